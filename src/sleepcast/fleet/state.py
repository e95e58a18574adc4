"""The state of a fleet: its robots' variables as columns, and what they have learned as minds.

A `Mind` - rules, operators, names - is stored once for all robots that have learned the same, and never changes. A
message that teaches something moves its robots from one mind to another: a draft of the old mind (a `RuleBase`) is
changed, and the table returns the equal mind, a new one if there is none yet. So storing a rule costs the same
however many robots store it.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from functools import cached_property
from math import nan
from typing import TypeAlias, TypeVar
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from sleepcast.columns.values import Mask, Rows, Shared, ValueColumns, distinct
from sleepcast.core.arrays import filled
from sleepcast.core.serial import Array, SerialError, dump_arrays, load_arrays
from sleepcast.fleet.schema import ColumnsState
from sleepcast.language.numerics import GOLDEN, MASK, UNIT, mix
from sleepcast.language.parts import Part
from sleepcast.language.program import Library, Program
from sleepcast.language.symbols import Declared, declared_in
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, ID, MARKING, TICK, TIME_SLOT, Vocabulary
from sleepcast.mind.authority import Latch
from sleepcast.mind.merging import Merging
from sleepcast.mind.rules import Rule, RuleBase, learned_at_first, running

Key = TypeVar("Key", bound=Hashable)
Whole: TypeAlias = NDArray[np.int32]


class FleetState(ValueColumns):
    """All values with one number per robot. numbers: the robots' ids; seed: of the run."""

    def __init__(self, vocabulary: Vocabulary, numbers: Sequence[int], seed: int) -> None:
        count = len(numbers)
        self.at_first = values_at_first(vocabulary)
        """What robots know when they begin, by slot."""
        super().__init__(count, self.at_first)
        self._columns[ID] = np.array(numbers, dtype=np.float64)
        self.seed = seed
        self.present: Mask | None = None
        """Which rows have a robot, where they come and go; None if all have. Changed in place by whoever knows."""
        self.keys = filled(0, np.uint64, count)
        self.keys[:] = streams(seed, np.array(numbers, dtype=np.int64))
        """The key of each robot's random stream."""
        self.draws = filled(0, np.int32, count)
        """Random numbers drawn in this tick."""
        self.mind = np.zeros(count, np.int32)
        """What each robot has learned: a number in the table of minds. Changed by `turn`."""
        self.one_mind: int | None = 0
        """The common mind of all robots, if it is known that there is one."""
        self.turns = 0
        """How often robots have been given minds: as long as it stays the same, all have the same minds as before."""
        self.proven = np.zeros(count, np.int32)
        """The mind whose rules ROLLBACK restores."""
        self.unproven_since = np.zeros(count, np.int64)
        """Tick in which the rules last changed or met a fault."""
        self.actuated: dict[int, Mask] = {}
        """Which robots have assigned an actuator, by slot, since it was last queried."""
        self.lost = np.zeros(count, np.int32)
        """Number of messages lost because a queue or the outbox was full."""
        self.in_outbox = np.zeros(count, np.int32)
        """Messages in the outbox."""
        self.sequence = np.zeros(count, np.int32)
        """The number of the last message sent."""
        self.stopped = np.zeros(count, np.bool_)
        self.latch = Shared(count, Latch())
        """Which STOPs hold each robot, and which have ended."""
        self.merging = Shared(count, Merging(), Merging.key)
        """Which commands have changed what on each robot, where those of several operators are merged."""
        self.held = np.zeros(count, np.bool_)
        """Whether functions that act are refused: the robot is stopped and its body has no latch of its own."""
        self.still = np.zeros(count, np.bool_)
        """Whether the body is held still."""
        self._castes: NDArray[np.float64] | None = None

    # Columns that a robot may never need are made when somebody looks at them.

    @cached_property
    def dropped(self) -> Whole:
        """Number of assignments and calls that were not passed to the body because a value was unknown."""
        return np.zeros(self.count, np.int32)

    @cached_property
    def reported_in(self) -> Whole:
        """The second in which each robot last reported anything."""
        return np.zeros(self.count, np.int32)

    @cached_property
    def reported(self) -> Whole:
        """Its reports in that second."""
        return np.zeros(self.count, np.int32)

    @cached_property
    def telling_until(self) -> NDArray[np.float64]:
        """When everything that each robot has told would be paid off at its permitted rate, s."""
        return np.zeros(self.count)

    @cached_property
    def rate_limited(self) -> Mask:
        """Whether a TELL has been refused since the robot was last below its rate."""
        return np.zeros(self.count, np.bool_)

    @cached_property
    def crowded(self) -> Mask:
        """Whether each robot has reported that it had more neighbours than a form goes through."""
        return np.zeros(self.count, np.bool_)

    def everybody(self) -> Rows:
        """The robots that are there."""
        return Rows.run(0, self.count) if self.present is None else Rows.of(np.flatnonzero(self.present))

    def turn(self, rows: Rows, mind: int) -> None:
        """Give these robots a mind."""
        self.mind[rows.index] = mind
        self.turns += 1
        if rows.size == self.count:
            self.one_mind = mind
        elif self.one_mind != mind:
            self.one_mind = None

    def divide(self, rows: Rows, key: Callable[[int], Key]) -> list[tuple[Key, Rows, Mask | None]]:
        """Group the rows by the result of `key` for their mind's number; each group with a mask of the rows (None:
        all)."""
        if rows.size == 0:
            return []
        if (one := self.one_mind) is not None:
            return [(key(one), rows, None)]
        numbers = self.mind[rows.index]
        if (numbers == numbers[0]).all():
            one = int(numbers[0])
            if rows.size == self.count:
                self.turn(rows, one)  # updates the cached common mind
            return [(key(one), rows, None)]
        unique, which = distinct(numbers)
        codes: dict[Key, int] = {}
        coded = np.array([codes.setdefault(key(number), len(codes)) for number in unique.tolist()])[which]
        if len(codes) == 1:
            return [(next(iter(codes)), rows, None)]
        return [(group, rows.take(coded == code), coded == code) for group, code in codes.items()]

    def castes(self) -> NDArray[np.float64]:
        """The caste of the ping that native code has noted for each robot, NaN for none, until the outbox takes it."""
        if self._castes is None:
            self._castes = filled(nan, np.float64, self.count)
        return self._castes

    def assigned(self, slot: int) -> Mask:
        """Which robots have assigned an actuator."""
        robots = self.actuated.get(slot)
        if robots is None:
            self.layouts += 1
            robots = self.actuated[slot] = filled(0, np.bool_, self.count)
        return robots

    # ---- saving and restoring

    def state(self) -> ColumnsState:
        """Everything except the random streams, which follow from the seed."""
        actuated = {slot: Array.of(robots) for slot, robots in sorted(self.actuated.items()) if robots.any()}
        return ColumnsState(
            self.values(),
            dump_arrays(self._arrays()),
            actuated,
            dump_arrays({"latch": self.latch.column}),
            self.latch.values,
            dump_arrays(self._telling()),
            Array.of(self.crowded) if self.crowded.any() else None,
        )

    def restore(self, state: ColumnsState) -> None:
        """Restore a saved state. Raises SerialError if it is of another fleet."""
        self.refill(state.values)
        load_arrays(state.arrays, self._arrays())
        self.one_mind = None
        self.turns += 1
        if not all(0 <= slot < len(self._same) for slot in state.actuated):
            raise SerialError("an actuator that is no variable")
        self.actuated = {
            slot: robots.made(np.bool_, (self.count,), f"who assigned actuator {slot}")
            for slot, robots in state.actuated.items()
        }
        if state.telling:  # absent in states saved before the rate of TELL was bounded
            load_arrays(state.telling, self._telling())
        none = np.zeros(self.count, np.bool_)
        self.crowded[:] = none if state.crowded is None else state.crowded.made(np.bool_, none.shape, "who is crowded")
        if state.latches:  # absent in states saved before STOPs were identified by number: the next RELEASE ends them
            latch = np.zeros(self.count, np.int32)
            load_arrays(state.orders, {"latch": latch})
            self.latch.restore(state.latches, latch)

    def _telling(self) -> dict[str, NDArray[np.generic]]:
        """The arrays that bound the rate of TELL."""
        return {"telling_until": self.telling_until, "told_less": self.rate_limited}

    def _arrays(self) -> dict[str, NDArray[np.generic]]:
        """All arrays with one element per robot that are not variables."""
        return {
            "draws": self.draws,
            "mind": self.mind,
            "proven": self.proven,
            "unproven_since": self.unproven_since,
            "dropped": self.dropped,
            "lost": self.lost,
            "said": self.in_outbox,
            "sequence": self.sequence,
            "reported_in": self.reported_in,
            "reported": self.reported,
            "stopped": self.stopped,
            "held": self.held,
            "still": self.still,
        }


