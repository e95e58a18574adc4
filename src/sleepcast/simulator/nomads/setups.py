"""Setups: what robots of a Nomad's kind are like, read from files.

A setup is TOML like a type of robots (see `robot_types`), with more tables: [steering] for wheels that all turn
together, [turret] and [infrared] for what stands on them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import nan
from pathlib import Path

from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.core.settings import Table, toml_document
from sleepcast.core.units import LENGTH, RATE, TIME
from sleepcast.robot import Axes
from sleepcast.simulator.scenario.robot_settings import (
    LEAST,
    MAX_SONARS,
    MAX_WORLD,
    WIDEST_BEAM,
    RobotSpec,
    Wheels,
    read_robots,
)
from sleepcast.simulator.scenario.world_settings import MAX_SEED

FORMAT = 1
"""The version of the format of setups; a file of a newer one is refused."""
SETUPS = Path(__file__).parent.parent / "setups"
MADE = ("limits", "body", "wheels", "sonar", "stores")
"""What a setup has as a type of robots has it."""
TINIEST = 1e-300
"""A slip that changes no number. Wheels that slip let the real way follow the real heading; without, the encoders' one
would do, and a corrected encoder would turn the body."""


@dataclass(frozen=True, slots=True)
class Infrared:
    """A ring of `count` infrared sensors: the whole opening of each, rad, and how far they see, m."""

    count: int
    beam: float
    most: float


@dataclass(frozen=True, slots=True)
class Setup:
    """What robots are like. robots: how they are made; track: of their wheels, m; speeds, accelerations: the limits of
    their axes, NaN for one that they lack; steers: whether these are way, direction and turret, and not two wheels;
    infrared: None without."""

    robots: RobotSpec
    track: float
    speeds: Axes
    accelerations: Axes
    steers: bool
    infrared: Infrared | None


@dataclass(frozen=True, slots=True)
class _Turning:
    """How fast something turns at most, rad/s, and how fast that changes, rad/s2."""

    rate: float
    acceleration: float


def setup_names() -> list[str]:
    """The setups that come along, sorted."""
    return sorted(file.stem for file in SETUPS.glob("*.toml"))


def read_setup(setup: Path | str) -> Setup:
    """The setup with this name, or of this file. Raises MisuseError for no such name, SettingsError for the file."""
    name, known = str(setup), setup_names()
    if name not in known and not name.endswith(".toml"):
        raise MisuseError(f'no setup "{name}"{did_you_mean(name, known)}: wanted {", ".join(known)}, or a file *.toml')
    file = SETUPS / f"{name}.toml" if name in known else Path(setup)
    with toml_document(file).root() as root:
        version = root.whole("format", low=1, high=MAX_SEED)
        if version > FORMAT:
            raise root.error("format", f"format {version} is newer than this sleepcast, which reads format {FORMAT}")
        root.text("about", "", most=500)
        made = {part: root.values[part] for part in MADE if root.has(part)}
        # Where they start, and in how large a world, is for others to say.
        robots = Table(root.document, made | {"type": "nomad", "motion": "still"}, ())
        return _geared(root, read_robots(robots, 1, (), (MAX_WORLD, MAX_WORLD), ()))


def _geared(root: Table, robots: RobotSpec) -> Setup:
    """The setup of these robots, with what the file says of steering, turret and infrared sensors."""
    limits = robots.limits
    if robots.wheels is None:
        raise root.error("wheels", "is missing: wanted a table [wheels] with their track")
    if robots.ring is None or robots.ring.pause is None:
        raise root.error("sonar", "wanted sonars that fire one after the other: a table [sonar] with their pause")
    wheels = _apart(robots.wheels)
    steers = root.has("steering")
    second, third = _Turning(limits.speed, limits.acceleration), _Turning(nan, nan)
    if steers:
        with root.table("steering") as table:
            second = _turning(table, limits.turn_rate)
    if root.has("turret"):
        with root.table("turret") as table:
            third = _turning(table, table.number("turn_rate", RATE, low=LEAST, high=100.0))
    speed, acceleration = limits.speed, limits.acceleration
    if steers:
        # The bodies' two wheels stand for all: their speeds are the way's, and the steering's on top of it.
        speed += wheels.track / 2.0 * second.rate
        acceleration += wheels.track / 2.0 * second.acceleration
    return Setup(
        robots=replace(robots, wheels=wheels, limits=replace(limits, speed=speed, acceleration=acceleration)),
        track=wheels.track,
        speeds=Axes(limits.speed, second.rate, third.rate),
        accelerations=Axes(limits.acceleration, second.acceleration, third.acceleration),
        steers=steers,
        infrared=_infrared(root) if root.has("infrared") else None,
    )


def _apart(wheels: Wheels) -> Wheels:
    """The same wheels, which know the real heading from the believed one."""
    if wheels.slip_left or wheels.slip_right or wheels.slip_noise:
        return wheels
    return replace(wheels, slip_left=TINIEST)


def _turning(table: Table, rate: float) -> _Turning:
    """ramp: the time from rest to the full rate."""
    return _Turning(rate, rate / table.number("ramp", TIME, low=1e-3, high=60.0))


def _infrared(root: Table) -> Infrared:
    with root.table("infrared") as table:
        return Infrared(
            count=table.whole("count", 16, low=1, high=MAX_SONARS),
            beam=table.number("beam", low=LEAST, high=WIDEST_BEAM),
            most=table.number("range", LENGTH, low=LEAST, high=MAX_WORLD),
        )
