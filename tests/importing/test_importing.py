"""Files of other programs become scenarios that open: own small ones of each kind, and what is wrong in them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from math import degrees, radians
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import sleepcast as sc
from sleepcast.api.assembly import assemble
from sleepcast.core.errors import MisuseError
from sleepcast.core.settings import SettingsError
from sleepcast.importing import READERS, read_foreign
from sleepcast.importing.folder import write_folder
from sleepcast.importing.found import Disc, Found, Outline
from sleepcast.simulator import find_scenario
from sleepcast.simulator.scenario.scenario import Scenario

ARGOS = """<?xml version="1.0" ?>
<argos-configuration>
  <framework><experiment length="30" ticks_per_second="5" random_seed="7" /></framework>
  <controllers><a_controller id="c"><sensors><range_and_bearing implementation="any" /></sensors></a_controller>
  </controllers>
  <arena size="6, 4, 1" center="1,0,0.5">
    <box id="wall" size="2,0.2,0.5" movable="false"><body position="3,1,0" orientation="90,0,0" /></box>
    <cylinder id="post" radius="0.3" height="1" movable="true"><body position="-1,-1,0" orientation="0,0,0" />
    </cylinder>
    <light id="lamp" position="2,-1,0.5" orientation="0,0,0" color="yellow" intensity="1" medium="leds" />
    <foot-bot id="one" rab_range="2"><body position="0,0,0" orientation="45,0,0" /><controller config="c" /></foot-bot>
    <distribute>
      <position method="grid" center="2,1,0" distances="0.5,0.4,1" layout="2,2,1" />
      <orientation method="constant" values="180,0,0" />
      <entity quantity="3" max_trials="1" base_num="5"><pipuck id="e"><controller config="c" /></pipuck></entity>
    </distribute>
    <distribute>
      <position method="uniform" min="-9,-1,0" max="0,1,0" /><orientation method="uniform" min="0,0,0" max="360,0,0" />
      <entity quantity="4" max_trials="9"><kilobot id="k"><controller config="c" /></kilobot></entity>
    </distribute>
  </arena>
</argos-configuration>
"""
STAGE = """# a room
include "robots.inc"
resolution 0.02
window ( size [ 600 400 ] scale 20 )
define floorplan model ( boundary 1 ranger_return 0.5 )
floorplan ( name "room" size [8.000 4.000 0.8] pose [2 0 0 0] bitmap "room.png" )
floorplan ( size [ 1 1 1 ] pose [ 9 9 0 0 ] bitmap "lost.png" )
model ( size [2 1 1] pose [0 5 0 90] block( points 3 point[0] [0 0] point[1] [4 0] point[2] [0 4] z [0 1] ) )
zone ( name "home" pose [ -1 -1 0 0 ] size [ 1 2 0 ] )
rover ( name "r0" pose [ 1 0 0 90 ] ctrl "wander" )
rover ( name "r1" pose [ 3 0 0 -90 ] )
nobody ( pose [0 0 0 0] )
"""
ROBOTS = """
define zone model ( obstacle_return 0 ranger_return -1 )
define eyes ranger ( sensor ( range [0 5] ) )
define rover position ( size [0.4 0.3 0.2] velocity_bounds [-0.5 0.5 0 0 0 0 -90 90] eyes ( pose [0 0 0 0] ) )
"""
CRAZYFLIES = """
fileversion: 3
robots:
  cf1: {enabled: true, uri: "radio://0/80/2M/E7E7E7E701", initial_position: [0.0, 0.5, 0.0], type: cf21}
  cf2: {enabled: false, initial_position: [1, 0, 0], type: cf21}
  cf3: {enabled: true, initial_position: [-1, 0.25, 0.3], type: bolt}
