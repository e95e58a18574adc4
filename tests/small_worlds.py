"""Small scenarios for tests, written as the TOML files that people write."""

from __future__ import annotations

from pathlib import Path

from sleepcast.simulator import Scenario, Simulator, load
from sleepcast.simulator.engine import Machine

SMALL = """
format = 1
title = "a small world"
seconds = "1min"
tick = "0.1s"
seed = 3

[world]
width = "1km"
height = "1km"

[places.house]
x = "500m"
y = "400m"

[robots]
type = "rover"
count = 20
motion = "still"

[robots.limits]
speed = "5m/s"
turn_rate = "90deg/s"
acceleration = "2m/s2"

[robots.body]
radius = "0.5m"
sonars = 16
sonar_range = "100m"

[robots.stores.battery]
start = ["20%", "100%"]
reach = "20km"

[radio]
delay = "0s"
"""

IN_MAZE = ("[robots]\n", '[world.maze]\ncell = "2m"\n\n[robots]\n')
"""The change that puts a maze into the world, which has the seed of the run."""

SCOUTS = """
format = 1
title = "Scouts"
seconds = "1min"
tick = "0.1s"
seed = 3

[world]
width = "12m"
height = "12m"
edge = "wall"

[robots]
type = "scout"
count = 1
motion = "still"

[robots.limits]
speed = "1m/s"
turn_rate = "180deg/s"
acceleration = "2m/s2"

[robots.body]
radius = "0.17m"
bumpers = 8

[robots.wheels]
track = "0.3452m"

[robots.sonar]
"""


def write(folder: Path, *changes: tuple[str, str], more: str = "", text: str = SMALL) -> Path:
    """The small scenario (or `text`) in `folder`, each pair of texts replaced, `more` added at the end; gives its
    file."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    file = folder / "scenario.toml"
    file.write_text(text + more, encoding="utf-8")
    return file


def small(folder: Path, *changes: tuple[str, str], more: str = "") -> Scenario:
    return load(write(folder, *changes, more=more))


def simulator(folder: Path, *changes: tuple[str, str], more: str = "", seed: int | None = None) -> Simulator:
    return Simulator(small(folder, *changes, more=more), seed)


def scouts(
    folder: Path, *changes: tuple[str, str], more: str = "", seed: int | None = None, machine: Machine | None = None
) -> Simulator:
    """Scouts in a room, each pair of texts replaced, `more` added at the end."""
    return Simulator(load(write(folder, *changes, more=more, text=SCOUTS)), seed, machine)