def values_at_first(vocabulary: Vocabulary) -> list[float]:
    """The values of a robot's variables, by slot, before anything has happened; its number is unknown here."""
    known = dict.fromkeys((*range(ACTIVE0 + BUFFERS), TIME_SLOT, TICK), 0.0) | {MARKING: 1.0, ID: nan}
    return [known.get(slot, nan) for slot in range(vocabulary.size)]


# Random numbers over columns: the same numbers as `language.numerics` gives one robot, for many robots at once.

Words: TypeAlias = NDArray[np.uint64]

_GOLDEN = np.uint64(GOLDEN)
_FIRST, _SECOND = np.uint64(0xBF58_476D_1CE4_E5B9), np.uint64(0x94D0_49BB_1331_11EB)
_30, _27, _31, _11 = (np.uint64(shift) for shift in (30, 27, 31, 11))


def _mixed(z: Words) -> Words:
    """The finaliser of SplitMix64, see `language.numerics.mix`; arrays of integers wrap at 64 bits."""
    z = (z ^ (z >> _30)) * _FIRST
    z = (z ^ (z >> _27)) * _SECOND
    return z ^ (z >> _31)


def streams(seed: int, robots: NDArray[np.int64]) -> Words:
    """The 64-bit key of each robot's random stream."""
    first = np.uint64(mix(seed + GOLDEN & MASK))
    return _mixed(first + robots.astype(np.uint64) * _GOLDEN)


