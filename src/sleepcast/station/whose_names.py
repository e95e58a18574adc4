"""Whose names decide what a text means to robots on the air.

A desk knows names of robots that are there, and of others that were heard once and may have left, or be different ones
by now. All of them are known names; but only robots that are there can make a text wrong, and of these only those that
it is for. What else is known informs.

A text is checked in all names that were ever heard, as a rule with nothing to find. If robots' names make it wrong, it
is checked again in those of the robots that it is for and that are there; for a sender who insists, in those of nobody.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from copy import copy, deepcopy
from dataclasses import replace

from sleepcast.channel.message import natural_order
from sleepcast.core.errors import listed, printable
from sleepcast.core.model import Constant, HostFunction
from sleepcast.language import Checked, check
from sleepcast.language.functions import (
    ABOUT_NEIGHBOURS,
    AUCTIONS,
    BODY_WORDS,
    CHOOSING,
    FUNCTIONS,
    INSTANTS,
    MANY,
    NEIGHBOURS,
    TIMED,
)
from sleepcast.language.reader import List, Symbol, read, walk
from sleepcast.language.symbols import Declared
from sleepcast.language.vocabulary import NEW_FORMS, Binding, Variable, Vocabulary
from sleepcast.station.remote import RemoteMind, RemoteMinds
from sleepcast.station.schema_merge import merge_schemas

FEW = 3
"""Robots in a sentence."""
WITHOUT_THESE = "send this by name to robots that know it (--only), or update these first"
"""What to do about robots that would refuse a text with a new form."""
OTHERS_ONLY = "send this by name to robots that have it (--only): no update gives it to other bodies"
"""The same of a function of some bodies."""
_WORDS = sorted({*NEW_FORMS, *ABOUT_NEIGHBOURS, *BODY_WORDS, *AUCTIONS, *INSTANTS})
NEW_WORDS = re.compile(rf"(?<![\w-])({'|'.join(map(re.escape, _WORDS))})(?![\w-])", re.I)
"""What a text has in it that has a new form; so may others."""


class NamesOfSome:
    """The names of some robots only (a `Names` for the checker), in the slots of the whole fleet's vocabulary. hearsay:
    which kinds of names count besides that only others have: their functions then take whatever they are given."""

    def __init__(self, minds: RemoteMinds, robots: Iterable[str], hearsay: Sequence[type] = ()) -> None:
        self._minds: dict[tuple[bytes, frozenset[str], frozenset[str]], RemoteMind] = {}
        """One of all that have learned the same."""
        types = dict.fromkeys(kind for name in robots if (kind := minds.type_of(name)) in minds.types)
        for name in robots:
            if (mind := minds.get(name)) is not None:
                self._minds.setdefault((mind.telemetry.mind, mind.groups, frozenset(mind.telemetry.user)), mind)
        self._all = minds
        some = merge_schemas({each: minds.types[each] for each in types if each})[0]
        self.vocabulary = _restricted(minds.vocabulary, some, tuple(hearsay))

    def declared(self, key: str) -> Declared | None:
        """What the first of them that knows `key` has learned under it."""
        return next((known for mind in self._minds.values() if (known := mind.known(key)) is not None), None)

    def heard(self) -> Iterable[str]:
        """Every name that any robot has learned: suggestions inform."""
        return self._all.heard()


def _restricted(whole: Vocabulary, some: Vocabulary, hearsay: tuple[type, ...]) -> Vocabulary:
    """The vocabulary of some robots, whose variables have the slots that they have in the whole fleet's."""
    restricted = copy(whole)
    restricted.user_slots = dict(whole.user_slots)
    restricted.bindings = {
        key: _lenient(binding) for key, binding in whole.bindings.items() if isinstance(binding, hearsay)
    }
    for key, binding in some.bindings.items():
        if isinstance(binding, Variable):
            place = whole.bindings.get(key)
            if not isinstance(place, Variable):  # another type has something else there, so that there is no slot
                restricted.bindings.pop(key, None)
                continue
            binding = replace(binding, slot=place.slot)
        restricted.bindings[key] = binding
    return restricted


def _lenient(binding: Binding) -> Binding:
    """A function that takes whatever it is given; all else as it is."""
    if not isinstance(binding, HostFunction):
        return binding
    return replace(binding, dimensions=(None,) * MANY, least=0, arguments="...")


HEARSAY: tuple[Sequence[type], ...] = ((HostFunction, Variable, Constant), (HostFunction,), ())
"""What of the names of others counts besides: as much as makes nothing wrong."""


