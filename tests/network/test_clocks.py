"""Real processes whose clocks are wrong, by libfaketime: STOP stops them, and they and the operator are told."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

import forkserver

LIBRARY = next((str(found) for found in Path("/usr/lib").glob("*/faketime/libfaketime.so.1")), "")
pytestmark = pytest.mark.skipif(not LIBRARY, reason="clocks are set wrong with libfaketime: apt install libfaketime")
PATIENCE = 240.0


class Fleet:
    """Swarms and operators on one loopback channel of their own. home: where their files lie."""

    def __init__(self, home: Path, stack: ExitStack) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            self.channel = f"udp://239.255.83.77:{free.getsockname()[1]}?interface=lo"
        self.home, self._stack = home, stack
        self.told: dict[str, Path] = {}

    def _begin(self, arguments: list[str], clock: str, told: Path) -> subprocess.Popen[str]:
        environment = {**os.environ, "XDG_CONFIG_HOME": str(self.home), "XDG_DATA_HOME": str(self.home)}
        if clock:
            environment |= {"LD_PRELOAD": LIBRARY, "DONT_FAKE_MONOTONIC": "1", "FAKETIME_DONT_FAKE_MONOTONIC": "1"}
            environment |= {"FAKETIME_TIMESTAMP_FILE": clock} if "/" in clock else {"FAKETIME": clock}
            environment |= {"FAKETIME_NO_CACHE": "1"}
        command = [sys.executable, "-m", "sleepcast", *arguments, "--channel", self.channel]
        with told.open("w") as errors:
            return forkserver.Popen(
                command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=errors, text=True
            )

    def swarm(self, prefix: str, clock: str = "", count: int = 1) -> None:
        """Robots with this clock: an offset for libfaketime, a moment, or a file of one."""
        self._up(prefix, ["swarm", str(count), "--name-prefix", prefix], clock)

    def node(self, name: str, clock: str) -> None:
        """One robot with this clock."""
        self._up(name, ["node", "--name", name, "--body", "sim"], clock)

    def _up(self, prefix: str, arguments: list[str], clock: str) -> None:
        self.told[prefix] = self.home / f"{prefix}.told"
        process = self._begin(arguments, clock, self.told[prefix])
        self._stack.enter_context(process)  # waits for its end
        self._stack.callback(process.terminate)
        assert process.stdout is not None
        assert re.search(" (is|are) up[:,]", process.stdout.readline()), self.told[prefix].read_text()

    def say(self, *arguments: str, clock: str = "") -> tuple[dict[str, object], str]:
        """What an operator with this clock gets for a command, and what he is told."""
        told = self.home / "operator.told"
        process = self._begin([*arguments, "--json"], clock, told)
        out, _ = process.communicate(timeout=PATIENCE)
        return json.loads(out), told.read_text()


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Fleet]:
    with ExitStack() as stack:
        yield Fleet(tmp_path, stack)


def wait_for(holds: Callable[[], bool]) -> None:
    until = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < until
        time.sleep(0.05)


def says(line: str, told: str) -> bool:
    """Whether somebody was told this. {hour}: 1 h and {day}: 24 h, or what a busy machine makes of them, where
    a message is not looked at at once; {four}: 4 s likewise, or less."""
    numbers = {"hour": "(59 min 5[789] s|1 h)", "day": "24 h", "four": "[34] s"}
    return re.search(f"^(.*: )?{line.format(**numbers)}$", told, re.MULTILINE) is not None


def test_stop_reaches_robots_with_any_clock_and_everybody_is_told(fleet: Fleet) -> None:
    clocks = {"good": "", "hour": "+3600", "late": "-3600", "day": "+86400", "four": "+4"}
    for prefix, clock in clocks.items():
        fleet.swarm(prefix, clock)
    names = sorted(f"{prefix}1" for prefix in clocks)
    heard: set[object] = set()

    def all_have_answered() -> bool:  # what was sent before a robot began is not for it
        answers, _ = fleet.say("ask", "id")
        heard.update(answers["matched"], answers["fault"])  # type: ignore[call-overload]
        return heard == {*names}

    wait_for(all_have_answered)
    lines = (
        "hour1: its clock is {hour} ahead; it obeys STOP only",
        "late1: its clock is {hour} behind; it obeys STOP only",
        "day1: its clock is {day} ahead; it obeys STOP only",
        "four1: its clock is {four} ahead",
    )

    def all_are_told() -> bool:  # a busy machine looks at what robots said too late to know their clocks so well
        sent, told = fleet.say("send", "--all", "--blind", "--deadline", "30", "(SETQ E5 1)")
        assert sorted(sent["matched"]) == ["four1", "good1"]  # type: ignore[call-overload]
        assert sorted(sent["fault"]) == ["day1", "hour1", "late1"]  # type: ignore[call-overload]
        return all(says(line, told) for line in lines)

    wait_for(all_are_told)
    ours = "our clock is {hour} ahead of that of desk: nothing but STOP is obeyed"
    wait_for(lambda: says(ours, fleet.told["hour"].read_text()))
    stopped, _ = fleet.say("stop", "--accepted")
    assert sorted(stopped["matched"]) == names  # type: ignore[call-overload]


def test_an_operator_an_hour_ahead_is_told_so_and_stops_everybody(fleet: Fleet) -> None:
    fleet.swarm("r", count=10)
    wait_for(lambda: fleet.say("ask", "id")[0]["n_matched"] == 10)  # so that an operator knows whom to expect
    stopped, _ = fleet.say("stop", "--accepted", clock="+3600")
    assert stopped["n_matched"] == 10
    yours = (
        "your clock is {hour} ahead of 10 robots: they obey nothing but your STOP; set it, and start sleepcast again"
    )
    wait_for(lambda: says(yours, fleet.say("ask", "id", clock="+3600")[1]))


def test_robots_that_wake_in_1970_take_the_time_from_an_operator_and_obey(fleet: Fleet) -> None:
    fleet.node("r9", "@1970-01-01 00:10:00")
    fleet.swarm("s", "@1970-01-01 00:10:00", count=3)
    taken = "took its time from desk: its clock was 5[0-9] years behind"

    def all_have_it() -> bool:
        fleet.say("ask", "id")
        return all(re.search(taken, fleet.told[each].read_text()) for each in ("r9", "s"))

    wait_for(all_have_it)

    def all_obey() -> bool:  # on a busy machine some answer too late, or what they say is looked at too late
        sent, told = fleet.say("send", "--all", "--blind", "--deadline", "30", "(SETQ E5 1)")
        return sorted(sent["matched"]) == ["r9", "s1", "s2", "s3"] and "clock is" not in told  # type: ignore[call-overload]

    wait_for(all_obey)


def test_a_clock_that_jumps_in_mid_run_changes_nothing(fleet: Fleet) -> None:
    """An administrator sets a robot's clock an hour ahead, and an hour back."""
    file = fleet.home / "clock"
    file.write_text("+0\n")
    fleet.swarm("r", str(file))
    wait_for(lambda: fleet.say("ask", "id")[0]["n_matched"] == 1)  # so that an operator knows whom to expect
    for jump in ("+3600", "-3600", "+0"):
        file.write_text(f"{jump}\n")

        def it_answers() -> bool:
            found, told = fleet.say("ask", "id")
            assert "clock is" not in told
            return (found["n_matched"], found["n_silent"]) == (1, 0)

        wait_for(it_answers)
    assert "clock is" not in fleet.told["r"].read_text()
