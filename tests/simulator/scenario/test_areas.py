"""Areas of a scenario: what its tables say, and that its robots know them from the start, on a fleet as on a node."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.core.model import NamedArea
from sleepcast.language import CheckError, Vocabulary, functions
from sleepcast.language.vocabulary import VocabularyError
from sleepcast.loop import Swarm, vocabulary_of
from sleepcast.node.node import Node
from sleepcast.node.state import mind_of, restore
from sleepcast.simulator import SettingsError, Simulator
from sleepcast.simulator.scenario import areas
from small_worlds import small, write

AREAS = """
[areas.yard]
corners = [["100m", "100m"], ["900m", "100m"], ["900m", "800m"]]

[areas.pond]
center = ["500m", "400m"]
radius = "200m"

[areas.Strip]
x = ["0m", "1km"]
y = ["300m", "500m"]
"""


def test_an_area_is_a_polygon_a_disc_or_a_rectangle(tmp_path: Path) -> None:
    assert small(tmp_path, more=AREAS).areas == (
        NamedArea("yard", (100.0, 100.0, 900.0, 100.0, 900.0, 800.0)),
        NamedArea("pond", (500.0, 400.0, 200.0)),
        NamedArea("Strip", (0.0, 300.0, 1000.0, 300.0, 1000.0, 500.0, 0.0, 500.0)),
    )


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("[areas.a]\n", "areas.a: wanted either corners, or center and radius, or x and y"),
        ('[areas.a]\nx = [1, 2]\nradius = "1m"\n', "areas.a: wanted either corners, or center"),
        ('[areas.a]\nradius = "1m"\n', "areas.a.center: is missing"),
        ("[areas.a]\ny = [1, 2]\n", "areas.a.x: is missing"),
        ("[areas.a]\nx = [1, 1]\ny = [1, 2]\n", "areas.a.x: wanted two values at least 1e-06 m apart"),
        ("[areas.a]\ncorners = [[0, 0], [1, 1]]\n", "areas.a.corners: wanted a list of 3 to 48 points"),
        ("[areas.a]\ncorners = [[0, 0], [9, 0], [9, 9], [0, 0]]\n", "points 4 and 1 are the same: leave one out"),
        ("[areas.a]\ncorners = [[0, 0], [9, 0], [9, 2e3]]\n", "wanted a length from 0 to 1000"),
        ('[areas.a]\ncenter = [1, 1]\nradius = "0m"\n', "areas.a.radius: wanted a length"),
        ("[areas.A]\nx = [1, 2]\ny = [1, 2]\n[areas.a]\nx = [1, 2]\ny = [1, 2]\n", "an area is called A already"),
        ('[areas."1"]\nx = [1, 2]\ny = [1, 2]\n', '"1" is no name'),
        ("".join(f"[areas.a{i}]\nx = [1, 2]\ny = [1, 2]\n" for i in range(33)), "33 of them; at most 32 fit"),
    ],
)
def test_what_is_no_area_is_refused_with_its_key(tmp_path: Path, more: str, said: str) -> None:
    with pytest.raises(SettingsError) as refused:
        small(tmp_path, more=more)
    assert said in str(refused.value)


@pytest.mark.parametrize("name", ["x", "DIST", "e5", "Battery", "house_x", "DRIVE"])
def test_an_area_has_a_name_of_its_own(tmp_path: Path, name: str) -> None:
    scenario = small(tmp_path, more=f"[areas.{name}]\nx = [1, 2]\ny = [1, 2]\n")
    with pytest.raises(VocabularyError, match=f"the area {name} has the same name as the"):
        Swarm(Simulator(scenario))


def test_an_area_of_a_scenario_has_as_many_corners_as_one_that_is_sent() -> None:
    assert areas.MAX_CORNERS == functions.MAX_CORNERS
    assert 2 + 2 * functions.MAX_CORNERS <= functions.MANY


def test_robots_know_areas_from_the_start(tmp_path: Path) -> None:
    with sc.open(write(tmp_path, more=AREAS)) as fleet:
        away = 200.0 - np.hypot(fleet.x - 500.0, fleet.y - 400.0)
        np.testing.assert_allclose(fleet["(TO-EDGE pond)"], away, rtol=1e-12)
        np.testing.assert_array_equal(fleet["(INSIDE strip)"], (fleet.y >= 300.0) & (fleet.y <= 500.0))
        inside = fleet["(INSIDE yard)"] > 0.0
        assert 0 < inside.sum() < 20
        joined = fleet.send("(WHEN (INSIDE yard) (JOIN bravo))")
        assert len(joined.matched) == inside.sum()
        fleet.send("(AREA pond 0m 0m 5km)", everybody=True)
        assert fleet["(INSIDE pond)"].all()
        fleet.send("(FORGET yard)", everybody=True)
        with pytest.raises(CheckError, match="yard"):
            fleet["(INSIDE yard)"]


def test_a_robot_that_hears_an_area_later_has_the_same_one_as_the_others(tmp_path: Path) -> None:
    with sc.open(write(tmp_path, more=AREAS)) as fleet:
        vocabulary = vocabulary_of(fleet.swarm.simulator.model)
        node = Node("rover1", vocabulary)
        values = [float(fleet[each.name][0]) for each in vocabulary.sensors]
        node.sense(values, 0.0)
        for name in ("yard", "pond", "strip"):
            wanted = float(fleet[f"(TO-EDGE {name})"][0])
            assert node.evaluate(f"(TO-EDGE {name})").value == wanted
            corners = {area.name.casefold(): area for area in vocabulary.areas}[name].sizes
            node.evaluate(f"(AREA again {' '.join(map(repr, corners))})")
            assert node.evaluate("(TO-EDGE again)").value == wanted


def test_a_restart_brings_back_no_area_that_was_forgotten() -> None:
    vocabulary = Vocabulary("rover", areas=(NamedArea("yard", (0.0, 0.0, 5.0)), NamedArea("pond", (0.0, 0.0, 9.0))))
    node = Node("rover1", vocabulary)
    assert node.declared("yard") is not None
    node.evaluate("(FORGET yard)")
    node.evaluate("(DEFUN pond () 3)")
    again = Node("rover1", vocabulary)
    assert restore(mind_of(node), again, 0.0) == []
    assert again.declared("yard") is None
    assert again.evaluate("(TO-EDGE pond)").value == 3.0
