"""Array backends for motion, contact and sonar: NumPy always, compiled kernels where numba is installed.

Both have the same methods. Ranges of whole rings agree to a few micrometres, because the compiled kernels compute
most pairs in single precision; all other results are bit-identical. Results do not depend on the number of threads.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from typing import Protocol

import numpy as np

from sleepcast.core.errors import MisuseError
from sleepcast.core.extras import installing
from sleepcast.core.threads import ThreadPool
from sleepcast.simulator.laser import beams
from sleepcast.simulator.laser.beams import BeamScene
from sleepcast.simulator.motion import steps
from sleepcast.simulator.motion.driving import Laws
from sleepcast.simulator.motion.flying import FlightColumns, Power, TypeLaws
from sleepcast.simulator.motion.steps import BodyColumns, Displacement, Draws, Settled
from sleepcast.simulator.neighbours.neighbourhood import Formula, Neighbourhood, Vicinity
from sleepcast.simulator.scenario.scanners import LaserModel
from sleepcast.simulator.sonar import cones, noise
from sleepcast.simulator.sonar.cones import Ranges, Seen, VisibleScene
from sleepcast.simulator.sonar.firing import Firing, Tick, fire
from sleepcast.simulator.sonar.noise import Noise, SonarReceiver
from sleepcast.simulator.world import grid, sight
from sleepcast.simulator.world.grid import CellLists, Floats, Grid, Sorted, Whole
from sleepcast.simulator.world.sight import Flags, SightLines

MAX_THREADS = 64
"""Most threads of one backend: beyond that, memory bandwidth is the limit."""


def cores() -> int:
    """Number of cores that this process may use, at most MAX_THREADS."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(usable, MAX_THREADS)


FROM_PAIRS = "NumPy finds what robots sense of their neighbours from pairs"


class Machine(Protocol):
    """An array backend; the functions of the same names in `grid`, `sight`, `cones`, `beams`, `steps` and `noise` say
    what each method does."""

    @property
    def name(self) -> str: ...

    @property
    def pool(self) -> ThreadPool | None:
        """The thread pool it uses, if it has one."""

    def forget(self) -> None:
        """Forget what is known of points that were sorted before."""

    def sort(self, grid: Grid, x: Floats, y: Floats, /) -> Sorted: ...

    def candidates(self, grid: Grid, points: Sorted, x: Floats, y: Floats, reach: float, /) -> Whole: ...

    def pairs(
        self, grid: Grid, points: Sorted, x: Floats, y: Floats, reach: float, first: Whole, /
    ) -> tuple[Whole, Whole]: ...

    @property
    def compiles(self) -> bool:
        """Whether it can do `neighbours` and `fly`; otherwise the first is found from `pairs`, and the other is done by
        `Flight.step`."""

    def neighbours(
        self, vicinity: Vicinity, formula: Formula, robots: Whole, radius: Floats, colour: Floats, /
    ) -> Floats:
        """What a formula comes to for each of these robots; see `range_and_bearing`."""

    def near_lists(self, vicinity: Vicinity, robots: Whole, radius: Floats, colour: Floats, /) -> tuple[Whole, Whole]:
        """How many neighbours each of these robots senses, as for `neighbours`, and all of them, in no order: the
        number of the robot in the upper half of 64 bits, and below it that of the neighbour."""

    def shown(
        self, near: Neighbourhood, quantity: int, row: int, robots: Whole, others: Floats, reach: float, /
    ) -> Floats:
        """A quantity of one other robot for each robot: see `kernels_shown.show_many`."""

    def hidden(self, lines: SightLines, x: Floats, y: Floats, to_x: Floats, to_y: Floats, /) -> Flags: ...

    def crossings(self, lines: SightLines, x: Floats, y: Floats, to_x: Floats, to_y: Floats, /) -> Whole: ...

    def scan(self, model: LaserModel, scene: BeamScene, which: Whole, key: int, /) -> Ranges: ...

    def in_sight(self, listed: CellLists, solids: Floats, /) -> Seen:
        """These rows of `solids` in the form that `ranges` and `hear` expect."""

    def ranges(self, view: VisibleScene, which: Whole, /) -> Ranges: ...

    def hear(self, view: VisibleScene, which: Whole, receiver: SonarReceiver, sensed: Floats, /) -> None:
        """`ranges`, then `tell`."""

    def look(self, view: VisibleScene, which: Whole, sonars: Whole, /) -> Ranges: ...

    def fire(self, firing: Firing, tick: Tick, /) -> None:
        """Fire all sonars that are due in this tick; see `firing.fire`."""

    def room(self, count: int, /) -> tuple[Displacement, Floats]:
        """Scratch arrays for `count` bodies: the poses they propose, and the share of each move that they may make."""

    def propose(self, bodies: BodyColumns, laws: Laws, draws: Draws, proposal: Displacement, /) -> None: ...

    def commit(self, bodies: BodyColumns, laws: Laws, proposal: Displacement, settled: Settled, /) -> None: ...

    def settle(
        self,
        grid: Grid,
        points: Sorted,
        listed: CellLists,
        solids: Floats,
        radii: Floats,
        positions: tuple[Floats, Floats],
        way: tuple[Floats, Floats],
        settled: Settled,
        /,
    ) -> None: ...

    def fly(self, bodies: FlightColumns, laws: TypeLaws, power: Power, which: slice, /) -> None:
        """Move these bodies through a tick, all of one type that hovers, where it `compiles`; see
        `kernels_flying.fly`."""

    def disturb(self, seen: Ranges, which: Whole, noise: Noise, /) -> None: ...

    def tell(self, seen: Ranges, which: Whole, receiver: SonarReceiver, sensed: Floats, /) -> None: ...

    def share(self, count: int, work: Callable[[int, int], object], /) -> None:
        """Call `work(start, stop)` for consecutive slices of `range(count)`, on all threads; the work per item should
        be small."""


