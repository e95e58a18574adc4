"""A robot's journal: each entry has the times of its arrival and of its effect, however late ticks are."""

from __future__ import annotations

import sqlite3
from pathlib import Path

from safety.scene import VOCABULARY, Body
from sleepcast.channel import Kind, Message
from sleepcast.core.clock import ManualClock
from sleepcast.node.node import Node
from sleepcast.node.store import Store


def test_an_entry_has_the_times_of_arrival_and_effect_and_not_that_of_a_tick(tmp_path: Path) -> None:
    clock = ManualClock(1_000_000.0)
    store = Store(tmp_path / "r1.store", clock, print)
    node = Node("r1", VOCABULARY, body=Body())
    node.clock, node.zero = clock, clock.now()
    store.adopt(node, None)
    node.think(1, 0.0)
    clock.advance(2.5)  # the next tick is late; meanwhile a command and a STOP come
    node.receive(Message("desk", 1, 1, Kind.COMMAND, 2.0, text="(DRIVE 1)", heard=2.1))
    node.receive(Message("desk", 1, 2, Kind.STOP, 2.2, heard=2.4))
    if store.before():
        store.write()
    clock.advance(1.0)
    node.think(2, 2.5)
    if store.after():
        store.write()
    store.close()
    with sqlite3.connect(tmp_path / "r1.store") as opened:
        found = opened.execute("SELECT kind, arrived - 1e6, time - 1e6 FROM journal ORDER BY number").fetchall()
    opened.close()
    assert [(kind, round(arrived, 3), round(time, 3)) for kind, arrived, time in found] == [
        ("stop", 2.4, 2.5),
        ("command", 2.1, 3.5),
    ]