def draws(keys: Words, ticks: NDArray[np.int64], numbers: NDArray[np.int32]) -> NDArray[np.float64]:
    """One number in [0, 1) for each key: draw `number` of its tick."""
    of_tick = _mixed(keys + ticks.astype(np.uint64) * _GOLDEN)
    word = _mixed(of_tick + numbers.astype(np.uint64) * _GOLDEN)
    return (word >> _11).astype(np.float64) * UNIT


# ---- minds

UNMERGED = Merging()
"""Of changes that are no command's: all of them count."""


class MindKey:
    """Equal for equal minds. It keeps its hash, which takes as long to find as there are names."""

    __slots__ = ("_hash", "_learned")

    def __init__(
        self, rules: Mapping[str, Rule], symbols: Mapping[str, Declared], operators: Mapping[str, Program]
    ) -> None:
        named = [each for names in (symbols, operators) for each in (tuple(names), tuple(names.values()))]
        self._learned = tuple(rules.values()), *named
        self._hash = hash(self._learned)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, MindKey) and self._hash == other._hash and self._learned == other._learned

    def __hash__(self) -> int:
        return self._hash


class Mind:
    """What some robots have learned. rules, operators and symbols by key, in order of arrival.

    running: the active rules in order of evaluation; sequence: their keys.
    """

    def __init__(self, rules: dict[str, Rule], symbols: dict[str, Declared], operators: dict[str, Program]) -> None:
        self.rules, self.symbols, self.operators = rules, symbols, operators
        self.key = MindKey(rules, symbols, operators)

    @cached_property
    def running(self) -> tuple[Rule, ...]:
        return tuple(running(self.rules))

    @cached_property
    def sequence(self) -> tuple[str, ...]:
        return tuple(rule.key for rule in self.running)

    def declared(self, key: str) -> Declared | None:
        """The declaration learned under `key`."""
        return declared_in(self.rules, self.symbols, key)

    def heard(self) -> Iterable[str]:
        """Every learned name as written."""
        return [symbol.name for symbol in self.symbols.values()]

    def fetch(self, part: Part) -> Program | None:
        """The program in the buffer or rule that a `fetch` part names, None if there is none."""
        rule = self.rules.get(part.name)
        return None if rule is None else rule.program

    def operator(self, part: Part) -> Program | None:
        """The program of the operator that a `call` part names, None if there is none of that name."""
        return self.operators.get(part.name)


