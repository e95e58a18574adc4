"""The rehearsal in three ways with one account: simulated copters, MAVLink copters and Crazyflies.

The commands of its mission file, byte for byte, go to all of them: simulated copters hear them in this process, and
real nodes hear one broadcast of each, half of them with vehicles made of pymavlink as bodies, half with Crazyflies that
Bitcraze's library meets over UDP. The batteries of all are those that the simulator has drawn, and some are too weak to
take off. The times of the file are not waited for, but the states that they leave room for: so a busy machine may take
longer. Three of each belong to every run of the tests, ten to the nightly one.

On a busy machine a node does not meet its body within its five seconds, and ends: it is started again, as by whatever
watches over it on a real robot. One that has not looked at its body for a second has brought it to rest, a MAVLink
vehicle in a mode of its own: it is given back, and told once more.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pymavlink")
pytest.importorskip("pyproj")
pytest.importorskip("cflib")

import sleepcast as sc
from bridges.mind import quadcopter
from channel.test_udp import free_port
from processes import SLEEPCAST, live_in, running
from sleepcast.api.mission import MissionLine
from sleepcast.station import CountNeededError

BRIDGES = Path(__file__).resolve().parents[1] / "bridges"
STATES = (
    "(>= battery 0)",
    "(> height 1.9m)",
    "(> z 2.5m)",
    "(AND (< (ABS speed) 0.05m/s) (< (ABS climb_rate) 0.05m/s))",
    "1",
    "(< (DIST x y z x 20m 2m) 0.3m)",
    "(> turn_rate 10deg/s)",
    "(< (ABS turn_rate) 1deg/s)",
    "(NOT flying)",
)
"""What is so on all whose batteries suffice before each command, and after the last one."""
OURS = "(IF (AND armed (KNOWN mode)) (= mode GUIDED) TRUE)"
"""What has to be so besides on the air: a vehicle that flies obeys us."""
BACK = "(WHEN (AND armed (NOT (= mode GUIDED))) (SET_MODE GUIDED))"
SEED = 5
"""By which one of three batteries, and three of ten, are too weak."""
PATIENCE, AGAIN = 300.0, 15.0
"""Seconds that a state may take on a busy machine, and after which a command is said again."""
UNHEARD = "300s"
"""How long an operator may not be heard."""
COLUMNS = ("matched", "not_matched", "unknown", "fault", "held", "not_stored", "waiting")
Columns = dict[str, frozenset[int]]


@pytest.mark.parametrize("count", [3, pytest.param(10, marks=pytest.mark.nightly)])
def test_one_mission_has_the_same_account_in_the_simulator_and_on_both_makes(
    count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    live_in(tmp_path, monkeypatch)
    drawn = {"robots.stores.battery.start": ["20%", "100%"]}
    with sc.open("rehearsal", robots=count, seed=SEED, over=drawn) as simulated:
        lines = simulated.mission
        charges = np.round(100.0 * simulated["battery"]).astype(int).tolist()
        strong = [number for number, charge in enumerate(charges, 1) if charge > 50]
        assert 0 < len(strong) < count, "some take off, and some do not"
        accounts = fly(simulated, lines, strong, STATES, ("",))
    assert accounts[0]["matched"] == set(strong)
    with real(charges, tmp_path) as fleet:
        on_air = [f"(AND {state} {OURS})" for state in STATES]
        assert fly(fleet, lines, strong, on_air, ("v", "c")) == [each for each in accounts for _ in "vc"]


def fly(
    fleet: sc.Fleet, lines: sc.Mission, strong: list[int], states: Sequence[str], makes: Sequence[str]
) -> list[Columns]:
    """Send each line when the state before it has come on the strong ones; gives the columns of each, for each make the
    robots whose names begin so."""
    found = []
    for line, previous, state in zip(lines, (None, *lines), states, strict=False):
        reach(fleet, state, strong, previous)
        sent = send(fleet, line)
        found += [columns(sent, make) for make in makes]
    reach(fleet, states[-1], strong, lines[-1])
    return found


def send(fleet: sc.Fleet, line: MissionLine) -> sc.CommandResult:
    """Send a line, and let the robots answer."""
    sends: dict[str, Callable[..., sc.CommandResult]] = {"STOP": fleet.stop, "RELEASE": fleet.release}
    order = line.instruction
    sent = sends[order.kind](wait=PATIENCE) if order.kind in sends else send_text(fleet, order.text)
    assert not sent.silent, sent
    return sent


def send_text(fleet: sc.Fleet, text: str) -> sc.CommandResult:
    """Send it to as many as may obey, which a desk on the air wants to be told."""
    count = None
    while True:
        try:
            return fleet.send(text, wait=PATIENCE, count=count, sure=True)
        except CountNeededError as needed:
            count = needed.may


def columns(sent: sc.CommandResult, make: str) -> Columns:
    """The numbers of the robots of this make in each column of the account in which somebody stands."""
    found = {column: [name for name in getattr(sent, column) if name.startswith(make)] for column in COLUMNS}
    return {column: frozenset(map(number_in, robots)) for column, robots in found.items() if robots}


def number_in(name: str) -> int:
    return int("".join(filter(str.isdigit, name)))


def reach(fleet: sc.Fleet, state: str, strong: list[int], last: MissionLine | None) -> None:
    """Let time pass until it is so on all of these numbers. Once in a while what was sent last is said again."""
    began = said = fleet.time
    while not (fleet[state] == 1.0)[np.isin(fleet["id"], strong)].all():
        assert fleet.time < began + PATIENCE, (state, fleet.table("x", "y", "z", "speed", "battery", "flying"))
        if last is not None and last.instruction.kind == "once" and fleet.time > said + AGAIN:
            said = fleet.time
            if isinstance(fleet, sc.ConnectedFleet):
                send_text(fleet, BACK)
            send_text(fleet, last.instruction.text)
        fleet.run(0.2, quiet=True)


@contextmanager
def real(charges: list[int], folder: Path) -> Iterator[sc.ConnectedFleet]:
    """As many MAVLink copters and Crazyflies with these charges (%), each with its node, and a desk that knows all."""
    key = folder / "vehicle.key"
    key.write_text("fleet key\n")
    channel = f"udp://239.255.83.89:{free_port()}?interface=lo"
    with ExitStack() as stack, (folder / "nodes.log").open("w+") as log:
        nodes: dict[str, subprocess.Popen[str]] = {}
        bodies: dict[str, str] = {}
        for number, charge in enumerate(charges, 1):
            ports = free_port(), free_port()
            vehicle = sys.executable, BRIDGES / "mavlink_vehicle.py", ports[0], "fleet key", "copter", charge
            stack.enter_context(running(*vehicle, stdin=subprocess.PIPE))
            stack.enter_context(quadcopter(ports[1], charge, PATIENCE))
            bodies[f"v{number}"] = f"mavlink://127.0.0.1:{ports[0]}?listen=yes&key={key}#1"
            bodies[f"c{number}"] = f"crazyflie://127.0.0.1:{ports[1]}?speed=2"

        def start_missing() -> None:
            for name, body in bodies.items():
                if name not in nodes or nodes[name].poll() is not None:
                    options = ("--name", name, "--body", body, "--channel", channel, "--lease", UNHEARD, "--no-store")
                    nodes[name] = stack.enter_context(running(*SLEEPCAST, "node", *options, stderr=log.fileno()))

        start_missing()
        fleet = stack.enter_context(sc.connect(channel, expect=len(bodies)))
        until = time.monotonic() + PATIENCE
        while len(fleet) < len(bodies) or np.isnan(fleet["battery"]).any():
            start_missing()
            assert time.monotonic() < until, (fleet.names, Path(log.name).read_text())
            fleet.run(0.2, quiet=True)
        yield fleet
