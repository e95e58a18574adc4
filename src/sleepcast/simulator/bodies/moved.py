"""What bodies are to the modules that let them fly: their columns, as far as these need them.

`Bodies` is `Grounded`, and its `Flight` is `Aloft`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.model import Quantity
from sleepcast.simulator.bodies.air import Air
from sleepcast.simulator.bodies.population import Population
from sleepcast.simulator.bodies.proximity import Neighbours
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.motion.flying import FlightLaws
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.world.world import World

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Whole = NDArray[np.intp]


class Grounded(Protocol):
    """The bodies of a world, or of one type, as far as their flight concerns them; see `bodies.Bodies`."""

    count: int
    scenario: Scenario
    seed: int
    tick: int
    world: World
    near: Neighbours
    machine: Machine
    population: Population | None
    radii: Floats
    sensors: tuple[Quantity, ...]
    known: Floats
    stores: Floats
    store_names: tuple[str, ...]
    uses: Floats
    x: Floats
    y: Floats
    heading: Floats
    speed: Floats
    mode: NDArray[np.int8]
    held: Flags
    still: Flags
    stopped: Flags
    wanted_speed: Floats
    wanted_turn: Floats
    wanted_side: Floats
    target_x: Floats
    target_y: Floats
    of_each_type: list[slice]

    @property
    def parts(self) -> Sequence[Grounded]: ...

    def by_type(self, values: Sequence[float], /) -> Floats: ...

    def drawn(self, purpose: str, /) -> Floats: ...

    def go_to(self, which: Whole, x: Floats, y: Floats, /) -> None: ...

    def exhausted(self) -> Flags | None: ...

    def say_of(self, robot: int, sentence: str) -> None: ...


class Aloft(Protocol):
    """What flies among bodies, as far as it concerns planes; see `flight.Flight`."""

    z: Floats
    ground: Floats
    air: Air | None
    climb_rate: Floats
    armed: Floats
    target_z: Floats

    def laws_of(self, which: Whole | slice, /) -> FlightLaws: ...

    def ground_at(self, x: Floats, y: Floats, /) -> Floats: ...

    def below(self, x: Floats, y: Floats, z: Floats, /) -> Floats: ...


class Rooms(Protocol):
    """Planes, as far as it concerns where there is room for their circles; see `wings.Wings`."""

    planes: Flags
    circle: Floats

    def roomy(self, which: Whole, x: Floats, y: Floats, /) -> tuple[Floats, Floats]: ...


class Returning(Protocol):
    """What flies among bodies, as far as it concerns its way home; see `flight.Flight`."""

    z: Floats
    target_z: Floats

    @property
    def wings(self) -> Rooms | None: ...

    def laws_of(self, which: Whole | slice, /) -> FlightLaws: ...

    def ground_at(self, x: Floats, y: Floats, /) -> Floats: ...

    def rest(self, which: Whole, target: float = ..., /) -> None: ...
