"""Train a policy: two hundred vehicles learn to drive to a lamp, and to stay there.

    python examples/train_to_gather.py

Every vehicle tries a variation of the policy. The best ones make the next one (the cross-entropy method: R. Y.
Rubinstein, European Journal of Operational Research 99, 1997). The policy is linear: six numbers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import sleepcast.gym

FIELD = """
format = 1
title = "A lamp in a field"
seconds = "90s"
tick = "0.5s"

[world]
width = "100m"
height = "100m"

[places.lamp]
x = "50m"
y = "50m"

[robots]
type = "vehicle"
count = 200
motion = "still"

[robots.limits]
speed = "1m/s"
turn_rate = "45deg/s"
acceleration = "1m/s2"

[robots.body]
radius = "0.2m"
"""
AWAY = "(DIST x y lamp_x lamp_y)"
ASIDE = "(WRAP (- (BEARING x y lamp_x lamp_y) heading))"
BEST = 0.15
"""Share of the vehicles whose variation is kept."""


def train(generations: int = 15, seed: int = 1, *, quiet: bool = False) -> list[float]:
    """The mean reward of a vehicle in each generation: minus its mean distance from the lamp, m."""
    chance = np.random.default_rng(seed)
    env = sleepcast.gym.vector_env(
        FIELD, observations=[f"(/ {AWAY} 50m)", f"(COS {ASIDE})", f"(SIN {ASIDE})"], reward=f"(- 0m {AWAY})", ticks=2
    )
    inputs, outputs = 3, 2
    mean, deviation = np.zeros((inputs, outputs)), np.ones((inputs, outputs))
    rewards = []
    for generation in range(generations):
        policies = mean + deviation * chance.standard_normal((env.num_envs, inputs, outputs))
        reward = episode(env, policies, seed=generation)
        best = policies[np.argsort(-reward)[: round(BEST * env.num_envs)]]
        mean, deviation = best.mean(axis=0), best.std(axis=0) + 0.02
        rewards.append(float(reward.mean()))
        if not quiet:
            print(f"generation {generation + 1}: {-rewards[-1]:.1f} m from the lamp on average")
    env.close()
    return rewards


def episode(env: sleepcast.gym.RobotVector, policies: NDArray[np.float64], seed: int) -> NDArray[np.float64]:
    """The mean reward of each vehicle with its own policy, shape (vehicles, inputs, outputs)."""
    observed, _ = env.reset(seed=seed)
    rewards, over = [], False
    while not over:
        actions = np.tanh(np.einsum("vi,vio->vo", observed, policies))
        observed, reward, _, cut, _ = env.step(actions.astype(np.float32))
        rewards.append(reward)
        over = bool(cut.all())
    return np.mean(rewards, axis=0)


if __name__ == "__main__":
    train()
