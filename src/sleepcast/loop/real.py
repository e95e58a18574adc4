"""A mind with a real body, in real time: one tick after the other, each through one function in one order.

    sense    what the body last measured
    deliver  what the channel has brought is received, and written down if somebody keeps it
    think    ... and thought about, with the active rules
    act      what the mind wants of its body's actuators goes there
    report   what has come of it is written down, and what the mind says goes on the air

Nobody watches a robot that is on its own, so the loop does: ticks that begin late are counted, and what a robot could
not keep up with is let go, never made up for; a body that fails ends the run; and however it ends, the body is stopped
first.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from math import inf, nan
from typing import Protocol

from sleepcast.channel import Channel
from sleepcast.core.clock import Clock
from sleepcast.node.node import Node
from sleepcast.robot import Robot, Setpoint


class Keeper(Protocol):
    """Keeps what minds know, so that it outlives this process."""

    def before(self) -> None:
        """Messages were received, and are to be thought about now."""

    def after(self) -> None:
        """They were thought about."""


@dataclass(slots=True)
class Watch:
    """How a run goes. ticks: how many so far; late: those that began when the next one was due already; worst: by how
    many s the latest of them was late. measured: time of the last reading that was news."""

    ticks: int = 0
    late: int = 0
    worst: float = 0.0
    measured: float = -inf

    def begin(self, lag: float, tick: float) -> None:
        """A tick of `tick` s begins `lag` s after it was due."""
        self.ticks += 1
        if 0.0 < tick <= lag:
            self.late += 1
            self.worst = max(self.worst, lag)

    def __str__(self) -> str:
        return f"{self.ticks} ticks, {self.late} late" + (f", the latest by {self.worst:.2f} s" if self.late else "")


def run_robot(
    node: Node,
    robot: Robot,
    clock: Clock,
    channel: Channel,
    *,
    tick: float,
    going: Callable[[], bool],
    watch: Watch,
    sleep: Callable[[float], None] = time.sleep,
    keeper: Keeper | None = None,
) -> None:
    """Let a mind live in its body until `going`, asked before each tick, says no; then the body is stopped.

    node: its body is `robot`. clock: of the mind, whose time begins with 0. tick: s from one to the next; 0 for a body
    in step, whose `sense` waits for the next one by itself (and which is its own clock). sleep: waits so many s of
    `clock`. keeper: of what the mind knows. Raises whatever `robot` and `channel` raise, once the body is stopped.
    """
    start = due = clock.now()
    try:
        while going():
            now = clock.now()
            if now < due:
                sleep(due - now)
                now = clock.now()
            watch.begin(now - due, tick)
            due = max(due + tick, now)
            step_robot(node, robot, clock, channel, watch, start, keeper)
    finally:
        robot.stop()


def step_robot(
    node: Node,
    robot: Robot,
    clock: Clock,
    channel: Channel,
    watch: Watch,
    start: float,
    keeper: Keeper | None = None,
) -> None:
    """One tick: sense, deliver, think, act, report. start: when the mind's time began, s of `clock`."""
    reading = robot.sense()
    now = clock.now() - start
    if reading.time > watch.measured:  # what has been heard before is not measured again: it grows old
        watch.measured = reading.time
        node.sense(reading.values, now)
    for message in channel.receive():
        node.receive(message)
    if keeper is not None:
        keeper.before()
        now = clock.now() - start  # writing takes its time, and nothing is evaluated after its deadline
    node.think(watch.ticks, now)
    act(node, robot)
    if keeper is not None:
        keeper.after()
    for message in node.outbox:
        channel.send(message)
    node.outbox.clear()
    node.pings.clear()  # there is nothing here that could send them


def act(node: Node, robot: Robot) -> None:
    """Give a body what its mind has assigned to actuators since the last time."""
    wanted = node.actuators()
    if wanted:
        robot.act(Setpoint(*(wanted.get(actuator.name, nan) for actuator in robot.model.actuators)))
