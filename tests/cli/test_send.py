"""`send` and its kin as a person and a script meet them: how many are meant, stages, leases, and an honest stop."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from channel.test_udp import free_port
from cli.calling import Called, again_until, called_warm
from cli.terminal import terminal
from cli.test_swarm import account, channel, swarm
from counting import ONCE, counted
from processes import live_in
from sleepcast.cli import main

__all__ = ["channel"]

ROBOTS = 12
MARK = "(WHEN (> id 0) (MARK))"
DOUBTED = "(WHEN (> id 0) (> id 6) (MARK))"


def told(found: Called) -> dict[str, Any]:
    said: dict[str, Any] = json.loads(found.out)
    return said


@pytest.fixture(scope="module")
def dozen(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The channel of twelve robots, of which the desk of a home of its own has heard."""
    uri = f"udp://239.255.83.78:{free_port()}?interface=lo"
    with pytest.MonkeyPatch.context() as patch:
        live_in(tmp_path_factory.mktemp("home"), patch)
        with swarm(ROBOTS, uri):
            again_until(lambda asked: asked["n"] == ROBOTS, lambda: account(uri, "ask", "id"))
            yield uri


@pytest.fixture
def on_air(dozen: str) -> Callable[..., Called]:
    return lambda *arguments: called_warm(*arguments, "--channel", dozen)


def foreseen(channel: str, count: int, *arguments: str) -> dict[str, Any]:
    """What becomes of a command that so many were to obey; said again where some were too late to tell of it."""
    return again_until(lambda found: found["n_predicted"] == count, lambda: account(channel, "send", *arguments))


def test_a_script_that_does_not_say_how_many_are_meant_is_refused(on_air: Callable[..., Called]) -> None:
    refused = on_air("send", MARK, "--json")
    assert (refused.status, refused.out) == (2, "")
    assert "12 may obey, say how many are meant" in refused.err


def test_a_person_is_asked_how_many_are_meant(dozen: str) -> None:
    with terminal(["send", MARK, "--channel", dozen], Path.home()) as person:
        person.wait_for("would obey 12: r1, r2, r3")
        person.wait_for("Robots that are meant:")
        person.type("12\r")
        person.wait_for("matched 12")
        assert person.status() == 0


def test_what_is_hardly_meant_is_not_sent_for_a_script_unless_it_insists(on_air: Callable[..., Called]) -> None:
    doubted = on_air("send", "--count", "12", DOUBTED)
    assert (doubted.status, doubted.out) == (2, "")
    assert "(did you mean (AND (> id 0) (> id 6))?)" in doubted.err
    assert "Nothing was sent" in doubted.err
    assert told(on_air("send", "--anyway", "--count", "12", DOUBTED, "--json"))["n_matched"] == ROBOTS


def test_the_best_four_obey_and_a_script_is_told_who_bid(dozen: str) -> None:
    text = "(BEST 4 (- 20 id) (< id 10) (MARK) :window 2s)"
    found = again_until(
        lambda told: told["n_matched"] == 4 and not told["n_silent"], lambda: account(dozen, "send", text)
    )
    assert found["matched"] == found["auction"]["chosen"][::-1] == ["r6", "r7", "r8", "r9"]
    assert found["auction"]["bids"]["r9"] == 11.0
    assert found["auction"]["outbid"]["r5"] == ["r9", "r8", "r7", "r6"]
    assert set(found["not_matched"]) == {f"r{n}" for n in (1, 2, 3, 4, 5, 10, 11, 12)}


def test_a_person_is_told_who_was_chosen_and_who_was_outbid_by_whom(on_air: Callable[..., Called]) -> None:
    text = "(BEST 1 id (< id 3) (MARK) :window 2s)"
    foretold = "would bid 2: r1, r2; cannot say 0; would not 10; 1 at most will obey"
    told_of = again_until(
        lambda found: "chosen r1 (1)" in found.out and foretold in found.err, lambda: on_air("send", text)
    )
    assert "outbid 1: r2 by r1" in told_of.out
    quorum = again_until(lambda found: "silent 0" in found.out, lambda: on_air("send", "(QUORUM 5 8 (< id 3) (MARK))"))
    assert "wanted 5: nobody was chosen" in quorum.out
    assert "outbid" not in quorum.out
    unsure = again_until(
        lambda found: "silent 0" in found.out, lambda: on_air("send", "(BEST 1 UNKNOWN (< id 3) (MARK))")
    )
    assert "test or cost unknown 2: r1, r2" in unsure.out


