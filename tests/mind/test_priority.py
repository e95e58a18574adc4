"""`:priority` of a RULE: which of a robot's rules has the last word, and that none comes above a built-in one."""

from __future__ import annotations

from random import Random

import pytest
from msgspec.msgpack import decode, encode

from fleet.twins import Twins
from language.cases import Body
from sleepcast.channel import Message
from sleepcast.channel.message import HOPS, Kind
from sleepcast.language import CheckError
from sleepcast.language.functions import MAX_PRIORITY, PRIORITY
from sleepcast.language.vocabulary import NEW_FORMS, Vocabulary
from sleepcast.mind.inspection import mind_text
from sleepcast.mind.state import MindState, RuleState, SharedRule
from sleepcast.mind.telemetry import VocabularyRecord, read_mind, read_vocabulary, vocabulary_text
from sleepcast.node.node import Node
from sleepcast.node.state import mind_of, restore
from station.test_whose_names import Fleet, rover, said


def lamp(both: Twins) -> float:
    """What the last rule of a tick has left in every robot's lamp."""
    both.think()
    both.compare()
    found = {dict(mind.variables())["lamp"] for mind in (*both.views, *both.nodes)}
    assert len(found) == 1
    return found.pop()


def twins(*texts: str) -> Twins:
    both = Twins(2)
    for text in texts:
        both.do(text)
        both.compare()
    return both


def priorities(both: Twins) -> dict[str, int]:
    return {rule.name: rule.priority for rule in both.nodes[0].rules()}


def test_the_highest_priority_has_the_last_word_however_late_others_come() -> None:
    both = twins("(RULE a (SETQ lamp 1) :priority 2)", "(RULE b (SETQ lamp 2))", "(RULE c (SETQ lamp 3) :priority -1)")
    assert lamp(both) == 1.0
    both.do("(RULE d (SETQ lamp 4) :priority 2)")
    assert lamp(both) == 4.0, "rules of one priority run in the order of arrival"
    both.do("(FORGET a)")
    both.do("(RULE E1 (SETQ lamp 5) :PRIORITY 3)")
    assert lamp(both) == 5.0, "buffers, too"
    assert priorities(both) == {"E1": 3, "b": 0, "c": -1, "d": 2}


def test_what_is_stored_again_has_the_priority_that_is_said_then() -> None:
    both = twins("(RULE a (SETQ lamp 1) :priority 2)", "(RULE b (SETQ lamp 2))", "(RULE a (SETQ lamp 3))")
    assert (lamp(both), priorities(both)) == (2.0, {"a": 0, "b": 0})
    both = twins("(RULE E2 (SETQ lamp 1) :priority 2)", "(SETQQ E2 (SETQ lamp 3))", "(RULE b (SETQ lamp 2))")
    assert (lamp(both), priorities(both)) == (2.0, {"E2": 0, "b": 0})


def test_a_rule_that_remembers_keeps_its_priority() -> None:
    both = twins("(RULE a (ONCE TRUE (SETQ lamp 1)) :priority 2)", "(RULE b (SETQ lamp 2))")
    assert priorities(both) == {"a": 2, "b": 0}


@pytest.mark.parametrize("more", ["", f" {PRIORITY}", f" {PRIORITY} 10", f" {PRIORITY} -10", f" {PRIORITY} 1.5"])
def test_what_is_no_priority_is_refused(more: str) -> None:
    node = Node("r", Vocabulary())
    if not more:
        assert node.evaluate("(RULE a 1)").faults == ()
        return
    both = twins(f"(RULE a 1{more})", f"(RULE a 1{more}m)")
    assert priorities(both) == {}


def test_no_rule_from_the_air_comes_above_a_built_in_one() -> None:
    both = Twins(2)
    for robot in range(2):
        both.install(robot, "guard", "(SETQ lamp 7)", 1, protected=True)
    both.do(f"(RULE a (SETQ lamp 1) :priority {MAX_PRIORITY})")
    assert lamp(both) == 7.0

    both = Twins(2)
    for robot in range(2):
        both.install(robot, "guard", "(SETQ lamp 7)", 0, protected=True)
    both.do("(RULE a (SETQ lamp 1) :priority 1)")
    both.compare()
    (view,) = both.views[0].rules()
    assert view.name == "guard", "refused"
    both.do("(RULE a (SETQ lamp 1) :priority -1)")
    assert lamp(both) == 7.0
    assert both.nodes[0].evaluate("(RULE b 1 :priority 1)").faults[0].reason == (
        "b would outrank guard, which is built in: here :priority is at most 0"
    )


