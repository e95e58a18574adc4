"""One node's process from within."""

from __future__ import annotations

from math import inf

from sleepcast.bridges import UNLIMITED, Opening, open_robot
from sleepcast.cli.node_life import NodeProcess, StartScript


def test_a_long_start_counts_for_deadlines() -> None:
    """The mind's time is that of its messages' deadlines, which count from its zero, however long it took to begin."""
    robot = open_robot("sim", Opening(False, UNLIMITED, 1, 0))
    life = NodeProcess("r1", robot, None, None, None, number=1, seed=0, lease=inf)
    life.begin(StartScript(), StartScript())
    life.node.zero -= 100.0  # that long ago
    life.go_on(lambda: None, 0.05, 0.2)
    assert 100.0 < life.node.evaluate("time").value < 200.0