def test_who_sends_is_told_that_robots_wait_where_there_is_time_to_call_it_off(on_air: Callable[..., Called]) -> None:
    assert "robots wait for" in on_air("send", "(AFTER-ISSUE 3s (WHEN (< id 4) (MARK)))").err
    assert "robots wait for" not in on_air("send", "(AFTER-ISSUE 1ms (WHEN (< id 4) (MARK)))").err


def test_robots_wait_for_an_instant_and_a_script_is_told_within_which_bound_they_obeyed(dozen: str) -> None:
    found = again_until(
        lambda told: told["n_matched"] == 3 and not told["n_waiting"],
        lambda: account(dozen, "send", "(AFTER-ISSUE 2s (WHEN (< id 4) (MARK)))"),
    )
    assert (found["matched"], found["n_not_matched"]) == (["r1", "r2", "r3"], 9)
    assert found["bound"] > 0.0


def test_a_time_of_day_that_is_none_is_refused(on_air: Callable[..., Called]) -> None:
    refused = on_air("send", "--all", "--at", "25:00", "(MARK)")
    assert refused.status == 2
    assert "wanted hours, minutes and seconds, such as 12:30:05" in refused.err


def test_a_person_is_asked_about_what_is_hardly_meant(dozen: str) -> None:
    with terminal(["send", DOUBTED, "--count", "12", "--channel", dozen], Path.home()) as person:
        person.wait_for("did you mean (AND (> id 0) (> id 6))?")
        person.wait_for("Send it as it stands?")
        person.type("y\r")
        person.wait_for("matched 12")
        assert person.status() == 0


def test_a_text_is_read_checked_and_foreseen_once(dozen: str) -> None:
    with counted() as found:  # robots have told their names, so they are what they were when it was read
        assert main(["send", "--count", "12", "--channel", dozen, MARK]) == 0
    assert found == ONCE


def test_in_stages_one_robot_is_first_then_two_then_all_others(dozen: str) -> None:
    staged = foreseen(dozen, 12, "--staged", "--count", "12", MARK)
    assert [stage["n_matched"] for stage in staged["stages"]] == [1, 2, 9]
    assert (staged["n_matched"], staged["n_silent"], staged["n_predicted"]) == (12, 0, 12)


def test_a_stage_with_a_fault_is_the_last(on_air: Callable[..., Called]) -> None:
    halted = on_air("send", "--staged", "--count", "12", "(WHEN (> id 0) (PROGN (MARK) (/ 1 0)))")
    assert halted.status == 1
    assert "not sent to the other robots" in halted.err


def test_only_those_that_are_named_obey(on_air: Callable[..., Called]) -> None:
    only = told(on_air("send", "--only", "r3,r10", "(MARK)", "--json"))
    assert (only["matched"], only["n_silent"], only["not_matched"]) == (["r3", "r10"], 0, [])


def test_who_obeys_by_chance_is_not_foreseen(on_air: Callable[..., Called]) -> None:
    chance = told(on_air("send", "--count", "12", "(WHEN (PROB 0.5) (MARK))", "--json"))
    assert chance["n_predicted"] == 0, "nobody can say who will"


def test_who_obeys_what_no_telemetry_tells_is_asked(dozen: str) -> None:
    sonar = foreseen(dozen, 3, "(WHEN (OR (> id 9) (> (SONAR 0) 900km)) (MARK))")
    assert sonar["predicted"] == sonar["matched"] == ["r10", "r11", "r12"], "the others were asked themselves"
    assert sonar["n_not_matched"] == 9


def test_a_lease_is_answered_by_all(on_air: Callable[..., Called]) -> None:
    assert told(on_air("lease", "take", "bravo", "--seconds", "9", "--json"))["n_not_matched"] == ROBOTS


def test_a_question_is_told_as_numbers(on_air: Callable[..., Called]) -> None:
    asked = told(on_air("ask", "id", "--json"))
    assert [asked[key] for key in ("answers", "n", "min", "mean", "max")] == [12, 12, 1.0, 6.5, 12.0]
    assert asked["histogram"] == {"low": 1.0, "high": 12.0, "counts": [2, 1, 1, 1, 1, 1, 1, 1, 1, 2]}


def test_robots_that_are_gone_do_not_confirm_stop(channel: str) -> None:
    with swarm(2, channel) as process:
        again_until(lambda asked: asked["n"] == 2, lambda: account(channel, "ask", "id"))
        process.kill()
        process.wait()
    stopped = called_warm("stop", "--seconds", "1", "--json", "--channel", channel)
    assert (stopped.status, told(stopped)["n_silent"], told(stopped)["matched"]) == (1, 2, [])


