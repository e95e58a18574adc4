"""The job: copters fly to places of their own choice in a cube of air, and keep off each other.

One for every 64 cubic metres, so that about eight others are within the five metres that each senses; ten rules; ten
ticks a second; whoever touches another one crashes. Nothing is pushed by another one's wash. Batteries last for hours,
so that all are in the air however long it is measured.
"""

from __future__ import annotations

from dataclasses import replace
from math import cbrt, ceil
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from sleepcast.loop import Swarm

TICK = 0.1
"""s"""
ROOM = 64.0
"""m3 for each copter."""
LOWEST = 2.0
"""m above the ground where they start."""
SCATTER = 0.5
"""m by which each starts beside its place in the lattice, at most, along each axis."""
SEED = 5
FIELD = """
format = 2
title = "copters"
seconds = "60s"
tick = "0.1s"

[world]
width = "{side}m"
height = "{side}m"

[robots]
like = "copter"
count = {count}

[robots.limits]
turn_rate = "180deg/s"

[robots.body]
radius = "0.25m"

[robots.flight]
climb = "2m/s"
ceiling = "{ceiling}m"
hovers = "10h"
climbs = "30km"

[robots.stores.battery]
start = ["100%", "100%"]
reach = "120km"

[neighbours]
reach = "5m"
"""
RULES = """
(PROGN
  (DEFVAR goal_x (+ x (RANDOM -8m 8m)))
  (DEFVAR goal_y (+ y (RANDOM -8m 8m)))
  (DEFVAR goal_z (+ z (RANDOM -8m 8m)))
  (DEFVAR since time)
  (DEFVAR side 1)
  (DEFVAR trips 0)
  (RULE seek
    (PROGN
      (SETQ drive_speed 0.5m/s)
      (SETQ drive_side 0m/s)
      (SETQ drive_turn (* 1rad/s (WRAP (- (BEARING x y goal_x goal_y) heading))))))
  (RULE rise (SETQ drive_climb (* 0.2 (- goal_z z))))
  (RULE choose (WHEN (PROB 2%) (SETQ side (- side))))
  (RULE slow (WHEN (< (NEAREST_DIST 5m) 2.5m) (SETQ drive_speed 0.25m/s)))
  (RULE avoid
    (WHEN (< (NEAREST_DIST 5m) 2m)
      (PROGN
        (SETQ drive_speed (* -1m/s (COS (- (BEARING x y (NEAREST_X 5m) (NEAREST_Y 5m)) heading))))
        (SETQ drive_side (* -1m/s (SIN (- (BEARING x y (NEAREST_X 5m) (NEAREST_Y 5m)) heading)))))))
  (RULE part
    (WHEN (< (NEAREST_DIST 5m) 2m)
      (SETQ drive_climb (IF (< (NEAREST_Z 5m) z) 1m/s -1m/s))))
  (RULE thin
    (WHEN (> (COUNT 5m) 14)
      (SETQ drive_climb (IF (< (MEAN_Z 5m) z) 0.5m/s -0.5m/s))))
  (RULE arrive
    (WHEN (< (DIST x y z goal_x goal_y goal_z) 1m)
      (PROGN
        (SETQ trips (+ trips 1))
        (SETQ since (- time 60s)))))
  (RULE renew
    (WHEN (>= (- time since) 60s)
      (PROGN
        (SETQ goal_x (+ x (RANDOM -8m 8m)))
        (SETQ goal_y (+ y (RANDOM -8m 8m)))
        (SETQ goal_z (+ z (RANDOM -8m 8m)))
        (SETQ since time))))
  (RULE tire
    (WHEN (< battery 20%)
      (SETQ drive_speed (* 0.5 drive_speed)))))
"""


def swarm(count: int, threads: int) -> Swarm:
    """So many copters in the air, whose operator broadcasts the ten rules at the first tick."""
    from sleepcast.api.assembly import assemble
    from sleepcast.simulator import read_scenario
    from sleepcast.simulator.scenario.mission import Order
    from sleepcast.simulator.scenario.starts import StartPose

    across = ceil(cbrt(count))
    side = across * cbrt(ROOM)
    text = FIELD.format(side=side, count=count, ceiling=LOWEST + side)
    scenario = read_scenario(text)
    starts = tuple(StartPose(*place) for place in places(count))
    mission = (Order(0.0, RULES, "the benchmark"),)
    scenario = replace(scenario, robots=replace(scenario.robots, starts=starts), mission=mission)
    return assemble(scenario, SEED, mission=True, threads=threads)[0]


def places(count: int) -> list[tuple[float, float, float, str, float]]:
    """Where they start: a lattice, each up to SCATTER beside its place; x, y in m, heading in rad, no name, z in m."""
    source, pitch = np.random.default_rng(SEED), cbrt(ROOM)
    across = ceil(cbrt(count))
    number = np.arange(count)
    lattice = np.stack((number % across, number // across % across, number // across**2)) + 0.5
    x, y, z = lattice * pitch + source.uniform(-SCATTER, SCATTER, (3, count))
    headings = source.uniform(-np.pi, np.pi, count)
    columns = (each.tolist() for each in (x, y, headings, z + LOWEST - pitch / 2.0))
    return [(a, b, heading, "", c) for a, b, heading, c in zip(*columns, strict=True)]
