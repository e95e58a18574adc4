"""Looking at robots on the air: who would obey, why one did not, a table that lives, and who was ever heard."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from channel.test_udp import free_port
from cli.calling import called_warm
from cli.terminal import terminal
from cli.test_swarm import channel, in_time, swarm
from processes import live_in
from sleepcast.station.validation import TEST_UNKNOWN

__all__ = ["channel"]

TEACHING = """(DEFUN late (n) (> id n))
(RULE keep (WHEN (late 4) (SETQ marked 1)))
(DEFVAR twice (* 2 id))
(WHEN (late 2) (JOIN bravo))
"""


@pytest.fixture(scope="module")
def taught(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The channel of six robots that have learned something."""
    home = tmp_path_factory.mktemp("home")
    rules = home / "begin.sleep"
    rules.write_text(TEACHING)
    uri = f"udp://239.255.83.79:{free_port()}?interface=lo"
    with pytest.MonkeyPatch.context() as patch:
        live_in(home, patch)
        with swarm(6, uri, "--rules", str(rules)):
            yield uri


def told(channel: str, *arguments: str) -> dict[str, object]:
    found = in_time(channel, *arguments)
    assert found.status == 0, found.err
    said: dict[str, object] = json.loads(found.out.splitlines()[0])
    return said


WORTHY = "(WHEN (AND (late 3) (> twice 9) (IN bravo)) (JOIN charlie))"


def test_who_would_obey_is_said_before_anything_is_sent(taught: str) -> None:
    found = told(taught, "who", WORTHY)
    assert (found["yes"], found["no"], found["unknown"]) == (["r5", "r6"], ["r1", "r2", "r3", "r4"], {})
    assert (found["n_yes"], found["n_no"], found["n_unknown"], found["polled"]) == (2, 4, 0, False)
    assert isinstance(found["oldest"], float)
    assert told(taught, "who", "(WHEN (> (SONAR 0) 0) (JOIN charlie))")["n_unknown"] == 6, "no telemetry tells it"


def test_robots_are_asked_who_would_obey(taught: str) -> None:
    polled = told(taught, "who", "--poll", WORTHY)
    assert (polled["yes"], polled["no"], polled["polled"]) == (["r5", "r6"], ["r1", "r2", "r3", "r4"], True)
    assert told(taught, "who", "--poll", "(> id 4)")["yes"] == ["r5", "r6"]
    unknown = told(taught, "who", "--poll", "(> fule 4)")
    assert (unknown["n_yes"], unknown["n_no"], set(unknown["unknown"].values())) == (0, 0, {TEST_UNKNOWN})


@pytest.mark.parametrize("test", ["(> id 4)", "(NOT (< id 5))", "(OR (= id 5) (= id 6))", "(AND (> id 4) (KNOWN id))"])
def test_a_test_alone_is_a_question_of_who(taught: str, test: str) -> None:
    alone = told(taught, "who", test)
    assert (alone["yes"], alone["everybody"], alone["text"]) == (["r5", "r6"], False, test)


def test_what_has_no_test_is_obeyed_by_all(taught: str) -> None:
    assert told(taught, "who", "(+ 1 id)")["n_yes"] == 6, "whoever hears it evaluates it"


def test_why_a_robot_obeyed_no_command_is_told_as_foreseen(taught: str) -> None:
    sent = told(taught, "send", WORTHY)
    assert (sent["predicted"], sorted(map(str, sent["matched"]))) == (["r5", "r6"], ["r5", "r6"])
    why = told(taught, "why", "r4", str(sent["id"]))
    assert (why["robot"], why["matched"], why["reason"]) == ("r4", False, "twice = 8, needed > 9")


def test_why_a_rule_was_obeyed_is_told(taught: str) -> None:
    rule = called_warm("why", "r5", "keep", "--channel", taught)
    assert "r5, keep: obeyed" in rule.out
    assert "(late 4)" in rule.out


