"""A Nomad behind a Nserver as a body for a mind: `body` has what it shares with other bridges.

The server stops the robot when this process is gone (`TIMEOUT`). A server that is gone is looked for again and again;
in step, it is the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from math import copysign, isnan, nan, pi
from threading import Thread

from sleepcast.bridges.body import PATIENCE, REST, BridgedBody, BusyError, Motion
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError
from sleepcast.core.records import dataclass
from sleepcast.nomad.client.nomad import PARTING_SECONDS, Nomad, NomadError, Pose, RequestError
from sleepcast.nomad.wire.state import State
from sleepcast.nomad.wire.units import INCH, INFRARED_STEP, NOTHING_HEARD, NOTHING_NEAR, TENTH, TENTH_DEGREE
from sleepcast.robot import Axes, Limits, Reading, RobotModel

TIMEOUT = 1
"""Whole seconds without a request after which the server stops the robot: as every program of the thesis has it."""
FARTHEST = 1_000.0
"""m or rad that an axis may be asked to go in one go."""
LEAST_BRAKING = 0.5
"""Share of the acceleration that is always left: however gently it is to drive, a robot must be able to stop."""
FRONT = range(-4, 5)
"""Numbers of the sonars in front, within a quarter turn to both sides."""

TURN = 2.0 * pi
_FARTHEST_ECHO = NOTHING_HEARD * INCH


class NomadRobot(BridgedBody):
    """See the module; `nomad` names what expressions may ask of it. SI units; x, y and heading are what its encoders
    give, in the frame of the server's world.

    base: its type. Its motions have a value for each axis: "speeds" (m/s, rad/s), "way" (m, rad), and "limp" has none.
    """

    RENEWS = False
    KEEPS_ACCELERATION = True
    FAILURES = (NomadError,)
    REFUSALS = (RequestError, MisuseError)

    def __init__(
        self, nomad: Nomad, base: Base, model: RobotModel, *, clock: Clock | None = None, in_step: bool = False
    ) -> None:
        super().__init__(model, clock=clock, in_step=in_step)
        self.base, self._nomad = base, nomad
        self._number = nomad.robot
        self._zeroing: Thread | None = None
        self._before = 0.0
        """Seconds that other servers had counted before this one began to count."""
        self._greet(nomad)
        self._state = nomad.state

    def _greet(self, nomad: Nomad) -> None:
        """What a server is sent first."""
        nomad.conf_tm(TIMEOUT)
        nomad.st()
        nomad.sp(*self.base.words(self.base.speeds))
        if self.base.accelerations != BASES[self.base.name].accelerations:
            nomad.ac(*self.base.words(self.base.whole(self.base.accelerations)))

    @property
    def state(self) -> State:
        """What the server last sent."""
        return self._state

    # ---- what a bridge says

    def carry_out(self, motion: Motion) -> object:
        if motion.sort == "speeds":
            return self._nomad.vm(*self.base.words(Axes(*motion.values)))
        if motion.sort == "way":
            return self._nomad.pr(*self.base.words(Axes(*motion.values)))
        return self._nomad.lp() if motion.sort == "limp" else self._nomad.st()

    def measure(self) -> None:
        if self._nomad.state is self._state:  # no other reply has brought it
            self._nomad.gs()
        self._state = self._nomad.state

    def reading(self) -> Reading:
        return Reading(self._before + self._state.time, self._values(self._state))

    def seek(self) -> None:
        last, connection = self.now(), self._nomad.connection
        nomad = Nomad.connect(connection.host, connection.port, robot=self._number, timeout=PATIENCE)
        try:
            self._greet(nomad)
        except BaseException:
            nomad.connection.close()
            raise
        self._before = max(self._before, last - nomad.state.time)  # a restarted server counts from 0
        self._nomad, self._state = nomad, nomad.state

    def leave(self) -> None:
        if self._lost is None and self._nomad.connection.open:
            self._nomad.timeout = PARTING_SECONDS
            try:
                self._nomad.st()
            except NomadError as error:
                self._lost = error
        with suppress(NomadError):
            self._nomad.disconnect_robot()

    def course(self, motion: Motion) -> tuple[float, float] | None:
        if motion.sort not in ("speeds", "way"):
            return None
        wanted, turn = self.base.motion(Axes(*motion.values))
        if motion.sort == "way":  # at whatever speed it comes to
            limits = self.base.limits
            return copysign(limits.speed, wanted) if wanted else 0.0, limits.turn_rate if turn else 0.0
        return wanted, turn

    # ---- what expressions may ask; see nomad

    def drive(self, speed: float, turn_rate: float) -> None:
        self.move(Motion("speeds", self.base.within(self.base.axes(speed, turn_rate))))

    def turn_axes(self, first: float, second: float, third: float = 0.0) -> None:
        self.move(Motion("speeds", self.base.within(Axes(first, second, third))))

    def travel(self, first: float, second: float, third: float = 0.0) -> None:
        ways = (min(max(way, -FARTHEST), FARTHEST) for way in (first, second, third))
        self.move(Motion("way", Axes(*ways)))

    def halt(self) -> None:
        self.move(REST)

    def limp(self) -> None:
        self.move(Motion("limp"))

    def cruise(self, *speeds: float) -> None:
        words = self.base.words(_sizes(speeds, self.base.speeds))
        self.send(lambda: self._nomad.sp(*words))

    def accelerate(self, *accelerations: float) -> None:
        words = self.base.words(_sizes(accelerations, self.base.whole(self.base.accelerations), LEAST_BRAKING))
        self.send(lambda: self._nomad.ac(*words))

    def zero(self) -> None:
        """Over a connection of its own: it may take two minutes, and STOP must not wait for it."""
        if self._stopped:
            return
        self.keep_its_place()
        if self._zeroing is not None and self._zeroing.is_alive():
            raise BusyError("it is still on its way home from the last ZR")
        self.move(REST)
        self._zeroing = self.beside(self._zero, "ZR")

    def believe_place(self, x: float, y: float) -> None:
        self.keep_its_place()
        self.send(lambda: self._nomad.believe_place(x, y))

    def believe_heading(self, heading: float, turret: float | None = None) -> None:
        self.keep_its_place()
        angles = heading % TURN, (heading if turret is None else turret) % TURN
        self.send(lambda: self._nomad.believe_heading(*angles))

    def place(self, x: float, y: float, heading: float, turret: float | None = None) -> None:
        self.keep_its_place()
        pose = Pose(x, y, heading % TURN, (heading if turret is None else turret) % TURN)
        if not self._stopped:
            self.send(lambda: self._nomad.place(pose))

    def say(self, text: str) -> None:
        self.send(lambda: self._nomad.say(text))

    def fire_sonars(self, pause: float, *order: float) -> None:
        sonars = tuple(int(number) for number in order if 0 <= number < self.model.geometry.sonars)
        every = range(self.model.geometry.sonars)
        self.send(lambda: self._nomad.fire_sonars(min(max(pause, 0.0), 1.02), sonars if order else every))

    def sonar(self, which: float) -> float:
        return self._ranges()[int(which) % self.model.geometry.sonars]

    def nearest(self, first: float, last: float) -> float:
        sonars = self._ranges()
        step = TURN / len(sonars)
        wide = last - first if last - first >= TURN else (last - first) % TURN
        there = [reading for number, reading in enumerate(sonars) if (number * step - first) % TURN <= wide]
        return min((reading for reading in there if not isnan(reading)), default=nan if there else _FARTHEST_ECHO)

    def _ranges(self) -> list[float]:
        """Of the sonars, m, now; NaN where nothing is known."""
        if self.stale:
            return [nan] * self.model.geometry.sonars
        return _ranges(self._state)

    def _zero(self) -> None:
        connection = self._nomad.connection
        other = Nomad.connect(connection.host, connection.port, robot=self._nomad.robot, timeout=PATIENCE)
        try:
            other.zr()
        finally:
            other.disconnect_robot()

    # ---- readings

    def _values(self, state: State) -> tuple[float, ...]:
        """In the order of `nomad.sensors`."""
        sonars = _ranges(state)
        common = (
            state.x,
            state.y,
            state.heading,
            *self.base.measured(state),
            float(any(state.moving)),
            float((state.bumper & -state.bumper).bit_length()),
            state.computer_volts,
            state.motor_volts,
            *sonars,
            min((sonars[number] for number in FRONT if not isnan(sonars[number])), default=nan),
        )
        if self.base.track:
            return common
        return (*common, state.turret, *(min(max(steps, 0), NOTHING_NEAR) * INFRARED_STEP for steps in state.infrared))


def _ranges(state: State) -> list[float]:
    return [inches * INCH if 0 < inches <= NOTHING_HEARD else nan for inches in state.sonar_inches]


def _sizes(wanted: Sequence[float], most: Axes, least: float = 0.0) -> Axes:
    """What is wanted of each axis without its sign: `most` of it at most, and at least this share of that."""
    given = (*wanted, 0.0)[:3]
    return Axes(*(min(max(abs(size), least * bound), bound) for size, bound in zip(given, most, strict=True)))


# Sorts of Nomads: what the three axes of each are, and how fast they may turn. SI, and words of the wire at the edge.

_DEGREE = pi / 180.0


@dataclass(frozen=True, slots=True)
class Base:
    """A type of Nomad.

    radius: of the body, m.
    limits: whatever is asked of it.
    track: between its wheels, m; 0 where they steer together.
    units: what one of the wire is for each axis, m or rad; 0 for an axis that it lacks.
    accelerations: of each axis at most, m/s2 or rad/s2.
    """

    name: str
    radius: float
    limits: Limits
    track: float
    units: Axes
    accelerations: Axes

    def limited(self, limits: Limits) -> Base:
        """The same, never asked for more than this, nor for more than it can."""
        share = min(1.0, limits.acceleration / self.limits.acceleration)
        slower = Axes(*(most * share for most in self.accelerations))
        return replace(self, limits=self.limits.within(limits), accelerations=slower)

    @property
    def speeds(self) -> Axes:
        """Of each axis at most, in whole units of the wire."""
        speed, turn_rate = self.limits.speed, self.limits.turn_rate
        return self.whole(Axes(speed, speed, 0.0) if self.track else Axes(speed, turn_rate, turn_rate))

    def axes(self, speed: float, turn_rate: float) -> Axes:
        """Speeds of the axes for a body that goes so fast along its heading (m/s) and turns so fast (rad/s)."""
        if not self.track:
            return Axes(speed, turn_rate, turn_rate)
        return Axes(speed + turn_rate * self.track / 2.0, speed - turn_rate * self.track / 2.0, 0.0)

    def motion(self, speeds: Axes) -> tuple[float, float]:
        """The other way: speed and turn rate."""
        first, second, _ = speeds
        return ((first + second) / 2.0, (first - second) / self.track) if self.track else (first, second)

    def within(self, speeds: Axes) -> Axes:
        """Speeds within the limits; two wheels slow down together, so that the body stays on its curve."""
        if self.track:
            speed, turn_rate = self.motion(speeds)
            limits = self.limits
            turn_rate = min(max(turn_rate, -limits.turn_rate), limits.turn_rate)
            speeds = self.axes(min(max(speed, -limits.speed), limits.speed), turn_rate)
            most = self.speeds.first
            share = min(1.0, most / max(abs(speeds.first), abs(speeds.second), most))
            return Axes(speeds.first * share, speeds.second * share, 0.0)
        return Axes(*(min(max(speed, -most), most) for speed, most in zip(speeds, self.speeds, strict=True)))

    def whole(self, sizes: Axes) -> Axes:
        """As much of each as the wire can say, at most."""
        return Axes(
            *(int(size / unit + 1e-6) * unit if unit else 0.0 for size, unit in zip(sizes, self.units, strict=True))
        )

    def words(self, values: Axes) -> tuple[int, int, int]:
        """Values of the axes as the wire has them."""
        first, second, third = (round(v / unit) if unit else 0 for v, unit in zip(values, self.units, strict=True))
        return first, second, third

    def measured(self, state: State) -> tuple[float, float]:
        """Speed and turn rate that a server tells."""
        first, second, third = (word * unit for word, unit in zip(state.velocities, self.units, strict=True))
        return self.motion(Axes(first, second, third))


SCOUT = Base(
    "scout",
    radius=0.17,
    # Its wheels could turn it twice as fast on the spot, but no sonar could follow.
    limits=Limits(speed=1.0, turn_rate=pi, acceleration=2.0),
    track=0.3452,
    units=Axes(TENTH, TENTH, 0.0),
    accelerations=Axes(2.0, 2.0, 0.0),
)
NOMAD200 = Base(
    "nomad200",
    radius=0.225,
    limits=Limits(speed=0.508, turn_rate=45.0 * _DEGREE, acceleration=0.762),
    track=0.0,
    units=Axes(TENTH, TENTH_DEGREE, TENTH_DEGREE),
    accelerations=Axes(0.762, 60.0 * _DEGREE, 60.0 * _DEGREE),
)
BASES = {base.name: base for base in (SCOUT, NOMAD200)}
