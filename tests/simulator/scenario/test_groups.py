"""Groups, constants, lights and the disc in scenario files: what they make, and every mistake with its place."""

from __future__ import annotations

from dataclasses import replace
from math import isnan, sqrt
from pathlib import Path

import numpy as np
import pytest

from simulator.test_sorts import SORTS, mixed
from sleepcast.core.units import LENGTH
from sleepcast.loop import Swarm
from sleepcast.simulator import Changes, SettingsError, Simulator, load
from small_worlds import SMALL, scouts, small, write

GROUPS = """
[constants]
TUG = 4
FAR = "60m"

[robots.groups.tugs]
count = 5
values = { caste = "tug", keep = "FAR" }

[robots.groups.boats]
count = 15
values = { caste = 2.5 }
"""
FIRST = SMALL.count("\n") + 1
"""The number of the line before the first of GROUPS; the text begins with an empty line."""


def column(sim: Simulator, name: str) -> list[float]:
    return [row[[s.name for s in sim.model.sensors].index(name)] for row in sim.readings()]


class TestNumbers:
    def test_rows_have_the_places_of_chance_in_another_order(self, tmp_path: Path) -> None:
        chance = Simulator(small(tmp_path, ("count = 20\n", "count = 2000\n")))
        rows = Simulator(small(tmp_path, ("count = 20\n", 'count = 2000\nnumbers = "along rows"\n')))
        places = [sorted(zip(sim.x.tolist(), sim.y.tolist(), strict=True)) for sim in (chance, rows)]
        assert places[0] == places[1]
        assert (rows.bodies.encoder_x == rows.x).all()

        def apart(sim: Simulator) -> float:
            return float(np.median(np.hypot(np.diff(sim.x), np.diff(sim.y))))

        assert apart(chance) > 400.0
        assert apart(rows) < 40.0

    def test_each_sort_has_rows_of_its_own(self, tmp_path: Path) -> None:
        sim = mixed(tmp_path, SORTS.replace("count = 2\n", 'count = 9\nnumbers = "along rows"\n'))
        assert tuple(sim.names[8:10]) == ("scout9", "nomad1")
        assert (np.diff(sim.x[:9]) > 0.0).all()

    def test_only_these_two_are_there(self, tmp_path: Path) -> None:
        with pytest.raises(SettingsError, match="along rows"):
            small(tmp_path, ("count = 20\n", 'count = 20\nnumbers = "backwards"\n'))


class TestGroups:
    def test_each_robot_has_the_values_of_its_group(self, tmp_path: Path) -> None:
        sim = Simulator(small(tmp_path, more=GROUPS))
        assert column(sim, "caste") == [4.0] * 5 + [2.5] * 15
        assert column(sim, "keep")[:5] == [60.0] * 5
        assert all(map(isnan, column(sim, "keep")[5:]))

    def test_values_are_sensors_with_range_and_unit(self, tmp_path: Path) -> None:
        sensors = {sensor.name: sensor for sensor in Simulator(small(tmp_path, more=GROUPS)).model.sensors}
        assert (sensors["caste"].low, sensors["caste"].high) == (2.5, 4.0)
        assert sensors["keep"].dimension == LENGTH

    def test_rules_know_values_and_constants(self, tmp_path: Path) -> None:
        swarm = Swarm(Simulator(small(tmp_path, more=GROUPS)))
        swarm.sense()
        text = "(AND (= caste TUG) (> 61m FAR) (= keep FAR))"
        assert [node.evaluate(text).matched for node in swarm.minds.values()] == [True] * 5 + [False] * 15
        assert isnan(swarm.fleet.at(7).evaluate("keep").value)

    def test_the_count_follows_from_them(self, tmp_path: Path) -> None:
        assert small(tmp_path, ("count = 20\n", ""), more=GROUPS).robots.count == 20

    @pytest.mark.parametrize(("count", "tugs"), [(4, 1), (40, 10), (1, 0), (2, 0), (10, 2)])
    def test_another_number_of_robots_keeps_the_proportion(self, tmp_path: Path, count: int, tugs: int) -> None:
        scenario = small(tmp_path, more=GROUPS)
        sim = Simulator(replace(scenario, robots=replace(scenario.robots, count=count)))
        assert column(sim, "caste") == [4.0] * tugs + [2.5] * (count - tugs)

    def test_so_does_a_run_that_asks_for_another_number_in_a_world_that_grows_with_it(self, tmp_path: Path) -> None:
        square = ('width = "1km"\nheight = "1km"', "area_per_robot = 20000")
        file = write(tmp_path, square, ("count = 20\n", ""), more=GROUPS)
        assert load(file).width == pytest.approx(sqrt(20 * 20_000))
        scenario = load(file, Changes(robots=60))
        assert scenario.width == pytest.approx(sqrt(60 * 20_000))
        assert column(Simulator(scenario), "caste") == [4.0] * 15 + [2.5] * 45


class TestDisc:
    def test_bodies_that_touch_start_apart_within_it(self, tmp_path: Path) -> None:
        disc = '\n[robots.disc]\nx = "6m"\ny = "6m"\nradius = "2m"\n'
        sim = scouts(tmp_path, ("count = 1\n", "count = 30\n"), more=disc)
        assert np.hypot(sim.x - 6.0, sim.y - 6.0).max() <= 2.0
        away = np.hypot(sim.x[:, None] - sim.x, sim.y[:, None] - sim.y)
        assert away[np.triu_indices(30, 1)].min() >= 2 * 0.17

    def test_robots_start_evenly_within_it(self, tmp_path: Path) -> None:
        more = '\n[robots.disc]\nx = "300m"\ny = "400m"\nradius = "100m"\n'
        sim = Simulator(small(tmp_path, ("count = 20", "count = 4000"), more=more))
        away = np.hypot(sim.x - 300.0, sim.y - 400.0)
        assert away.max() <= 100.0
        assert abs((away < 50.0).mean() - 0.25) < 0.03
        assert abs((sim.x < 300.0).mean() - 0.5) < 0.03
        assert abs((sim.y < 400.0).mean() - 0.5) < 0.03


