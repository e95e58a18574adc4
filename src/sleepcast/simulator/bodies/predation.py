"""Robots that eat others: who is caught at the end of a tick, by whom.

Robots ask with EAT during a tick, and all of it is settled at its end, before anybody comes or goes: one after the
other, in an order that chance draws anew for each tick, each catches the nearest robot that nobody has caught yet. So
nobody is eaten twice, low numbers have no advantage, and the result depends neither on the order in which robots ask
nor on the rows in which they are kept.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from math import ceil
from typing import Any

import numpy as np

from sleepcast.core.counter_rng import key, uniform
from sleepcast.core.model import HostFunction
from sleepcast.core.units import LENGTH, NONE
from sleepcast.simulator.bodies.bodies import Bodies, Flags, Floats, Whole
from sleepcast.simulator.bodies.body import Body, BodySenses
from sleepcast.simulator.bodies.range_and_bearing import COLOUR, RangeAndBearing
from sleepcast.simulator.scenario.predation import EATEN, PredationModel
from sleepcast.simulator.world.grid import Sorted, candidates, pairs, sort
from sleepcast.simulator.world.torus import Images, cells_over

MAX_PAIRS = 1 << 20
"""Pairs of robots that are looked at together: some hundred megabytes."""


class Predation:
    """What all `bodies` of a world ask for with EAT. near: shows who has which colour."""

    def __init__(self, bodies: Bodies, model: PredationModel, near: RangeAndBearing) -> None:
        self._bodies, self._near = bodies, near
        size, around = (bodies.scenario.width, bodies.scenario.height), bodies.scenario.around
        self._patches = [side / ceil(side / model.cell - 1e-9) for side in size] if model.cell else []
        """Width and height of a patch, m; they fill the world."""
        self._most = min(model.reach, sum(size))
        self._cells = cells_over(size, around, self._most, self._most, bodies.count)
        self._within: Floats = np.zeros(bodies.count)
        """How near those must be that each robot wants to eat, m; 0 of robots that have not asked in this tick."""
        self._colour: Floats = np.zeros(bodies.count)
        """Of those that it wants to eat, NaN for any."""
        names = [sensor.name for sensor in bodies.sensors]
        self._eaten: Floats = bodies.known[names.index(EATEN)]
        self._eaten[:] = 0.0

    def ask(self, robots: Whole, radius: Floats, colour: Floats) -> None:
        """These robots want to eat one within so many m, of this colour. A second request in a tick replaces the
        first; one of a robot that is stopped comes to nothing."""
        self._within[robots] = np.clip(radius, 0.0, self._most)
        self._colour[robots] = colour

    def settle(self, alive: Flags) -> Whole:
        """The end of a tick: who is eaten, rows. alive: who is there and stays, so that it eats and can be eaten."""
        bodies = self._bodies
        hunters = np.flatnonzero((self._within > 0.0) & alive & ~bodies.stopped)
        self._eaten[:] = 0.0
        if not hunters.size:
            return hunters
        turn = uniform(key(bodies.seed, "eats", bodies.tick), bodies.numbers[hunters])
        fed: dict[int, int] = {}
        caught: set[int] = set()
        for hunter, prey in self._within_reach(hunters[np.argsort(turn)], alive):
            if hunter not in fed and prey not in caught:
                fed[hunter] = prey
                caught.add(prey)
        self._eaten[[*fed]] = 1.0
        self._within[:] = 0.0
        return np.array([*fed.values()], np.intp)

    def _within_reach(self, hunters: Whole, alive: Flags) -> Iterator[tuple[int, int]]:
        """Each of these robots, in this order, with all that it can eat, the nearest first."""
        bodies, grid = self._bodies, self._cells.grid
        images = self._cells.images(bodies.x, bodies.y)
        prey = np.flatnonzero(alive[images.of])
        points = sort(grid, images.x[prey], images.y[prey])
        points = Sorted(prey[points.order].astype(np.int32), points.start)
        chances = candidates(grid, points, images.x[hunters], images.y[hunters], self._most)
        block = np.cumsum(chances) // MAX_PAIRS
        for some in np.split(hunters, np.flatnonzero(np.diff(block)) + 1):
            yield from self._block(some, points, images)

    def _block(self, hunters: Whole, points: Sorted, images: Images) -> Iterator[tuple[int, int]]:
        """The same for one block of hunters. points: all prey, by cell."""
        bodies = self._bodies
        hunter, prey = pairs(self._cells.grid, points, images.x, images.y, self._most, hunters)
        away = (images.x[prey] - images.x[hunter]) ** 2 + (images.y[prey] - images.y[hunter]) ** 2
        prey = images.whose(prey)
        wanted = self._colour[hunter]
        fits = (prey != hunter) & (away <= self._within[hunter] ** 2)
        fits &= np.isnan(wanted) | (self._near.shows(COLOUR, prey) == wanted)
        for place, side in zip((bodies.x, bodies.y), self._patches, strict=False):
            fits &= np.floor(place[prey] / side) == np.floor(place[hunter] / side)
        if bodies.scenario.sight.neighbours:
            some = np.flatnonzero(fits)
            fits[some] = ~bodies.sight.behind_walls(
                hunter[some], bodies.x[prey[some]], bodies.y[prey[some]], prey[some]
            )
        hunter, prey, away = hunter[fits], prey[fits], away[fits]
        rank = np.empty(bodies.count, np.intp)
        rank[hunters] = np.arange(hunters.size)
        order = np.lexsort((bodies.numbers[prey], away, rank[hunter]))
        return zip(hunter[order].tolist(), prey[order].tolist(), strict=True)


def predation_functions(model: PredationModel | None) -> tuple[HostFunction, ...]:
    """What expressions may call of robots that eat others."""
    if model is None:
        return ()
    doc = (
        "Eats the nearest robot within r that no other one eats: at the end of the tick it is gone. With a colour: of "
        "that colour only."
    )
    return (
        HostFunction(
            "EAT",
            partial(_alone, _eat),
            (LENGTH, NONE),
            least=1,
            arguments="r [colour]",
            doc=doc,
            many=_eat,
            irreversible=True,
            moves=False,
        ),
    )


def _eat(bodies: Any, robots: Whole, radius: Floats, colour: Floats | None = None) -> None:
    senses: BodySenses = bodies.senses
    senses.of(Predation).ask(robots, radius, np.full(len(robots), np.nan) if colour is None else colour)


def _alone(many: Any, body: Body, *arguments: float) -> None:
    many(body, np.array([body.number]), *(np.array([each]) for each in arguments))
