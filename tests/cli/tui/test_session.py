"""The terminal desk without a terminal, in simulated time: what it foresees, sends, asks twice about, and says."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from counting import ONCE, counted
from safety.scene import Scene
from sleepcast.channel import Kind
from sleepcast.cli.tui import panes as panes
from sleepcast.cli.tui.commands import CommandType
from sleepcast.cli.tui.completion import members_of, names_of, range_of
from sleepcast.cli.tui.session import AGAIN_WITHIN, HELD, STOP_AGAIN, WHY_PATIENCE, TuiSession
from sleepcast.language import Checked
from sleepcast.station import MemoryJournal
from sleepcast.station.journal.journal import JournalError, PendingEntry
from sleepcast.station.remote import RemoteMinds, TelemetryClient
from station.test_rest import Boat


class Seat:
    """A person at a desk, and three robots r0 to r2 (id 0 to 2), of which r2 is in bravo. width: of the panes."""

    def __init__(self, robots: int = 3) -> None:
        self.scene, minds = Scene(robots), RemoteMinds()
        self.station = self.scene.desk(minds=minds)
        telemetry = TelemetryClient(self.station, minds)
        self.station.listeners.append(telemetry.hear)
        self.session = TuiSession(self.station, telemetry, 2.0)
        self.run(1.0)
        self.session.to = self.session.addressees()[1]
        self.station.send("(WHEN (= id 2) (JOIN bravo))")
        self.run(3.0)
        self.session.to = self.session.addressees()[0]

    def run(self, seconds: float) -> None:
        """Let time pass."""
        for _ in range(round(seconds / 0.1)):
            self.scene.run(0.1)
            self.session.tick()

    def foreseen(self, text: str) -> str:
        self.run(1.0)  # what is foreseen stands for a moment
        return self.session.forecast(text).sentence

    def kinds(self) -> list[Kind]:
        return [command.kind for command in self.station.commands()]

    def shown(self, width: int = 60) -> str:
        """What the panes show."""
        lines = panes.robots(self.session, width, 10, 0) + panes.commands(self.session, width, 10)
        lines += [panes.safety(self.session, width), panes.title(self.session, width, "udp://")]
        texts = ["".join(text for _, text in line) for line in lines]
        assert all(len(text) <= width for text in texts)
        return "\n".join(texts)


@pytest.fixture
def seat(monkeypatch: pytest.MonkeyPatch) -> Seat:
    """One whose previews take no time, however busy the machine is."""
    monkeypatch.setattr("sleepcast.cli.tui.session.time.perf_counter", lambda: 0.0)
    return Seat()


def test_who_would_obey_depends_on_whom_it_is_for(seat: Seat) -> None:
    session = seat.session
    assert seat.foreseen("(WHEN (> id 0) (ST))") == "would obey: yes 2, no 1, unknown 0"
    assert seat.foreseen("(DRIVE 1)") == "would obey: yes 3, no 0, unknown 0, EVERYBODY"
    assert seat.foreseen("(BEST 2 id TRUE (ST))") == "would bid, 2 at most will obey: yes 3, no 0, unknown 0"
    session.address("bravo")
    assert seat.foreseen("(DRIVE 1)") == "would obey: yes 1, no 2, unknown 0"
    session.address("(> x 0.5m)")
    assert session.to.label == "(> x 0.5m)"
    assert seat.foreseen("(DRIVE 1)") == "would obey: yes 2, no 1, unknown 0"
    session.address("r1")
    assert seat.foreseen("(DRIVE 1)") == "would obey: yes 1, no 0, unknown 0"
    session.type = CommandType.ASK
    assert seat.foreseen("x") == "a question to 1 robot"
    assert [each.label for each in session.addressees()] == ["", "all", "bravo", "(> x 0.5m)", "r1"]
    session.next_addressee()
    assert session.to.label == ""
    for unknown, complaint in (("r7", "neither a robot nor a group"), ("(> x", "is not closed")):
        session.enter(f":to {unknown}")
        assert session.wrong
        assert complaint in session.message


def test_a_preview_that_takes_long_keeps_no_key_waiting(seat: Seat, monkeypatch: pytest.MonkeyPatch) -> None:
    spent = 0.0
    monkeypatch.setattr("sleepcast.cli.tui.session.time.perf_counter", lambda: spent)
    check = seat.station.check

    def slow(text: str, *, only: Sequence[str] | None = None, anyway: bool = False) -> Checked:
        nonlocal spent
        spent += 0.3
        return check(text, only=only, anyway=anyway)

    monkeypatch.setattr(seat.station, "check", slow)
    assert seat.foreseen("(WHEN (> id 0) (ST))") == "would obey: yes 2, no 1, unknown 0"
    assert seat.foreseen("(WHEN (> id 1) (ST))") == "counting", "never what was said of another text"
    assert seat.foreseen("(WHEN (> id 0) (ST))") == "would obey: yes 2, no 1, unknown 0"
    spent += 10.0
    assert seat.foreseen("(WHEN (> id 1) (ST))") == "would obey: yes 1, no 2, unknown 0"


def test_what_is_typed_so_far_is_foreseen_and_what_is_wrong_pointed_at(seat: Seat) -> None:
    assert seat.foreseen("(WHEN (> id 0") == "would obey: yes 2, no 1, unknown 0 (2 parentheses are open)"
    assert seat.foreseen("(WHEN (>") == "2 parentheses are open"
    assert seat.foreseen("") == seat.foreseen(":to") == ""
    seat.run(1.0)
    spot = seat.session.forecast("(DRIVE 1 2)").spot
    assert spot is not None
    assert spot.wrong
    lines = panes.hint(seat.session, "(DRIVE 1 2)", 60, 4, 7)
    assert lines[0][0][1].startswith(" " * 7)
    assert set(lines[0][0][1].strip()) == {"^"}
    seat.run(1.0)
    doubtful = seat.session.forecast("(WHEN (> fuell 1) (ST))")
    assert doubtful.spot is not None
    assert (doubtful.spot.wrong, "did you mean fuel" in doubtful.spot.message) == (False, True)


def test_unknown_tests_and_failing_rules_are_shown(seat: Seat) -> None:
    assert seat.foreseen("(WHEN (> fuell 1) (ST))").startswith("would obey: yes 0, no 0, unknown 3 (its test has no")
    assert not seat.session.enter("(WHEN (> fuell 1) (DRIVE 1))")
    assert "none of the 3 robots that have sent telemetry has fuell" in seat.session.message
    seat.run(HELD)
    assert seat.session.enter("(WHEN (> fuell 1) (DRIVE 1))")
    seat.run(1.0)
    assert "did not match 0, unknown 3, fault 0" in seat.shown(90)
    assert "r1               U" in seat.shown()
    assert "!" not in panes.robots_title(seat.session)
    seat.station.send("(WHEN (> id 0) (RULE guard (/ 1 0)))", standing=True)
    seat.run(2.0)
    assert panes.robots_title(seat.session).endswith("; ! guard fails on 2")


def test_a_robot_that_was_not_heard_of_late_decides_nothing(seat: Seat) -> None:
    seat.scene.isolate("r1")
    seat.run(20.0)
    assert seat.foreseen("(WHEN (> id 0) (ST))").startswith("would obey: yes 1, no 1, unknown 1 (")
    assert "oL r1" in seat.shown()
    assert "L 1" in panes.robots_title(seat.session)
    seat.session.by_age = True
    assert seat.session.listed(seat.station.roster)[0] == "r1"


def test_what_was_refused_stays_typed(seat: Seat) -> None:
    session = seat.session
    for text in ("(DRIVE", "(DRIVE 1)", "(FLY 1 2", ":fly", ":show wings", ":hold"):
        assert not session.enter(text)
        assert session.wrong
    assert seat.kinds() == [Kind.COMMAND]
    session.address("all")
    with counted() as found:
        assert session.enter("(DRIVE 1)")
    assert found == ONCE
    assert not session.message
    seat.run(1.0)
    assert "matched 3" in seat.shown()
    session.hush()
    assert session.enter("")


def test_a_question_to_some_counts_only_them(seat: Seat) -> None:
    seat.session.address("bravo")
    while seat.session.type is not CommandType.ASK:
        seat.session.next_type()
    assert seat.session.enter("(+ id 1)")
    seat.run(1.0)
    assert "answered 3, min 3, mean 3, max 3, silent 0" in seat.shown()


def test_many_are_counted_by_hand() -> None:
    seat = Seat(11)
    session = seat.session
    session.address("all")
    assert session.enter("(DRIVE 1)")
    assert "Type 11 to send it" in session.message
    session.hush()
    assert session.message, "what is to be typed stays said"
    assert session.enter("10")
    assert session.message == "not sent"
    with counted() as found:
        session.enter("(DRIVE 1)")
        assert session.enter("11")
    assert found == ONCE | {"validated": 2}
    seat.run(1.0)
    assert "matched 11" in seat.shown()
    session.enter("(DRIVE 1)")
    session.stop()
    assert session.pending is None, "STOP ends all that waits"


def test_what_is_hardly_meant_is_entered_twice(seat: Seat) -> None:
    session, doubted = seat.session, "(WHEN (> id 0) (> id 1) (DRIVE 1))"
    sent = len(seat.kinds())
    assert not session.enter(doubted), "the text stays typed"
    assert session.wrong
    assert session.message.startswith(
        "(> id 1) at 1:16 decides nothing: its value goes nowhere (did you mean (AND (> id 0)"
    )
    assert session.message.endswith("Press Enter once more to send it as it stands")
    session.address("r2")
    assert not session.enter(doubted), "to somebody else it is another command"
    assert not session.enter("(WHEN (> id 0) (> id 5) (DRIVE 1))")
    for _ in range(3):  # a key that is held down
        assert not session.enter(doubted)
        seat.run(HELD - 0.2)
    assert len(seat.kinds()) == sent
    seat.run(0.2)
    assert session.enter(doubted)
    assert len(seat.kinds()) == sent + 1
    assert not session.enter(doubted), "confirmed once is not confirmed for ever"


def test_stages_go_on_while_all_goes_well() -> None:
    seat = Seat(12)
    session = seat.session
    session.type = CommandType.STAGED
    session.enter("(WHEN (> id 0) (DRIVE 1))")
    assert "Type 11" in session.message
    session.enter("11")
    assert session.message.startswith("stage 1")
    assert not session.enter("(DRIVE 0)")
    assert "still sent in stages" in session.message
    seat.run(2.0)
    assert (session.message, session.staging) == ("all 3 stages went well", None)
    driven = [name for name, robot in seat.scene.fleet.items() if robot.body.driven]
    assert len(driven) == 11
    counts = [command.addressed - command.n_silent for command in seat.station.commands()[-3:]]
    assert len(counts) == 3


@pytest.mark.parametrize(
    ("text", "lost", "said"),
    [
        ("(WHEN (> id 0) (DRIVE (/ 1 0)))", "", "fault on r1"),
        ("(WHEN (> id 0) (DRIVE 1))", "r1", "silent 1 of 1 robots: r1"),
    ],
)
def test_stages_end_where_one_goes_wrong(text: str, lost: str, said: str) -> None:
    seat = Seat(5)
    session = seat.session
    if lost:
        seat.scene.isolate(lost)
    session.type = CommandType.STAGED
    session.enter(text)
    seat.run(4.0)
    assert "halted after stage 1" in session.message
    assert said in session.message
    assert (session.wrong, session.staging) == (True, None)
    assert not any(robot.body.driven for name, robot in seat.scene.fleet.items() if name != "r1")


def test_stop_ends_all_stages() -> None:
    seat = Seat(5)
    seat.session.type = CommandType.STAGED
    seat.session.enter("(WHEN (> id 0) (DRIVE 1))")
    seat.session.stop()
    seat.run(3.0)
    assert seat.session.staging is None
    assert sum(kind is Kind.COMMAND for kind in seat.kinds()) == 2  # the first is from before


def test_stop_is_sent_at_once_and_a_key_held_down_is_one_stop(seat: Seat) -> None:
    session = seat.session
    for _ in range(5):
        session.stop()
    assert seat.kinds() == [Kind.COMMAND, Kind.STOP]
    seat.run(STOP_AGAIN)
    assert all(robot.node.stopped for robot in seat.scene.fleet.values())
    assert "stopped 3, silent 0" in seat.shown()
    seat.run(2.5)
    assert "S  r0" in seat.shown()
    session.stop()
    assert seat.kinds() == [Kind.COMMAND, Kind.STOP, Kind.STOP]


def test_stopping_and_at_rest_are_told_apart(seat: Seat) -> None:
    boat = Boat(seat.scene, 3.0)
    seat.scene.fleet["r0"].node.body = boat
    seat.session.stop()
    boat.begin()
    seat.run(3.0)
    shown = seat.shown(120)
    assert "; still moving 1: r0 (1." in shown
    assert "m to go), rest unknown 2" in shown
    assert "s  r0" in shown
    assert "S  r1" in shown
    seat.run(6.0)
    shown = seat.shown(120)
    assert "; at rest 1, rest unknown 2" in shown
    assert "S  r0" in shown


def test_release_wants_its_key_twice_in_a_moment(seat: Seat) -> None:
    session = seat.session
    session.stop()
    seat.run(1.0)
    session.release()
    seat.run(AGAIN_WITHIN + 0.2)
    for _ in range(3):  # a key that is held down
        session.release()
        seat.run(HELD - 0.2)
    assert Kind.RELEASE not in seat.kinds()
    seat.run(0.2)
    session.release()
    assert Kind.RELEASE not in seat.kinds(), "robots are asked first whose STOPs hold"
    seat.run(0.5)
    assert seat.kinds()[-1] is Kind.RELEASE
    seat.run(1.0)
    assert "RELEASE" in seat.shown()
    assert not any(robot.node.stopped for robot in seat.scene.fleet.values())


def test_a_release_names_the_stops_that_robots_tell_of(seat: Seat) -> None:
    """The terminal desk did not ask, so that it named none where it looks only when it is told to."""
    other = seat.scene.desk("anna")
    other.stop()
    seat.run(1.0)
    session = seat.session
    session.look_every = 0.0
    seat.station._stops = type(seat.station._stops)(10)  # as at a desk that was opened after that STOP
    seat.run(AGAIN_WITHIN + 1.0)
    session.release()
    seat.run(HELD)
    session.release()
    seat.run(1.0)
    assert not any(robot.node.stopped for robot in seat.scene.fleet.values())


def test_stop_ends_a_release_that_has_not_gone_out(seat: Seat) -> None:
    session = seat.session
    session.release()
    seat.run(HELD)
    session.release()
    session.stop()
    seat.run(2.0)
    assert Kind.RELEASE not in seat.kinds()
    assert all(robot.node.stopped for robot in seat.scene.fleet.values())


def test_who_leaves_while_robots_are_not_stopped_is_asked_once(seat: Seat) -> None:
    session = seat.session
    seat.scene.isolate("r1")
    session.stop()
    seat.run(1.0)
    assert "silent 1 of 3 robots heard so far: r1" in seat.shown()
    session.leave()
    assert not session.leaving
    assert "STOP is still sent to 1 robot" in session.message
    session.leave()
    assert session.leaving


def test_a_robot_that_stands_because_of_its_store_is_told(seat: Seat) -> None:
    seat.scene.fleet["r1"].node.halt("its store was damaged")
    seat.run(5.0)
    assert " report stopped; stopped until RELEASE: r1 (its store was damaged)" in seat.shown(120)


def test_a_full_disk_stops_commands_but_no_stop(seat: Seat) -> None:
    session = seat.session
    seat.station.notes.journal = FullDisk()
    session.address("all")
    assert not session.enter("(DRIVE 1)")
    assert "the disk is full" in session.message
    session.stop()
    seat.run(1.0)
    assert all(robot.node.stopped for robot in seat.scene.fleet.values())
    assert "JOURNAL: the disk is full" in panes.trouble(session, 80)[0][1]


class FullDisk(MemoryJournal):
    def append(self, *entries: PendingEntry) -> None:
        raise JournalError("the disk is full")


def test_why_is_asked_on_the_air(seat: Seat) -> None:
    session = seat.session
    session.enter(":why r1")
    seat.run(1.0)
    assert any("(= id 2)" in line for line in session.page)
    session.page = []
    seat.scene.isolate("r1")
    session.enter(":why r1")
    seat.run(WHY_PATIENCE + 1.0)
    assert (session.message, session.wrong, session.page) == ("r1 does not answer", True, [])
    session.enter(":why r9")
    assert "no robot" in session.message


def test_driven_robots_get_heartbeats_unless_told_otherwise(seat: Seat) -> None:
    assert seat.station.holding
    seat.session.enter(":hold off")
    assert not seat.station.holding
    seat.session.enter(":hold on")
    assert seat.station.holding


def test_names_are_known_with_what_they_are_worth(seat: Seat) -> None:
    minds = seat.session.telemetry.minds
    assert {"x", "fuel", "DRIVE", "bravo", "id"} <= set(names_of(minds))
    assert range_of("x", minds) == (0.0, 2.0)
    assert range_of("DRIVE", minds) is None
    assert (members_of("bravo", minds), members_of("x", minds)) == (1, None)
    seat.session.enter(":show x fuel")
    assert seat.shown().splitlines()[2].split()[-3:] == ["2m", "50%", "bravo"]


def test_nothing_that_came_from_the_air_reaches_the_terminal_as_it_is(seat: Seat) -> None:
    seat.session.address("all")
    seat.session.enter('(REPORT "evil \x1b[2J" 1)')
    seat.run(1.0)
    told = panes.reports(seat.session, 60, 5) + panes.commands(seat.session, 60, 10)
    assert not any("\x1b" in text for line in told for _, text in line)


@pytest.mark.parametrize(
    ("text", "width", "seen"), [("abc", 3, "abc"), ("abcd", 3, "ab…"), ("日本語", 4, "日…"), ("a", 0, "")]
)
def test_texts_are_cut_by_columns(text: str, width: int, seen: str) -> None:
    assert panes.clipped(text, width) == seen


def test_a_name_that_two_robots_have_is_marked_and_a_command_to_it_is_asked_about_twice(seat: Seat) -> None:
    seat.scene.another("r1")
    seat.run(4.0)
    assert "2  r1" in seat.shown()
    assert "o  r0" in seat.shown()
    assert "2 robots have the name r1" in "".join(text for _, text in panes.notice(seat.session, 60))
    session = seat.session
    session.address("r1")
    before = len(seat.kinds())
    assert not session.enter("(DRIVE 1)"), "the text stays typed"
    assert "2 robots have the name r1" in session.message
    assert len(seat.kinds()) == before
    seat.run(HELD)
    assert session.enter("(DRIVE 1)")
    assert len(seat.kinds()) == before + 1
