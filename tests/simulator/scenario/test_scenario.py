"""Scenario files: what they say is read, and every mistake is told with its file, its line and its key."""

from __future__ import annotations

from dataclasses import replace
from math import inf, isclose, radians
from pathlib import Path

import pytest

from sleepcast.core.errors import MisuseError
from sleepcast.core.settings import key_lines
from sleepcast.simulator import Changes, ScenarioOfSeeds, SettingsError, find_scenario, load, scenario_names
from sleepcast.simulator.scenario.robot_settings import MAX_ROBOTS, Wheels
from sleepcast.simulator.world.world import Circle, Polygon
from small_worlds import SMALL, small, write


class TestReading:
    def test_units_become_si(self, tmp_path: Path) -> None:
        scenario = small(tmp_path)
        assert (scenario.width, scenario.height, scenario.seconds, scenario.tick) == (1000.0, 1000.0, 60.0, 0.1)
        assert isclose(scenario.robots.limits.turn_rate, radians(90))
        assert scenario.robots.stores[0].low == 0.2

    def test_what_is_not_said_has_its_usual_value(self, tmp_path: Path) -> None:
        scenario = small(tmp_path)
        assert (scenario.speed_up, scenario.pings, scenario.radio.reach) == (1.0, None, inf)
        assert scenario.constants == scenario.lights == scenario.measures == scenario.robots.groups == ()
        assert scenario.robots.wander.speed == scenario.robots.limits.speed
        assert scenario.mission == scenario.commands == ()
        assert scenario.robots.x == (0.0, 1000.0)

    def test_a_plain_number_is_si(self, tmp_path: Path) -> None:
        assert small(tmp_path, ('width = "1km"', "width = 1500")).width == 1500.0

    def test_a_unit_may_stand_apart_and_in_any_case(self, tmp_path: Path) -> None:
        assert small(tmp_path, ('width = "1km"', 'width = "2 KM"')).width == 2000.0

    def test_units_that_people_wrote_are_kept_for_showing(self, tmp_path: Path) -> None:
        scenario = small(tmp_path)
        assert (scenario.length_unit, scenario.robots.speed_unit, scenario.robots.stores[0].unit) == ("km", "m/s", "%")

    def test_the_name_is_that_of_the_folder(self, tmp_path: Path) -> None:
        folder = tmp_path / "pond"
        folder.mkdir()
        write(folder)
        assert load(folder).name == "pond"

    def test_commands_and_noise(self, tmp_path: Path) -> None:
        more = '\n[noise]\nx = "3m"\nbattery = "1%"\n\n[[commands]]\ntitle = "Rest"\ntext = "(ST)"\n'
        scenario = small(tmp_path, more=more)
        assert scenario.noise == {"x": 3.0, "battery": 0.01}
        assert [(command.title, command.text) for command in scenario.commands] == [("Rest", "(ST)")]


