"""The state vector and the state reply: built from a simulated body's condition, read by clients.

State has 45 numbers; a state reply has all of them, then a laser block (always empty: no robot here has one), then a
PosData record for each sensor that was asked for, the clock, and the batteries.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from math import pi
from typing import NamedTuple

from sleepcast.core.records import dataclass
from sleepcast.nomad.wire import units
from sleepcast.nomad.wire.units import FULL_BATTERY, FULL_TURN, INCH, REAL_TIME, metres, radians
from sleepcast.robot import Axes, Condition, Pose

ENTRIES = 45
INFRARED, SONAR, BUMPER, POSITION, VELOCITY = 1, 17, 33, 34, 38
MOTORS, LASER_MODE, COMPASS, ERROR = 41, 42, 43, 44
"""Where things stand in the state vector."""
RING = 16
"""Sonars, and infrared sensors, on the wire."""
SWITCHES, SCOUT_SWITCHES = 20, 24
"""Of the bumper: two rings of ten on a Nomad 200; a Scout's ribbon as so many equal parts."""

MASK_WORDS = 7
EVERYTHING = (0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x0E, 0x00)
"""The mask of a client that has just connected."""
POS_INFRARED, POS_SONAR, POS_BUMPER, POS_LASER, POS_COMPASS = 1, 2, 4, 8, 16
"""Bits of the mask's last word: whose PosData is wanted."""


def state_of(condition: Condition, *, steers: bool, speed: float, compass: bool) -> list[int]:
    """The 45 numbers.

    steers: as of its world.
    speed: of the simulation.
    compass: whether it has one that is on.
    """
    state = [0] * ENTRIES
    state[0] = units.pace(speed)
    state[INFRARED:SONAR] = ring(condition.infrared, units.infrared, units.NOTHING_NEAR)
    state[SONAR:BUMPER] = ring(condition.sonars, units.inches, units.NOTHING_HEARD)
    state[BUMPER] = bumper(condition.touched, SWITCHES if steers else SCOUT_SWITCHES)
    state[POSITION:VELOCITY] = position(condition.believed)
    state[VELOCITY:MOTORS] = velocity(condition.speeds, steers=steers)
    first, second, third = condition.moving
    state[MOTORS] = first | second << 1 | third << 2
    if compass:
        state[COMPASS] = units.direction(condition.real.turret)
    return state


def ring(readings: Sequence[float], encode: Callable[[float], int], nothing: int) -> list[int]:
    """What sixteen sensors say, of which the robot may have fewer."""
    words = [encode(reading) for reading in readings[:RING]]
    return words + [nothing] * (RING - len(words))


def bumper(touched: Sequence[float], switches: int) -> int:
    """Bits of the bumper for contacts at these angles (rad from the heading): 0 in front, then counter-clockwise."""
    bits = 0
    for angle in touched:
        bits |= 1 << round(angle / (2.0 * pi) * switches) % switches
    return bits


def position(pose: Pose) -> tuple[int, int, int, int]:
    """x, y, steering, turret."""
    return (units.tenths(pose.x), units.tenths(pose.y), units.direction(pose.heading), units.direction(pose.turret))


def velocity(speeds: Axes, *, steers: bool) -> tuple[int, int, int]:
    """Of the three axes."""
    if steers:
        return (units.tenths(speeds.first), units.tenth_degrees(speeds.second), units.tenth_degrees(speeds.third))
    return (units.tenths(speeds.first), units.tenths(speeds.second), units.tenths(speeds.third))


def axes(words: Sequence[int], *, steers: bool) -> Axes:
    """Three numbers of the wire, for the axes, in SI."""
    first, second, third = words
    if steers:
        return Axes(units.metres(first), units.radians(second), units.radians(third))
    return Axes(units.metres(first), units.metres(second))


def tail(condition: Condition) -> tuple[int, int, int]:
    """What ends a state reply: the clock and both batteries."""
    charge = units.battery(condition.battery)
    return (units.milliseconds(condition.time), charge, charge)