all: {broadcasts: {num_repeats: 15}}
"""
PLAN = """
{"fileType": "Plan", "version": 1, "groundStation": "QGroundControl",
 "geoFence": {"version": 2, "circles": [{"circle": {"center": [47.3980, 8.5456], "radius": 30}, "inclusion": false}],
   "polygons": [{"inclusion": true, "polygon": [[47.397, 8.544], [47.399, 8.544], [47.399, 8.547]]}]},
 "rallyPoints": {"version": 2, "points": [[47.3978, 8.5450, 50]]},
 "mission": {"version": 2, "vehicleType": 10, "plannedHomePosition": [47.3977, 8.5456, 488], "items": [
   {"type": "SimpleItem", "command": 22, "params": [0, 0, 0, null, 47.3977, 8.5456, 10]},
   {"type": "SimpleItem", "command": 178, "params": [1, 5, 0, 0, 0, 0, 0]},
   {"type": "ComplexItem", "complexItemType": "survey", "TransectStyleComplexItem": {"Items": [
     {"type": "SimpleItem", "command": 16, "params": [0, 0, 0, null, 47.3981, 8.5461, 10]}]}},
   {"type": "SimpleItem", "command": 20, "params": [0, 0, 0, 0, 0, 0, 0]}]}}
"""
WAYPOINTS = """QGC WPL 110
# a comment
0\t1\t0\t16\t0\t0\t0\t0\t-35.3632\t149.1652\t584\t1
1\t0\t3\t22\t0\t0\t0\t0\t0\t0\t20\t1

