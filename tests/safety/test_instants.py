"""An instant for all, on the air: all robots obey at once whatever their clocks show, and whoever is in doubt rests."""

from __future__ import annotations

from random import Random

import pytest

from safety.scene import STEP, Scene
from sleepcast.core.clock import ManualClock
from sleepcast.language import CheckError
from sleepcast.language.reader import ReadError
from sleepcast.mind.instants import MAX_WAITING, MeasuredClocks, UnknownClocks
from sleepcast.station import Account
from sleepcast.station.network import NetworkStation
from sleepcast.station.prepared import Terms
from sleepcast.station.sent import Command
from sleepcast.station.validation import CommandTypeError

NOW = 1_800_000_000.0
"""When scenes begin, s of Unix time: operators whose clocks show less tell nobody the time."""
WHERE = "(AFTER-ISSUE 3s (WHEN (> x 0) (DRIVE 1)))"


class Stamped(list[float]):
    """Notes when a body was driven, by the one clock of the scene."""

    def __init__(self, made: Scene) -> None:
        self._clock = made.clock

    def append(self, speed: float) -> None:
        super().append(self._clock.now())


def scene(robots: int = 3, **more: float) -> Scene:
    """Robots that measure the clocks of those who command them."""
    made = Scene(robots, clock=ManualClock(NOW), on_air=True, **more)
    for name in made.fleet:
        measure(made, name)
    return made


def measure(made: Scene, name: str) -> None:
    robot = made.fleet[name]
    robot.node.timing.clocks = MeasuredClocks(robot.session.delivery.trips, lambda: robot.session.zero)
    robot.node.timing.tick = STEP
    robot.node.zero = robot.session.zero


def counted(desk: NetworkStation, command: Command) -> Account:
    return desk.accounting(command.id)


def test_robots_wait_then_all_obey_and_each_says_so_twice() -> None:
    made = scene()
    desk = made.desk()
    sent = desk.send(WHERE)
    made.run(1.0)
    waiting = counted(desk, sent)
    assert (waiting.waiting, waiting.n_matched, waiting.n_silent) == (("r0", "r1", "r2"), 0, 0)
    assert waiting.sentence().startswith("matched 0, did not match 0, waiting 3, fault 0")
    assert waiting.instant == sent.message.issued + 3.0
    assert not made.fleet["r1"].body.driven
    made.run(1.9)
    assert not made.fleet["r1"].body.driven
    made.run(0.5)
    done = counted(desk, sent)
    assert (done.matched, done.not_matched, done.waiting) == (("r1", "r2"), ("r0",), ())
    assert 0.0 < done.bound < 0.05
    assert made.fleet["r1"].body.driven == [1.0]


def test_the_test_is_evaluated_at_the_instant_not_when_it_is_heard() -> None:
    made = scene()
    sent = made.desk().send("(AFTER-ISSUE 2s (WHEN (> fuel 60%) (DRIVE 1)))", undecided=True)
    made.run(1.0)
    made.fleet["r2"].node.sense((2.0, 0.9), 1.0)
    made.run(1.5)
    assert counted(made.desk(), sent).matched == ("r2",)


@pytest.mark.parametrize("seed", [1, 2])
def test_clocks_that_are_wrong_and_unequal_ways_leave_every_robot_within_its_bound(seed: int) -> None:
    chance = Random(seed)
    made = scene(5, loss=0.2, delay=0.04, seed=seed)
    for name in made.fleet:
        made.set_clock(name, chance.uniform(-1.9, 1.9))
        measure(made, name)
    for robot in made.fleet.values():
        robot.body.driven = Stamped(made)
    sent = made.desk().send("(AFTER-ISSUE 4s (WHEN (> x -1) (DRIVE 1)))")
    made.run(6.0)
    account = counted(made.desk(), sent)
    assert account.n_matched == 5
    errors = [abs(at - sent.message.issued - 4.0) for robot in made.fleet.values() for at in robot.body.driven]
    assert len(errors) == 5
    assert max(errors) <= account.bound < 0.06


def test_who_could_not_measure_the_senders_clock_does_nothing_and_says_so() -> None:
    made = scene()
    made.fleet["r1"].node.timing.clocks = UnknownClocks()
    sent = made.desk().send(WHERE)
    made.run(3.5)
    account = counted(made.desk(), sent)
    assert account.matched == ("r2",)
    assert account.faults["r1"].startswith("not done: this robot has no bound of its clock")
    assert not made.fleet["r1"].body.driven


def test_a_desk_that_is_gone_leaves_its_robots_at_what_they_have_measured() -> None:
    made = scene()
    made.desk().send(WHERE)
    made.run(1.5)
    made.isolate("chief")
    made.run(2.0)
    assert made.fleet["r2"].body.driven == [1.0]


def test_what_is_heard_after_its_instant_is_late_and_not_done() -> None:
    made = scene()
    desk = made.desk()
    made.isolate("r1")
    first = desk.send("(AFTER-ISSUE 4s (WHEN (> x 0) (DRIVE 2)))", deadline=60.0)
    sent = desk.send("(AFTER-ISSUE 1s (WHEN (> x 0) (DRIVE 1)))", deadline=60.0)
    made.run(1.5)
    made.join("r1")
    made.run(4.0)
    assert counted(desk, first).matched == ("r1", "r2")
    assert counted(desk, sent).faults == {"r1": "heard after its instant, so not done"}
    assert made.fleet["r1"].body.driven == [2.0]


