"""Sonar of the first simulator: the exact distance to the nearest other robot in a sector.

A robot is in a sector if its middle is; the distance runs from one body's rim to the other's. No noise, no
cross-talk, no walls: those come with the full simulator.
"""

from __future__ import annotations

from math import pi

import numpy as np

from sleepcast.simulator.bodies.bodies import TURN, Bodies


def nearest(bodies: Bodies, number: int, reach: float, first: float, last: float) -> float:
    """Metres from robot `number` to the nearest other one between the angles `first` and `last` (rad,
    counter-clockwise from its heading, counted from first to last); `reach` m where nothing is nearer."""
    across, up = bodies.x - bodies.x[number], bodies.y - bodies.y[number]
    away = np.sqrt(across * across + up * up) - (bodies.radii + bodies.radii[number])
    away[number] = np.inf
    near = np.flatnonzero(away < reach)
    width = last - first
    if width < TURN:
        bearing = np.arctan2(up[near], across[near]) - bodies.heading[number]
        near = near[np.mod(bearing - first, TURN) <= width % TURN]
    return max(0.0, float(away[near].min())) if near.size else reach


def sector(sonars: int, which: float) -> tuple[float, float]:
    """The sector of sonar `which` out of `sonars`: number 0 looks ahead, the others follow
    counter-clockwise."""
    middle = (int(which) % sonars) * TURN / sonars
    return middle - pi / sonars, middle + pi / sonars
