"""The job in IR-SIM: headless, a lidar of sixteen beams each, commands for all robots in one call a step."""

from __future__ import annotations

import os
from importlib.metadata import version
from math import pi
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.rivals import job

os.environ["MPLBACKEND"] = "Agg"  # it asks matplotlib for a window when it is imported

import irsim
import yaml


def world(robots: int) -> dict[str, object]:
    """Its world file. Walls are four objects, so that its search tree can leave out those far away."""
    width = job.side(robots)
    places, headings = job.start(robots)
    opening = 2 * pi * (job.BEAMS - 1) / job.BEAMS
    lidar = {
        "name": "lidar2d",
        "range_min": 0.0,
        "range_max": job.REACH,
        "angle_range": opening,
        "number": job.BEAMS,
        "offset": [0.0, 0.0, opening / 2],
    }
    body = {
        "number": robots,
        "kinematics": {"name": "diff"},
        "shape": {"name": "circle", "radius": job.RADIUS},
        "vel_max": [job.TOP_SPEED, job.TOP_TURN],
        "vel_min": [-job.TOP_SPEED, -job.TOP_TURN],
        "distribution": {"name": "manual"},
        "state": np.column_stack([places, headings]).tolist(),
        "sensors": [lidar],
    }
    walls = [{"shape": {"name": "linestring", "vertices": [list(a), list(b)]}} for a, b in job.corners(robots)]
    times = {"step_time": job.TICK, "sample_time": job.TICK}
    return {
        "world": {"width": width, "height": width, "collision_mode": "contact", **times},
        "robot": [body],
        "obstacle": walls,
    }


def ready(robots: int) -> job.Job:
    with TemporaryDirectory() as folder:
        file = Path(folder, "world.yaml")
        file.write_text(yaml.safe_dump(world(robots)))
        env = irsim.make(str(file), headless=True, log_level="ERROR", seed=job.SEED)
    source = np.random.default_rng(job.SEED)

    def ranges() -> job.Floats:
        return np.array([robot.lidar.range_data for robot in env.robot_list])

    def step() -> None:
        commands = np.stack(job.decide(ranges(), source), axis=1)
        env.step(list(commands[:, :, np.newaxis]), 0)

    return job.Job(
        step=step,
        places=lambda: np.array([robot.state[:2, 0] for robot in env.robot_list]),
        ranges=ranges,
        setting=f"ir-sim {version('ir-sim')}: headless, lidar of 16 beams, contact; all commands in one call a step",
    )
