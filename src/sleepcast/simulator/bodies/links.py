"""Links between minds and bodies that a scenario cuts: nothing that a mind asks for reaches a body that is cut off.

What the body does then is what its real twin does. A base on the ground stands, since its speeds stay away. A Crazyflie
(`flight.watchdog`) levels out, and its motors stop for good when it has heard no setpoint for so long. What else flies
goes on with what it was told for `DRIVEN_ON`, and then its `flight.failsafe` acts. When the link is back, nothing old
goes on.

Who is cut off follows from the scenario and the tick alone, so that a snapshot, a fork and a batch hold nothing of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import numpy as np

from sleepcast.core.records import NamedTuple
from sleepcast.core.ticks import tick_at
from sleepcast.robot import OUT_OF_REACH, REACHED_AGAIN
from sleepcast.simulator.bodies.bodies import Bodies
from sleepcast.simulator.bodies.flight import Flight
from sleepcast.simulator.bodies.pilot import pilot_of
from sleepcast.simulator.motion.driving import DRIVE
from sleepcast.simulator.motion.flying import LANDS
from sleepcast.simulator.scenario.events import LinkCut

DRIVEN_ON = 3.0
"""Seconds after which a vehicle of ArduPilot drops velocities that are not renewed (`GUID_TIMEOUT`)."""
LOST = f"{OUT_OF_REACH}: its link is cut"


class CutTicks(NamedTuple):
    """The link of this robot (an index) is cut in the ticks from `begins` up to `ends`, and on the tick `acts` the body
    helps itself, if it is cut off still; inf for never."""

    robot: int
    begins: int
    acts: float
    ends: float


class Links:
    """The links of the bodies of a world, of which a scenario cuts some."""

    def __init__(self, bodies: Bodies, cuts: Sequence[LinkCut]) -> None:
        self._bodies = bodies
        self._cuts = [self._ticks_of(cut) for cut in cuts]

    def _ticks_of(self, cut: LinkCut) -> CutTicks:
        tick, flight = self._bodies.scenario.tick, self._bodies.part_of(cut.robot).scenario.robots.flight
        begins, ends = max(1, tick_at(cut.time, tick)), inf
        if cut.lasts < inf:
            ends = max(begins + 1, tick_at(cut.time + cut.lasts, tick))
        waits = DRIVEN_ON if flight is None or flight.watchdog == inf else flight.watchdog
        return CutTicks(cut.robot, begins, max(begins + 1, tick_at(cut.time + waits, tick)), ends)

    def look(self, tick: int) -> None:
        """Let the bodies know whose link is cut in this tick."""
        cut_off = self._bodies.cut_off
        cut_off[:] = False
        for cut in self._cuts:
            cut_off[cut.robot] |= cut.begins <= tick < cut.ends

    def step(self) -> None:
        """What the next tick begins with, before anything moves: links that are cut or back, and bodies that help
        themselves."""
        tick = self._bodies.tick + 1
        for cut in self._cuts:
            if tick == cut.begins:
                self._lose(cut.robot)
            elif tick == cut.ends:
                self._reach(cut)
            elif tick == cut.acts < cut.ends:
                self._act(cut.robot)
        self.look(tick)
        self._bodies.still[:] = self._bodies.held & ~self._bodies.cut_off

    def _lose(self, robot: int) -> None:
        """The link is gone. Only what renews its own motion flies on, unless its mind holds it still."""
        bodies, flight = self._bodies, self._flight_of(robot)
        bodies.say_of(robot, LOST)
        spec = bodies.part_of(robot).scenario.robots.flight
        if flight is None or spec is None or spec.watchdog < inf or bodies.held[robot]:
            self._rest(robot)

    def _reach(self, cut: CutTicks) -> None:
        """The link is back. What a body that flies has begun by itself goes on, unless it is stopped."""
        bodies, flight = self._bodies, self._flight_of(cut.robot)
        helped = flight is not None and cut.acts < cut.ends
        if not helped or bodies.stopped[cut.robot]:
            self._rest(cut.robot)
        bodies.say_of(cut.robot, REACHED_AGAIN)

    def _act(self, robot: int) -> None:
        """The body has waited for its mind long enough."""
        flight, which = self._flight_of(robot), np.array([robot])
        if flight is None or flight.armed[robot] == 0.0:
            return
        spec = self._bodies.part_of(robot).scenario.robots.flight
        assert spec is not None
        if not flight.z[robot] > flight.ground[robot]:
            flight.rest(which)
        elif spec.watchdog < inf:
            pilot_of(self._bodies).lock(which)
        elif flight.target_z[robot] != LANDS:
            flight.rest(which)
            pilot_of(self._bodies).let_go(which)

    def _rest(self, robot: int) -> None:
        """End what moves this body."""
        bodies, which = self._bodies, np.array([robot])
        bodies.swing[robot] = 0.0
        if bodies.flight is not None and bodies.flight.flies[robot]:
            bodies.flight.rest(which)
            return
        bodies.mode[robot] = DRIVE
        for wanted in (bodies.wanted_speed, bodies.wanted_turn, bodies.wanted_side):
            if wanted.size:
                wanted[robot] = 0.0

    def _flight_of(self, robot: int) -> Flight | None:
        """What flies, if this body is of it."""
        flight = self._bodies.flight
        return flight if flight is not None and flight.flies[robot] and flight.collides else None