def test_stop_discards_what_waits_and_release_brings_nothing_back() -> None:
    made = scene()
    desk = made.desk()
    sent = desk.send(WHERE)
    made.run(1.0)
    desk.stop()
    made.run(0.5)
    desk.release()
    made.run(3.0)
    assert counted(desk, sent).faults == dict.fromkeys(made.fleet, "STOP has discarded it before its instant")
    assert not made.fleet["r2"].body.driven


def test_what_was_sent_before_a_stop_is_not_done_though_it_is_heard_after_the_release() -> None:
    made = scene()
    desk, made_deaf = made.desk(), made.fleet["r2"]
    made.loss = 1.0
    sent = desk.send(WHERE)
    made.loss = 0.0
    desk.stop()
    made.run(0.02)
    assert made_deaf.node.stopped
    desk.release()
    made.run(4.0)
    assert not made_deaf.node.stopped
    assert counted(desk, sent).n_matched == 0
    assert not made_deaf.body.driven


def test_cancel_discards_what_the_same_sender_has_sent_and_nobody_elses() -> None:
    made = scene()
    chief, anna = made.desk("chief"), made.desk("anna")
    mine, hers = chief.send(WHERE), anna.send("(AFTER-ISSUE 3s (WHEN (> x 0) (DRIVE 2)))")
    made.run(0.5)
    cancelled = chief.send("(WHEN (> x 1) (CANCEL))")
    made.run(4.0)
    assert counted(chief, cancelled).answers["r2"].value == 1.0
    assert counted(chief, mine).matched == ("r1",)
    assert counted(chief, mine).faults == {"r2": "CANCEL has discarded it before its instant"}
    assert counted(anna, hers).matched == ("r1", "r2")


def test_so_many_wait_and_no_more() -> None:
    made = scene(1)
    desk = made.desk()
    sent = [desk.send("(AFTER-ISSUE 3s (DRIVE 1))", everybody=True) for _ in range(MAX_WAITING + 1)]
    made.run(1.0)
    assert [counted(desk, each).n_waiting for each in sent] == [1] * MAX_WAITING + [0]
    assert counted(desk, sent[-1]).faults["r0"] == f"{MAX_WAITING} commands wait in this robot already: no more"


def test_answers_that_are_lost_at_the_instant_are_asked_for() -> None:
    made = scene(4)
    desk = made.desk()
    sent = desk.send(WHERE)
    made.run(2.5)
    made.isolate("chief")
    made.run(0.8)
    assert counted(desk, sent).n_waiting == 4
    made.join("chief")
    made.run(3.0)
    assert (counted(desk, sent).n_matched, counted(desk, sent).n_not_matched) == (3, 1)


def test_what_is_wrong_is_told_of_what_was_written() -> None:
    desk = scene().desk()
    with pytest.raises(CheckError) as refused:
        desk.prepare("(WHEN (> x 0) (SETQ y (SQRT 1 2)))", Terms(at=desk.now + 2.0))
    assert "at 1:23" in str(refused.value)
    assert "AFTER-ISSUE" not in str(refused.value)


def test_a_desk_turns_a_time_into_an_instant_when_it_sends() -> None:
    made = scene()
    desk = made.desk()
    at = desk.now + 2.0
    prepared = desk.prepare("(WHEN (> x 0) (DRIVE 1))", Terms(at=at))
    assert prepared.forecast.may == 3
    made.run(0.5)
    sent = desk.commit(prepared)
    assert sent.message.text == f"(AFTER-ISSUE {at - sent.message.issued:.6f}s (WHEN (> x 0) (DRIVE 1)))"
    assert sent.instant == pytest.approx(at, abs=2e-6)
    with pytest.raises(CommandTypeError, match=r"the instant is 0\.1 s ago: wanted one within the next 1 h"):
        desk.send("(MARK)", everybody=True, at=desk.now - 0.1)
    for seconds, when in ((0.0, "now"), (1e-9, "now"), (1e300, r"in 3\.16881e\+292 years")):
        with pytest.raises(CommandTypeError, match=f"the instant is {when}: wanted"):
            desk.send("(MARK)", everybody=True, at=desk.now + seconds)
    made.run(2.0)
    with pytest.raises(CommandTypeError, match=r"the instant is 0\.5"):
        desk.commit(prepared)


def test_a_question_about_what_waits_is_answered_at_once() -> None:
    made = scene()
    desk = made.desk()
    asked = desk.ask("(AFTER-ISSUE 3s (> x 0))")
    made.run(0.5)
    account = desk.accounting(asked.id)
    assert (account.instant, account.n_waiting, account.n_matched) == (None, 0, 3)


def test_what_is_written_for_an_instant_is_read_by_itself() -> None:
    desk = scene().desk()
    noted = desk.send("(DRIVE 1) ; all of them", everybody=True, at=desk.now + 2.0)
    assert noted.instant == pytest.approx(desk.now + 2.0, abs=2e-6)
    for text in ("(DRIVE 1", "(DRIVE 1)) (DRIVE 2", "(DRIVE 1) (DRIVE 2)", " "):
        with pytest.raises(ReadError) as found:
            desk.send(text, everybody=True, at=desk.now + 2.0)
        assert "AFTER-ISSUE" not in str(found.value)
