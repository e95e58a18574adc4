"""The state vector: what a client learns of its robot, from the condition of a simulated body.

State has 45 numbers; a state reply has all of them, then a laser block (always empty: no robot here has one), then a
PosData record for each sensor that was asked for, the clock, and the batteries.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import pi

from sleepcast.nomad import units
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
    """The 45 numbers. steers: as of its world; speed: of the simulation; compass: whether it has one that is on."""
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


def ring(readings: Sequence[float], told: Callable[[float], int], nothing: int) -> list[int]:
    """What sixteen sensors say, of which the robot may have fewer."""
    found = [told(reading) for reading in readings[:RING]]
    return found + [nothing] * (RING - len(found))


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
