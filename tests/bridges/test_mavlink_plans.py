"""Plans: read from a folder, looked at as a whole, written to the vehicle, and flown."""

from __future__ import annotations

import json
from contextlib import closing
from math import inf, nan
from pathlib import Path

import pytest

pytest.importorskip("pymavlink")
pytest.importorskip("pyproj")

from bridges.mavlink_vehicle import AUTOS, EARTH, GROUND, HOME
from bridges.mind import Mind
from bridges.test_mavlink import MavlinkRig, Process, Ticks
from processes import live_in
from sleepcast.bridges import BodyError
from sleepcast.bridges.mavlink.model import COPTER, PLANE, ROVER
from sleepcast.bridges.mavlink.plans import Plan, read_plans
from sleepcast.core.errors import MisuseError
from sleepcast.core.mission_files import HOMEWARD, LAND, LOITER_TURNS, SPLINE, TAKEOFF, WAYPOINT, Item
from sleepcast.core.settings import SettingsError
from sleepcast.robot import FencedError, Limits

JUMP, SPEED = 177, 178
SQUARE = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
FENCED = Limits(inf, inf, inf, fence=(-5.0, -5.0, 15.0, 15.0))


def at(x: float, y: float) -> tuple[float, float]:
    """Latitude and longitude of a place."""
    longitude, latitude, _ = EARTH.fwd(HOME[1], HOME[0], 90.0, x)
    longitude, latitude, _ = EARTH.fwd(longitude, latitude, 0.0, y)
    return latitude, longitude


def to(x: float, y: float, height: float = 5.0, command: int = WAYPOINT, *parameters: float, frame: int = 3) -> Item:
    first, second, third, fourth = (*parameters, *(0.0,) * (4 - len(parameters)))
    return Item(command, at(x, y), height, frame, (first, second, third, fourth))


def jump(number: float) -> Item:
    return Item(JUMP, None, nan, 2, (number, 2.0, 0.0, 0.0))


def survey(*corners: tuple[float, float], height: float = 5.0) -> Plan:
    way = [to(x, y, height) for x, y in corners]
    return Plan("survey", (Item(TAKEOFF, None, height), *way, Item(LAND, None)))


def flying(*plans: Plan, kind: str = "copter") -> tuple[MavlinkRig, Ticks]:
    """A vehicle, and its mind, that have just met."""
    rig = MavlinkRig(kind, plans=plans or (survey(*SQUARE),))
    mind = Ticks(rig)
    mind.go_on(1.2)
    return rig, mind


def test_a_copter_flies_its_plan_from_the_ground_to_the_ground() -> None:
    rig, mind = flying()
    mind.say("(PLAN survey)")
    mind.go_on(3.0)
    assert [m.command for m in rig.vehicle.stored[0]] == [16, TAKEOFF, *[WAYPOINT] * 4, LAND], "home comes first"
    assert (rig.sensed()["mode"], rig.sensed()["armed"]) == (COPTER["AUTO"], 1.0)
    assert rig.vehicle.fastest == pytest.approx(2.0), "no faster than its limits"
    seen = []
    for _ in range(100):
        mind.go_on(0.5)
        found = rig.sensed()
        seen.append((found["waypoint"], found["plan_progress"]))
        if not found["flying"]:
            break
    assert [number for number, _ in seen if number] == sorted(number for number, _ in seen if number)
    assert {3.0, 4.0, 5.0, 6.0} <= {number for number, _ in seen}
    assert [done for _, done in seen] == sorted(done for _, done in seen)
    assert rig.body.complaints() == []


def test_a_rover_and_a_plane_follow_plans_too() -> None:
    rig, mind = flying(Plan("lap", tuple(to(x, y, nan) for x, y in SQUARE)), kind="rover")
    mind.say("(PLAN lap)")
    mind.go_on(30.0)
    assert (rig.sensed()["mode"], rig.sensed()["plan_progress"], rig.sensed()["waypoint"]) == (ROVER["AUTO"], 1.0, 0.0)
    mind.say("(PLAN lap)")
    mind.go_on(3.0)
    assert rig.sensed()["plan_progress"] < 1.0, "one that is done is begun again"
    way = Item(TAKEOFF, None, 50.0), to(300.0, 0.0, 60.0), to(300.0, 300.0, 60.0)
    rig, mind = flying(Plan("lap", way), kind="plane")
    mind.say("(PLAN lap)")
    mind.go_on(90.0)
    assert (rig.sensed()["mode"], rig.sensed()["plan_progress"]) == (PLANE["AUTO"], 1.0)
    assert rig.sensed()["height"] == pytest.approx(60.0, abs=0.5)
    assert rig.body.complaints() == []


