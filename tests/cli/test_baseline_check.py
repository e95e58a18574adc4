"""Robots end the same whatever they had when a baseline came: the proposal, evaluated by real minds."""

from __future__ import annotations

from random import Random

import pytest

from sleepcast.channel import Kind, Message
from sleepcast.cli.baseline_check import Case, _difference
from sleepcast.language.vocabulary import Quantity, Vocabulary
from sleepcast.mind.telemetry import MindRecord
from sleepcast.station.baselines import propose

BODY = Vocabulary("body", (Quantity("fuel"),), (Quantity("drive"),))
NAMES = ("a", "b", "c", "d")
NOTHING = MindRecord([], [], [])


def text_of(chance: Random, number: int) -> str:
    """One of the commands that people send, about a few names, so that most replace one another."""
    name, other = chance.choice(NAMES), chance.choice(NAMES)
    return chance.choice(
        (
            f"(RULE {name} (SETQ drive {number}))",
            f"(RULE {name} (WHEN (IN g{other}) (SETQ drive (+ {number} (f{other} 1)))))",
            f"(DEFUN f{name} (x) (+ x {number}))",
            f"(DEFUN f{name} (x) (f{other} {number}))",
            f"(RULE {name} {number} :priority {number % 19 - 9})",
            f"(FORGET {name})",
            f"(FORGET f{name})",
            f"(ACTIVATE {name})",
            f"(DEACTIVATE {name})",
            f"(SETQQ e{chance.randint(1, 3)} (SETQ drive {number}))",
            f"(ACTIVATE e{chance.randint(1, 3)})",
            f"(JOIN g{name})",
            f"(LEAVE g{name})",
            f"(PROGN (RULE {name} {number}) (RULE {other} {number}))",
            f"(RULE f{name} {number})" if chance.random() < 0.1 else f"(RULE {name} {number})",
            f"(WHEN (IN g{other}) (RULE {name} {number}))" if chance.random() < 0.1 else f"(RULE {name} {number})",
            f"(DEFVAR v{name} {number})" if chance.random() < 0.1 else f"(RULE {name} {number})",
        )
    )


def messages(texts: list[str]) -> dict[int, Message]:
    return {
        number: Message("desk", 1, number, Kind.COMMAND, float(number), float("inf"), text, True)
        for number, text in enumerate(texts, start=1)
    }


@pytest.mark.parametrize("seed", range(12))
def test_what_is_dropped_makes_no_difference_wherever_a_robot_was_away(seed: int) -> None:
    chance = Random(seed)
    sent = messages([text_of(chance, number) for number in range(chance.choice((10, 40, 120)))])
    refused: set[int] = set()
    Case(("r1",), BODY, NOTHING, frozenset()).learned(sent.values(), refused)
    kept, touched = propose(dict(sent), refused)
    case = Case(("r1",), BODY, NOTHING, touched)
    full = case.learned(sent.values())
    for cut in {0, len(sent), *(chance.randrange(len(sent)) for _ in range(6))}:
        rest = [sent[number] for number in sent if number <= cut or number in kept]
        assert not _difference(full, case.learned(rest), registers=True), (cut, kept)


def test_a_mind_that_refused_a_command_differs() -> None:
    sent = messages(["(RULE a 1)", "(RULE a 2)", "(RULE a 3)"])
    kept, touched = propose(dict(sent))

    def objection(*rules: tuple[str, str, bool]) -> str:
        return Case(("r1",), BODY, MindRecord([], [], list(rules)), touched).objection(sent, kept)

    assert "differ in the rule a" in objection(("a", "2", False))
    assert objection(("a", "1", True)) == "", "all of them are refused by each"
    assert objection(("mine", "7", True), ("a", "3", False), ("other", "8", False)) == ""


def test_what_others_have_taught_is_no_difference_and_is_used() -> None:
    sent = messages(["(RULE a (f 1))", "(RULE a (f 2))", "(RULE a (f 3))"])
    kept, touched = propose(dict(sent))
    start = MindRecord(["birds"], [("f", ["x"], "(+ x 1)")], [("a", "(f 3)", False)])
    assert Case(("r1",), BODY, start, touched).objection(sent, kept) == ""
    assert len(kept) == 2


def test_priorities_of_rules_are_compared_and_those_of_others_are_used() -> None:
    sent = messages(["(RULE a 1)", "(RULE a (own) :priority 2)", "(RULE a own :priority 3)"])
    kept, touched = propose(dict(sent))

    def objection(vocabulary: Vocabulary = BODY, **priorities: int) -> str:
        rules = [("guard", "1", True), ("own", "7", False), ("a", "own", False)]
        return Case(("r1",), vocabulary, MindRecord([], [], rules, priorities), touched).objection(sent, kept)

    assert objection(guard=4, own=12, a=3) == "", "own has it from its host"
    assert objection(guard=4, own=-9, a=3) == "", "own has it from a RULE, or its host"
    assert "differ in the rule a" in objection(guard=4, a=2)
    assert "differ in the rule a" in objection(guard=0, a=3), "guard would be outranked, so robots have refused it"
    assert "differ in the rule a" in objection(Vocabulary("body", forms=frozenset()), guard=4, a=3), "of 0.2.0"


def test_a_proposal_that_drops_too_much_is_found_out() -> None:
    sent = messages(["(RULE a 1)", "(RULE b 1)", "(RULE a 2)", "(FORGET b)"])
    _, touched = propose(dict(sent))
    case = Case(("r1",), BODY, MindRecord([], [], [("a", "2", False)]), touched)
    assert "would differ in" in case.objection(sent, [1, 3])
