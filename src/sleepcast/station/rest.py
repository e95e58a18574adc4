"""Coming to rest: which of the robots that have accepted a STOP stand by now, and how far the others may still go.

A robot that accepts STOP brakes, which takes its time. It tells how it moves in its answer, and again whenever it tells
of itself while it is stopped; a desk on the air asks those that still moved until they are at rest (`RestWatch`). One
that tells nothing of it (of version 0.2.0, a small computer, a body that does not measure its speed) has accepted, and
nobody knows more.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import inf, isnan, nan

import msgspec
import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message import MOTION, TELEMETRY, Message, natural_order
from sleepcast.channel.message_batch import NameIndex
from sleepcast.core.errors import and_more, printable
from sleepcast.core.model import RestState
from sleepcast.core.serial import Array, SerialError
from sleepcast.core.units import UNITS, value_in_words
from sleepcast.language.vocabulary import Vocabulary, unit_of
from sleepcast.mind.telemetry import read_motion
from sleepcast.station.roster import Index, Seconds, longer
from sleepcast.station.serialized import RestStatesState

Mask = NDArray[np.bool_]
DIGITS = 3
"""Of speeds and distances in sentences: they change while they are read."""
SMALLER = {"mi": "ft", "nmi": "m", "km": "m"}
"""Units of less than a tenth of these."""


def motion_said(message: Message) -> RestState | None:
    """How its stopped body moves, by what a robot says of a STOP or of itself; None if it does not say."""
    told = message.body.get(TELEMETRY)
    if isinstance(told, dict):
        return read_motion(told.get(MOTION)) if told.get("stopped") is True else None
    return read_motion(message.body.get(MOTION))


class RestStates:
    """What robots told last of how they move since a STOP, as columns by their places on the roster."""

    def __init__(self, names: NameIndex) -> None:
        self.names = names
        self._told: Mask = np.zeros(0, np.bool_)
        self._speed: Seconds = np.empty(0)
        self._distance: Seconds = np.empty(0)
        self.version = 0
        """Counts what was told."""

    def add(self, robot: int, state: RestState) -> None:
        """What one robot tells."""
        self.take(np.array([robot]), np.array([state.speed]), np.array([state.distance]))

    def take(self, robots: Index, speeds: Seconds, distances: Seconds) -> None:
        """What many robots tell: see `RestState`."""
        self.version += 1
        length = len(self.names)
        self._told = longer(self._told, length)
        self._speed, self._distance = longer(self._speed, length), longer(self._distance, length)
        self._told[robots], self._speed[robots], self._distance[robots] = True, speeds, distances

    def forget(self) -> None:
        """Know nothing of it."""
        self._told, self._speed, self._distance = np.zeros(0, np.bool_), np.empty(0), np.empty(0)

    def among(self, accepted: Mask, shared: Sequence[int] = ()) -> RestAccount:
        """The account of those that have accepted the STOP, by place. shared: names that several robots have, of which
        nobody knows who told last."""
        length = max(len(accepted), len(self._told))
        known = longer(self._told, length) & longer(accepted, length)
        known[[place for place in shared if place < length]] = False
        speed, distance = longer(self._speed, length), longer(self._distance, length)
        rests, moves = known & (speed == 0.0), np.flatnonzero(known & (speed != 0.0))
        accepts = np.flatnonzero(longer(accepted, length) & ~known)
        return RestAccount(self.names, np.flatnonzero(rests), moves, speed[moves], distance[moves], accepts)

    def state(self) -> RestStatesState | None:
        """The columns, None if nobody has told anything."""
        if not self._told.any():
            return None
        return RestStatesState(Array.of(self._told), Array.of(self._speed), Array.of(self._distance))

    def restore(self, state: RestStatesState) -> None:
        """Know what was kept. Raises SerialError."""
        self._told = state.told.column(np.bool_, len(self.names), "who tells of coming to rest")
        shape = self._told.shape
        self._speed = state.speed.made(np.float64, shape, "speeds")
        self._distance = state.distance.made(np.float64, shape, "distances")
        if (self._speed < 0.0).any() or (self._distance < 0.0).any():
            raise SerialError("a robot with a speed or a distance below 0")


class RestAccount(msgspec.Struct, frozen=True, eq=False, dict=True):
    """Robots that have accepted a STOP, by their places: those at rest; those that still move, with their speeds (m/s)
    and how far they may still go (m; NaN for unknown); and those that do not tell."""

    names: NameIndex
    resting: Index
    moving: Index
    speeds: Seconds
    distances: Seconds
    untold: Index

    @cached_property
    def at_rest(self) -> tuple[str, ...]:
        return tuple(self.names[place] for place in self.resting.tolist())

    @cached_property
    def stopping(self) -> dict[str, RestState]:
        """How each robot moves that has not come to rest."""
        states = zip(self.speeds.tolist(), self.distances.tolist(), strict=True)
        return {self.names[place]: RestState(*state) for place, state in zip(self.moving.tolist(), states, strict=True)}

    @cached_property
    def accepted(self) -> tuple[str, ...]:
        """Those that do not tell whether they are at rest."""
        return tuple(self.names[place] for place in self.untold.tolist())

    @property
    def n_at_rest(self) -> int:
        return len(self.resting)

    @property
    def n_stopping(self) -> int:
        return len(self.moving)

    @property
    def n_accepted(self) -> int:
        return len(self.untold)

    def farthest(self, most: int) -> dict[str, RestState]:
        """Those that may go farthest, at most so many, unknown ones first."""
        order = np.argsort(-np.where(np.isnan(self.distances), inf, self.distances), kind="stable")[:most]
        soonest = [
            (self.names[int(self.moving[at])], float(self.speeds[at]), float(self.distances[at])) for at in order
        ]
        return {name: RestState(speed, distance) for name, speed, distance in sorted(soonest, key=_by_name)}

    def soonest(self, most: int) -> list[str]:
        """Those that may be at rest first, at most so many."""
        order = np.argsort(self._seconds, kind="stable")[:most]
        return [self.names[int(self.moving[at])] for at in order]

    @cached_property
    def _seconds(self) -> Seconds:
        """How long each takes until it is at rest, if it brakes evenly, s; 0 where nobody knows."""
        seconds: Seconds = np.nan_to_num(2.0 * self.distances / np.where(self.speeds > 0.0, self.speeds, nan))
        return seconds

    @property
    def next_at_rest(self) -> float:
        """Seconds until the first of them may be at rest; inf for none."""
        return float(self._seconds.min(initial=inf))

    def sentence(self, vocabulary: Vocabulary, most: int) -> str:
        """For a person: `at rest 60, still moving 2: r7 (12.6 kn, 33 m to go), r9 (...)`, with those that do not tell;
        at most so many by name. vocabulary: says in which units speeds and places are read."""
        parts = [f"at rest {self.n_at_rest:,}"] if self.n_at_rest else []
        if self.n_stopping:
            parts.append(f"still moving {self.n_stopping:,}: {self.who_moves(vocabulary, most)}")
        if self.n_accepted:
            parts.append(f"rest unknown {self.n_accepted:,}")
        return ", ".join(parts)

    def who_moves(self, vocabulary: Vocabulary, most: int) -> str:
        """Those that still move: the farthest ones by name, the others counted."""
        units = _units(vocabulary)
        named = self.farthest(most)
        sentences = [f"{name} ({state_in_words(state, *units)})" for name, state in named.items()]
        more = self.n_stopping - len(named)
        return printable(", ".join([*sentences, *and_more(more)]))


def state_in_words(state: RestState, speed_unit: str, length_unit: str) -> str:
    """`12.6 kn, 33 m to go` of one that still moves."""
    if isnan(state.speed):
        return "speed unknown"
    unit = SMALLER.get(length_unit, length_unit) if state.distance < 0.1 * UNITS[length_unit].factor else length_unit
    way = "" if isnan(state.distance) else f", {value_in_words(state.distance, unit, DIGITS)} to go"
    return f"{value_in_words(state.speed, speed_unit, DIGITS)}{way}"


def stopped_in_words(state: RestState | None, vocabulary: Vocabulary) -> str:
    """What a stopped robot is: `at rest`, `stopping (12.6 kn, 33 m to go)`, or `stopped` if it does not tell."""
    if state is None or state.at_rest:
        return "stopped" if state is None else "at rest"
    return f"stopping ({state_in_words(state, *_units(vocabulary))})"


def _units(vocabulary: Vocabulary) -> tuple[str, str]:
    """In which speeds and lengths are read."""
    return unit_of("speed", vocabulary) or "m/s", unit_of("x", vocabulary) or "m"


def _by_name(moving: tuple[str, float, float]) -> tuple[tuple[int, str], ...]:
    return natural_order(moving[0])


# ---- on the air: those are asked that still moved

REST_SECONDS = 30.0
"""Seconds after the last robot has accepted a STOP for which a desk asks whether robots have come to rest."""
LOOK_EVERY, LOOK_SELDOM = 0.5, 2.0
"""Seconds between two such looks: at least, and at most where nobody is expected to be at rest before."""
MAX_LOOKED_AT = 200
"""Robots in one such look, those first that may be at rest first: some 60 kB of answers."""


class RestWatch:
    """When a desk looks at robots that have accepted a STOP and still moved. due: when it looks next, s of the desk's
    clock; inf for never, as where no STOP of ours holds."""

    def __init__(self) -> None:
        self._stop, self.due = "", inf

    def wanted(self, stop: str, accepted: float, rest: RestAccount, now: float) -> Sequence[str]:
        """Whom to ask now.

        stop: id of the STOP that holds
        accepted: when the last robot accepted it, s
        rest: what is known since
        """
        if stop != self._stop:
            self._stop, self.due = stop, now + LOOK_EVERY
        if not rest.n_stopping or now > accepted + REST_SECONDS:
            self.due = inf
            return ()
        if self.due == inf:
            self.due = now + LOOK_EVERY
        if now < self.due:
            return ()
        self.due = now + min(max(rest.next_at_rest, LOOK_EVERY), LOOK_SELDOM)
        return rest.soonest(MAX_LOOKED_AT)
