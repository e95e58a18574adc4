"""The simulator as the loop knows it: robots with names and bodies, ticks, readings, pings, and a hash of the
state.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.threads import ThreadPool
from sleepcast.simulator.bodies.bodies import Bodies, Floats, Saying
from sleepcast.simulator.bodies.body import model_of
from sleepcast.simulator.bodies.motion import step
from sleepcast.simulator.bodies.senses import Senses
from sleepcast.simulator.engine import Machine, choose, cores
from sleepcast.simulator.robots import Robots
from sleepcast.simulator.scenario.events import happen
from sleepcast.simulator.scenario.measures import Measuring
from sleepcast.simulator.scenario.robot_types import names_of
from sleepcast.simulator.scenario.scenario import Scenario

MOST_CASTE = 254
"""What a byte tells apart besides silence; a higher caste is shown as this one."""


class Simulator:
    """A scenario brought to life; `seed` replaces the scenario's own. Equal seeds make equal runs, to the
    last bit, on any number of threads.

    machine: does the heavy work; None takes the fastest that is installed (see `engine`), on so many `threads` (None:
    one for each core), or NumPy where nobody touches or hears anything: loading the other one takes a second.

    names, robots: of each robot by its index; a robot's own number is its index + 1. model: what they all
    are.
    """

    def __init__(
        self,
        scenario: Scenario,
        seed: int | None = None,
        machine: Machine | None = None,
        threads: int | None = None,
    ) -> None:
        self.scenario = scenario
        self.seed = scenario.seed if seed is None else seed
        if machine is None:
            light = scenario.robots.ring is None and not scenario.robots.bumpers
            machine = choose("numpy" if light else None, threads)
        self.pool = machine.pool or ThreadPool(threads or cores())
        """The threads that may work at once."""
        self.bodies = Bodies(scenario, self.seed, machine)
        self.world = self.bodies.world
        """The solid things, which may be changed between ticks."""
        self.model = model_of(scenario, self.bodies)
        self.names = names_of(scenario.each_sort, scenario.robots.count)
        self.robots = Robots(self.bodies, self.model)
        self.senses = Senses(self.bodies)
        self._pinged = np.zeros(scenario.robots.count, np.uint8)
        self.measuring = Measuring(scenario.measures, scenario.tick, self.bodies.x, self.bodies.y)

    @property
    def tick(self) -> int:
        """Ticks since the start."""
        return self.bodies.tick

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self.bodies.time

    @property
    def x(self) -> Floats:
        """Where the robots are, m, shape (robots,); the simulator's own array."""
        return self.bodies.x

    @property
    def y(self) -> Floats:
        return self.bodies.y

    @property
    def said(self) -> deque[Saying]:
        """The latest things that robots said aloud."""
        return self.bodies.said

    def step(self) -> None:
        """One tick: what the scenario lets happen happens, everything moves, then lights are seen and the pings sent
        since the last tick are heard."""
        scenario, until = self.scenario, (self.tick + 1) * self.scenario.tick
        if scenario.events:
            happen(self.world, scenario.events, (*scenario.shapes, *scenario.absent), self.time, until)
        step(self.bodies)
        self.senses.step()
        self.measuring.observe(self.tick, self.time)

    @property
    def sensed(self) -> Floats:
        """What the robots sense, in the order of `model.sensors`: SI, shape (sensors, robots); NaN for what was never
        measured. The simulator's own table, up to date for those for whom `sense` was called in this tick."""
        return self.bodies.sensed

    @property
    def echoing(self) -> range:
        """The rows of `sensed` that the sonars fill."""
        return range(len(self.bodies.sensors), len(self.model.sensors))

    def sense(self, robots: NDArray[np.intp] | None = None, echoes: bool | Collection[int] = True) -> None:
        """Bring `sensed` up to date for the robots with these indices (None: all), noise included; asked twice in a
        tick, it says the same. echoes: whether the sonars as well, which is most of the work, or which rows of theirs
        at least. Changes no state."""
        self.bodies.sense(robots, echoes)

    def act(self, actuator: str, robots: NDArray[np.intp] | slice, values: Floats) -> None:
        """Ask these bodies to move: set their actuator of this name to `values` (SI), one for each, as `Body.act` does.
        Stopped bodies do nothing; NaN leaves the value as it was. Raises MisuseError for no such actuator."""
        self.bodies.act(actuator, robots, values)

    def readings(self, numbers: Sequence[int] | None = None) -> list[list[float]]:
        """What the robots with these indices (None: all) sense; see `Bodies.readings`."""
        return self.bodies.readings(numbers)

    def place(self, number: int, x: float, y: float, heading: float) -> None:
        """Put robot `number` somewhere (m, rad), at rest; it believes to be there."""
        self.bodies.place(number, x, y, heading)

    def ping(self, number: int, caste: float) -> None:
        """Robot `number` sends a ping that carries `caste`; those in reach hear it in the next tick."""
        self.pings(np.array([number]), np.array([caste]))

    def pings(self, robots: NDArray[np.intp], castes: Floats) -> None:
        """The same for many robots. A robot that pings twice in a tick is heard once, the first time."""
        self._pinged[robots] = 1.0 + np.rint(np.clip(np.nan_to_num(castes, nan=MOST_CASTE), 0.0, MOST_CASTE))
        self.senses.ping(robots, castes)

    def pinged(self) -> bytes:
        """Who has pinged since this was last asked, to show it: a byte for each robot, 0 or its latest caste + 1; empty
        if nobody has. Changes nothing of the run."""
        found = self._pinged.tobytes() if self._pinged.any() else b""
        self._pinged.fill(0)
        return found

    def measured(self) -> dict[str, list[list[float]]]:
        """The scenario's own measures so far, each a list of [seconds, metres]."""
        return self.measuring.series()

    def state_hash(self) -> str:
        """SHA-256 of the state of all bodies, as hexadecimal digits."""
        return self.bodies.state_hash(self.senses.state())
