"""Which robots there are, as somebody has said: whoever was never heard is silent, by name or as one of a number."""

from __future__ import annotations

from pathlib import Path

import pytest

from safety.scene import Scene
from sleepcast.station.prepared import Terms
from sleepcast.station.roster import (
    MAX_ROBOTS,
    NOBODY_SAID,
    Expectation,
    ExpectationError,
    FleetFile,
    FleetFileLostError,
    read_expectation,
)
from sleepcast.station.validation import Audience, CountNeededError, SendPolicy

HUNDRED = Expectation(size=100)


def test_robots_that_a_fresh_desk_never_heard_are_silent() -> None:
    """At 40 % loss; ten of a hundred have no power."""
    scene = Scene(robots=100, loss=0.4, seed=5)
    for number in range(10):
        scene.fleet[f"r{number}"].on = False
    desk = scene.desk(heard=(), expected=HUNDRED)
    asked = desk.ask("fuel")
    scene.run(0.1)
    early = desk.accounting(asked.id)
    assert 0 < early.n_matched < 90
    assert early.n_matched + early.n_silent == early.total == 100
    scene.run(4.0)
    found = desk.accounting(asked.id)
    assert (found.n_matched, found.n_silent, found.complete) == (90, 10, False), "lost answers are asked for again"
    assert found.silence() == "silent 10 of 100 robots: 10 that were never heard"
    assert found.sentence().endswith(found.silence())


def test_without_that_the_account_says_among_whom_it_counts() -> None:
    scene = Scene(robots=100, loss=0.4, seed=5)
    desk = scene.desk(heard=())
    asked = desk.ask("fuel")
    scene.run(0.5)
    found = desk.accounting(asked.id)
    assert 0 < found.n_matched < 100
    assert found.silence() == f"silent 0 of {found.n_matched} robots heard so far"


def test_a_lost_answer_to_a_command_is_asked_for_without_a_name() -> None:
    """A command is evaluated once, so that only its answer can be said again: by those whose answers have not come."""
    scene = Scene(robots=40, loss=0.5, seed=2)
    desk = scene.desk(heard=(), expected=Expectation(size=40))
    sent = desk.send("(WHEN (> id 19) (DRIVE 1))", count=40)
    scene.run(4.9)
    found = desk.accounting(sent.id)
    assert (found.n_matched, found.n_not_matched, found.n_silent) == (20, 20, 0)
    assert all(len(robot.body.driven) == (number > 19) for number, robot in enumerate(scene.fleet.values()))


def test_a_robot_that_comes_into_reach_before_the_deadline_obeys_and_is_counted() -> None:
    scene = Scene(robots=5)
    scene.fleet["r3"].on = False
    desk = scene.desk(heard=(), expected=Expectation(size=5))
    sent = desk.send("(WHEN (> id 2) (DRIVE 1))", count=5, deadline=60.0)
    scene.run(5.0)
    before = desk.session.delivery.next_number
    scene.run(15.0)
    assert desk.accounting(sent.id).n_silent == 1
    asked = desk.session.delivery.next_number - before
    assert 0 < asked < 8, "less and less often"
    scene.fleet["r3"].on = True
    scene.run(15.0)
    assert desk.accounting(sent.id).complete
    assert len(scene.fleet["r3"].body.driven) == 1


@pytest.mark.parametrize("expected", [Expectation(size=5), Expectation.of(f"r{i}" for i in range(5))])
def test_stop_goes_on_until_the_last_expected_robot_has_confirmed(expected: Expectation) -> None:
    scene = Scene(robots=5)
    scene.isolate("r3")
    desk = scene.desk(heard=(), expected=expected)
    for other in scene.fleet:
        scene.deaf |= {("r3", other), (other, "r3")}
    scene.deaf |= {("r3", "chief"), ("chief", "r3")}
    stop = desk.stop()
    scene.run(20.0)
    found = desk.accounting(stop.id)
    assert (found.n_matched, found.n_silent) == (4, 1)
    named = "r3 (never heard)" if expected.names else "1 that were never heard"
    assert found.silence() == f"silent 1 of 5 robots: {named}"
    scene.join("r3")
    scene.run(2.0)
    assert desk.accounting(stop.id).complete
    assert scene.fleet["r3"].node.stopped


def test_release_goes_on_for_robots_out_of_reach_but_less_and_less_often() -> None:
    scene = Scene(robots=5)
    desk = scene.desk(heard=(), expected=Expectation(size=5))
    desk.stop()
    scene.run(1.0)
    assert scene.fleet["r3"].node.stopped
    scene.isolate("r3")
    release = desk.release()
    scene.run(5.0)
    before = desk.session.delivery.next_number
    scene.run(115.0)
    assert desk.accounting(release.id).n_silent == 1
    assert 0 < desk.session.delivery.next_number - before < 15
    scene.join("r3")
    scene.run(35.0)
    assert desk.accounting(release.id).complete
    assert not scene.fleet["r3"].node.stopped


