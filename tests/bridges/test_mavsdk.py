"""A program that is written with MAVSDK commands a simulated robot; and one takes missions, as vehicles do."""

from __future__ import annotations

import time
from contextlib import closing
from pathlib import Path

import pytest

pytest.importorskip("mavsdk")
pytest.importorskip("pymavlink")
pytest.importorskip("pyproj")

from bridges.mind import PATIENCE, Mind, Talking
from channel.test_udp import free_port
from sleepcast.bridges.mavlink.fences import read_fence, write_fence
from sleepcast.bridges.mavlink.link import MavlinkConnection, UdpWire
from sleepcast.bridges.mavlink.transfer import MISSION, Download, Party, Upload, finish
from sleepcast.core.mission_files import HOMEWARD, TAKEOFF, WAYPOINT, FenceArea, Item

PROGRAM = Path(__file__).with_name("mavsdk_program.py")
VEHICLE = Path(__file__).with_name("mavsdk_vehicle.py")

pytestmark = pytest.mark.counterpart("mavsdk", "pymavlink")


class Program(Talking):
    def __init__(self, port: int, folder: Path) -> None:
        super().__init__(folder / "mavsdk", PROGRAM, port)

    def close(self) -> None:
        self.kill()


def test_a_program_waits_until_it_is_ready_drives_it_and_does_not_rearm_what_it_has_killed(tmp_path: Path) -> None:
    port = free_port()
    uri = f"mavlink://127.0.0.1:{port}?unsigned=yes&origin=36.6,-121.9"
    with (
        closing(Program(port, tmp_path)) as program,
        closing(Mind("sim:maze", tmp_path, "--ground-station", uri)) as mind,
    ):
        program.wait_for("connected")
        program.say("ready")
        program.wait_for("ready, all ok: True")
        program.say("arm", "goto")
        program.wait_for("arm: done", "goto: done")
        mind.say('(WHEN (AND (< 29 goal_x 31) (= goal_height 10)) (REPORT "goal taken"))')
        mind.wait_for("goal taken")
        for off, *said in (("kill", "text: it is stopped, so it goes nowhere"), ("terminate",)):
            program.say(off)
            program.wait_for(f"{off}: done")
            mind.wait_for("stopped, and at rest until RELEASE")
            program.say("goto")
            program.wait_for("goto: COMMAND_DENIED", *said)
            assert mind.printed().rstrip().endswith("at rest until RELEASE"), "GUIDED, which MAVSDK chooses first"
            program.say("arm", "goto")
            mind.wait_for("released, and free to be moved again")
            program.wait_for("arm: done", "goto: done")
        program.say("hold", "goto")  # at once
        program.wait_for("hold: done", "goto: done")
        mind.wait_for("stopped, and at rest until RELEASE")
        mind.wait_for("released, and free to be moved again")
        program.say("north", "offboard")
        program.wait_for("offboard: done")
        mind.say('(RULE look (WHEN (> speed 0) (REPORT "it drives")))')
        mind.wait_for("it drives")
        program.say("up")
        program.wait_for("text: it has no velocity up or down")
        program.say("place")
        mind.say('(RULE seek (WHEN (AND (= goal_x 2) (= goal_y 3) (= goal_height 1)) (REPORT "place taken")))')
        mind.wait_for("place taken")


def test_a_program_asks_for_its_place_more_often_its_number_and_its_missions_and_arms_by_force(tmp_path: Path) -> None:
    """Most of these calls raised an error while they were not answered."""
    port = free_port()
    uri = f"mavlink://127.0.0.1:{port}?unsigned=yes&origin=36.6,-121.9#7"
    with (
        closing(Program(port, tmp_path)) as program,
        closing(Mind("sim:maze", tmp_path, "--ground-station", uri)) as mind,
    ):
        program.wait_for("connected")
        program.say("ready", "battery", "often", "imu", "number", "download", "clear", "upload")
        program.wait_for(
            "ready, all ok: True", "battery: done: 0.0", "often: done", "imu: UNSUPPORTED", "number: done: 7.0"
        )
        program.wait_for("download: done: []", "clear: DENIED", "upload: DENIED")
        program.say("force")
        mind.wait_for("stopped, and at rest until RELEASE")  # MAVSDK sends what it sends for kill
        program.wait_for("text: it is disarmed by force, which stops it")


def test_missions_and_fences_go_to_another_maker_of_the_protocol_and_come_back(tmp_path: Path) -> None:
    """MAVSDK asks with MISSION_REQUEST_INT, ArduPilot and the vehicle of the other tests with MISSION_REQUEST."""
    way = Item(TAKEOFF, None, 5.0), Item(WAYPOINT, (36.6, -121.9), 5.0), Item(HOMEWARD, None)
    area = FenceArea(((36.6, -121.9), (36.61, -121.9), (36.6, -121.89)), True)
    with closing(UdpWire("127.0.0.1", 0, listening=True)) as wire:
        link, us = MavlinkConnection(wire, 255, 190, None), Party(1, 255, 190)
        with closing(Talking(tmp_path / "vehicle", VEHICLE, wire.port)) as vehicle:
            vehicle.wait_for("connected")
            _meet(link)
            finish(Upload(link, us, MISSION, way, time.monotonic()), link, us, "it was not taken")
            vehicle.wait_for(f"{[WAYPOINT, TAKEOFF, WAYPOINT, HOMEWARD]}")
            download = Download(link, us, MISSION, time.monotonic())
            finish(download, link, us, "it was not told")
            assert [item.command for item in download.items] == [WAYPOINT, TAKEOFF, WAYPOINT, HOMEWARD]
            assert download.items[2].at == pytest.approx((36.6, -121.9))
            write_fence(link, us, [area])
            vehicle.wait_for(f"{[5001] * 3}")
            (found,) = read_fence(link, us)
            assert (found.inside, len(found.corners)) == (True, 3)


def _meet(link: MavlinkConnection) -> None:
    """Wait until both know of each other."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        link.send(link.mav.heartbeat_encode(6, 8, 0, 0, 4))
        if any(message.get_type() == "HEARTBEAT" for message in link.receive()):
            return
        time.sleep(0.05)
    pytest.fail("the vehicle was not heard")
