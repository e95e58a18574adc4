"""A real ground station, MAVProxy in a process of its own: it sees a robot, and commands it once it has the key."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest

pytest.importorskip("MAVProxy")
pytest.importorskip("pyproj")

from bridges.mind import Mind, Talking
from channel.test_udp import free_port
from processes import live_in

pytestmark = pytest.mark.counterpart("mavproxy")

MODULES = "signing,arm,mode,cmdlong"


class MavProxy(Talking):
    """Its master is a port at which it listens. Whatever it keeps between runs would lie in `folder`."""

    def __init__(self, port: int, folder: Path) -> None:
        options = (f"--master=udpin:127.0.0.1:{port}", "--mav20", "--no-state", f"--default-modules={MODULES}")
        super().__init__(folder / "mavproxy", "-m", "MAVProxy.mavproxy", *options, folder=folder)

    def close(self) -> None:
        self.kill()


def test_mavproxy_sees_a_robot_is_refused_without_the_key_and_obeyed_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    live_in(tmp_path, monkeypatch)  # where MAVProxy would look for keys
    (tmp_path / "key").write_text("fleetkey\n")
    port = free_port()
    uri = f"mavlink://127.0.0.1:{port}?key={tmp_path / 'key'}&origin=36.6,-121.9"
    with (
        closing(MavProxy(port, tmp_path)) as desk,
        closing(Mind("sim:maze", tmp_path, "--ground-station", uri)) as mind,
    ):
        desk.wait_for("Detected vehicle 1:1 on link 0")
        desk.wait_for("Mode GUIDED")
        mind.wait_for("messages from the ground station were refused: they are not signed")
        desk.say("mode HOLD", "signing key fleetkey", "mode GUIDED")
        desk.wait_for("Got COMMAND_ACK: DO_SET_MODE: ACCEPTED")
        assert "stopped" not in mind.printed(), "the first order had no signature"
        desk.say("mode HOLD")
        desk.wait_for("Mode HOLD")
        mind.wait_for("stopped, and at rest until RELEASE")
        desk.say("mode GUIDED")
        desk.wait_for("Mode GUIDED")
        mind.wait_for("released, and free to be moved again")
        desk.say("guided 36.6003604 -121.8996646 0")
        desk.wait_for("Got COMMAND_ACK: DO_REPOSITION: ACCEPTED")
        mind.say('(WHEN (< 29 goal_x 31) (REPORT "goal taken"))')
        mind.wait_for("goal taken")
        desk.say("velocity 0.1 0 0")
        mind.wait_for("the ground station no longer drives it: it comes to rest")
        desk.say("disarm")
        desk.wait_for("DISARMED")
        mind.wait_for("stopped, and at rest until RELEASE")
