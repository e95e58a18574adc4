"""`stop` as a person and a script meet it: it goes on until everybody has confirmed, and says why nobody does."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from channel.test_udp import free_port
from cli.calling import LONGEST, Called, again_until, called_warm
from cli.terminal import terminal
from cli.test_swarm import account, at_rest, channel, swarm
from processes import SLEEPCAST, live_in, running
from sleepcast.station.roster import FleetFile
from small_worlds import write

__all__ = ["channel"]


def wait_for(process: subprocess.Popen[str], text: str) -> list[str]:
    """The lines on standard error up to the first one with this text."""
    assert process.stderr is not None
    lines: list[str] = []
    for line in process.stderr:
        lines.append(line.rstrip("\n"))
        if text in line:
            return lines
    raise AssertionError(f"it ended, and said {lines}")


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The channel of the robots r1 to r3, whose desk has heard them."""
    uri = f"udp://239.255.83.78:{free_port()}?interface=lo"
    with pytest.MonkeyPatch.context() as patch:
        home = tmp_path_factory.mktemp("home")
        live_in(home, patch)
        with swarm(3, uri, *at_rest(home)):
            again_until(lambda asked: asked["n"] == 3, lambda: account(uri, "ask", "id"))
            yield uri


@pytest.fixture
def on_air(three: str) -> Callable[..., Called]:
    return lambda *arguments: called_warm(*arguments, "--channel", three)


@pytest.fixture
def expected(tmp_path: Path) -> str:
    """A file that names these three and one more, which was never heard."""
    file = tmp_path / "fleet.txt"
    file.write_text("r1 r2 r3\nr4 # in the workshop\n")
    return str(file)


@pytest.fixture
def four(on_air: Callable[..., Called], expected: str) -> Iterator[Called]:
    """The desk expects these four as long as this lasts; what it says when it is told so."""
    yield on_air("roster", "--expect", expected)
    on_air("roster", "--expect", "none")


def given_up(on_air: Callable[..., Called], said: str, *arguments: str) -> Called:
    """STOP, given up after a moment; once more where robots of a busy machine did not confirm it within that."""
    return again_until(lambda found: said in found.out, lambda: on_air("stop", *arguments))


def test_those_that_are_expected_and_say_nothing_are_silent(on_air: Callable[..., Called]) -> None:
    asked = again_until(
        lambda found: found["answers"] == 3, lambda: json.loads(on_air("ask", "id", "--expect", "5", "--json").out)
    )
    assert (asked["n_silent"], asked["n_nameless"]) == (2, 2)
    assert (asked["robots"], asked["expected"]) == (5, True)


def test_where_nobody_is_expected_all_count_that_were_heard(on_air: Callable[..., Called]) -> None:
    again_until(lambda found: "silent 0 of 3 robots heard so far" in found.out, lambda: on_air("ask", "id"))
    again_until(lambda found: "would obey 3" in found.out, lambda: on_air("who", "(> id 0)"))


def test_looks_have_a_row_for_each_that_is_expected(on_air: Callable[..., Called], expected: str) -> None:
    who = again_until(
        lambda found: found["n_yes"] == 3,
        lambda: json.loads(on_air("who", "(> id 0)", "--expect", expected, "--json").out),
    )
    assert who["unknown"] == {"r4": "it has sent no telemetry yet"}
    watched = json.loads(on_air("watch", "--once", "--expect", expected, "--json").out)
    assert (len(watched["robots"]), watched["expected"], watched["silent"]) == (4, 4, 1)


def test_given_up_it_says_who_has_not_confirmed(on_air: Callable[..., Called], expected: str) -> None:
    said = "silent 1 of 4 robots: r4 (never heard)"
    waited = given_up(on_air, said, "--expect", expected, "--timeout", "1")
    assert waited.status == 1
    assert "not confirmed by 1 of 4 robots" in waited.err
    assert "STOP goes out with the key of desk (commander, " in waited.err


def test_who_is_expected_is_remembered(three: str, four: Called) -> None:
    assert four.status == 0
    assert "r4  never heard" in four.out
    assert f"4 are expected on {three}" in four.out


