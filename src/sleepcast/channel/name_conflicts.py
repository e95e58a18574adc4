"""Names that two robots have, as one party hears them.

One process of a robot is one epoch of its name. One epoch after another is a restart; replayed messages of an earlier
one were issued before the later one began. Two robots have one name if their epochs interleave: the one that was heard
first says something that it issued after the first message of the other. Only verified messages that are in time count.

A desk compares all names that it hears. A robot compares its own: whoever says something under its name, in another
epoch, after the robot has begun. So that robots of one name hear each other, each says its names in a digest when it
begins, when it hears the other, time and again while the conflict lasts, and when a desk asks for it. To a desk a robot
tells of the others in its answers: a desk that has not heard them knows of them, too.

A conflict ends when all but one have been silent for `LASTS`. The rule is described in docs/wire.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import inf, isfinite
from random import Random
from re import fullmatch

import msgspec

from sleepcast.channel.fair_table import FairTable
from sleepcast.channel.message import INTRODUCE, MAX_NAME, NAMES, OTHERS, Kind, Message, is_addressed
from sleepcast.core.errors import listed, printable

LASTS = 30.0
"""Seconds of silence after which a robot does not hold its name any more: a conflict is over."""
UNDECIDED_FOR = 1.0
"""Seconds after the first message of a new epoch within which the robot of the one before, if it is there, answers a
desk; else it counts as restarted."""
UNDECIDED_LONGER = 4.0
"""The same where that robot has said something, which proves nothing as its clock is behind."""
PROBES = (0.0, 0.3, 0.7, 1.5, 2.5, 3.5)
"""Seconds after that first message at which a desk asks both, as long as it is undecided."""
SPEAK_EVERY = 6.0
"""Seconds between two digests with our names while another robot has one of them: some of five arrive in `LASTS`."""
SPEAK_FIRST = 0.4
"""Seconds after our start by which our names have been said."""
SPEAK_SOON = 0.05
"""Seconds over which the answers to such a digest are spread."""
LEAST_PAUSE = 1.0
"""Seconds between two of them at least, whoever asks."""
ON_THE_WAY = 3.0
"""Seconds that a message may have been on its way, besides the difference of clocks, and still shows that its sender is
there: a replayed one does not."""
MAX_HOLDERS = 4
"""Robots of one name that are told apart; of more, those that were heard last."""
MAX_NAMES = 100_000
"""Names that a desk compares; beyond, the key with the most of them loses the one that it knows longest, which is
compared again when it is heard."""
MAX_SPOKEN = 10_000
"""Names in one digest: as many as robots in a process."""
SHOWN = 3
"""Names in a sentence."""


class Holder(msgspec.Struct):
    """A robot that has a name.

    epoch: its life
    address: where its messages come from, "" if unknown
    issued: time of the first message that counts, by its clock
    since: when that was heard, s
    heard: when it was last heard, s
    contested: whether another robot was seen to have the name as well
    """

    epoch: int
    address: str
    issued: float
    since: float
    heard: float
    contested: bool = False

    def __str__(self) -> str:
        return f"one at {self.address} (epoch {self.epoch})" if self.address else f"one with epoch {self.epoch}"


class NameConflicts:
    """One party's comparison.

    chance: for the moments of digests
    skew: allowed difference of clocks, s
    own: names of our robots, with their epochs; empty for a desk, which compares all names

    All times are s of Unix time, by our clock unless another is named.
    """

    def __init__(self, chance: Random, skew: float) -> None:
        self.own: dict[str, int] = {}
        self._chance, self._fresh = chance, skew + ON_THE_WAY
        self._began = inf
        self._holders = FairTable[str, list[Holder], str](MAX_NAMES, lost=lambda key, name: self._forget(name))
        self._shared: dict[str, list[Holder]] = {}
        """Those of names that more than one robot has or had within `LASTS`."""
        self._changed: dict[str, None] = {}
        self._probed: dict[str, int] = {}
        self._speak_at, self._spoke = inf, -inf

    # ---- who we are

    def hold(self, own: Mapping[str, int]) -> None:
        """We are robots with these names and epochs."""
        self.own = dict(own)

    def begin(self, now: float) -> None:
        """Our robots begin to listen, or their clock has been set: what was issued before is of earlier lives."""
        self._began = now
        self._holders.clear()
        self._shared.clear()
        self._speak_at = now + SPEAK_FIRST

    # ---- what is heard

    def hear(
        self, message: Message, now: float, address: str = "", owns: Callable[[str], bool] = lambda name: True
    ) -> None:
        """Compare a robot's verified message, unless it was long on its way. owns: whether a name is one of its key's
        owner."""
        sender, body = message.sender, message.body
        if now - message.issued > self._fresh:
            return
        if self.own:
            if sender in self.own:
                self._take(sender, message.epoch, message.issued, now, address, message.key)
        elif message.kind not in (Kind.DIGEST, Kind.REQUEST):  # those may be of a receiver, which is no robot
            self._take(sender, message.epoch, message.issued, now, address, message.key)
            if OTHERS in body:
                for epoch, heard in _others(body[OTHERS], now):
                    self._hear_of(sender, message.epoch, epoch, heard, now, message.key)
        if message.kind is Kind.DIGEST and NAMES in body:
            for name, epoch in _spoken(body[NAMES]):
                if owns(name) and (not self.own or name in self.own):
                    self._take(name, epoch, message.issued, now, address, message.key)

    def ask(self, question: Message, now: float) -> None:
        """A desk asks some of us to say our names."""
        if question.body.get(INTRODUCE) is True and any(is_addressed(question.body, name) for name in self.own):
            self._speak(now, LEAST_PAUSE)

    def _take(self, name: str, epoch: int, issued: float, now: float, address: str, key: str) -> None:
        if name in self.own:
            self._take_own(name, epoch, issued, now, address)
            return
        holders = self._known(name, now, key)
        for heard in holders:
            if heard.epoch == epoch:
                break
        else:
            self._add(name, holders, Holder(epoch, address, issued, now, now))
            return
        heard.heard, heard.address = now, address or heard.address
        if len(holders) > 1:
            number = holders.index(heard)
            if any(before.issued >= heard.issued for before in holders[:number]):
                heard.issued = issued  # what it said until now was issued too early to prove anything
            for after in holders[number + 1 :]:
                if heard.issued < after.issued < issued:
                    self._contest(name, heard, after)

    def _take_own(self, name: str, epoch: int, issued: float, now: float, address: str) -> None:
        """Another robot speaks under our name, unless this is of our life before."""
        own = self.own[name]
        if epoch == own or issued <= self._began:
            return
        holders = self._known(name, now, "")
        if not holders:
            holders.append(Holder(own, "", self._began, self._began, inf))
        heard = next((each for each in holders if each.epoch == epoch), None)
        if heard is None:
            heard = Holder(epoch, address, issued, now, now)
            self._add(name, holders, heard)
        heard.heard, heard.address = now, address or heard.address
        self._contest(name, holders[0], heard)
        self._speak(now, SPEAK_EVERY)

    def _hear_of(self, name: str, by: int, epoch: int, heard: float, now: float, key: str) -> None:
        """A robot says when it last heard another one under its name."""
        holders = self._known(name, now, key)
        teller = next((each for each in holders if each.epoch == by), None)
        if teller is None or epoch == by:
            return
        other = next((each for each in holders if each.epoch == epoch), None)
        if other is None:
            other = Holder(epoch, "", inf, now, heard)
            self._add(name, holders, other)
        other.heard = max(other.heard, heard)
        self._contest(name, teller, other)

    def _known(self, name: str, now: float, key: str) -> list[Holder]:
        """The robots that have this name, but for those that have long been silent. key: who speaks under it."""
        holders = self._holders.get(name)
        if holders is None:
            holders = []
            self._holders.put(key, name, holders)
        else:
            for each in holders:
                if now - each.heard > LASTS:
                    self._retire(name, holders, now)
                    break
        return holders

    def _add(self, name: str, holders: list[Holder], new: Holder) -> None:
        holders.append(new)
        if len(holders) > MAX_HOLDERS:
            holders.remove(min(holders[:-1], key=lambda each: each.heard))
        if len(holders) > 1:
            self._shared[name] = holders
            self._changed[name] = None
            self._probed[name] = 0

    def _contest(self, name: str, one: Holder, other: Holder) -> None:
        if not (one.contested and other.contested):
            one.contested = other.contested = True
            self._changed[name] = None

    def _retire(self, name: str, holders: list[Holder], now: float) -> None:
        """Leave out those that have long been silent. The last one alone has its name without conflict."""
        holders[:] = [each for each in holders if now - each.heard <= LASTS]
        if len(holders) < 2 and name in self._shared:
            for each in holders:
                each.contested = False
            del self._shared[name]
            self._probed.pop(name, None)
            self._changed[name] = None

    def _forget(self, name: str) -> None:
        self._shared.pop(name, None)
        self._probed.pop(name, None)

    # ---- what is so

    def holders(self, name: str, now: float) -> Sequence[Holder]:
        """The robots that have a name, in the order in which they were first heard, if there may be several; else
        none."""
        holders = self._shared.get(name)
        if holders is None:
            return ()
        if now - min(each.heard for each in holders) > LASTS:
            self._retire(name, holders, now)
        return tuple(holders) if len(holders) > 1 else ()

    def contested(self, now: float) -> dict[str, tuple[Holder, ...]]:
        """The robots of each name that several have."""
        contested = {
            name: tuple(each for each in self.holders(name, now) if each.contested) for name in tuple(self._shared)
        }
        return {name: holders for name, holders in contested.items() if holders}

    def is_undecided(self, name: str, now: float) -> bool:
        """Whether a name has a new epoch of which is not known yet whether it is a restart."""
        holders = self.holders(name, now)
        return any(
            not (before.contested and after.contested)
            and now - after.since < (UNDECIDED_LONGER if before.heard > after.since else UNDECIDED_FOR)
            for number, after in enumerate(holders)
            for before in holders[:number]
        )

    def undecided(self, now: float) -> list[str]:
        """All such names."""
        return [name for name in tuple(self._shared) if self.is_undecided(name, now)]

    def changed(self, now: float) -> list[str]:
        """The names whose robots have changed since the last call, and those that are undecided."""
        undecided = self.undecided(now)
        names = dict.fromkeys((*self._changed, *undecided, *self._probed))
        self._changed.clear()
        for name in [name for name in self._probed if name not in undecided]:
            del self._probed[name]
        return list(names)

    def to_probe(self, now: float) -> list[str]:
        """Undecided names whose robots are to be asked now."""
        due = []
        for name in self.undecided(now):
            asked, since = self._probed.get(name, 0), self._shared[name][-1].since
            if asked < len(PROBES) and now - since >= PROBES[asked]:
                self._probed[name] = asked + 1
                due.append(name)
        return due

    def of_own(self, now: float) -> list[str]:
        """What a robot's terminal says: which of our names others have as well."""
        others = {
            name: [each for each in holders if each.epoch != self.own[name]]
            for name, holders in self.contested(now).items()
        }
        return [
            f"{'another robot has our name' if len(names) == 1 else f'other robots have {len(names)} of our names:'} "
            f"{printable(listed(names, SHOWN))}, {where}: commands reach both, and no desk takes the answer of one for "
            "both"
            for names, where in _alike(others)
        ]

    def others(self, name: str, now: float) -> list[list[float]]:
        """What our robot of this name tells a desk of others that have its name: epochs, and the seconds since each was
        heard."""
        holders = self.holders(name, now) if self._shared else ()
        return [[each.epoch, now - each.heard] for each in holders if each.contested and each.epoch != self.own[name]]

    # ---- saying our names

    def due(self) -> float:
        """When to call `introduction`, s."""
        return self._speak_at

    def introduction(self, now: float) -> dict[str, object]:
        """What a digest of now says of our names, as fields of its body: nothing, unless that is due."""
        if self._speak_at == inf or not self.own:
            self._speak_at = inf
            return {}
        self._spoke, self._speak_at = now, now + SPEAK_EVERY if self.contested(now) else inf
        return {NAMES: _ranges(self.own)}

    def _speak(self, now: float, pause: float) -> None:
        soon = now + SPEAK_SOON * (1.0 + self._chance.random())
        self._speak_at = min(self._speak_at, max(soon, self._spoke + pause))


