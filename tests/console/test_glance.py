"""The fleet at a glance: quantities over all robots, of a swarm and of a page that looks at another time."""

from __future__ import annotations

from statistics import median

from console.test_backend import Stand, stand
from sleepcast.console.feature import HANDLERS, run_again
from sleepcast.console.features.glance import GetGlance, Glance
from sleepcast.console.registry import decode
from sleepcast.console.swarm_dialogue import SwarmDialogue

__all__ = ["stand"]


def glance(stand: Stand) -> Glance:
    found = SwarmDialogue(stand.desk).answer(decode('{"type": "glance", "serial": 3}'))
    assert isinstance(found, Glance)
    return found


def test_it_says_least_median_and_greatest(stand: Stand) -> None:
    found = glance(stand)
    levels = [100 * stand.level(name) for name in stand.swarm.minds]
    wanted = [f"{value:.4g} %" for value in (min(levels), median(levels), max(levels))]
    battery = next(quantity for quantity in found.quantities if quantity.name == "battery")
    assert found.serial == 3
    assert (battery.shown, battery.unknown) == (wanted, 0)
    assert not {"x", "y", "heading"} & {quantity.name for quantity in found.quantities}


def test_it_can_be_asked_of_any_time() -> None:
    assert HANDLERS[GetGlance].then is run_again