def test_it_goes_on_until_ctrl_c_and_says_then_who_has_confirmed(three: str, four: Called) -> None:
    with running(*SLEEPCAST, "stop", "--channel", three) as stop:
        said = wait_for(stop, "stopped 3, silent 1 of 4 robots: r4")
        assert len([line for line in said if "stopped" in line]) <= 3, "a line where something has changed"
        stop.send_signal(signal.SIGINT)
        out, err = stop.communicate(timeout=LONGEST)
    assert stop.returncode == 1
    assert "ended by Ctrl-C; STOP is not sent any more" in err
    assert "stopped 3: r1, r2, r3" in out
    assert "silent 1 of 4 robots: r4 (never heard)" in out


def test_it_goes_on_until_each_expected_robot_has_confirmed(channel: str, tmp_path: Path) -> None:
    def on_air(*arguments: str) -> Called:
        return called_warm(*arguments, "--channel", channel)

    (tmp_path / "fleet.txt").write_text("r1 r2")
    with swarm(1, channel, *at_rest(tmp_path)):
        assert on_air("roster", "--expect", str(tmp_path / "fleet.txt")).status == 0
        with running(*SLEEPCAST, "stop", "--channel", channel) as stop:
            wait_for(stop, "silent 1 of 2 robots: r2")
            with swarm(1, channel, "--first", "2", *at_rest(tmp_path)):
                out, _ = stop.communicate(timeout=LONGEST)
                assert stop.returncode == 0
                assert "stopped 2: r1, r2" in out
        assert given_up(on_air, "silent 1 of 2 robots: r2 (last heard", "--timeout", "1").status == 1
        assert on_air("roster", "--forget", "r2", "--expect", "heard").status == 0
        assert on_air("stop").status == 0, "it is expected no more"


def test_a_damaged_file_of_the_expected_is_told_and_stop_does_not_wait_for_it(
    three: str, on_air: Callable[..., Called], four: Called
) -> None:
    FleetFile(three, "sleepcast").file.write_bytes(b"{")
    stopped = given_up(on_air, "stopped 3: r1, r2, r3", "--timeout", "2")
    assert stopped.status == 1
    assert "sleepcast roster --expect" in stopped.err
    assert "sleepcast roster --expect" in on_air("ask", "id").err


def test_those_heard_can_be_expected_and_nobody_again(three: str, on_air: Callable[..., Called], four: Called) -> None:
    file = FleetFile(three, "sleepcast").file
    assert file.exists()
    assert on_air("roster", "--expect", "heard").status == 0
    assert on_air("stop").status == 0
    assert on_air("roster", "--expect", "none").status == 0
    assert not file.exists()


def test_a_missing_file_of_the_expected_ends_a_question_but_no_stop(
    on_air: Callable[..., Called], tmp_path: Path
) -> None:
    assert on_air("stop", "--expect", str(tmp_path / "none")).status == 1
    assert on_air("ask", "id", "--expect", str(tmp_path / "none")).status == 2


def test_it_tells_its_progress_in_one_line_of_a_terminal(channel: str, tmp_path: Path) -> None:
    with swarm(2, channel), terminal(["stop", "--channel", channel, "--expect", "3"], tmp_path) as person:
        person.wait_for("stopped 2, silent 1 of 3 robots")
        person.interrupt()
        person.wait_for("not confirmed by 1 of 3 robots")
        assert person.status() == 1


def test_sigterm_tells_the_truth_as_well(channel: str) -> None:
    with swarm(1, channel), running(*SLEEPCAST, "stop", "--channel", channel, "--expect", "2") as stop:
        wait_for(stop, "stopped 1, silent 1 of 2 robots")
        stop.terminate()
        out, err = stop.communicate(timeout=LONGEST)
        assert stop.returncode == 1
        assert "ended by SIGTERM" in err
        assert "silent 1 of 2 robots: 1 that were never heard" in out


def test_it_ends_when_somebody_releases_the_robots_meanwhile(channel: str) -> None:
    with swarm(1, channel), running(*SLEEPCAST, "stop", "--channel", channel, "--expect", "2") as stop:
        wait_for(stop, "stopped 1, silent 1 of 2 robots")
        assert called_warm("release", "--channel", channel).status == 0
        _, err = stop.communicate(timeout=LONGEST)
        assert stop.returncode == 1
        assert "desk has released the robots meanwhile: they may move" in err


