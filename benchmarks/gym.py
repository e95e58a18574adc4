"""How many steps a second an environment makes: vehicles that drive about in a field and know their way to a lamp.

    python -m benchmarks.gym [--robots N] [--quick] [--json]

A step is one robot's: its action, 0.5 s of simulated time, its observation and its reward. Actions are drawn at random
beforehand. VMAS does the same job in one world and in many small ones, which is what it is made for, where it is
installed (it brings PyTorch): `pip install vmas`.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from importlib.util import find_spec

import numpy as np

from benchmarks.report import Json, described, machine, middle, number, table

TOGETHER = 10
"""Robots in each of many worlds."""
ROUNDS = 3
AWAY = "(DIST x y lamp_x lamp_y)"
FIELD = """
format = 1
title = "A lamp in a field"
seconds = "1h"
tick = "0.5s"
[world]
width = "{side}m"
height = "{side}m"
[places.lamp]
x = "{half}m"
y = "{half}m"
[robots]
type = "vehicle"
count = {robots}
motion = "still"
[robots.limits]
speed = "1m/s"
turn_rate = "45deg/s"
acceleration = "1m/s2"
[robots.body]
radius = "0.2m"
"""


def side(robots: int) -> float:
    """Of a field with 50 m2 for each robot, m."""
    return float(np.sqrt(50.0 * robots))


def rate(
    robots: int, steps: int, step: Callable[[int], object], clock: Callable[[], float] = time.perf_counter
) -> float:
    """Robots' steps a second: the median of some rounds, after one that does not count."""
    found = []
    for _ in range(ROUNDS + 1):
        began = clock()
        for turn in range(steps):
            step(turn)
        found.append(robots * steps / (clock() - began))
    return middle(found[1:])


def with_sleepcast(robots: int, steps: int) -> dict[str, float]:
    import sleepcast.gym

    field = FIELD.format(side=side(robots), half=side(robots) / 2, robots=robots)
    observations = ["x", "y", "heading", "speed", AWAY]
    vector = sleepcast.gym.vector_env(field, observations=observations, reward=f"(- 0m {AWAY})")
    vector.reset(seed=1)
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, (steps, robots, 2)).astype(np.float32)
    parallel = sleepcast.gym.parallel_env(field, observations=observations, reward=f"(- 0m {AWAY})")
    parallel.reset(seed=1)
    names = parallel.possible_agents
    by_name = [dict(zip(names, each, strict=True)) for each in actions]
    return {
        "sleepcast, `vector_env`": rate(robots, steps, lambda i: vector.step(actions[i])),
        "sleepcast, `parallel_env`": rate(robots, steps, lambda i: parallel.step(by_name[i])),
    }


def with_vmas(robots: int, steps: int) -> dict[str, float]:
    worlds = robots // TOGETHER
    return {
        "VMAS, one world": in_vmas(1, robots, steps),
        f"VMAS, {worlds} worlds of {TOGETHER}": in_vmas(worlds, TOGETHER, steps),
    }


def in_vmas(worlds: int, each: int, steps: int, clock: Callable[[], float] = time.perf_counter) -> float:
    """Robots' steps a second in so many worlds with so many robots each."""
    import torch
    from vmas import make_env
    from vmas.simulator.core import Agent, Sphere, World
    from vmas.simulator.dynamics.diff_drive import DiffDrive
    from vmas.simulator.scenario import BaseScenario

    class Field(BaseScenario):  # type: ignore[misc]  # has no types
        """The same robots in `side` m, without contact, as vehicles of the field."""

        def make_world(self, batch_dim: int, device: torch.device, **given: int) -> World:
            world = World(batch_dim, device, dt=0.5, drag=0.0)
            for place in range(given["robots"]):
                body = DiffDrive(world, integration="euler")
                world.add_agent(Agent(name=f"robot{place}", shape=Sphere(0.2), collide=False, dynamics=body))
            return world

        def reset_world_at(self, env_index: int | None = None) -> None:
            for agent in self.world.agents:
                size = (self.world.batch_dim, 2) if env_index is None else (2,)
                agent.set_pos((torch.rand(size) - 0.5) * side(len(self.world.agents)), batch_index=env_index)

        def observation(self, agent: Agent) -> torch.Tensor:
            away = agent.state.pos.norm(dim=-1, keepdim=True)
            return torch.cat([agent.state.pos, agent.state.rot, agent.state.vel, away], dim=-1)

        def reward(self, agent: Agent) -> torch.Tensor:
            return -agent.state.pos.norm(dim=-1)

    env = make_env(Field(), num_envs=worlds, device="cpu", continuous_actions=True, seed=1, robots=each)
    actions = torch.rand((steps, each, worlds, 2)) * 2.0 - 1.0
    return rate(worlds * each, steps, lambda i: env.step(list(actions[i])), clock)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.gym", description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("--robots", type=int, default=1_000, help="10 or more")
    parser.add_argument("--quick", action="store_true", help="a few steps; rough numbers")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    steps, robots = 5 if options.quick else 100, max(TOGETHER, options.robots)
    rates, missing = with_sleepcast(robots, steps), []
    if find_spec("vmas"):
        rates |= with_vmas(robots, steps)
    else:
        missing = ["VMAS is not installed, so it is not in this table."]
    found, best = machine(), rates["sleepcast, `vector_env`"]
    if options.json:
        print(json.dumps(Json(machine=found, robots=robots, steps_per_second=rates, missing=missing)))
        return 0
    rows = [(name, number(each), f"{each / best:.2g}") for name, each in rates.items()]
    heads = (f"{robots:,} robots", "steps a second", "of vector_env")
    print(f"{described(found)}\n\n{table(heads, rows)}", *missing, sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