MISTAKES = [
    # what is replaced, by what, the line and key of the error, and what it must say
    ("width", "widht", 9, "world.widht", "unknown key (did you mean width?)"),
    ('width = "1km"\n', "", 8, "world.width", "is missing"),
    ('"1km"\nheight', '"1kn"\nheight', 9, "world.width", 'wanted a length such as "5m", not "1kn", a speed'),
    ('"1km"\nheight', '"1kmh"\nheight', 9, "world.width", 'unknown unit in "1kmh" (did you mean km?)'),
    ('"1km"\nheight', '"wide"\nheight', 9, "world.width", 'wanted a length such as "5m", not "wide"'),
    ('"1km"\nheight', '"0km"\nheight', 9, "world.width", 'from 1e-06m to 10000km, not "0km"'),
    ("count = 20", "count = 0", 18, "robots.count", "wanted a whole number from 1 to 1000000, not 0"),
    ("count = 20", 'count = "many"', 18, "robots.count", 'not "many"'),
    ("count = 20", "count = true", 18, "robots.count", "not true"),
    ("count = 20", "count = 1000001", 18, "robots.count", "not 1000001"),
    ('motion = "still"', 'motion = "wonder"', 19, "robots.motion", "(did you mean wander?)"),
    ("seed = 3", "seed = -3", 6, "seed", "wanted a whole number from 0 to"),
    ("seed = 3", "sed = 3", 6, "sed", "unknown key (did you mean seed?)"),
    ("format = 1", "format = 3", 2, "format", "format 3 is newer than this sleepcast, which reads format 2"),
    ("format = 1\n", "", 1, "format", "is missing"),
    ('x = "500m"', 'x = "5km"', 13, "places.house.x", 'from 0km to 1km, not "5km"'),
    ("[places.house]", "[places.2nd]", 12, "places.2nd", '"2nd" is no name'),
    ("[places.house]", "[place.house]", 12, "place", "unknown key (did you mean places?)"),
    ('["20%", "100%"]', '["100%", "20%"]', 32, "robots.stores.battery.start", "wanted the least before the greatest"),
    ('["20%", "100%"]', '["20%"]', 32, "robots.stores.battery.start", 'not ["20%"]'),
    ('["20%", "100%"]', '["20kg", "100%"]', 32, "robots.stores.battery.start", "wanted the same unit for both"),
    ("stores.battery", "stores.speed", 31, "robots.stores.speed", "has a variable of this name already"),
    ("stores.battery", "stores.house_x", 31, "robots.stores.house_x", "has a variable of this name already"),
    ('delay = "0s"', 'loss = "130%"', 36, "radio.loss", 'from 0% to 100%, not "130%"'),
    ('delay = "0s"', "operator = [0, 0]", 35, "radio.operator_reach", "is missing"),
    ('delay = "0s"', "operator = [0]", 36, "radio.operator", "a list of x and y"),
    ('title = "a small world"', "title = 5", 3, "title", "wanted a text in quotes, not 5"),
    ("[radio]", "[[radio]]", 35, "radio", "wanted a table [radio], not"),
    ("sonars = 16\n", "sonars = 16\nsonar_range = 0\nlength = 3\n", 0, "", "Cannot overwrite a value"),
    ("seed = 3", 'seed = 3\nmission = "no.sleep"', 7, "mission", "there is no file"),
    ("seed = 3", f'seed = 3\nmission = "{"m" * 300}"', 7, "mission", "there is no file"),
    ('width = "1km"', 'map = "lab.yaml"', 9, "world.map.file", "there is no file"),
    ('width = "1km"', 'drawing = "."', 9, "world.drawing.file", "there is no file"),
    ('width = "1km"', 'width = "1km"\nrooms = { size = "0.1m", door = 0 }', 10, "world.rooms", "10000 by 10000 rooms"),
    ("[robots]\n", '[robots]\nlike = "mower.toml"\n', 17, "robots.like", "there is no file"),
    ('type = "rover"', 'type = "2nd rover"', 17, "robots.type", '"2nd rover" is no name'),
    ("[robots]\n", "[places.House]\nx = 1\ny = 2\n[robots]\n", 16, "places.House", "is called house already"),
    ('"20km"', '"20km"\nfull = "3kg"', 34, "robots.stores.battery.full", 'a plain number, not "3kg", a mass'),
    ("[radio]", '[noise]\nbattery = "2m"\n[radio]', 36, "noise.battery", 'a plain number, not "2m", a length'),
    ("tick =", "tick ", 5, "", "not TOML"),
]


@pytest.mark.parametrize(("old", "new", "line", "key", "said"), MISTAKES, ids=lambda value: str(value)[:24])
def test_a_mistake_is_told_with_its_place(tmp_path: Path, old: str, new: str, line: int, key: str, said: str) -> None:
    file = write(tmp_path, (old, new))
    with pytest.raises(SettingsError) as caught:
        load(file)
    text = str(caught.value)
    assert text.startswith(f"{file}:{line}: {key}" if line else f"{file}:"), text
    assert said in text
    assert caught.value.exit_status == 2