def sentences(contested: Mapping[str, Sequence[Holder]]) -> list[str]:
    """What a desk says of names that several robots have."""
    return [
        f"{len(contested[names[0]])} robots have {'the name' if len(names) == 1 else f'each of {len(names)} names:'} "
        f"{printable(listed(names, SHOWN))}, {where}"
        for names, where in _alike(contested)
    ]


def _alike(holders_of: Mapping[str, Sequence[Holder]]) -> Iterator[tuple[list[str], str]]:
    """The names whose robots are in the same places, and where that is; a single name with the epochs."""
    places: dict[tuple[int, tuple[str, ...]], list[str]] = {}
    for name, holders in holders_of.items():
        places.setdefault((len(holders), tuple(sorted(each.address for each in holders))), []).append(name)
    for (_, addresses), names in places.items():
        if len(names) == 1:
            yield names, ", ".join(map(str, sorted(holders_of[names[0]], key=lambda each: each.epoch)))
        else:
            yield names, ", ".join(f"one at {address or 'an unknown address'}" for address in addresses)


# ---- fields of bodies


def _others(listed: object, now: float) -> Iterator[tuple[int, float]]:
    """The other robots of its name that a robot tells of: epochs, and when each was heard; malformed ones are left
    out."""
    for each in listed[:MAX_HOLDERS] if isinstance(listed, list) else ():
        match each:
            case [int() as epoch, (int() | float()) as ago] if epoch >= 0 and isfinite(ago) and 0.0 <= ago <= LASTS:
                yield epoch, now - ago