def in_words(state: Sequence[int]) -> str:
    """A state vector for a person, in the Nomad's units."""
    x, y, steering, turret = state[POSITION:VELOCITY]
    said = f"x {x}, y {y}, steering {steering}, turret {turret}; speeds {_row(state[VELOCITY:MOTORS])}"
    if any(near < units.NOTHING_NEAR for near in state[INFRARED:SONAR]):
        said += f"; infrared {_row(state[INFRARED:SONAR])}"
    return f"{said}; sonars {_row(state[SONAR:BUMPER])}; bumper {state[BUMPER]}"


def _row(numbers: Sequence[int]) -> str:
    return " ".join(map(str, numbers))


@dataclass(slots=True)
class Mask:
    """Which entries of the state vector one client wants, and what they were when it last wanted them.

    words: of the last ct. posdata: bits of the sensors whose PosData it wants.
    """

    words: Sequence[int] = EVERYTHING
    posdata: int = 0
    _wanted: list[bool] = field(default_factory=lambda: [True] * ENTRIES)
    _held: list[int] = field(default_factory=lambda: [0] * ENTRIES)
    everything: bool = True
    """Whether no entry that a robot has is masked out."""

    def configure(self, words: Sequence[int]) -> None:
        """Take the words of ct."""
        self.words = words
        bits = [bool(word >> bit & 1) for word in words[:5] for bit in range(8)]
        self._wanted = [True, *bits, True, bool(words[5] & 4), bool(words[5] & 8), True]
        self.posdata = words[6] & 0x1F
        self.everything = all(self._wanted)

    def sift(self, state: list[int]) -> list[int]:
        """The state as this client may see it: an entry that is masked out keeps what it last was."""
        if not self.everything:
            state = [now if wanted else held for now, held, wanted in zip(state, self._held, self._wanted, strict=True)]
        self._held = state
        return state


# What a program knows of its robot: the words of the last state reply, and the same in SI.

MAX_LASER = 482
"""Points or lines of one scan: what the programs' array has room for."""
STAMPED = (
    ("infrared", POS_INFRARED, RING),
    ("sonar", POS_SONAR, RING),
    ("bumper", POS_BUMPER, 1),
    ("laser", POS_LASER, 1),
    ("compass", POS_COMPASS, 1),
)
"""Sensors in the order of their records: name, bit in the mask's entry 0, how many records."""
STAMP_WORDS = 9


class Stamp(NamedTuple):
    """Where and when a sensor measured, as words: 1/10 in, 1/10 deg, 1/10 in/s or 1/10 deg/s, ms. position_clock: of
    the pose; clock: of the measurement."""

    x: int
    y: int
    steering: int
    turret: int
    first: int
    second: int
    third: int
    position_clock: int
    clock: int