WORLD = """
[[world.polygons]]
corners = [["24in", "48in"], ["10m", "2m"], ["8m", "9m"]]

[[world.circles]]
center = ["500m", "400m"]
radius = "12m"

[robots.wheels]
track = "0.4m"

[robots.sonar]
order = [0, 2, 1]
pause = "24ms"
"""
NO_SECTORS = ('sonars = 16\nsonar_range = "100m"\n', "")
SOLID_MISTAKES = [
    ('"48in"]', '"48in", "1m"]', "world.polygons[0].corners.point 1", "a list of x and y"),
    ('"24in"', '"-24in"', "world.polygons[0].corners.point 1", 'from 0in to 39370.1in, not "-24in"'),
    (', ["8m", "9m"]', "", "world.polygons[0].corners", "a list of 3 to 10000 points"),
    ('["8m", "9m"]', '["10m", "2m"]', "world.polygons[0].corners", "the same point twice in a row"),
    ('["8m", "9m"]', '["24in", "48in"]', "world.polygons[0].corners", "or the first one again at its end"),
    ('"12m"', '"0m"', "world.circles[0].radius", 'not "0m"'),
    ("radius = ", "radios = ", "world.circles[0].radios", "(did you mean radius?)"),
    ('"0.4m"', '"0.4s"', "robots.wheels.track", "wanted a length"),
    ("track", "slip", "robots.wheels.track", "is missing"),
    ("[0, 2, 1]", "[0, 16]", "robots.sonar.order.number 2", "wanted a whole number from 0 to 15, not 16"),
    ("[0, 2, 1]", "[]", "robots.sonar.order", "a list of 1 to 256 whole numbers"),
    ('pause = "24ms"', 'beam = "120deg"', "robots.sonar.beam", 'not "120deg"'),
    ('pause = "24ms"', 'least = "1m"\nrange = "90cm"', "robots.sonar.range", 'not "90cm"'),
]


class TestSolidWorlds:
    def test_shapes_and_robots_are_read(self, tmp_path: Path) -> None:
        scenario = small(tmp_path, NO_SECTORS, more=WORLD)
        polygon, circle = scenario.shapes
        assert isinstance(polygon, Polygon)
        assert polygon.corners[0] == pytest.approx((24 * 0.0254, 48 * 0.0254))
        assert circle == Circle(500.0, 400.0, 12.0)
        assert scenario.robots.wheels == Wheels(0.4)
        assert scenario.robots.ring is not None
        assert (scenario.robots.ring.order, scenario.robots.ring.count) == ((0, 2, 1), 16)
        assert scenario.robots.geometry.sonars == 16

    @pytest.mark.parametrize(("old", "new", "key", "said"), SOLID_MISTAKES, ids=lambda value: str(value)[:24])
    def test_a_mistake_is_told_with_its_place(self, tmp_path: Path, old: str, new: str, key: str, said: str) -> None:
        assert old in WORLD
        file = write(tmp_path, NO_SECTORS, more=WORLD.replace(old, new, 1))
        with pytest.raises(SettingsError) as caught:
            load(file)
        line, _, rest = str(caught.value).removeprefix(f"{file}:").partition(": ")
        assert rest.startswith(f"{key}: ")
        assert said in rest
        written = file.read_text().split("\n")[int(line) - 1]
        assert key.split(".")[2].split()[0] in written or "is missing" in said

    def test_a_world_has_one_sort_of_size_and_a_robot_one_sort_of_sonar(self, tmp_path: Path) -> None:
        with pytest.raises(SettingsError, match=r"world.width: a world has either width and height or area_per_robot"):
            small(tmp_path, ('width = "1km"', 'width = "1km"\narea_per_robot = 4'))
        with pytest.raises(SettingsError, match=r"robots.sonar: a robot has either sonars of"):
            small(tmp_path, more=WORLD)

    def test_a_store_may_not_be_called_like_a_sonar(self, tmp_path: Path) -> None:
        with pytest.raises(SettingsError, match="has a variable of this name already"):
            small(tmp_path, ("stores.battery", "stores.sonar3"))


@pytest.mark.parametrize(
    ("raw", "said"),
    [(b"\xff\xfe", "not UTF-8"), (b"x" * 1_048_577, "too long"), (b"a = 1\nb = [\n", ":3: not TOML")],
    ids=["binary", "huge", "cut"],
)
def test_a_file_that_is_no_settings_file(tmp_path: Path, raw: bytes, said: str) -> None:
    file = tmp_path / "scenario.toml"
    file.write_bytes(raw)
    with pytest.raises(SettingsError) as caught:
        load(file)
    assert said in str(caught.value)


def test_a_thing_that_is_absent_at_first_is_looked_at_all_the_same(tmp_path: Path) -> None:
    """Else a run would end where it is to be added."""
    door = '[[world.walls]]\nname = "door"\nabsent = true\npoints = [[1, 1], [1, 1]]\n'
    with pytest.raises(SettingsError, match=r"world.walls\[0\].points: a wall with the same point twice in a row: "):
        small(tmp_path, more=door + '[[events]]\nat = "1s"\nadd = "door"\n')


