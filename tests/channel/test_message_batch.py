"""Batches of messages."""

from __future__ import annotations

import numpy as np

from sleepcast.channel.message import Kind
from sleepcast.channel.message_batch import MessageBatch, NameIndex, Reports, in_settled_order

NAMES = NameIndex(prefix="r", count=9)


def reports(label: str, rule: str, *robots: int) -> MessageBatch:
    indices = np.array(robots)
    sequences = (10 + indices).astype(np.int32)
    return MessageBatch(
        Kind.REPORT, NAMES, 1, indices, np.zeros_like(indices), sequences, indices / 10.0, 5.0, Reports(label, (), rule)
    )


def test_robots_that_deactivate_a_rule_say_so_in_one_order_whichever_minds_come_first() -> None:
    marked, other = reports("marked", "", 0, 4), reports("rule other deactivated", "other", 3)
    first, second = (reports("rule go deactivated", "go", *robots) for robots in ((2, 7), (5,)))
    orders = [first, marked, other, second], [marked, second, first, other]
    (found, again) = (
        [[(m.id, m.body["label"]) for m in batch.messages()] for batch in in_settled_order(order)] for order in orders
    )
    assert found == again
    assert [(f"r{robot + 1}-1.{10 + robot}", "rule go deactivated") for robot in (2, 5, 7)] in found
    assert len(found) == 3


def test_a_robots_own_messages_stay_in_their_order_and_keep_their_values() -> None:
    def said(label: str, sequence: int, **values: float) -> MessageBatch:
        robots = np.array([int(name[1:]) for name in values])
        words = Reports(label, (np.array([*values.values()]),))
        sequences, zeros = np.full(len(robots), sequence, np.int32), np.zeros(len(robots))
        return MessageBatch(Kind.REPORT, NAMES, 1, robots, np.arange(len(robots)), sequences, zeros, 5.0, words)

    one, other = said("b", 7, r3=0.3, r6=0.6), said("b", 7, r1=0.1, r4=0.4)
    later, between = said("a", 9, r3=3.0, r4=4.0), said("c", 8, r4=40.0)
    settled = in_settled_order([other, between, one, later])
    found = [[(m.sender, m.sequence, m.body["label"], *m.body["values"]) for m in each.messages()] for each in settled]  # type: ignore[misc]
    assert found == [
        [("r2", 7, "b", 0.1), ("r4", 7, "b", 0.3), ("r5", 7, "b", 0.4), ("r7", 7, "b", 0.6)],
        [("r4", 9, "a", 3.0)],
        [("r5", 8, "c", 40.0)],
        [("r5", 9, "a", 4.0)],
    ]
