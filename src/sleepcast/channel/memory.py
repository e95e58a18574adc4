"""The radio of a simulated swarm, in this process: range, loss, delay, duplication and reordering, all from
the seed.

Parties have numbers: the robots 0 to n - 1, the operator `OPERATOR`. What happens to a copy of a message is
a pure function of the seed, who sends what and when, and who receives it; neither the order of the calls nor
what else is on the air changes it. A copy waits until its time has come, then it lies in its receiver's
inbox.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.chance import key, uniform
from sleepcast.channel.message import TO_OPERATOR, Message
from sleepcast.clock import Clock
from sleepcast.errors import MisuseError

OPERATOR = -1
"""The operator's number among the parties."""
MAX_WAITING = 1_000_000
"""Copies on their way at one time: a thousand messages to a thousand robots. What is sent beyond is refused,
counted."""

_Numbers = NDArray[np.int64]
_Metres = NDArray[np.float64]
_Copy = tuple[float, int, int, int, int, int, int, Message]
"""When it is due, transmitter, epoch, sequence, repeat, receiver, copy; unique without the message itself."""


@dataclass(frozen=True, slots=True)
class RadioModel:
    """How good the radio is.

    reach: m from one robot to another. operator: where the operator sits (x, y in m; None: within reach of
    everybody), operator_reach: m between the operator and a robot. loss, duplication, reordering: chances,
    0..1, for each copy. delay: s that every copy takes; jitter: up to so many s more, drawn evenly.
    held_back: s by which a reordered copy comes later. Raises MisuseError for what cannot be.
    """

    reach: float = inf
    operator: tuple[float, float] | None = None
    operator_reach: float = inf
    loss: float = 0.0
    delay: float = 0.0
    jitter: float = 0.0
    duplication: float = 0.0
    reordering: float = 0.0
    held_back: float = 1.0

    def __post_init__(self) -> None:
        for name in ("loss", "duplication", "reordering"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise MisuseError(f"the radio's {name} is a chance from 0 to 1, not {getattr(self, name)}")
        for name in ("reach", "operator_reach", "delay", "jitter", "held_back"):
            if not getattr(self, name) >= 0.0:
                raise MisuseError(f"the radio's {name} must be 0 or more, not {getattr(self, name)}")


@dataclass(slots=True)
class RadioCounts:
    """Copies so far: meant for a receiver, put into an inbox, and what became of the others."""

    sent: int = 0
    delivered: int = 0
    out_of_reach: int = 0
    lost: int = 0
    duplicated: int = 0
    refused: int = 0


class Radio:
    """The air between the robots at `x`, `y` and their operator; see the module.

    x, y: metres, float64, shape (robots,); they are looked at whenever something is sent, never copied.
    clock: the swarm's; it alone says when anything happens.
    """

    def __init__(self, model: RadioModel, x: _Metres, y: _Metres, *, seed: int, clock: Clock) -> None:
        self.model = model
        self.counts = RadioCounts()
        self._x, self._y, self._seed, self._clock = x, y, seed, clock
        self._robots: _Numbers = np.arange(len(x), dtype=np.int64)
        self._waiting: list[_Copy] = []
        self._inboxes: dict[int, list[Message]] = {}
        self._repeats: Counter[tuple[int, str]] = Counter()
        self._repeats_at = -inf

    def endpoint(self, number: int) -> Endpoint:
        """The channel as party `number` has it."""
        return Endpoint(self, number)

    def send(self, transmitter: int, message: Message) -> None:
        """Put `message` on the air: a robot's answers and reports to the operator, all else to the robots in
        reach."""
        now = self._clock.now()
        meant, found = self._receivers(transmitter, message)
        self.counts.sent += len(meant)
        self.counts.out_of_reach += len(meant) - len(found)
        repeat = self._repeat(transmitter, message, now)
        chance = (self._seed, transmitter, message.id, message.kind.value, now, repeat)
        order = (transmitter, message.epoch, message.sequence, repeat)
        self._launch(message, found, now, chance, order, copy=0)
        if self.model.duplication:
            twice = self._drawn(found, (*chance, "twice")) < self.model.duplication
            self.counts.duplicated += int(np.count_nonzero(twice))
            self._launch(message, found[twice], now, chance, order, copy=1)

    def receive(self, number: int) -> list[Message]:
        """What party `number` has heard since it last asked, in the order of arrival."""
        self._deliver()
        return self._inboxes.pop(number, [])

    def receive_all(self) -> dict[int, list[Message]]:
        """What each robot has heard since it last asked; robots that heard nothing are not in it."""
        self._deliver()
        heard, self._inboxes = self._inboxes, {}
        if OPERATOR in heard:
            self._inboxes[OPERATOR] = heard.pop(OPERATOR)
        return heard

    def samples(self) -> _Numbers:
        """The robots from which a sample sent to the operator just now gets through."""
        near = self._near_operator()
        robots = self._robots if near is None else self._robots[near]
        if self.model.loss:
            robots = robots[self._drawn(robots, (self._seed, "sample", self._clock.now())) >= self.model.loss]
        return robots

    def _receivers(self, transmitter: int, message: Message) -> tuple[_Numbers, _Numbers]:
        """Who should hear this, and those of them who are in reach."""
        if transmitter == OPERATOR:
            near = self._near_operator()
            return self._robots, self._robots if near is None else self._robots[near]
        if message.kind in TO_OPERATOR:
            near = self._near_operator()
            operator = np.array([OPERATOR], np.int64)
            return operator, operator if near is None or near[transmitter] else operator[:0]
        others = self._robots[self._robots != transmitter]
        if self.model.reach == inf:
            return others, others
        near = self._within(float(self._x[transmitter]), float(self._y[transmitter]), self.model.reach)
        return others, others[near[others]]

    def _near_operator(self) -> NDArray[np.bool_] | None:
        """Whether each robot and the operator are in each other's reach; None if all are."""
        if self.model.operator is None or self.model.operator_reach == inf:
            return None
        return self._within(*self.model.operator, self.model.operator_reach)

    def _within(self, x: float, y: float, reach: float) -> NDArray[np.bool_]:
        across, up = self._x - x, self._y - y
        near: NDArray[np.bool_] = across * across + up * up <= reach * reach
        return near

    def _repeat(self, transmitter: int, message: Message, now: float) -> int:
        """How often this very message was sent before at this very time: a repeat has a fate of its own."""
        if now != self._repeats_at:
            self._repeats.clear()
            self._repeats_at = now
        said = self._repeats[transmitter, message.id]
        self._repeats[transmitter, message.id] = said + 1
        return said

    def _launch(
        self,
        message: Message,
        receivers: _Numbers,
        now: float,
        chance: tuple[object, ...],
        order: tuple[int, int, int, int],
        *,
        copy: int,
    ) -> None:
        """Send one copy of `message` to each of `receivers` on its way, unless it is lost."""
        model = self.model
        if model.loss:
            kept = receivers[self._drawn(receivers, (*chance, "lost", copy)) >= model.loss]
            self.counts.lost += len(receivers) - len(kept)
            receivers = kept
        due = np.full(len(receivers), now + model.delay)
        if model.jitter:
            due += model.jitter * self._drawn(receivers, (*chance, "jitter", copy))
        if model.reordering:
            held = self._drawn(receivers, (*chance, "held back", copy)) < model.reordering
            due[held] += model.held_back
        room = MAX_WAITING - len(self._waiting)
        self.counts.refused += max(0, len(receivers) - room)
        for receiver, when in zip(receivers[:room].tolist(), due[:room].tolist(), strict=True):
            self._waiting.append((when, *order, receiver, copy, message))

    def _drawn(self, receivers: _Numbers, what: tuple[object, ...]) -> NDArray[np.float64]:
        return uniform(key(*what), receivers.astype(np.uint64))

    def _deliver(self) -> None:
        """Move every copy whose time has come into its receiver's inbox, in order of time, then of
        sending."""
        if not self._waiting:
            return
        now = self._clock.now()
        due = [copy for copy in self._waiting if copy[0] <= now]
        if not due:
            return
        self._waiting = [copy for copy in self._waiting if copy[0] > now] if len(due) < len(self._waiting) else []
        due.sort()
        self.counts.delivered += len(due)
        for copy in due:
            self._inboxes.setdefault(copy[5], []).append(copy[7])


class Endpoint:
    """One party's `Channel` on the radio."""

    def __init__(self, radio: Radio, number: int) -> None:
        self._radio, self._number = radio, number

    def send(self, message: Message) -> None:
        self._radio.send(self._number, message)

    def receive(self) -> list[Message]:
        return self._radio.receive(self._number)