class MindNames:
    """The names of a mind, for the checker."""

    def __init__(self, vocabulary: Vocabulary, mind: Mind) -> None:
        self.vocabulary, self._mind = vocabulary, mind

    def declared(self, key: str) -> Declared | None:
        return self._mind.declared(key)

    def heard(self) -> Iterable[str]:
        return self._mind.heard()


class EqualMinds(WeakValueDictionary[MindKey, Mind]):
    """The minds of all fleets whose vocabularies were made `anew` from one: equal ones are one and the same."""


class Minds:
    """The table of minds. vocabulary: of all robots. Number 0 is the mind that has learned nothing."""

    def __init__(self, vocabulary: Vocabulary) -> None:
        self.vocabulary, self.library = vocabulary, Library(vocabulary)
        self._minds: dict[int, Mind] = {}
        self._numbers: dict[MindKey, int] = {}
        self._shared = vocabulary.common(EqualMinds)
        self._next = 0
        self.add(Mind({}, *learned_at_first(vocabulary, self.library)))

    def __getitem__(self, number: int) -> Mind:
        return self._minds[number]

    def __len__(self) -> int:
        return len(self._minds)

    def draft(self, number: int, changing: Callable[[], None] = lambda: None, merging: Merging = UNMERGED) -> RuleBase:
        """A copy of a mind, to be changed. changing: called before its rules change; merging: which changes count."""
        mind = self._minds[number]
        return RuleBase(
            self.vocabulary,
            self.library,
            merging,
            changing,
            rules=mind.rules,
            symbols=mind.symbols,
            operators=mind.operators,
        )

    def settle(self, draft: RuleBase) -> int:
        """The number of the mind equal to the draft."""
        return self.add(Mind(draft.rules, draft.symbols, draft.operators))

    def add(self, mind: Mind) -> int:
        """The number of a mind equal to this one."""
        if mind.key in self._numbers:
            return self._numbers[mind.key]
        if self._shared is not None:
            mind = self._shared.setdefault(mind.key, mind)
        number, self._next = self._next, self._next + 1
        self._minds[number], self._numbers[mind.key] = mind, number
        return number

    @property
    def table(self) -> tuple[dict[int, Mind], int]:
        """Every mind by its number, and the number that the next one gets."""
        return dict(self._minds), self._next

    def fill(self, minds: dict[int, Mind], following: int) -> None:
        """Replace all minds by these, under these numbers, all below `following`, the next number."""
        self._minds, self._numbers, self._next = {}, {}, following
        for number, mind in sorted(minds.items()):
            self._minds[number] = mind
            self._numbers.setdefault(mind.key, number)

    def keep_only(self, used: set[int]) -> None:
        """Remove the minds that no robot has any more; 0 stays."""
        self._minds = {number: mind for number, mind in self._minds.items() if number in used or number == 0}
        self._numbers = {key: number for key, number in self._numbers.items() if number in self._minds}