def check_for(whole: Checked, minds: RemoteMinds, robots: Sequence[str], *, anyway: bool = False) -> Checked:
    """Check a text for robots that are there, if it is wrong in all names that were ever heard.

    whole: what the checker says in those
    anyway: its sender insists, so robots' names refuse nothing
    """
    text = whole.text
    checked = check(text, NamesOfSome(minds, robots))
    bare = check(text, NamesOfSome(minds, ())) if checked.errors else checked
    if bare.errors:
        return checked  # no robot could run it, whatever its names
    if checked.errors and not anyway:
        return replace(checked, by=f"This is so by the names of {_whose(text, minds, robots)}")
    present = () if checked.errors else robots
    tries = (check(text, NamesOfSome(minds, present, hearsay)) for hearsay in HEARSAY)
    return _informed(next((each for each in tries if not each.errors), bare), whole, minds, set(present))


def refuse_forms(checked: Checked, minds: RemoteMinds, robots: Sequence[str]) -> Checked:
    """The same text, wrong if it has a new form, or a new part of one (`NEW_FORMS`), that some of these robots do not
    say they know: they would refuse what others obey, whatever its sender says."""
    found = deepcopy(checked.found)  # what was checked is kept for others, too
    for form, known_as in _new_forms(checked, minds):
        types: dict[bytes, list[str]] = {}
        for name in sorted(robots, key=natural_order):
            kind = minds.type_of(name)
            if kind in minds.types and not _knows(minds.types[kind], known_as):
                types.setdefault(kind, []).append(name)
        if types:
            whose = " and ".join(_named(minds.types[kind], names) for kind, names in types.items())
            message = (
                f"{form.text} @@ is not known to {whose}: {OTHERS_ONLY if known_as in BODY_WORDS else WITHOUT_THESE}"
            )
            found.note("error", message, form.start, form.end)
    return checked if found.counts == checked.counts else replace(checked, found=found, program=None)


def _knows(vocabulary: Vocabulary, known_as: str) -> bool:
    """Whether robots with this vocabulary say that they know a form."""
    return known_as in (vocabulary.bindings if known_as in BODY_WORDS else vocabulary.forms)


def _new_forms(checked: Checked, minds: RemoteMinds) -> Iterator[tuple[Symbol, str]]:
    """What a text has of new forms, each with the name under which robots say that they know it."""
    own = {name.casefold() for name in minds.heard()}
    around = False
    for form in walk(read(checked.text)):
        if not isinstance(form, List) or form.head is None:
            continue
        head = form.items[0]
        if form.head in ABOUT_NEIGHBOURS and form.head not in own and not around and isinstance(head, Symbol):
            around = True
            yield head, NEIGHBOURS
        if form.head in BODY_WORDS and form.head not in own and isinstance(head, Symbol):
            yield head, form.head
        if form.head in AUCTIONS and form.head not in own and isinstance(head, Symbol):
            yield head, CHOOSING
        if form.head in INSTANTS and form.head not in own and isinstance(head, Symbol):
            yield head, TIMED
        for item in form.items[2:] if form.head in FUNCTIONS else ():
            if isinstance(item, Symbol) and item.key in NEW_FORMS:
                yield item, item.key


def _informed(checked: Checked, whole: Checked, minds: RemoteMinds, present: set[str]) -> Checked:
    """What is right for those who decide, with a warning of what others' names say to it."""
    whose = _whose(whole.text, minds, [name for name in minds.known if name not in present])
    kept = checked.found.kept
    for at, finding in enumerate(kept):
        if finding.unknown and finding.unknown not in whole.unknown:  # somebody has it, so it is no slip
            kept[at] = replace(finding, unknown="", confirm=False)
    for error in whole.errors:
        checked.found.note("warning", f"{error.message}, by the names of {whose}", error.start, error.end)
    return replace(checked, by=whose)


def _whose(text: str, minds: RemoteMinds, robots: Sequence[str]) -> str:
    """The types, and some of the robots, of those whose names alone make a text wrong; of all, if none do alone."""
    types: dict[bytes, list[str]] = {}
    for name in sorted(robots, key=natural_order):
        types.setdefault(minds.type_of(name) or b"", []).append(name)
    guilty = {key: names for key, names in types.items() if check(text, NamesOfSome(minds, names)).errors} or types
    return " and ".join(_named(minds.types.get(key), names) for key, names in guilty.items())


def _named(vocabulary: Vocabulary | None, names: Sequence[str]) -> str:
    kind = "" if vocabulary is None else vocabulary.name
    some = listed(names, FEW)
    return printable(f"{kind} ({some})" if kind else some)
