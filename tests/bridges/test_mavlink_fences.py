"""Fences in the vehicle: read, written, and kept by its body as well."""

from __future__ import annotations

import json
from contextlib import closing
from math import inf
from pathlib import Path
from random import Random

import pytest

pytest.importorskip("pymavlink")
pytest.importorskip("pyproj")

from bridges.mavlink_vehicle import HOME, RADIUS
from bridges.test_mavlink import MavlinkRig, Process
from bridges.test_mavlink_plane import OVER, flying
from bridges.test_mavlink_plans import at
from processes import live_in
from sleepcast.bridges import BodyError, open_robot
from sleepcast.bridges.mavlink.fences import fence_on, read_fence, write_fence
from sleepcast.bridges.mavlink.transfer import Party
from sleepcast.core.geodesy import LocalMap, Origin
from sleepcast.core.mission_files import FenceArea
from sleepcast.core.outlines import depth
from sleepcast.robot import FencedError, Limits, Setpoint

EARTH = LocalMap(Origin(*HOME))
US = Party(1, 255, 190)
TRIANGLE = FenceArea(tuple(at(x, y) for x, y in ((-10.0, -10.0), (40.0, -10.0), (0.0, 40.0))), True)
POND = FenceArea((at(8.0, 0.0),), False, 3.0)


def fenced(*areas: FenceArea) -> Limits:
    fence = fence_on(EARTH, areas, "the fence")
    return Limits(inf, inf, inf, inside=fence.inside, outside=fence.outside)


@pytest.mark.parametrize("lost", [0, 1, 3])
def test_a_fence_that_is_written_is_the_one_that_is_read(lost: int) -> None:
    rig = MavlinkRig()
    link = rig.vehicle_body._link
    rig.vehicle.forgets = lost
    if lost:  # it asks anew, as time passes for it
        send = link.send

        def pass_time(message: object) -> None:
            send(message)
            rig.loop.advance(0.5)

        link.send = pass_time  # type: ignore[method-assign]
    write_fence(link, US, [TRIANGLE, POND])
    assert [(m.command, m.param1) for m in rig.vehicle.stored[1]] == [(5001, 3.0)] * 3 + [(5004, 3.0)]
    polygon, circle = read_fence(link, US)
    assert (polygon.inside, circle.inside, circle.radius) == (True, False, 3.0)
    for mine, yours in zip(polygon.corners, TRIANGLE.corners, strict=True):
        assert mine == pytest.approx(yours, abs=1e-7)


def test_a_fence_that_the_vehicle_does_not_take_or_tell_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sleepcast.bridges.mavlink.transfer.SECONDS", 0.2)
    rig = MavlinkRig()
    rig.vehicle.forgets = 10_000
    with pytest.raises(BodyError, match=r"the fence in the vehicle was not read: it has not answered for 0\.2 s"):
        read_fence(rig.vehicle_body._link, US)
    rig.vehicle.forgets = 0
    huge = FenceArea(tuple(at(x, x * x) for x in range(701)), True)
    with pytest.raises(BodyError, match="a fence of 701 corners and circles: wanted 700 at most"):
        write_fence(rig.vehicle_body._link, US, [huge])


@pytest.mark.parametrize(
    "area", [FenceArea(TRIANGLE.corners[:2], True), FenceArea((), False), FenceArea(((-36.6, 58.0),) * 3, True)]
)
def test_an_area_that_is_none_is_said(area: FenceArea) -> None:
    with pytest.raises(BodyError, match="the fence: area 2 is neither a polygon of three corners or more nor a circle"):
        fence_on(EARTH, [POND, area], "the fence")


@pytest.mark.parametrize("kind", ["rover", "copter"])
def test_whatever_is_asked_it_leaves_no_area_and_enters_none(kind: str) -> None:
    limits = fenced(TRIANGLE, POND)
    rig = MavlinkRig(kind).ready()
    if kind == "copter":
        rig.vehicle_body.take_off(5.0)
        rig.wait(4.0)
    rig.vehicle_body.narrow(limits)
    chance, worst, farthest = Random(7), inf, 0.0
    for _ in range(30):
        side = chance.uniform(-2.0, 2.0) if kind == "copter" else 0.0
        rig.robot.act(Setpoint(chance.choice((2.0, 2.0, -2.0)), chance.uniform(-0.5, 0.5), side, 0.0))
        for _ in range(4):
            rig.wait(0.5)
            place = rig.sensed()["x"], rig.sensed()["y"]
            worst = min(worst, depth(limits.inside[0], place), -depth(limits.outside[0], place))
            farthest = max(farthest, abs(place[0]) + abs(place[1]))
    assert worst > -0.05
    assert farthest > 5.0, "it drove about"
    assert "it is at rest: its fence is ahead" in rig.body.complaints()


