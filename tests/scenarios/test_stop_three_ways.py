"""The stop of the thesis in three ways with one outcome: programs in C, programs in Python, and minds with a rule.

All of them drive the same two robots in the world of the scenario `stop`, behind one server, and hear one datagram. One
seed of each way belongs to every run of the tests, all twenty to the nightly one.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from clients.compiling import workshop
from scenarios.nomad_trial import Program, free_ports, server, trial
from scenarios.stopping import INCH, Outcome

CLIENTS = Path(__file__).resolve().parents[2] / "clients"
NEAR, FAR = 8 * INCH, 10 * INCH
"""Where a robot is to stop, m."""
FEW = {"c": (0,), "python": (10,), "sleep": (10,)}
"""Seeds of every run."""
TWENTY = range(20)


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    """Of one server for all trials, one after the other."""
    with server() as listening:
        yield listening


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the C programs."""
    made = workshop(tmp_path_factory.mktemp("c"), "native")
    made.make("programs")
    return made.folder / "programs"


def program(way: str, built: Path, port: int, robot: int, hears: int, rate: int) -> Program:
    """What drives this robot (from 1) and hears datagrams at this port. rate: ms / 4 between two sonars."""
    options = ["-h", "127.0.0.1", "-p", str(port), "-r", str(robot), "-d", str(hears), "-w", "0", "-f", str(rate)]
    if way == "c":
        return [built / f"rob{robot}", *options]
    if way == "python":
        return [sys.executable, CLIENTS / "python" / "rob.py", *options]
    return [
        *(sys.executable, "-m", "sleepcast", "node", "--name", f"rob{robot}", "--lockstep"),
        *("--body", f"nomad://127.0.0.1:{port}#{robot}"),
        *("--rules", CLIENTS / "sleep" / "stop.sleep", "--datagrams", str(hears)),
    ]


def outcome(way: str, built: Path, port: int, seed: int, *numbers: str, rate: int = 1) -> Outcome:
    """What comes of it when these numbers are sent."""
    ports = free_ports()
    programs = [program(way, built, port, robot, hears, rate) for robot, hears in enumerate(ports, 1)]
    in_python = [sys.executable, CLIENTS / "python" / "brdcst.py"]
    broadcast = [built / "brdcst"] if way == "c" else in_python
    return trial(port, seed, programs, [*broadcast, *numbers, *map(str, ports)])


@pytest.mark.parametrize(
    ("way", "seed"),
    [
        pytest.param(way, seed, marks=() if seed in few else pytest.mark.nightly)
        for way, few in FEW.items()
        for seed in TWENTY
    ],
)
def test_both_stop_within_ten_inches_of_something_and_nobody_before_the_order(
    way: str, seed: int, built: Path, port: int
) -> None:
    found = outcome(way, built, port, seed, "10", "7.5", "0")
    assert found.stood == 0
    assert len(found.stops) == 2
    assert all(NEAR <= stop.distance <= FAR for stop in found.stops), found
    assert found.moved == 0.0


def test_the_numbers_of_a_datagram_are_another_distance_and_another_speed(built: Path, port: int) -> None:
    found = outcome("sleep", built, port, 10, "12", "5", "0")
    assert found.stood == 0
    assert all(10.5 * INCH <= stop.distance <= 12 * INCH for stop in found.stops), found


@pytest.mark.nightly
def test_programs_whose_sonars_hear_each_other_stop_early_and_a_longer_pause_cures_it(built: Path) -> None:
    early = {}
    with server("--crosstalk") as listening:
        for rate in (1, 6):
            found = [outcome("c", built, listening, seed, "10", "7.5", "0", rate=rate) for seed in range(10)]
            stops = [stop for each in found for stop in each.stops]
            assert len(stops) == 20
            early[rate] = sum(stop.distance > FAR + INCH / 2 for stop in stops)
    assert early[1] >= 15
    assert early[6] <= 3