2\t0\t3\t16\t0\t0\t0\t0\t-35.3622\t149.1652\t20\t1
3\t0\t3\t5001\t5\t0\t0\t0\t-35.361\t149.164\t0\t1
4\t0\t3\t5001\t5\t0\t0\t0\t-35.361\t149.166\t0\t1
5\t0\t3\t5001\t5\t0\t0\t0\t-35.364\t149.166\t0\t1
6\t0\t3\t20\t0\t0\t0\t0\t0\t0\t0\t1
"""
MAVPROXY_FENCE = """QGC WPL 110
0\t0\t0\t5001\t4.000000\t0.000000\t0.000000\t0.000000\t-35.363000\t149.164000\t0.000000\t1
1\t0\t0\t5001\t4.000000\t0.000000\t0.000000\t0.000000\t-35.363000\t149.167000\t0.000000\t1
2\t0\t0\t5001\t4.000000\t0.000000\t0.000000\t0.000000\t-35.365000\t149.167000\t0.000000\t1
3\t0\t0\t5001\t4.000000\t0.000000\t0.000000\t0.000000\t-35.365000\t149.164000\t0.000000\t1
4\t0\t0\t5004\t30.000000\t0.000000\t0.000000\t0.000000\t-35.364000\t149.165500\t0.000000\t1
"""
MAVPROXY_RALLY = """QGC WPL 110
0\t0\t3\t5100\t0.000000\t0.000000\t0.000000\t0.000000\t-35.363000\t149.164000\t50.000000\t1
1\t0\t3\t5100\t0.000000\t0.000000\t0.000000\t0.000000\t-35.363000\t149.167000\t50.000000\t1
"""
Import = Callable[[str, str], tuple[Found, Scenario]]


@pytest.fixture
def imported(tmp_path: Path) -> Import:
    """Writes a file, imports it and opens the scenario."""

    def make(name: str, text: str) -> tuple[Found, Scenario]:
        (tmp_path / name).write_text(text)
        found, folder = read_foreign(tmp_path / name), tmp_path / "made"
        write_folder(found, folder, _opened)
        return found, find_scenario(str(folder))

    return make


def _opened(folder: Path) -> object:
    return assemble(find_scenario(str(folder)), None, mission=True)


def starts(scenario: Scenario) -> dict[str, tuple[float, float, float]]:
    """Where robots start in a fleet of the scenario: by name, x, y in m and heading in degrees."""
    fleet = sc.open(scenario.path.parent)
    poses = zip(fleet.names, fleet.x, fleet.y, fleet.heading, strict=True)
    return {name: (round(float(x), 3), round(float(y), 3), round(degrees(turn), 3)) for name, x, y, turn in poses}


def test_an_experiment_of_argos(imported: Import) -> None:
    found, scenario = imported("small.argos", ARGOS)
    assert (scenario.width, scenario.height, scenario.tick, scenario.seconds, scenario.seed) == (6.0, 4.0, 0.2, 30.0, 7)
    assert [each.type for each in found.robots] == ["foot-bot", "pipuck", "kilobot"]
    assert found.robots[2].box == ((-2.0, -1.0), (0.0, 1.0)), "no farther than the arena"
    wall = next(each for each in found.solids if isinstance(each, Outline))
    assert max(x for x, _ in wall.corners) == pytest.approx(3.1), "turned by 90 degrees, it stands upright"
    assert scenario.neighbours is not None
    assert scenario.neighbours.reach == 2.0
    assert scenario.sight.neighbours, "its walls hide, as those of ARGoS do"
    assert [light.name for light in scenario.lights] == ["lamp"]
    at = starts(scenario)
    assert at["one"] == (2.0, 2.0, 45.0)
    assert at["e5"][:2] == (4.25, 3.2), "a grid begins at its upper right corner"
    assert (at["e6"][:2], at["e7"][:2]) == ((3.75, 3.2), (4.25, 2.8))
    assert found.robots[1].hardware.track, "a robot that is known"
    assert any("movable <cylinder>" in each for each in found.left_out())
    assert not any("random_seed" in each for each in found.left_out())


def test_obstacles_by_chance_are_the_same_each_time(tmp_path: Path) -> None:
    text = """<argos-configuration><arena size="9,9,1"><distribute>
    <position method="uniform" min="-4,-4,0" max="4,4,0"/>
    <orientation method="uniform" min="0,0,0" max="360,0,0"/><entity quantity="5" max_trials="100">
    <cylinder id="c" radius="0.5" height="1"/></entity></distribute></arena></argos-configuration>"""
    (tmp_path / "chance.argos").write_text(text)
    first, second = read_foreign(tmp_path / "chance.argos"), read_foreign(tmp_path / "chance.argos")
    assert first.solids == second.solids
    assert len({each.center for each in first.solids if isinstance(each, Disc)}) == 5


@pytest.mark.parametrize("seed", ["", 'random_seed="0"'])
def test_an_experiment_without_a_seed_is_repeated_with_one(imported: Import, seed: str) -> None:
    robot = '<foot-bot id="f"><body position="0,0,0"/><controller config="c"/></foot-bot>'
    found, scenario = imported(
        "any.argos",
        f'<argos-configuration><framework><experiment length="9" {seed}/></framework>'
        f'<arena size="2,2,1">{robot}</arena></argos-configuration>',
    )
    assert scenario.seed == 0
    assert any(each.startswith("random_seed 0: ARGoS draws another one for each run") for each in found.left_out())


def test_a_world_of_stage(imported: Import, tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    (tmp_path / "robots.inc").write_text(ROBOTS)
    picture = image.new("RGB", (100, 60), "white")
    picture.paste((100, 255, 255), (20, 10, 100, 20))  # dark by its red, and 80 by 50 pixels with the one below
    picture.paste((0, 0, 0), (20, 50, 30, 60))
    picture.save(tmp_path / "room.png")
    found, scenario = imported("room.world", STAGE)
    assert found.cells is not None
    left, right = min(x for x, _ in found.cells.corners()), max(x for x, _ in found.cells.corners())
    assert (left, right) == (pytest.approx(-2.0), pytest.approx(6.0)), "what is dark is 8 m wide, the margin is not"
    block = next(each for each in found.solids if isinstance(each, Outline) and len(each.corners) == 3)
    assert max(y for _, y in block.corners) - min(y for _, y in block.corners) == pytest.approx(2.0)
    around = next(each for each in found.solids if isinstance(each, Outline) and not each.closed)
    assert len(around.corners) == 5, "a boundary is a wall, and no area"
    assert [each.name for each in scenario.areas] == ["home"]
    at = starts(scenario)
    assert (at["r1"][0] - at["r0"][0], at["r0"][2], at["r1"][2]) == (2.0, 90.0, -90.0)
    said = "\n".join(found.left_out())
    for part in ("ctrl wander", "ranger of rover (2 times)", "bitmap 'lost.png'", "nobody: no model of this name"):
        assert part in said


RANGERS = """
define sick ranger ( sensor ( range [0.1 8] fov 180 samples 181 noise [0.01 0 0] pose [0 0 0 10] ) )
define ring ranger ( sonar ( pose [0 0 0 0] ) sonar ( pose [0 0 0 90] ) )
define sonar sensor ( range [0 5] samples 1 )
define rover position ( size [0.4 0.4 0.2] sick ( pose [0.1 0 0 20] ) ring () )
rover ( pose [0 0 0 0] )
"""


def test_rangers_of_stage(imported: Import) -> None:
    found, scenario = imported("a.world", RANGERS)
    laser = scenario.laser
    assert laser is not None
    assert (laser.beams, laser.reach, laser.least) == (181, 8.0, 0.0)
    assert (laser.first, laser.last) == (pytest.approx(radians(-60.0)), pytest.approx(radians(120.0)))
    assert laser.noise == pytest.approx(0.1), "what stands there is a variance"
    said = "\n".join(found.left_out())
    for part in ("a ranger that is not in the middle of its robot: it is here", "ranger of rover: give robots a"):
        assert part in said


def test_other_rangers_of_stage(imported: Import) -> None:
    around = "fov 360 samples 361"
    found, scenario = imported("a.world", RANGERS.replace("fov 180 samples 181", around) + OTHERS)
    assert scenario.laser is not None
    assert scenario.laser.closed
    assert scenario.laser.beams == 360, "Stage measures ahead of its last beam once more"
    said = "\n".join(found.left_out())
    assert "another ranger of second (2 times): a scenario has one kind of scanner" in said
    assert "robots without a ranger: they have one here: a scenario's scanner is that of all" in said


@pytest.mark.parametrize(
    ("sensor", "beams", "first", "last"),
    [
        ("fov 359 samples 360", 360, -149.5, 209.5),
        ("fov 360 samples 361", 360, -150.0, 209.0),
        ("fov 180 samples 2", 2, -60.0, 120.0),
        ("fov 359.99999999 samples 361", 360, -150.0, 209.0),
        ("fov 359.9999 samples 361", 361, -149.99995, 209.99995),
        ("fov 90 samples 10 range [0 1e12]", 10, -15.0, 75.0),
    ],
)
def test_beams_of_rangers_of_stage_look_where_they_did(
    imported: Import, sensor: str, beams: int, first: float, last: float
) -> None:
    laser = imported("a.world", RANGERS.replace("fov 180 samples 181", sensor))[1].laser
    assert laser is not None
    assert laser.beams == beams
    assert (degrees(laser.first), degrees(laser.last)) == pytest.approx((first, last), abs=1e-5)


def test_a_ranger_that_reaches_nowhere_is_none(imported: Import) -> None:
    assert imported("a.world", RANGERS.replace("range [0.1 8]", "range [0 1e-7]"))[1].laser is None


OTHERS = """
define second position ( size [0.4 0.4 0.2] ranger ( sensor ( samples 5000 fov 90 ) ) )
second ( pose [2 0 0 0] )
second ( pose [4 0 0 0] )
position ( pose [6 0 0 0] )
"""


@pytest.mark.parametrize("wrong", ["samples many", "fov inf", "range [0 wide]", "noise 0.1"])
def test_a_ranger_without_its_numbers(tmp_path: Path, wrong: str) -> None:
    path = tmp_path / "a.world"
    path.write_text(f"position ( ranger ( sensor ( samples 10 fov 90 {wrong} ) ) )")
    with pytest.raises(SettingsError, match=rf"a.world:1: {wrong.split()[0]}: wanted "):
        read_foreign(path)


def test_a_fleet_of_crazyswarm2(imported: Import) -> None:
    pytest.importorskip("yaml")
    found, scenario = imported("crazyflies.yaml", CRAZYFLIES)
    at = starts(scenario)
    assert set(at) == {"cf1", "cf3"}
    assert (at["cf1"][0] - at["cf3"][0], at["cf1"][1] - at["cf3"][1]) == (1.0, 0.25)
    assert "robots that are not enabled: they are not there" in found.left_out()
    with sc.open(scenario.path.parent) as fleet:
        assert fleet.send("(WHEN (NOT flying) (TAKEOFF 1m))").matched == ("cf1", "cf3")
        assert fleet.run("4s", quiet=True)["z"].tolist() == pytest.approx([1.0, 1.0])


def test_a_plan_of_qgroundcontrol(imported: Import) -> None:
    pytest.importorskip("pyproj")
    found, scenario = imported("field.plan", PLAN)
    assert found.route == ["wp1", "wp2", "home"]
    (hx, hy), (x, y) = found.places["home"][0], found.places["wp2"][0]
    assert (x - hx, y - hy) == (pytest.approx(37.8, abs=0.1), pytest.approx(44.5, abs=0.1))
    assert {each.name for each in scenario.areas} == {"fence1", "keep_out2"}
    assert "rally1" in found.places
    assert list(starts(scenario)) == ["rover1"]


def test_waypoints_are_visited(imported: Import) -> None:
    pytest.importorskip("pyproj")
    found, scenario = imported("square.waypoints", WAYPOINTS)
    assert found.route == ["wp1", "home"]
    assert list(found.areas) == ["fence1"], "of the five corners that it speaks of, three are there"
    fleet = sc.open(scenario.path.parent, mission=True)
    start, farthest = float(fleet.y[0]), 0.0
    for _ in range(70):
        fleet.run(1)
        farthest = max(farthest, float(fleet.y[0]) - start)
    assert farthest == pytest.approx(111.0, abs=2.0)
    assert float(fleet.y[0]) - start == pytest.approx(0.0, abs=3.0)


def test_a_fence_of_mavproxy_has_no_home(imported: Import) -> None:
    pytest.importorskip("pyproj")
    found, scenario = imported("fence.txt", MAVPROXY_FENCE)
    assert [len(each) for each in found.areas.values() if isinstance(each, tuple)] == [4]
    assert {each.name for each in scenario.areas} == {"fence1", "keep_out2"}
    circle = found.areas["keep_out2"]
    assert isinstance(circle, Disc)
    assert circle.center == pytest.approx((0.0, 0.0), abs=0.01), "home is in the middle"
    assert any(each.startswith("home: the file has none") for each in found.left_out())


def test_rally_points_of_mavproxy_have_no_home(imported: Import) -> None:
    pytest.importorskip("pyproj")
    found, _ = imported("rally.txt", MAVPROXY_RALLY)
    assert list(found.places) == ["home", "rally1", "rally2"]
    assert found.places["rally1"][0][0] == pytest.approx(-136.0, abs=1.0)


def test_robots_that_overlap_at_the_start_touch_nothing(imported: Import) -> None:
    robots = "".join(
        f'<foot-bot id="f{i}"><body position="0.0{i},0,0"/><controller config="c"/></foot-bot>' for i in (1, 2)
    )
    found, scenario = imported(
        "near.argos", f'<argos-configuration><arena size="2,2,1">{robots}</arena></argos-configuration>'
    )
    assert not scenario.robots.bumpers
    assert any(each.startswith("contact: bodies touch nothing here") for each in found.left_out())


def test_more_types_than_a_scenario_has_are_joined_where_bodies_are_equal(imported: Import) -> None:
    text = "".join(f"define kind{i} position ( size [0.2 0.2 0.2] )\nkind{i} ( pose [{i} 0 0 0] )\n" for i in range(10))
    found, scenario = imported("many.world", text)
    assert len(starts(scenario)) == 10
    assert len(found.robots) == 1


@pytest.mark.parametrize(
    ("name", "text", "sentence"),
    [
        ("a.doc", "", "nobody here reads such files: wanted one of *.argos"),
        ("a.txt", "", "no waypoints: wanted QGC WPL 110"),
        ("a.argos", "", "not XML"),
        ("a.argos", "<svg/>", "no experiment of ARGoS"),
        ("a.argos", '<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "declares an entity"),
        (
            "a.argos",
            '<argos-configuration><arena size="1,2"/></argos-configuration>',
            "a.argos:1: <arena> size: wanted 3 numbers",
        ),
        ("a.world", "position ( pose [0 0 0", "a bracket is not closed"),
        ("a.world", 'position ( name "r ', "a quotation mark without its other one"),
        ("a.world", "size [1 1 1]", "neither walls nor robots"),
        ("a.world", 'include "a.world"', "include one another"),
        ("a.yaml", "robots: {a: {enabled: true, initial_position: [0, x, 0]}}", "robots.a.initial_position: wanted"),
        ("a.yaml", "a: &a 1\nb: *a", "it has aliases"),
        ("a.yaml", "robots: {a: {enabled: false}}", "none of 1 is enabled"),
        ("a.plan", "{", "not JSON"),
        ("a.plan", "{}", "no plan of QGroundControl"),
        ("a.plan", '{"fileType": "Plan", "mission": {"items": [3]}}', "wanted items, not 3"),
        ("a.waypoints", "QGC WPL 110\n1 2 3", "a.waypoints:2: wanted twelve numbers"),
        ("a.waypoints", "QGC WPL 120", "wanted QGC WPL 110"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, name: str, text: str, sentence: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(MisuseError) as caught:
        read_foreign(tmp_path / name)
    assert sentence in str(caught.value)


def test_nothing_is_left_of_a_scenario_that_cannot_be_opened(tmp_path: Path) -> None:
    (tmp_path / "a.world").write_text("position ( pose [0 0 0 0] )")

    def refuse(_: Path) -> None:
        raise MisuseError("it cannot be opened")

    with pytest.raises(MisuseError, match="a: it makes no scenario"):
        write_folder(read_foreign(tmp_path / "a.world"), tmp_path / "made", refuse)
    assert [each.name for each in tmp_path.iterdir()] == ["a.world"]


def test_a_folder_that_is_there_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "a.world").write_text("position ( pose [0 0 0 0] )")
    with pytest.raises(MisuseError, match="is there already"):
        write_folder(read_foreign(tmp_path / "a.world"), tmp_path, _opened)


WORDS = st.sampled_from(
    [
        *(ARGOS, STAGE, CRAZYFLIES, PLAN, WAYPOINTS, "(", ")", "[", "]", "define", "position", "pose", "1e999", "nan"),
        *('"', "<", ">", "<arena", "/>", "{", "}", ":", ",", "null", "\x00", "\n", "QGC WPL 110\n", "16 " * 12, "-1"),
    ]
)


@given(st.sampled_from(sorted(READERS)), st.lists(st.one_of(WORDS, st.text(max_size=20)), max_size=12), st.data())
def test_any_file_is_read_or_refused_in_a_sentence(
    tmp_path_factory: pytest.TempPathFactory, ending: str, parts: list[str], data: st.DataObject
) -> None:
    text = "".join(parts)
    cut = data.draw(st.integers(0, len(text)))
    file = tmp_path_factory.mktemp("fuzz") / f"a{ending}"
    file.write_text(text[:cut], encoding="utf-8", errors="surrogatepass")
    with suppress(MisuseError):  # a sentence; nothing else comes out
        read_foreign(file)