def test_a_rule_that_says_it_in_every_tick_begins_it_once() -> None:
    rig, mind = flying()
    mind.say("(RULE go (WHEN (> battery 50%) (PLAN survey)))")
    mind.go_on(12.0)
    assert [number for number, _ in rig.vehicle.orders if number == 300] == [300]
    assert rig.sensed()["waypoint"] >= 2.0
    rig.vehicle_body.narrow(Limits(inf, inf, inf, fence=(-5.0, -5.0, 5.0, 5.0)))
    rig.vehicle_body.fly_plan(1.0)
    mind.say("(SET_MODE GUIDED)")
    with pytest.raises(FencedError, match="plan survey: item 3 lies outside of the fence"):
        rig.vehicle_body.fly_plan(1.0)


@pytest.mark.parametrize("lost", [1, 2, 5])
def test_what_is_lost_of_a_plan_is_sent_again(lost: int) -> None:
    rig, mind = flying()
    rig.vehicle.forgets = lost
    mind.say("(PLAN survey)")
    mind.go_on(10.0)
    assert [m.seq for m in rig.vehicle.stored[0]] == list(range(7))
    assert rig.sensed()["mode"] == COPTER["AUTO"]
    assert rig.body.complaints() == []


def test_a_last_word_that_is_lost_is_said_again() -> None:
    rig, mind = flying()
    rig.vehicle.swallows = True
    mind.say("(PLAN survey)")
    mind.go_on(8.0)
    assert (len(rig.vehicle.stored[0]), rig.sensed()["mode"]) == (7, COPTER["AUTO"])
    assert rig.body.complaints() == []


def test_a_plan_that_the_vehicle_does_not_take_is_told_and_not_begun() -> None:
    rig, mind = flying()
    rig.vehicle.forgets = 10_000
    mind.say("(PLAN survey)")
    mind.go_on(8.0)
    assert rig.body.complaints() == ["plan survey was not taken: it has not answered for 6 s"]
    assert rig.vehicle.mode != COPTER["AUTO"]
    rig.vehicle.forgets = 0
    mind.say("(PLAN survey)")
    mind.go_on(5.0)
    assert rig.vehicle.mode == COPTER["AUTO"]


@pytest.mark.parametrize("refused", [224, 176, 400, 300])
def test_a_plan_that_it_does_not_begin_is_told(refused: int) -> None:
    rig, mind = flying()
    rig.vehicle.refuse = {refused}
    mind.say("(PLAN survey)")
    mind.go_on(5.0)
    assert any("was answered: denied" in sentence for sentence in rig.body.complaints())
    assert rig.vehicle_body._motion.sort == "rest"


def test_stop_ends_a_plan_also_while_it_is_sent() -> None:
    rig, mind = flying()
    mind.say("(PLAN survey)")
    mind.go_on(10.0)
    rig.body.stop()
    mind.go_on(1.0)
    assert rig.vehicle.mode == COPTER["LOITER"]
    rig.body.release()
    mind.go_on(5.0)
    assert rig.vehicle.mode == COPTER["LOITER"], "nothing old resumes"
    rig, mind = flying()
    rig.vehicle.forgets = 3
    mind.say("(PLAN survey)")
    rig.body.stop()
    mind.go_on(2.0)
    rig.body.release()
    mind.go_on(8.0)
    assert (rig.vehicle.armed, rig.vehicle.mode) == (False, 0)


def test_another_plan_in_the_air_is_not_written_under_the_one_that_is_flown() -> None:
    other = Plan("home", (to(3.0, 3.0),))
    rig, mind = flying(survey(*SQUARE), other)
    mind.say("(PLAN survey)")
    mind.go_on(10.0)
    before = len(rig.vehicle.orders)
    mind.say("(PLAN home)")
    mind.go_on(10.0)
    modes = [mode for number, mode in rig.vehicle.orders[before:] if number == 176]
    assert modes == [COPTER["GUIDED"], COPTER["AUTO"]]
    assert (rig.sensed()["x"], rig.sensed()["y"]) == pytest.approx((3.0, 3.0), abs=1.1)


