"""A table in which nobody can take the room of others.

What comes from the air is kept in tables of bounded size. Where the entry that was used longest ago simply gives way,
whoever may send anything can push out what others need: sixty digests, questions or epochs are quickly invented. Here
each entry has an owner, usually the key that signed it, and a full table takes one more at the expense of the owner
that has the most: whoever makes many entries loses their own.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Mapping
from itertools import count
from typing import Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")
Owner = TypeVar("Owner", bound=Hashable)


class FairTable(Generic[Key, Value, Owner]):
    """At most `most` entries, and at most `each` of one owner. An entry that gives way is the one of its owner that was
    used longest ago. lasting: entries of which this is true give way only where there are no others. lost: called with
    the owner and the key of each entry that gives way."""

    def __init__(
        self,
        most: int,
        *,
        each: int | None = None,
        lasting: Callable[[Value], bool] | None = None,
        lost: Callable[[Owner, Key], object] = lambda owner, key: None,
    ) -> None:
        self._most, self._each, self._lasting, self._lost = most, most if each is None else each, lasting, lost
        self._entries: dict[Key, tuple[Owner, Value]] = {}
        self._of: dict[Owner, OrderedDict[Key, int]] = {}
        """The keys of each owner, the one used longest ago first, with the moment of its last use."""
        self._moments = count()

    def __len__(self) -> int:
        return len(self._entries)

    def __contains__(self, key: Key) -> bool:
        return key in self._entries

    def __iter__(self) -> Iterator[Key]:
        return iter(self._entries)

    def get(self, key: Key) -> Value | None:
        """The value of a key, None if there is none; this is no use."""
        entry = self._entries.get(key)
        return None if entry is None else entry[1]

    def values(self) -> Iterator[Value]:
        """All values, in the order in which they came."""
        return (value for _, value in self._entries.values())

    def items(self) -> Iterator[tuple[Key, Value]]:
        """All keys and values, in the order in which they came."""
        return ((key, value) for key, (_, value) in self._entries.items())

    def put(self, owner: Owner, key: Key, value: Value) -> None:
        """Store a value, in place of one with the same key; if there is no room, another entry gives way."""
        before = self._entries.get(key)
        if before is not None and before[0] != owner:
            self.pop(key)
            before = None
        self._entries[key] = owner, value
        self._use(owner, key)
        if before is not None:  # as many as there were
            return
        if len(self._of[owner]) > self._each:
            self._drop(owner, key)
        elif len(self._entries) > self._most:
            self._drop(self._greediest(key), key)

    def use(self, key: Key) -> None:
        """An entry was used: it is now the last of its owner's to give way."""
        self._use(self._entries[key][0], key)

    def _use(self, owner: Owner, key: Key) -> None:
        of = self._of.get(owner)
        if of is None:
            of = self._of[owner] = OrderedDict()
        of[key] = next(self._moments)
        of.move_to_end(key)

    def pop(self, key: Key) -> Value | None:
        """Remove an entry, and return its value; None if there is none."""
        entry = self._entries.pop(key, None)
        if entry is None:
            return None
        owner, value = entry
        del self._of[owner][key]
        if not self._of[owner]:
            del self._of[owner]
        return value

    def clear(self) -> None:
        """Remove everything."""
        self._entries.clear()
        self._of.clear()

    def _drop(self, owner: Owner, new: Key) -> None:
        """Let the entry of this owner give way that was used longest ago, but not the one that has just come."""
        keys = (key for key in self._of[owner] if key != new)
        brief = (key for key in self._of[owner] if key != new and not self._lasts(key))
        gone = next(brief if self._lasting else keys, None)
        gone = next(keys) if gone is None else gone
        self.pop(gone)
        self._lost(owner, gone)

    def _greediest(self, new: Key) -> Owner:
        """The owner whose entry gives way: who has the most; among several, whose entry was used longest ago."""
        of: dict[Owner, Mapping[Key, int]] = {}
        if self._lasting:  # entries that do not last go first, without the one that has just come
            for owner, keys in self._of.items():
                if brief := {key: moment for key, moment in keys.items() if key != new and not self._lasts(key)}:
                    of[owner] = brief
        of = of or {owner: keys for owner, keys in self._of.items() if len(keys) > 1 or new not in keys}
        return max(of, key=lambda owner: (len(of[owner]), -next(iter(of[owner].values()))))

    def _lasts(self, key: Key) -> bool:
        return self._lasting is not None and self._lasting(self._entries[key][1])
