"""Authority goes by key, not by predicate: who may ask, command and change rules, and who hears why not."""

from __future__ import annotations

from math import inf

import pytest

from safety.scene import FLEET, KEYS, Scene
from sleepcast.channel import Kind, Message
from sleepcast.channel.drops import DropReason
from sleepcast.channel.envelope import encode
from sleepcast.channel.keys import KeyPair
from sleepcast.channel.message import Role
from sleepcast.station.network import RoleError

RULES = [
    "(RULE go (DRIVE 1))",
    "(SETQQ E5 (DRIVE 1))",
    "(SETQ E5 '(DRIVE 1))",
    "(DEFUN faster (x) (DRIVE x))",
    "(FORGET keep)",
    "(ACTIVATE keep)",
    "(DEACTIVATE keep)",
    "(LEASE keep 1)",
    "(SETQ active5 1)",
    "(ROLLBACK)",
    "(WHEN (> x 0) (PROGN (DRIVE 1) (IF (> fuel 2) 1 (RULE go 1))))",
]


def drops(scene: Scene, robot: str = "r0") -> dict[DropReason, int]:
    return dict(scene.fleet[robot].session.delivery.admission.counts)


def test_an_observer_asks_and_nothing_else() -> None:
    """Must 5: refused at its own desk with the reason; a forged desk is refused at the door, and nothing happens."""
    scene = Scene()
    watch = scene.desk("watch")
    asked = watch.ask("(+ x 1)")
    scene.run(1.0)
    assert watch.accounting(asked.id).n_matched == 3
    with pytest.raises(RoleError, match="watch is an observer, who may only ask and stop"):
        watch.send("(WHEN (> x 0) (DRIVE 1))")
    with pytest.raises(RoleError):
        watch.post(Kind.COMMAND, text="(WHEN (> x 0) (DRIVE 1))")
    for kind in (Kind.COMMAND, Kind.RELEASE, Kind.HEARTBEAT, Kind.ANSWER, Kind.REPORT):
        scene.say(Message("watch", 1, 50, kind, scene.clock.now(), text="(DRIVE 1)"), KEYS["watch"])
    scene.run(1.0)
    assert drops(scene)[DropReason.NOT_ALLOWED] == 5
    assert not any(robot.body.driven for robot in scene.fleet.values())


def test_a_question_changes_nothing_whatever_it_asks() -> None:
    """Must 5: an observer cannot drive a robot by asking it to."""
    scene = Scene()
    watch = scene.desk("watch")
    for text in ("(DRIVE 1)", "(PROGN (JOIN bravo) 1)", "(RULE go (DRIVE 1))", "(SETQ throttle 1)", "(DROP)"):
        watch.ask(text)
    scene.run(1.0)
    robot = scene.fleet["r0"]
    assert (robot.body.driven, robot.body.dropped, robot.node.groups, robot.node.rules()) == ([], 0, frozenset(), [])
    assert robot.node.actuators() == {}


@pytest.mark.parametrize("text", RULES)
def test_an_operator_changes_no_rules(text: str) -> None:
    """Must 5: an operator commands, a commander rules; who gets round his own desk hears it from the robot."""
    scene = Scene(robots=1)
    chief, anna = scene.desk("chief"), scene.desk("anna")
    chief.send("(PROGN (RULE keep 1) (DEACTIVATE keep))", standing=True, everybody=True)
    scene.run(0.5)
    with pytest.raises(RoleError, match="anna is an operator, who changes no rules"):
        anna.send(text, everybody=True)
    before = scene.fleet["r0"].node.rules()
    sent = anna.post(Kind.COMMAND, text=text)
    scene.run(0.5)
    assert "only a commander's key may change rules" in anna.accounting(sent.id).faults["r0"]
    assert (scene.fleet["r0"].node.rules(), scene.fleet["r0"].body.driven) == (before, [])


def test_what_stands_is_a_commanders() -> None:
    """Must 5: an operator's standing command is refused at the desk, and dropped at every door that it comes to."""
    scene = Scene(robots=2)
    anna = scene.desk("anna")
    with pytest.raises(RoleError):
        anna.send("(DRIVE 1)", standing=True, everybody=True)
    forged = Message("anna", 1, 1, Kind.COMMAND, scene.clock.now(), inf, "(DRIVE 1)", standing=True)
    scene.say(forged, KEYS["anna"])
    scene.run(2.0)
    assert drops(scene)[DropReason.NOT_ALLOWED] >= 1
    assert not any(robot.body.driven for robot in scene.fleet.values())