def test_a_pilot_keeps_what_he_flies() -> None:
    rig, mind = flying()
    mind.say("(PLAN survey)")
    mind.go_on(10.0)
    rig.vehicle.change_mode(COPTER["ALT_HOLD"])
    mind.go_on(3.0)
    assert (rig.vehicle.mode, rig.sensed()["waypoint"]) == (COPTER["ALT_HOLD"], 0.0)
    with pytest.raises(MisuseError, match="somebody else has put it into ALT_HOLD"):
        rig.vehicle_body.fly_plan(1.0)


@pytest.mark.parametrize(
    ("plan", "said"),
    [
        ((to(20.0, 0.0),), "item 1 lies outside of the fence"),
        ((to(10.0, 10.0), to(20.0, 0.0), to(0.0, 0.0)), "item 2 lies outside of the fence"),
        ((to(10.0, 0.0, 5.0, LOITER_TURNS, 1.0, 0.0, 8.0),), r"item 1: its circle of 8 m passes the fence"),
        ((to(10.0, 0.0, 5.0, SPLINE),), "item 1 is a spline, which may swing beyond the fence"),
        ((to(10.0, 0.0, 40.0),), r"item 1 is at 40 m: it flies from 0\.5 to 30 m high"),
        ((to(10.0, 0.0, 0.1),), r"item 1 is at 0\.1 m"),
        ((to(10.0, 0.0, GROUND + 31.0, frame=0),), "item 1 is at 31 m"),
        ((to(10.0, 0.0, 5.0, frame=10),), "item 1 counts its height from the terrain"),
        ((to(10.0, 0.0, nan),), "item 1: nobody knows how high that is"),
        ((Item(TAKEOFF, None, 500.0), to(0.0, 0.0)), "item 1 is at 500 m"),
        ((Item(LOITER_TURNS, None, -3.0), to(0.0, 0.0)), "item 1 is at -3 m"),
        ((Item(SPEED, None, nan, 2, (1.0, 9.0, -1.0, 0.0)),), "item 1 asks for 9 m/s, and 2 are allowed"),
        ((to(2e5, 0.0),), "item 1 is farther than 100000 m"),
    ],
)
def test_a_plan_beyond_the_limits_is_refused_before_anything_is_sent(plan: tuple[Item, ...], said: str) -> None:
    rig, _ = flying(Plan("survey", plan))
    rig.vehicle_body.narrow(FENCED)
    with pytest.raises((FencedError, MisuseError), match=f"plan survey: {said}"):
        rig.vehicle_body.fly_plan(1.0)
    rig.wait(1.0)
    assert not any(kind.startswith("MISSION") for kind in rig.vehicle.heard)


def test_ways_between_places_and_back_lie_within_the_fence_too() -> None:
    """The fence has a notch, and the vehicle starts to the left of it."""
    from sleepcast.core.model import NamedArea

    notch = NamedArea("notch", (4.0, 2.0, 6.0, 2.0, 6.0, 20.0, 4.0, 20.0))
    fenced = Limits(inf, inf, inf, fence=(-5.0, -5.0, 15.0, 15.0), outside=(notch,))
    for plan, said in (
        ((to(10.0, 10.0),), None),  # below the notch
        ((to(0.0, 10.0), to(10.0, 10.0)), "the way to item 2 passes the fence"),
        (
            (
                to(0.0, 10.0),
                to(0.0, 0.0),
                to(10.0, 0.0),
                to(10.0, 10.0),
                jump(1.0),
            ),
            "the way back to item 1",
        ),
        ((to(0.0, 0.0), to(10.0, 0.0), to(10.0, 10.0), Item(HOMEWARD, None)), "the way to item 4"),
        ((jump(3.0), to(0.0, 0.0), to(10.0, 10.0)), "the way to item 3"),
        (
            (to(0.0, 10.0), jump(4.0), to(0.0, 0.0), jump(6.0), to(0.0, 0.0), to(10.0, 10.0), to(10.0, 0.0)),
            "the way to item 6",
        ),
    ):
        rig, _ = flying(Plan("survey", plan))
        rig.vehicle_body.narrow(fenced)
        if said is None:
            with pytest.raises(FencedError, match="the way to item 1"):
                rig.vehicle_body.fly_plan(1.0)
        else:
            with pytest.raises(FencedError, match=said):
                rig.vehicle_body.fly_plan(1.0)


def test_a_name_that_is_none_is_said() -> None:
    rig, _ = flying()
    for wanted in (0.0, 2.0, 1.5, nan):
        with pytest.raises(MisuseError, match=r"there is no plan .* here; there are survey"):
            rig.vehicle_body.fly_plan(wanted)
    assert "PLAN" not in {function.name for function in MavlinkRig("copter").body.model.functions}


