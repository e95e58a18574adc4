"""Motors of bodies that are driven axis by axis: how fast each axis is to turn in the next tick.

An axis keeps a speed, travels by a distance and rests there, or rolls out. It changes its speed by no more than its
acceleration allows. One that travels goes as fast as it may and yet can end its way with even braking. In ticks of dt
that is exact: speeds that fall by A = a dt at the beginning of each tick, from v on, still lead (v + (v - A) + ...) dt
far. Set equal to what is left, s dt, this gives with n = floor((sqrt(1 + 8 s / A) - 1) / 2), the ticks of full braking,
v = s / (n + 1) + A n / 2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sleepcast.robot import Axes
from sleepcast.simulator.world.grid import Floats

AXES = 3
ARRIVED = 1e-9
"""m or rad that rounding may leave of a way."""
SLOWEST = 1e-9
"""m/s or rad/s: what is slower rests."""
FARTHEST = 1e7
"""m or rad of one way: a quarter of the way round the earth."""
ROLL_OUT = 0.25
"""Share of its greatest acceleration with which friction slows an axis down that nobody drives or brakes."""

SPEED, TRAVEL, LIMP = range(3)
"""What an axis does."""


class Motors:
    """The axes of `count` bodies, arrays of shape (3, count), SI.

    most_speed, most_acceleration: the limits, NaN for an axis that a body lacks. drive: SPEED, TRAVEL or LIMP; speed:
    wanted by SPEED; left: of the way, by TRAVEL; cruise: how fast it goes; acceleration: how fast speeds change.
    """

    def __init__(self, count: int, speeds: Axes, accelerations: Axes) -> None:
        def each(values: Axes) -> Floats:
            return np.repeat(np.array(values, np.float64)[:, None], count, axis=1)

        self.most_speed, self.most_acceleration = each(speeds), each(accelerations)
        self.drive: NDArray[np.int8] = np.full((AXES, count), SPEED, np.int8)
        self.speed, self.left = np.zeros((AXES, count)), np.zeros((AXES, count))
        self.cruise, self.acceleration = each(speeds), each(accelerations)

    def keep_speeds(self, robot: int, speeds: Axes) -> None:
        """Turn these axes at these speeds from now on."""
        named = self._named(robot, speeds)
        most = self.most_speed[named, robot]
        self.drive[named, robot] = SPEED
        self.speed[named, robot] = np.clip(np.array(speeds)[named], -most, most)

    def travel(self, robot: int, distances: Axes) -> None:
        """Turn these axes by so much and rest there."""
        named = self._named(robot, distances)
        self.drive[named, robot] = TRAVEL
        self.left[named, robot] = np.clip(np.array(distances)[named], -FARTHEST, FARTHEST)

    def set_cruise(self, robot: int, speeds: Axes) -> None:
        named = self._named(robot, speeds)
        self.cruise[named, robot] = np.clip(np.array(speeds)[named], 0.0, self.most_speed[named, robot])

    def set_acceleration(self, robot: int, accelerations: Axes) -> None:
        """More than 0 and within the limits; what is 0 or less changes nothing."""
        wanted = np.array(accelerations)
        named = self._named(robot, accelerations)
        named = named[wanted[named] > 0.0]
        self.acceleration[named, robot] = np.minimum(wanted[named], self.most_acceleration[named, robot])

    def let_go(self, robot: int, axes: tuple[bool, bool, bool]) -> None:
        self.drive[np.flatnonzero(axes), robot] = LIMP

    def rest(self, robot: int) -> None:
        self.drive[:, robot] = SPEED
        self.speed[:, robot] = 0.0

    def next_speeds(self, speeds: Floats, tick: float) -> Floats:
        """How fast the axes are to turn in the next tick (s), shape (3, count). speeds: how fast they turn now."""
        limp, travels = self.drive == LIMP, self.drive == TRAVEL
        change = np.where(limp, ROLL_OUT * self.most_acceleration, self.acceleration) * tick
        left = np.abs(self.left) / tick
        braking = np.floor((np.sqrt(1.0 + 8.0 * left / change) - 1.0) / 2.0)
        fastest = np.minimum(left / (braking + 1.0) + change * braking / 2.0, self.cruise)
        wanted = np.where(travels, np.copysign(fastest, self.left), np.where(limp, 0.0, self.speed))
        following: Floats = speeds + np.clip(wanted - speeds, -change, change)
        return np.nan_to_num(following)

    def count(self, gone: Floats, speeds: Floats, tick: float) -> None:
        """The axes have turned by `gone` in a tick (s) at these `speeds`, both of shape (3, count)."""
        travels = self.drive == TRAVEL
        self.left -= np.where(travels, gone, 0.0)
        slow = np.abs(speeds) <= self.acceleration * tick + SLOWEST
        there = travels & (np.abs(self.left) < ARRIVED) & slow
        self.drive[there] = SPEED
        self.speed[there] = self.left[there] = 0.0

    def moving(self, robot: int, speeds: Axes) -> tuple[bool, bool, bool]:
        """Which of a body's axes turn, or are about to. speeds: how fast they turn now."""
        first, second, third = speeds
        return self._moves(0, robot, first), self._moves(1, robot, second), self._moves(2, robot, third)

    def _moves(self, axis: int, robot: int, speed: float) -> bool:
        if abs(speed) > SLOWEST:
            return True
        drive = int(self.drive[axis, robot])
        if drive == TRAVEL:
            return bool(self.cruise[axis, robot] > 0.0)
        return drive == SPEED and bool(self.speed[axis, robot] != 0.0)

    def _named(self, robot: int, values: Axes) -> NDArray[np.intp]:
        """The axes that this body has and that `values` speak of."""
        return np.flatnonzero(~np.isnan(np.array(values)) & ~np.isnan(self.most_speed[:, robot]))
