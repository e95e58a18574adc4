"""What every bridge has in common, below the language: the I/O thread, the watchdog, the limits, STOP.

A mind never waits, and every exchange with a robot is a wait. So the connection belongs to a thread of its own, the
I/O thread, which works in rounds: it sends what the mind wants done, and stores what was measured. The mind only reads
what is stored, and notes what it wants. A bridge derives from `BridgedBody` and says four things: how a motion is
sent, how the robot is measured, how it is reached again, and how its connection is closed.

Everything that moves the robot is a `Motion` that goes through `move`, and each round decides what becomes of it:

    watchdog    a mind that has not looked at its body for `UNATTENDED` s has lost it: the body is brought to rest, or
                does what the bridge has as its `failsafe`; the same when the operator's lease is over
    STOP, hold  the body rests, whatever is asked
    limits      speed and turn rate are brought within them, changes of speed are spread over time; what would pass the
                fence, or come too near to something, becomes rest. A body that does not know where it is stands, if it
                has a fence. What moves to its side has two speeds over the ground, which are one vector; what hovers
                climbs no faster than it can come to rest before its floor and its ceiling
    reach       a robot that is gone is looked for again and again, ever less often. Meanwhile what is asked is refused;
                when it is back, the body is at rest, and nothing old resumes. What a bridge does not expect of its
                robot counts as that, so that the I/O thread goes on

No expression, and no bridge, can change that. In step, for simulations that wait for their programs, there is no
I/O thread: each `sense` is one round, and a robot that is gone is the end.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from math import atan2, hypot, inf, isfinite, isnan, nan
from threading import Event, Lock, Thread
from types import TracebackType
from typing import ClassVar, Self

from sleepcast.core.backoff import Backoff
from sleepcast.core.clock import Clock, WallClock
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.model import RestState
from sleepcast.core.records import dataclass
from sleepcast.robot import (
    DOES_NOTHING,
    FENCE_AHEAD,
    FRESH,
    OUT_OF_REACH,
    REACHED_AGAIN,
    TELL_AGAIN,
    FencedError,
    Limits,
    OutOfReachError,
    Reading,
    RobotModel,
    Setpoint,
    brought_to_rest,
    rest_state_of,
)

UNATTENDED = 1.0
"""Seconds without a look from the mind after which the body is brought to rest."""
ROUND = 0.05
"""Seconds between two rounds of the I/O thread when there is nothing to send: half of a usual tick."""
LOOKS = 2
"""Rounds for each look of the mind, where its ticks are longer, and neither the limits nor the robot want more."""
PATIENCE = 5.0
"""Seconds for an answer: a robot that needs longer has been lost."""
SOONEST, LATEST = 0.5, 10.0
"""Seconds between two tries to find a robot that is gone: at first, and after it has not been found for long."""
MAX_JOBS = 64
"""Things to be done that wait for the I/O thread; what finds no room is refused, and the language counts a fault."""
MAX_COMPLAINTS = 100
"""Sentences that wait to be read; the oldest go."""
LAG = 0.25
"""Seconds from a look at what is ahead to when what follows from it is done: two rounds, and ticks of the robot."""
STANDSTILL, SLOWEST = 0.05, 0.05
"""m/s up to which a robot counts as at rest, and the share of its greatest speed up to which a slow one does."""


class BusyError(SleepcastError):
    """The body has more to do than it can remember."""


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """What a body is to do.

    sort: its type: "rest", "speeds", of what hovers "climb", or one of the bridge's own.
    values: of "speeds", speed in m/s and turn rate in rad/s, of what moves to its side that to its left, and of what
        hovers that upwards, m/s; of "climb", that upwards alone.
    """

    sort: str
    values: tuple[float, ...] = ()


REST = Motion("rest")


class BridgedBody(ABC):
    """See the module. Its sensors have x, y, heading, speed and turn_rate among them if it can keep a fence, and height
    if it hovers.

    model: what it answers to.
    clock: by which the mind's looks are timed.
    in_step: see the module; a bridge whose robot cannot wait for its programs refuses it.
    """

    RENEWS: ClassVar[bool] = True
    """Whether the robot is told its motion in each round, or only another one."""
    KEEPS_ACCELERATION: ClassVar[bool] = False
    """Whether the robot itself changes its speed no faster than its limits say."""
    RESTING: ClassVar[float | None] = None
    """m/s up to which the robot counts as at rest: as far as what it measures differs from 0 then. None: `STANDSTILL`,
    or `SLOWEST` of its greatest speed if that is less."""
    FAILURES: ClassVar[tuple[type[Exception], ...]] = (OutOfReachError, OSError)
    """What is raised where the robot cannot be reached."""
    REFUSALS: ClassVar[tuple[type[Exception], ...]] = (MisuseError,)
    """What is raised where the robot, or the bridge, does not do one thing, and everything else goes on."""

    def __init__(self, model: RobotModel, *, clock: Clock | None = None, in_step: bool = False) -> None:
        self.model, self._clock, self._in_step = model, clock or WallClock(), in_step
        self._hovers, self._is_omni = model.hovers, model.is_omni
        self._lock = Lock()
        """Held to change what follows; never while anybody waits for the robot."""
        self._motion = self.failsafe = REST
        self._current = REST
        """What is wanted in this round, before its speed is paced."""
        self._sent_motion: Motion | None = None
        """What the robot was last told, the very object."""
        self._stopped = self._held = False
        self._jobs: deque[Callable[[], object]] = deque()
        self._complaints: deque[str] = deque(maxlen=MAX_COMPLAINTS)
        self._lost: Exception | None = None
        """Why the robot is out of reach, None while it is not."""
        self._pauses, self._next = Backoff(SOONEST, LATEST), 0.0
        """Seconds to the next try to find it, and when that is."""
        self._attended = self._heard = self._clock.now()
        self._looks_every = 0.0
        """Seconds between the mind's last two looks."""
        self._at_rest: tuple[float, ...] = (0.0,) * (1 + self._is_omni + self._hovers)
        self._going: tuple[float, ...] = self._at_rest
        self._paced = nan
        """What the robot was last told, m/s ahead, and as far as it moves so to its left and upwards, and when."""
        self._kept_back, self._kept_at = "", -inf
        """Why the limits last brought it to rest, and when."""
        self._wake, self._ending, self._given_up = Event(), False, in_step
        self._io_thread = Thread(target=self._go_round, name="I/O thread", daemon=True)

    # ---- what a bridge says

    @abstractmethod
    def carry_out(self, motion: Motion) -> object:
        """Send a motion to the robot. Raises one of `FAILURES` where it cannot be reached, one of `REFUSALS` for
        what it does not do."""

    @abstractmethod
    def measure(self) -> None:
        """Bring what `reading` gives up to date, if this has not been done on the way. Raises one of `FAILURES`."""

    @abstractmethod
    def reading(self) -> Reading:
        """What was measured last, without looking anew. Its time never goes back."""

    @abstractmethod
    def seek(self) -> None:
        """Reach the robot again, which was gone. Raises one of `FAILURES` while it is not there."""

    @abstractmethod
    def leave(self) -> None:
        """Bring the robot to rest, if it can be reached, and close the connection; `lost` says if that has failed."""

    def course(self, motion: Motion) -> tuple[float, float] | None:
        """Speed and turn rate, m/s and rad/s, of a motion, the greatest that it may come to; None for one that needs
        not be watched, or watches itself."""
        return (motion.values[0], motion.values[1]) if motion.sort == "speeds" else None

    def steered(self, motion: Motion) -> Motion:
        """What a motion comes to now: "speeds" for one that this computer steers, itself if the robot does."""
        if self._hovers and motion.sort == "climb":
            return Motion("speeds", (0.0, 0.0, 0.0, motion.values[0]))
        return motion

    def drift_measured(self) -> tuple[float, float]:
        """Of what moves to its side, how fast it goes along its heading and to its left, m/s; NaN for unknown."""
        return self._sensed().get("speed", nan), 0.0

    def nearest(self, first: float, last: float) -> float:
        """Distance in m to the nearest thing between two angles, rad counter-clockwise from the heading; NaN if
        unknown."""
        return nan

    @property
    def measures_ranges(self) -> bool:
        """Whether `nearest` may know something."""
        return bool(self.model.geometry.sonars)

    # ---- a Robot

    def begin(self) -> None:
        """Start the I/O thread, unless the body is in step."""
        if not self._in_step:
            self._io_thread.start()

    def narrow(self, limits: Limits) -> None:
        """Keep these limits, too. Raises MisuseError for one that this body cannot keep."""
        names = {sensor.name for sensor in self.model.sensors}
        if limits.are_fenced and not {"x", "y", "heading", "speed", "turn_rate"} <= names:
            raise MisuseError(f"a {self.model.name} does not know where it is, so it cannot keep within a fence")
        if limits.least_range > 0.0 and not self.measures_ranges:
            raise MisuseError(f"a {self.model.name} has no range sensors, so it cannot keep a range to anything")
        self.model = replace(self.model, limits=self.model.limits.within(limits))

    @property
    def stopped(self) -> bool:
        return self._stopped

    def sense(self) -> Reading:
        if self._in_step and self._lost is None:
            self.round()
        if self._lost is not None and self._given_up:  # nobody looks for it
            raise self._lost
        now = self._clock.now()
        self._looks_every, self._attended = now - self._attended, now
        return self.reading()

    def now(self) -> float:
        return self.reading().time

    def act(self, wanted: Setpoint) -> None:
        motion = self._motion
        course = self.course(motion) if motion.sort == "speeds" else None
        speed, turn = course or (0.0, 0.0)
        speed = speed if isnan(wanted.speed) else wanted.speed
        turn = turn if isnan(wanted.turn_rate) else wanted.turn_rate
        with suppress(OutOfReachError):
            if not self._is_omni:
                self.drive(speed, turn)
                return
            side, climb, *_ = (*(motion.values[2:] if course else ()), 0.0, 0.0)
            side, climb = side if isnan(wanted.side) else wanted.side, climb if isnan(wanted.climb) else wanted.climb
            self.fly(speed, turn, side, climb)

    def drive(self, speed: float, turn_rate: float) -> None:
        """Drive on at this speed (m/s) and turn rate (rad/s), as far as the limits allow."""
        if self._is_omni:
            self.fly(speed, turn_rate, 0.0, 0.0)
            return
        most = self.model.limits
        speed, turn_rate = clamped(speed, most.speed), clamped(turn_rate, most.turn_rate)
        self.move(Motion("speeds", (speed, turn_rate)) if speed or turn_rate else REST)

    def fly(self, speed: float, turn_rate: float, side: float, climb: float) -> None:
        """Of what moves to its side: go on at these speeds ahead, to its left and, if it hovers, upwards (m/s), and at
        this turn rate (rad/s), as far as the limits allow: the speed that they limit is that over the ground, in
        whatever direction."""
        most = self.model.limits
        speed, side = clamped(speed, most.speed), clamped(side, most.speed)
        share = max(1.0, hypot(speed, side) / most.speed)
        values: tuple[float, ...] = (speed / share, clamped(turn_rate, most.turn_rate), side / share)
        values += (clamped(climb, most.climb),) if self._hovers else ()
        self.move(Motion("speeds", values) if any(values) else REST)

    def climb(self, speed: float) -> None:
        """Climb at this speed, m/s, or sink, on the spot."""
        self.move(Motion("climb", (clamped(speed, self.model.limits.climb),)))

    def stop(self) -> None:
        with self._lock:
            self._stopped, self._motion = True, REST
        self._wake.set()

    def release(self) -> None:
        self._stopped = False

    def let_go(self) -> None:
        with self._lock:
            self._motion = REST if self._stopped else self.failsafe
        self._wake.set()

    def hold(self, still: bool) -> None:
        with self._lock:
            self._held = still
            if still and self._motion.sort != "speeds":  # how much of it is left, nobody knows
                self._motion = REST
        self._wake.set()

    def rest_state(self) -> RestState | None:
        """By the sensors of a reading, `speed` and `turn_rate`, or what a bridge knows better; None without a sensor of
        speed. Unknown while it is out of reach."""
        if all(sensor.name != "speed" for sensor in self.model.sensors):
            return None
        speed, turn_rate = (nan, nan) if self._lost is not None else self.course_measured()
        resting = min(STANDSTILL, SLOWEST * self.model.limits.speed) if self.RESTING is None else self.RESTING
        return rest_state_of(self.model, speed, turn_rate, resting, LAG)

    def course_measured(self) -> tuple[float, float]:
        """At which speed it goes, in whatever direction, and at which rate it turns, m/s and rad/s; NaN for unknown."""
        known = self._sensed()
        return known.get("speed", nan), known.get("turn_rate", nan)

    def _sensed(self) -> dict[str, float]:
        """The values of its sensors, none of them while they are too old."""
        if self.stale and not self._in_step:
            return {}
        return dict(zip((sensor.name for sensor in self.model.sensors), self.reading().values, strict=True))

    @property
    def stale(self) -> bool:
        """Whether what was measured is too old to count."""
        return self._clock.now() - self._heard > FRESH

    # ---- its end

    def complaints(self) -> list[str]:
        """What has gone wrong since the last call."""
        sentences: list[str] = []
        while self._complaints:
            sentences.append(self._complaints.popleft())
        return sentences

    @property
    def lost(self) -> str:
        return str(self._lost or "")

    def close(self) -> None:
        """Bring the robot to rest, if it can be reached, and close the connection."""
        if self._ending:
            return
        self._ending = True
        self._wake.set()
        if self._io_thread.is_alive():
            self._io_thread.join(PATIENCE + 1.0)
        self.leave()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # ---- what the mind leaves for the I/O thread: for functions of a bridge

    def move(self, motion: Motion) -> None:
        """Do this from now on. Raises OutOfReachError."""
        with self._lock:
            self._check_reach()
            if not self._stopped:
                self._motion = motion
        self._wake.set()

    def send(self, job: Callable[[], object]) -> None:
        """Have this done, in the order of the calls; it must not move the robot. Raises OutOfReachError, BusyError."""
        with self._lock:
            self._check_reach()
            if len(self._jobs) >= MAX_JOBS:
                raise BusyError(f"{MAX_JOBS} requests wait already to be sent to the robot")
            self._jobs.append(job)
        self._wake.set()

    def beside(self, job: Callable[[], None], failed: str) -> Thread:
        """Have this done in a thread of its own, for which the I/O thread need not wait.

        failed: how the sentence begins that says why it has failed, whatever that is.
        """

        def run() -> None:
            try:
                job()
            except Exception as error:
                self.complain(f"{failed}: {str(error) or type(error).__name__}")

        thread = Thread(target=run, name=failed, daemon=True)
        thread.start()
        return thread

    def complain(self, sentence: str) -> None:
        """Say at the node that something has gone wrong."""
        self._complaints.append(sentence)

    def check_free(self) -> None:
        """Raise MisuseError while it is stopped: for what is no motion, and would let it move."""
        if self._stopped:
            raise MisuseError("it is stopped: RELEASE it first")

    def keep_its_place(self) -> None:
        """A fence means nothing to a body that can be talked into being elsewhere. Raises FencedError."""
        if self.model.limits.are_fenced:
            raise FencedError("this robot is kept within a fence, so its position may not be set")

    def rest(self) -> None:
        """Forget what was asked: the robot has lost or found itself anew, and nothing old may resume."""
        with self._lock:
            self._motion, self._sent_motion, self._going = REST, None, self._at_rest
            self._jobs.clear()

    def _check_reach(self) -> None:
        if self._lost is not None:
            raise OutOfReachError(DOES_NOTHING)

    # ---- the I/O thread

    def _go_round(self) -> None:
        try:
            while not self._ending:
                self._wake.wait(self.round_every)
                self._wake.clear()
                try:
                    self.round()
                except Exception as error:  # whatever it is, the thread that stops the robot lives on
                    self._lose_by_fault(error)
        finally:  # nothing should get here but the end; if something does, the mind must not go on without a body
            if not self._ending:
                self._given_up = True
                self._lost = OutOfReachError("the thread that talks to the robot has died: please report what it said")

    @property
    def round_every(self) -> float:
        """Seconds from one round to the next, if nothing is to be sent: `ROUND`, or longer for a robot that is told
        each motion once, has no limits to be watched, and is looked at rarely."""
        if self.RENEWS or self.model.limits.are_watched or self._lost is not None:
            return ROUND
        return min(max(ROUND, self._looks_every / LOOKS), UNATTENDED / 4.0)

    def round(self) -> None:
        """One round with the robot: what brings to rest first, then jobs, then other motion, then the measuring."""
        if self._lost is not None:
            self._seek()
            return
        with self._lock:
            if not self._in_step and self._clock.now() - self._attended > UNATTENDED:
                self._motion = self.failsafe
            if self.model.limits.are_watched:
                self._keep_back(self._why_not(self.steered(self._motion)))
            motion = self._current = REST if self._stopped or self._held else self._motion
            jobs, self._jobs = list(self._jobs), deque()
        motion = self._paced_motion(self.steered(motion))
        todo: list[Callable[[], object]] = list(jobs)
        if self.RENEWS or motion is not self._sent_motion:
            todo.insert(0 if motion is REST else len(todo), lambda: self.carry_out(motion))
            self._sent_motion = motion
        try:
            for job in todo:
                try:
                    job()
                except self.REFUSALS as error:
                    self.complain(str(error))
            self.measure()
        except self.FAILURES as error:
            self._lose(error)
        else:
            self._heard = self._clock.now()

    def _paced_motion(self, motion: Motion) -> Motion:
        """The motion with no more change of speed than the time since the last round allows."""
        now = self.reading().time if self._in_step else self._clock.now()
        passed = min(now - self._paced, LAG) if isfinite(self._paced) else 0.0
        self._paced = now
        if self.KEEPS_ACCELERATION or motion.sort not in ("rest", "speeds"):
            self._going = self._at_rest
            return motion
        speed, turn, *others = motion.values if motion.sort == "speeds" else (0.0, 0.0, *self._at_rest[1:])
        wanted = (speed, *others)[: len(self._at_rest)]
        self._going = approached(self._going, wanted, self.model.limits.acceleration * max(passed, 0.0))
        if self._hovers:
            height = self._sensed().get("height", nan)
            self._going = (*self._going[:2], self.model.limits.climb_within(height, self._going[2], LAG))
        if motion is REST and not any(self._going):
            return REST
        return Motion("speeds", (self._going[0], turn, *self._going[1:]))

    def _keep_back(self, why: str) -> None:
        """Bring the body to rest if there is a reason, and say so: a rule may ask for it again in every tick."""
        now = self._clock.now()
        if why:
            self._motion = REST
            if why != self._kept_back or now - self._kept_at > TELL_AGAIN:
                self.complain(brought_to_rest(why))
            self._kept_back, self._kept_at = why, now

    def _why_not(self, motion: Motion) -> str:
        """Why this motion would not keep the body within its fence and off what is in its way; "" if it does."""
        course = self.course(motion)
        if course is None:
            return ""
        known = self._sensed()
        x, y, heading, speed, turning = (known.get(n, nan) for n in ("x", "y", "heading", "speed", "turn_rate"))
        wanted, turn = course
        side = motion.values[2] if self._is_omni and motion.sort == "speeds" else 0.0
        if self.model.limits.are_fenced and isnan(x + y + heading):
            return "it does not know where it is, and has a fence" if wanted or side else ""
        turn = max(abs(turn), 0.0 if isnan(turning) else abs(turning))
        going = self.model.limits.speed if isnan(speed) else speed
        ways = self._ways(wanted, side) if self._is_omni else [(0.0, going, wanted)]
        return next(filter(None, (self._what_is_ahead((x, y, heading), turn, *way) for way in ways)), "")

    def _ways(self, wanted: float, side: float) -> list[tuple[float, float, float]]:
        """In which directions what moves to its side goes and wants to go, rad from its heading, and how fast it does
        and wants to, m/s. On its way from one to the other it is on no side faster than in one of them."""
        ahead, left = self.drift_measured()
        drift, speed = hypot(ahead, left), hypot(wanted, side)
        ways = []
        if drift > (self.RESTING or STANDSTILL):
            ways.append((atan2(left, ahead), drift, 0.0))
        if speed:
            already = (ahead * wanted + left * side) / speed
            already = self.model.limits.speed if isnan(already) else max(already, 0.0)
            ways.append((atan2(side, wanted), already, speed))
        return ways

    def _what_is_ahead(
        self, pose: tuple[float, float, float], turn: float, way: float, going: float, wanted: float
    ) -> str:
        """What is too near that way, see `_ways`; "" for nothing."""
        x, y, heading = pose
        ahead = (x, y, heading + way), going, wanted, turn, LAG, lambda a, b: self.nearest(way + a, way + b)
        if self.model.limits.may_go_on(*ahead):
            return ""
        if not self.model.limits.without_fence.may_go_on(*ahead):
            return f"less than its least range of {self.model.limits.least_range:g} m is known to be free ahead"
        return FENCE_AHEAD

    def _lose(self, why: Exception) -> None:
        """The robot is gone: nothing that is wanted of it now will be wanted when it is back."""
        self.complain(f"{OUT_OF_REACH}: {why}")  # first: whoever sees that it is lost is told why
        self._lost = why
        self.rest()
        self._pauses.reset()
        self._next = self._clock.now() + self._pauses.take()

    def _seek(self) -> None:
        """Look for the robot, if it is time to."""
        if self._clock.now() < self._next:
            return
        try:
            self.seek()
        except self.FAILURES as error:
            self._miss(error)
            return
        self.rest()
        self._heard = self._clock.now()
        self.complain(REACHED_AGAIN)
        self._lost = None

    def _miss(self, why: Exception) -> None:
        """It has not been found: the next try is later."""
        if str(why) != self.lost:
            self.complain(f"the body is still out of reach: {why}")
        self._lost, self._next = why, self._clock.now() + self._pauses.take()

    def _lose_by_fault(self, error: Exception) -> None:
        """The bridge has met what it does not expect: the robot counts as out of reach, which brings it to rest."""
        why = OutOfReachError(f"its bridge has failed, please report it: {type(error).__name__}: {error}")
        if self._lost is None:
            self._lose(why)
        else:
            self._miss(why)


def approached(before: tuple[float, ...], wanted: tuple[float, ...], step: float) -> tuple[float, ...]:
    """The vector `wanted`, or what lies `step` on the way from `before` to it, if it is farther away."""
    changes = [end - begin for begin, end in zip(before, wanted, strict=True)]
    far = hypot(*changes)
    if far > step:
        changes = [change / far * step for change in changes]
    return tuple(begin + change for begin, change in zip(before, changes, strict=True))


def clamped(value: float, most: float) -> float:
    """The value, brought within `most` on both sides."""
    return min(max(value, -most), most)
