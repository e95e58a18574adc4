"""Robots that come and go: which rows of the arrays have a robot, what is its number, and who is to come and to go.

What robots ask for with HATCH and DIE in a tick is done at its end, at one time: first the children come, in the order
of their parents' numbers, with the numbers that follow; then those go that are to die. A row that a robot leaves is
taken again from the next tick on, the lowest one first. Chance goes by numbers, never by rows.

Those whose time has come (`at`) come before all children; for them rows are kept free until then. Whoever comes without
a parent, also because somebody has added it, is its own parent in a `Turnover`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from math import isnan

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.errors import SleepcastError
from sleepcast.core.records import NamedTuple
from sleepcast.simulator.scenario.population import rows_at_first, sizes, sorts_by_name
from sleepcast.simulator.scenario.robot_types import slices
from sleepcast.simulator.scenario.scenario import Scenario

Whole = NDArray[np.intp]
Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

NOBODY = -1
"""The number in a row without a robot."""
MAX_BIRTHS = 1 << 31
"""Numbers of one run: noise puts those of two robots into one word of 64 bits."""
_NO_ROWS: Whole = np.zeros(0, np.intp)
_NO_SHARES: Floats = np.zeros(0)
MAX_CALLS = 64
"""Calls of HATCH by one robot in a tick: what they ask for is kept until its end."""


class PopulationError(SleepcastError):
    """Robots cannot come as they were asked for."""


class Turnover(NamedTuple):
    """Who comes and goes at the end of a tick; rows.

    parents, children: each child with its parent, in the order of the children's numbers; one that nobody has hatched
        with itself
    numbers: of the children, from 0
    shares: of each store of its parent that each child gets; 1 where it has as much as its parent
    givers, kept: the parents that give of their stores, and the share that each keeps
    dead: those that go
    refused: parents for whose children there was no room any more, and that stay themselves; ascending
    """

    parents: Whole
    children: Whole
    numbers: Whole
    shares: Floats
    givers: Whole
    kept: Floats
    dead: Whole
    refused: Whole

    @property
    def changed(self) -> Whole:
        """The rows of children and of the dead."""
        return np.concatenate((self.children, self.dead))

    @property
    def newcomers(self) -> Whole:
        """The rows of those that nobody has hatched."""
        newcomers: Whole = self.children[self.children == self.parents]
        return newcomers


def joined(turnovers: Sequence[Turnover]) -> Turnover:
    """What has happened one after the other, at least one of them, as one."""
    return Turnover(*map(np.concatenate, zip(*turnovers, strict=True)))


class Population:
    """See the module. scenario: without room for more; roomy: with it.

    numbers: of the robot in each row, from 0, or `NOBODY`
    present: which rows have a robot
    following: the number of the next robot
    added: how many people have added
    awaited: the sorts of which robots are to come by themselves and have not come yet, by their time
    """

    def __init__(self, scenario: Scenario, roomy: Scenario) -> None:
        first, count = rows_at_first(scenario), roomy.robots.count
        self._slices = slices(roomy.each_type, count)
        self.specs = scenario.each_type
        self.sorts = sorts_by_name(self.specs)
        self.sizes = sizes(scenario)
        """How many robots each sort has, those that come later among them."""
        self.awaited = sorted((sort for sort, spec in enumerate(self.specs) if spec.at), key=self.time_of)
        self.numbers: Whole = np.full(count, NOBODY, np.intp)
        self.numbers[first] = np.arange(len(first))
        self.present: Flags = self.numbers >= 0
        self.following, self.added = len(first), 0
        self._asked: dict[int, list[tuple[int, int, float]]] = {}
        """Sort, how many, and the share of each store of every call of HATCH in this tick, by the parent's row."""
        self._dying: Flags = np.zeros(len(self.numbers), np.bool_)

    @property
    def count(self) -> int:
        """How many robots there are."""
        return int(np.count_nonzero(self.present))

    @property
    def staying(self) -> Flags:
        """Which rows have a robot that does not go at the end of this tick, as far as it has asked for."""
        return self.present & ~self._dying

    def rows_of(self, numbers: Floats) -> Floats:
        """The rows of the robots with these numbers, `NOBODY` where there is none."""
        rows, known = np.flatnonzero(self.present), self.numbers[self.present]
        order = np.argsort(known)
        at = np.minimum(np.searchsorted(known[order], numbers), len(rows) - 1) if len(rows) else None
        if at is None:
            return np.full(len(numbers), float(NOBODY))
        return np.where(known[order[at]] == numbers, rows[order[at]], NOBODY).astype(np.float64)

    def time_of(self, sort: int) -> float:
        """When the robots of a sort come, s."""
        return self.specs[sort].at

    def room(self, sort: int) -> int:
        """How many more of a sort may come, besides those that are to come by themselves."""
        return len(self._free(sort))

    def _free(self, sort: int, kept: bool = True) -> list[int]:
        """The rows for more of a sort, lowest first. kept: without those for robots that are to come by themselves."""
        part = self._slices[sort]
        rows: list[int] = (np.flatnonzero(~self.present[part]) + part.start).tolist()
        return rows[: len(rows) - self.sizes[sort]] if kept and sort in self.awaited else rows

    def come(self, sort: int, count: int, *, awaited: bool) -> Turnover:
        """So many robots of a sort come, for which there is room. awaited: by themselves, because it is their time."""
        rows = np.array(self._free(sort, kept=not awaited)[:count], np.intp)
        if awaited:
            self.awaited.remove(sort)
        else:
            self.added += count
        numbers = np.arange(self.following, self.following + len(rows))
        self.following += len(rows)
        self.numbers[rows], self.present[rows] = numbers, True
        return Turnover(rows, rows, numbers, np.ones(len(rows)), _NO_ROWS, _NO_SHARES, _NO_ROWS, _NO_ROWS)

    def _crowded(self, row: int, sort: int, count: int) -> bool:
        """Whether so many more children of this parent would be in a body that crashes with them, also on the ground,
        where they could never take off."""
        crash = [spec.flight is not None and not spec.flight.particle for spec in self.specs]
        parent = next(kind for kind, part in enumerate(self._slices) if part.start <= row < part.stop)
        others = sum(more for kind, more, _ in self._asked[row] if crash[kind])
        return crash[sort] and (crash[parent] or others + count > 1)

    def hatch(self, row: int, sort: float, count: float, share: float) -> float:
        """HATCH by the robot in this row, see `FUNCTIONS`. Raises PopulationError."""
        if sort not in self.sorts.values():
            names = " or ".join(sorted(self.sorts, key=lambda name: self.sorts[name]))
            raise PopulationError(f"HATCH needs a sort of robots that may come here: wanted {names}, not {sort:g}")
        if not count >= 0.0 or count != int(count):
            raise PopulationError(f"HATCH needs a whole number of children, 0 or more, not {count:g}")
        if not isnan(share) and not 0.0 <= share <= 1.0:
            raise PopulationError(f"HATCH gives a share of each store from 0 to 1, not {share:g}")
        own = self._asked.setdefault(row, [])
        room = self.room(int(sort)) - sum(more for kind, more, _ in own if kind == sort)
        if count > room:
            name = next(name for name, place in self.sorts.items() if place == sort)
            raise PopulationError(f"there is room for {room} more {name}, not for {int(count)}: see most in [robots]")
        if count and self._crowded(row, int(sort), int(count)):
            raise PopulationError("a child begins where its parent is: two that fly would be in each other, and crash")
        if len(own) >= MAX_CALLS:
            raise PopulationError(f"HATCH was called {MAX_CALLS} times in this tick: ask for more children at a time")
        if count:
            own.append((int(sort), int(count), share))
        return count

    def die(self, rows: Whole) -> None:
        """These robots go at the end of the tick."""
        self._dying[rows] = True

    def settle(self) -> Turnover | None:
        """The end of a tick: takes note of who comes and goes; None if nobody does."""
        dead = np.flatnonzero(self._dying & self.present)
        self._dying[:] = False
        if not self._asked and not dead.size:
            return None
        parents, children, shares, kept, refused = self._placed()
        numbers = np.arange(self.following, self.following + len(children))
        self.following += len(children)
        self.numbers[children], self.numbers[dead] = numbers, NOBODY
        self.present[children], self.present[dead] = True, False
        givers = np.array(list(kept), np.intp)
        left = np.array(list(kept.values()), np.float64)
        return Turnover(parents, children, numbers, shares, givers, left, dead, np.setdiff1d(refused, dead))

    def _placed(self) -> tuple[Whole, Whole, Floats, dict[int, float], Whole]:
        """The children with their parents, rows and shares; what parents keep of their stores; and the parents of those
        for whom there is no room. Each call gives of what those before it have left, or copies that: so nobody gives
        more than all."""
        asked, self._asked = self._asked, {}
        free = [iter(self._free(sort)) for sort in range(len(self._slices))]
        placed, kept, refused = list[tuple[int, int, float]](), dict[int, float](), dict[int, None]()
        for parent in sorted(asked, key=lambda row: int(self.numbers[row])):
            for sort, count, share in asked[parent]:
                rows = list(islice(free[sort], count))
                has = kept.get(parent, 1.0)
                given = has if isnan(share) else has * share / count
                placed += [(parent, row, given) for row in rows]
                if not isnan(share):
                    kept[parent] = has * (1.0 - share * len(rows) / count)
                if len(rows) < count:
                    refused[parent] = None
        parents, children = (np.array([each[i] for each in placed], np.intp) for i in (0, 1))
        return parents, children, np.array([each[2] for each in placed]), kept, np.array(list(refused), np.intp)