def test_the_mark_that_some_editors_put_before_a_text_is_no_part_of_it(tmp_path: Path) -> None:
    script = tmp_path / "m.sleep"
    script.write_text("@1s (ST)\n", encoding="utf-8-sig")
    file = write(tmp_path, ("seed = 3", 'seed = 3\nmission = "m.sleep"'))
    file.write_text(file.read_text(), encoding="utf-8-sig")
    assert [order.text for order in load(file).mission] == ["(ST)"]


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"nowhere.toml: cannot be read: No such file"):
        load(tmp_path / "nowhere.toml")


def test_an_unknown_key_lists_what_is_known(tmp_path: Path) -> None:
    file = write(tmp_path, ("[radio]", "[radio]\nquality = 3"))
    with pytest.raises(SettingsError, match=r"known here: delay, duplication, .*, telemetry"):
        load(file)


def test_a_mistake_in_one_of_several_commands(tmp_path: Path) -> None:
    more = '\n[[commands]]\ntitle = "Rest"\ntext = "(ST)"\n\n[[commands]]\ntitle = "Go"\ntexts = "(ST)"\n'
    file = write(tmp_path, more=more)
    line = SMALL.count("\n") + 8
    with pytest.raises(SettingsError, match=rf":{line}: commands\[1\]\.texts: unknown key \(did you mean text\?\)"):
        load(file)


class TestKeyLines:
    def test_keys_of_every_sort_are_found(self) -> None:
        text = 'a = 1\n[t]\n"b c" = 2\nd.e = 3\n[[u]]\nf = 4\n[[u]]\n  f = 5 # here\n[t.v]\ng = 6'
        assert key_lines(text) == {
            ("a",): 1,
            ("t",): 2,
            ("t", "b c"): 3,
            ("t", "d", "e"): 4,
            ("u",): 5,
            ("u", 0): 5,
            ("u", 0, "f"): 6,
            ("u", 1): 7,
            ("u", 1, "f"): 8,
            ("t", "v"): 9,
            ("t", "v", "g"): 10,
        }

    def test_a_text_of_several_lines_has_no_keys(self) -> None:
        assert key_lines('a = """\nb = 1\n"""\nc = 2') == {("a",): 1, ("c",): 4}


class TestGallery:
    def test_it_has_bravo_and_its_kin(self) -> None:
        assert {"braitenberg", "bravo", "flood"} <= set(scenario_names())

    @pytest.mark.parametrize("name", scenario_names())
    def test_every_scenario_loads_and_has_a_page(self, name: str) -> None:
        scenario = find_scenario(name)
        assert scenario.name == name
        assert scenario.title
        assert (scenario.path.parent / "README.md").is_file()

    def test_a_path_is_a_scenario_as_well(self, tmp_path: Path) -> None:
        assert find_scenario(str(write(tmp_path))).title == "a small world"
        assert find_scenario(str(tmp_path)).title == "a small world"

    def test_an_unknown_name_is_refused_with_the_nearest(self) -> None:
        with pytest.raises(MisuseError, match=r'no scenario "brave" \(did you mean bravo\?\): wanted one of .*bravo, '):
            find_scenario("brave")


@pytest.mark.parametrize("robots", [0, -1, MAX_ROBOTS + 1])
def test_no_run_has_an_impossible_number_of_robots(robots: int) -> None:
    with pytest.raises(MisuseError, match=f"^robots {robots}: wanted a whole number from 1 to"):
        find_scenario("crowd", Changes(robots=robots))


@pytest.mark.parametrize("own", [None, 8])
def test_the_scenario_of_each_seed_is_that_which_is_found_with_it(tmp_path: Path, own: int | None) -> None:
    maze = '\n[world.maze]\ncell = "100m"\n' + ("" if own is None else f"seed = {own}\n")
    name, changes = str(write(tmp_path, more=maze)), Changes(over=(("robots.count", 12),))
    of_seed = ScenarioOfSeeds(name, changes)
    for seed in (3, 4, 3):
        assert of_seed[seed] == find_scenario(name, replace(changes, seed=seed))
    assert (of_seed[3].shapes == of_seed[4].shapes) == (own is not None)
