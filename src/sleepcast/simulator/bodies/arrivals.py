"""Robots that come during a run, without a parent: each is as one of its sort is at the start.

Whatever is by chance goes by the robot's own number: heading, stores and, unless the scenario says where it stands, its
place. A place is free outside of solid areas, and where the body touches nothing, as at the start (`starting`). Places
by chance are drawn until all are free. Where a place is given, and is taken, nobody comes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.core.records import dataclass
from sleepcast.simulator.bodies.bodies import MAX_REDRAWS, Bodies, Whole
from sleepcast.simulator.bodies.population import MAX_BIRTHS, Population
from sleepcast.simulator.bodies.senses import Senses
from sleepcast.simulator.bodies.starting import Placed, is_crowded, placed, touch, touch_solids
from sleepcast.simulator.scenario.population import with_counts
from sleepcast.simulator.scenario.robot_settings import RobotSpec
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.scenario.starts import StartPose, Starts
from sleepcast.simulator.world.areas import barred


@dataclass(frozen=True, slots=True)
class Arrival:
    """A robot that somebody has added between two ticks. Its class name is written into recordings.

    sort: its table in the scenario, from 0
    order: how many were added before it, by which a run that goes on knows whether it has come already
    x, y, heading, z: where it stood then, m and rad
    """

    sort: int
    order: int
    x: float
    y: float
    heading: float
    z: float = 0.0

    @property
    def starts(self) -> Starts:
        """Its place, as the scenario would give it."""
        return (StartPose(self.x, self.y, self.heading, z=self.z),)


def newcomers(bodies: Bodies, scenario: Scenario, sort: int, numbers: Whole, starts: Starts | None = None) -> Bodies:
    """Robots of one sort with these numbers, as they would be at the start of an empty world. scenario: of the run;
    starts: where they stand, None for what it says. Raises StartError if they overlap each other there."""
    wanted = [len(numbers) if each == sort else 0 for each in range(len(scenario.each_type))]
    alone = with_counts(replace(scenario, shapes=(), picture=None), wanted)
    if starts is not None:
        spec = replace(alone.each_type[sort], starts=starts)
        sorts = tuple(spec if each == sort else other for each, other in enumerate(alone.sorts))
        alone = replace(alone, sorts=sorts) if sorts else replace(alone, robots=spec)
    made = Bodies(alone, bodies.seed, bodies.machine, sensors=bodies.sensors, numbers=numbers)
    Senses(made)  # which begins what they sense
    return made


def find_room(bodies: Bodies, new: Bodies, *, given: bool) -> bool:
    """Whether there is a free place for each of `new` among the bodies of a run; those whose place is not `given` are
    moved to one."""
    for attempt in range(MAX_REDRAWS):
        taken = _taken(bodies, new)
        if not taken.size:
            return True
        if given:
            return False
        x, y = new.anywhere(f" free {attempt}")
        for mine, other in ((new.x, x), (new.y, y), (new.encoder_x, x), (new.encoder_y, y)):
            mine[taken] = other[taken]
        if new.flight and new.scenario.ground:
            new.flight.start()  # the ground is not as high there
    return False


def _taken(bodies: Bodies, new: Bodies) -> Whole:
    """Those of `new` that cannot be where they are."""
    taken = barred(bodies.world, new.x, new.y, new.lands)
    if not is_crowded(bodies):
        return np.flatnonzero(taken)
    there = np.ones(bodies.count, bool) if bodies.population is None else bodies.population.present
    others, all_new = placed(bodies).of(there), placed(new)
    for robot in np.flatnonzero(~taken).tolist():
        one, mine = all_new.of(np.array([robot])), all_new.of(np.flatnonzero(~taken[:robot]))
        taken[robot] = touch(bodies, one, others.joined(mine)).any() or _at_wall(bodies, one)
    return np.flatnonzero(taken)


def _at_wall(bodies: Bodies, one: Placed) -> bool:
    """Whether something solid is so near to this body that it would touch it."""
    lines, tops = bodies.near.lines, bodies.near.tops
    return bool(touch_solids(bodies, one.of(np.zeros(len(lines), np.intp)), lines, tops).any())


# ---- what people ask for


def sort_called(population: Population, kind: str) -> int:
    """The sort of robots of this type of which one more may come; "" for the only one. Raises MisuseError."""
    specs = population.specs
    open_to = [sort for sort, spec in enumerate(specs) if spec.hatch or spec.most]
    kinds = list(dict.fromkeys(specs[sort].type for sort in open_to))
    if not kinds:
        raise MisuseError(
            "no robots can be added to this run: say most = ... in a table of robots of its scenario, for room"
        )
    if kind not in kinds and (kind or len(kinds) > 1):
        raise MisuseError(f'no robot "{kind}" can be added{did_you_mean(kind, kinds)}: wanted {" or ".join(kinds)}')
    sorts = [sort for sort in open_to if specs[sort].type == (kind or kinds[0])]
    return next((sort for sort in sorts if population.room(sort)), sorts[0])


def refuse_full(population: Population, sort: int) -> None:
    """Raise MisuseError if no more of a sort may come."""
    name = population.specs[sort].type
    if not population.room(sort):
        raise MisuseError(f"there is no room for another {name}: see most in the scenario")
    if population.following >= MAX_BIRTHS:
        raise MisuseError(f"{MAX_BIRTHS} robots have come in this run: that is as many as there are numbers for")


def start_at(
    spec: RobotSpec, x: float | None, y: float | None, heading: float | None, size: Sequence[float]
) -> Starts | None:
    """Where a robot is to start, None for a place by chance. size: of the world, m. Raises MisuseError."""
    if (x is None) != (y is None):
        raise MisuseError("a place has both x and y: give both, or neither for a place by chance")
    if x is None or y is None:
        if spec.starts:
            raise MisuseError(
                f"each {spec.type} of the scenario has a start of its own: say where this one is to stand"
            )
        return None
    for name, value, side in (("x", x, size[0]), ("y", y, size[1])):
        if not 0.0 <= value <= side:
            raise MisuseError(f"{name} = {value:g} m lies outside the world, which goes from 0 to {side:g} m")
    if heading is not None and not abs(heading) <= 100.0:
        raise MisuseError(f"a heading of {heading:g} rad: wanted an angle from -100 to 100 rad")
    return (StartPose(x, y, heading),)
