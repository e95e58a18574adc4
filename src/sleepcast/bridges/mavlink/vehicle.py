"""Vehicles that speak MAVLink 2 (rovers, boats and copters with ArduPilot) as bodies; `plane` has what planes do.

The vehicle flies itself; a mind gives it setpoints while it is in the mode GUIDED: velocities, or places. Positions
come by GPS, and are metres around an origin; heights count from where the vehicle started. `body` has what this shares
with other bridges, watchdog and limits among them, and `hovering` what copters share with others that hover.

A mode, and arming, come before what moves it: `orders` has them answered one after the other, and setpoints wait for
that. What it does not follow then, because it is in another mode or not armed, is forgotten and told.

STOP, and a hold, send zero velocities; where the vehicle follows none, because it is in a mode of its own such as RTL,
they change its mode to the one in which it stands. When the mind is gone, or the operator's lease is over, the vehicle
changes to the mode of the setting `failsafe`. A hold and the failsafe leave a mode alone that somebody else has chosen.

Somebody else is its pilot with a remote control, another ground station, or the vehicle's own failsafe. They come
first: a mode that they choose ends what was asked of the vehicle, and is changed by a later command or STOP alone.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from math import cos, hypot, inf, isfinite, isnan, nan, pi, remainder, sin
from typing import Any

from sleepcast.bridges.body import REST, BridgedBody, Motion
from sleepcast.bridges.mavlink.link import MavlinkConnection
from sleepcast.bridges.mavlink.model import AUTO, GUIDED, LAND, ROVER, model_of
from sleepcast.bridges.mavlink.orders import (
    ARM_DISARM,
    ASKED,
    AT_ONCE,
    CHANGE_SPEED,
    INTERVAL,
    LAND_START,
    MESSAGES,
    MISSION_ITEM,
    MISSION_START,
    ORDER_SECONDS,
    REPOSITION,
    RESULTS,
    SET_MODE,
    TAKEOFF,
    WITH_PLACE,
    Orders,
    PendingCommand,
)
from sleepcast.bridges.mavlink.plan_flights import PlanFlights
from sleepcast.bridges.mavlink.plans import Circumstances, Plan
from sleepcast.bridges.mavlink.transfer import Party
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError, printable
from sleepcast.core.geodesy import LocalMap, Origin
from sleepcast.core.model import MapOutline
from sleepcast.robot import FRESH, NOBODY_DRIVES, FencedError, Limits, OutOfReachError, Reading, hovering

USUAL = 5.0
"""m: the height of a take-off."""
GCS_SYSTEM_ID, GCS_COMPONENT_ID = 255, 190
"""How we call ourselves: the usual numbers of a ground station."""
SILENT = 2.0
"""Seconds without a message after which the vehicle is out of reach: two of its heartbeats."""
BEAT = 1.0
"""Seconds between two heartbeats of ours: the vehicle's own failsafe waits for several of them."""
AS_FAILSAFE = {"LOITER": "hover", GUIDED: "hover", LAND: "land", "RTL": "rtl"}
"""Modes in which it is safe, by the names of `hovering.FAILSAFES`."""
FAILSAFES_OF_ROVERS = {"hover": "stands", "rtl": "returns home"}
OTHERS = "its failsafe or somebody else"
SETTLES = 0.5
"""Seconds after the answer to an order in which a heartbeat may still tell what was before."""
PARTING = 0.5
"""Seconds for the last order at the end."""
TELL_AGAIN = 5.0
"""Seconds between two reports of refused messages, and between two times of the same sentence."""
RESTARTED = 1.0
"""Seconds by which the vehicle's own time goes back only if it has restarted."""
MAX_STATUS_TEXT = 60
"""Characters of what a vehicle says."""
MAX_SENTENCES = 100
"""Whose times are remembered: a vehicle may say anything."""
RATES = {33: 10.0, 30: 10.0, 1: 1.0, 24: 1.0}
"""Messages that we need, by number (GLOBAL_POSITION_INT, ATTITUDE, SYS_STATUS, GPS_RAW_INT), and how often, 1/s."""
BEGUN_BY = {TAKEOFF: "takeoff", REPOSITION: "goto", LAND_START: "land"}
"""The motion that comes to nothing with an order."""
BEGIN_A_PLAN = (SET_MODE, ARM_DISARM, MISSION_ITEM, MISSION_START)
"""Orders with which a plan comes to nothing."""
LANDED_STATE = {245: 4.0}
"""The same of what can fly (EXTENDED_SYS_STATE)."""
MISSION_STATE = {42: 2.0, 242: 0.2}
"""The same of what has plans (MISSION_CURRENT, HOME_POSITION)."""
FLYING = {1: 0.0, 2: 1.0, 3: 1.0, 4: 1.0}
"""Of each landed state: on the ground; in the air, taking off, landing."""
BODY_FRAME, EARTH_FRAME = 8, 6
VELOCITIES, PLACE = 0x5C7, 0xDF8
"""What a setpoint does not say: all but velocity and yaw rate, all but the place."""


