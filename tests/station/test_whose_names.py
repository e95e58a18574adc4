"""Robots that have left inform a desk and refuse nothing; of those that are there, those decide that a text is for."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from contextlib import nullcontext
from pathlib import Path

import pytest

from cli.calling import called_here
from safety.scene import START, Scene
from sleepcast.channel import Kind, Message
from sleepcast.channel.admission import Admission
from sleepcast.channel.keys import PublicKey, Trust
from sleepcast.channel.message import Role
from sleepcast.cli.tui.session import TuiSession
from sleepcast.console.adapters.channel import EMPTY, FleetAdapter
from sleepcast.console.features.send import Send
from sleepcast.console.network import NetworkBackend
from sleepcast.console.outgoing import Refused
from sleepcast.console.swarm_dialogue import SwarmDialogue
from sleepcast.console.view import Scene as Ground
from sleepcast.core.clock import ManualClock
from sleepcast.core.model import Quantity
from sleepcast.language import CheckError, HostFunction, Vocabulary
from sleepcast.mind.telemetry import vocabulary_text
from sleepcast.node.node import Node
from sleepcast.station.network import PRESENT_FOR, NetworkStation
from sleepcast.station.prepared import Terms
from sleepcast.station.remote import RemoteMinds, TelemetryClient
from sleepcast.station.validation import Audience
from sleepcast.station.whose_names import OTHERS_ONLY, WITHOUT_THESE
from station.far import Far

OF_0_2_0 = Path(__file__).resolve().parent.parent / "of_0_2_0"
DRIVE = "(DRIVE 0.2m/s)"


def _drive(body: object, *speeds: float) -> None:
    """Nothing: only its name is of interest."""


def rover(name: str, *functions: HostFunction, sensors: tuple[Quantity, ...] = ()) -> Vocabulary:
    return Vocabulary(name, sensors=(Quantity("x", "m"), *sensors), functions=functions)


SCOUT = rover(
    "scout",
    HostFunction("DRIVE", _drive, (None, None), arguments="speed turn_rate"),
    HostFunction("SONAR", _drive, (None,), acts=False, arguments="i"),
)
BOARD = rover("board", HostFunction("DRIVE", _drive, (None,), arguments="speed"))
BUOY = rover("buoy", sensors=(Quantity("sonar", "m"),))


class Fleet:
    """A desk, and robots of several types that it hears when they tell."""

    def __init__(self, **types: Vocabulary) -> None:
        self.scene = Scene(robots=0)
        nodes = {name: Node(name, found, number=at) for at, (name, found) in enumerate(types.items(), 1)}
        self.far = Far(nodes, self.scene.clock)
        for node in nodes.values():
            node.sense(tuple(1.0 for _ in node.vocabulary.sensors), 0.0)
        self.desk: NetworkStation = self.scene.desk(heard=(), minds=self.far.minds)

    def tell(self, *names: str) -> None:
        """These robots tell of themselves now."""
        self.far.look(names)
        self.desk.vocabulary = self.far.minds.vocabulary
        for name in names:
            self.desk.hear(Message(name, 1, 1, Kind.ANSWER, 0.0, body={"command": "chief-1.1"}))
        for mind in self.far.minds.values():
            self.desk.observe(mind.reported_at, [mind])

    def leave(self) -> None:
        """Nobody is heard for a while."""
        self.scene.clock.advance(PRESENT_FOR + 1.0)

    def may(self, text: str, **more: object) -> int:
        return self.desk.prepare(text, Terms(everybody=True, **more)).may  # type: ignore[arg-type]


def said(fleet: Fleet, text: str, only: Iterable[str] | None = None) -> str:
    """What the desk says of a text that is for these, "" if it may be sent."""
    try:
        fleet.desk.draft(text, Terms(everybody=True, audience=Audience.of(only)))  # type: ignore[arg-type]
    except CheckError as error:
        return str(error)
    return ""


def unknown(fleet: Fleet, *only: str) -> tuple[list[str], int]:
    """The names in a text that no robot has, of these or of all, and how many have told theirs."""
    checked = fleet.desk.check("(TUMBEL)", only=only or None)
    return fleet.desk.unknown_names(checked, only or None)


def test_a_robot_that_has_left_refuses_nothing() -> None:
    """(DRIVE 0.2m/s), right for the board, was refused on the word of a scout that was heard once."""
    fleet = Fleet(r1=SCOUT, tiny=BOARD)
    fleet.tell("r1")
    assert "DRIVE speed turn_rate) takes 2 arguments, got 1" in said(fleet, DRIVE)
    fleet.leave()
    assert said(fleet, DRIVE) == ""
    fleet.tell("tiny")
    assert said(fleet, DRIVE) == ""
    assert "takes 1" in said(fleet, "(DRIVE 1 2 3)") or "1 to 2" in said(fleet, "(DRIVE 1 2 3)")


def test_what_was_told_to_an_earlier_desk_informs_only() -> None:
    fleet = Fleet(r1=SCOUT)
    fleet.far.look(["r1"])
    fleet.desk.vocabulary = fleet.far.minds.vocabulary
    assert fleet.desk.present() == []
    checked = fleet.desk.check(DRIVE)
    assert not checked.errors
    (finding,) = checked.findings
    assert finding.message == "(DRIVE speed turn_rate) takes 2 arguments, got 1 at 1:1, by the names of scout (r1)"
    assert (finding.severity, checked.unknown) == ("warning", [])
    assert fleet.desk.check("(DRIVE)", only=["tiny"]).program is not None
    assert fleet.desk.check("(+ DRIVE 1)").unknown == [], "it is known, so it is no slip"
    assert fleet.desk.check("(DRIVE 1 2)").findings == ()


def test_the_sentence_says_whose_names_decide() -> None:
    fleet = Fleet(r1=SCOUT, r2=SCOUT, r10=SCOUT, r3=SCOUT, tiny=BUOY)
    fleet.tell("r1", "r2", "r10", "r3", "tiny")
    refused = said(fleet, DRIVE)
    assert refused.endswith("This is so by the names of scout (r1, r2, r3 and 1 more)")
    assert "names of" not in said(fleet, "(SQRT 1 2)"), "no robot could run it"


def test_those_decide_that_a_text_is_for() -> None:
    fleet = Fleet(r1=SCOUT, tiny=BUOY)
    fleet.tell("r1", "tiny")
    assert "buoy" not in said(fleet, DRIVE)
    assert said(fleet, DRIVE, ["tiny"]) == ""
    assert said(fleet, DRIVE, ["r1"]).endswith("This is so by the names of scout (r1)")


def test_who_insists_is_refused_by_no_robots_names() -> None:
    fleet = Fleet(r1=SCOUT)
    fleet.tell("r1")
    insists = Terms(everybody=True, anyway=True)
    assert fleet.desk.prepare(DRIVE, insists).may == 1
    assert fleet.may(DRIVE, anyway=True) == 1
    fleet.desk.ask(DRIVE, anyway=True)
    with pytest.raises(CheckError):
        fleet.desk.ask(DRIVE)
    with pytest.raises(CheckError):
        fleet.desk.draft("(SQRT 1 2)", insists)


def test_what_robots_learned_that_have_left_refuses_nothing_either() -> None:
    fleet = Fleet(r1=SCOUT, r2=SCOUT)
    fleet.far.nodes["r1"].evaluate("(RULE patrol (SLEEP))")
    fleet.far.nodes["r1"].evaluate("(DEFVAR charge 1)")
    fleet.tell("r1")
    assert "already a rule" in said(fleet, "(JOIN patrol)")
    fleet.leave()
    fleet.tell("r2")
    assert said(fleet, "(JOIN patrol)") == ""
    assert said(fleet, "(PROGN (JOIN charge) (DEFUN patrol (a) a))") == ""


def test_of_two_types_that_cannot_be_united_those_decide_that_are_there() -> None:
    """SONAR is a function of scouts and a number of buoys: whoever was heard first kept the other out for ever."""
    fleet = Fleet(r1=SCOUT, tiny=BUOY)
    fleet.tell("r1")
    fleet.tell("tiny")
    assert set(fleet.far.minds) == {"r1"}
    assert list(fleet.far.minds.refused.values()) == ["sonar is a number here and a function of scout"]
    assert said(fleet, "(WHEN (> sonar 1m) (SLEEP))", ["tiny"]) == ""
    fleet.leave()
    fleet.tell("tiny")
    assert set(fleet.far.minds) == {"tiny"}
    assert list(fleet.far.minds.refused.values()) == ["sonar is a function here and a number of buoy"]
    assert len(fleet.desk.preview("(WHEN (> sonar 0.5m) (SLEEP))").yes) == 1


def test_a_name_is_unknown_by_the_word_of_robots_that_are_there() -> None:
    fleet = Fleet(r1=SCOUT, r2=SCOUT, tiny=BOARD)
    fleet.tell("r1", "r2")
    assert unknown(fleet) == (["TUMBEL"], 2)
    assert unknown(fleet, "r1") == (["TUMBEL"], 1)
    fleet.desk.hear(Message("tiny", 1, 1, Kind.ANSWER, 0.0, body={"command": "chief-1.1"}))
    assert unknown(fleet) == ([], 0), "one that is there has not told its names"
    fleet.leave()
    assert unknown(fleet) == ([], 0), "nobody is there"


def test_the_names_of_some_are_in_the_slots_of_all() -> None:
    fleet = Fleet(tiny=BUOY, boat=rover("boat", sensors=(Quantity("depth", "m"),)))
    fleet.tell("tiny", "boat")
    whole = fleet.far.minds.vocabulary
    assert vocabulary_text(whole) != ""
    checked = fleet.desk.check("(WHEN (> (+ sonar x) 1m) (SLEEP))", only=["tiny"])
    assert checked.findings == ()
    assert fleet.desk.preview("(WHEN (> sonar 0.5m) (SLEEP))").yes == ("tiny",)


@pytest.mark.parametrize(
    ("text", "place"),
    [("(RULE a 1 :priority 2)", ":priority at 1:11"), ("(SETQ z (SUM-OVER (n 5m) 1))", "SUM-OVER at 1:10"),
     ("(SETQ z (OF 3 distance))", "OF at 1:10"), ("(FOR-NEIGHBOURS (n 5m) (MARK))", "FOR-NEIGHBOURS at 1:2"),
     ("(SETQ z (SCAN-MIN 0 1))", "SCAN-MIN at 1:10"), ("(WHEN (SCAN-GAP 0 1) (MARK))", "SCAN-GAP at 1:8"),
     ("(WHEN (SEES 3 0 1) (MARK))", "SEES at 1:8"),
     ("(BEST 4 x TRUE (MARK))", "BEST at 1:2"),
     ("(QUORUM 1 2 TRUE (MARK))", "QUORUM at 1:2")],
)  # fmt: skip
def test_the_desk_refuses_a_new_form_while_a_robot_is_there_that_does_not_know_it(text: str, place: str) -> None:
    fleet = mixed()
    desk, insists = fleet.desk, Terms(everybody=True, anyway=True)
    body = any(name in text for name in ("SCAN", "SEES"))
    why = f"{place} is not known to old (tiny): {OTHERS_ONLY if body else WITHOUT_THESE}"
    fleet.tell("r1")
    early = desk.prepare(text, Terms(everybody=True))
    fleet.tell("tiny")
    for _ in range(2):  # what was checked is not checked again, and says the same
        (error,) = desk.check(text).errors
        assert error.message == why
    for refused in (
        lambda: desk.prepare(text, insists),
        lambda: desk.send(text, everybody=True, confirmed=True),
        lambda: desk.ask(text, anyway=True),
        lambda: desk.accept(early, count=1, confirmed=True),
    ):
        with pytest.raises(CheckError, match=re.escape(why)):
            refused()
    assert not desk.commands()
    assert not desk.check(text, only=["r1"]).errors
    fleet.leave()
    assert not desk.check(text).errors, "nobody of them is there"
    desk.accept(desk.prepare(text, insists), count=2, confirmed=True)


@pytest.mark.parametrize(
    "text",
    ["(RULE a 1)", "(DEFVAR :priority 1)", "(DEFVAR of 1)", "(PRINT sum-over)", "(DEFVAR sees 1)", "(DEFVAR best 1)"],
)
def test_a_name_like_any_other_is_no_new_form(text: str) -> None:
    fleet = mixed()
    fleet.tell("r1", "tiny")
    assert not fleet.desk.check(text).errors


def mixed() -> Fleet:
    """A desk, a robot of today, and one that knows no new forms."""
    old = rover("old")
    old.forms = frozenset()
    seeing = (("SCAN-MIN", 2), ("SCAN-GAP", 2), ("SEES", 3))
    functions = (HostFunction(name, _drive, (None,) * count, acts=False) for name, count in seeing)
    return Fleet(r1=rover("new", *functions), tiny=old)


GUARD = "(RULE guard (MARK) :priority 2)"
REFUSED = f":priority at 1:20 is not known to old (r2): {WITHOUT_THESE}"


class Seat:
    """A desk on a radio with three robots that have told of themselves; r2 knows no new forms."""

    def __init__(self) -> None:
        self.scene, minds = Scene(robots=3), RemoteMinds()
        old = rover("old")
        old.forms = frozenset()
        self.scene.fleet["r2"].node = Node("r2", old, number=2)
        self.scene.fleet["r2"].node.sense((2.0,), 0.0)
        self.desk = self.scene.desk(minds=minds)
        self.telemetry = TelemetryClient(self.desk, minds)
        self.desk.listeners.append(self.telemetry.hear)
        for _ in range(3):  # they are asked for what they are, too
            self.telemetry.look()
            self.scene.run(0.5)
        assert set(minds) == {"r0", "r1", "r2"}

    def leave(self) -> None:
        """r2 goes, and is not there any more after a while."""
        assert not self.desk.commands()
        self.scene.isolate("r2")
        self.scene.run(PRESENT_FOR + 1.0)

    def sent(self) -> list[str]:
        return [command.text for command in self.desk.commands()]


def test_the_command_line_refuses_it(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    seat = Seat()
    monkeypatch.setattr(
        "sleepcast.cli.send.observing_station", lambda *_, **__: nullcontext((seat.desk, seat.telemetry))
    )
    for insists in ((), ("--anyway",), ("--blind", "--anyway"), ("--only", "r1,r2")):
        found = called_here(capsys, "send", GUARD, "--all", *insists)
        assert (found.status, found.out) == (2, "")
        assert REFUSED in found.err
    assert not seat.desk.commands()


def test_the_page_refuses_it_until_the_robot_has_left() -> None:
    seat = Seat()
    ground = Ground("air", "", "robots", (), EMPTY, "m", ())
    fleet = FleetAdapter(seat.desk, seat.telemetry, ground, 1.0, START)
    page = SwarmDialogue(NetworkBackend(fleet, seat.desk, seat.scene.clock, START))
    send = Send(4, GUARD, everybody=True, confirmed=True)
    refused = page.answer(send)
    assert isinstance(refused, Refused)
    assert (refused.serial, REFUSED in refused.reason) == (4, True)
    seat.leave()
    assert not isinstance(page.answer(send), Refused)
    assert seat.sent() == [GUARD]


def test_the_terminal_desk_refuses_it_until_the_robot_has_left() -> None:
    seat = Seat()
    session = TuiSession(seat.desk, seat.telemetry, 2.0)
    session.address("all")
    assert not session.enter(GUARD), "the text stays typed"
    assert (session.wrong, REFUSED in session.message) == (True, True)
    seat.leave()
    assert session.enter(GUARD)
    assert seat.sent() == [GUARD]


# ---- a real robot of version 0.2.0, as it was heard


def told_by_0_2_0() -> tuple[list[Message], float]:
    """What it told a later desk of itself and of commands that it did not know, and when, s."""
    found = json.loads((OF_0_2_0 / "told.json").read_text(encoding="utf-8"))
    key = PublicKey("r*", Role.ROBOT, bytes.fromhex(found["public"]))
    admission = Admission(Trust((key,)), found["fleet"], ManualClock(found["issued"]), robot=False)
    entered = [admission.enter(bytes.fromhex(each)) for message in found["messages"] for each in message["datagrams"]]
    return [each.message for each in entered if each is not None], found["issued"]


@pytest.mark.parametrize(
    ("text", "form"),
    [
        ("(BEST 1 (DIST x y 0m 0m) (> id 0) (JOIN a))", "BEST"),
        ("(QUORUM 1 2 (> id 0) (JOIN a))", "QUORUM"),
        ("(AFTER-ISSUE 3s (JOIN a))", "AFTER-ISSUE"),
        ("(HATCH sheep 1)", "HATCH"),
        ("(DIE)", "DIE"),
    ],
)
def test_a_robot_of_0_2_0_is_sent_nothing_that_it_does_not_know(text: str, form: str) -> None:
    messages, issued = told_by_0_2_0()
    minds, scene = RemoteMinds(), Scene(robots=0)
    desk = scene.desk(heard=(), minds=minds)
    for message in messages:
        minds.take(message, issued)
        desk.hear(message)
    assert set(minds) == {"r1"}, "its type was understood"
    desk.vocabulary = minds.vocabulary
    with pytest.raises(CheckError, match=rf"{form} at 1:2 is not known to scout \(r1\): send this by name to robots"):
        desk.send(text, everybody=True, confirmed=True)
    assert not desk.check("(WHEN (> x 1m) (JOIN a))").errors


def test_a_robot_of_0_2_0_answers_in_a_sentence_what_it_does_not_know() -> None:
    faults = [message.body.get("fault") for message in told_by_0_2_0()[0]]
    assert [fault for fault in faults if fault] == [
        f"this robot has no function {form} in {text}"
        for form, text in (
            ("AFTER-ISSUE", "(AFTER-ISSUE 3s (JOIN c))"),
            ("BEST", "(BEST 1 (DIST x y 0m 0m) (> id 0) (JOIN a))"),
            ("HATCH", "(HATCH sheep 1)"),
        )
    ]
