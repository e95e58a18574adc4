"""Planes with ArduPilot as bodies: they cannot stand, so they circle.

In GUIDED a plane goes to a place and circles around it; it is told places only, once each, with the radius of the
circle. At rest, under STOP and in a hold it circles where it is, and goes on with the circle that it flies already. Its
places lie that radius inside its fence, and so does the place of every rest: it begins its turn a turning radius before
the fence. In a mode of its own, STOP changes the mode to LOITER, which circles, too.

A take-off is its mode TAKEOFF, which climbs straight on; once its wings need not be level any more, it is put into
GUIDED and circles at the height that was asked for. It lands as its own mission says.
"""

from __future__ import annotations

from math import hypot, isfinite, nan
from typing import Any

from sleepcast.bridges.body import Motion
from sleepcast.bridges.mavlink.model import AUTO, GUIDED, TAKEOFF
from sleepcast.bridges.mavlink.orders import (
    ASKED,
    AT_ONCE,
    CHANGE_SPEED,
    LAND_START,
    ORDER_SECONDS,
    REPOSITION,
    SET_MODE,
    PendingCommand,
)
from sleepcast.bridges.mavlink.vehicle import MavlinkVehicle
from sleepcast.core.errors import MisuseError
from sleepcast.core.model import RestState
from sleepcast.robot import Limits, Setpoint, hovering

LEVEL = 30.0
"""m of height above which ArduPilot lets a plane bank freely after a take-off: three times its TKOFF_LVL_ALT."""
Circle = tuple[float, float, float]
"""x and y of its middle, and height above where the plane started, m."""


