"""Goals: what shall hold of a fleet during a run, and what came instead.

    [[goals]]
    holds = "share (= marked (> fuel 50%)) >= 0.99"
    otherwise = "Somebody is marked who should not be, or the other way round."

A goal holds at the end; with `when = "always"` at every tick, from `after` on; with `when = "once"` at any of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import isnan

from sleepcast.api.fleet import SimulatedFleet
from sleepcast.core.errors import MisuseError, in_file
from sleepcast.core.records import dataclass
from sleepcast.core.settings import Table
from sleepcast.core.units import TIME
from sleepcast.experiments.measures import StopCondition, read_stop
from sleepcast.language import CheckError, ReadError

MAX_GOALS = 16
MAX_TIME = 1e7
"""Simulated seconds, after which no goal begins."""


@dataclass(frozen=True)
class Goal:
    """What shall hold, and when: "end", "always" (from `after` s on) or "once". otherwise: what to say if it does
    not."""

    holds: StopCondition
    when: str
    after: float
    otherwise: str


@dataclass(frozen=True)
class Miss:
    """A goal that was not met: its condition, what was measured instead at `time` (s), and what to think of."""

    goal: str
    value: float
    time: float
    otherwise: str

    def shown(self) -> float | None:
        """What was measured; None if it was unknown."""
        return None if isnan(self.value) else self.value

    def sentence(self) -> str:
        measured = "unknown" if isnan(self.value) else f"{self.value:.3g}"
        return f"wanted {self.goal}, but it was {measured} at {self.time:g} s. {self.otherwise}".rstrip()


def read_goal(table: Table) -> Goal:
    """The goal in a table `[[goals]]`. Raises SettingsError."""
    with table:
        text = table.text("holds", most=1000)
        with table.answering("holds"):
            condition = read_stop(text)
        when = table.text("when", "end", choices=("end", "always", "once"))
        after = table.number("after", TIME, 0.0, low=0.0, high=MAX_TIME)
        return Goal(condition, when, after, table.text("otherwise", "", most=1000))


@contextmanager
def answering(place: str) -> Iterator[None]:
    """What is wrong in an expression is said with the place where it stands."""
    try:
        yield
    except (ReadError, CheckError) as error:
        raise MisuseError(in_file(place, str(error))) from error


class GoalJudge:
    """Looks at the goals of one run. name: of what has them, for errors."""

    def __init__(self, goals: Sequence[Goal], name: str) -> None:
        self._goals, self._name = goals, name
        self._missed: dict[Goal, Miss] = {}
        self._met: set[Goal] = set()

    def look(self, fleet: SimulatedFleet, *, is_end: bool) -> None:
        """See how things are after a tick; at the end for the last time. Raises MisuseError for a goal that cannot be
        measured."""
        for goal in self._goals:
            if goal in self._met or (goal.when == "end" and not is_end) or fleet.time < goal.after - 1e-9:
                continue
            with answering(f"{self._name}, goal {goal.holds.text}"):
                value = goal.holds.measure(fleet)
            holds = goal.holds.compared(value, goal.holds.bound)
            if holds and goal.when == "once":
                self._met.add(goal)
                self._missed.pop(goal, None)
            elif not holds and (goal.when != "always" or goal not in self._missed):
                self._missed[goal] = Miss(goal.holds.text, value, fleet.time, goal.otherwise)

    @property
    def missed(self) -> list[Miss]:
        """The goals that were not met, in their order."""
        return [self._missed[goal] for goal in self._goals if goal in self._missed]