def test_beyond_an_edge_it_may_only_come_back() -> None:
    limits = fenced(TRIANGLE)
    for place, speed, may in (((-12.0, 0.0), 1.0, True), ((-12.0, 0.0), -1.0, False), ((5.0, 0.0), -1.0, True)):
        pose = (*place, 0.0)
        assert limits.within(Limits(2.0, 1.0, 2.0)).may_go_on(pose, speed, speed, 0.0, 0.25, lambda *_: inf) is may


def test_a_place_beyond_or_behind_an_area_is_a_fault() -> None:
    rig = MavlinkRig("copter").ready()
    rig.vehicle_body.take_off(5.0)
    rig.wait(4.0)
    rig.vehicle_body.narrow(fenced(TRIANGLE, POND))
    for x, said in (
        (8.0, "lies outside of the fence"),
        (60.0, "lies outside"),
        (14.0, r"the way to \(14, 0\) m passes the fence"),
    ):
        with pytest.raises(FencedError, match=said):
            rig.vehicle_body.go_to(x, 0.0)
    rig.vehicle_body.go_to(0.0, 10.0)


def test_a_plane_circles_where_there_is_room() -> None:
    field = FenceArea(tuple(at(x, y) for x, y in ((-200.0, -300.0), (400.0, -300.0), (100.0, 500.0))), True)
    limits = fenced(field)
    rig, mind = flying()
    rig.vehicle_body.narrow(limits)
    mind.say("(GOTO 100m 100m)")
    mind.go_on(40.0)
    rig.vehicle_body._circle = None  # as if somebody had put it there: it takes the last place with room
    depths = []
    mind.say("(SET_MODE CRUISE)")
    mind.go_on(6.0)
    mind.say("(SET_MODE GUIDED)")
    mind.go_on(20.0)
    for _ in range(60):
        mind.go_on(0.5)
        depths.append(depth(limits.inside[0], (rig.sensed()["x"], rig.sensed()["y"])))
    assert min(depths) > -OVER
    assert rig.vehicle.radius == RADIUS


def test_the_setting_writes_a_file_or_reads_the_vehicle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    live_in(tmp_path, monkeypatch)
    polygon = {"polygon": [list(corner) for corner in TRIANGLE.corners], "inclusion": True}
    circle = {"circle": {"center": list(POND.corners[0]), "radius": 3.0}, "inclusion": False}
    fence = {"polygons": [polygon], "circles": [circle]}
    (tmp_path / "yard.plan").write_text(json.dumps({"fileType": "Plan", "version": 1, "geoFence": fence}))
    with closing(Process(tmp_path, "rover")) as vehicle:
        vehicle.wait_for("mode 0")
        of_vehicle = vehicle.uri.replace("#1", f"&origin={HOME[0]},{HOME[1]}&fence=vehicle#1").replace("rtl", "loiter")
        with pytest.raises(BodyError, match="the fence in the vehicle is empty"):
            open_robot(of_vehicle)
        with open_robot(of_vehicle.replace("fence=vehicle", f"fence={tmp_path / 'yard.plan'}")) as robot:
            written = robot.model.limits
        with open_robot(of_vehicle) as robot:
            read = robot.model
        assert [area.name for area in (*read.limits.inside, *read.limits.outside)] == ["fence1", "keep_out2"]
        for mine, yours in zip(written.inside + written.outside, read.limits.inside + read.limits.outside, strict=True):
            assert mine.sizes == pytest.approx(yours.sizes, abs=0.05)
        assert [(outline.name, outline.closed) for outline in read.outlines] == [("fence1", True), ("keep_out2", True)]
        with pytest.raises(BodyError, match="fence=vehicle needs origin=LATITUDE,LONGITUDE"):
            open_robot(of_vehicle.replace("origin", "altitude").replace(f"{HOME[0]},{HOME[1]}", "5"))
