"""Recordings for tests of exports: one that version 0.2.0 has made, and small ones of one's own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from sleepcast.simulator import Scenario, load
from sleepcast.simulator.recording.recorder import Recorder
from sleepcast.simulator.recording.recording import Recording, load_recording
from sleepcast.simulator.scenario.sensors import sensors_of

YARD = Path(__file__).resolve().parent.parent / "of_0_2_0" / "yard.mcap"
"""Three scouts in a yard with a wall, for ten seconds: scout2 joins `east`, learns a rule and drives; then STOP."""

WORLD = """
format = 1
title = "für jeden"
seconds = "10s"
tick = "0.1s"

[world]
width = "4m"
height = "2m"

[robots]
like = "scout"
motion = "still"
starts = [
    { x = "1m", y = "1m", name = "left-1" },
    { x = "2m", y = "1m", name = "left_1" },
    { x = "3m", y = "1m", name = "3ö" },
]
"""


def world(folder: Path) -> Scenario:
    """A small world whose robots have names that others would not allow."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scenario.toml").write_text(WORLD, encoding="utf-8")
    return load(folder)


def recorded(folder: Path, fill: Callable[[Recorder], None]) -> Recording:
    """A recording of that world, with what `fill` writes."""
    scenario, file = world(folder / "world"), folder / "run.mcap"
    sensors = sensors_of(scenario)
    with Recorder(file, scenario, 3, version="9.9", complain=pytest.fail, sensors=sensors) as recorder:
        fill(recorder)
    return load_recording(file)


def flown(recorder: Recorder) -> None:
    """Record robots of that world one, two and three metres above the ground."""
    heights = np.array([1.0, 2.0, 3.0])
    recorder.poses(0.0, heights, np.ones(3), np.zeros(3), heights)


def one_picture(recorder: Recorder, time: float = 0.0) -> None:
    """Record where the robots of that world are."""
    recorder.poses(time, np.array([1.0, 2.0, 3.0]), np.ones(3), np.array([0.0, np.pi / 2, -np.pi / 2]))
