"""The seam between mind and body: what a mind may know of a robot and ask of it.

A body says what it is (`RobotModel`: the names it answers to, its limits, its shape), gives a `Reading` when
it is asked what it senses, and takes a `Setpoint`. Everything that may move a robot goes through here, and
the body keeps its own limits: whatever is asked of it, it does no more than `Limits` allows, and nothing once
it is stopped.

A simulated robot, a robot behind the Nomad wire and a real one are all a `Robot`; testing/robot_contract.py
says what that promises. SI units throughout; positions in the world's frame (x east, y north), angles
counter-clockwise from the x axis.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from dataclasses import replace
from math import cos, inf, isnan, nan, pi, remainder, sin, sqrt
from typing import Protocol, runtime_checkable

from sleepcast.core.errors import SleepcastError
from sleepcast.core.model import HostFunction, MapOutline, NamedArea, Quantity, RestState
from sleepcast.core.outlines import depth, depths
from sleepcast.core.records import NamedTuple, dataclass

BRAKING = 0.8
"""Share of the acceleration that coming to rest in time counts on."""
STANDING = 1e-3
"""m/s below which a body stands."""
ROUNDED = 1e-9
"""m by which sums may be wrong."""
SPREAD = (-1.0, -0.5, 0.0, 0.5, 1.0)
"""Shares of the greatest turn for which it is looked where the way leads."""
AHEAD = pi / 4.0
"""rad to both sides of its way in which something is in the way of a body."""


class FencedError(SleepcastError):
    """A body that is kept within a fence is to go, or to believe that it is, elsewhere."""


class OutOfReachError(SleepcastError):
    """The body cannot be reached, now or for good."""


FRESH = 1.0
"""Seconds after which what was measured counts as unknown: the robot, or the way to it, has got stuck."""
OUT_OF_REACH = "the body is out of reach"
"""How the sentence begins that says why."""
NOBODY_DRIVES = "nobody drives it any more"
"""How the sentences begin that say what it does then."""
DOES_NOTHING = f"{OUT_OF_REACH}, and does nothing"
REACHED_AGAIN = "the body is within reach again, and at rest until a command moves it"
FENCE_AHEAD = "its fence is ahead"
"""Why a body comes to rest, or goes on along its fence."""
TELL_AGAIN = 5.0
"""Seconds for which what has brought a body to rest again and again is told once."""


def brought_to_rest(why: str) -> str:
    """The sentence that says what has brought a body to rest, such as `FENCE_AHEAD`."""
    return f"it is at rest: {why}"


@dataclass(frozen=True, slots=True)
class Limits:
    """What a body never exceeds, whatever it is asked to do.

    speed: m/s, forwards and backwards alike.
    turn_rate: rad/s to either side.
    acceleration: m/s2, braking included.
    fence: least x, least y, greatest x, greatest y in m; the body turns back there. None: no fence.
    least_range: m to what is in its way, before which it comes to rest; 0 for none.
    climb: m/s upwards and downwards alike, of what hovers.
    floor, ceiling: m of height between which what hovers is driven; only a take-off and a landing pass the floor.
    inside, outside: areas that it does not leave, not even one of them, and areas that it does not enter.
    """

    speed: float
    turn_rate: float
    acceleration: float
    fence: tuple[float, float, float, float] | None = None
    least_range: float = 0.0
    climb: float = inf
    floor: float = -inf
    ceiling: float = inf
    inside: tuple[NamedArea, ...] = ()
    outside: tuple[NamedArea, ...] = ()

    @property
    def are_watched(self) -> bool:
        """Whether there is a fence or a least range to be kept, see `may_go_on`."""
        return self.are_fenced or self.least_range > 0.0

    @property
    def are_fenced(self) -> bool:
        """Whether there are places where it may not be."""
        return self.fence is not None or bool(self.inside or self.outside)

    @property
    def without_fence(self) -> Limits:
        return replace(self, fence=None, inside=(), outside=())

    def within(self, others: Limits) -> Limits:
        """The narrower ones of both; the fence of `others` if they have one."""
        return Limits(
            min(self.speed, others.speed),
            min(self.turn_rate, others.turn_rate),
            min(self.acceleration, others.acceleration),
            others.fence or self.fence,
            max(self.least_range, others.least_range),
            min(self.climb, others.climb),
            max(self.floor, others.floor),
            min(self.ceiling, others.ceiling),
            (*self.inside, *others.inside),
            (*self.outside, *others.outside),
        )

    def holds(self, x: float, y: float, margin: float = 0.0) -> bool:
        """Whether a place is within the fence and its areas, and no nearer to an edge than the margin; m."""
        return self.holds_way((x, y), (x, y), margin)

    def holds_way(self, start: tuple[float, float], end: tuple[float, float], margin: float = 0.0) -> bool:
        """The same of a straight way."""
        for x, y in (start, end) if self.fence is not None else ():
            left, bottom, right, top = self.fence or (0.0,) * 4
            if not (left + margin <= x <= right - margin and bottom + margin <= y <= top - margin):
                return False
        deep = all(depths(area, start, end)[0] >= margin for area in self.inside)
        return deep and all(depths(area, start, end)[1] <= -margin for area in self.outside)

    def _keeps_to_areas(self, place: tuple[float, float], direction: float, turned: float, way: float) -> bool:
        """Whether no edge of an area is passed by going so many m in this direction, or in one that differs from it by
        `turned` rad at most. One that is where it may not be may come back."""
        x, y = place
        areas = replace(self, fence=None)
        for share in SPREAD:
            angle = direction + share * min(turned, pi)
            end = x + way * cos(angle), y + way * sin(angle)
            if areas.holds_way(place, end):
                continue
            if areas.holds(x, y) or areas._beyond(end) > areas._beyond(place) + ROUNDED:
                return False
        return True

    def _beyond(self, place: tuple[float, float]) -> float:
        """How far beyond the edges of areas a place is, m."""
        short = (-depth(area, place) for area in self.inside)
        deep = (depth(area, place) for area in self.outside)
        return sum(max(each, 0.0) for each in (*short, *deep))

    def speed_before(self, room: float, lag: float) -> float:
        """The greatest speed, m/s, that still comes to rest within `room` m if braking begins `lag` s from now: of the
        way that `may_go_on` counts, v lag + v² / 2a."""
        if room == inf:
            return inf
        room = max(room, 0.0)
        return 2.0 * room / (lag + sqrt(lag * lag + 2.0 * room / (BRAKING * self.acceleration)))

    def climb_within(self, height: float, wanted: float, lag: float) -> float:
        """The climb rate, m/s, nearest to the wanted one that still comes to rest before the ceiling, or above the
        floor; 0 for one that does not know its height (m; NaN)."""
        room = self.ceiling - height if wanted > 0.0 else height - self.floor
        if isnan(room):
            return 0.0
        most = min(self.climb, self.speed_before(room, lag))
        return min(max(wanted, -most), most)

    def may_go_on(
        self,
        pose: tuple[float, float, float],
        speed: float,
        wanted: float,
        turn: float,
        lag: float,
        nearest: Callable[[float, float], float],
    ) -> bool:
        """Whether a body may do what it wants and could still come to rest in time: within the fence, and no nearer to
        anything than the least range. One that is beyond the fence may come back.

        pose: x and y in m, heading in rad.
        speed, wanted: m/s along its heading.
        turn: rad/s by which it may turn.
        lag: s for which nobody will look again.
        nearest: m to the nearest thing between two angles, rad counter-clockwise from the heading; NaN where that is
            not known, which does not let it go on.
        """
        towards = speed if abs(speed) > STANDING else wanted
        if towards == 0.0:
            return True
        forwards, fastest = towards > 0.0, abs(speed)
        if wanted * towards > 0.0:  # else it brakes
            fastest = max(fastest, min(abs(wanted), self.speed, fastest + self.acceleration * lag))
        way = fastest * lag + fastest * fastest / (2.0 * BRAKING * self.acceleration)
        turned = abs(turn) * (lag + fastest / self.acceleration)
        x, y, heading = pose
        ahead = 0.0 if forwards else pi
        if self.fence is not None and not _stays_within(self.fence, x, y, heading + ahead, turned, way):
            return False
        if (self.inside or self.outside) and not self._keeps_to_areas((x, y), heading + ahead, turned, way):
            return False
        return not self.least_range or nearest(ahead - AHEAD, ahead + AHEAD) - way >= self.least_range


def _stays_within(
    fence: tuple[float, float, float, float], x: float, y: float, direction: float, turned: float, way: float
) -> bool:
    """Whether no side of a fence is passed by going so many m in this direction, or in one that differs from it by
    `turned` rad at most."""
    left, bottom, right, top = fence
    for outward, room in ((pi, x - left), (0.0, right - x), (-pi / 2.0, y - bottom), (pi / 2.0, top - y)):
        aside = abs(remainder(direction - outward, 2.0 * pi))
        towards = way * cos(max(0.0, aside - turned))
        if towards > max(0.0, room) + ROUNDED:
            return False
    return True


@dataclass(frozen=True, slots=True)
class Geometry:
    """A body's shape: a disc of `radius` m, with `sonars` range sensors evenly round it, number 0 in front,
    then counter-clockwise, each of which sees one sector and reads `sonar_range` m where nothing is
    nearer."""

    radius: float
    sonars: int = 0
    sonar_range: float = 0.0


@dataclass(frozen=True, slots=True)
class BodyConstant:
    """A number that robots of one type know by name. value: in SI, of the dimension of `unit` ("": a plain number)."""

    name: str
    value: float
    unit: str = ""
    doc: str = ""


@dataclass(frozen=True, slots=True)
class RobotModel:
    """What all robots of one type have in common. sensors: in the order of a `Reading`'s values. actuators:
    in the order of a `Setpoint`'s fields, as many of them as the body has. outlines: for maps, of fences that they keep
    and ways that they may go."""

    name: str
    sensors: tuple[Quantity, ...]
    actuators: tuple[Quantity, ...]
    functions: tuple[HostFunction, ...]
    limits: Limits
    geometry: Geometry
    constants: tuple[BodyConstant, ...] = ()
    areas: tuple[NamedArea, ...] = ()
    outlines: tuple[MapOutline, ...] = ()

    @property
    def is_omni(self) -> bool:
        """Whether it moves to its side, too, as `Setpoint.side` asks: what hovers, and some that drive."""
        return any(actuator.name == "drive_side" for actuator in self.actuators)

    @property
    def hovers(self) -> bool:
        """Whether it moves in all directions, as `Setpoint.side` and `Setpoint.climb` ask."""
        return any(actuator.name == "drive_climb" for actuator in self.actuators)


@dataclass(frozen=True, slots=True)
class Reading:
    """What a body sensed at `time` (s, simulated or monotonic): one SI value per sensor of its model, NaN
    where it measured nothing."""

    time: float
    values: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Setpoint:
    """How a mind wants its body to move: speed ahead in m/s, turn_rate in rad/s; what hovers also moves to its left
    (side) and upwards (climb), m/s, and some bodies on the ground move to their left. NaN leaves that one as it is."""

    speed: float = nan
    turn_rate: float = nan
    side: float = nan
    climb: float = nan


@runtime_checkable
class Robot(Protocol):
    """One body. None of these ever waits or fails for what a mind asks."""

    @property
    def model(self) -> RobotModel: ...

    @property
    def stopped(self) -> bool:
        """Whether the body is latched by `stop`."""

    def sense(self) -> Reading: ...

    def act(self, wanted: Setpoint) -> None:
        """Drive as wanted from now on, as far as the limits allow; while stopped, nothing."""

    def stop(self) -> None:
        """Come to rest as fast as the limits allow and stay so, whatever is asked, until `release`."""

    def release(self) -> None:
        """End `stop`. The body stays at rest until it is asked anew: nothing old resumes by itself."""

    def hold(self, still: bool) -> None:
        """Keep still for as long as `still` was the last word; then the motion of before goes on."""


@runtime_checkable
class Failsafe(Protocol):
    """A body that does something else than come to rest when its operator is gone."""

    def let_go(self) -> None:
        """Nobody drives it any more: bring it to where it is safe. Nothing old resumes by itself."""


@runtime_checkable
class RestSensing(Protocol):
    """A body that knows whether it has come to rest."""

    def rest_state(self) -> RestState | None:
        """How it moves now, by what was measured last; None if one like this does not measure it."""


@runtime_checkable
class Settling(Protocol):
    """A body that can be at rest at once, as only a simulated one can."""

    def settle(self) -> None:
        """Be at rest, as one that has never moved."""


def rest_state_of(model: RobotModel, speed: float, turn_rate: float, resting: float, lag: float) -> RestState:
    """The state of a body that moves at this speed (m/s) and turns at this rate (rad/s; NaN: does not say), and brakes
    as its limits say. resting: m/s up to which it counts as at rest, since measurements are not exact; lag: s for which
    it may go on before it brakes."""
    going = abs(speed)
    fastest = going if isnan(turn_rate) else going + abs(turn_rate) * model.geometry.radius
    if fastest <= resting:
        return RestState(0.0, 0.0)
    return RestState(fastest, going * lag + going * going / (2.0 * BRAKING * model.limits.acceleration))


# ---- many simulated bodies, driven axis by axis: what a server of such robots needs of their world


class Axes(NamedTuple):
    """A number for each of a body's three axes; NaN leaves that axis alone, or means that it has none.

    Of a body on two wheels: the right wheel, the left wheel, nothing; m (and m/s, m/s2). Of one that steers all its
    wheels together: the way, the direction it goes in, its turret; m and rad (and per s, per s2).
    """

    first: float = nan
    second: float = nan
    third: float = nan


class Pose(NamedTuple):
    """Where a body is: x, y in m, heading and turret in rad, counter-clockwise from the x axis. Without a turret of its
    own, a body's turret is its heading."""

    x: float
    y: float
    heading: float
    turret: float