def test_a_key_that_robots_do_not_trust_is_no_radio_silence(channel: str) -> None:
    """Robots say nothing to a stranger. The stranger is told so, and what else is on the air."""
    made = called_warm("keys", "new", "anna", "--role", "operator")
    assert made.status == 0, made.err
    asking = ("ask", "id", "--channel", channel, "--expect", "9", "--within", "60")
    with swarm(2, channel), running(*SLEEPCAST, *asking):
        refused = again_until(
            lambda found: "somebody is there under key " in found.err,
            lambda: called_warm("stop", "--channel", channel, "--key", "anna", "--timeout", "4"),
        )
    assert refused.status == 1
    assert "no robot has confirmed STOP yet" in refused.err
    assert "knows no robot's key" in refused.err
    assert "a robot obeys only if it trusts the key of anna (operator, " in refused.err
    assert "is of the fleet 'sleepcast'" in refused.err


def test_another_fleet_is_no_radio_silence(channel: str) -> None:
    with swarm(2, channel, "--fleet", "other"):
        refused = again_until(
            lambda found: "is of the fleet 'sleepcast'" in found.err,
            lambda: called_warm("stop", "--channel", channel, "--timeout", "3"),
        )
    assert refused.status == 1


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits the files of another process")
def test_a_stop_that_no_disk_holds_is_no_success_and_the_next_life_begins_stopped(channel: str, tmp_path: Path) -> None:
    import resource

    store, both = tmp_path / "two.store", ["r1", "r2"]

    def told(*arguments: str) -> Any:
        return json.loads(called_warm(*arguments, "--json", "--channel", channel).out)

    with swarm(2, channel, "--store", str(store), *at_rest(tmp_path)) as process:
        soft, hard = resource.prlimit(process.pid, resource.RLIMIT_FSIZE)
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (1, hard))
        stopped = called_warm("stop", "--expect", "2", "--channel", channel)
        assert stopped.status == 1
        assert "not stored, so a restart may forget it 2: r1, r2" in stopped.out
        assert "STOP could not be stored everywhere, so a restart may forget it" in stopped.err
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (soft, hard))
        again_until(lambda found: (found["matched"], found["n_not_stored"]) == (both, 0), lambda: told("release"))
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (1, hard))
        assert told("stop", "--expect", "2")["not_stored"] == both
        process.kill()
    with swarm(2, channel, "--store", str(store), *at_rest(tmp_path)):
        robots = again_until(
            lambda found: [robot["told"] is not None for robot in found] == [True, True],
            lambda: told("watch", "--once")["robots"],
        )
        assert [(robot["stopped"], robot["doubt"]) for robot in robots] == [(True, "its store has lost its marker")] * 2


def test_it_goes_on_until_all_are_at_rest(channel: str, tmp_path: Path) -> None:
    """From 5 m/s these brake at 1 m/s2, so they have accepted STOP long before they stand."""

    def on_air(*arguments: str) -> Called:
        return called_warm(*arguments, "--channel", channel)

    def moving(found: Called) -> dict[str, dict[str, float]]:
        return dict(json.loads(found.out)["stopping"])

    def driven() -> tuple[Called, Called]:
        """Who moves when STOP is accepted, and what is said from then on; once more where robots of a busy machine did
        not hear of it in time, or stood before it was asked."""
        on_air("release")
        on_air("send", "--all", "(DRIVE 5m/s 0)", "--hold", "4")
        return on_air("stop", "--accepted", "--json"), on_air("stop")

    slow = write(tmp_path, ('acceleration = "2m/s2"', 'acceleration = "1m/s2"'))
    with swarm(2, channel, "--scenario", str(slow)):
        accepted, done = again_until(
            lambda found: len(moving(found[0])) == 2 and "still moving" in found[1].err, driven
        )
        assert accepted.status == 0, "that is what was asked for"
        for state in moving(accepted).values():
            assert state["distance"] == pytest.approx(state["speed"] ** 2 / 2)
        assert done.status == 0
        assert "stopped 2: r1, r2\n  at rest 2\n  silent 0" in done.out
        assert "AT REST" in on_air("watch", "--once").out
        found = json.loads(on_air("stop", "--json").out)
        assert (found["n_at_rest"], found["n_stopping"], found["n_accepted"]) == (2, 0, 0)
        assert (found["at_rest"], found["stopping"]) == (["r1", "r2"], {})
