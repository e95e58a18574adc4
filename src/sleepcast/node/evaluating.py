"""A node as those need it who evaluate a text in the place of that of a message: its bids, and what waits for an
instant."""

from __future__ import annotations

from collections.abc import Mapping
from math import nan
from typing import Protocol

from sleepcast.channel.message import Kind, Message
from sleepcast.core.clock import Clock
from sleepcast.core.errors import SleepcastError
from sleepcast.language.program import Program
from sleepcast.mind.authority import Authority
from sleepcast.mind.views import EvaluatedCommand
from sleepcast.node.memory import RobotMemory


class Thinking(Protocol):
    """A node."""

    name: str
    stopped: bool
    catching_up: bool
    authority: Authority
    clock: Clock | None
    zero: float

    @property
    def memory(self) -> RobotMemory: ...
    @property
    def groups(self) -> frozenset[str]: ...
    def program(self, text: str) -> Program: ...
    def judge(self, program: Program, message: Message, now: float) -> EvaluatedCommand: ...
    def answer(
        self, message: Message, outcome: str, value: float, fault: str, details: Mapping[str, object]
    ) -> None: ...
    def say(self, kind: Kind, *, body: dict[str, object]) -> None: ...


class NodeEvaluator:
    """See the module."""

    def __init__(self, node: Thinking) -> None:
        self._node = node

    @property
    def is_held_still(self) -> bool:
        return self._node.stopped or self._node.catching_up

    def objection(self, message: Message, text: str, now: float) -> str:
        node = self._node
        try:
            return node.authority.objection(message, node.program(text), node.groups, now)
        except SleepcastError as error:
            return str(error).splitlines()[0]

    def outcome_of(self, message: Message, text: str, now: float) -> EvaluatedCommand:
        try:
            return self._node.judge(self._node.program(text), message, now)
        except SleepcastError as error:
            return EvaluatedCommand("fault", nan, str(error).splitlines()[0])