class NumPyMachine:
    """NumPy on one thread."""

    name = "numpy"
    pool = None
    compiles = False
    sort = staticmethod(grid.sort)
    candidates = staticmethod(grid.candidates)
    pairs = staticmethod(grid.pairs)
    hidden = staticmethod(sight.hidden)
    crossings = staticmethod(sight.crossings)
    scan = staticmethod(beams.scan)
    ranges = staticmethod(cones.ranges)
    look = staticmethod(cones.look)
    propose = staticmethod(steps.propose)
    commit = staticmethod(steps.commit)
    settle = staticmethod(steps.settle)
    disturb = staticmethod(noise.disturb)
    tell = staticmethod(noise.tell)

    def neighbours(self, vicinity: Vicinity, formula: Formula, robots: Whole, radius: Floats, colour: Floats) -> Floats:
        raise NotImplementedError(FROM_PAIRS)

    def near_lists(self, vicinity: Vicinity, robots: Whole, radius: Floats, colour: Floats) -> tuple[Whole, Whole]:
        raise NotImplementedError(FROM_PAIRS)

    def shown(
        self, near: Neighbourhood, quantity: int, row: int, robots: Whole, others: Floats, reach: float
    ) -> Floats:
        raise NotImplementedError(FROM_PAIRS)

    def fly(self, bodies: FlightColumns, laws: TypeLaws, power: Power, which: slice) -> None:
        raise NotImplementedError("with NumPy `Flight.step` moves what flies")

    def forget(self) -> None:
        """Nothing: it keeps nothing."""

    def in_sight(self, listed: CellLists, solids: Floats) -> CellLists:
        return listed

    def room(self, count: int) -> tuple[Displacement, Floats]:
        return Displacement(*np.empty((3, count))), np.empty(count)

    def hear(self, view: VisibleScene, which: Whole, receiver: SonarReceiver, sensed: Floats) -> None:
        noise.tell(cones.ranges(view, which), which, receiver, sensed)

    def fire(self, firing: Firing, tick: Tick) -> None:
        fire(firing, tick, cones.look)

    def share(self, count: int, work: Callable[[int, int], object]) -> None:
        work(0, count)


NUMBA_SETTINGS = ".numba_config.yaml"
"""What numba looks for in the folder in which a process was started, which may be anybody's."""


@cache
def has_numba() -> bool:
    """Whether kernels can be compiled. Does not load numba, which takes longer than a small run, nor llvmlite, without
    which numba cannot be loaded."""
    return find_spec("numba") is not None and find_spec("llvmlite") is not None


def keeps_kernels() -> bool:
    """Whether this computer has compiled what moves bodies and makes quiet ticks: then it is called without numba, and
    takes no time to load."""
    if not has_numba() or os.path.isfile(NUMBA_SETTINGS):
        return False
    from sleepcast.simulator.simd.cached import ENTRIES, ROOM_NAME, piece_name, readable

    latest = ("motion.kernels_motion", "displace"), ("quiet.kernels_quiet", "quiet")  # others are compiled before them
    return readable() and all(ENTRIES.names(piece_name(f"{ROOM_NAME}.{module}", name)) for module, name in latest)


def choose(name: str | None = None, threads: int | None = None) -> Machine:
    """The backend `name`, "numpy" or "numba"; None chooses the fastest one installed. threads: None means one per core.
    Raises MisuseError for an unknown or missing backend."""
    if threads is not None and not 1 <= threads <= MAX_THREADS:
        raise MisuseError(f"a machine has 1 to {MAX_THREADS} threads, not {threads}")
    installed = has_numba()
    if name == "numpy" or (name is None and not installed):
        return NumPyMachine()
    if name not in (None, "numba"):
        raise MisuseError(f'no machine "{name}": wanted numpy or numba')
    if not installed:
        raise MisuseError(f'the machine "numba" needs numba: take "numpy", or install it: {installing("fast")}')
    if os.path.isfile(NUMBA_SETTINGS):
        raise MisuseError(
            f"{NUMBA_SETTINGS} lies in this folder, and numba would obey it: kernels would be compiled otherwise than "
            "everywhere else, and kept. Take it away, or start in another folder"
        )
    from sleepcast.simulator.fast import NumbaMachine

    return NumbaMachine(threads or cores())