def _ranges(own: Mapping[str, int]) -> list[list[object]]:
    """Names with their epochs, numbered ones that follow each other as one: [beginning, first number, how many, epoch];
    others as [name, epoch]."""
    ranges: list[list[object]] = []
    last: tuple[str, int, int] | None = None
    for name, epoch in own.items():
        numbered = fullmatch(r"(.*?)(0|[1-9][0-9]{0,8})", name)
        if numbered is None:
            ranges.append([name, epoch])
            last = None
            continue
        beginning, number = numbered[1], int(numbered[2])
        if last == (beginning, number - 1, epoch):
            ranges[-1][2] = int(str(ranges[-1][2])) + 1
        else:
            ranges.append([beginning, number, 1, epoch])
        last = beginning, number, epoch
    return ranges


def _spoken(listed: object) -> Iterator[tuple[str, int]]:
    """The names and epochs in a digest; malformed ones are left out."""
    left = MAX_SPOKEN
    for each in listed if isinstance(listed, list) else ():
        match each:
            case [str() as name, int() as epoch] if 0 < len(name) <= MAX_NAME and left > 0:
                left -= 1
                yield name, epoch
            case [str() as beginning, int() as first, int() as many, int() as epoch] if 0 <= first < 10**9:
                many = min(many, left)
                left -= max(0, many)
                names = (f"{beginning}{number}" for number in range(first, first + many))
                yield from ((name, epoch) for name in names if len(name) <= MAX_NAME)
