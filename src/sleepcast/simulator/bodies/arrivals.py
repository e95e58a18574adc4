"""Robots that come during a run, without a parent: each is as one of its sort is at the start.

Whatever is by chance goes by the robot's own number: heading, stores and, unless the scenario says where it stands, its
place. A place is free outside of solid areas; where bodies touch each other also if the body touches nothing there; and
in the air if nobody is so near that both would crash. Places by chance are drawn until all are free. Where a place is
given, and is taken, nobody comes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.core.records import dataclass
from sleepcast.simulator.bodies.bodies import MAX_REDRAWS, Bodies, Flags, Floats, Whole
from sleepcast.simulator.bodies.population import MAX_BIRTHS, Population
from sleepcast.simulator.bodies.senses import Senses
from sleepcast.simulator.motion.steps import SKIN
from sleepcast.simulator.scenario.population import with_counts
from sleepcast.simulator.scenario.robot_settings import RobotSpec
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.scenario.starts import StartPose, Starts
from sleepcast.simulator.simd.formulas import shortest
from sleepcast.simulator.world.areas import barred
from sleepcast.simulator.world.grid import distance


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
    if bodies.contact is None and bodies.flight is None:
        return np.flatnonzero(taken)
    there = np.ones(bodies.count, bool) if bodies.population is None else bodies.population.present
    others = tuple(column[there] for column in (bodies.x, bodies.y, _heights(bodies), bodies.radii, _aloft(bodies)))
    for robot in np.flatnonzero(~taken).tolist():
        before = np.flatnonzero(~taken[:robot])
        mine = tuple(column[before] for column in (new.x, new.y, _heights(new), new.radii, _aloft(new)))
        all_ = tuple(np.concatenate(each) for each in zip(others, mine, strict=True))
        taken[robot] = _touches(bodies, new, robot, all_)
    return np.flatnonzero(taken)


def _heights(bodies: Bodies) -> Floats:
    """z of bodies, m, 0 on the ground."""
    return np.zeros(bodies.count) if bodies.flight is None else np.nan_to_num(bodies.flight.z)


def _aloft(bodies: Bodies) -> Floats:
    """1 of bodies in the air, 0 of those on the ground."""
    if bodies.flight is None:
        return np.zeros(bodies.count)
    return (_heights(bodies) > bodies.flight.ground_at(bodies.x, bodies.y)).astype(float)


def _touches(bodies: Bodies, new: Bodies, robot: int, others: Sequence[Floats]) -> bool:
    """Whether one of `new` touches a wall or one of `others` (x, y, z and radii, m, and
    whether they are in the air) where that matters."""
    x, y, radius, z = float(new.x[robot]), float(new.y[robot]), float(new.radii[robot]), float(_heights(new)[robot])
    around = bodies.scenario.around
    dx, dy, dz = shortest(others[0] - x, around[0]), shortest(others[1] - y, around[1]), others[2] - z
    near: Flags = np.sqrt(dx * dx + dy * dy + dz * dz) < others[3] + radius + SKIN
    if bodies.contact is None:
        aloft = (others[4] > 0.0) | (_aloft(new)[robot] > 0.0)
        return bodies.flight is not None and bodies.flight.collides and bool((near & aloft).any())
    lines = bodies.near.lines
    ends = [lines[:, each] for each in range(4)]
    walls = distance(np.full(len(lines), x), np.full(len(lines), y), *ends) < radius + lines[:, 4] + SKIN
    return bool(near.any() or walls.any())


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
