"""A desk that asks robots of themselves, over a radio that loses, and what it puts on a page."""

from __future__ import annotations

import json
import struct
from collections import Counter
from io import StringIO

import pytest
from rich.console import Console

from safety.scene import KEYS, START, Scene
from sleepcast.channel import Kind, Message
from sleepcast.channel.envelope import look
from sleepcast.channel.message import TELEMETRY
from sleepcast.cli.watch import Window
from sleepcast.console import Scene as Ground
from sleepcast.console.adapters.channel import EMPTY, FleetAdapter
from sleepcast.core.errors import SleepcastError
from sleepcast.station.network import NetworkStation
from sleepcast.station.remote import RemoteMinds
from sleepcast.station.telemetry_client import TelemetryClient


def looking(scene: Scene) -> tuple[NetworkStation, TelemetryClient]:
    minds = RemoteMinds()
    desk = scene.desk(minds=minds)
    telemetry = TelemetryClient(desk, minds)
    desk.listeners.append(telemetry.hear)
    return desk, telemetry


def kinds(scene: Scene) -> Counter[Kind]:
    return Counter(look(datagram).kind for datagram in scene.sent)


def teach(scene: Scene, text: str) -> None:
    for robot in scene.fleet.values():
        assert not robot.node.evaluate(text).faults


@pytest.mark.parametrize("seed", range(3))
def test_everybody_is_known_over_a_bad_radio(seed: int) -> None:
    scene = Scene(robots=20, loss=0.3, delay=0.02, seed=seed)
    teach(scene, "(DEFUN late (n) (> id n))")
    desk, telemetry = looking(scene)
    telemetry.look()
    scene.run(4.0)
    found = desk.preview("(WHEN (late 14.5) (DRIVE 1))")
    assert (found.count(1), found.count(0), found.count(2)) == (5, 15, 0)
    assert not telemetry.learning(START)


def test_nobody_speaks_unasked() -> None:
    scene = Scene(robots=5)
    _, telemetry = looking(scene)
    telemetry.look()
    scene.run(2.0)
    scene.sent.clear()
    scene.run(20.0)
    assert not kinds(scene)[Kind.ASK]
    assert not kinds(scene)[Kind.ANSWER]


def test_what_was_learned_since_is_asked_for_again() -> None:
    scene = Scene(robots=4)
    teach(scene, "(DEFUN late (n) (> id n))")
    desk, telemetry = looking(scene)
    telemetry.look()
    scene.run(1.0)
    assert desk.preview("(WHEN (late 1) (DRIVE 1))").yes == ("r2", "r3")
    scene.fleet["r0"].node.evaluate("(DEFUN late (n) TRUE)")
    telemetry.look()
    scene.run(1.0)
    assert desk.preview("(WHEN (late 1) (DRIVE 1))").yes == ("r0", "r2", "r3")
    scene.fleet["r3"].on = False
    scene.run(6.0)
    telemetry.look()
    scene.run(2.0)
    found = desk.preview("(WHEN (late 1) (DRIVE 1))")
    assert (found.yes, dict(found.unknown)) == (("r0", "r2"), {"r3": "its last news is too old"})


def test_why_over_a_bad_radio() -> None:
    scene = Scene(robots=3, loss=0.3, delay=0.02, seed=4)
    desk, telemetry = looking(scene)
    sent = desk.send("(WHEN (> fuel 80%) (DRIVE 1))")
    scene.run(2.0)
    asked = telemetry.ask_why("r1", sent.id)
    lost = telemetry.ask_why("r1", "nobody-1.1")
    assert telemetry.explanation(asked, "r1") is None
    scene.run(3.0)
    found = telemetry.explanation(asked, "r1")
    assert found is not None
    assert (found.matched, found.reason) == (False, "fuel = 50 %, needed > 80 %")
    with pytest.raises(SleepcastError, match="remembers no command"):
        telemetry.explanation(lost, "r1")


def poses(fleet: FleetAdapter) -> dict[str, tuple[float, float, float]]:
    found = struct.unpack(f"<{3 * len(fleet.scene.names)}f", fleet.poses())
    return dict(zip(fleet.scene.names, zip(found[::3], found[1::3], found[2::3], strict=True), strict=True))


def test_a_liar_neither_moves_the_map_nor_breaks_the_page() -> None:
    scene = Scene(robots=3)
    desk, telemetry = looking(scene)
    ground = Ground("air", "", "robots", (), EMPTY, "m", ())
    fleet = FleetAdapter(desk, telemetry, ground, 1.0, START)
    fleet.hear()
    scene.run(1.0)
    fleet.hear()
    assert telemetry.minds["r1"].values[telemetry.minds.vocabulary.first_sensor] == 1.0
    told = telemetry.minds["r1"].telemetry
    numbers = list(struct.unpack(f"<{len(told.values) // 8}d", told.values))
    asked = telemetry.look()
    lies = {
        "values": struct.pack(f"<{len(numbers)}d", *numbers[:7], 1e300, *numbers[8:]),
        "type": told.type,
        "mind": b"12345678",
        "active": 2**63 - 1,
        "running": b"\xff" * 8,
        "user": {"x": 1.0, "(": 2.0, "own": float("inf")},
        "groups": ["\x1b[2J", "[/red]", "bravo"],
        "stopped": True,
    }
    for number, lie in enumerate((lies, lies | {"values": b"123"}, lies | {"groups": [1]}, "junk", 5, None)):
        body = {"command": asked.id, "outcome": "answer", "value": None, "fault": None, TELEMETRY: lie}
        scene.say(
            Message("r[/9]", 1, number, Kind.ANSWER, scene.clock.now(), scene.clock.now() + 5.0, body=body), KEYS["r*"]
        )
    scene.run(1.0)
    fleet.hear()
    assert telemetry.minds["r[/9]"].stopped
    assert telemetry.minds["r[/9]"].groups == {"bravo"}
    window = Window(desk, telemetry, None, ["x", "own"])
    with StringIO() as shown:
        Console(file=shown, width=100).print(window.table(10))
        assert "r[/9]" in shown.getvalue()
    json.dumps(window.as_dict(), allow_nan=False)
    assert fleet.scene.names == ("r0", "r1", "r2", "r[/9]")
    found = poses(fleet)
    left, low, right, high = fleet.scene.area
    assert max(abs(left), abs(low), abs(right), abs(high)) < 100.0
    assert all(position[2] != position[2] for position in found.values()), "nobody here has told a y"
    assert dict(fleet.minds["r[/9]"].variables())["own"] != dict(fleet.minds["r[/9]"].variables())["own"]
    desk.preview("(WHEN (> x 1) (DRIVE 1))")
    assert fleet.silent().tolist() == [False] * 4
    scene.run(6.0)
    assert fleet.silent().tolist() == [True] * 4
    assert fleet.age("r1") is not None
    assert fleet.age("nobody") is None
