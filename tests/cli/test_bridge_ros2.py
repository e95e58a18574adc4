"""`sleepcast bridge ros2`: a fleet of ROS 2 robots with a mind each, in one process; with real ROS 2 and with loss."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from queue import Empty, Queue
from threading import Thread
from typing import Any

import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed here")

from benchmarks.channel.lab import Lab, why_not

from bridges.ros2_robot import OverDds, domain_for
from bridges.test_ros2 import another, needs_ros, robots_command, robots_place
from channel.test_udp import free_port
from cli.calling import LONGEST, called, called_here
from cli.test_swarm import account, too_late
from processes import SLEEPCAST, live_in, start
from sleepcast.api.connection import FLEET, AirOptions, observing_station
from sleepcast.bridges.ros2.mapping import TURTLEBOT
from sleepcast.bridges.ros2.messages import Bool, Odometry, Twist
from sleepcast.station.network import NetworkStation

DOMAIN = domain_for(3)
ROBOTS = [f"/scout{number}" for number in range(1, 4)]
LAB = why_not()


@pytest.fixture
def channel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The address of a channel of our own, of a user with no keys and no memory of any fleet."""
    live_in(tmp_path, monkeypatch)
    return f"udp://239.255.83.77:{free_port()}?interface=lo"


class Said:
    """What a process prints, line by line. The process is killed with the block, and read to its last line: before
    anybody closes its pipes."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.lines: list[str] = []
        self._process = process
        self._waiting: Queue[str] = Queue()
        self._readers = [
            Thread(target=self._read, args=(each,), daemon=True) for each in (process.stdout, process.stderr)
        ]
        for reader in self._readers:
            reader.start()

    def _read(self, stream: Any) -> None:
        for line in stream or ():
            self._waiting.put(line.strip())

    def __enter__(self) -> Said:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        for reader in self._readers:
            reader.join(LONGEST)

    def until(self, done: Callable[[list[str]], bool]) -> None:
        """Wait until this is true of all lines so far."""
        end = time.monotonic() + LONGEST
        while not done(self.lines):
            try:
                self.lines.append(self._waiting.get(timeout=max(0.0, end - time.monotonic())))
            except Empty:
                raise AssertionError("\n".join(self.lines)) from None

    def rest(self) -> str:
        """All that it has printed, once it has ended."""
        for reader in self._readers:
            reader.join(LONGEST)
        while not self._waiting.empty():
            self.lines.append(self._waiting.get())
        return "\n".join(self.lines)


def count(lines: list[str], what: str) -> int:
    """How many lines end with this."""
    return sum(line.endswith(what) for line in lines)


def any_has(sentence: str, lines: list[str]) -> bool:
    return any(sentence in line for line in lines)


def last(lines: list[str], *what: str) -> list[str]:
    """What each robot has said last of these."""
    found = {}
    for line in lines:
        name, _, said = line.partition(" ")
        if said in what:
            found[name] = said
    return list(found.values())


@contextmanager
def bridge(channel: str, *options: object) -> Iterator[tuple[subprocess.Popen[str], Said]]:
    command = ("bridge", "ros2", "--channel", channel, "--domain", DOMAIN, "--discovery", "localhost", *options)
    with start(*SLEEPCAST, *command) as process, Said(process) as said:
        yield process, said


class Told:
    """What robots report to a desk."""

    def __init__(self, station: NetworkStation) -> None:
        self._station = station

    def until(self, sentence: str) -> None:
        end = time.monotonic() + LONGEST
        while not any(sentence in str(report) for report in self._station.reports):
            assert time.monotonic() < end, list(self._station.reports)
            self._station.wait(0.1)


@contextmanager
def desk(channel: str) -> Iterator[Told]:
    with observing_station(AirOptions(channel, FLEET, None, None, None), lambda _: None) as (station, _):
        yield Told(station)


def test_a_fleet_is_found_driven_stopped_lost_and_found_again(channel: str) -> None:
    with bridge(channel) as (process, said):
        with another(*ROBOTS[:2], domain=DOMAIN) as robots, Said(robots) as heard:
            said.until(lambda lines: "scout2 is up, with 0 rules; 2 robots" in lines)
            assert account(channel, "ask", "(* 1 id)")["max"] == 2.0
            go = account(channel, "send", "--standing", "--all", "(RULE go (SETQ drive_speed 0.2m/s))")
            assert go["n_matched"] == 2
            heard.until(lambda lines: count(lines, "moves") == 2)
            assert account(channel, "stop")["n_matched"] == 2
            heard.until(lambda lines: last(lines, "moves", "rests") == ["rests"] * 2)
            heard.until(lambda lines: last(lines, "stopped", "free") == ["stopped"] * 2)
            with desk(channel) as told:
                robots.kill()
                told.until("nothing new has come at /scout1/odom")
        said.until(lambda lines: sum("out of reach" in line for line in lines) == 2)
        with another(*ROBOTS, domain=DOMAIN) as robots, Said(robots) as heard:
            said.until(lambda lines: "scout3 is up, with 0 rules; 3 robots" in lines)
            said.until(lambda lines: sum("within reach again" in line for line in lines) == 2)
            heard.until(lambda lines: last(lines, "stopped", "free") == ["stopped"] * 2 + ["free"])
            assert account(channel, "release")["n_matched"] == 3
            heard.until(lambda lines: last(lines, "moves", "rests") == ["moves"] * 3)
            process.send_signal(signal.SIGINT)
            heard.until(lambda lines: last(lines, "moves", "rests") == ["rests"] * 3)
        assert process.wait(LONGEST) == 130
    text = said.rest()
    assert text.count("its body has been stopped") == 3
    assert "Traceback" not in text


def test_what_does_not_fit_is_told_at_node_and_desk_and_comes_right(channel: str, tmp_path: Path) -> None:
    """A named robot has a mind before it is there; a topic of another type, and a clock that is wrong, are told."""
    over = OverDds("/scout1", DOMAIN)
    wrong = [over.writer("battery_state", Bool)]
    with bridge(channel, "--robot", "scout1", "--no-store") as (process, said):
        said.until(lambda lines: count(lines, "is up, with 0 rules; 1 robot") == 1)
        said.until(partial(any_has, "the body is out of reach: nothing new"))
        with another("/scout1", "/scout2", domain=DOMAIN, factor=1.0):  # its time begins with 0
            for sentence in ("within reach again", "battery_state has the type", "behind this computer's clock"):
                said.until(partial(any_has, sentence))
            assert account(channel, "ask", "x")["max"] == 0.0
        process.terminate()
        assert process.wait(LONGEST) == 143
    text = said.rest()
    assert "scout2" not in text
    del wrong


@needs_ros
@pytest.mark.skipif(bool(LAB), reason=f"no networks of our own here: {LAB}")
def test_twenty_robots_of_real_ros_on_a_lossy_network(channel: str) -> None:
    """A fifth of what passes between the robots' computer and ours is lost, both ways; then all of it, for a while, in
    motion."""
    fleet = [f"/scout{number}" for number in range(1, 21)]
    pipes, place = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}, robots_place(True, DOMAIN, "SUBNET")
    with Lab(["robots", "ours"]) as lab:

        def ours(*arguments: str) -> dict[str, Any]:
            out, err, end = "", "no robot was heard", time.monotonic() + LONGEST
            while too_late(out, err):
                assert time.monotonic() < end, err
                done = lab.start("ours", *SLEEPCAST[2:], *arguments, "--channel", channel, "--json", **pipes)
                out, err = done.communicate(timeout=LONGEST)
            assert out, err
            told: dict[str, Any] = json.loads(out)
            return told

        def all_obey(*arguments: str) -> None:
            """Say it, again with more time for answers where some robots have not answered in time."""
            within, end, heard = 0.5, time.monotonic() + LONGEST, 0
            while heard < len(fleet):
                assert time.monotonic() < end, heard
                told = ours(*arguments, "--within", f"{within}")
                heard, within = told["n_matched"], min(2.0 * within, 16.0)
                assert told["n_fault"] == 0, told

        robots = lab.start(
            "robots", *map(str, robots_command(True, DOMAIN)), *fleet, environment={**os.environ, **place}, **pipes
        )
        minds = ("bridge", "ros2", "--channel", channel, "--domain", str(DOMAIN), "--discovery", "subnet", "--no-store")
        lab.lose(0.2, what='iifname "eth0"')
        with Said(robots) as heard, Said(lab.start("ours", *SLEEPCAST[2:], *minds, **pipes)) as said:
            said.until(lambda lines: count(lines, "20 robots") == 1)
            all_obey("send", "--standing", "--all", "--count", "20", "(RULE go (SETQ drive_speed 0.2m/s))")
            heard.until(lambda lines: last(lines, "moves", "rests") == ["moves"] * 20)
            lab.cut("robots")
            heard.until(lambda lines: last(lines, "moves", "rests") == ["rests"] * 20)
            said.until(lambda lines: sum("is out of reach" in line for line in lines) == 20)
            lab.heal()
            said.until(lambda lines: sum("within reach again" in line for line in lines) == 20)
            heard.until(lambda lines: last(lines, "moves", "rests") == ["moves"] * 20)
            all_obey("stop")
            heard.until(lambda lines: last(lines, "moves", "rests") == ["rests"] * 20)
            heard.until(lambda lines: last(lines, "stopped", "free") == ["stopped"] * 20)


def test_a_robot_that_lacks_a_topic_says_so_at_the_desk(channel: str) -> None:
    over = OverDds("/scout1", DOMAIN)
    kept = [
        over.writer("odom", Odometry),
        over.reader("cmd_vel", Twist),
        OverDds("/map", DOMAIN).writer("odom", Odometry),
    ]
    with bridge(channel, "--no-store") as (process, said):
        said.until(lambda lines: count(lines, "is up, with 0 rules; 1 robot") == 1)
        with desk(channel) as told:
            told.until("nobody publishes /scout1/battery_state: battery and volts are unknown")
        said.until(partial(any_has, "skipped map, which is no robot of this mapping: nobody publishes /map/scan"))
        process.terminate()
        assert process.wait(LONGEST) == 143
    del kept


def test_a_list_of_what_is_there(channel: str) -> None:
    look = ("bridge", "ros2", "--domain", str(DOMAIN), "--discovery", "localhost", "--dry-run", "--seconds")
    nobody = called(*look, "0.1")
    assert (nobody.status, nobody.out) == (1, "0 robots in 0.1 s\n")
    assert nobody.err.startswith(
        "nobody has a topic such as NAMESPACE/odom or NAMESPACE/scan or NAMESPACE/cmd_vel in ROS"
    )
    with another(*ROBOTS[:2], domain=DOMAIN):
        end, wanted = time.monotonic() + LONGEST, [f"{name}: all topics are there" for name in ROBOTS[:2]]
        while (found := called(*look, "2")).out.splitlines()[1:] != wanted:
            assert time.monotonic() < end, found
        assert found.status == 0
        odom = {"topic": "/scout1/odom", "type": "Odometry", "direction": "in", "wrong": "", "doubt": ""}
        told: dict[str, Any] = {"robots": []}
        while not told["robots"] or told["robots"][0]["topics"][0] != odom:  # not all has been found in two seconds
            assert time.monotonic() < end, told
            listed = called(*look, "2", "--json", "--robot", "scout1", "--robot", "a")
            told = json.loads(listed.out)
    assert listed.status == 1
    assert ([each["namespace"] for each in told["robots"]], told["lost"]) == (["/scout1"], ["/a"])


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("--robot", "a b"), "'a b' is no namespace of ROS 2"),
        (("--robots", "none.txt"), "cannot read none.txt"),
        (("--robots", "7"), "wanted a file of their names"),
        (("--domain", "233"), "domain is a whole number from 0 to 232, not '233'"),
        (("--discovery", "off"), "discovery is subnet or localhost, not 'off'"),
        (("--mapping", "none.toml"), "none.toml: cannot be read"),
        (("--json",), "--json is for the list"),
        (("--no-store", "--store", "."), "do not go together"),
        (("--rules", "none.sleep"), "none.sleep"),
        (("--lease", "never"), "or off"),
        (("--channel", "tcp://x"), "tcp"),
        (("--key", "nobody"), "nobody"),
    ],
)
def test_what_is_no_fleet(
    channel: str, arguments: tuple[str, ...], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    place = ("--channel", channel, "--discovery", "localhost", "--seconds", "0")
    refused = called_here(capsys, "bridge", "ros2", *place, *arguments)
    assert refused.status == 2, refused
    assert complaint in refused.err


WAYS = {
    "bridge": ("bridge", "ros2", "--dry-run", "--seconds", "0"),
    "body": ("node", "--no-store", "--body", "ros2:///nobody"),
    "nserver": ("nserver", "--ros2", "--headless", "--port", "0"),
}
"""Into a ROS domain, each with nothing said about which."""


@pytest.mark.parametrize(
    ("name", "value", "complaint"),
    [
        ("ROS_DOMAIN_ID", "seven", "ROS_DOMAIN_ID is a whole number from 0 to 232, not 'seven'"),
        ("ROS_DOMAIN_ID", "233", "ROS_DOMAIN_ID is a whole number from 0 to 232, not '233'"),
        ("ROS_DOMAIN_ID", " 7", "ROS_DOMAIN_ID is a whole number from 0 to 232, not ' 7'"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF", "ROS_AUTOMATIC_DISCOVERY_RANGE is SUBNET or LOCALHOST, not 'OFF'"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "subnet", "not 'subnet'; ROS 2 takes it for LOCALHOST"),
    ],
)
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.usefixtures("channel")
def test_what_the_environment_of_ros_says_wrongly_is_told_in_one_way(
    way: str,
    name: str,
    value: str,
    complaint: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv(name, value)
    refused = called_here(capsys, *WAYS[way])
    assert (refused.status, refused.out) == (2, "")
    assert complaint in refused.err


@pytest.mark.parametrize(
    ("option", "text", "complaint"),
    [
        ("--rules", "(SETQ x 1)", ":1: x is a sensor: it can be read, not assigned"),
        ("--golden", "(SETQ y 1)", "wanted (RULE name expression)"),
    ],
)
def test_options_that_no_robot_can_take_are_refused(
    channel: str, tmp_path: Path, option: str, text: str, complaint: str
) -> None:
    (tmp_path / "given").write_text(text)
    place = ("--channel", channel, "--domain", str(DOMAIN), "--discovery", "localhost")
    refused = called("bridge", "ros2", *place, "--robot", "scout1", "--no-store", option, str(tmp_path / "given"))
    assert refused.status == 2, refused
    assert complaint in refused.err
    assert "Traceback" not in refused.err


def test_a_unit_that_does_not_fit_is_refused_with_its_place(channel: str, tmp_path: Path) -> None:
    file = tmp_path / "rover.toml"
    file.write_text(TURTLEBOT.read_text().replace('"speed", turn_rate', '"speed kg", turn_rate', 1))
    refused = called("bridge", "ros2", "--channel", channel, "--mapping", str(file))
    assert refused.status == 2
    assert 'speed of Odometry is a speed, and "kg" is a unit of a mass' in refused.err
    assert f"{file}:" in refused.err
