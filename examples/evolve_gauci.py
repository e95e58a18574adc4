"""Evolve a controller: robots with one bit of sight find wheel speeds with which they gather.

    python examples/evolve_gauci.py

Each robot sees only whether somebody is straight ahead, and has a pair of wheel speeds for either answer: four numbers.
M. Gauci and others found theirs by trying a grid of them (The International Journal of Robotics Research 33, 2014).
Here the cross-entropy method does it (R. Y. Rubinstein, European Journal of Operational Research 99, 1997). Every
candidate lives in worlds of its own, and all of them run at once. In the end the one that was found is compared with
the published one in worlds in which neither was tried.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

import sleepcast as sc

FASTEST, TRACK = 0.128, 0.051
"""The e-puck's fastest wheel speed, m/s, and the distance of its wheels, m."""
PUBLISHED = np.array([-0.7, -1.0, 1.0, -1.0])
"""Left and right wheel where nobody is seen, then where somebody is, as shares of the fastest speed."""
RULE = """(PROGN
  (DEFVAR blind_speed {:.4f}m/s) (DEFVAR blind_turn {:.4f}rad/s)
  (DEFVAR seeing_speed {:.4f}m/s) (DEFVAR seeing_turn {:.4f}rad/s)
  (RULE gather (IF (< (SONAR 0) 20m) (DRIVE seeing_speed seeing_turn) (DRIVE blind_speed blind_turn))))"""
ROBOTS, SIDE = 20, 4.0
"""Robots, which start in a square of so many m."""
LIVES = 24, 5
"""Candidates of a generation, and how many of them make the next one."""
HELD_OUT = range(1_001, 1_021)


def rule(speeds: NDArray[np.float64]) -> str:
    """What robots with these wheel speeds are taught."""
    left, right = np.clip(speeds.reshape(2, 2).T, -1.0, 1.0) * FASTEST
    drives = np.column_stack(((left + right) / 2.0, (right - left) / TRACK))
    return RULE.format(*drives.ravel())


def dispersion(candidates: Sequence[NDArray[np.float64]], seeds: Sequence[int], seconds: float) -> NDArray[np.float64]:
    """How far apart robots are in the end: their mean squared distance from their middle, m2, shape (candidates,
    seeds)."""
    square = [f"{30 - SIDE / 2}m", f"{30 + SIDE / 2}m"]
    worlds = sc.open_many(
        "gauci",
        seeds=[seed for _ in candidates for seed in seeds],
        robots=ROBOTS,
        over={"robots.x": [square], "robots.y": [square]},
        quiet=True,
    )
    for number, fleet in worlds.items():
        fleet.send(rule(candidates[number // len(seeds)]), everybody=True, wait=0)
    worlds.run(seconds, quiet=True)
    apart = [np.var(fleet.x) + np.var(fleet.y) for fleet in worlds]
    return np.array(apart).reshape(len(candidates), len(seeds))


def evolve(generations: int = 12, seconds: float = 60.0, seed: int = 1, *, quiet: bool = False) -> NDArray[np.float64]:
    """The mean of the best wheel speeds of the last generation."""
    chance = np.random.default_rng(seed)
    mean, deviation = np.zeros(4), np.full(4, 0.8)
    for generation in range(generations):
        candidates = np.clip(mean + deviation * chance.standard_normal((LIVES[0], 4)), -1.0, 1.0)
        seeds = [int(each) for each in chance.integers(1, 1_000, 2)]
        apart = dispersion([*candidates], seeds, seconds).mean(axis=1)
        best = candidates[np.argsort(apart)[: LIVES[1]]]
        mean, deviation = best.mean(axis=0), best.std(axis=0) + 0.03
        if not quiet:
            shown = ", ".join(f"{each:+.2f}" for each in mean)
            print(f"generation {generation + 1}: {np.sort(apart)[: LIVES[1]].mean():.3f} m2, wheels {shown}")
    return np.clip(mean, -1.0, 1.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("--generations", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    found = evolve(options.generations, seed=options.seed)
    evolved, published = dispersion([found, PUBLISHED], [*HELD_OUT], 180.0)
    print(f"in {len(HELD_OUT)} new worlds, after 3 minutes:")
    print(f"evolved   {np.mean(evolved):.3f} m2 (median {np.median(evolved):.3f})")
    print(f"published {np.mean(published):.3f} m2 (median {np.median(published):.3f})")


if __name__ == "__main__":
    main()
