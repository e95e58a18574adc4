"""A simulated robot behind the wire: commands in words of the wire, motion in SI, and the state that it reports.

Every request of a client, and every command from the page, counts as a sign of life: a robot that is told to
(`conf_tm`) stops when none has come for so many simulated seconds. What it tells is made at most once in a tick, and
anew after a command that is not the one before once more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf, nan

from sleepcast.nomad.server.windows import RobotWindow
from sleepcast.nomad.wire import units
from sleepcast.nomad.wire.encoding import Layout, encode
from sleepcast.nomad.wire.requests import AxisMode, Reply, RequestType, firing_order, moves, name_of
from sleepcast.nomad.wire.state import (
    POS_BUMPER,
    POS_COMPASS,
    POS_INFRARED,
    POS_LASER,
    POS_SONAR,
    RING,
    Mask,
    axes,
    position,
    state_of,
    tail,
    velocity,
)
from sleepcast.robot import Axes, Condition, Pose, SimulatedWorld

LONGEST_TIMEOUT = 255
"""s, the most that conf_tm and ws say."""
LONGEST_PAUSE = 255
"""The slowest firing rate of sonars."""
TOGETHER = 5.0
"""Simulated seconds: who has moved a robot within that drives it, and if another has, both do."""
NO_LASER = (0,)
"""A laser block without points."""

Words = Sequence[int]


class SimulatedRobot:
    """See the module.

    clients: who is connected to it, as text.
    accelerations: what ac last asked for.
    timeout: seconds without a request after which it stops, 0 for never.
    timed_by: who said so.
    """

    def __init__(self, world: SimulatedWorld, robot: int, window: RobotWindow) -> None:
        self.world, self.robot, self.window = world, robot, window
        self.steers = world.steers(robot)
        self.clients: list[str] = []
        self.accelerations = (0, 0, 0)
        self.speed = 1.0
        """Of the simulation, as the state tells it."""
        self.holders: set[str] = set()
        """Who keeps it at rest, whatever is asked."""
        self.timeout, self.timed_by = 0, ""
        self._drivers: dict[str, float] = {}
        """Who has moved it lately, and when, simulated s; the latest is the last."""
        self._asked = world.time
        self._last: tuple[int, Words] = (0, ())
        self._zeroing = self._compass = False
        self._records: PosData | None = None
        self._condition: Condition | None = None
        self._state: list[int] = []
        self._replies: dict[Layout | None, bytes] = {}

    def alive(self) -> None:
        """Note a request to it."""
        self._asked = self.world.time

    # ---- who drives it

    def admit(self, client: str) -> None:
        """This client is connected to it."""
        self.clients.append(client)
        self.window.client = ", ".join(self.clients)

    def dismiss(self, client: str) -> None:
        """And is no longer."""
        self.clients.remove(client)
        self.window.client = ", ".join(self.clients)

    def driven_by(self, who: str) -> str:
        """It is about to be moved by this client. Gives a sentence if until now one alone did, and that was another."""
        alone, before, now = not self.rivals(), self._drivers, self.world.time
        self._drivers = {other: at for other, at in before.items() if other != who and now - at <= TOGETHER}
        self._drivers[who] = now
        both = self.rivals()
        return (
            f"robot {self.robot + 1} is driven by {both}: each replaces what the other asks" if alone and both else ""
        )

    def rivals(self) -> str:
        """Those who drive it together, "" while one alone does."""
        *others, last = sorted(who for who, at in self._drivers.items() if self.world.time - at <= TOGETHER) or [""]
        return f"{', '.join(others)} and {last}" if others else ""

    def let_go_by(self, who: str) -> bool:
        """This client no longer drives it; whether it was the last that did."""
        last = next(reversed(self._drivers), "") == who
        self._drivers.pop(who, None)
        return last

    def abandon(self) -> None:
        """The client that moved it is gone: it stops."""
        self._note("stopped: its program is gone")
        self.command(RequestType.ST, ())

    # ---- what it is asked

    def command(self, kind: int, words: Words) -> None:
        """Do what a command (a key of `COMMANDS`) asks, of which the number of words is right."""
        self.alive()
        if self.held and kind in MOTIONS:
            kind, words = RequestType.ST, ()
        if (kind, words) == self._last:
            return
        self._last = (kind, words)
        self._condition = None
        if kind in MOTIONS or kind in RESTS:
            self._zeroing = False
        self._note(f"{name_of(kind)}({', '.join(map(str, words))})")
        COMMANDS[kind](self, words)

    def drive(self, speed: float, turn_rate: float) -> None:
        """Go on at this speed, m/s along its heading, and turn rate, rad/s counter-clockwise, as far as it can: for
        those who do not speak the wire."""
        self.alive()
        if self.held:
            speed = turn_rate = 0.0
        self._last, self._condition, self._zeroing = (0, ()), None, False
        self._note(f"{speed:.3g} m/s, {turn_rate:.3g} rad/s")
        aside = turn_rate * self.world.track(self.robot) / 2.0
        wanted = Axes(speed, turn_rate) if self.steers else Axes(speed + aside, speed - aside)
        self.world.set_speeds(self.robot, wanted)

    @property
    def held(self) -> bool:
        """Whether somebody keeps it at rest."""
        return bool(self.holders)

    def hold(self, still: bool, by: str) -> None:
        """Keep it at rest from now on, or no longer as far as this one is concerned; nothing old resumes."""
        self.holders = self.holders | {by} if still else self.holders - {by}
        self.window.held = " and ".join(sorted(self.holders))
        if still:
            self.command(RequestType.ST, ())

    def _note(self, command: str) -> None:
        """Show a command in the window, once for many that are the same."""
        commands = self.window.commands
        if not commands or commands[-1][1] != command:
            commands.append((self.world.time, command))

    def glance(self) -> None:
        """Show in the window how it is now."""
        self.window.look(self.condition(), self.world.radius(self.robot))
        self.window.rivals = self.rivals()

    def after_tick(self) -> None:
        """A tick has passed: what was known is old."""
        self._condition = None
        self._last = (0, ())
        if self._zeroing and not any(self.condition().moving):
            self._zeroing = False
            self.window.lift(self.window.actual, self.window.encoder)
        if self.timeout and self.world.time - self._asked > self.timeout and not self._zeroing:
            self._asked = inf
            self._note("stopped: nothing came in time")
            self.world.rest(self.robot)
            self._condition = None
        if self._records is not None:
            self._records.look(self.condition())

    # ---- what it tells

    def condition(self) -> Condition:
        """What there is to know now."""
        if self._condition is None:
            self._condition = self.world.observe(self.robot)
            self._state = []  # a mask may still hold the old one
            self._replies.clear()
        return self._condition

    def state(self) -> list[int]:
        """The state vector now."""
        condition = self.condition()
        if not self._state:
            self._state = state_of(condition, steers=self.steers, speed=self.speed, compass=self._compass)
        return self._state

    def state_reply(self, layout: Layout | None, mask: Mask) -> bytes:
        """The reply to whatever gets the state."""
        seen = mask.sift(self.state())
        plain = mask.everything and not mask.posdata
        if plain and (known := self._replies.get(layout)) is not None:
            return known
        words = [*seen, *NO_LASER, *self.posdata(mask.posdata), *tail(self.condition())]
        reply = encode(layout, Reply.STATE, words)
        if plain:
            self._replies[layout] = reply
        return reply

    def posdata(self, sensors: int) -> list[int]:
        """The PosData of these sensors (bits as in the mask). They are kept from the first request on."""
        if not sensors:
            return []
        if self._records is None:
            self._records = PosData(steers=self.steers)
            self._records.look(self.condition())
        return self._records.words(sensors)

    def stopped(self, flags: Sequence[int]) -> bool:
        """Whether none of the axes that are waited for is moving."""
        return not any(flag and moving for flag, moving in zip(flags, self.condition().moving, strict=True))

    @property
    def zeroing(self) -> bool:
        """Whether `zr` is still under way."""
        return self._zeroing

    # ---- what it does

    def _accelerate(self, words: Words) -> None:
        self.accelerations = (words[0], words[1], words[2])
        self.world.accelerate(self.robot, _positive(axes(words, steers=self.steers)))

    def _cruise(self, words: Words) -> None:
        self.world.cruise(self.robot, _magnitude(axes(words, steers=self.steers)))

    def _drive(self, words: Words) -> None:
        self.world.set_speeds(self.robot, axes(words, steers=self.steers))

    def _travel(self, words: Words) -> None:
        self.world.travel(self.robot, axes(words, steers=self.steers))

    def _rest(self, words: Words) -> None:
        self.world.rest(self.robot)

    def _limp(self, words: Words) -> None:
        self.world.limp(self.robot, (True, True, True))

    def _move(self, words: Words) -> None:
        values = axes(words[1::2], steers=self.steers)
        if AxisMode.ACCELERATION in words[::2]:
            self.world.accelerate(self.robot, _positive(moves(words, AxisMode.ACCELERATION, values)))
        if AxisMode.SPEED in words[::2]:
            self.world.cruise(self.robot, _magnitude(moves(words, AxisMode.SPEED, values)))
        limp = tuple(mode == AxisMode.LIMP for mode in words[::2])
        if any(limp):
            self.world.limp(self.robot, (limp[0], limp[1], limp[2]))
        if AxisMode.VELOCITY in words[::2]:
            self.world.set_speeds(self.robot, moves(words, AxisMode.VELOCITY, values))
        if AxisMode.POSITION in words[::2]:
            self.world.travel(self.robot, moves(words, AxisMode.POSITION, values))

    def _zero(self, words: Words) -> None:
        self._zeroing = True
        self.world.zero(self.robot)

    def _define_place(self, words: Words) -> None:
        self.window.lift(self.window.encoder)
        self.world.believe(self.robot, x=units.metres(words[0]), y=units.metres(words[1]))

    def _define_angles(self, words: Words) -> None:
        turret = units.radians(words[1]) if self.steers else nan
        self.world.believe(self.robot, heading=units.radians(words[0]), turret=turret)

    def _place(self, words: Words) -> None:
        self.window.lift(self.window.actual, self.window.encoder)
        self.world.place(self.robot, self.pose(words))

    def _watch(self, words: Words) -> None:
        self.timeout = max(0, min(words[0], LONGEST_TIMEOUT))

    def _fire(self, words: Words) -> None:
        pause = max(0, min(words[0], LONGEST_PAUSE)) * units.CONFIGURED_PAUSE
        self.world.fire(self.robot, firing_order(words[1 : 1 + RING]), pause)

    def _switch_compass(self, words: Words) -> None:
        self._compass = self.steers and words[0] != 0

    def _nothing_there(self, words: Words) -> None:
        """It has nothing that this would configure."""

    def pose(self, words: Words) -> Pose:
        """x, y, steering and turret of the wire; a body without a turret has it where its heading is."""
        heading = units.radians(words[2])
        turret = units.radians(words[3]) if self.steers else heading
        return Pose(units.metres(words[0]), units.metres(words[1]), heading, turret)


COMMANDS: dict[int, Callable[[SimulatedRobot, Words], None]] = {
    RequestType.AC: SimulatedRobot._accelerate,
    RequestType.SP: SimulatedRobot._cruise,
    RequestType.VM: SimulatedRobot._drive,
    RequestType.PR: SimulatedRobot._travel,
    RequestType.ST: SimulatedRobot._rest,
    RequestType.LP: SimulatedRobot._limp,
    RequestType.MV: SimulatedRobot._move,
    RequestType.ZR: SimulatedRobot._zero,
    RequestType.DP: SimulatedRobot._define_place,
    RequestType.DA: SimulatedRobot._define_angles,
    RequestType.PLACE_ROBOT: SimulatedRobot._place,
    RequestType.CONF_TM: SimulatedRobot._watch,
    RequestType.CONF_SN: SimulatedRobot._fire,
    RequestType.CONF_CP: SimulatedRobot._switch_compass,
    RequestType.CONF_IR: SimulatedRobot._nothing_there,
    RequestType.CONF_LS: SimulatedRobot._nothing_there,
    RequestType.CONF_SG: SimulatedRobot._nothing_there,
}
"""What changes a robot, by type of request."""

MOTIONS = frozenset({RequestType.VM, RequestType.PR, RequestType.MV, RequestType.ZR})
"""Those that move it,"""
STOPS = frozenset({RequestType.ST, RequestType.LP})
RESTS = STOPS | {RequestType.PLACE_ROBOT}
"""and those that end a motion; both end zeroing."""


def _positive(wanted: Axes) -> Axes:
    """With NaN, which changes nothing, for what is not more than 0."""
    return Axes(*(value if value > 0.0 else nan for value in wanted))


def _magnitude(wanted: Axes) -> Axes:
    return Axes(*map(abs, wanted))


# PosData: where a robot was, and how fast, when each of its sensors last measured.

Record = tuple[int, ...]
"""x, y, steering, turret; the speeds of the axes; the clock then, and the clock of the reading."""
BLANK: Record = (0,) * 9


class PosData:
    """The records of one robot. steers: as of its world."""

    def __init__(self, *, steers: bool) -> None:
        self._steers = steers
        self._before: Condition | None = None
        self._infrared = [BLANK] * RING
        self._sonar = [BLANK] * RING
        self._bumper = BLANK
        self._now = BLANK

    def look(self, condition: Condition) -> None:
        """The robot is now like this."""
        clock = tail(condition)[0]
        now = (*position(condition.believed), *velocity(condition.speeds, steers=self._steers), clock, clock)
        before, self._before, self._now = self._before, condition, now
        self._infrared = [now if number < len(condition.infrared) else BLANK for number in range(RING)]
        heard = before.sonars if before else ()
        for number, reading in enumerate(condition.sonars[:RING]):
            if number >= len(heard) or reading != heard[number]:
                self._sonar[number] = now
        if condition.touched and not (before and before.touched):
            self._bumper = now

    def words(self, sensors: int) -> list[int]:
        """The records of these sensors (bits as in the mask), in the order of the wire."""
        records: list[Record] = []
        if sensors & POS_INFRARED:
            records += self._infrared
        if sensors & POS_SONAR:
            records += self._sonar
        if sensors & POS_BUMPER:
            records.append(self._bumper)
        if sensors & POS_LASER:
            records.append(BLANK)
        if sensors & POS_COMPASS:
            records.append(self._now)
        return [word for record in records for word in record]
