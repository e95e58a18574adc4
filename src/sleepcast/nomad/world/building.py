"""Builds a world of Nomads from files: a site, a setup, and robots placed in it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import ceil, pi
from pathlib import Path

from sleepcast.channel.simulated_radio import RadioModel
from sleepcast.core.errors import MisuseError
from sleepcast.nomad.world.nomad_world import NomadWorld
from sleepcast.nomad.world.paths import has_room, spread
from sleepcast.nomad.world.setup_files import SUFFIX, read_robot_setup
from sleepcast.nomad.world.setups import Setup, read_setup
from sleepcast.nomad.world.sites import CELL, MAX_NOMADS, Site, read_site
from sleepcast.simulator.engine import Machine, NumPyMachine
from sleepcast.simulator.scenario.robot_settings import MAX_TIME, CrosstalkModel, RobotSpec
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.simulation import Simulator
from sleepcast.simulator.world.world import boundary

TICK = 0.02
"""Tick, s: a Scout at full speed moves 2 cm between two sonar readings, less than the whole inches they report; and
fifty ticks take a few hundredths of one core."""
FEW = 50
"""Number of robots whose ticks NumPy computes in real time with nine tenths of a core to spare."""
WARM_ROBOTS, WARM_TICKS = 2, 3
"""Size of a warm-up: enough for what happens only between robots, or after something has moved."""
CROSSTALK = CrosstalkModel(chance=1.0, spread=pi / 6.0, robots=True)
"""Cross-talk for setups that do not specify it."""


def nomad_world(
    world: Path | None = None,
    setup: Path | str = "ideal",
    robots: int | None = None,
    seed: int | None = None,
    *,
    crosstalk: bool | None = None,
    tick: float = TICK,
    expedite: bool = False,
    machine: Machine | None = None,
) -> NomadWorld:
    """A world with robots in it.

    world: a file or folder, see `sites`; None is an empty room.
    setup: its name or a file, see `setups`.
    robots: number of robots; None: as many as the world has starts, or one.
    seed: replaces the world's own.
    crosstalk: whether sonars mistake each other's pings for their own; None: as the setup says.
    tick: simulated seconds per step.
    expedite: whether ticks should be as fast as possible even if kernels must be compiled first; otherwise up to `FEW`
        robots use NumPy, which is ready at once.
    machine: see `Simulator`; None chooses according to `expedite`.

    Unless the world says where, the first robot starts at the origin, heading east, with the others around it.
    Raises MisuseError, and SettingsError for errors in a file.
    """
    if robots is not None and not 1 <= robots <= MAX_NOMADS:
        raise MisuseError(f"{robots} robots: wanted 1 to {MAX_NOMADS}")
    if not 1e-3 <= tick <= 1.0:
        raise MisuseError(f"a tick of {tick} s: wanted 0.001 to 1")
    made, site = _heard(_equipment(setup), crosstalk), read_site(world, robots, seed)
    count = robots or max(1, len(site.starts))
    if machine is None and count <= FEW and not expedite:
        machine = NumPyMachine()
    elif machine is None:
        _warm_up()
    # The bodies start in an empty world, so that there is room whatever the site is like; then they move to their
    # starts.
    simulator = Simulator(_scenario(site, made.robots, count, tick), machine=machine)
    for shape in site.shapes:
        simulator.world.add(shape)
    starts = site.starts[:count]
    for robot, start in enumerate(starts):
        if not has_room(simulator.bodies, start.x, start.y, robot, range(robot)):
            raise start.no_room
        simulator.bodies.place(robot, start.x, start.y, start.heading)
    least = CELL * ceil(2.2 * made.robots.geometry.radius / CELL)
    spread(simulator.bodies, range(len(starts)), site.origin, (2.0 * least, least))
    return NomadWorld(simulator, made, site.origin)


def _equipment(setup: Path | str) -> Setup:
    """The equipment of this name, or from this file; a robot.setup changes that of an ideal Scout."""
    if Path(setup).suffix.casefold() == SUFFIX:
        return read_robot_setup(Path(setup), read_setup("ideal"))
    return read_setup(setup)


@cache
def _warm_up() -> None:
    """Load the kernels of the installed backend, once per process, before anything waits for a tick."""
    setup = read_setup("nomad200")
    simulator = Simulator(_scenario(read_site(None), setup.robots, WARM_ROBOTS, TICK))
    nomads = NomadWorld(simulator, setup, (0.0, 0.0))
    for _ in range(WARM_TICKS):
        nomads.step()
        nomads.observe(0)


def _heard(setup: Setup, crosstalk: bool | None) -> Setup:
    """The setup with or without cross-talk."""
    ring = setup.robots.ring
    assert ring  # a setup has sonars
    if crosstalk is None or crosstalk == (ring.crosstalk is not None):
        return setup
    ring = replace(ring, crosstalk=CROSSTALK if crosstalk else None)
    return replace(setup, robots=replace(setup.robots, ring=ring))


def _scenario(site: Site, robots: RobotSpec, count: int, tick: float) -> Scenario:
    """The site as a scenario with nothing but robots and its edge."""
    radius = robots.geometry.radius
    if min(site.width, site.height) < 4.0 * radius:
        raise MisuseError(f"{site.path}: a world of {site.width:g} by {site.height:g} m has no room for a robot")
    limits = replace(robots.limits, fence=(0.0, 0.0, site.width, site.height))
    inner = [(1.01 * radius, size - 1.01 * radius) for size in (site.width, site.height)]
    return Scenario(
        name="nomads",
        path=site.path,
        title="Nomads",
        about="",
        seed=site.seed,
        tick=tick,
        speed_up=1.0,
        seconds=MAX_TIME,
        width=site.width,
        height=site.height,
        length_unit="in",
        shapes=(boundary(site.width, site.height),),
        fenced=False,
        robots=replace(robots, count=count, limits=limits, x=inner[0], y=inner[1]),
        places=(),
        noise={},
        radio=RadioModel(),
        telemetry=1.0,
        commands=(),
        mission=(),
        laser=site.laser,
    )