def test_a_built_in_rule_that_comes_later_is_not_outranked_and_not_starved() -> None:
    loop = "(DOTIMES (i 1000) (+ i 1 1 1 1 1 1 1))"
    both = twins("(DEFVAR n 0)", *(f"(RULE k{i} {loop} :priority 5)" for i in range(9)))
    assert both.fleet.scheduler.left_over
    for robot in range(2):
        both.install(robot, "guard", "(SETQ n (+ n 1))", 0, protected=True)
    for _ in range(8):
        both.think()
        both.compare()
    ran = {dict(mind.variables())["n"] for mind in (*both.views, *both.nodes)}
    assert len(ran) == 1
    assert ran.pop() >= 2.0, "left over once, it is first in the next tick"


def test_a_priority_that_its_host_gave_stays_the_hosts() -> None:
    both = Twins(2)
    for robot in range(2):
        both.install(robot, "own", "(SETQ lamp 7)", 3, protected=False)
    both.do("(RULE own (SETQ lamp 8))")
    assert (lamp(both), priorities(both)) == (8.0, {"own": 3})
    assert "leave out :priority" in both.nodes[0].evaluate("(RULE own 1 :priority 1)").faults[0].reason


def test_fleets_and_nodes_serve_the_same_rules_first() -> None:
    """Whatever the priorities, the budget and what a tick leaves over."""
    chance = Random(5)
    both = twins("(PROGN (DEFVAR n 0) (DEFVAR m 0))")
    for i in range(16):
        loop = f"(DOTIMES (i {chance.randint(500, 1000)}) (+ i 1 1 1 1 1 1 1))"
        body = f"(PROGN (SETQ n (+ n 1)) {loop} (SETQ m {i}))"
        both.do(f"(RULE k{i} {body} :priority {chance.randint(-MAX_PRIORITY, MAX_PRIORITY)})")
        both.compare()
    for _ in range(6):
        both.think()
        both.compare()
    assert both.fleet.scheduler.left_over


def test_rollback_brings_priorities_back() -> None:
    both = twins("(RULE a (SETQ lamp 1) :priority 2)", "(RULE b (SETQ lamp 2))")
    both.think(120)
    both.do("(RULE a (SETQ lamp 9))")
    both.do("(ROLLBACK)")
    assert (lamp(both), priorities(both)) == (1.0, {"a": 2, "b": 0})


def test_rollback_keeps_what_a_host_has_given_and_protected() -> None:
    both = twins("(RULE late (SETQ lamp 1) :priority 2)")
    for robot in range(2):
        both.install(robot, "own", "(SETQ lamp 7)", 3, protected=False)
    both.think(120)
    both.do("(RULE own (SETQ lamp 8))")
    for robot in range(2):
        both.install(robot, "late", "(SETQ lamp 5)", 1, protected=True)
    both.do("(ROLLBACK)")
    assert (lamp(both), priorities(both)) == (7.0, {"late": 1, "own": 3})
    assert [(rule.name, rule.text, rule.protected) for rule in both.nodes[0].rules()] == [
        ("late", "(SETQ lamp 5)", True),
        ("own", "(SETQ lamp 7)", False),
    ]
    both.do("(RULE own 1 :priority 5)")
    both.compare()
    assert priorities(both) == {"late": 1, "own": 3}, "refused"


def test_a_lease_does_not_end_a_rule_that_its_host_has_protected_since() -> None:
    both = twins("(RULE guard (SETQ lamp 1))", "(LEASE guard 3)")
    for robot in range(2):
        both.install(robot, "guard", "(SETQ lamp 7)", 0, protected=True)
    both.think(120)
    both.do("(SETQ lamp 0)")
    assert lamp(both) == 7.0
    both.do("(ROLLBACK)")
    both.think(120)
    both.do("(SETQ lamp 0)")
    assert lamp(both) == 7.0


