"""The work that is measured: readings, the Bravo predicate and ten rules; and the same by hand in NumPy."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

import sleepcast
from sleepcast.channel.message import Kind, Message
from sleepcast.core.model import Quantity
from sleepcast.fleet import Fleet
from sleepcast.language import Vocabulary

Columns: TypeAlias = dict[str, NDArray[np.float64]]
CROWD = Path(sleepcast.__file__).parent / "scenarios" / "crowd" / "crowd.sleep"
NAMES = ("fuel", "ordnance", "x", "y", "near1", "near2", "near3")
BRAVO = "(AND (< (DIST x y 3 4) 5) (> fuel 0.5) (> ordnance 0.7))"
RULES = (
    "(SETQ throttle 0.3)",
    "(COND ((< near1 0.5) (SETQ throttle 0.1)))",
    "(COND ((AND (< near2 0.6) (< near3 0.6)) (SETQ lamp 1)))",
    "(IF (> fuel 0.2) (SETQ lamp 0) (SETQ lamp 2))",
    "(WHEN (< (DIST x y 3 4) 2) (SETQ throttle (* 0.5 (DIST x y 3 4))))",
    "(COND ((PROB 0.05) (SETQ lamp 3)))",
    "(SETQ throttle (MIN throttle 0.4))",
    "(COND ((> near1 3) (SETQ throttle (+ throttle 0.05))) ((> near2 3) (SETQ throttle (- throttle 0.05))))",
    "(AND (> ordnance 0.7) (< fuel 0.5) (SETQ lamp (+ lamp 1)))",
    "(SETQ lamp (CLAMP lamp 0 3))",
)


def columns(robots: int) -> Columns:
    """What the robots sense."""
    source = np.random.default_rng(1)
    return {
        name: source.random(robots) * (10.0 if name in "xy" else 1.0) * (4.0 if "near" in name else 1.0)
        for name in NAMES
    }


def fleet(sensed: Columns, *, native: bool = False) -> Fleet:
    """Robots that sense that."""
    count = len(sensed["x"])
    vocabulary = Vocabulary("bench", tuple(map(Quantity, NAMES)), (Quantity("throttle"), Quantity("lamp")))
    made = Fleet([f"r{i}" for i in range(count)], vocabulary, seed=1, native=native)
    made.sense(np.stack([sensed[name] for name in NAMES], axis=1), 0.0)
    return made


def crowd(robots: int, *, native: bool) -> Fleet:
    """Scouts, at one per 4 m2, that have heard the message of the scenario `crowd`."""
    source = np.random.default_rng(4)
    side = 2.0 * robots**0.5
    ranges = source.uniform(0.15, 6.5, (17, robots))
    places = source.uniform(0.0, side, (2, robots))
    heading, bumper = source.uniform(-np.pi, np.pi, robots), (source.random(robots) < 0.02) * 3.0
    sensors = (
        *(Quantity(name, "m") for name in ("x", "y", "front_range", *(f"sonar{i}" for i in range(16)))),
        *(Quantity("heading", "rad"), Quantity("bumper"), Quantity("battery", low=0, high=1, shown_as="%")),
    )
    vocabulary = Vocabulary("scout", sensors, (Quantity("drive_speed", "m/s"), Quantity("drive_turn", "rad/s")))
    made = Fleet([f"r{i}" for i in range(robots)], vocabulary, seed=1, native=native)
    made.sense(np.stack([*places, *ranges, heading, bumper, np.full(robots, 0.9)], axis=1), 0.0)
    made.receive(command(1, CROWD.read_text(encoding="utf-8").partition("@0s")[2]))
    return made


def command(number: int, text: str) -> Message:
    return Message("bench", 1, number, Kind.COMMAND, 0.0, text=text)


def predicate_by_hand(c: Columns) -> NDArray[np.bool_]:
    """Bravo as a careful person writes it in NumPy."""
    across, up = c["x"] - 3.0, c["y"] - 4.0
    found: NDArray[np.bool_] = (np.sqrt(across * across + up * up) < 5.0) & (c["fuel"] > 0.5) & (c["ordnance"] > 0.7)
    return found


def in_pieces(work: Callable[[Columns], NDArray[np.bool_]], c: Columns, length: int = 16_384) -> NDArray[np.bool_]:
    """The same piece by piece, so that what lies between stays in the cache."""
    count = len(c["x"])
    found = np.empty(count, np.bool_)
    for start in range(0, count, length):
        piece = slice(start, start + length)
        found[piece] = work({name: column[piece] for name, column in c.items()})
    return found


def rules_by_hand(c: Columns, source: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The ten rules as a careful person writes them in NumPy: no bounds, no unknowns, nothing that can be asked."""
    count = len(c["x"])
    throttle = np.where(c["near1"] < 0.5, 0.1, 0.3)
    lamp = np.where(c["fuel"] > 0.2, 0.0, 2.0)
    far = np.sqrt((c["x"] - 3.0) ** 2 + (c["y"] - 4.0) ** 2)
    throttle = np.where(far < 2.0, 0.5 * far, throttle)
    lamp[source.random(count) < 0.05] = 3.0
    np.minimum(throttle, 0.4, out=throttle)
    throttle += np.where(c["near1"] > 3.0, 0.05, np.where(c["near2"] > 3.0, -0.05, 0.0))
    lamp += (c["ordnance"] > 0.7) & (c["fuel"] < 0.5)
    return throttle, np.clip(lamp, 0.0, 3.0)