@dataclass(frozen=True, slots=True)
class Condition:
    """What there is to know of one simulated body at `time` (s of simulated time).

    believed: the pose that its encoders give.
    real: where it is.
    speeds: of its axes, 0 for one that it lacks.
    moving: which axes are turning or about to.
    sonars: m, what each last read, NaN before it has ever fired.
    infrared: m, likewise, empty for none.
    touched: angle of each contact that the bumper feels, rad from the heading.
    battery: from 0, empty, to 1.
    """

    time: float
    believed: Pose
    real: Pose
    speeds: Axes
    moving: tuple[bool, bool, bool]
    sonars: tuple[float, ...]
    infrared: tuple[float, ...]
    touched: tuple[float, ...]
    battery: float


class Contact(NamedTuple):
    """Where a body that follows a path would first touch something: x, y of the body in m, and the direction from the
    touched point back into the body, rad in the world's frame."""

    x: float
    y: float
    normal: float


class SonarKind(NamedTuple):
    """What a sonar measures: in a cone that opens by `beam` rad in all, between the least and the greatest range, m."""

    beam: float
    least: float
    most: float


class LidarKind(NamedTuple):
    """So many beams, the first at this angle from the heading, the others counter-clockwise at this distance from each
    other, rad; ranges from the least to the greatest, m."""

    beams: int
    first: float
    increment: float
    least: float
    most: float


