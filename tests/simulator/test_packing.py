"""Scenarios packed into a recording come back as they were, and nothing else comes out of a parcel."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from sleepcast.simulator import Place, Scenario, find_scenario, load, scenario_names
from sleepcast.simulator.packing import TYPE, pack, unpack
from small_worlds import SCOUTS, small, write


@pytest.mark.parametrize("name", scenario_names())
def test_every_scenario_of_the_gallery_comes_back(name: str) -> None:
    scenario = find_scenario(name)
    assert unpack(Scenario, pack(scenario)) == replace(scenario, path=Path(scenario.path.name))


EVERYTHING = """
[[world.circles]]
center = ["3m", "3m"]
radius = "1m"

[constants]
EYES = 4
FAR = "6m"

[lights.lamp]
x = "9m"
y = "9m"

[robots.disc]
x = "9m"
y = "9m"
radius = "2m"

[robots.groups.eyes]
count = 1
values = { caste = "EYES", keep = "FAR" }

[robots.groups.ears]
count = 2
values = { caste = 2 }
sees_light = false

[pings]
reach = "5m"

[measures.way]
of = "distance"
to = "lamp"

[measures.size]
of = "gyration"
"""


def test_every_sort_of_part_comes_back(tmp_path: Path) -> None:
    scenario = load(write(tmp_path, ("count = 1\n", ""), more=EVERYTHING, text=SCOUTS))
    robots = scenario.robots
    assert all((scenario.shapes, scenario.constants, scenario.lights, scenario.pings, scenario.measures))
    assert all((robots.groups, robots.disc, robots.wheels, robots.ring))
    found = unpack(Scenario, pack(scenario))
    assert found == replace(scenario, path=Path(scenario.path.name))
    assert found.robots.groups[0].values["keep"].unit == "m"


def test_infinities_and_none_come_back(tmp_path: Path) -> None:
    scenario = small(tmp_path)
    found = unpack(Scenario, pack(scenario))
    assert found.radio == scenario.radio
    assert found.radio.reach == float("inf")
    assert found.radio.operator is None


def test_a_parcel_names_no_folder_of_this_machine(tmp_path: Path) -> None:
    assert str(tmp_path).encode() not in pack(small(tmp_path))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("tick", "0.1"),
        ("tick", None),
        ("robots", {TYPE: "Path"}),
        ("robots", {TYPE: "Scenario"}),
        ("radio", {TYPE: "RadioModel", "reach": 1.0, "nonsense": 2.0}),
        ("places", [{TYPE: "Place", "name": "house"}]),
        ("noise", {"x": []}),
        ("commands", "none"),
        ("seed", True),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path: Path, name: str, value: object) -> None:
    plain = json.loads(pack(small(tmp_path)))
    with pytest.raises(ValueError):
        unpack(Scenario, json.dumps(plain | {name: value}).encode())


def test_a_parcel_of_another_kind_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="wanted Place"):
        unpack(Place, pack(small(tmp_path)))
