"""A recording of robots that come and go, for tests of exports and replays."""

from __future__ import annotations

from pathlib import Path

import sleepcast as sc

FLOCK = """
format = 2
title = "flock"
seconds = 9
tick = 1

[world]
width = 9
height = 9

[robots]
type = "sheep"
count = 2
hatch = true

[robots.limits]
speed = 1
turn_rate = 1
acceleration = 1

[robots.body]
radius = 0.1

[robots.stores.energy]
start = ["50%", "50%"]
full = "100%"
"""


STEPS = (
    ("sheep1", "(HATCH sheep 2 0.5)"),
    ("sheep1", "(DIE)"),
    ("sheep3", "(HATCH sheep 1)"),
    ("sheep4", "(DIE)"),
)
"""Who does what in each second."""
THERE = (
    ["sheep1", "sheep2"],
    ["sheep1", "sheep2", "sheep3", "sheep4"],
    ["sheep2", "sheep3", "sheep4"],
    ["sheep2", "sheep3", "sheep4", "sheep5"],
    ["sheep2", "sheep3", "sheep5"],
)
"""Who is there at the start and after each second; sheep5 has the row of sheep1."""


def flock(file: Path, rotate: str | None = None) -> Path:
    """The recording of that, with a picture and readings each second."""
    with sc.open(FLOCK, seed=1) as fleet, fleet.record(file, pictures=1, readings=1, rotate=rotate):
        for name, text in STEPS:
            fleet.swarm.minds[name].evaluate(text)
            fleet.run(1)
    return file
