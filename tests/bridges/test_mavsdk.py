"""A program that is written with MAVSDK commands a simulated robot."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest

pytest.importorskip("mavsdk")
pytest.importorskip("pymavlink")
pytest.importorskip("pyproj")

from bridges.mind import Mind, Talking
from channel.test_udp import free_port

PROGRAM = Path(__file__).with_name("mavsdk_program.py")

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
        program.say("hold")
        mind.wait_for("stopped, and at rest until RELEASE")
        program.say("goto")
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