Corners = Sequence[tuple[float, float]]
"""Of a polygon, x and y in m."""


class SimulatedWorld(Protocol):
    """Simulated robots, by their index from 0, and the solid things around them. SI units, one frame for everybody.

    Every robot does what it was last asked, within its limits, until it is asked anew. Nothing here waits: `step` alone
    lets time pass. Raises IndexError for a robot that there is not.
    """

    @property
    def count(self) -> int:
        """How many robots there are."""

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""

    @property
    def tick(self) -> float:
        """Simulated seconds of one step."""

    def steers(self, robot: int) -> bool:
        """Whether its axes are way, direction and turret, and not two wheels."""

    def radius(self, robot: int) -> float:
        """Of its body, m."""

    def track(self, robot: int) -> float:
        """From wheel to wheel, m; of wheels that all steer, the diameter of the circle through them."""

    def sonar(self, robot: int) -> SonarKind:
        """Of each of its sonars."""

    def step(self) -> None:
        """Let one tick pass."""

    def observe(self, robot: int) -> Condition: ...

    def set_speeds(self, robot: int, speeds: Axes) -> None:
        """Turn the axes at these speeds from now on."""

    def travel(self, robot: int, distances: Axes) -> None:
        """Turn each axis by this much, at most as fast as `cruise` says, and rest there."""

    def cruise(self, robot: int, speeds: Axes) -> None:
        """How fast `travel` goes, at least 0."""

    def accelerate(self, robot: int, accelerations: Axes) -> None:
        """How fast speeds change, more than 0; never beyond the robot's limits."""

    def limp(self, robot: int, axes: tuple[bool, bool, bool]) -> None:
        """Let go of these axes: they roll out by friction and no longer hold."""

    def rest(self, robot: int) -> None:
        """Come to rest and hold the position."""

    def zero(self, robot: int) -> None:
        """Come to rest, turn the turret home and be at the origin with heading 0: by belief in any case, with the body
        where there is room for it. `moving` until that is done."""

    def believe(self, robot: int, x: float = nan, y: float = nan, heading: float = nan, turret: float = nan) -> None:
        """Correct the pose that the encoders give; NaN leaves a number as it is. The body stays where it is."""

    def place(self, robot: int, pose: Pose) -> None:
        """Put the body somewhere, at rest; it believes to be there."""

    def fire(self, robot: int, order: Sequence[int], pause: float) -> None:
        """Fire these sonars one after the other for ever, each `pause` s after the echo before; none for an empty
        order. A sonar that does not fire keeps its reading."""

    def solids(self) -> Sequence[Corners]:
        """The polygons that there are now, those of the world's file too, circles with many corners."""

    def add(self, corners: Corners) -> bool:
        """Put up a polygon; False if the world is full or that is none."""

    def remove(self, corners: Corners) -> bool:
        """Take the polygon with these corners away; False if there is none."""

    def move(self, corners: Corners, dx: float, dy: float) -> bool:
        """Move the polygon with these corners by so many m; False if there is none."""

    def fill(self, polygons: Sequence[Corners]) -> bool:
        """Put up these in place of all polygons that there are; False, and nothing changes, if they do not fit in or
        one is none."""

    def clear(self) -> None:
        """Take everything away, the edge of the world apart."""

    def predict(self, robot: int, pose: Pose) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """What its sonars and its infrared sensors would read there: m, without noise, other robots left out."""

    def lidar(self, robot: int) -> LidarKind:
        """Of the lidar at its centre."""

    def scan(self, robot: int) -> tuple[float, ...]:
        """What its lidar measures in this tick: m from the robot's centre to the nearest thing along each beam, other
        robots included; infinite where nothing is in reach, minus infinite where something is too near."""

    def along(self, robot: int, start: tuple[float, float], end: tuple[float, float]) -> Contact | None:
        """Where its body touches something on the straight way; None if it is free."""

    def round(self, robot: int, centre: tuple[float, float], radius: float, begin: float, end: float) -> Contact | None:
        """The same on a circular way round `centre` (m), from the angle `begin` to `end` (rad)."""


