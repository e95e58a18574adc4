"""Planes behind MAVLink 2: they circle where others stand, inside their fence."""

from __future__ import annotations

from contextlib import closing
from math import hypot, inf, nan
from pathlib import Path

import pytest

pytest.importorskip("pymavlink")
pytest.importorskip("pyproj")

from bridges.mavlink_vehicle import AUTO, LOITER, PACE, RADIUS, TAKEOFF
from bridges.mind import Mind
from bridges.test_mavlink import MavlinkRig, Process, Ticks
from processes import live_in
from sleepcast.bridges import open_robot
from sleepcast.bridges.mavlink.model import PLANE
from sleepcast.core.errors import MisuseError
from sleepcast.robot import FencedError, Limits, hovering

FENCE = (-200.0, -200.0, 400.0, 200.0)
OVER = 8.0
"""m by which the counterpart, and its telling twenty times a second, may miss a circle."""


def flying(**settings: str) -> tuple[MavlinkRig, Ticks]:
    """A plane that has taken off, and circles in GUIDED."""
    rig = MavlinkRig("plane", **settings)
    mind = Ticks(rig)
    mind.go_on(1.2)
    mind.say("(TAKEOFF 40m)")
    mind.go_on(40.0)
    assert rig.vehicle.mode == PLANE["GUIDED"]
    return rig, mind


def farthest(rig: MavlinkRig, mind: Ticks, x: float, y: float, seconds: float) -> tuple[float, float]:
    """Least and greatest distance from a place, in so many seconds; m."""
    found = []
    for _ in range(round(seconds * 2)):
        mind.go_on(0.5)
        found.append(hypot(rig.sensed()["x"] - x, rig.sensed()["y"] - y))
    return min(found), max(found)


def test_a_take_off_is_its_own_mode_and_ends_in_a_circle_at_the_height_that_was_asked_for() -> None:
    rig = MavlinkRig("plane")
    mind = Ticks(rig)
    mind.go_on(1.2)
    mind.say("(RULE up (WHEN (NOT flying) (TAKEOFF 40m)))")
    mind.go_on(2.0)
    assert [order for order in rig.vehicle.orders if order[0] in (176, 400)] == [(176, TAKEOFF), (400, 1.0)]
    assert (rig.sensed()["flying"], rig.sensed()["mode"]) == (1.0, PLANE["TAKEOFF"])
    mind.go_on(40.0)
    found = rig.sensed()
    assert (found["mode"], found["armed"]) == (PLANE["GUIDED"], 1.0)
    assert found["height"] == pytest.approx(40.0, abs=0.3)
    assert found["speed"] == pytest.approx(PACE, abs=0.1)
    assert rig.body.complaints() == []


def test_it_circles_around_its_place() -> None:
    rig, mind = flying()
    mind.say("(GOTO 100m 50m 60m)")
    mind.go_on(30.0)
    least, most = farthest(rig, mind, 100.0, 50.0, 30.0)
    assert RADIUS - OVER < least <= most < RADIUS + OVER
    assert rig.sensed()["height"] == pytest.approx(60.0, abs=0.3)
    assert [number for number, _ in rig.vehicle.orders].count(192) == 2, "each place once"
    mind.say("(GOTO 100m 50m 60m)")
    mind.go_on(1.0)
    assert rig.body.complaints() == []


def test_stop_is_a_circle_where_it_is_and_release_goes_nowhere() -> None:
    rig, mind = flying()
    mind.say("(GOTO 3000m 0m)")
    mind.go_on(20.0)
    rig.body.stop()
    x, y = rig.sensed()["x"], rig.sensed()["y"]
    mind.go_on(25.0)
    least, most = farthest(rig, mind, x, y, 30.0)
    assert RADIUS - OVER < least <= most < RADIUS + OVER + PACE
    assert rig.vehicle.mode == PLANE["GUIDED"]
    rest = rig.vehicle_body.rest_state()
    assert rest is not None
    assert rest.at_rest, "a plane comes to no other rest"
    rig.body.release()
    mind.go_on(20.0)
    least, most = farthest(rig, mind, x, y, 20.0)
    assert most < RADIUS + OVER + PACE, "nothing old resumes"


def test_a_plane_on_its_way_is_not_at_rest() -> None:
    rig, mind = flying()
    mind.say("(GOTO 3000m 0m)")
    mind.go_on(20.0)
    rest = rig.vehicle_body.rest_state()
    assert rest is not None
    assert rest.speed == pytest.approx(PACE, abs=0.1)


def test_a_circle_that_is_not_answered_is_told_again_until_it_is() -> None:
    rig, mind = flying()
    mind.say("(GOTO 3000m 0m)")
    mind.go_on(10.0)
    rig.vehicle.deaf = {192}
    rig.body.stop()
    mind.go_on(8.0)
    assert "it has not answered the order about where to circle" in rig.body.complaints()
    rig.vehicle.deaf = set()
    mind.go_on(30.0)
    rest = rig.vehicle_body.rest_state()
    assert rest is not None
    assert rest.at_rest


