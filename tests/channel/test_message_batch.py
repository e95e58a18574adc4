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
    assert found[-1] == [(f"r{robot + 1}-1.{10 + robot}", "rule go deactivated") for robot in (2, 5, 7)]
    assert in_settled_order([first, marked]) == [first, marked], "nothing to be put in order"
