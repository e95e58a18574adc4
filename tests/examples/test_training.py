"""The example of a training improves what it is paid for."""

from __future__ import annotations

import runpy
from pathlib import Path

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "train_to_gather.py"


def test_vehicles_learn_to_drive_to_the_lamp() -> None:
    rewards = runpy.run_path(str(EXAMPLE))["train"](generations=8, quiet=True)
    assert rewards[-1] > rewards[0] + 10.0, "they are ten metres nearer to it on average"
