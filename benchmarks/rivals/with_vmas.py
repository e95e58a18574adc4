"""The job in VMAS, on the processor, in two ways: one world, as the job is; and many small worlds at once.

Many worlds is what VMAS is made for: its time hardly grows with their number. But robots of different worlds do not
see each other, so it is an easier job, and the table says so.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from importlib.metadata import version
from math import pi

import numpy as np
import torch
import vmas
from vmas.simulator.core import Agent, Landmark, Line, Sphere, World
from vmas.simulator.dynamics.diff_drive import DiffDrive
from vmas.simulator.scenario import BaseScenario
from vmas.simulator.sensors import Lidar

from benchmarks.rivals import job

TOGETHER = 10
"""Robots in each of many worlds."""
TRIALS = 2
"""Steps with each number of threads, to find the faster; the first of them is not counted."""


class Wander(BaseScenario):  # type: ignore[misc]
    """So many robots in a walled square round the origin."""

    def __init__(self, robots: int) -> None:
        super().__init__()
        self.robots = robots

    def make_world(self, batch_dim: int, device: torch.device, **_: object) -> World:
        world = World(batch_dim, device, dt=job.TICK, drag=0.0)
        for number in range(self.robots):
            world.add_agent(
                Agent(
                    name=f"robot{number}",
                    shape=Sphere(job.RADIUS),
                    u_range=[job.TOP_SPEED, job.TOP_TURN],
                    u_multiplier=[1.0, 1.0],
                    dynamics=DiffDrive(world, integration="euler"),
                    sensors=[Lidar(world, n_rays=job.BEAMS, max_range=job.REACH)],
                )
            )
        for number in range(4):
            world.add_landmark(Landmark(name=f"wall{number}", shape=Line(length=job.side(self.robots)), collide=True))
        return world

    def reset_world_at(self, env_index: int | None = None) -> None:
        places, headings = job.start(self.robots)
        half = job.side(self.robots) / 2
        for agent, place, heading in zip(self.world.agents, places - half, headings, strict=True):
            self._put(agent, place.tolist(), float(heading))
        for wall, (begin, end) in zip(self.world.landmarks, job.corners(self.robots), strict=True):
            level = begin[1] == end[1]
            middle = [(a + b) / 2 - half for a, b in zip(begin, end, strict=True)]
            self._put(wall, middle, 0.0 if level else pi / 2)

    def _put(self, entity: Agent | Landmark, place: list[float], heading: float) -> None:
        worlds = self.world.batch_dim
        entity.set_pos(torch.tensor(place, dtype=torch.float32).repeat(worlds, 1), batch_index=None)
        entity.set_rot(torch.full((worlds, 1), heading), batch_index=None)

    def observation(self, agent: Agent) -> torch.Tensor:
        return agent.sensors[0].measure()

    def reward(self, agent: Agent) -> torch.Tensor:
        return torch.zeros(self.world.batch_dim)


def decide(ranges: torch.Tensor) -> torch.Tensor:
    """`job.decide` in torch: ranges of shape (robots, worlds, beams) to commands of shape (robots, worlds, 2)."""
    ahead = torch.minimum(ranges[..., :3].amin(-1), ranges[..., -2:].amin(-1))
    near = ahead < job.CLOSE
    away = torch.where(ranges[..., 1:5].amin(-1) < ranges[..., -4:].amin(-1), -job.AWAY, job.AWAY)
    turns = torch.where(near, away, (2 * torch.rand_like(ahead) - 1) * job.DRIFT)
    return torch.stack([torch.where(near, job.SLOW, job.SPEED), turns], dim=-1)


def ready(robots: int) -> job.Job:
    """All robots in one world."""
    return _ready(robots, 1, "one world")


def ready_in_worlds(robots: int) -> job.Job:
    """Ten robots in each world."""
    return _ready(TOGETHER, robots // TOGETHER, f"worlds of {TOGETHER} robots, which do not see other worlds")


def _ready(robots: int, worlds: int, words: str) -> job.Job:
    env = vmas.make_env(Wander(robots), num_envs=worlds, device="cpu", seed=job.SEED)
    seen = env.reset()

    def step() -> None:
        nonlocal seen
        seen = env.step(list(decide(torch.stack(seen))))[0]

    def places() -> job.Floats:
        found = torch.cat([agent.state.pos for agent in env.world.agents]).numpy()
        return np.asarray(found + job.side(robots) / 2, np.float64)

    threads = _faster(step)
    return job.Job(
        step=step,
        places=places,
        ranges=lambda: torch.cat(list(seen)).numpy().astype(np.float64),
        setting=f"vmas {version('vmas')}, torch {version('torch')}: {words}; lidar of 16 rays, "
        f"differential drive, {threads} threads",
    )


def _faster(step: Callable[[], None]) -> int:
    """Let torch have one thread or all of them, whatever is faster; gives how many."""
    taken = {}
    for threads in sorted({1, len(os.sched_getaffinity(0))}):
        torch.set_num_threads(threads)
        step()
        begin = time.perf_counter()
        for _ in range(TRIALS - 1):
            step()
        taken[threads] = time.perf_counter() - begin
    best = min(taken, key=taken.__getitem__)
    torch.set_num_threads(best)
    return best