# ---- files


def square_plan(**changes: object) -> str:
    places = [
        {"type": "SimpleItem", "command": 16, "frame": 3, "params": [0, 0, 0, None, *at(x, y), 5]} for x, y in SQUARE
    ]
    mission = {"version": 2, "vehicleType": 2, "plannedHomePosition": [*HOME, 120], "items": places, **changes}
    return json.dumps({"fileType": "Plan", "version": 1, "mission": mission})


WAYPOINTS = "QGC WPL 110\n0 1 0 16 0 0 0 0 {0} {1} 120 1\n1 0 3 16 0 0 0 0 {0} {1} 5 1\n".format(*HOME)


def test_plans_are_called_by_their_files(tmp_path: Path) -> None:
    (tmp_path / "survey.plan").write_text(square_plan())
    (tmp_path / "Fence_line2.waypoints").write_text(WAYPOINTS)
    (tmp_path / "notes.txt").write_text("none of these")
    plans = read_plans(tmp_path)
    assert [(plan.name, len(plan.items)) for plan in plans] == [("Fence_line2", 1), ("survey", 4)]


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("survey.plan", "", "not JSON"),
        ("survey.plan", square_plan()[:90], "not JSON"),
        ("survey.plan", '{"fileType": "Mission"}', "no plan of QGroundControl"),
        ("survey.plan", square_plan(items=[]), "a mission of 0 items: wanted 1 to 699"),
        ("survey.plan", square_plan(items=[{"command": 16, "params": [0] * 7}] * 700), "a mission of 700 items"),
        ("survey.plan", square_plan(items=[{"command": 9999, "params": [0] * 7}]), "item 1 is command 9999 of MAVLink"),
        ("survey.plan", square_plan(items=[{"command": 177, "params": [5] * 7}]), "item 1 jumps to item 5"),
        ("survey.plan", " " * 1_048_577, "too long for a plan"),
        ("survey.waypoints", "QGC WPL 120\n", "wanted QGC WPL 110"),
        ("survey.waypoints", "QGC WPL 110\n0 1 0 16", "wanted twelve numbers"),
        ("survey.waypoints", "QGC WPL 110\n" + "0 1 nan 16 0 0 0 0 1 1 1 1\n", "wanted twelve numbers"),
        ("survey.waypoints", WAYPOINTS.replace("1 0 3 16", "1 0 300 16"), "item 1 has a frame that is none of MAVLink"),
        ("survey.plan", square_plan(items=[{"command": 20, "frame": "3", "params": [0] * 7}]), "item 1 has a frame"),
        ("survey.plan", square_plan(items=[{"command": 16, "params": [0, 0, 0, 0, 95, 8, 5]}]), "without a place"),
        ("my survey.plan", square_plan(), "wanted a letter, then up to 31 letters, digits and _"),
        ("..plan", square_plan(), "wanted a letter|it has 0 files"),
        ("7.plan", square_plan(), "wanted a letter"),
    ],
)
def test_a_file_that_is_no_plan(name: str, text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises((BodyError, SettingsError), match=said):
        read_plans(tmp_path)


def test_a_folder_that_is_none_or_has_no_plans_or_two_of_one_name(tmp_path: Path) -> None:
    with pytest.raises(BodyError, match="wanted a folder"):
        read_plans(tmp_path / "nowhere")
    with pytest.raises(BodyError, match="it has 0 files of plans: wanted 1 to 64"):
        read_plans(tmp_path)
    (tmp_path / "Survey.plan").write_text(square_plan())
    (tmp_path / "survey.waypoints").write_text(WAYPOINTS)
    with pytest.raises(BodyError, match="has this name already"):
        read_plans(tmp_path)


def test_a_node_writes_a_signed_plan_to_a_vehicle_in_another_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    live_in(tmp_path, monkeypatch)
    (tmp_path / "plans").mkdir()
    (tmp_path / "plans" / "survey.plan").write_text(square_plan())
    with closing(Process(tmp_path)) as vehicle:
        uri = vehicle.uri.replace("#1", f"&plans={tmp_path / 'plans'}&origin={HOME[0]},{HOME[1]}#1")
        with closing(Mind(uri, tmp_path)) as mind:
            mind.wait_for("v1 is up")
            mind.say('(RULE on (ONCE (> waypoint 1) (REPORT "on its way")))')
            mind.insist("on its way", "(PLAN survey)")
            vehicle.wait_for(f"mode {AUTOS['copter']}")
            mind.close()
