"""What bodies that hover can be told, for many of them at once: the commands of `robot.hovering`, with its sentences.

A body that is stopped does nothing, and nothing is wrong with that; one that refuses says why.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.robot import FencedError, Limits, hovering
from sleepcast.simulator.bodies.bodies import Bodies, Flags, Floats, Whole
from sleepcast.simulator.bodies.flight import Flight, fence_of
from sleepcast.simulator.motion.flying import LANDS
from sleepcast.simulator.world.roofs import GROUND

STAYS = "this robot does not fly"
UNCUT = "this robot has no emergency stop"
STOPPED = "it is stopped: RELEASE it first"
NO_ROOF = "its roof ends before it is fast enough to fly: it needs more room ahead"
NO_CLIMB = "the ground ahead rises faster than it climbs: it needs another heading or place to take off"
NO_RUN = "its take-off leads out of the fence: it needs more room ahead"

Fence = tuple[float, float, float, float]
Results = list[float | SleepcastError] | None
"""What came of a command on each of some bodies: 1, or why it failed; None where it failed on none."""


class Pilot(NamedTuple):
    """Tells the bodies of a world what to do, by their indices; see `hovering.Hovering`."""

    bodies: Bodies
    flight: Flight

    def arm(self, robots: Whole) -> Results:
        told = self._told(robots)
        told.refuse(self.bodies.stopped[robots], STOPPED)
        told.refuse(self.flight.locked[robots], hovering.LOCKED_MOTORS)
        self.flight.armed[told.free] = 1.0
        return told.results

    def disarm(self, robots: Whole) -> Results:
        told = self._told(robots)
        told.refuse(~self._is_grounded(robots), hovering.FLYING)
        self.flight.armed[told.free] = 0.0
        return told.results

    def take_off(self, robots: Whole, height: Floats | None = None) -> Results:
        flight, told = self.flight, self._told(robots)
        heights = flight.usual_height(robots) if height is None else height
        targets = heights + flight.ground[robots]
        self._refuse_heights(told, heights)
        self._refuse_heights(told, targets)
        told.refuse(flight.locked[robots], hovering.LOCKED_MOTORS)
        exhausted = self.bodies.exhausted()
        if exhausted is not None:
            told.refuse(exhausted[robots], hovering.exhausted())
        if flight.wings:
            told.refuse(flight.wings.rolls_off(robots), NO_ROOF)
            told.refuse(flight.wings.meets_slope(robots), NO_CLIMB)
            told.check(flight.wings.lacks_room(robots), _refuse_run)
        stand = told.free if flight.wings is None else told.free[~flight.wings.is_up(told.free)]
        flight.rest(stand)
        if flight.wings:
            flight.wings.take_off(stand[flight.wings.planes[stand]])
        flight.armed[told.free] = 1.0
        flight.target_z[told.free] = targets[told.obeys]
        if flight.homes:
            flight.homes.set(stand, flight.target_z[stand])
            flight.homes.returns[told.free] = False
        return told.results

    def touch_down(self, robots: Whole) -> Results:
        told = self._told(robots)
        self.land(told.free)
        return told.results

    def climb(self, robots: Whole, speed: Floats) -> Results:
        told = self._told(robots)
        if self.flight.wings:
            told.refuse(self.flight.wings.planes[robots], hovering.GLIDES)
        told.refuse(self._is_grounded(robots), hovering.GROUNDED)
        self.flight.rest(told.free)
        self.flight.wanted_climb[told.free] = speed[told.obeys]
        return told.results

    def go_to(self, robots: Whole, x: Floats, y: Floats, z: Floats | None = None) -> Results:
        """Bodies on the ground go there, too, and have no height."""
        bodies, flight = self.bodies, self.flight
        rolls = ~flight.flies[robots]
        bodies.go_to(robots[rolls], x[rolls], y[rolls])
        told = self._told(robots, flies=~rolls)
        self._refuse_places(told, x, y)
        grounded = self._is_grounded(robots)
        if z is None:
            told.refuse((flight.target_z[robots] == LANDS) & ~grounded, hovering.LANDING)
        else:
            self._refuse_heights(told, z - GROUND)
            self._refuse_heights(told, z - flight.ground_at(x, y))
        told.refuse(grounded, hovering.GROUNDED)
        height = flight.target_z[told.free] if z is None else z[told.obeys]
        climbs_out = flight.wings.climbs_out[told.free] if flight.wings else False
        flight.rest(told.free)
        bodies.go_to(told.free, x[told.obeys], y[told.obeys])
        if flight.wings:
            flight.wings.climbs_out[told.free] = climbs_out
        flight.target_z[told.free] = height
        return told.results

    def cut_motors(self, robots: Whole) -> Results:
        """STOP does not keep anybody from it."""
        told = self._told_of_emergency(robots)
        self.lock(told.free)
        return told.results

    def cut_all_motors(self, robots: Whole) -> Results:
        """Of all that have an emergency stop, as if they were on one radio channel."""
        told = self._told_of_emergency(robots)
        if told.free.size:
            self.lock(np.flatnonzero(self.flight.cuts))
        return told.results

    def lock(self, which: Whole) -> None:
        """Stop the motors of these bodies for good, and say so of those whose motors could have turned."""
        newly = which[~self.flight.locked[which]]
        self.flight.lock(which)
        for robot in newly.tolist():
            self.bodies.say_of(robot, hovering.LOCKED_MOTORS)

    def let_go(self, which: Whole) -> None:
        """Land those of these bodies that land where nobody drives them any more, and send those home that return. Of
        those in the air it is told what they do."""
        flight = self.flight
        for robot in which[self._are_flown(which)].tolist():
            spec = self.bodies.part_of(robot).scenario.robots.flight
            assert spec is not None
            self.bodies.say_of(robot, spec.let_go)
        self.land(which[flight.lands_alone[which]])
        if flight.homes:
            up = flight.z[which] > flight.ground[which]
            flight.homes.go(which[flight.returns_home[which] & up])

    def land(self, which: Whole) -> None:
        """Bring these bodies down where they are."""
        up = self.flight.z[which] > self.flight.ground[which]
        self.flight.rest(which[up], LANDS)
        self.flight.rest(which[~up])

    def _told(self, robots: Whole, *, flies: Flags | None = None) -> _Told:
        """A command to these. flies: which of them it concerns; None if those on the ground refuse it."""
        told = _Told(robots, ~self.bodies.stopped[robots], np.ones(len(robots), bool) if flies is None else flies)
        told.refuse(~self.flight.flies[robots], STAYS)
        return told

    def _told_of_emergency(self, robots: Whole) -> _Told:
        everybody = np.ones(len(robots), bool)
        told = _Told(robots, everybody.copy(), everybody)
        told.refuse(~self.flight.cuts[robots], UNCUT)
        return told

    def _are_flown(self, robots: Whole) -> Flags:
        """Which of them motors keep in the air."""
        flight = self.flight
        flown: Flags = flight.flies[robots] & (flight.z[robots] > flight.ground[robots]) & (flight.armed[robots] > 0.0)
        return flown

    def _is_grounded(self, robots: Whole) -> Flags:
        """Which of them stand on the ground or a roof, and are not about to leave it."""
        flight, ground = self.flight, self.flight.ground[robots]
        up: Flags = (flight.z[robots] > ground) | (flight.target_z[robots] > ground)
        return ~up

    def _refuse_heights(self, told: _Told, heights: Floats) -> None:
        """Refuse heights, m, beyond the floor and the ceiling of each body."""
        for limits, _, of_type in self._limits_of(told.robots):
            wrong = of_type & ~((heights >= limits.floor) & (heights <= limits.ceiling))
            told.check(wrong, partial(_check_height, limits, heights))

    def _refuse_places(self, told: _Told, x: Floats, y: Floats) -> None:
        """Refuse places, m, outside of the world, within a body's radius of the wall around it, or too near to its edge
        for a plane to circle around them; a torus has them all."""
        if self.bodies.scenario.torus:
            return
        wings = self.flight.wings
        circle = wings.circle[told.robots] if wings else np.zeros(len(x))
        for limits, fence, of_type in self._limits_of(told.robots):
            left, bottom, right, top = fence
            inside = (x >= left + circle) & (x <= right - circle) & (y >= bottom + circle) & (y <= top - circle)
            told.check(of_type & ~inside, partial(_check_place, replace(limits, fence=fence), x, y, circle))

    def _limits_of(self, robots: Whole) -> Iterator[tuple[Limits, Fence, Flags]]:
        """The limits and the fence of each type, and which of the robots are of it."""
        scenario = self.bodies.scenario
        for spec, which in zip(scenario.each_type, self.bodies.of_each_type, strict=True):
            yield spec.limits, fence_of(scenario, spec), (robots >= which.start) & (robots < which.stop)


def _check_height(limits: Limits, heights: Floats, index: int) -> None:
    hovering.check_height(limits, float(heights[index]))


def _check_place(limits: Limits, x: Floats, y: Floats, circle: Floats, index: int) -> None:
    hovering.check_place(limits, float(x[index]), float(y[index]), float(circle[index]))


def _refuse_run(index: int) -> None:
    raise FencedError(NO_RUN)


def pilot_of(bodies: Bodies) -> Pilot:
    """Who tells these bodies what to do, of which some fly."""
    assert bodies.flight is not None
    return Pilot(bodies, bodies.flight)


class _Told:
    """A command to some robots, of which `obeys` do it and `asked` may refuse it."""

    def __init__(self, robots: Whole, obeys: Flags, asked: Flags) -> None:
        self.robots, self.obeys, self._asked = robots, obeys & asked, asked
        self._faults: dict[int, SleepcastError] = {}

    @property
    def free(self) -> Whole:
        """The indices of those that do it."""
        return self.robots[self.obeys]

    @property
    def results(self) -> Results:
        faults = self._faults
        return [faults.get(index, 1.0) for index in range(len(self.robots))] if faults else None

    def refuse(self, where: Flags, sentence: str) -> None:
        """Those refuse it, for this reason."""
        self._note(where, lambda index: MisuseError(sentence))

    def check(self, where: Flags, check: Callable[[int], None]) -> None:
        """Those refuse it for the reason that `check` raises for their index."""

        def raised(index: int) -> SleepcastError | None:
            try:
                check(index)
            except SleepcastError as error:
                return error
            return None

        self._note(where, raised)

    def _note(self, where: Flags, reason: Callable[[int], SleepcastError | None]) -> None:
        for index in np.flatnonzero(where & self._asked).tolist():
            error = reason(index)
            if error is not None:
                self.obeys[index] = False
                self._faults.setdefault(index, error)
