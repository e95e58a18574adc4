"""What robots know outlives them: each command is evaluated once, whenever the process ends."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from node.afloat import Afloat
from sleepcast.channel import Message


@pytest.mark.parametrize("seed", [1, 2])
def test_every_command_is_evaluated_once_whatever_happens(tmp_path: Path, seed: int) -> None:
    fleet = Afloat(4, tmp_path, seed, loss=0.3, twice=0.1, delay=0.06)
    sent: dict[str, Message] = {}
    numbers: dict[str, int] = {}
    first = fleet.post("(DEFVAR total 0)", standing=True)
    for number in range(1, 120):
        standing = number % 5 == 0
        text = f"(SETQ total (+ total {number}))" if standing else f"(NOTE {number})"
        message = fleet.post(text, standing=standing)
        sent[message.id], numbers[message.id] = message, number
        fleet.run(0.1, deaths=0.5)
    fleet.run(15.0)
    for robot in fleet.robots:
        assert robot.store.life(robot.name) > 0
        journal = robot.journal()
        times = Counter(command for command, _, _, _ in journal)
        assert times[first.id] == 1
        assert set(times.values()) == {1}, "each was evaluated once"
        outcomes = {command: (outcome, time) for command, _, time, outcome in journal}
        stood = [numbers[id] for id, message in sent.items() if message.standing]
        assert robot.node.evaluate("total").value == sum(stood), "each rule has done once what it does"
        done = Counter(robot.world.done)
        assert set(done.values()) <= {1}, "nothing was done twice"
        for id, message in sent.items():
            outcome, time = outcomes.get(id, ("never came", 0.0))
            if message.standing:
                assert outcome == "matched"
            elif outcome == "matched":
                assert numbers[id] in done
                assert time <= message.deadline
            else:
                assert outcome in ("interrupted", "late", "never came")
        assert robot.said == []
