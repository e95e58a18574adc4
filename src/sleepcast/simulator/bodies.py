"""Bodies: the state of all simulated robots as arrays, one column for each robot.

What a robot can sense lies in one table (`sensed`), a row for each sensor of the model, so that a reading is
a column; `x`, `y`, `heading`, `speed` and the stores are rows of it under a name. What a body was last asked
to do lies beside it. Everything is float64, SI, and changed in place; chance comes from the seed and the
robot's number alone.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from enum import IntEnum
from hashlib import sha256
from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.chance import GOLDEN, key, mix, uniform
from sleepcast.simulator.groups import value_quantities, values_of
from sleepcast.simulator.scenario import Scenario, Store
from sleepcast.simulator.signals import signal_sensors
from sleepcast.units import Quantity

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

MAX_SAYINGS = 1_000
"""Latest sayings that are kept for whoever listens."""
TURN = 2.0 * pi


class Mode(IntEnum):
    """What moves a body."""

    WANDER = 0
    DRIVE = 1
    GOTO = 2


class Saying(NamedTuple):
    """What a robot said aloud (`TK`): when (s), which robot (its index), and the words."""

    time: float
    robot: int
    text: str


class Bodies:
    """`count` bodies at the start of a scenario; see the module.

    Arrays of shape (count,) unless said otherwise. x, y: m in the world's frame; heading: rad, -pi..pi,
    counter- clockwise from the x axis; speed: m/s along the heading. stores: shape (stores, count). mode: a
    `Mode`; wanted_speed, wanted_turn: what DRIVE asked for, m/s and rad/s; target_x, target_y: where GOTO
    leads, m. stopped, held: latched by STOP, kept still. swing: rad of a tumble that are still to be turned.
    roaming: the turn rate of a wandering body, rad/s.
    """

    def __init__(self, scenario: Scenario, seed: int) -> None:
        robots = scenario.robots
        self.scenario, self.seed, self.count = scenario, seed, robots.count
        self.limits, self.geometry = robots.limits, robots.geometry
        self.fence = (0.0, 0.0, scenario.width, scenario.height)
        self.tick = 0
        self.said: deque[Saying] = deque(maxlen=MAX_SAYINGS)
        self.sensors = sensors_of(scenario)
        self.sensed: Floats = np.full((len(self.sensors), self.count), np.nan)
        self.numbers = np.arange(self.count, dtype=np.uint64)
        self.chance = mix(self.numbers * np.uint64(GOLDEN) + np.uint64(key(seed, "bodies")))
        """A key for each robot, uint64."""
        self.x: Floats = self.sensed[0]
        self.y: Floats = self.sensed[1]
        self.heading: Floats = self.sensed[2]
        self.speed: Floats = self.sensed[3]
        self.stores: Floats = self.sensed[4 : 4 + len(robots.stores)]
        self._start()
        self.mode = np.full(self.count, Mode.WANDER if robots.wanders else Mode.DRIVE, np.int8)
        self.wanted_speed, self.wanted_turn = np.zeros(self.count), np.zeros(self.count)
        self.target_x, self.target_y = np.zeros(self.count), np.zeros(self.count)
        self.swing, self.roaming = np.zeros(self.count), np.zeros(self.count)
        self.stopped, self.held = np.zeros(self.count, bool), np.zeros(self.count, bool)

    @property
    def time(self) -> float:
        """Simulated time in s."""
        return self.tick * self.scenario.tick

    def readings(self, numbers: Sequence[int] | None = None) -> list[list[float]]:
        """What the robots with these indices (None: all) sense now: for each one value per sensor, in SI, NaN
        where it measured nothing. Asked twice in one tick, the answer is the same, noise included."""
        which = slice(None) if numbers is None else np.asarray(numbers, np.int64)
        sensed = self.sensed[:, which].T
        if self.scenario.noise:
            sensed = sensed.copy()
            for column, sensor in enumerate(self.sensors):
                deviation = self.scenario.noise.get(sensor.name, 0.0)
                if deviation:
                    noisy = sensed[:, column] + deviation * self._normal(sensor.name, self.numbers[which])
                    sensed[:, column] = np.clip(noisy, sensor.low, sensor.high)
        rows: list[list[float]] = sensed.tolist()
        return rows

    def _normal(self, name: str, numbers: NDArray[np.uint64]) -> Floats:
        """Standard normal noise of one sensor at this tick (Box and Muller's method)."""
        size, angle = (self.drawn(f"noise {half} {name} {self.tick}", numbers) for half in "ab")
        normal: Floats = np.sqrt(-2.0 * np.log(1.0 - size)) * np.cos(TURN * angle)
        return normal

    def drawn(self, purpose: str, numbers: NDArray[np.uint64] | None = None) -> Floats:
        """For each robot (or those of `numbers`) a number from [0, 1) for `purpose`, the same in every
        run."""
        return uniform(key(self.seed, purpose), self.numbers if numbers is None else numbers)

    def state_hash(self, more: Iterable[NDArray[np.generic]] = ()) -> str:
        """SHA-256 of the whole state, as hexadecimal digits: equal for equal runs, whatever the process. more: state
        that others keep."""
        digest = sha256(str(self.tick).encode())
        for array in (*self._state(), *more):
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()

    def _state(self) -> Iterable[NDArray[np.generic]]:
        yield self.sensed
        yield from (self.wanted_speed, self.wanted_turn, self.target_x, self.target_y, self.swing, self.roaming)
        yield from (self.mode, self.stopped, self.held)

    def _start(self) -> None:
        robots = self.scenario.robots
        if robots.disc is None:
            self.x[:] = _spread(robots.x, self.drawn("x"))
            self.y[:] = _spread(robots.y, self.drawn("y"))
        else:
            x, y, radius = robots.disc
            away, angle = radius * np.sqrt(self.drawn("away")), TURN * self.drawn("angle")
            self.x[:], self.y[:] = x + away * np.cos(angle), y + away * np.sin(angle)
        self.heading[:] = _spread((-pi, pi), self.drawn("heading"))
        self.speed[:] = robots.wander.speed if robots.wanders else 0.0
        for row, store in zip(self.stores, robots.stores, strict=True):
            carried = self.drawn(f"{store.name} carried") < store.share
            row[:] = np.where(carried, _spread((store.low, store.high), self.drawn(store.name)), 0.0)
        first = 4 + len(robots.stores)
        for place in self.scenario.places:
            self.sensed[first], self.sensed[first + 1] = place.x, place.y
            first += 2
        for quantity in value_quantities(robots.groups):
            self.sensed[first] = values_of(robots.groups, self.count, quantity.name)
            first += 1


def _spread(ends: tuple[float, float], drawn: Floats) -> Floats:
    return ends[0] + (ends[1] - ends[0]) * drawn


def sensors_of(scenario: Scenario) -> tuple[Quantity, ...]:
    """The sensors of the scenario's robots, in the order of the rows of `Bodies.sensed`."""
    length, speed = scenario.length_unit, scenario.robots.limits.speed
    return (
        Quantity("x", "m", 0.0, scenario.width, doc="where the robot is, to the east", shown_as=length),
        Quantity("y", "m", 0.0, scenario.height, doc="where the robot is, to the north", shown_as=length),
        Quantity("heading", "rad", -pi, pi, doc="counter-clockwise from east", shown_as="deg"),
        Quantity("speed", "m/s", -speed, speed, doc="along the heading", shown_as=scenario.robots.speed_unit),
        *(_of_store(store) for store in scenario.robots.stores),
        *(
            Quantity(f"{place.name}_{axis}", "m", 0.0, size, doc=f"where {place.title} is, {way}", shown_as=length)
            for place in scenario.places
            for axis, size, way in (("x", scenario.width, "to the east"), ("y", scenario.height, "to the north"))
        ),
        *value_quantities(scenario.robots.groups),
        *signal_sensors(scenario.lights, scenario.pings, length),
    )


def _of_store(store: Store) -> Quantity:
    return Quantity(store.name, store.unit, 0.0, store.full, doc=store.about, shown_as=store.unit)