def test_a_robot_does_not_rule_the_others() -> None:
    """Must 5: whoever takes one robot tells the others what they may take or leave, and no rules."""
    scene = Scene(robots=2)
    chief = scene.desk()
    chief.send("(WHEN (= x 0) (TELL (RULE go (DRIVE 1))))")
    chief.send("(WHEN (= x 0) (TELL (JOIN bravo)))")
    scene.run(1.0)
    assert scene.fleet["r1"].node.rules() == []
    assert scene.fleet["r1"].node.groups == {"bravo"}


def test_a_message_cannot_say_its_own_role() -> None:
    """Must 5: the role comes from the key that signed, whatever else is in the message."""
    scene = Scene(robots=1)
    scene.desk("anna")
    now = scene.clock.now()
    body: dict[str, object] = {"role": "commander"}
    scene.say(
        Message("anna", 1, 1, Kind.COMMAND, now, now + 5, "(RULE go 1)", body=body, role="commander"), KEYS["anna"]
    )
    scene.run(0.5)
    assert scene.fleet["r0"].node.rules() == []


def test_a_name_that_is_not_the_keys_is_refused() -> None:
    """Must 5: anna's key does not speak for the chief."""
    scene = Scene(robots=1)
    scene.desk()
    now = scene.clock.now()
    scene.say(Message("chief", 1, 1, Kind.COMMAND, now, now + 5, "(DRIVE 1)"), KEYS["anna"])
    scene.run(0.2)
    assert drops(scene) == {DropReason.NOT_ALLOWED: 1}
    assert scene.fleet["r0"].body.driven == []


def test_strangers_and_revoked_keys_are_not_obeyed() -> None:
    """Musts 5 and 7: an unknown key, and one that was revoked a moment ago, even for STOP."""
    scene = Scene(robots=1)
    stranger = KeyPair("chief", Role.COMMANDER, b"x" * 32)
    now = scene.clock.now()
    scene.desk("bert")
    scene.say(Message("chief", 1, 1, Kind.COMMAND, now, now + 5, "(DRIVE 1)"), stranger)
    scene.run(0.1)
    scene.trust.revoke("anna")
    for number, kind in enumerate((Kind.COMMAND, Kind.STOP, Kind.ASK), 1):
        scene.say(Message("anna", 1, number, kind, now, now + 5, "(DRIVE 1)" * (kind is not Kind.STOP)), KEYS["anna"])
    scene.run(0.2)
    assert drops(scene) == {DropReason.UNKNOWN_KEY: 1, DropReason.REVOKED: 3}
    assert not scene.fleet["r0"].node.stopped
    assert scene.fleet["r0"].body.driven == []


def test_forgeries_change_nothing_are_not_answered_and_cost_no_more_than_the_set_rate() -> None:
    """Must 7: an attacker who knows a key's id makes a robot look at a set number of signatures a second, and STOP of
    the same key has a budget of its own."""
    scene = Scene(robots=1)
    scene.desk("bert")
    robot, now = scene.fleet["r0"], scene.clock.now()
    before = len(scene.sent)
    for number in range(1_000):
        (good,) = encode(Message("anna", 1, number, Kind.COMMAND, now, now + 5, "(DRIVE 1)"), FLEET, KEYS["anna"])
        robot.wire.heard.append(good[:-1] + bytes([good[-1] ^ 1]))
    robot.wire.heard += [b"", b"x" * 2_000, bytes(200)]
    scene.run(0.05)
    found = drops(scene)
    assert found[DropReason.FORGED] + found[DropReason.TOO_MANY] == 1_000
    assert found[DropReason.FORGED] <= 210
    assert found[DropReason.MALFORMED] == 3
    assert len(scene.sent) == before, "nobody answers a forger"
    scene.say(Message("anna", 1, 5_000, Kind.STOP, now), KEYS["anna"])
    scene.run(0.05)
    assert robot.node.stopped
    assert robot.body.driven == []


