"""A swarm on the operator's page: the simulator's swarm put into the shapes that the console shows."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from math import cos, pi, sin
from threading import Event

from sleepcast.cli.headless import warm_up
from sleepcast.cli.interrupts import INTERRUPTED, TERMINATED, Terminated, end_now
from sleepcast.cli.recording import Wanted, recorded
from sleepcast.cli.snapshots import Keeping
from sleepcast.cli.streams import announce
from sleepcast.console import Address, Outline, Place, ReadyCommand, Scene, serve
from sleepcast.core.clock import WallClock
from sleepcast.language import Vocabulary
from sleepcast.loop import Pace, Swarm
from sleepcast.simulator import Area, Circle, Scenario, Shape, Wall
from sleepcast.simulator.robot_types import slices
from sleepcast.station import Station

ROUND = 32
"""Corners of a circle as it is drawn."""


class SwarmOnPage:
    """A simulated swarm as the console wants to see it (its `Swarm`)."""

    def __init__(self, swarm: Swarm) -> None:
        self._swarm = swarm
        world = swarm.simulator.world
        self._world_version = world.version
        self._obstacles: tuple[tuple[Outline, ...], ...] | None = None
        # Not the scenario's walls: the swarm may come from a snapshot.
        now = replace(swarm.simulator.scenario, shapes=tuple(world.shapes.values()))
        self.scene = scene_of(now, tuple(swarm.simulator.names))
        self.minds = swarm.fleet
        self.vocabulary: Vocabulary = swarm.vocabulary

    @property
    def tick(self) -> int:
        """Ticks since the start."""
        return self._swarm.simulator.tick

    def now(self) -> float:
        """Simulated seconds since the start."""
        return self._swarm.now()

    def step(self) -> None:
        """One tick of everything."""
        self._swarm.step()

    def poses(self) -> bytes:
        """x (m), y (m) and heading (rad, counter-clockwise from x) of each robot in turn, float32, little endian."""
        simulator = self._swarm.simulator
        found = array("f", bytes(12 * len(simulator.names)))
        for column, values in enumerate((simulator.x, simulator.y, simulator.bodies.heading)):
            # The bytes keep their order whatever the machine's own: the array only moves them, four at a time.
            found[column::3] = array("f", values.astype("<f4").tobytes())
        return found.tobytes()

    def obstacles(self) -> tuple[tuple[Outline, ...], ...] | None:
        """What is solid now, once that has changed."""
        world = self._swarm.simulator.world
        if world.version != self._world_version:
            self._world_version = world.version
            self._obstacles = tuple(outlines(shape) for shape in world.shapes.values())
        return self._obstacles

    def pings(self) -> bytes:
        """Who has pinged since this was last asked, a byte for each robot; see `Simulator.pinged`."""
        return self._swarm.simulator.pinged()


def scene_of(scenario: Scenario, names: tuple[str, ...]) -> Scene:
    """What the page draws under the robots, which have these names."""
    return Scene(
        title=scenario.title,
        story=" ".join(scenario.about.split()),
        noun=f"{scenario.robots.type}s",
        names=names,
        area=(0.0, 0.0, scenario.width, scenario.height),
        unit=scenario.length_unit or "m",
        sizes=tuple(
            (part.stop - part.start, sort.geometry.radius)
            for sort, part in zip(scenario.each_sort, slices(scenario.each_sort, len(names)), strict=True)
        ),
        places=tuple(Place(place.title, place.x, place.y) for place in scenario.places),
        obstacles=tuple(outlines(shape) for shape in scenario.shapes),
        lights=tuple(Place(light.title, light.x, light.y) for light in scenario.lights),
        commands=tuple(ReadyCommand(each.title, each.text.strip(), each.about) for each in scenario.commands),
    )


def outlines(shape: Shape) -> tuple[Outline, ...]:
    """A shape as the page draws it. A wall goes there and back; a circle has many corners."""
    if isinstance(shape, Circle):
        angles = (2.0 * pi * corner / ROUND for corner in range(ROUND))
        return (tuple((shape.x + shape.radius * cos(angle), shape.y + shape.radius * sin(angle)) for angle in angles),)
    if isinstance(shape, Wall):
        return ((*shape.points, *shape.points[-2:0:-1]),)
    return shape.outlines if isinstance(shape, Area) else (shape.corners,)


def show(
    swarm: Swarm,
    station: Station,
    speed: float | None,
    address: Address,
    wanted: Wanted | None = None,
    keeping: Keeping | None = None,
    threads: int | None = None,
) -> None:
    """Serve the page of a swarm until Ctrl-C, which comes out as KeyboardInterrupt.

    speed: simulated seconds in a second (None: the scenario's own). wanted: what is recorded of it. keeping: the
    snapshot to take at the end. threads: see `headless.warm_up`, which is done while the page is served already. Raises
    what the console raises for the address, and what Recorder raises.
    """
    clock, scenario, warm = WallClock(), swarm.simulator.scenario, Event()

    def prepare() -> None:
        warm_up(scenario, threads)
        warm.set()

    try:
        serve(
            SwarmOnPage(swarm),
            station,
            Pace(clock, swarm, scenario.speed_up if speed is None else speed),
            clock,
            address=address,
            say=announce,
            prepare=prepare,
            around=_kept(swarm, station, wanted, keeping),
        )
    except (KeyboardInterrupt, Terminated) as error:
        if not warm.is_set():
            end_now(TERMINATED if isinstance(error, Terminated) else INTERRUPTED)
        raise


@contextmanager
def _kept(swarm: Swarm, station: Station, wanted: Wanted | None, keeping: Keeping | None) -> Iterator[None]:
    """Record what happens inside, and keep the swarm at the end. A page that could not be opened comes by neither: it
    would leave an empty recording, and replace a good snapshot by one of the start."""
    with ExitStack() as stack:
        if keeping is not None:
            stack.callback(keeping.take, swarm)
        if wanted is not None:
            stack.enter_context(recorded(swarm, station, wanted))
        yield
