"""What robots sense of lights, of pings, of their neighbours, of stocks and of fields, tick by tick.

A ping sent in one tick is received in the next one, by every robot in reach except its sender, unless something hides
it, as the scenario says; each of them may miss it at random. It is stored with its range and bearing of that moment in
the receiver's queue; in each tick one ping is taken from the queue and presented for that tick. Pings that arrive
together are queued in a random order for each receiver, drawn from the numbers of the tick, the sender and the
receiver, so that low robot numbers have no advantage.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sleepcast.core.counter_rng import key, uniform
from sleepcast.core.model import HostFunction
from sleepcast.simulator.bodies.bodies import Bodies, Floats
from sleepcast.simulator.bodies.body import Sense
from sleepcast.simulator.bodies.local_fields import LocalFields, field_functions
from sleepcast.simulator.bodies.looking_down import DownCameras, down_functions
from sleepcast.simulator.bodies.population import Turnover
from sleepcast.simulator.bodies.predation import Predation, predation_functions
from sleepcast.simulator.bodies.range_and_bearing import COLOUR, RangeAndBearing, neighbour_functions
from sleepcast.simulator.bodies.seeing import Eyes, eye_functions
from sleepcast.simulator.bodies.stocks import Stocks, stock_functions
from sleepcast.simulator.scenario.flight import seen_above
from sleepcast.simulator.scenario.groups import seeing
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.scenario.signals import FRONT, LIGHT_NAMES, PING_NAMES, REAR, PingModel
from sleepcast.simulator.simd.formulas import shortest
from sleepcast.simulator.world.grid import Sorted, candidates, pairs, sort
from sleepcast.simulator.world.torus import Images, cells_over

MAX_PAIRS = 1 << 20
"""Pairs of sender and receiver processed at once: some hundred megabytes."""
CELLS_IN_REACH = 2.0
"""Grid cells per ping range: smaller cells are too many, larger ones contain too many candidates."""


class Senses:
    """The senses of all `bodies`. Light sensors and ping receivers write into its table of sensor values; neighbours
    are sensed by functions that expressions call, see `functions_of`. stocks, predation: None without any."""

    def __init__(self, bodies: Bodies) -> None:
        scenario = bodies.scenario
        self._bodies = bodies
        names = [sensor.name for sensor in bodies.sensors]
        if scenario.lights:
            first = names.index(LIGHT_NAMES[0])
            self._seen: Floats = bodies.known[first : first + len(LIGHT_NAMES)]
            self._sees = np.flatnonzero(seeing(scenario.robots.groups, bodies.count))
            self._look()
        self._pings = None
        if scenario.pings is not None:
            first = names.index(PING_NAMES[0])
            self._pings = _PingReceiver(bodies, scenario.pings, bodies.known[first : first + len(PING_NAMES)])

        self._near = RangeAndBearing(bodies, scenario.neighbours) if scenario.neighbours else None
        self.stocks = Stocks(bodies) if scenario.stocks else None
        self._fields = LocalFields(bodies) if scenario.fields else None
        self.predation = None
        if scenario.predation is not None and self._near is not None:
            self.predation = Predation(bodies, scenario.predation, self._near)
        eyes = Eyes(bodies, self._near) if scenario.laser or scenario.camera else None
        cameras = DownCameras(bodies, self._near) if scenario.robots.camera else None
        parts = (self._near, self.stocks, self._fields, self.predation, eyes, cameras)
        self._parts: dict[type, object] = {type(part): part for part in parts if part}

    def of(self, kind: type[Sense]) -> Sense:
        """See `BodySenses`."""
        part = self._parts[kind]
        assert isinstance(part, kind)
        return part

    def ping(self, robots: NDArray[np.intp], castes: Floats) -> None:
        """Send a ping from each of these robots, with its caste. Only the first ping of a body in a tick is
        received."""
        if self._pings is not None:
            self._pings.send(robots, castes)

    def colours(self) -> NDArray[np.float64]:
        """The colour that each robot shows to its neighbours; of none where nobody senses neighbours."""
        return np.zeros(0) if self._near is None else self._near.following(COLOUR)

    def show_groups(self, robots: Sequence[int] | slice, groups: Mapping[str, ArrayLike]) -> None:
        """See `RangeAndBearing.show_groups`."""
        if self._near is not None:
            self._near.show_groups(robots, groups)

    def delayed_poses(self) -> Iterator[tuple[Floats, ...]]:
        """See `NeighbourView.all_poses`."""
        return iter(()) if self._near is None else self._near.delayed_poses()

    def amount(self, field: str) -> Floats | None:
        """See `LocalFields.amount`."""
        return None if self._fields is None else self._fields.amount(field)

    def step(self) -> None:
        """Update light sensors, received pings, what neighbours show, stocks and fields, after everything has moved."""
        if self._bodies.scenario.lights:
            self._look()
        if self._pings is not None:
            self._pings.step()
        if self._near is not None:
            self._near.step()
        if self.stocks is not None:
            self.stocks.step()
        if self._fields is not None:
            self._fields.step()

    def turn_over(self, turnover: Turnover) -> None:
        """Robots have come and gone: nothing waits for them, and children show what their parents do."""
        changed = turnover.changed
        if self._pings is not None:
            self._pings.clear(changed)
        if self._near is not None:
            self._near.turn_over(turnover)
        if self.stocks is not None:
            self.stocks.clear(changed)
        if self._fields is not None:
            self._fields.clear(changed)

    @property
    def beginnings(self) -> list[tuple[int, int]] | None:
        """Functions that begin a tick of senses that native code asks, instead of `step`: addresses of their code, and
        of its argument. None where only Python can."""
        if self._near is None:
            return []
        begin = self._near.beginning()
        return None if begin is None else [begin]

    def keep_up(self) -> None:
        """The world has changed: let native code know what hides neighbours."""
        if self._near is not None:
            self._near.keep_up()

    def begun(self) -> None:
        """Ticks were begun by those functions."""
        if self._near is not None:
            self._near.forget()

    def state(self) -> Iterator[NDArray[np.generic]]:
        """The arrays that the next ticks depend on besides those of the bodies, for the state hash."""
        if self._pings is not None:
            yield from self._pings.state()
        if self._near is not None:
            yield from self._near.arrays().values()
        if self.stocks is not None:
            yield from self.stocks.arrays().values()
        if self._fields is not None:
            yield from self._fields.arrays().values()

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The arrays, by name, that a run changes and that the next ticks depend on, besides those of the bodies."""
        senses = (self._pings, self._near, self.stocks, self._fields)
        return {name: each for sense in senses if sense for name, each in sense.arrays().items()}

    def _look(self) -> None:
        """Update flag, range and bearing of the nearest light that is in reach and not hidden, for robots with a light
        sensor."""
        bodies, sees = self._bodies, self._sees
        around, sight = bodies.scenario.around, bodies.scenario.sight
        x, y, heading = bodies.x[sees], bodies.y[sees], bodies.heading[sees]
        flags, ranges, bearings = np.zeros(sees.size), np.full(sees.size, np.nan), np.full(sees.size, np.nan)
        for light in bodies.scenario.lights:
            dx, dy = shortest(light.x - x, around[0]), shortest(light.y - y, around[1])
            away = np.sqrt(dx * dx + dy * dy)
            nearest = (away <= light.reach) & ~(ranges <= away)
            if sight.lights or sight.bodies_hide:
                may = np.flatnonzero(nearest)
                place = np.full(may.size, light.x), np.full(may.size, light.y)
                nearest[may] = ~bodies.sight.hidden(sees[may], *place, walls=sight.lights)
            flags[nearest] = 1.0
            ranges[nearest] = away[nearest]
            bearings[nearest] = bearing(dx, dy, heading)[nearest]
        self._seen[:, sees] = flags, ranges, bearings


