"""The dead man's lease: a body that somebody drives comes to rest when nobody is heard, and nothing old resumes."""

from __future__ import annotations

from math import inf, nan
from pathlib import Path

import pytest

from sleepcast.channel import Kind, Message
from sleepcast.core.errors import MisuseError
from sleepcast.loop import vocabulary_of
from sleepcast.mind.authority import read_lease
from sleepcast.node.node import Node
from sleepcast.robot import Setpoint
from sleepcast.simulator import Simulator
from small_worlds import simulator

TICK = 0.1


class Drill:
    """One robot, and what it hears at which time."""

    def __init__(self, folder: Path, lease: float = 1.0) -> None:
        self.world: Simulator = simulator(folder)
        self.world.place(0, 500.0, 500.0, 0.0)
        self.body = self.world.robots[0]
        self.node = Node("r1", vocabulary_of(self.body.model), body=self.body, lease=lease)
        self.number = 0

    def hear(self, text: str = "", kind: Kind = Kind.COMMAND, role: str = "operator", standing: bool = False) -> None:
        self.number += 1
        self.node.receive(
            Message("desk", 1, self.number, kind, self.world.time, text=text, standing=standing, role=role)
        )

    def run(self, seconds: float, heartbeat: float = inf, role: str = "operator") -> None:
        every = round(heartbeat / TICK) if heartbeat < inf else 0
        for tick in range(round(seconds / TICK)):
            if every and tick % every == 0:
                self.hear(kind=Kind.HEARTBEAT, role=role)
            self.world.step()
            if self.node.awake:
                self.node.sense(self.body.sense().values, self.world.time)
                self.node.think(self.world.tick, self.world.time)
                wanted = self.node.actuators()
                if wanted:
                    self.body.act(Setpoint(wanted.get("drive_speed", nan), wanted.get("drive_turn", nan)))

    @property
    def speed(self) -> float:
        return float(self.world.bodies.speed[0])


@pytest.fixture
def drill(tmp_path: Path) -> Drill:
    return Drill(tmp_path)


@pytest.mark.parametrize("text", ["(DRIVE 2 0)", "(SETQ drive_speed 2)", "(GOTO 900 500)"])
def test_a_driven_body_comes_to_rest_when_nobody_is_heard(drill: Drill, text: str) -> None:
    drill.hear(text)
    drill.run(1.0)
    assert drill.speed > 1.5
    assert drill.node.driven
    drill.run(3.5)
    assert drill.speed == 0.0
    assert not drill.node.driven
    assert not drill.node.stopped, "it obeys the next command"
    assert [message.body["label"] for message in drill.node.outbox if message.kind is Kind.REPORT] == [
        "at rest: nobody drives it any more"
    ]


def test_nothing_old_resumes_when_somebody_is_heard_again(drill: Drill) -> None:
    drill.hear("(GOTO 900 500)")
    drill.run(5.0)
    drill.run(5.0, heartbeat=0.3)
    assert drill.speed == 0.0
    drill.hear("(DRIVE 2 0)")
    drill.run(1.0)
    assert drill.speed > 1.5


def test_heartbeats_keep_it_going_but_only_of_those_who_may_command(drill: Drill) -> None:
    drill.hear("(DRIVE 2 0)")
    drill.run(10.0, heartbeat=0.3)
    assert drill.speed == 2.0
    drill.run(3.0, heartbeat=0.3, role="observer")
    drill.run(1.0, heartbeat=0.3, role="robot")
    assert drill.speed == 0.0


def test_what_stands_keeps_nobody_going_for_it_may_be_old(drill: Drill) -> None:
    drill.hear("(DRIVE 2 0)")
    for _ in range(8):
        drill.hear("(DEFVAR a 1)", role="commander", standing=True)
        drill.run(0.4)
    assert drill.speed == 0.0


@pytest.mark.parametrize(
    ("text", "role", "standing"),
    [
        ("(DRIVE 2 0)", "robot", False),  # told by another robot
        ("(DRIVE 2 0)", "commander", True),
        ("(DRIVE 2 0)", "", False),  # in one process, where nobody signs
        ("(RULE go (DRIVE 2 0))", "commander", False),
    ],
)
def test_a_robot_on_a_mission_of_its_own_needs_nobody(drill: Drill, text: str, role: str, standing: bool) -> None:
    drill.hear(text, role=role, standing=standing)
    drill.run(5.0)
    assert drill.speed == 2.0
    assert not drill.node.driven


def test_a_rule_that_moves_it_takes_over(drill: Drill) -> None:
    drill.hear("(RULE go (WHEN (> time 0.85) (DRIVE 2 0)))", role="commander")
    drill.hear("(DRIVE 1 0)")
    drill.run(5.0)
    assert drill.speed == 2.0


@pytest.mark.parametrize("text", ['(TK "hello")', "(DEFVAR a 1)", "(WHEN (> x 900) (DRIVE 0 0))", '(REPORT "x" x)'])
def test_a_command_that_moves_nothing_drives_nobody(drill: Drill, text: str) -> None:
    drill.body.wander()
    drill.hear(text)
    drill.run(4.0)
    assert not drill.node.driven
    assert drill.speed == 5.0


def test_it_may_be_off(tmp_path: Path) -> None:
    drill = Drill(tmp_path, lease=inf)
    drill.hear("(DRIVE 2 0)")
    drill.run(20.0)
    assert drill.speed == 2.0


def test_a_stop_stays_latched(drill: Drill) -> None:
    drill.hear("(DRIVE 2 0)")
    drill.run(0.5)
    drill.hear(kind=Kind.STOP)
    drill.run(5.0)
    drill.hear("(DRIVE 2 0)")
    drill.run(3.0)
    assert drill.node.stopped
    assert drill.speed == 0.0


@pytest.mark.parametrize(("text", "lease"), [("1s", 1.0), ("0.5", 0.5), ("OFF", inf), (" 2 s", 2.0)])
def test_leases_as_they_are_said(text: str, lease: float) -> None:
    assert read_lease(text) == lease


@pytest.mark.parametrize("text", ["", "never", "0", "-1s", "nan", "inf", "0.01s", "2h", "99999"])
def test_what_is_no_lease(text: str) -> None:
    with pytest.raises(MisuseError, match=r"wanted .* or off"):
        read_lease(text)
