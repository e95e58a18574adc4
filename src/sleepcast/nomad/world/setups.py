"""Setups: the equipment of Nomads, read from files.

A setup is a TOML file like a robot type (see `robot_types`), with more tables: [steering] for wheels that all turn
together, [turret] and [infrared].
"""

from __future__ import annotations

from dataclasses import replace
from math import nan
from pathlib import Path

from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.core.given_numbers import MAX_SEED
from sleepcast.core.records import dataclass
from sleepcast.core.settings import Table, toml_document
from sleepcast.core.units import LENGTH, RATE, TIME
from sleepcast.robot import Axes
from sleepcast.simulator.motion.driving import TINIEST
from sleepcast.simulator.scenario.robot_settings import (
    LEAST,
    MAX_SONARS,
    MAX_WORLD,
    WIDEST_BEAM,
    RobotSpec,
    Wheels,
    read_robots,
)

FORMAT = 1
"""Version of the format of setups; files of a newer one are refused."""
SETUPS = Path(__file__).parent / "robots"
MADE = ("limits", "body", "wheels", "sonar", "stores")
"""Tables that a setup shares with a robot type."""


@dataclass(frozen=True, slots=True)
class Infrared:
    """A ring of `count` infrared sensors: full opening angle of each, rad, and range, m."""

    count: int
    beam: float
    most: float


@dataclass(frozen=True, slots=True)
class Setup:
    """The equipment of Nomads.

    robots: as for other robots.
    track: of their wheels, m.
    speeds, accelerations: limits of their axes, NaN for missing axes.
    steers: whether the axes are drive, steering and turret, and not two wheels.
    infrared: None without.
    ignored: sentences about what its file says and nothing here uses.
    """

    robots: RobotSpec
    track: float
    speeds: Axes
    accelerations: Axes
    steers: bool
    infrared: Infrared | None
    ignored: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Turning:
    """Greatest turn rate, rad/s, and its greatest change, rad/s2."""

    rate: float
    acceleration: float


def setup_names() -> list[str]:
    """The included setups, sorted."""
    return sorted(file.stem for file in SETUPS.glob("*.toml"))


def read_setup(setup: Path | str) -> Setup:
    """The setup with this name, or from this file. Raises MisuseError for an unknown name, SettingsError for the
    file."""
    name, known = str(setup), setup_names()
    if name not in known and not name.endswith(".toml"):
        raise MisuseError(
            f'no setup "{name}"{did_you_mean(name, known)}: wanted {", ".join(known)}, or a file *.toml or *.setup'
        )
    file = SETUPS / f"{name}.toml" if name in known else Path(setup)
    with toml_document(file).root() as root:
        version = root.whole("format", low=1, high=MAX_SEED)
        if version > FORMAT:
            raise root.error("format", f"format {version} is newer than this sleepcast, which reads format {FORMAT}")
        root.text("about", "", most=500)
        made = {part: root.values[part] for part in MADE if root.has(part)}
        # The start area and the size of the world are set elsewhere.
        robots = Table(root.document, made | {"type": "nomad", "motion": "still"}, ())
        return _geared(root, read_robots(robots, 1, (), None, (MAX_WORLD, MAX_WORLD), ()))


def _geared(root: Table, robots: RobotSpec) -> Setup:
    """The setup of these robots, with the file's steering, turret and infrared sensors."""
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
        # The simulated body has two wheels: their greatest speed is that of the drive plus that of steering.
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
    """Wheels whose true heading is stored apart from their odometry."""
    if wheels.slip_left or wheels.slip_right or wheels.slip_noise:
        return wheels
    return replace(wheels, slip_left=TINIEST)


def _turning(table: Table, rate: float) -> _Turning:
    """The key ramp is the time from rest to the full rate."""
    return _Turning(rate, rate / table.number("ramp", TIME, low=1e-3, high=60.0))


def _infrared(root: Table) -> Infrared:
    with root.table("infrared") as table:
        return Infrared(
            count=table.whole("count", 16, low=1, high=MAX_SONARS),
            beam=table.number("beam", low=LEAST, high=WIDEST_BEAM),
            most=table.number("range", LENGTH, low=LEAST, high=MAX_WORLD),
        )
