"""Two operators' commands about the same rules: whatever the order in which they arrive, the same is left."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import permutations
from random import Random

import msgspec
import pytest

from sleepcast.channel import Kind, Message
from sleepcast.language.vocabulary import Vocabulary
from sleepcast.mind.state import MindState
from sleepcast.node.node import Node
from sleepcast.node.state import mind_of, restore

NOTHING = Vocabulary("nothing")
CHANGES = (
    *("(RULE a 1)", "(RULE a 2)", "(RULE b 3)", "(SETQQ c 4)", "(SETQQ E5 6)"),
    *("(ACTIVATE a)", "(DEACTIVATE a)", "(ACTIVATE c)", "(DEACTIVATE b)", "(ACTIVATE E5)", "(SETQ active5 0)"),
    *("(FORGET a)", "(FORGET b)", "(DEFUN f (x) (+ x 1))", "(DEFUN f (x) (+ x 2))", "(FORGET f)"),
    *("(JOIN g)", "(LEAVE g)", "(PROGN (RULE a 7) (RULE b 8))"),
)


def commands(texts: Iterable[str], senders: int = 2) -> list[Message]:
    """These texts, one a second, from senders in turn."""
    return [
        Message(f"desk{number % senders}", 1, number + 1, Kind.COMMAND, 10.0 + number, text=text, standing=True)
        for number, text in enumerate(texts)
    ]


def left(messages: Iterable[Message], *, restart: bool = False) -> tuple[object, ...]:
    """What they make of a robot that hears one in each tick. restart: after each, it goes on as a new one."""
    node = Node("r1", NOTHING, on_air=True)
    for tick, message in enumerate(messages, 1):
        node.receive(message)
        node.think(tick, 100.0 + tick)
        if restart:
            kept = msgspec.msgpack.encode(mind_of(node))
            node = Node("r1", NOTHING, on_air=True)
            node.think(tick, 100.0 + tick)
            assert restore(msgspec.msgpack.decode(kept, type=MindState), node, 0.0) == []
    rules = [(rule.name, rule.text, rule.active) for rule in node.rules()]
    operators = {name: program.text for name, program in node.memory.base.operators.items()}
    return rules, operators, node.groups, node.values[3:67]


@pytest.mark.parametrize("restart", [False, True])
def test_any_order_leaves_the_same(restart: bool) -> None:
    chance = Random(1)
    for _ in range(150):
        sent = commands(chance.choices(CHANGES, k=8))
        wanted = left(sent)
        chance.shuffle(sent)
        assert left(sent, restart=restart) == wanted, [message.text for message in sent]


def test_the_order_of_one_sender_counts_before_his_clock() -> None:
    first, second = (
        Message("desk", 1, number, Kind.COMMAND, issued, text=text)
        for number, issued, text in ((1, 10.0, "(RULE a 1)"), (2, 10.0, "(RULE a 2)"))
    )
    for heard in permutations((first, second)):
        rules = left(heard)[0]
        assert rules == [("a", "2", True)]


def test_a_command_that_came_too_late_to_change_something_says_so() -> None:
    node = Node("r1", NOTHING, on_air=True)
    older, newer = commands(("(DEACTIVATE a)", "(RULE a 1)"))
    for tick, message in enumerate((newer, older), 1):
        node.receive(message)
        node.think(tick, 100.0)
    faults = [message.body["fault"] for message in node.outbox]
    assert faults == [None, "a was changed by a command that was sent later in (DEACTIVATE a)"]


def test_what_waits_together_is_evaluated_in_the_order_of_all() -> None:
    node = Node("r1", NOTHING, on_air=True)
    sent = commands([f'(REPORT "{number}")' for number in range(6)])
    for message in (*sent[1::2], *sent[::2]):
        node.receive(message)
    node.think(1, 20.0)
    assert [m.body["label"] for m in node.outbox if m.kind is Kind.REPORT] == [str(number) for number in range(6)]
