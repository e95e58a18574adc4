"""Stocks: amounts at places, of which robots take and to which they add.

A robot's requests of one tick are collected, and settled in the next step: first comes the inflow, then what robots
add, then what they take. If more is wanted than there is (or fits in), every robot gets the same share of what it
asked for, so that no result depends on the order of the robots. Stocks are settled in the order of the scenario: one
that fills a store leaves less room in it for the next one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.model import HostFunction
from sleepcast.simulator.bodies.bodies import Bodies, Flags, Floats, Whole
from sleepcast.simulator.bodies.body import BodySenses, acting
from sleepcast.simulator.scenario.stocks import MAX_AMOUNT, Stock
from sleepcast.simulator.simd.formulas import shortest


class Stocks:
    """All stocks of a world.

    level: what is left, in SI, shape (stocks,); in the order of the scenario, as all rows below.
    """

    def __init__(self, bodies: Bodies) -> None:
        stocks = bodies.scenario.stocks
        self._bodies, self._stocks = bodies, stocks
        self.level: Floats = np.array([stock.start for stock in stocks])
        self._taking: Floats = np.zeros((len(stocks), bodies.count))
        """What each robot has asked for since the last step, shape (stocks, robots), and below what it wants to add."""
        self._giving: Floats = np.zeros((len(stocks), bodies.count))
        names = [sensor.name for sensor in bodies.sensors]
        self._sensed = [names.index(stock.name) for stock in stocks]
        """The row of each stock in the table of sensor values."""
        for stock in stocks:
            for name, value in zip(stock.names[1:], (stock.x, stock.y), strict=True):
                bodies.known[names.index(name)] = value
        self._show()

    def take(self, row: int, robots: Whole, amounts: Floats) -> None:
        """These robots ask for so much; those that are not within the stock's radius get nothing."""
        self._ask(self._taking, row, robots, amounts)

    def give(self, row: int, robots: Whole, amounts: Floats) -> None:
        """These robots want to add so much; those that are not within the stock's radius add nothing."""
        self._ask(self._giving, row, robots, amounts)

    def clear(self, robots: Whole) -> None:
        """These robots ask for nothing."""
        self._taking[:, robots] = self._giving[:, robots] = 0.0

    def step(self) -> None:
        """Settle what was asked for since the last step, and let robots sense what is there now."""
        for row, stock in enumerate(self._stocks):
            level = float(self.level[row])
            level = level if stock.endless else min(stock.capacity, level + stock.inflow * self._bodies.scenario.tick)
            level += self._settle(stock, self._giving[row], stock.capacity - level, add=True)
            left = level - self._settle(stock, self._taking[row], np.inf if stock.endless else level, add=False)
            self.level[row] = stock.start if stock.endless else min(max(left, 0.0), stock.capacity)
        self._taking[:] = self._giving[:] = 0.0
        self._show()

    def state(self) -> Iterator[NDArray[np.generic]]:
        """The arrays that the next ticks depend on, for the state hash."""
        yield from self.arrays().values()

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The arrays that a run changes and that the next ticks depend on."""
        return {"stock levels": self.level, "stocks taken": self._taking, "stocks given": self._giving}

    def _ask(self, asked: Floats, row: int, robots: Whole, amounts: Floats) -> None:
        stock = self._stocks[row]
        near = self._away(stock, robots) <= stock.radius
        most = min(stock.rate * self._bodies.scenario.tick, MAX_AMOUNT)
        wanted = asked[row, robots] + np.where(near, np.clip(amounts, 0.0, MAX_AMOUNT), 0.0)
        asked[row, robots] = np.minimum(wanted, most)

    def _settle(self, stock: Stock, asked: Floats, most: float, *, add: bool) -> float:
        """Let robots add to the stock, or take of it, what they have asked for, at most so much in all; returns how
        much that is."""
        robots = np.flatnonzero((asked > 0.0) & ~self._bodies.stopped)
        if not robots.size:
            return 0.0
        wanted = asked[robots]
        if stock.store:
            stored, full = self._store(stock.store)
            room = stored[robots] if add else full[robots] - stored[robots]
            wanted = np.minimum(wanted, np.maximum(np.nan_to_num(room, nan=0.0), 0.0))
        total = float(wanted.sum())
        if total > most:
            wanted *= max(most, 0.0) / total
            total = max(most, 0.0)
        if stock.store:
            moved = stored[robots] - wanted if add else stored[robots] + wanted
            stored[robots] = np.clip(moved, 0.0, full[robots])
        return total

    def _store(self, name: str) -> tuple[Floats, Floats]:
        """What all robots have in a store, the simulator's own array, and how much fits in; NaN where a robot has no
        such store."""
        bodies = self._bodies
        full = np.full(bodies.count, np.nan)
        for spec, which in zip(bodies.scenario.each_type, bodies.of_each_type, strict=True):
            for store in spec.stores:
                if store.name.casefold() == name.casefold():
                    full[which] = store.full
        return bodies.stores[bodies.store_names.index(name.casefold())], full

    def _show(self) -> None:
        """Let robots in reach sense what is there."""
        known = self._bodies.known
        for stock, level, row in zip(self._stocks, self.level.tolist(), self._sensed, strict=True):
            if stock.reach == np.inf:
                known[row] = level
            else:
                near: Flags = self._away(stock, slice(None)) <= stock.reach
                known[row] = np.where(near, level, np.nan)

    def _away(self, stock: Stock, robots: Whole | slice) -> Floats:
        """The distance of these robots from a stock, m."""
        bodies = self._bodies
        around_x, around_y = bodies.scenario.around
        dx, dy = shortest(bodies.x[robots] - stock.x, around_x), shortest(bodies.y[robots] - stock.y, around_y)
        away: Floats = np.sqrt(dx * dx + dy * dy)
        return away


def stock_functions(stocks: Sequence[Stock]) -> Iterator[HostFunction]:
    """What expressions may call of these stocks."""
    for row, stock in enumerate(stocks):
        into, out = (f" into its {stock.store}", f" from its {stock.store}") if stock.store else ("", "")
        for name, act, doc in (
            ("TAKE", Stocks.take, f"Takes so much of {stock.title}{into}; only within its radius."),
            ("GIVE", Stocks.give, f"Adds so much to {stock.title}{out}; only within its radius."),
        ):
            yield acting(f"{name}_{stock.name.upper()}", stock.dimension, "amount", doc, partial(_done, act, row))


def _done(
    act: Callable[[Stocks, int, Whole, Floats], None], row: int, senses: BodySenses, robots: Whole, amounts: Floats
) -> None:
    """Do this with a stock of the world of these senses."""
    act(senses.of(Stocks), row, robots, amounts)