def test_a_replay_changes_nothing() -> None:
    """Must 7: everything that was on the air, all of it once more, in any order."""
    scene = Scene(robots=3)
    desk = scene.desk()
    desk.send("(PROGN (DRIVE 1) (DEFVAR n 0) (SETQ n (+ n 1)))", everybody=True)
    scene.run(1.0)
    desk.send("(DRIVE 2)", everybody=True)
    scene.run(1.0)
    recorded = list(scene.sent)
    scene.chance.shuffle(recorded)
    for datagram in recorded:
        scene.fly("stranger", datagram)
    scene.run(2.0)
    for robot in scene.fleet.values():
        assert robot.body.driven == [1.0, 2.0]
        assert dict(robot.node.variables())["n"] == 1.0


def test_what_is_late_is_not_done() -> None:
    """Must 7, and `a retried arming takes effect late`: a command held back on the way is not obeyed after its time."""
    scene = Scene(robots=1)
    desk = scene.desk()
    scene.isolate("r0")
    desk.send("(DRIVE 1)", everybody=True, deadline=2.0)
    scene.run(2.5)
    recorded = list(scene.sent)
    scene.run(2.0)
    scene.join("r0")
    for datagram in recorded:
        scene.fly("stranger", datagram)
    scene.run(3.0)
    assert scene.fleet["r0"].body.driven == []


def test_built_in_rules_cannot_be_touched_over_the_air() -> None:
    """Must 8: not even by a commander, in any way that the language has."""
    scene = Scene(robots=1)
    robot = scene.fleet["r0"]
    robot.node.install("keep", "(DRIVE 0)", priority=9)
    desk = scene.desk()
    for text in ("(RULE keep 1)", "(FORGET keep)", "(DEACTIVATE keep)", "(LEASE keep 0)"):
        sent = desk.send(text, everybody=True, count=1 if "FORGET" in text else None)
        scene.run(0.3)
        assert desk.accounting(sent.id).n_fault == 1, text
    (kept,) = robot.node.rules()
    assert (kept.active, kept.protected, kept.text) == (True, True, "(DRIVE 0)")


def test_a_rule_that_goes_wrong_is_deactivated_reported_and_rolled_back() -> None:
    """Must 8: the desk hears of it unasked, and ROLLBACK brings the last good rules back."""
    scene = Scene(robots=1)
    desk = scene.desk()
    desk.send("(RULE good (SETQ throttle 0.5))", standing=True, everybody=True)
    scene.run(2.0)
    desk.send("(PROGN (RULE good (SETQ throttle 1)) (RULE bad (/ 1 0)))", standing=True, everybody=True)
    scene.run(1.0)
    assert [report.body["label"] for report in desk.reports] == ["rule bad deactivated"]
    assert {rule.name: rule.active for rule in scene.fleet["r0"].node.rules()} == {"good": True, "bad": False}
    desk.send("(ROLLBACK)", everybody=True, count=1)
    scene.run(0.5)
    assert [(rule.name, rule.text) for rule in scene.fleet["r0"].node.rules()] == [("good", "(SETQ throttle 0.5)")]


def test_everything_is_in_the_journal() -> None:
    """Must 9: what was sent, heard, refused and repeated, by whom, in order: a session can be read again."""
    scene = Scene(robots=2)
    anna = scene.desk("anna")
    scene.desk("chief")
    with pytest.raises(RoleError):
        anna.send("(RULE go 1)", everybody=True)
    sent = anna.send("(WHEN (> x 0) (DRIVE 1))")
    scene.run(0.5)
    scene.isolate("r1")
    stop = anna.stop()
    scene.run(1.0)
    scene.desk("chief").stop()
    scene.run(0.5)
    entries = [(entry.event.value, entry.who, entry.subject) for entry in anna.journal.entries()]
    assert entries[0] == ("refused", "anna", "")
    assert ("sent", "anna", sent.id) in entries
    assert [who for event, who, subject in entries if (event, subject) == ("heard", sent.id)].count("r1") == 1
    assert ("repeated", "anna", stop.id) in entries
    assert any(event == "heard" and who == "chief" for event, who, _ in entries)
    anna.conclude()
    accounts = {e.subject: e.details for e in anna.journal.entries() if e.event.value == "accounted"}
    assert [accounts[sent.id][f"n_{sort}"] for sort in ("matched", "not_matched", "fault", "silent")] == [1, 1, 0, 0]
    assert list(accounts[stop.id]["silent"]) == ["r1"]  # type: ignore[call-overload]
    spoken = next(e for e in anna.journal.entries() if e.who == "r1" and e.subject == sent.id)
    assert spoken.details["outcome"] == "matched"
