"""What hovers answers to the same names, whoever has made it: its model, and a mission that both makes fly alike."""

from __future__ import annotations

import subprocess
import sys
from contextlib import AbstractContextManager
from dataclasses import replace
from math import nan
from pathlib import Path

import pytest

pytest.importorskip("pymavlink")
pytest.importorskip("pyproj")
pytest.importorskip("cflib")

from bridges.mind import quadcopter
from channel.test_udp import free_port
from cli.calling import again_until
from cli.test_swarm import account
from processes import SLEEPCAST, live_in, running
from sleepcast.bridges.crazyflie.quadcopter import model_of as crazyflie
from sleepcast.bridges.mavlink.model import COPTER
from sleepcast.bridges.mavlink.model import model_of as mavlink
from sleepcast.bridges.mavlink.vehicle import MavlinkVehicle
from sleepcast.core.errors import MisuseError
from sleepcast.core.model import HostFunction
from sleepcast.robot import FencedError, Limits
from sleepcast.robot.hovering import check_height, check_place

LIMITS = Limits(2.0, 1.0, 1.0, climb=1.0, floor=0.5, ceiling=30.0)
HERE = Path(__file__).parent
COLUMNS = ("matched", "not_matched", "unknown", "fault", "silent", "held", "stopped")


def shape(function: HostFunction) -> tuple[object, ...]:
    """What a text and its reader see of a function."""
    of = function
    return of.dimensions, of.least, of.arguments, of.result, of.acts, of.labelled, of.moves, of.irreversible, of.doc


def test_both_makes_have_one_vocabulary() -> None:
    one, other = crazyflie(LIMITS), mavlink(COPTER, LIMITS, MavlinkVehicle)
    assert one.actuators == other.actuators
    assert [actuator.name for actuator in one.actuators] == ["drive_speed", "drive_turn", "drive_side", "drive_climb"]
    sensors = [{sensor.name: sensor for sensor in model.sensors} for model in (one, other)]
    common = sensors[0].keys() & sensors[1].keys()
    assert {"x", "y", "z", "height", "heading", "speed", "climb_rate", "armed", "flying", "battery"} <= common
    assert all(sensors[0][name] == sensors[1][name] for name in common)
    functions = [{function.name: shape(function) for function in model.functions} for model in (one, other)]
    common = functions[0].keys() & functions[1].keys()
    assert common == {"TAKEOFF", "LAND", "GOTO", "CLIMB", "ARM", "DISARM"}
    assert all(functions[0][name] == functions[1][name] for name in common)


def test_places_and_heights_that_limits_do_not_allow_are_refused() -> None:
    fenced = replace(LIMITS, fence=(-5.0, -5.0, 5.0, 5.0))
    check_place(fenced, 5.0, -5.0)
    check_height(fenced, 0.5)
    for x, y in ((5.1, 0.0), (nan, 0.0)):
        with pytest.raises(FencedError, match="lies outside of the fence"):
            check_place(fenced, x, y)
    for x in (2e5, nan):
        with pytest.raises(MisuseError, match="is farther than 100000 m from the origin"):
            check_place(LIMITS, x, 0.0)
    for height in (0.4, 30.1, nan, -nan):
        with pytest.raises(MisuseError, match=r"it flies from 0\.5 to 30 m high"):
            check_height(LIMITS, height)


def node(name: str, body: str, channel: str) -> AbstractContextManager[subprocess.Popen[str]]:
    command = ("node", "--name", name, "--body", body, "--channel", channel, "--lease", "60s", "--no-store")
    return running(*SLEEPCAST, *command, up="is up", stdin=subprocess.PIPE)


def test_one_mission_flies_both_makes_with_the_same_account(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    live_in(tmp_path, monkeypatch)
    (tmp_path / "vehicle.key").write_text("fleet key\n")
    channel, ports = f"udp://239.255.83.87:{free_port()}?interface=lo", (free_port(), free_port())
    vehicle = f"mavlink://127.0.0.1:{ports[0]}?listen=yes&key={tmp_path / 'vehicle.key'}#1"

    def sends(*command: str) -> set[str]:
        """The columns in which both robots stand; in no other stands one alone."""
        found = {key: robots for key, robots in account(channel, *command).items() if key in COLUMNS and robots}
        assert all(robots == ["c1", "v1"] for robots in found.values()), found
        return set(found)

    def until(value: str, least: float, most: float) -> None:
        again_until(
            lambda found: found["n"] == 2 and least <= found["min"] and found["max"] <= most,
            lambda: account(channel, "ask", value),
        )

    counterpart = (sys.executable, HERE / "mavlink_vehicle.py", ports[0], "fleet key", "copter")
    with (
        running(*counterpart, up="mode", stdin=subprocess.PIPE),
        quadcopter(ports[1]),
        node("v1", vehicle, channel),
        node("c1", f"crazyflie://127.0.0.1:{ports[1]}", channel),
    ):
        until("flying", 0.0, 0.0)
        assert sends("send", "(WHEN (AND (> battery 50%) (NOT flying)) (TAKEOFF 0.8m))") == {"matched"}
        until("height", 0.7, 1.1)
        assert sends("send", "(WHEN flying (GOTO 0.5m 0.3m 1m))") == {"matched"}
        until("(DIST x y 0.5m 0.3m)", 0.0, 0.2)
        until("z", 0.9, 1.1)
        assert sends("send", "(WHEN flying (SETQ drive_side 0.3m/s) (SETQ drive_climb 0.1m/s))") == {"matched"}
        until("climb_rate", 0.05, 0.15)
        assert sends("stop") == {"matched"}
        until("climb_rate", 0.0, 0.0)
        assert sends("send", "(WHEN flying (LAND))") == sends("send", "(WHEN flying (TAKEOFF))") == {"matched", "held"}
        assert sends("send", "(WHEN flying (ARM))") == {"fault"}
        assert sends("release") == {"matched"}
        assert sends("send", "(WHEN flying (LAND))") == {"matched"}
        until("flying", 0.0, 0.0)
        assert sends("send", "(WHEN flying (LAND))") == {"not_matched"}
