"""A Nomad behind a Nserver as a body for a mind.

A mind never waits, and every word with a Nserver is a wait. So the connection belongs to a thread of its own, the
courier, which goes round and round: it takes along what the mind wants done, tells the server, and lays down what the
server answered. The mind only reads what lies there, and notes what it wants.

Safety lies here and not in the language. What is asked beyond the limits is brought within them. The server stops the
robot when this process is gone (`TIMEOUT`), and the courier brings it to rest when the mind has not looked at its body
for `UNATTENDED` s though the process lives. No expression can change that.

A server that is gone is looked for again and again, ever less often. Until it is back the mind goes on, with a body
that is out of reach: what was sensed grows old, and what is asked is refused. Then the body is at rest, and nothing
old resumes.

In step, for simulations that wait for their programs, there is no courier: each `sense` is one round, and a server that
is gone is the end.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from math import copysign, isnan, nan, pi
from threading import Event, Lock, Thread
from types import TracebackType
from typing import Literal, NamedTuple, Self

from sleepcast.core.clock import Clock, WallClock
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.nomad.client import PARTING_SECONDS, LostError, Nomad, NomadError, Pose, RequestError
from sleepcast.nomad.state import State
from sleepcast.nomad.units import INCH, INFRARED_STEP, NOTHING_HEARD, NOTHING_NEAR, TENTH, TENTH_DEGREE
from sleepcast.robot import Axes, Limits, Reading, RobotModel, Setpoint

TIMEOUT = 1
"""Whole seconds without a request after which the server stops the robot: as every program of the thesis has it."""
UNATTENDED = 1.0
"""Seconds without a look from the mind after which the courier brings the robot to rest."""
ROUND = 0.05
"""Seconds between two rounds of the courier when there is nothing to take along: half of a usual tick."""
PATIENCE = 5.0
"""Seconds for an answer: a server that needs longer has been lost."""
SOONEST, LATEST = 0.5, 10.0
"""Seconds between two tries to find a server that is gone: at first, and after it has not been found for long."""
MAX_ERRANDS = 64
"""Things to be done that wait for the courier; what finds no room is refused, and the language counts a fault."""
MAX_COMPLAINTS = 100
"""Sentences that wait to be read; the oldest go."""
FARTHEST = 1_000.0
"""m or rad that an axis may be asked to go in one go."""
LEAST_BRAKING = 0.5
"""Share of the acceleration that is always left: however gently it is to drive, a robot must be able to stop."""
LAG = 0.25
"""Seconds from a look at what is ahead to when what follows from it is done: two rounds, and ticks of the server."""
FRESH = 1.0
"""Seconds after which what was measured counts as unknown: the server, or the way to it, has got stuck."""
FRONT = range(-4, 5)
"""Numbers of the sonars in front, within a quarter turn to both sides."""

TURN = 2.0 * pi
_FARTHEST_ECHO = NOTHING_HEARD * INCH
Sort = Literal["rest", "speeds", "way", "limp"]


class FencedError(SleepcastError):
    """A body that is kept within a fence is to believe that it is elsewhere."""


class BusyError(SleepcastError):
    """The body has more to do than it can remember."""


class Motion(NamedTuple):
    """What the axes are to do: rest, turn at speeds (m/s, rad/s), go a way (m, rad), or be let go."""

    sort: Sort
    axes: Axes = Axes(0.0, 0.0, 0.0)


REST = Motion("rest")


class NomadRobot:
    """See the module; `nomad` names what expressions may ask of it. SI units; x, y and heading are what its encoders
    give, in the frame of the server's world.

    base: its sort; model: what it answers to. clock: by which the mind's looks are timed. It is a `Robot`; in step,
    `sense` raises LostError when the server is gone.
    """

    def __init__(
        self, nomad: Nomad, base: Base, model: RobotModel, *, clock: Clock | None = None, in_step: bool = False
    ) -> None:
        self.base, self.model = base, model
        self._nomad, self._clock, self._in_step = nomad, clock or WallClock(), in_step
        self._number = nomad.robot
        self._lock = Lock()
        """Held to change what follows; never while anybody waits for the server."""
        self._motion = REST
        self._told: Motion | None = None
        """The setpoint that the server was last sent, the very object."""
        self._stopped = self._held = False
        self._errands: deque[Callable[[Nomad], object]] = deque()
        self._complaints: deque[str] = deque(maxlen=MAX_COMPLAINTS)
        self._zeroing: Thread | None = None
        self._lost: NomadError | None = None
        """Why the server is out of reach, None while it is not."""
        self._pause, self._next = SOONEST, 0.0
        """Seconds to the next try to find it, and when that is."""
        self._state = nomad.state
        self._before = 0.0
        """Seconds that other servers had counted before this one began to count."""
        self._attended = self._heard = self._clock.now()
        self._wake, self._ending = Event(), False
        self._greet(nomad)
        self._state = nomad.state
        self._courier = Thread(target=self._go_round, name="courier", daemon=True)
        if not in_step:
            self._courier.start()

    def _greet(self, nomad: Nomad) -> None:
        """What a server is sent first."""
        nomad.conf_tm(TIMEOUT)
        nomad.st()
        nomad.sp(*self.base.words(self.base.speeds))
        if self.base.accelerations != BASES[self.base.name].accelerations:
            nomad.ac(*self.base.words(self.base.whole(self.base.accelerations)))

    # ---- a Robot

    @property
    def stopped(self) -> bool:
        return self._stopped

    @property
    def state(self) -> State:
        """What the server last sent."""
        return self._state

    def sense(self) -> Reading:
        if self._in_step and self._lost is None:
            self._round()
        if self._lost is not None and not self._courier.is_alive():  # nobody looks for it
            raise self._lost
        self._attended = self._clock.now()
        return self.reading()

    def reading(self) -> Reading:
        """What was sensed last, without looking anew."""
        state = self._state
        return Reading(self._before + state.time, self._values(state))

    def now(self) -> float:
        """The time of the last reading: in step, the robot is its mind's clock."""
        return self._before + self._state.time

    def act(self, wanted: Setpoint) -> None:
        motion = self._motion if self._motion.sort == "speeds" else REST
        speed, turn = self.base.motion(motion.axes)
        with suppress(NomadError):  # out of reach
            self.drive(
                speed if isnan(wanted.speed) else wanted.speed, turn if isnan(wanted.turn_rate) else wanted.turn_rate
            )

    def stop(self) -> None:
        with self._lock:
            self._stopped, self._motion = True, REST
        self._wake.set()

    def release(self) -> None:
        self._stopped = False

    def hold(self, still: bool) -> None:
        with self._lock:
            self._held = still
            if still and self._motion.sort == "way":  # how much of it is left, nobody knows
                self._motion = REST
        self._wake.set()

    # ---- its end

    def complaints(self) -> list[str]:
        """What the server has refused since the last call."""
        said: list[str] = []
        while self._complaints:
            said.append(self._complaints.popleft())
        return said

    @property
    def lost(self) -> str:
        return str(self._lost or "")

    def close(self) -> None:
        """Bring the robot to rest, if it can be reached, and let go of it."""
        self._ending = True
        self._wake.set()
        if self._courier.is_alive():
            self._courier.join(PATIENCE + 1.0)
        if self._lost is None and self._nomad.connection.open:
            self._nomad.timeout = PARTING_SECONDS
            try:
                self._nomad.st()
            except NomadError as error:
                self._lost = error
        with suppress(NomadError):
            self._nomad.disconnect_robot()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # ---- what expressions may ask; see nomad

    def drive(self, speed: float, turn_rate: float) -> None:
        self._move(Motion("speeds", self.base.within(self.base.axes(speed, turn_rate))))

    def turn_axes(self, first: float, second: float, third: float = 0.0) -> None:
        self._move(Motion("speeds", self.base.within(Axes(first, second, third))))

    def travel(self, first: float, second: float, third: float = 0.0) -> None:
        ways = (min(max(way, -FARTHEST), FARTHEST) for way in (first, second, third))
        self._move(Motion("way", Axes(*ways)))

    def halt(self) -> None:
        self._move(Motion("rest"))

    def limp(self) -> None:
        self._move(Motion("limp"))

    def cruise(self, *speeds: float) -> None:
        words = self.base.words(_sizes(speeds, self.base.speeds))
        self._send(lambda nomad: nomad.sp(*words))

    def accelerate(self, *accelerations: float) -> None:
        words = self.base.words(_sizes(accelerations, self.base.whole(self.base.accelerations), LEAST_BRAKING))
        self._send(lambda nomad: nomad.ac(*words))

    def zero(self) -> None:
        """Over a connection of its own: it may take two minutes, and STOP must not wait for it."""
        if self._stopped:
            return
        self._keep_its_place()
        if self._zeroing is not None and self._zeroing.is_alive():
            raise BusyError("it is still on its way home from the last ZR")
        self._move(Motion("rest"))
        self._zeroing = Thread(target=self._zero, name="zeroing", daemon=True)
        self._zeroing.start()

    def believe_place(self, x: float, y: float) -> None:
        self._keep_its_place()
        self._send(lambda nomad: nomad.believe_place(x, y))

    def believe_heading(self, heading: float, turret: float | None = None) -> None:
        self._keep_its_place()
        angles = heading % TURN, (heading if turret is None else turret) % TURN
        self._send(lambda nomad: nomad.believe_heading(*angles))

    def place(self, x: float, y: float, heading: float, turret: float | None = None) -> None:
        self._keep_its_place()
        pose = Pose(x, y, heading % TURN, (heading if turret is None else turret) % TURN)
        if not self._stopped:
            self._send(lambda nomad: nomad.place(pose))

    def say(self, text: str) -> None:
        self._send(lambda nomad: nomad.say(text))

    def fire_sonars(self, pause: float, *order: float) -> None:
        sonars = tuple(int(number) for number in order if 0 <= number < self.model.geometry.sonars)
        every = range(self.model.geometry.sonars)
        self._send(lambda nomad: nomad.fire_sonars(min(max(pause, 0.0), 1.02), sonars if order else every))

    def sonar(self, which: float) -> float:
        return self._ranges()[int(which) % self.model.geometry.sonars]

    def nearest(self, first: float, last: float) -> float:
        sonars = self._ranges()
        step = TURN / len(sonars)
        wide = last - first if last - first >= TURN else (last - first) % TURN
        there = [found for number, found in enumerate(sonars) if (number * step - first) % TURN <= wide]
        return min((found for found in there if not isnan(found)), default=nan if there else _FARTHEST_ECHO)

    def _ranges(self) -> list[float]:
        """Of the sonars, m, now; NaN where nothing is known."""
        if self._clock.now() - self._heard > FRESH:
            return [nan] * self.model.geometry.sonars
        return _ranges(self._state)

    def _keep_its_place(self) -> None:
        """A fence means nothing to a body that can be talked into being elsewhere."""
        if self.base.limits.fence is not None:
            raise FencedError("this robot is kept within a fence, so its position may not be set")

    # ---- what the mind leaves for the courier

    def _move(self, motion: Motion) -> None:
        with self._lock:
            self._check_reach()
            if not self._stopped:
                self._motion = motion
        self._wake.set()

    def _send(self, errand: Callable[[Nomad], object]) -> None:
        with self._lock:
            self._check_reach()
            if len(self._errands) >= MAX_ERRANDS:
                raise BusyError(f"{MAX_ERRANDS} requests wait already to be sent to the robot")
            self._errands.append(errand)
        self._wake.set()

    def _check_reach(self) -> None:
        if self._lost is not None:
            raise LostError("the body is out of reach, and does nothing")

    # ---- the courier

    def _go_round(self) -> None:
        try:
            while not self._ending:
                self._wake.wait(ROUND)
                self._wake.clear()
                if self._lost is not None:
                    self._seek()
                    continue
                if self._clock.now() - self._attended > UNATTENDED:
                    with self._lock:
                        self._motion = REST
                self._round()
        finally:  # nothing should get here but the end; if something does, the mind must not go on without a body
            if not self._ending:
                self._lost = NomadError("the thread that talks to the robot has died: please report what it said")

    def _round(self) -> None:
        """One round with the server: what brings to rest first, then errands, then other motion; the state in any
        case, and once if nothing else brings it."""
        with self._lock:
            if self.base.limits.are_watched and not self._may_go_on(self._motion):
                self._motion = REST
            motion = REST if self._stopped or self._held else self._motion
            errands, self._errands = self._errands, deque()
        todo: list[Callable[[Nomad], object]] = list(errands)
        if motion is not self._told:
            todo.insert(0 if motion.sort == "rest" else len(todo), partial(self._carry_out, motion))
            self._told = motion
        try:
            answers = [self._done(errand) for errand in todo]
            if not any(isinstance(answer, State) for answer in answers):
                self._nomad.gs()
        except NomadError as error:
            self._lose(error)
        else:
            self._heard = self._clock.now()
        self._state = self._nomad.state

    def _lose(self, why: NomadError) -> None:
        """The server is gone: nothing that is wanted of it now will be wanted when it is back."""
        with self._lock:
            self._lost, self._motion, self._told = why, REST, None
            self._errands.clear()
        self._pause, self._next = SOONEST, self._clock.now() + SOONEST
        self._complaints.append(f"the body is out of reach: {why}")

    def _seek(self) -> None:
        """Look for the server, if it is time to."""
        if self._clock.now() < self._next:
            return
        last, connection = self.now(), self._nomad.connection
        try:
            found = Nomad.connect(connection.host, connection.port, robot=self._number, timeout=PATIENCE)
            try:
                self._greet(found)
            except BaseException:
                found.connection.close()
                raise
        except NomadError as error:
            if str(error) != self.lost:
                self._complaints.append(str(error))
            self._lost, self._pause = error, min(2.0 * self._pause, LATEST)
            self._next = self._clock.now() + self._pause
            return
        self._before = max(self._before, last - found.state.time)  # a restarted server counts from 0
        self._nomad, self._state, self._heard = found, found.state, self._clock.now()
        self._lost = None
        self._complaints.append("the body is within reach again, and at rest until a command moves it")

    def _may_go_on(self, motion: Motion) -> bool:
        """Whether this motion keeps the body within its fence and off what is in its way."""
        if motion.sort not in ("speeds", "way"):
            return True
        limits, state = self.base.limits, self._state
        (speed, turning), (wanted, turn) = self.base.measured(state), self.base.motion(motion.axes)
        if motion.sort == "way":  # at whatever speed it comes to
            wanted = copysign(limits.speed, wanted) if wanted else 0.0
            turn = limits.turn_rate if turn else 0.0
        turn = max(abs(turn), abs(turning))
        return limits.may_go_on((state.x, state.y, state.heading), speed, wanted, turn, LAG, self.nearest)

    def _carry_out(self, motion: Motion, nomad: Nomad) -> State:
        if motion.sort == "speeds":
            return nomad.vm(*self.base.words(motion.axes))
        if motion.sort == "way":
            return nomad.pr(*self.base.words(motion.axes))
        return nomad.lp() if motion.sort == "limp" else nomad.st()

    def _done(self, errand: Callable[[Nomad], object]) -> object:
        try:
            return errand(self._nomad)
        except (RequestError, MisuseError) as error:
            self._complaints.append(str(error))
            return None

    def _zero(self) -> None:
        connection = self._nomad.connection
        try:
            other = Nomad.connect(connection.host, connection.port, robot=self._nomad.robot, timeout=PATIENCE)
            try:
                other.zr()
            finally:
                other.disconnect_robot()
        except NomadError as error:
            self._complaints.append(f"ZR: {error}")

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
    """A sort of Nomad. radius: of the body, m. limits: whatever is asked of it. track: between its wheels, m; 0 where
    they steer together. units: what one of the wire is for each axis, m or rad; 0 for an axis that it lacks.
    accelerations: of each axis at most, m/s2 or rad/s2."""

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