def mistake(folder: Path, *changes: tuple[str, str], more: str) -> str:
    file = write(folder, *changes, more=more)
    with pytest.raises(SettingsError) as caught:
        load(file)
    return str(caught.value).removeprefix(f"{file}:")


MISTAKES = [
    ("TUG = 4", "TUG = true", 2, "constants.TUG", "wanted a value, not true"),
    ("TUG = 4", "2ND = 4", 2, "constants.2ND", '"2ND" is no name'),
    ("TUG = 4", 'TUG = "4parsec"', 2, "constants.TUG", 'unknown unit in "4parsec"'),
    ("TUG = 4", "TUG = 4\nbattery = 4", 3, "constants.battery", "robots know something of this name already"),
    ("TUG = 4", "TUG = 4\nfront = 4", 3, "constants.front", "robots know something of this name already"),
    ("TUG = 4", "TUG = 4\nfar = 4", 4, "constants.FAR", "robots know something of this name already"),
    ("caste = 2.5", "heading = 2.5", 11, "robots.groups.boats.values.heading", "something of this name already"),
    ("caste = 2.5", "Sonar0 = 2.5", 11, "robots.groups.boats.values.Sonar0", "something of this name already"),
    ("caste = 2.5", "tug = 2.5", 11, "robots.groups.boats.values.tug", "something of this name already"),
    ("caste = 2.5", 'caste = "tugs"', 11, "robots.groups.boats.values.caste", 'no constant "tugs" (did you mean TUG?)'),
    ("caste = 2.5", 'caste = "2m"', 11, "robots.groups.boats.values.caste", "use one dimension"),
    ("caste = 2.5", "Caste = 2.5", 11, "robots.groups.boats.values.Caste", "another group spells it caste"),
    ("count = 15", "count = 16", 18 - FIRST, "robots.count", "the groups add up to 21"),
    ("count = 15", "count = 0", 10, "robots.groups.boats.count", "wanted a whole number from 1 to 1000000, not 0"),
    ("count = 15", "cuont = 15", 10, "robots.groups.boats.cuont", "unknown key (did you mean count?)"),
    ("count = 15", "count = 15\nsees_light = 1", 11, "robots.groups.boats.sees_light", "wanted true or false, not 1"),
    ("groups.boats", 'groups."b t"', 9, "robots.groups.b t", '"b t" is no name'),
]


@pytest.mark.parametrize(("old", "new", "line", "key", "said"), MISTAKES, ids=lambda value: str(value)[:24])
def test_a_mistake_is_told_with_its_place(tmp_path: Path, old: str, new: str, line: int, key: str, said: str) -> None:
    assert old in GROUPS
    text = mistake(tmp_path, more=GROUPS.replace(old, new))
    assert text.startswith(f"{FIRST + line}: {key}: "), text
    assert said in text


MORE_MISTAKES = [
    ('[lights.lamp]\nx = "2km"\ny = 0', 2, "lights.lamp.x", 'not "2km"'),
    ("[lights.lamp]\nx = 0", 1, "lights.lamp.y", "is missing"),
    ("[lights.house]\nx = 0\ny = 0", 1, "lights.house", "a place has this name already"),
    ('[lights.lamp]\nx = 0\ny = 0\nreach = "far"', 4, "lights.lamp.reach", "wanted a length"),
    ("[pings]\nloss = 0", 1, "pings.reach", "is missing"),
    ("[pings]\nreach = 9\nloss = 2", 3, "pings.loss", "from 0 to 1, not 2"),
    ("[pings]\nreach = 9\nqueue = 65", 3, "pings.queue", "wanted a whole number from 1 to 64, not 65"),
    ("[robots.disc]\nx = 10\ny = 10\nradius = 11", 4, "robots.disc.radius", "from 0 to 10, not 11"),
    ('[measures.far]\nof = "distance"', 1, "measures.far.to", "is missing"),
    ('[measures.far]\nof = "distance"\nto = "horse"', 3, "measures.far.to", "(did you mean house?)"),
    ('[measures.far]\nof = "distances"', 2, "measures.far.of", "(did you mean distance?)"),
    ('[measures.far]\nof = "gyration"\nto = "house"', 3, "measures.far.to", "unknown key"),
    ('[measures.radio]\nof = "gyration"', 1, "measures.radio", "is measured of every run already"),
    ('[measures.size]\nof = "gyration"\nevery = "0s"', 3, "measures.size.every", 'not "0s"'),
]


@pytest.mark.parametrize(("more", "line", "key", "said"), MORE_MISTAKES, ids=lambda value: str(value)[:30])
def test_so_is_one_in_lights_pings_and_measures(tmp_path: Path, more: str, line: int, key: str, said: str) -> None:
    text = mistake(tmp_path, more=f"\n{more}\n")
    assert text.startswith(f"{FIRST + line}: {key}: "), text
    assert said in text


def test_a_disc_and_a_rectangle_are_too_much(tmp_path: Path) -> None:
    disc = "\n[robots.disc]\nx = 10\ny = 10\nradius = 5\n"
    text = mistake(tmp_path, ("count = 20", "count = 20\ny = [0, 1]"), more=disc)
    assert text.startswith("19: robots.y: the robots start within a disc"), text
