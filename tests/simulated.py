"""What tests ask of a simulation: to go on, what a robot senses, and what comes of a command."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.simulator import Simulator


def steps(simulator: Simulator, seconds: float) -> None:
    """Let so much time pass."""
    for _ in range(round(seconds / simulator.scenario.tick)):
        simulator.step()


def sensed(simulator: Simulator, robot: int) -> dict[str, float]:
    """What a robot (an index) senses now, by the name of its sensor."""
    names = (sensor.name for sensor in simulator.model.sensors)
    return dict(zip(names, simulator.readings([robot])[0], strict=True))


def refused(call: Callable[[], object]) -> str:
    """The sentence with which something is refused as a misuse."""
    with pytest.raises(MisuseError) as caught:
        call()
    return str(caught.value)


def outcome(command: Callable[..., object], *numbers: float) -> tuple[type, str]:
    """1, or the error that was raised, as its type and text."""
    try:
        command(*numbers)
    except SleepcastError as error:
        return type(error), str(error)
    return float, "1.0"