def test_what_robots_told_before_a_command_does_not_foresee_who_obeys_the_next(channel: str) -> None:
    with swarm(3, channel) as process:
        assert account(channel, "send", "--all", "(JOIN bravo)")["n_matched"] == 3
        process.kill()  # they say nothing new
        process.wait()
        found = called_warm("who", "(WHEN (IN bravo) (MARK))", "--channel", channel)
        assert "would not 0\n  unknown 3: r1 (it" in found.out  # was commanded since its last news, or that is too old
        for more in ((), ("--anyway",), ("--only", "r2")):  # robots that have left refuse nothing
            sent = called_warm("send", "--all", "(DRIVE 1)", "--channel", channel, *more)
            assert "takes 2 arguments, got 1 at 1:1, by the names of scout (r1, r2, r3)" in sent.err
            assert "silent" in sent.out, (sent, more)


def test_a_name_that_no_robot_has_is_told_before_anything_is_sent(channel: str, tmp_path: Path) -> None:
    def on_air(*arguments: str) -> Called:
        return called_warm(*arguments, "--channel", channel)

    wrong, nobody = "(WHEN (> feul 50%) (MARK))", "none of the 3 robots that have sent telemetry has "
    with swarm(3, channel):
        for asked in (("ask", "feul"), ("send", wrong), ("send", wrong, "--json"), ("ask", "(TUMBEL)")):
            refused = again_until(lambda found: nobody in found.err, partial(on_air, *asked))
            assert (refused.status, refused.out) == (2, ""), asked
            assert "did you mean" in refused.err
            assert "nothing was sent. Send it as it is with --anyway" in refused.err
        insisted = on_air("ask", "feul", "--anyway")
        assert (insisted.status, "none of them knows the value" in insisted.out) == (0, True)
        assert told(on_air("send", wrong, "--anyway", "--json"))["unknown"] == ["r1", "r2", "r3"]
        for typed, said in (("n\r", "so nothing was sent"), ("y\r", "test unknown 3: r1, r2, r3")):
            with terminal(["send", wrong, "--channel", channel], tmp_path) as person:
                person.wait_for("has feul. Send it all the same?")
                person.type(typed)
                person.wait_for(said)
        assert on_air("ask", "fuel").status == 0
        assert account(channel, "send", "--all", "(JOIN bravo)")["n_matched"] == 3
        for asked in (("ask", "(IN brvo)"), ("send", "(WHEN (IN brvo) (MARK))"), ("send", "--all", "(LEAVE brvo)")):
            refused = again_until(lambda found: "did you mean bravo?" in found.err, partial(on_air, *asked))
            assert (refused.status, refused.out) == (2, ""), asked
        assert "did you mean bravo?" in on_air("lease", "take", "brvo").err
        assert on_air("send", "(DEFVAR feul 1)", "--all").status == 0
        now_they_have = again_until(lambda found: found.out, lambda: on_air("ask", "feul", "--json"))
        assert told(now_they_have)["n"] == 3


def test_what_does_not_go_together(channel: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Misuse of every sort: exit status 2, nothing on standard output, a sentence, and nothing is sent."""
    wrong = {
        ("send", MARK, "--staged", "--only", "r1"): "do not go together",
        ("send", MARK, "--only", " , "): "names nobody",
        ("send", MARK, "--only", "nobody", "--blind"): 'no robot "nobody"',
        ("send", MARK, "--deadline", "0", "--blind"): "a deadline lies",
        ("send", MARK, "--deadline", "nan", "--blind"): 'wanted a time such as "30s", not "nan"',
        ("send", MARK, "--standing", "--deadline", "5", "--blind"): "no deadline",
        ("send", MARK, "--within", "nan"): 'wanted a time such as "30s", not "nan"',
        ("send", MARK, "--hold", "-1"): 'wanted a time from 0 to 86400, not "-1"',
        ("send", MARK, "--count", "0"): "not in the range",
        ("send", MARK, "--count", "3", "--blind"): "nothing was sent",
        ("lease", "grant", "bravo"): "--to NAME",
        ("lease", "take", "bra vo"): "not a group's name",
        ("lease", "take", ""): "not a group's name",
        ("lease", "take", "bravo", "--seconds", "2h"): "a lease is for 0 s to 1 h, not 7200 s",
        ("lease", "give", "bravo", "--keep"): "--keep goes with",
    }
    for arguments, complaint in wrong.items():
        assert main([*arguments, "--channel", channel]) == 2, arguments
        told = capsys.readouterr()
        assert told.out == ""
        assert complaint in told.err, arguments