def test_a_restart_keeps_what_the_host_gives_now() -> None:
    node, again = Node("r", Vocabulary(), body=Body()), Node("r", Vocabulary(), body=Body())
    for text in ("(RULE own 1)", "(RULE a 1 :priority 5)", "(RULE b 1 :priority 5)"):
        node.evaluate(text)
    again.install("own", "2", priority=3, protected=False)
    again.install("a", "2", priority=-2, protected=False)
    assert restore(mind_of(node), again, 0.0) == []
    assert [(rule.name, rule.text, rule.priority) for rule in again.rules()] == [
        ("own", "1", 3),
        ("a", "1", -2),
        ("b", "1", 5),
    ]


def test_a_store_keeps_priorities_and_one_of_0_2_0_has_none() -> None:
    node = Node("r", Vocabulary(), body=Body())
    node.evaluate("(RULE a 1 :priority 4)")
    kept = decode(encode(mind_of(node)), type=MindState)
    again = Node("r", Vocabulary(), body=Body())
    assert restore(kept, again, 0.0) == []
    assert [rule.priority for rule in again.rules()] == [4]
    assert decode(encode(["a", "1", True, None]), type=RuleState).rank == 0
    assert decode(encode(["a", "a", 0, True, False, 0]), type=SharedRule).rank == 0


def test_a_desk_far_away_sees_priorities_and_robots_of_0_2_0_tell_none() -> None:
    node = Node("r", Vocabulary(), body=Body())
    node.evaluate("(RULE a 1)")
    assert "priorities" not in mind_text(node.memory.base), "as it was"
    node.evaluate("(RULE b 1 :priority -3)")
    assert read_mind(mind_text(node.memory.base)).priorities == {"b": -3}
    assert read_vocabulary(vocabulary_text(Vocabulary())).forms == NEW_FORMS
    old = vocabulary_text(Vocabulary("old", forms=frozenset()))
    assert "forms" not in old
    assert read_vocabulary(old).forms == frozenset()


def test_only_a_commander_gives_priorities() -> None:
    node = Node("r", Vocabulary(), body=Body())
    for number, role in enumerate(("operator", "robot", "observer", "commander"), 1):
        node.receive(Message("x", 1, number, Kind.COMMAND, 0.0, text="(RULE a 1 :priority 2)", role=role))
        node.think(number, number / 10)
        assert len(node.rules()) == (role == "commander"), role
    told = node.evaluate("(DEFUN raise () (TELL 1))")
    assert told.faults == ()


@pytest.mark.parametrize("text", ["(RULE a 1 :priority 2)", "(DEFUN f () (PROGN 1 (RULE a 1 :priority 2)))"])
def test_no_robot_obeys_a_priority_that_another_one_tells(text: str) -> None:
    """A robot of 0.2.0 or a small computer would tell it, and where nobody signs no role forbids it."""
    node = Node("r", Vocabulary(), body=Body())
    node.receive(Message("x", 1, 1, Kind.COMMAND, 0.0, text=text, body={HOPS: 1}))
    node.think(1, 0.1)
    assert [outcome for _, outcome, _ in node.evaluated] == ["fault"]
    assert node.rules() == []
    node.receive(Message("x", 1, 2, Kind.COMMAND, 0.0, text="(RULE a 1)", body={HOPS: 1}))
    node.think(2, 0.2)
    assert len(node.rules()) == 1


def test_robots_that_do_not_know_it_refuse_a_priority() -> None:
    old = Node("r", Vocabulary("old", forms=frozenset()), body=Body())
    with pytest.raises(CheckError, match=":priority at 1:11 came after what these robots run"):
        old.evaluate("(RULE a 1 :priority 2)")
    assert old.evaluate("(RULE a 1)").faults == ()


def test_why_shows_a_priority_and_why_it_was_refused() -> None:
    node = Node("r", Vocabulary(), body=Body())
    node.install("guard", "1")
    for number, text in enumerate(("(RULE a 1 :priority -2)", "(RULE b 1 :priority 4)"), 1):
        node.receive(Message("x", 1, number, Kind.COMMAND, 0.0, text=text))
        node.think(number, number / 10)
        told = node.why()
        assert told is not None
        assert told.root.text == told.text == text
    assert told.faults == (f"b would outrank guard, which is built in: here :priority is at most 0 in {text}",)


def test_a_tell_carries_no_priority() -> None:
    fleet = Fleet(r1=rover("new"))
    fleet.tell("r1")
    assert "only a commander can" in said(fleet, "(TELL (WHEN TRUE (RULE a 1 :priority 2)))")
    assert VocabularyRecord.of(rover("new"), 0).forms == sorted(NEW_FORMS)
