"""A growing field: an amount in each cell of a grid, which grows, spreads, and is taken and added to by robots.

What robots ask for in a tick is collected, with the cell in which each was at that moment, and resolved in the next
one, all at once: first what is taken, then what is added. If a cell has less than is asked for, or less room, everybody
there gets the same share of what it asked for, or they get it in turn, in an order that chance draws anew for each
tick, as the scenario says; so no result depends on the order in which they ask. Afterwards the field spreads and grows.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.counter_rng import key, uniform
from sleepcast.core.ticks import nearest_ticks
from sleepcast.simulator.bodies.bodies import Floats, Whole
from sleepcast.simulator.scenario.fields import Growth, spread
from sleepcast.simulator.simd.formulas import exponential

TAKE, ADD = 0, 1
"""The rows of what robots ask for."""


class GrowingField:
    """The cells of one field, and what robots ask of them.

    growth: how it grows
    size: of the world, m
    torus: whether it has no edge
    tick: s
    numbers: of the robots, uint64; the simulator's own array
    start: the amounts at the start, shape (rows, columns), bottom row first
    chance: from which all chance of this field comes
    """

    def __init__(
        self,
        growth: Growth,
        size: tuple[float, float],
        torus: bool,
        tick: float,
        numbers: NDArray[np.uint64],
        start: Floats,
        chance: int = 0,
    ) -> None:
        self._growth, self._size, self._tick, self._numbers, self._chance = growth, size, tick, numbers, chance
        self._around = "wrap" if torus else "edge"
        self._share_x, self._share_y = spread(growth, size, tick)
        self._factor = float(exponential(np.array([growth.rate * tick]))[0]) if growth.logistic else 1.0
        self.amount: Floats = np.clip(start, 0.0, growth.most)
        self._delay = max(1, nearest_ticks(growth.delay, tick))
        self._waiting = np.zeros(start.shape if growth.delay else (0, 0), np.int64)
        """Ticks until an empty cell is full again, 0 where nothing is awaited; of a law with a delay."""
        if growth.sown < 1.0:
            self._sow()
        self._wanted: Floats = np.zeros((2, numbers.size))
        """What each robot asks for, and below the cell from which, row by row from the bottom."""
        self._cells = np.zeros((2, numbers.size), np.int64)

    def cells(self, x: Floats, y: Floats) -> Whole:
        """The cells that contain these points, m."""
        growth = self._growth
        column = np.clip(x * (growth.columns / self._size[0]), 0, growth.columns - 1).astype(np.int64)
        row = np.clip(y * (growth.rows / self._size[1]), 0, growth.rows - 1).astype(np.int64)
        cells: Whole = row * growth.columns + column
        return cells

    def ask(self, what: int, robots: Whole, amounts: Floats, x: Floats, y: Floats) -> None:
        """Robots at these points ask to TAKE or ADD these amounts; a second request in a tick replaces the first, and
        nobody can ask for more than a cell can have."""
        self._wanted[what, robots] = np.clip(amounts, 0.0, self._growth.most)
        self._cells[what, robots] = self.cells(x, y)

    def clear(self, robots: Whole) -> None:
        """These robots ask for nothing."""
        self._wanted[:, robots] = 0.0

    def step(self, tick: int) -> Floats:
        """The tick with this number; gives what each robot got."""
        amount = self.amount.reshape(-1)
        taken, from_each = self._shares(TAKE, amount, tick)
        amount -= from_each
        amount += self._shares(ADD, self._growth.most - amount, tick)[1]
        self._wanted[:] = 0.0
        if self._growth.diffusion:
            self._spread()
        self._grow()
        return taken

    def read(self, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        """The amounts in the cells at these points, and how they rise over a metre to the east and to the north: the
        mean slope to the cells on both sides."""
        growth, amount = self._growth, self.amount
        row, column = np.divmod(self.cells(x, y), growth.columns)
        east = self._slope(lambda index: amount[row, index], column, growth.columns, self._size[0])
        north = self._slope(lambda index: amount[index, column], row, growth.rows, self._size[1])
        return amount[row, column], east, north

    def _slope(self, amount_at: Callable[[Whole], Floats], index: Whole, count: int, side: float) -> Floats:
        """How the amount rises over a metre along one axis with so many cells. index: of the cells, along this axis;
        side: of the world, m."""
        if self._around == "wrap":
            return (amount_at((index + 1) % count) - amount_at((index - 1) % count)) / (2.0 * side / count)
        before, after = np.maximum(index - 1, 0), np.minimum(index + 1, count - 1)
        slope: Floats = (amount_at(after) - amount_at(before)) / (np.maximum(after - before, 1) * (side / count))
        return slope

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The arrays that a run changes and that the next ticks depend on."""
        columns: dict[str, NDArray[np.generic]] = {
            "amount": self.amount,
            "wanted": self._wanted,
            "cells": self._cells,
        }
        return columns | {"waiting": self._waiting} if self._growth.delay else columns

    def _sow(self) -> None:
        """Empty the cells that chance leaves out, each at some moment of its delay."""
        cells = np.arange(2 * self.amount.size, dtype=np.uint64)
        drawn = uniform(key(self._chance, "sown"), cells).reshape(2, *self.amount.shape)
        bare = drawn[0] >= self._growth.sown
        self.amount[bare] = 0.0
        self._waiting[bare] = 1 + (drawn[1, bare] * self._delay).astype(np.int64)

    def _shares(self, what: int, available: Floats, tick: int) -> tuple[Floats, Floats]:
        """What each robot gets of its request, and what all get in each cell. available: the most that all can get
        there."""
        wanted, cells = self._wanted[what], self._cells[what]
        total = np.bincount(cells, wanted, available.size)
        given = np.minimum(total, available)
        if self._growth.in_turn:
            return self._in_turn(wanted, cells, available, tick), given
        with np.errstate(invalid="ignore"):
            share = np.where(total > 0.0, given / total, 0.0)
        return wanted * share[cells], given

    def _in_turn(self, wanted: Floats, cells: Whole, available: Floats, tick: int) -> Floats:
        """What each robot gets where one comes after the other."""
        got = np.zeros(wanted.size)
        asking = np.flatnonzero(wanted > 0.0)
        turn = uniform(key(self._chance, "turn", tick), self._numbers[asking])
        asking = asking[np.lexsort((turn, cells[asking]))]
        cell = cells[asking]
        so_far = np.cumsum(wanted[asking]) - wanted[asking]
        first = np.flatnonzero(np.diff(cell, prepend=-1))
        before = so_far - np.repeat(so_far[first], np.diff(first, append=cell.size))
        got[asking] = np.clip(available[cell] - before, 0.0, wanted[asking])
        return got

    def _spread(self) -> None:
        """Diffusion, by the explicit scheme with the four cells around each; nothing leaves at the world's edge."""
        old = np.pad(self.amount, 1, mode=self._around)  # type: ignore[call-overload]  # one of two modes
        middle = old[1:-1, 1:-1]
        self.amount += self._share_x * ((old[1:-1, :-2] - middle) + (old[1:-1, 2:] - middle))
        self.amount += self._share_y * ((old[:-2, 1:-1] - middle) + (old[2:, 1:-1] - middle))
        np.clip(self.amount, 0.0, self._growth.most, out=self.amount)

    def _grow(self) -> None:
        """Growth by the exact solution of the logistic equation over one tick, or by a constant, or after a delay."""
        growth, amount = self._growth, self.amount
        if growth.delay:
            self._wait()
        elif growth.logistic:
            amount *= self._factor / (1.0 + amount * ((self._factor - 1.0) / growth.most))
        else:
            amount += growth.rate * self._tick
        np.clip(amount, 0.0, growth.most, out=amount)

    def _wait(self) -> None:
        """Fill the cells whose delay is over; that of those that have been emptied in this tick begins."""
        waiting, amount = self._waiting, self.amount
        due = waiting == 1
        waiting[waiting > 0] -= 1
        amount[due] = self._growth.most
        waiting[(amount == 0.0) & (waiting == 0)] = self._delay
