"""Senses: what robots see of the lights and hear of each other's pings, tick by tick.

A ping sent in one tick is heard in the next one, by every robot in reach but its sender, each of which may miss it by
chance. It is noted with its range and bearing of that moment and waits in the hearer's queue; in each tick one ping is
taken from the queue and presented for that tick. What arrives together is queued in an order that chance draws anew
for each hearer, from the numbers of the tick, the sender and the hearer alone: nobody is heard first for his number.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.chance import key, uniform
from sleepcast.simulator.bodies import Bodies, Floats
from sleepcast.simulator.groups import seeing
from sleepcast.simulator.signals import FRONT, LIGHT_NAMES, PING_NAMES, REAR, PingModel

MAX_PAIRS = 1 << 20
"""Pairs of sender and hearer looked at in one go: some tens of megabytes."""


class Senses:
    """The eyes and ears of all robots of `bodies`; they write into its table of what is sensed."""

    def __init__(self, bodies: Bodies) -> None:
        scenario = bodies.scenario
        self._bodies = bodies
        names = [sensor.name for sensor in bodies.sensors]
        if scenario.lights:
            first = names.index(LIGHT_NAMES[0])
            self._seen: Floats = bodies.known[first : first + len(LIGHT_NAMES)]
            self._sees = np.flatnonzero(seeing(scenario.robots.groups, bodies.count))
            self._look()
        self._ears = None
        if scenario.pings is not None:
            first = names.index(PING_NAMES[0])
            self._ears = _Ears(bodies, scenario.pings, bodies.known[first : first + len(PING_NAMES)])

    def ping(self, robots: NDArray[np.intp], castes: Floats) -> None:
        """The robots with these indices ping, each with its caste. A body pings once in a tick: a second time is not
        heard."""
        if self._ears is not None:
            self._ears.send(robots, castes)

    def step(self) -> None:
        """Sense what there is after everything has moved."""
        if self._bodies.scenario.lights:
            self._look()
        if self._ears is not None:
            self._ears.step()

    def state(self) -> Iterator[NDArray[np.generic]]:
        """What must be the same for runs to be the same, besides what lies in the bodies' own arrays."""
        if self._ears is not None:
            yield from self._ears.state()

    def _look(self) -> None:
        """Let each robot with an eye see the nearest light in reach; those without one know nothing of lights."""
        bodies, sees = self._bodies, self._sees
        x, y, heading = bodies.x[sees], bodies.y[sees], bodies.heading[sees]
        flags, ranges, bearings = np.zeros(sees.size), np.full(sees.size, np.nan), np.full(sees.size, np.nan)
        for light in bodies.scenario.lights:
            across, up = light.x - x, light.y - y
            away = np.sqrt(across * across + up * up)
            nearest = (away <= light.reach) & ~(ranges <= away)
            flags[nearest] = 1.0
            ranges[nearest] = away[nearest]
            bearings[nearest] = bearing(across, up, heading)[nearest]
        self._seen[:, sees] = flags, ranges, bearings


class _Ears:
    """The queues of pings. presented: the rows of PING_NAMES in the table of what is sensed, shape (4, robots)."""

    def __init__(self, bodies: Bodies, model: PingModel, presented: Floats) -> None:
        self._bodies, self._model, self._presented = bodies, model, presented
        self._sent = np.zeros(bodies.count, bool)
        """Who has pinged since the last step, and below with which caste."""
        self._castes: Floats = np.zeros(bodies.count)
        self._waiting: Floats = np.zeros((model.queue, 3, bodies.count))
        """Range, bearing and caste of the pings that wait on each robot, the oldest first."""
        self._length = np.zeros(bodies.count, np.int64)
        self._presented[0] = 0.0

    def send(self, robots: NDArray[np.intp], castes: Floats) -> None:
        robots, first = np.unique(robots, return_index=True)
        new = ~self._sent[robots]
        self._sent[robots[new]] = True
        self._castes[robots[new]] = castes[first[new]]

    def step(self) -> None:
        """Clear what was presented, take in what was sent, present the oldest that waits."""
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

    def _hear(self, senders: NDArray[np.intp], castes: Floats) -> None:
        width = max(1, MAX_PAIRS // senders.size)
        for first in range(0, self._bodies.count, width):
            self._hear_block(senders, castes, np.arange(first, min(first + width, self._bodies.count)))

    def _hear_block(self, senders: NDArray[np.int64], castes: Floats, hearers: NDArray[np.int64]) -> None:
        """Let some robots hear what was sent, each in an order of its own, and no more than fits into a queue."""
        bodies, model = self._bodies, self._model
        across = bodies.x[senders, None] - bodies.x[hearers]
        up = bodies.y[senders, None] - bodies.y[hearers]
        away = np.sqrt(across * across + up * up)
        pairs = (senders[:, None].astype(np.uint64) << np.uint64(32)) + hearers.astype(np.uint64)
        heard = (away <= model.reach) & (senders[:, None] != hearers)
        if model.loss:
            heard &= uniform(key(bodies.seed, "ping lost", bodies.tick), pairs) >= model.loss
        turn = np.where(heard, uniform(key(bodies.seed, "ping order", bodies.tick), pairs), np.inf)
        for _ in range(min(model.queue, senders.size)):
            first = turn.argmin(axis=0)
            columns = np.flatnonzero(heard[first, np.arange(hearers.size)])
            rows, ears = first[columns], hearers[columns]
            facing = bearing(across[rows, columns], up[rows, columns], bodies.heading[ears])
            self._queue(ears, np.stack((away[rows, columns], facing, castes[rows])))
            heard[rows, columns] = False
            turn[rows, columns] = np.inf

    def _queue(self, ears: NDArray[np.int64], ping: Floats) -> None:
        """Put one ping into the queue of each of `ears`; ping: its range, bearing and caste, shape (3, ears)."""
        self._drop_oldest(ears[self._length[ears] == self._model.queue])
        self._waiting[self._length[ears], :, ears] = ping.T
        self._length[ears] += 1

    def _drop_oldest(self, ears: NDArray[np.int64]) -> None:
        self._waiting[:-1, :, ears] = self._waiting[1:, :, ears]
        self._length[ears] -= 1


def bearing(across: Floats, up: Floats, heading: Floats) -> Floats:
    """FRONT or REAR: on which side something lies that is so far to the east and north, seen along `heading`."""
    return np.where(across * np.cos(heading) + up * np.sin(heading) > 0.0, FRONT, REAR)
