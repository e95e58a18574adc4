"""Which standing commands of a desk's own stream still count (`channel.baselines`): a proposal by their texts.

What a command does is kept apart by name: the text of a rule, a buffer, an operator or a group, and the flag of a
rule. A command is dropped only if each of these was wholly replaced by a later one that is kept, and no kept command
needs it: a command needs what the names in it meant when it was sent. Whatever is not understood here is kept, and
needs all that it names. Of each rule the first command that made it is kept as well, since rules are evaluated in that
order, and what forgets a name is kept for those who have learned it. So a robot that was away after any command ends
like the others.

Whether a robot has refused a command cannot be seen from texts: `sleepcast baseline` evaluates them all, and compares
minds before it sends anything.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import field
from itertools import islice
from typing import TYPE_CHECKING, NamedTuple

from sleepcast.channel import Kind, Message
from sleepcast.channel.baselines import MAX_ONLY
from sleepcast.channel.message import KEYS, ONLY, WITHIN
from sleepcast.core.errors import SleepcastError
from sleepcast.core.records import dataclass
from sleepcast.language import Form, List, Symbol
from sleepcast.language.reader import QUOTE, ReadError, read, walk
from sleepcast.language.vocabulary import buffer_number, rule_key

if TYPE_CHECKING:
    from sleepcast.station.network import NetworkStation
    from sleepcast.station.sent import Command

BASELINE_TEXT = "1"
"""The text of a command that only says which before it still count: a number, which does nothing."""
FLAG = "flag "
"""Before the key of a rule or buffer, the name of its flag."""
_TEXT_MAKERS = {"rule": "rule", "setqq": "buffer", "defun": "operator", "area": "operator"}


class TooManyError(SleepcastError):
    """More commands still count than one message can name."""


@dataclass(slots=True)
class Deed:
    """What a command does, by its text.

    sets: names that it wholly replaces, with the kind of thing that they become, "" for none
    makes: those of them that it makes
    forgets: those that it removes
    changes: names that it may change in part
    needs: names whose meaning it depends on
    certain: whether that is all
    all: whether it depends on everything before it
    """

    sets: dict[str, str] = field(default_factory=dict)
    changes: set[str] = field(default_factory=set)
    needs: set[str] = field(default_factory=set)
    makes: set[str] = field(default_factory=set)
    forgets: set[str] = field(default_factory=set)
    certain: bool = True
    all: bool = False


def deed_of(message: Message, *, refused: bool = False) -> Deed:
    """What a standing command does; one that is for some robots only, or was refused, or is not understood, may do
    anything to what it names."""
    if KEYS in message.body:
        return Deed(certain=False)
    try:
        form = read(message.text)
    except ReadError:
        return Deed(certain=False)
    deed = Deed()
    plain = not refused and message.body.keys() <= {*message.link.written(), WITHIN, ONLY}
    for part in _parts(form):
        if not (plain and _understood(part, deed)):
            _doubt(part, deed)
    return deed


def _parts(form: Form) -> Iterator[Form]:
    """What is evaluated one after the other, whatever the robot."""
    if isinstance(form, List) and form.head == "progn":
        for item in form.items[1:]:
            yield from _parts(item)
    else:
        yield form


def _understood(form: Form, deed: Deed) -> bool:
    """Take in a form that does the same on all robots; returns whether it is one."""
    if not isinstance(form, List) or len(form.items) < 2 or not isinstance(form.items[1], Symbol):
        return False
    head, key, rest = form.head or "", rule_key(form.items[1].key), form.items[2:]
    if head == "setq" and len(rest) == 1 and buffer_number(form.items[1].key):
        if not (isinstance(rest[0], List) and rest[0].head == QUOTE):
            return False
        head = "setqq"
    if head in _TEXT_MAKERS:
        deed.sets[key] = _TEXT_MAKERS[head]
        deed.makes.add(key)
        named = {rule_key(each.key) for inside in rest for each in walk(inside) if isinstance(each, Symbol)}
        deed.needs |= named - {key}
        if head == "rule":
            deed.sets[FLAG + key] = ""
    elif head == "forget":
        deed.sets |= {key: "", FLAG + key: ""}
        deed.forgets.add(key)
    elif head in ("activate", "deactivate"):
        deed.sets[FLAG + key] = ""
        deed.needs.add(key)
    elif head in ("join", "leave"):
        deed.sets[key] = "group"
        deed.makes |= {key} if head == "join" else set()
    else:
        return False
    return True


def _doubt(form: Form, deed: Deed) -> None:
    """Take in a form that may do anything to what it names."""
    names = {rule_key(each.key) for each in walk(form) if isinstance(each, Symbol)}
    deed.certain = False
    deed.changes |= {each for name in names for each in (name, FLAG + name)}
    deed.needs |= names
    deed.all |= "rollback" in names


class BaselineProposal(NamedTuple):
    """kept: numbers of the standing commands that a newcomer needs; touched: the keys of all names that any command may
    change."""

    kept: list[int]
    touched: frozenset[str]


def propose(messages: Mapping[int, Message | None], refused: Collection[int] = ()) -> BaselineProposal:
    """Which of a stream's standing commands still count.

    messages: by number; None for one that is not stored here any more, of which nothing is known, so that it is kept
        with all before it
    refused: numbers of those that robots did not obey
    """
    return _Slice(messages, refused).proposal()


class _Slice:
    """Which commands are kept: those that the final meaning of each name needs, and those that these need."""

    def __init__(self, messages: Mapping[int, Message | None], refused: Collection[int]) -> None:
        self._numbers = sorted(messages)
        self._deeds = [_stored_deed(messages[number], number in refused) for number in self._numbers]
        self._widen()
        self._touching: dict[str, list[int]] = defaultdict(list)
        """By name, the indices of the commands that may change it."""
        kinds: dict[str, set[str]] = defaultdict(set)
        for index, deed in enumerate(self._deeds):
            for key in {*deed.sets, *deed.changes}:
                self._touching[key].append(index)
            for key, kind in deed.sets.items():
                kinds[key] |= {kind} - {""}
        self._unsure = {key for key, each in kinds.items() if len(each) > 1}
        """Names of several kinds of things, of which a robot refuses one; and those that may have changed in part."""
        self._unsure |= {key for deed in self._deeds for key in deed.changes}
        self._kept: set[int] = set()
        self._waiting: list[int] = []

    def _widen(self) -> None:
        """A command that is not understood may also change whatever is named by what it names."""
        inside: dict[str, set[str]] = defaultdict(set)
        for deed in self._deeds:
            for key in deed.sets:
                inside[key] |= deed.needs
        for deed in self._deeds:
            waiting = set() if deed.certain else set(deed.needs)
            while waiting:
                named = inside.get(waiting.pop(), set()) - deed.needs
                deed.needs |= named
                deed.changes |= {each for name in named for each in (name, FLAG + name)}
                waiting |= named

    def proposal(self) -> BaselineProposal:
        for index, deed in enumerate(self._deeds):
            if not deed.certain:
                self._keep(index)
        for key in list(self._touching):
            self._need(key, len(self._numbers))
        while self._waiting:
            index = self._waiting.pop()
            deed = self._deeds[index]
            for before in range(index if deed.all else 0):
                self._keep(before)
            for name in deed.needs:
                self._need(name, index)
                if not deed.certain:
                    self._need(FLAG + name, index)
        touched = frozenset(key.removeprefix(FLAG) for key in self._touching)
        return BaselineProposal([self._numbers[index] for index in sorted(self._kept)], touched)

    def _keep(self, index: int) -> None:
        if index not in self._kept:
            self._kept.add(index)
            self._waiting.append(index)

    def _need(self, key: str, before: int) -> None:
        """Keep what gives a name its meaning before a command: the latest that sets it, what forgot it before, and what
        made it first after that."""
        touching = self._touching.get(key, [])
        touching = touching[: bisect_left(touching, before)]
        if key in self._unsure:
            needed = touching
        elif key.startswith(FLAG):
            needed = touching[-1:]
        else:
            forgot = max((at for at, index in enumerate(touching) if key in self._deeds[index].forgets), default=-1)
            made = (index for index in touching[forgot + 1 :] if key in self._deeds[index].makes)
            needed = [*touching[max(forgot, 0) : forgot + 1], *islice(made, 1), *touching[-1:]]
        for index in needed:
            self._keep(index)


def is_baseline(message: Message | None) -> bool:
    """Whether a command does nothing but say which before it still count: the next one says that anew."""
    return message is not None and ONLY in message.body and message.text == BASELINE_TEXT


def _stored_deed(message: Message | None, refused: bool) -> Deed:
    if message is None:
        return Deed(certain=False, all=True)
    if is_baseline(message):
        return Deed()
    return deed_of(message, refused=refused)


def post_baseline(station: NetworkStation, numbers: Sequence[int]) -> Command:
    """Tell all parties that of our standing commands only these still count. Raises TooManyError, and RoleError
    for a key that is no commander's."""
    if len(numbers) > MAX_ONLY:
        raise TooManyError(
            f"{len(numbers):,} standing commands still count, and one message names {MAX_ONLY:,} at most"
        )
    return station.post(Kind.COMMAND, text=BASELINE_TEXT, body={ONLY: list(numbers)}, standing=True)