class MavlinkVehicle(BridgedBody):
    """See the module. Its motions besides "speeds" and "climb" are "goto" (x, y, height; m), "takeoff" (height; m), and
    "mode" (its number), which only its failsafe is.

    link: to the vehicle.
    system: its number.
    modes: its own.
    failsafe: the name of one of them.
    origin: of x and y; None for the first place at which it is.
    altitude: of z = 0, m above the sea; NaN for where it started.
    height: of a take-off that says none, m.
    plans: that it may fly, numbered from 1.
    outlines: see `RobotModel`.
    """

    RESTING = 0.3
    """What a GPS tells of a vehicle that stands."""
    FAILSAFES = hovering.FAILSAFES
    """What it does then, unless it is a rover."""
    SPEED_OF: float = 1.0
    """Of what a limit is ordered: of its speed over ground, 0 for that through the air."""
    CIRCLE: float = 0.0
    """m: the radius in which it circles around a place; 0 for one that can stand there."""

    def __init__(
        self,
        link: MavlinkConnection,
        system: int,
        modes: dict[str, int],
        limits: Limits,
        *,
        failsafe: str = "LOITER",
        origin: Origin | None = None,
        altitude: float = nan,
        height: float = USUAL,
        plans: Sequence[Plan] = (),
        outlines: Sequence[MapOutline] = (),
        clock: Clock | None = None,
    ) -> None:
        super().__init__(model_of(modes, limits, type(self), [each.name for each in plans], outlines), clock=clock)
        self._plans = PlanFlights(plans, link, Party(system, GCS_SYSTEM_ID, GCS_COMPONENT_ID))
        self._home: tuple[float, float] | None = None
        """Latitude and longitude of where it started, degrees."""
        self._ground = nan
        """Its altitude, m above the sea."""
        self._link, self._system, self._modes = link, system, modes
        self._flies = modes is not ROVER
        self._altitude, self._usual = altitude, height
        self._names = {number: name for name, number in modes.items()}
        self._standing = modes["HOLD" if modes is ROVER else "LOITER"]
        self.failsafe = Motion("mode", (modes[failsafe],))
        self._map = None if origin is None else LocalMap(origin)
        now = self._clock.now()
        self._fixed = -inf
        """When the vehicle last said where it is, s."""
        self._met, self._beat, self._refusals_told = now, -inf, -inf
        """When it was last heard, when our last heartbeat went out, and when refused messages were last reported, s."""
        self._boot = -inf
        self._complained_at: dict[str, float] = {}
        """When each sentence of ours was last reported."""
        self._mode, self._armed = -1, False
        """The number of its mode, -1 while that is unknown."""
        self._reported_state: tuple[int, bool] | None = None
        """Mode, and whether it is armed, by its last heartbeat, until that has been looked at."""
        self._ordered = self._mode_before = -1
        """The last mode that we have sent, and the one of before the last that was answered."""
        self._sent: dict[int, float] = {}
        """When we have last sent each mode: one that another took the place of may still be on its way."""
        self._mode_settled = self._arming_settled = -inf
        """Until when a heartbeat may still tell what was before an answer."""
        self._reason, self._claimed, self._claim_again = "", (-1, -1), -inf
        """Why it was last looked at whether it must be in another mode than it is ("stop", "hold", "failsafe", or ""
        for not yet); which one, -1 if it need not, and the one in which it was then; when that is ordered again."""
        self._tick = 0
        """Of the mind."""
        self._before = self._motion
        """The motion when this tick began."""
        self._unfollowed: Motion | None = None
        """What it does not follow."""
        self._values: dict[str, float] = {}
        """What it measures, of its sensors: what has not come yet is missing."""
        self._drift, self._ground_speed = (nan, nan), nan
        """Its speeds along its heading and to its left, and in whatever direction, m/s."""
        self._orders = Orders(self._send_command)
        self._begun: Motion | None = None
        self._ask_for_messages()

    # ---- what a bridge says

    @property
    def stale(self) -> bool:
        return self._clock.now() - self._fixed > FRESH

    def reading(self) -> Reading:
        armed, mode = (float(self._armed), float(self._mode)) if self._mode >= 0 else (nan, nan)
        known = {**self._values, **self._plans.measured(), "armed": armed, "mode": mode}
        pairs = [(known.get(sensor.name, nan), sensor) for sensor in self.model.sensors]
        return Reading(max(self._fixed, 0.0), tuple(v if s.low <= v <= s.high else nan for v, s in pairs))

    def course_measured(self) -> tuple[float, float]:
        if self.stale:
            return nan, nan
        climb, turn = (self._values.get(name, nan) for name in ("climb_rate", "turn_rate"))
        return hypot(self._ground_speed, climb), turn

    def drift_measured(self) -> tuple[float, float]:
        return self._drift

    def sense(self) -> Reading:
        with self._lock:
            self._tick += 1
            unfollowed, self._unfollowed = self._unfollowed, None
            waits = bool(self._jobs) or self._orders.waits(ASKED)
            lost = unfollowed is not None and self._motion is unfollowed and not waits
            if lost:
                self._motion = REST
            self._before = self._motion
        if lost:
            self._say_once(
                f"it does not follow: it is in {self._mode_name()}, {'armed' if self._armed else 'not armed'}; "
                "(SET_MODE GUIDED) and (ARM) come first"
            )
        return super().sense()

    def carry_out(self, motion: Motion) -> None:
        self._unfollowed = None
        self._claim_mode(motion)
        if self._orders.waits(ASKED):
            return
        anew, self._begun = motion is not self._begun, motion
        if motion.sort == "plan":
            self._follow_plan(int(motion.values[0]), anew)
            return
        self._plans.leave()
        if self._armed and self._mode == self.mode_for(motion):
            self.follow(motion, anew)
        elif self._current is not REST and motion is not self.failsafe:
            self._unfollowed = self._current

    def mode_for(self, motion: Motion) -> int:
        """The mode in which it follows a motion."""
        return self._modes[GUIDED]

    def _follow_plan(self, number: int, anew: bool) -> None:
        """Send a plan, and begin it once the vehicle has all of it; what it flies must not be written over."""
        if anew:
            self._plans.begin(number, self._clock.now())
            if self._mode == self._modes[AUTO]:
                self._order(SET_MODE, 1.0, float(self._modes[GUIDED]), queue=ASKED, tick=self._tick)
                return
        arrived, why = self._plans.tend(self._clock.now())
        if why:
            self._say_once(f"plan {self._plans.name(number)} was not taken: {why}")
            with self._lock:
                self._motion = REST
        elif arrived:
            self.begin_plan(self._tick)

    def begin_plan(self, tick: int) -> None:
        """Order the mission that it has. A copter is armed in GUIDED, and started: else it would wait for a stick."""
        if not self._armed:
            self.make_ready(tick)
        self._begin_mission(tick)

    def _begin_mission(self, tick: int) -> None:
        asked: dict[str, Any] = {"queue": ASKED, "tick": tick}
        self._order(MISSION_ITEM, 1.0, 1.0, **asked)
        self._order(SET_MODE, 1.0, float(self._modes[AUTO]), **asked)
        self._order(MISSION_START, **asked)
        self._order(CHANGE_SPEED, self.SPEED_OF, self.model.limits.speed, -1.0, **asked)

    def follow(self, motion: Motion, anew: bool) -> None:
        """Send a motion in its mode. anew: for the first time."""
        if motion.sort == "takeoff":
            if anew:
                self._order(TAKEOFF, *(0.0,) * 6, motion.values[0], queue=ASKED, tick=self._tick)
            return
        if motion.sort == "goto" and anew:  # else it would go as fast as its own settings allow
            self._order(CHANGE_SPEED, self.SPEED_OF, self.model.limits.speed, -1.0, queue=ASKED, tick=self._tick)
        self._set_point(motion)

    def _claim_mode(self, motion: Motion) -> None:
        """Bring it, by STOP, a hold or the failsafe, into the mode in which it stands or is safe: until it is there, or
        somebody else has chosen another one."""
        reason = "stop" if self._stopped else "hold" if self._held else "failsafe" if motion is self.failsafe else ""
        if self._stopped or reason != self._reason:
            self._orders.forget(self._could_move if reason else self._is_claim)
        if reason != self._reason and self._mode >= 0:
            self._reason = reason
            self._claimed = self._claim_for(reason), self._mode
        claimed, was = self._claimed
        if claimed < 0:
            return
        if not self._armed or self._mode != was:
            self._claimed = -1, -1
        elif (now := self._clock.now()) >= self._claim_again:
            self._claim_again = now + ORDER_SECONDS
            self._order(SET_MODE, 1.0, float(claimed))

    def _claim_for(self, reason: str) -> int:
        """The mode that it is to be in for this reason, -1 if it stays as it is."""
        self._claim_again = -inf
        wanted = int(self.failsafe.values[0]) if reason == "failsafe" else self._standing
        if not reason or wanted == self._mode or not self._armed:  # with its motors off, on the ground, it is safe
            return -1
        if reason != "failsafe" and self._mode == self._modes[GUIDED]:
            return -1
        if reason == "stop" or self._is_ours():
            if reason == "failsafe":
                self.say_let_go(wanted)
            return wanted
        if reason == "failsafe":
            self._say_once(f"{NOBODY_DRIVES}; it stays in {self._mode_name()}, into which somebody else has put it")
        return -1

    def say_let_go(self, mode: int) -> None:
        """Say what it does in this mode of its failsafe."""
        name = self._names[mode]
        does = FAILSAFES_OF_ROVERS if self._modes is ROVER else self.FAILSAFES
        self._say_once(f"{hovering.let_go(does[AS_FAILSAFE[name]])} ({name})")

    def _is_ours(self) -> bool:
        """Whether we have chosen its mode, or drive it there."""
        return self._mode in (self._modes[GUIDED], self._ordered)

    def _could_move(self, order: PendingCommand) -> bool:
        """Whether an order may set it in motion, or is not that of a STOP."""
        if order.command == ARM_DISARM:
            return order.parameters[0] == 1.0
        if order.command == REPOSITION:  # a plane at rest is told where to circle
            return order.queue == ASKED
        return order.queue != MESSAGES and order.mode != self._standing

    @staticmethod
    def _is_claim(order: PendingCommand) -> bool:
        return order.queue == AT_ONCE and order.mode is not None

    def measure(self) -> None:
        now = self._clock.now()
        for message in self._link.receive():
            if message.get_srcSystem() == self._system:
                self._met = now
                self.take(message)
        self._take_state()
        if now - self._beat >= BEAT:
            self._beat = now
            self._link.send(self._link.mav.heartbeat_encode(6, 8, 0, 0, 4))  # a ground station, active
        for order in self._orders.tend(now):
            self._fail(order, "it has not answered the order about {}")
        if now - self._refusals_told > TELL_AGAIN and self._link.refused:
            self._refusals_told = now
            for sentence in self._link.complaints():
                self.complain(sentence)
        if now - self._met > SILENT:
            raise OutOfReachError(f"vehicle {self._system} has not been heard for {SILENT:g} s{self._refusals()}")

    def rest(self) -> None:
        is_let_go = self._motion is self.failsafe
        super().rest()
        if is_let_go:  # nothing old, but what is safe
            self._motion = self.failsafe

    def seek(self) -> None:
        self._orders.forget(lambda order: True)
        self._link.send(self._link.mav.heartbeat_encode(6, 8, 0, 0, 4))
        messages = [m for m in self._link.receive() if m.get_srcSystem() == self._system]
        if not any(m.get_type() == "HEARTBEAT" for m in messages):
            raise OutOfReachError(f"vehicle {self._system} is not heard{self._refusals()}")
        self._met = self._clock.now()
        for message in messages:
            self.take(message)
        self._take_state(back=True)
        self._ask_for_messages()

    def leave(self) -> None:
        mode = self._standing if self._stopped else int(self.failsafe.values[0])
        with suppress(*self.FAILURES):
            self._orders.forget(lambda order: True)
            ours = self._is_ours() or self._claimed[0] >= 0
            if self._armed and ours and mode != self._mode and self._lost is None:
                self._order(SET_MODE, 1.0, float(mode))
                end = time.monotonic() + PARTING
                while self._orders.waits(AT_ONCE) and time.monotonic() < end:
                    self.measure()
                    time.sleep(0.01)
                if self._orders.waits(AT_ONCE):
                    self._lost = OutOfReachError("it has not answered the last order")
        self._link.close()

    # ---- what expressions may ask

    def arm(self) -> None:
        self.check_free()
        self.send(partial(self._ask_to_arm, self._tick))

    def disarm(self) -> None:
        self.send(self._ask_to_disarm)

    def set_mode(self, mode: float) -> None:
        self.check_free()
        if mode not in self._names:
            raise MisuseError(f"there is no mode {mode:g} here; there are {', '.join(self._modes)}")
        self.send(partial(self._ask_for_mode, int(mode), self._tick))
        with self._lock:
            if mode != self._mode and self._motion is self._before:  # what this tick asks for comes after the mode
                self._motion = REST

    def go_to(self, x: float, y: float, z: float = nan) -> None:
        hovering.check_place(self.model.limits, x, y, self.CIRCLE)
        if self._map is None:
            raise MisuseError("the vehicle has not said yet where it is")
        known, limits = self._sensed(), self.model.limits
        here = known.get("x", nan), known.get("y", nan)
        if limits.holds(*here) and not limits.holds_way(here, (x, y)):
            raise FencedError(f"the way to ({x:g}, {y:g}) m passes the fence")
        height = self._values.get("height", nan)
        if isfinite(z) and self._flies:
            height += z - self._values.get("z", nan)
            hovering.check_height(self.model.limits, height)
        self.move(Motion("goto", (x, y, height)))

    def take_off(self, height: float = nan) -> None:
        wanted = self._usual if isnan(height) else height
        hovering.check_height(self.model.limits, wanted)
        self.check_hands()
        if self._stopped:
            return
        self.send(partial(self.make_ready, self._tick))
        if self._sensed().get("flying") == 1.0:  # where it is, since a vehicle that flies takes off no more
            self.move(Motion("goto", (*self.here(), wanted)))
        elif (self._motion.sort, self._motion.values) != ("takeoff", (wanted,)):  # a rule says it in every tick
            self.move(Motion("takeoff", (wanted,)))

    def fly_plan(self, plan: float) -> None:
        """Fly the plan with this number, or drive it; only one that is done is begun again. Raises FencedError, too."""
        number = self._plans.number(plan)
        if self._map is None:
            raise MisuseError("the vehicle has not said yet where it is")
        self.check_hands()
        if self._motion.sort == "plan" and self._plans.flies(number):  # a rule says it in every tick
            return
        known, home = self._sensed(), None if self._home is None else self._map.metres(*self._home)
        here = known.get("x", nan), known.get("y", nan)
        around = Circumstances(self.model.limits, self._map, here, home, self._ground, self._flies, self.CIRCLE)
        self._plans.check(number, around)
        if not self._stopped:
            self.move(Motion("plan", (float(number),)))

    def here(self) -> tuple[float, float]:
        """x and y (m) of the place at which it stays if it stays where it is; NaN for unknown."""
        known = self._sensed()
        return known.get("x", nan), known.get("y", nan)

    def check_hands(self) -> None:
        """Raise MisuseError in the mode of somebody else: it is in the hands of its pilot, who would lose it."""
        if self._armed and not self._is_ours():
            raise MisuseError(f"somebody else has put it into {self._mode_name()}: (SET_MODE GUIDED) takes it from him")

    def touch_down(self) -> None:
        if not self._stopped:
            self.set_mode(self._modes[LAND])

    def make_ready(self, tick: int) -> None:
        """Ask for the mode in which it takes off, and to arm. tick: of the mind."""
        self._ask_for_mode(self._modes[GUIDED], tick)
        if not self._armed:
            self._ask_to_arm(tick)

    def _ask_for_mode(self, mode: int, tick: int) -> None:
        last = self._orders.last(SET_MODE, ASKED)
        if self._stopped or mode == (self._mode if last is None else last.mode):  # a rule says it in every tick
            return
        self._orders.forget(lambda order: order.queue == ASKED and order.tick < tick)
        self._order(SET_MODE, 1.0, float(mode), queue=ASKED, tick=tick)

    def _ask_to_arm(self, tick: int) -> None:
        if not self._stopped:  # it may have been stopped since
            self._order(ARM_DISARM, 1.0, queue=AT_ONCE if self._armed else ASKED, tick=tick)

    def _ask_to_disarm(self) -> None:
        self._orders.forget(lambda order: order.queue == ASKED and order.command in (ARM_DISARM, TAKEOFF))
        self._order(ARM_DISARM, 0.0)

    # ---- what is sent

    def _ask_for_messages(self) -> None:
        more = {**(LANDED_STATE if self._flies else {}), **(MISSION_STATE if self._plans.known else {})}
        for number, rate in {**RATES, **more}.items():
            self._order(INTERVAL, float(number), 1e6 / rate, queue=MESSAGES)

    def _order(
        self, command: int, *parameters: float, queue: str = AT_ONCE, tick: int = 0, mode: int | None = None
    ) -> None:
        """Send a command, and again until it is answered. tick: of the mind that wants it; mode: see
        `PendingCommand`."""
        filled = (*parameters, *(0.0,) * (7 - len(parameters)))
        order = PendingCommand(command, filled, queue, tick, int(filled[1]) if command == SET_MODE else mode)
        if not self._orders.add(self._clock.now(), order):
            self._fail(order, "too many orders wait for an answer: it was not sent the one about {}")

    def _send_command(self, order: PendingCommand) -> None:
        if order.mode is not None:
            self._ordered = order.mode
            self._sent[self._ordered] = self._clock.now()
        mav, head = self._link.mav, (self._system, 1)
        if order.command in WITH_PLACE:  # numbers of four bytes are too few for degrees
            *before, latitude, longitude, height = order.parameters
            place = int(latitude), int(longitude), height
            self._link.send(mav.command_int_encode(*head, EARTH_FRAME, order.command, 0, 0, *before, *place))
        else:
            self._link.send(mav.command_long_encode(*head, order.command, order.sent % 256, *order.parameters))

    def _fail(self, order: PendingCommand, sentence: str) -> None:
        """An order has come to nothing. sentence: with a place for its name."""
        others = [other.name for other in self._orders.end(order)]
        with self._lock:
            needed = order.command in BEGIN_A_PLAN or (order.command == CHANGE_SPEED and not self._armed)
            begun = "plan" if needed and self._motion.sort == "plan" else BEGUN_BY.get(order.command)
            if order.queue == ASKED and self._motion.sort == begun:
                self._motion = REST
        if order.command != INTERVAL:
            after = f"; {' and '.join(others)}, asked for with it, {'is' if len(others) == 1 else 'are'} left out"
            self._say_once(sentence.format(order.name) + (after if others else ""))

    def _set_point(self, motion: Motion) -> None:
        """Of velocity for all motions but "goto"; zero for those that have none."""
        stamp = int(self._clock.now() * 1000.0) & 0xFFFFFFFF
        if motion.sort == "goto" and self._map is not None and isfinite(sum(motion.values)):
            x, y, height = motion.values
            ((latitude, longitude),) = self._map.degrees([x], [y])
            to = int(latitude * 1e7), int(longitude * 1e7), height
            encode = self._link.mav.set_position_target_global_int_encode
            self._link.send(encode(stamp, self._system, 1, EARTH_FRAME, PLACE, *to, *(0.0,) * 8))
            return
        speed, turn, side, climb = (*motion.values, 0.0, 0.0)[:4] if motion.sort == "speeds" else (0.0,) * 4
        encode = self._link.mav.set_position_target_local_ned_encode
        velocity = (0.0, 0.0, 0.0, speed, -side, -climb, 0.0, 0.0, 0.0, 0.0, -turn)
        self._link.send(encode(stamp, self._system, 1, BODY_FRAME, VELOCITIES, *velocity))

    # ---- what has come

    def take(self, message: Any) -> None:
        """A message of this vehicle."""
        self._plans.hear(message, self._clock.now())
        match message.get_type():
            case "HEARTBEAT" if message.get_srcComponent() == 1:
                self._reported_state = message.custom_mode, bool(message.base_mode & 128)
            case "GLOBAL_POSITION_INT":
                self._take_position(message)
            case "ATTITUDE":
                self._check_boot(message.time_boot_ms / 1000.0)
                self._values["turn_rate"] = -message.yawspeed
            case "SYS_STATUS":
                left, volts = message.battery_remaining, message.voltage_battery
                self._values["battery"] = nan if left < 0 else left / 100.0
                self._values["volts"] = nan if volts == 65_535 else volts / 1000.0
            case "GPS_RAW_INT":
                seen = message.satellites_visible
                self._values["gps_fix"] = float(message.fix_type)
                self._values["satellites"] = nan if seen == 255 else float(seen)
            case "HOME_POSITION":
                self._home = message.latitude / 1e7, message.longitude / 1e7
            case "EXTENDED_SYS_STATE":
                self._values["flying"] = FLYING.get(message.landed_state, nan)
            case "COMMAND_ACK":
                if message.target_system in (0, GCS_SYSTEM_ID) and message.target_component in (0, GCS_COMPONENT_ID):
                    self._hear_answer(message.command, message.result)
            case "STATUSTEXT" if message.severity <= 4:  # a warning, or worse
                text = printable(message.text.strip("\0 "))[:MAX_STATUS_TEXT]
                self._say_once(f"the vehicle says: {text}")

    def _take_position(self, message: Any) -> None:
        self._check_boot(message.time_boot_ms / 1000.0)
        latitude, longitude = message.lat / 1e7, message.lon / 1e7
        if self._map is None:
            if not (latitude or longitude) or abs(latitude) > 90.0 or abs(longitude) > 180.0:  # it does not know yet
                return
            self._map = LocalMap(Origin(latitude, longitude))
        x, y = self._map.metres(latitude, longitude) or (nan, nan)
        heading = nan if message.hdg == 65_535 else remainder(pi / 2.0 - message.hdg / 100.0 * pi / 180.0, 2.0 * pi)
        east, north = message.vy / 100.0, message.vx / 100.0
        ahead, left = cos(heading), sin(heading)
        self._ground_speed = hypot(east, north)
        self._drift = east * ahead + north * left, north * ahead - east * left
        height = message.relative_alt / 1000.0
        self._ground = message.alt / 1000.0 - height
        z = height if isnan(self._altitude) else message.alt / 1000.0 - self._altitude
        self._values |= {"x": x, "y": y, "z": z, "height": height, "heading": heading}
        self._values |= {"speed": self._drift[0], "climb_rate": -message.vz / 100.0}
        self._fixed = self._clock.now()

    def _check_boot(self, seconds: float) -> None:
        """seconds: since the vehicle started, by its own clock."""
        if seconds < self._boot - RESTARTED:
            self.rest()
            self._mode, self._armed, self._reason = -1, False, ""
            self._values.pop("flying", None)
            self._orders.forget(lambda order: True)
            self._ask_for_messages()
            self.complain("the vehicle has restarted; it is at rest until a command moves it")
            self._boot = seconds
        self._boot = max(self._boot, seconds)

    def _hear_answer(self, command: int, result: int) -> None:
        order = self._orders.answered(command, result)
        if order is None:
            return
        if result:
            why = RESULTS[result] if result < len(RESULTS) else f"result {result}"
            self._fail(order, f"the order about {{}} was answered: {why}")
            return
        settled = self._clock.now() + SETTLES  # the next heartbeat, which says so, may be a second away
        if order.mode is not None:
            self._mode_before, self._mode, self._mode_settled = self._mode, order.mode, settled
            self._reason = ""
        elif order.command == ARM_DISARM and order.parameters[0] == 1.0:
            self._armed, self._arming_settled = True, settled

    def _take_state(self, *, back: bool = False) -> None:
        """Look at its last heartbeat: whether somebody else has changed its mode, or switched its motors off. back:
        whether that may have been before a STOP."""
        if self._reported_state is None:
            return
        (mode, armed), self._reported_state = self._reported_state, None
        now = self._clock.now()
        if mode == self._mode_before and now < self._mode_settled:
            mode = self._mode
        armed = armed or now < self._arming_settled
        before, was_armed = self._mode, self._armed
        self._mode, self._armed = mode, armed
        if before < 0:
            return
        if mode != before:
            if mode == self._ordered or now - self._sent.get(mode, -inf) < ORDER_SECONDS:
                self._reason = ""  # it may have come after a STOP that was to prevent it
            else:
                self._ordered = -1
                if back:
                    self._reason = ""
                self._yield(f"{OTHERS} has put it into {self._mode_name()}: {self._what_holds(back)}")
        elif was_armed and not armed:
            self._yield("its motors are off; it is at rest until it is armed and a command moves it")

    def _yield(self, why: str) -> None:
        """Forget what was asked of it: somebody else, or the vehicle itself, has decided otherwise."""
        self._orders.forget(lambda order: order.queue == ASKED)
        with self._lock:
            if self._motion is not self.failsafe:
                self._motion = REST
            self._sent_motion, self._going = None, self._at_rest
        self._say_once(why)

    def _what_holds(self, back: bool) -> str:
        if self._mode == self._modes[GUIDED]:
            return "it is at rest"
        if self._stopped and self._mode != self._standing:
            return "STOP ends that" if back else "STOP does not hold it there"
        return "it is left alone"

    def _mode_name(self) -> str:
        return "an unknown mode" if self._mode < 0 else self._names.get(self._mode, f"mode {self._mode}")

    def _say_once(self, sentence: str) -> None:
        """Say it at the node, but not twenty times a second."""
        now = self._clock.now()
        if now - self._complained_at.get(sentence, -inf) > TELL_AGAIN:
            if len(self._complained_at) >= MAX_SENTENCES:
                self._complained_at.clear()
            self._complained_at[sentence] = now
            self.complain(sentence)

    def _refusals(self) -> str:
        return "".join(f"; {sentence}" for sentence in self._link.complaints())
