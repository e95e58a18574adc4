"""Sliders of scenarios."""

from __future__ import annotations

import pytest

from sleepcast.core.settings import SettingsError
from sleepcast.simulator import Changes, Scenario, find_scenario, scenario_names
from sleepcast.simulator.scenario.scenario import read_scenario
from small_worlds import SMALL

KEYED = '\n[constants]\nNOISE = 0.5\n[sliders.noise]\nkey = "constants.NOISE"\nlow = 0\nhigh = 2\n'
LIVE = """
[sliders.level]
title = "how full"
value = "60%"
low = "0%"
high = "100%"
step = "5%"

[[commands]]
title = "Full ones"
text = "(WHEN (> battery {level}) (MARK))"
"""


def world(more: str, **over: object) -> Scenario:
    return read_scenario(SMALL + more, Changes(over=tuple((key.replace("__", "."), put) for key, put in over.items())))


def test_a_number_of_the_file_has_a_slider() -> None:
    (noise,) = world(KEYED).sliders
    assert (noise.name, noise.title, noise.key, noise.unit) == ("noise", "noise", "constants.NOISE", "")
    assert (noise.value, noise.low, noise.high, noise.step, noise.live) == (0.5, 0.0, 2.0, 0.02, False)
    assert world(KEYED, constants__NOISE=noise.written(1.5)).constants[0].value == 1.5


def test_a_number_of_commands_alone_fills_them() -> None:
    found = world(LIVE)
    (level,) = found.sliders
    assert (level.value, level.low, level.high, level.step, level.unit, level.live) == (60, 0, 100, 5, "%", True)
    assert found.commands[0].text == "(WHEN (> battery 60%) (MARK))"
    assert found.commands[0].blank == "(WHEN (> battery {level}) (MARK))"
    changed = world(LIVE, **{level.key: level.written(35.0)})
    assert changed.commands[0].text == "(WHEN (> battery 35%) (MARK))"
    assert not found.constants  # robots do not know it


def test_a_sweep_may_go_beyond_a_slider() -> None:
    (noise,) = world(KEYED, constants__NOISE=7).sliders
    assert (noise.value, noise.high) == (7.0, 7.0)


@pytest.mark.parametrize(
    ("over", "said"),
    [
        ({"robots.limits.speed": "fast"}, 'scenario.toml: over robots.limits.speed: wanted a number, not "fast"'),
        ({"robots.limits.speed": "5s"}, "over robots.limits.speed: its number has not the unit of low and high"),
        ({"robots.limits": {}}, "over robots.limits.speed: is missing"),
    ],
)
def test_a_wrong_change_is_not_the_fault_of_a_slider(over: dict[str, object], said: str) -> None:
    more = '\n[sliders.a]\nkey = "robots.limits.speed"\nlow = "0m/s"\nhigh = "9m/s"'
    with pytest.raises(SettingsError) as error:
        world(more, **over)
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ('[sliders.a]\nkey = "robots.speed"\nlow = 0\nhigh = 1', "this file has no number at robots.speed"),
        ('[sliders.a]\nkey = "robots.limits.speed"\nlow = 0\nhigh = 9', "has not the unit of low and high"),
        ('[sliders.a]\nkey = "robots.limits.speed"\nlow = "6m/s"\nhigh = "9m/s"', "not between low and high"),
        ("[sliders.a]\nvalue = 1\nlow = 2\nhigh = 2", "wanted more than low"),
        ('[sliders.a]\nvalue = 1\nlow = "1m"\nhigh = "2s"', 'wanted the unit of low, "m"'),
        ('[sliders.a]\nvalue = 1\nlow = 0\nhigh = 2\nstep = "1m"', "step: wanted the unit of low and high"),
        ("[sliders.a]\nlow = 0\nhigh = 2", "value: is missing"),
        (KEYED + "[sliders.NOISE]\nvalue = 1\nlow = 0\nhigh = 2", 'write key = "constants.NOISE" instead'),
    ],
)
def test_errors_name_their_place(more: str, said: str) -> None:
    with pytest.raises(SettingsError) as error:
        world("\n" + more)
    assert said in str(error.value)


def test_every_slider_of_the_gallery_may_stand_at_either_end() -> None:
    moved = 0
    for name in scenario_names():
        for slider in find_scenario(name).sliders:
            for end in (slider.low, slider.high):
                find_scenario(name, Changes(over=((slider.key, slider.written(end)),)))
                moved += 1
    assert moved >= 40