def functions_of(scenario: Scenario) -> tuple[HostFunction, ...]:
    """What expressions may call of the senses of a scenario's robots."""
    above = seen_above(scenario.robots.flight)
    near = neighbour_functions(scenario.neighbours, above) if scenario.neighbours else ()
    world = (*stock_functions(scenario.stocks), *field_functions(scenario.fields))
    return (
        *near,
        *eye_functions(scenario),
        *down_functions(scenario),
        *world,
        *predation_functions(scenario.predation),
    )


class _PingReceiver:
    """The queues of pings. presented: the rows of PING_NAMES in the table of sensor values, shape (4, robots)."""

    def __init__(self, bodies: Bodies, model: PingModel, presented: Floats) -> None:
        self._bodies, self._model, self._presented = bodies, model, presented
        self._sent = np.zeros(bodies.count, bool)
        """Which robots have pinged since the last step, and below with which caste."""
        self._castes: Floats = np.zeros(bodies.count)
        self._waiting: Floats = np.zeros((model.queue, 3, bodies.count))
        """Range, bearing and caste of the pings queued on each robot, oldest first."""
        self._length = np.zeros(bodies.count, np.int64)
        size = bodies.scenario.width, bodies.scenario.height
        self._reach = min(model.reach, sum(size)) * (1.0 + 1e-9)
        """Range, m, limited to the size of the world, with a margin for rounding: exact ranges are checked later."""
        around = bodies.scenario.around
        self._cells = cells_over(size, around, self._reach / CELLS_IN_REACH, self._reach, bodies.count)
        self._presented[0] = 0.0

    def send(self, robots: NDArray[np.intp], castes: Floats) -> None:
        robots, first = np.unique(robots, return_index=True)
        new = ~self._sent[robots]
        self._sent[robots[new]] = True
        self._castes[robots[new]] = castes[first[new]]

    def clear(self, robots: NDArray[np.intp]) -> None:
        """Nothing is sent by these robots, nor waits for them."""
        self._sent[robots], self._length[robots] = False, 0
        self._presented[0, robots] = 0.0

    def step(self) -> None:
        """Clear the presented pings, queue those sent in the last tick, present the oldest of each queue."""
        self._presented[0] = 0.0
        senders = np.flatnonzero(self._sent)
        if senders.size:
            self._hear(senders, self._castes[senders])
            self._sent[senders] = False
        having = np.flatnonzero(self._length)
        if having.size:
            self._presented[0, having] = 1.0
            self._presented[1:, having] = self._waiting[0][:, having]
            self._drop_oldest(having)

    def state(self) -> Iterator[NDArray[np.generic]]:
        yield self._length
        yield np.where(np.arange(self._model.queue)[:, None, None] < self._length, self._waiting, 0.0)
        senders = np.flatnonzero(self._sent)
        yield np.stack((senders.astype(np.float64), self._castes[senders]), axis=-1)

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        return {
            "pings sent": self._sent,
            "castes sent": self._castes,
            "pings waiting": self._waiting,
            "pings": self._length,
        }

    def _hear(self, senders: NDArray[np.intp], castes: Floats) -> None:
        """Queue the sent pings at all receivers in reach, in blocks whose pairs fit into memory."""
        bodies = self._bodies
        images = self._cells.images(bodies.x, bodies.y)
        sent = np.flatnonzero(self._sent[images.of])
        points = sort(self._cells.grid, images.x[sent], images.y[sent])
        points = Sorted(sent[points.order].astype(np.int32), points.start)
        own_x, own_y = images.x[: bodies.count], images.y[: bodies.count]
        chances = candidates(self._cells.grid, points, own_x, own_y, self._reach)
        if bodies.population is not None:
            chances[~bodies.population.present] = 0
        hearers = np.flatnonzero(chances)
        block = np.cumsum(chances[hearers]) // MAX_PAIRS
        caste = np.zeros(bodies.count)
        caste[senders] = castes
        for some in np.split(hearers, np.flatnonzero(np.diff(block)) + 1):
            self._hear_block(images, points, caste, some)

    def _hear_block(self, images: Images, points: Sorted, caste: Floats, hearers: NDArray[np.intp]) -> None:
        """Queue pings at one block of receivers, each in a random order, at most one queue length each."""
        bodies, model, sight = self._bodies, self._model, self._bodies.scenario.sight
        hearers, sources = pairs(self._cells.grid, points, images.x, images.y, self._reach, hearers)
        dx, dy = images.x[sources] - images.x[hearers], images.y[sources] - images.y[hearers]
        sources = images.whose(sources)
        away = np.sqrt(dx * dx + dy * dy)
        tokens = (bodies.numbers[sources] << np.uint64(32)) + bodies.numbers[hearers]
        heard = away <= model.reach
        if model.loss:
            heard &= uniform(key(bodies.seed, "ping lost", bodies.tick), tokens) >= model.loss
        if sight.pings or sight.bodies_hide:
            may = np.flatnonzero(heard)
            their = sources[may]
            place = bodies.x[their], bodies.y[their]
            heard[may] = ~bodies.sight.hidden(hearers[may], *place, walls=sight.pings, senders=their)
        turn = uniform(key(bodies.seed, "ping order", bodies.tick), tokens)
        chosen_pairs = np.flatnonzero(heard)
        chosen_pairs = chosen_pairs[np.lexsort((sources[chosen_pairs], turn[chosen_pairs], hearers[chosen_pairs]))]
        hearers = hearers[chosen_pairs]
        ping = np.stack(
            (
                away[chosen_pairs],
                bearing(dx[chosen_pairs], dy[chosen_pairs], bodies.heading[hearers]),
                caste[sources[chosen_pairs]],
            )
        )
        indices = np.arange(len(hearers))
        rank = indices - np.maximum.accumulate(np.where(np.diff(hearers, prepend=-1) != 0, indices, 0))
        for number in range(min(model.queue, 1 + int(rank.max(initial=-1)))):
            chosen = np.flatnonzero(rank == number)
            self._queue(hearers[chosen], ping[:, chosen])

    def _queue(self, hearers: NDArray[np.int64], ping: Floats) -> None:
        """Put one ping into the queue of each of `hearers`; ping: range, bearing, caste, shape (3, hearers)."""
        self._drop_oldest(hearers[self._length[hearers] == self._model.queue])
        self._waiting[self._length[hearers], :, hearers] = ping.T
        self._length[hearers] += 1

    def _drop_oldest(self, hearers: NDArray[np.int64]) -> None:
        self._waiting[:-1, :, hearers] = self._waiting[1:, :, hearers]
        self._length[hearers] -= 1


def bearing(dx: Floats, dy: Floats, heading: Floats) -> Floats:
    """FRONT or REAR: the side of a point `dx` m east and `dy` m north, seen along `heading` (rad); NaN for one at
    the robot's own place."""
    side = np.where(dx * np.cos(heading) + dy * np.sin(heading) > 0.0, FRONT, REAR)
    return np.where((dx == 0.0) & (dy == 0.0), np.nan, side)