def test_its_circles_lie_inside_of_the_fence() -> None:
    rig, mind = flying()
    rig.vehicle_body.narrow(Limits(inf, inf, inf, fence=FENCE))
    with pytest.raises(FencedError, match=r"its circle of 60 m around \(350, 0\) m passes the fence"):
        rig.vehicle_body.go_to(350.0, 0.0)
    with pytest.raises(FencedError, match=r"\(500, 0\) m lies outside of the fence"):
        rig.vehicle_body.go_to(500.0, 0.0)
    mind.say("(GOTO 340m 140m)")
    beyond = []
    for tick in range(600):
        mind.go_on(0.1)
        if tick == 400:  # on the circle that touches the fence
            rig.body.stop()
        x, y = rig.sensed()["x"], rig.sensed()["y"]
        beyond.append(max(x - FENCE[2], y - FENCE[3], FENCE[0] - x, FENCE[1] - y))
    assert max(beyond) < OVER
    assert max(beyond[-200:]) > -2.0 * OVER, "it still circles there"


def test_a_fence_that_is_too_narrow_to_circle_in_is_refused() -> None:
    with pytest.raises(MisuseError, match="a plane that circles at 60 m needs a fence twice as wide"):
        MavlinkRig("plane").vehicle_body.narrow(Limits(inf, inf, inf, fence=(0.0, 0.0, 300.0, 119.0)))


def test_stop_in_a_mode_of_its_own_is_loiter() -> None:
    rig, mind = flying()
    mind.say("(SET_MODE CRUISE)")
    mind.go_on(1.0)
    rig.body.stop()
    mind.go_on(1.0)
    assert rig.vehicle.mode == LOITER
    rest = rig.vehicle_body.rest_state()
    assert rest is not None
    assert rest.at_rest


@pytest.mark.parametrize("failsafe", ["LOITER", "RTL"])
def test_without_its_operator_it_circles_or_does_what_its_setting_says(failsafe: str) -> None:
    rig, mind = flying(failsafe=failsafe)
    mind.say("(GOTO 3000m 0m)")
    mind.go_on(5.0)
    rig.body.let_go()
    x, y = rig.sensed()["x"], rig.sensed()["y"]
    mind.go_on(20.0)
    assert rig.vehicle.mode == (PLANE["GUIDED"] if failsafe == "LOITER" else PLANE["RTL"])
    does = "circles (GUIDED)" if failsafe == "LOITER" else "circles at home (RTL)"
    assert rig.body.complaints() == [hovering.let_go(does)]
    assert hypot(rig.sensed()["x"] - x, rig.sensed()["y"] - y) < RADIUS + OVER + PACE


def test_it_lands_as_its_mission_says_or_tells_that_it_has_none() -> None:
    rig, mind = flying()
    mind.say("(LAND)")
    mind.go_on(2.0)
    assert rig.body.complaints() == ["the order about the landing of its mission was answered: failed"]
    assert rig.vehicle.mode == PLANE["GUIDED"]
    rig.vehicle.lands = True
    mind.say("(RULE down (WHEN flying (LAND)))")
    mind.go_on(2.0)
    assert rig.vehicle.mode == AUTO
    mind.go_on(30.0)
    assert (rig.sensed()["flying"], rig.sensed()["armed"]) == (0.0, 0.0)
    assert [number for number, _ in rig.vehicle.orders].count(189) == 2, "a rule says it in every tick"
    assert rig.body.complaints() == ["its motors are off; it is at rest until it is armed and a command moves it"]


def test_what_a_plane_cannot_do_is_said() -> None:
    rig, _ = flying()
    with pytest.raises(MisuseError, match=r"a plane does not hover: \(GOTO x y z\) brings it to another height"):
        rig.vehicle_body.climb(1.0)
    with pytest.raises(MisuseError, match="it flies from 30 to 120 m high, not at 200 m"):
        rig.vehicle_body.go_to(0.0, 0.0, 200.0)
    assert rig.body.model.actuators == ()


def test_an_airspeed_that_it_cannot_fly_leaves_its_place_out() -> None:
    rig, mind = flying()
    rig.vehicle.refuse = {178}
    mind.say("(GOTO 100m 50m 60m)")
    mind.go_on(2.0)
    assert rig.body.complaints() == [
        "the order about its speed was answered: denied; where to circle, asked for with it, is left out"
    ]


def test_a_node_flies_a_plane_in_another_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    live_in(tmp_path, monkeypatch)
    with closing(Process(tmp_path, "plane")) as vehicle, closing(Mind(vehicle.uri, tmp_path)) as mind:
        mind.wait_for("v1 is up")
        mind.say('(RULE high (ONCE (> height 5m) (REPORT "high")))')
        mind.insist("high", "(TAKEOFF 50m)")
        mind.say("STOP")
        vehicle.wait_for(f"mode {LOITER}")
        mind.close()


def test_a_plane_has_no_mode_to_land_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    live_in(tmp_path, monkeypatch)
    with closing(Process(tmp_path, "plane")) as vehicle:
        vehicle.wait_for("mode 0")
        with pytest.raises(MisuseError, match=r"no mode LAND; a plane lands by its own mission.*wanted loiter, rtl"):
            open_robot(vehicle.uri.replace("failsafe=rtl", "failsafe=land"))
        with open_robot(vehicle.uri.replace("#1", "&circle=80#1")) as robot:
            limits = robot.model.limits
            assert (limits.floor, limits.ceiling, limits.speed) == (30.0, 120.0, 15.0)
            assert nan not in (limits.floor, limits.ceiling)