def test_a_robot_cannot_say_why_of_what_it_does_not_know(taught: str) -> None:
    lost = called_warm("why", "r5", "nothing", "--channel", taught)
    assert (lost.status, lost.out) == (1, "")
    assert "r5 remembers no command or rule nothing" in lost.err


def test_values_are_read_in_their_units(taught: str) -> None:
    asked = called_warm("ask", "(- 1 fuel)", "--channel", taught)
    assert re.search(r"know it: min [\d.]+ %, mean [\d.]+ %, max [\d.]+ %$", asked.out, re.MULTILINE), asked
    sent = told(taught, "send", "(WHEN (AND (> fuel -1) (< (DIST x y 0 0) -1)) (JOIN nobody))")
    why = called_warm("why", "r1", str(sent["id"]), "--channel", taught)
    assert re.search(r"^ *[\d.]+ % +fuel$", why.out, re.MULTILINE), why
    assert re.search(r"^ *[\d.]+ mi +x$", why.out, re.MULTILINE), why
    assert re.search(r"\(DIST x y 0 0\) = [\d.]+ mi, needed < -0.0006214 mi$", why.out), why


def test_a_table_of_robots(taught: str) -> None:
    with terminal(
        ["watch", "--show", "id,twice", "(IN bravo)", "--channel", taught, "--every", "0.2"], Path.home()
    ) as live:
        for _ in range(2):
            live.wait_for("r3")
            live.wait_for("4 robots for which it is true")
        live.interrupt()
        assert live.status() == 130
    assert "r1 " not in live.screen
    found = told(taught, "watch", "--once", "--show", "twice")
    robots = found["robots"]
    assert isinstance(robots, list)
    assert [(each["name"], each["values"]) for each in robots] == [(f"r{i}", {"twice": 2 * i}) for i in range(1, 7)]
    assert ["bravo" in each["groups"] for each in robots] == [False] * 2 + [True] * 4
    assert {(each["stopped"], each["rules"]) for each in robots} == {(False, 1)}
    missing = called_warm("watch", "--once", "--show", "twce", "--channel", taught)
    assert (missing.status, missing.out) == (2, "")
    assert "did you mean twice" in missing.err


def test_what_was_told_is_kept_and_grows_old(channel: str) -> None:
    with swarm(3, channel):
        assert told(channel, "who", "(WHEN (> id 1) (JOIN bravo))")["yes"] == ["r2", "r3"]
    late = time.monotonic() + 5.0
    found = json.loads(called_warm("roster", "--json").out)
    assert sorted(each["name"] for each in found["robots"]) == ["r1", "r2", "r3"]
    assert all(0 <= each["heard"] < 600 for each in found["robots"])
    assert "2 robots were heard" in called_warm("roster", "--forget", "r3").out
    unknown = called_warm("roster", "--forget", "r3")
    assert unknown.status == 2
    assert "no robot 'r3' was ever heard" in unknown.err
    lost = called_warm("why", "r1", "--channel", channel)
    assert (lost.status, lost.out) == (1, "")
    assert "r1 does not answer (last heard" in lost.err
    time.sleep(max(0.0, late - time.monotonic()))
    heard = told(channel, "who", "--told", "(WHEN (> id 1) (JOIN bravo))")
    assert set(heard["unknown"].values()) == {"its last news is too old"}
    asked_sonar = called_warm("who", "--told", "(WHEN (> (SONAR 1 2) 1) (JOIN bravo))", "--channel", channel)
    assert "(SONAR number) takes 1 argument, got 2" in asked_sonar.err, "the names are known without anybody there"
    assert (asked_sonar.status, "by the names of scout (r1, r2, r3)" in asked_sonar.err) == (
        0,
        True,
    )  # and refuse nothing


def test_nobody_there(channel: str) -> None:
    found = called_warm("who", "(WHEN (> id 1) (ST))", "--channel", channel, "--within", "0")
    assert found.status == 1
    assert "nobody is known here" in found.out
    assert told(channel, "watch", "--once", "--within", "0")["robots"] == []
