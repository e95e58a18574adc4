"""Evolve a controller: robots with one bit of sight find wheel speeds with which they gather.

    python examples/evolve_gauci.py

Each robot sees only whether somebody is straight ahead, and has a pair of wheel speeds for either answer: four numbers.
M. Gauci and others found theirs by trying a grid of them (The International Journal of Robotics Research 33, 2014).
Most speeds gather nobody, many make robots chase each other in rings, and few make one heap. So a thousand candidates
live for a short time and close together; the best of them live longer, and then have children in harder worlds. All
worlds of a round run at once. In the end the one that was found is compared with the published one in worlds in which
neither was tried.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import NamedTuple

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
ROBOTS = 20


class Trial(NamedTuple):
    """Robots start in a square of so many m, and gather for so many s, in so many worlds."""

    side: float
    seconds: float
    worlds: int


class Round(NamedTuple):
    """The best of the round before, and children of theirs which differ by so much, are tried. kept: 0 for all new."""

    candidates: int
    kept: int
    spread: float
    trial: Trial


ROUNDS = (
    Round(1_024, 0, 0.0, Trial(2.0, 40.0, 1)),
    Round(64, 64, 0.0, Trial(2.0, 80.0, 2)),
    *(Round(24, 8, spread, Trial(4.0, 120.0, 4)) for spread in (0.2, 0.15, 0.1, 0.07, 0.05, 0.03)),
    Round(8, 8, 0.0, Trial(4.0, 150.0, 16)),
)
"""From a thousand candidates in one easy world each to the last eight in sixteen hard ones."""
HELD_OUT = range(1_001, 1_021)
"""Seeds of worlds in which no candidate lives."""


def rule(speeds: NDArray[np.float64]) -> str:
    """What robots with these wheel speeds are taught."""
    left, right = speeds.reshape(2, 2).T * FASTEST
    drives = np.column_stack(((left + right) / 2.0, (right - left) / TRACK))
    return RULE.format(*drives.ravel())


def dispersion(
    candidates: NDArray[np.float64], seeds: Sequence[int], side: float, seconds: float
) -> NDArray[np.float64]:
    """How far apart robots are in the end: their mean squared distance from their middle, m2, shape (candidates,
    seeds)."""
    square = [f"{30 - side / 2}m", f"{30 + side / 2}m"]
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


def born(plan: Round, best: NDArray[np.float64], chance: np.random.Generator) -> NDArray[np.float64]:
    """The candidates of a round, shape (candidates, 4); `best`: those of the one before, the best first."""
    if plan.kept:
        kept = best[: plan.kept]
        parents = chance.choice(kept, plan.candidates - plan.kept)
        return np.vstack((kept, np.clip(chance.normal(parents, plan.spread), -1.0, 1.0)))
    new = chance.uniform(-1.0, 1.0, (plan.candidates, 4))
    mirrored = new[:, 0] < new[:, 1]  # left and right are alike, so half of all speeds are enough
    new[mirrored] = new[mirrored][:, [1, 0, 3, 2]]
    return new


def evolve(rounds: Sequence[Round] = ROUNDS, seed: int = 1, *, quiet: bool = False) -> NDArray[np.float64]:
    """The wheel speeds that were the best of the last round, shape (4,)."""
    chance, best = np.random.default_rng(seed), np.empty((0, 4))
    for number, plan in enumerate(rounds, 1):
        candidates = born(plan, best, chance)
        seeds = [int(each) for each in chance.integers(1, 1_000, plan.trial.worlds)]
        apart = dispersion(candidates, seeds, plan.trial.side, plan.trial.seconds).mean(axis=1)
        best = candidates[np.argsort(apart)]
        if not quiet:
            shown = ", ".join(f"{each:+.2f}" for each in best[0])
            print(f"round {number}: {len(candidates)} candidates, the best {apart.min():.3f} m2, wheels {shown}")
    return best[0]


def compared(speeds: NDArray[np.float64], seeds: Sequence[int] = HELD_OUT, seconds: float = 180.0) -> str:
    """How robots with these wheel speeds gather beside those with the published ones, in other worlds."""
    evolved, published = dispersion(np.array([speeds, PUBLISHED]), seeds, 4.0, seconds)
    return "\n".join(
        (
            f"in {len(seeds)} new worlds, after {seconds:g} s:",
            f"evolved   {np.mean(evolved):.3f} m2 (median {np.median(evolved):.3f})",
            f"published {np.mean(published):.3f} m2 (median {np.median(published):.3f})",
            f"the evolved one is {'no worse' if np.mean(evolved) <= np.mean(published) else 'worse'}",
        )
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("--seed", type=int, default=1, help="of the search; 1 without it")
    print(compared(evolve(seed=parser.parse_args().seed)))


if __name__ == "__main__":
    main()