class MavlinkPlane(MavlinkVehicle):
    """See the module. Its motions are "goto", "takeoff", "land" and rest."""

    CIRCLE = 60.0
    SPEED_OF = 0.0
    FAILSAFES = hovering.FAILSAFES_OF_PLANES

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        super().__init__(*arguments, **settings)
        self._circle: Circle | None = None
        """Where it circles, or goes to circle, in GUIDED; None until it is known where."""
        self._told: Circle | None = None
        """What it was told of that, None if that has failed."""
        self._roomy: tuple[float, float] | None = None
        """The last place where there was room for a circle."""
        self._tell_again = 0.0
        """When it is told again, s."""

    # ---- a Robot

    def narrow(self, limits: Limits) -> None:
        if limits.fence is not None:
            left, bottom, right, top = limits.fence
            hovering.check_room(right - left, top - bottom, self.CIRCLE)
        super().narrow(limits)

    def act(self, wanted: Setpoint) -> None:
        """A plane takes no speeds, and has no actuators."""

    def rest_state(self) -> RestState | None:
        """A plane that circles where it was told to is at rest: it comes to no other."""
        measured = super().rest_state()
        if not self._stopped or measured is None or measured.at_rest or self.stale:
            return measured
        circles = self._mode == self._standing or (self._mode == self._modes[GUIDED] and self._is_on(self._told))
        return RestState(0.0, 0.0) if circles else measured

    # ---- what expressions may ask

    def climb(self, speed: float) -> None:
        raise MisuseError(hovering.GLIDES)

    def touch_down(self) -> None:
        self.check_hands()
        if not self._stopped and self._motion.sort != "land":  # a rule says it in every tick
            self.move(Motion("land"))

    def make_ready(self, tick: int) -> None:
        flies = self._sensed().get("flying") == 1.0
        self._ask_for_mode(self._modes[GUIDED if flies else TAKEOFF], tick)
        if not self._armed:
            self._ask_to_arm(tick)

    def here(self) -> tuple[float, float]:
        """Where it is, or, if its circle there would pass the fence, a place near by."""
        (x, y), limits = super().here(), self.model.limits
        if limits.fence is not None:
            left, bottom, right, top = limits.fence
            x = min(max(x, left + self.CIRCLE), right - self.CIRCLE)
            y = min(max(y, bottom + self.CIRCLE), top - self.CIRCLE)
        return (x, y) if limits.holds(x, y, self.CIRCLE) or self._roomy is None else self._roomy

    # ---- what is sent

    def mode_for(self, motion: Motion) -> int:
        if motion.sort == "land":
            return self._mode
        return self._modes[TAKEOFF if motion.sort == "takeoff" else GUIDED]

    def begin_plan(self, tick: int) -> None:
        """Armed in any other mode, it would open the throttle before it has a way to go."""
        self._begin_mission(tick)
        if not self._armed:
            self._ask_to_arm(tick)

    def follow(self, motion: Motion, anew: bool) -> None:
        match motion.sort:
            case "takeoff":
                self._rise(motion)
            case "land":
                if anew:
                    self._order(LAND_START, queue=ASKED, tick=self._tick, mode=self._modes[AUTO])
            case "goto":
                if anew:
                    x, y, height = motion.values
                    self._circle = x, y, height
                    self._order(
                        CHANGE_SPEED, self.SPEED_OF, self.model.limits.speed, -1.0, queue=ASKED, tick=self._tick
                    )
                    self._tell(ASKED)
            case _ if self._claimed[0] < 0:  # else it is on its way into another mode
                if anew or self._circle is None:
                    self._circle = self._resting_circle()
                if self._circle != self._told and self._clock.now() >= self._tell_again:
                    self._tell(AT_ONCE)

    def _claim_for(self, reason: str) -> int:
        circles = self._mode == self._modes[GUIDED] and self.failsafe.values[0] == self._standing
        if reason != "failsafe" or not circles or not self._armed:
            return super()._claim_for(reason)
        self.say_let_go(self._mode)
        return -1

    def carry_out(self, motion: Motion) -> None:
        if self._mode != self._modes[GUIDED]:
            self._circle = self._told = None
            self._orders.forget(lambda order: order.command == REPOSITION)
        place = super().here()
        if isfinite(sum(place)) and self.model.limits.holds(*place, self.CIRCLE):
            self._roomy = place
        super().carry_out(motion)

    def _rise(self, motion: Motion) -> None:
        """Bring a plane that takes off into GUIDED as soon as it may bank."""
        known = self._sensed()
        if known.get("flying") != 1.0 or not known.get("height", nan) >= min(motion.values[0], LEVEL):
            return
        self._order(SET_MODE, 1.0, float(self._modes[GUIDED]), queue=ASKED, tick=self._tick)
        with self._lock:
            if self._motion is motion:
                self._motion = Motion("goto", (*self.here(), motion.values[0]))

    def _resting_circle(self) -> Circle | None:
        """Where it circles at rest: where it does so already, or else here; None if it does not know where it is."""
        known, limits = self._sensed(), self.model.limits
        height = min(max(known.get("height", nan), limits.floor), limits.ceiling)
        if not isfinite(known.get("x", nan) + height):
            return None
        x, y = self._circle[:2] if self._circle and self._is_on(self._circle) else self.here()
        return x, y, height

    def _is_on(self, circle: Circle | None) -> bool:
        """Whether it flies this circle."""
        known = self._sensed()
        if circle is None or not known:
            return False
        return hypot(known["x"] - circle[0], known["y"] - circle[1]) <= hovering.ON_ITS_CIRCLE * self.CIRCLE

    def _tell(self, queue: str) -> None:
        """Tell it where to circle."""
        if self._circle is None or self._map is None:
            return
        self._orders.forget(lambda order: order.command == REPOSITION)  # it goes where it was told last
        x, y, height = self._told = self._circle
        ((latitude, longitude),) = self._map.degrees([x], [y])
        place = float(int(latitude * 1e7)), float(int(longitude * 1e7)), height
        self._order(REPOSITION, -1.0, 0.0, self.CIRCLE, 0.0, *place, queue=queue, tick=self._tick)

    def _fail(self, order: PendingCommand, sentence: str) -> None:
        super()._fail(order, sentence)
        if order.command == REPOSITION:
            self._told, self._tell_again = None, self._clock.now() + ORDER_SECONDS