def test_robots_that_were_never_heard_may_obey_too() -> None:
    scene = Scene(robots=3, policy=SendPolicy(above=10))
    desk = scene.desk(expected=HUNDRED)
    text = "(WHEN (> id 1) (DRIVE 1))"
    assert desk.prepare(text).may == 100
    assert desk.prepare(text, Terms(audience=Audience(["r1"]))).may == 1
    assert desk.preview(text).reasons == {"it has sent no telemetry yet": 100}
    with pytest.raises(CountNeededError, match="100 may obey"):
        desk.send(text)
    only = desk.send(text, only=["r1"])
    but = desk.send(text, but=["r1"], count=99)
    scene.run(0.5)
    assert desk.accounting(only.id).silence() == "silent 0"
    found = desk.accounting(but.id)
    assert (found.total, found.n_silent, found.n_nameless) == (99, 97, 97)


def test_more_robots_than_expected_are_no_fewer() -> None:
    scene = Scene(robots=5)
    desk = scene.desk(heard=(), expected=Expectation.of(["r1", "r9"]))
    asked = desk.ask("fuel")
    scene.run(1.0)
    found = desk.accounting(asked.id)
    assert (found.n_matched, found.silent, found.total) == (5, ("r9",), 6)


def test_a_number_or_a_file_says_who_there_is(tmp_path: Path) -> None:
    file = tmp_path / "fleet.txt"
    file.write_text("r1, r2  # two of a kind\n\n# none\nr2 drone-7\n")
    assert read_expectation("100") == HUNDRED
    assert read_expectation(str(file)) == Expectation(("r1", "r2", "drone-7"), 3)


@pytest.mark.parametrize("said", ["0", "00", str(MAX_ROBOTS + 1), "9" * 5_000, "-3", "1e3", "no/such/file", "/", ""])
def test_what_says_nothing_of_the_sort_is_refused(said: str) -> None:
    with pytest.raises(ExpectationError, match=r"cannot be expected|cannot read"):
        read_expectation(said)


@pytest.mark.parametrize("written", [b"", b"# nobody", b"a" * 200, b"\xff\xfe", b"r1\x00", b"r1 \x1b[2J"])
def test_a_file_without_names_is_refused(written: bytes, tmp_path: Path) -> None:
    file = tmp_path / "fleet.txt"
    file.write_bytes(written)
    with pytest.raises(ExpectationError, match=r"names no robot|is not UTF-8"):
        read_expectation(str(file))


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FleetFile:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    return FleetFile("udp://127.255.255.255:9", "lab")


def test_what_is_kept_is_kept_for_each_channel_and_fleet(kept: FleetFile) -> None:
    assert kept.read() == NOBODY_SAID
    named = Expectation.of(["r1", "r2"])
    for expected in (HUNDRED, named):
        kept.write(expected)
        assert FleetFile("udp://127.255.255.255:9", "lab").read() == expected
    assert FleetFile("udp://127.255.255.255:9", "other").read() == NOBODY_SAID
    assert FleetFile("udp://127.255.255.255:10", "lab").read() == NOBODY_SAID
    kept.remove()
    kept.remove()
    assert kept.read() == NOBODY_SAID


@pytest.mark.parametrize(
    "written",
    [
        b"",
        b"{}",
        b"[" * 100_000,
        b"\xff",
        b'{"format":2,"channel":"","fleet":"","size":3,"names":[]}',
        b'{"format":1,"channel":"","fleet":"","size":1,"names":["a","b"]}',
        b'{"format":1,"channel":"","fleet":"","size":-1,"names":[]}',
        b'{"format":1,"channel":"","fleet":"","size":2,"names":["a b"]}',
    ],
)
def test_a_damaged_fleet_file_is_refused_and_can_be_replaced(kept: FleetFile, written: bytes) -> None:
    kept.write(HUNDRED)
    kept.file.write_bytes(written)
    with pytest.raises(ExpectationError):
        kept.read()
    kept.write(HUNDRED)
    assert kept.read() == HUNDRED


def test_a_fleet_file_that_cannot_be_written_says_so(kept: FleetFile) -> None:
    kept.file.parent.parent.mkdir(parents=True, exist_ok=True)
    kept.file.parent.write_text("in the way")
    with pytest.raises(FleetFileLostError, match="cannot write"):
        kept.write(HUNDRED)
