"""A real ground station, MAVProxy in a process of its own: it sees a robot, and commands it once it has the key."""

from __future__ import annotations

import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest

pytest.importorskip("MAVProxy")
pytest.importorskip("pyproj")

from bridges.mind import PATIENCE, Mind
from channel.test_udp import free_port

MODULES = "signing,arm,mode,cmdlong"


class MavProxy:
    """Its master is a port at which it listens. Whatever it keeps between runs would lie in `folder`."""

    def __init__(self, port: int, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("HOME", str(folder))  # where it would look for keys
        self._screen, self._read = folder / "mavproxy", 0
        options = (f"--master=udpin:127.0.0.1:{port}", "--mav20", "--no-state", f"--default-modules={MODULES}")
        with self._screen.open("w") as screen:
            self._running = subprocess.Popen(
                [sys.executable, "-m", "MAVProxy.mavproxy", *options],
                cwd=folder,
                stdin=subprocess.PIPE,
                stdout=screen,
                stderr=subprocess.STDOUT,
                text=True,
            )

    def say(self, *lines: str) -> None:
        assert self._running.stdin is not None
        self._running.stdin.writelines(f"{line}\n" for line in lines)
        self._running.stdin.flush()

    def wait_for(self, sentence: str) -> None:
        """Until it shows this, after what was waited for before."""
        end = time.monotonic() + PATIENCE
        while (found := self._screen.read_text().find(sentence, self._read)) < 0:
            assert self._running.poll() is None, self._screen.read_text()
            assert time.monotonic() < end, f"waited for {sentence}\n{self._screen.read_text()}"
            time.sleep(0.02)
        self._read = found + len(sentence)

    def close(self) -> None:
        self._running.kill()
        self._running.communicate()


def test_mavproxy_sees_a_robot_is_refused_without_the_key_and_obeyed_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "key").write_text("fleetkey\n")
    port = free_port()
    uri = f"mavlink://127.0.0.1:{port}?key={tmp_path / 'key'}&origin=36.6,-121.9"
    with (
        closing(MavProxy(port, tmp_path, monkeypatch)) as desk,
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