@dataclass(frozen=True, slots=True)
class State:
    """One robot as its server last reported it.

    words: State[0] to State[44] of a C program.
    laser: the scan, `laser_numbers` for each point.
    stamps: by sensor, where they were asked for.
    clock: ms.
    batteries: raw readings of the computer's and of the motors', 0..255.
    """

    words: tuple[int, ...] = (0,) * ENTRIES
    laser: tuple[int, ...] = ()
    laser_numbers: int = 2
    stamps: Mapping[str, tuple[Stamp, ...]] = field(default_factory=dict)
    clock: int = 0
    batteries: tuple[int, int] = (0, 0)

    @property
    def time(self) -> float:
        """Of the robot's own clock, s."""
        return self.clock / 1000.0

    @property
    def simulation_speed(self) -> float:
        """Simulated seconds in a second; 1 on a real robot."""
        return self.words[0] / REAL_TIME

    @property
    def infrared(self) -> tuple[int, ...]:
        """Nearness by the 16 infrared sensors, counter-clockwise from the front: 0 near to 15 nothing."""
        return self.words[INFRARED : INFRARED + RING]

    @property
    def sonar_inches(self) -> tuple[int, ...]:
        """Ranges of the 16 sonars as they came, counter-clockwise from the front; 255 is nothing near."""
        return self.words[SONAR : SONAR + RING]

    @property
    def sonars(self) -> tuple[float, ...]:
        """The same in m."""
        return tuple(inches * INCH for inches in self.sonar_inches)

    @property
    def bumper(self) -> int:
        """One bit for each switch that is pressed."""
        return self.words[BUMPER]

    @property
    def x(self) -> float:
        """By the encoders, m."""
        return metres(self.words[POSITION])

    @property
    def y(self) -> float:
        """By the encoders, m."""
        return metres(self.words[POSITION + 1])

    @property
    def heading(self) -> float:
        """By the encoders, rad, -pi..pi."""
        return _angle(self.words[POSITION + 2])

    @property
    def turret(self) -> float:
        """By the encoders, rad, -pi..pi."""
        return _angle(self.words[POSITION + 3])

    @property
    def velocities(self) -> tuple[int, ...]:
        """Of the three axes, as they came."""
        return self.words[VELOCITY : VELOCITY + 3]

    @property
    def right_speed(self) -> float:
        """Of a Scout's right wheel, m/s."""
        return metres(self.words[VELOCITY])

    @property
    def left_speed(self) -> float:
        """Of a Scout's left wheel, m/s."""
        return metres(self.words[VELOCITY + 1])

    @property
    def moving(self) -> tuple[bool, bool, bool]:
        """Which axes' motors are active."""
        bits = self.words[MOTORS]
        return bool(bits & 1), bool(bits & 2), bool(bits & 4)

    @property
    def compass(self) -> float:
        """rad, -pi..pi; 0 where there is none."""
        return _angle(self.words[COMPASS])

    @property
    def computer_volts(self) -> float:
        return _volts(self.batteries[0], 12.0)

    @property
    def motor_volts(self) -> float:
        return _volts(self.batteries[1], 12.85)

    def with_words(self, first: int, words: Sequence[int]) -> State:
        """The same with other words from place `first` on."""
        new = (*self.words[:first], *words, *self.words[first + len(words) :])
        return State(new, self.laser, self.laser_numbers, self.stamps, self.clock, self.batteries)


class ReplyReader:
    """Takes the words of a reply one after the other. distrust: makes what is raised where they cannot be right."""

    def __init__(self, words: Sequence[int], distrust: Callable[[str], Exception]) -> None:
        self._words, self._at, self._distrust = words, 0, distrust

    def take(self, count: int) -> tuple[int, ...]:
        """The next words."""
        taken = tuple(self._words[self._at : self._at + count])
        if len(taken) < count:
            raise self._distrust(f"a reply has {len(self._words)} words where at least {self._at + count} belong")
        self._at += count
        return taken

    def rest(self) -> tuple[int, ...]:
        """All that are left."""
        return self.take(len(self._words) - self._at)

    def laser(self, numbers: int) -> tuple[int, ...]:
        """A scan with so many numbers for each point."""
        (count,) = self.take(1)
        if not 0 <= count <= MAX_LASER:
            raise self._distrust(f"a scan has {count} points, and {MAX_LASER} are the most")
        return self.take(count * numbers)

    def stamps(self, bits: int) -> dict[str, tuple[Stamp, ...]]:
        """The records of the sensors whose bits are set."""
        return {
            name: tuple(Stamp(*self.take(STAMP_WORDS)) for _ in range(count))
            for name, bit, count in STAMPED
            if bits & bit
        }


def read_state(answer: ReplyReader, laser_numbers: int, stamp_bits: int) -> State:
    """The state in a reply. laser_numbers: for each point of a scan; stamp_bits: the mask's entry 0."""
    words = answer.take(ENTRIES)
    laser = answer.laser(laser_numbers)
    stamps = answer.stamps(stamp_bits)
    clock, computer, motors = answer.take(3)
    # A good reply carries no error, whatever stands in its place.
    return State((*words[:ERROR], 0), laser, laser_numbers, stamps, clock, (computer, motors))


def _angle(tenths: int) -> float:
    """A direction as -pi..pi."""
    return radians((tenths + FULL_TURN // 2) % FULL_TURN - FULL_TURN // 2)


def _volts(raw: int, span: float) -> float:
    """Of a battery whose meter ends at `span` V."""
    return (2.0 + 3.0 * raw / FULL_BATTERY) * span / 5.0