# ---- a server of such robots, for those who drive them beside its own wire


class ServedRobot(Protocol):
    """A simulated robot of a server. Several clients may drive it: the last word counts."""

    @property
    def robot(self) -> int:
        """Its index in the world."""

    @property
    def world(self) -> SimulatedWorld: ...

    @property
    def steers(self) -> bool:
        """See `SimulatedWorld`."""

    @property
    def holders(self) -> Set[str]:
        """Who keeps it at rest, whatever is asked."""

    def condition(self) -> Condition:
        """What there is to know of it now."""

    def admit(self, client: str) -> None:
        """This client is connected to it."""

    def dismiss(self, client: str) -> None:
        """And is no longer."""

    def driven_by(self, who: str) -> str:
        """It is about to be moved by this client. Gives a sentence if until now one alone did, and that was another."""

    def let_go_by(self, who: str) -> bool:
        """This client no longer drives it; whether it was the last that did."""

    def drive(self, speed: float, turn_rate: float) -> None:
        """Go on at this speed, m/s along its heading, and turn rate, rad/s counter-clockwise, as far as it can."""


class Companion(Protocol):
    """Another way to the robots of a server, beside its own wire, which takes part in every tick."""

    def before_tick(self) -> None:
        """Drive robots as they are told."""

    def after_tick(self) -> None:
        """Tell how they are now."""

    def released(self) -> None:
        """The person at the page has let all robots go: what nobody answers for any more ends as well."""


class RobotServer(Protocol):
    """A server of simulated robots, as its companions see it."""

    @property
    def world(self) -> SimulatedWorld: ...

    @property
    def robots(self) -> Sequence[ServedRobot]:
        """By their index in the world."""

    @property
    def say(self) -> Callable[[str], None]:
        """Tells the person at the terminal."""

    def hold(self, still: bool, by: str, robot: int | None) -> None:
        """Keep one robot (None: all) at rest from now on, whatever is asked, or no longer as far as `by` is
        concerned."""
