"""The fleet at a glance: quantities over all robots, of a swarm and of a page that looks at another time."""

from __future__ import annotations

from math import floor, log10
from statistics import median

from console.asking import put
from console.test_backend import Stand, stand
from sleepcast.console.feature import HANDLERS, run_again
from sleepcast.console.features.glance import MAX_LATEST, GetGlance, Glance, side_by_side
from sleepcast.console.features.send import Send
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
    places = 2 - floor(log10(max(levels)))
    wanted = [f"{round(value, places):g} %" for value in (min(levels), median(levels), max(levels))]
    battery = next(quantity for quantity in found.quantities if quantity.name == "battery")
    assert found.serial == 3
    assert (battery.shown, battery.unknown) == (wanted, 0)
    assert not {"x", "y", "heading"} & {quantity.name for quantity in found.quantities}


def test_values_in_a_row_have_three_digits_of_the_largest() -> None:
    assert side_by_side([-0.006522, 4.744e-6, 0.0007983]) == [-0.00652, 0.0, 0.0008]
    assert side_by_side([1.26, 57.25, 12345.6]) == [1.0, 57.0, 12346.0]
    assert str(side_by_side([-1e-9, 0.5])[0]) == "0.0"
    assert side_by_side([0.0, 0.0, 0.0]) == [0.0, 0.0, 0.0]
    assert side_by_side([]) == []


def test_it_says_what_robots_reported_last_whichever_they_are(stand: Stand) -> None:
    assert glance(stand).reports == []
    for number in (3, 5):
        put(stand.desk, Send, 1, f'(WHEN (= id {number}) (REPORT "here" id))', True)
        stand.run(1.0)
    assert [(each.robot, each.text) for each in glance(stand).reports] == [("rover5", "here: 5"), ("rover3", "here: 3")]
    for _ in range(MAX_LATEST):
        put(stand.desk, Send, 1, '(REPORT "level" 1)', True)
        stand.run(1.0)
    assert [each.text for each in glance(stand).reports] == ["level: 1"] * MAX_LATEST


def test_it_can_be_asked_of_any_time() -> None:
    assert HANDLERS[GetGlance].then is run_again
