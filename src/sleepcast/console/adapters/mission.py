"""Plays the mission of a simulated swarm.

Orders that shall go out at their times stand in the swarm's own `mission`, so that a snapshot has them. Those that are
due in a tick are sent before it begins, as by hand: they are on the air in the very tick in which a run without a page
sends them, and what is wrong with one is a sentence for a person. What a snapshot brings along goes on as it would have
without a page, to the last bit, so the swarm sends it itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import cast

from sleepcast.channel import Message
from sleepcast.console.features.mission import STOPPED
from sleepcast.console.marks import clock_time
from sleepcast.core.errors import MisuseError
from sleepcast.core.ticks import tick_at
from sleepcast.loop import Swarm
from sleepcast.loop.mission import MissionLog, is_same
from sleepcast.loop.swarm import give
from sleepcast.simulator import MissionError, Order
from sleepcast.station import Command, Station
from sleepcast.station.validation import DoubtError


class SwarmMission:
    """See the module; a `MissionPlayer`. log: what was sent, where somebody else keeps it, too."""

    def __init__(self, swarm: Swarm, station: Station, log: MissionLog | None = None) -> None:
        scenario = swarm.simulator.scenario
        self._swarm = swarm
        self._log = log or MissionLog(scenario.mission, swarm.commands, scenario.tick, swarm.given, station.operator)
        self._waiting: list[Order] = []
        """What is to be played when somebody has decided about the problem."""
        self.left_out: frozenset[int] = frozenset()
        self.problem, self._message, self.doubt = -1, "", False
        self.hold: Callable[[], None] = lambda: None
        self._brought = bool(swarm.mission)
        """Whether a snapshot was taken while the mission was played, and it goes on with that."""
        swarm.refused = self._refused
        swarm.senders.append(self.send_due)

    @property
    def orders(self) -> Sequence[Order]:
        return self._log.orders

    @property
    def playing(self) -> bool:
        """Whether there is more to send, at its time."""
        return bool(self._swarm.mission)

    def sent(self) -> Mapping[int, Message]:
        return self._log.sent()

    def take_over(self, sent: Mapping[int, Message]) -> None:
        """See `MissionLog`."""
        self._log.take_over(sent)

    @property
    def message(self) -> str:
        return STOPPED if self._swarm.halted else self._message

    # ---- what people do

    def play(self) -> str:
        if self.playing:
            return ""
        rest = [self.orders[number] for number in self._log.rest() if number not in self.left_out]
        if not rest:
            raise MisuseError("All commands of the mission were sent. Start the run again to play it once more.")
        if self._swarm.is_stopped_by_others(each.message for each in self._swarm.commands()):
            raise MisuseError("STOP holds. Release it, then play the mission.")
        self._go_on(rest)
        late = sum(order.time < self._swarm.now() for order in rest)
        return f"Of {late} command{'s' * (late > 1)} the time has passed: sent at once." if late else ""

    def _go_on(self, rest: Sequence[Order]) -> None:
        self._clear()
        self._brought = False
        self._swarm.mission.extend(rest)

    def halt(self, why: str) -> None:
        if self.playing or self._waiting:
            self._clear()
            self._swarm.mission.clear()
            self._message = why

    def _clear(self) -> None:
        self.problem, self._message, self.doubt, self._waiting = -1, "", False, []
        self._swarm.halted = False

    def send(self, number: int, *, confirmed: bool, again: bool) -> None:
        self._check(number)
        if number in self._log.sent() and not again:
            raise MisuseError(f"It was sent already, at {clock_time(self._log.sent()[number].issued)}.")
        try:
            self._send(self.orders[number], number, confirmed=confirmed)
        except MissionError as error:
            raise error.__cause__ or error from None
        self.left_out -= {number}
        self._drop(number)

    def skip(self, number: int) -> None:
        self._check(number)
        if number in self._log.sent():
            raise MisuseError(f"It was sent, at {clock_time(self._log.sent()[number].issued)}.")
        self.left_out |= {number}
        self._drop(number)

    def _check(self, number: int) -> None:
        if not 0 <= number < len(self.orders):
            raise MisuseError(f"The mission has no command number {number + 1}: it has {len(self.orders):,}.")

    def _drop(self, number: int) -> None:
        """An order is settled: it goes out no more by itself, and what waited for it goes on."""
        order = self.orders[number]
        mission = self._swarm.mission
        rest = _without(mission, order)
        mission.clear()
        mission.extend(rest)
        if number == self.problem:
            self._go_on(_without(self._waiting, order))
            self._swarm.heed_stops([each.message for each in self._swarm.commands()])

    # ---- before each tick

    def send_due(self) -> None:
        """Send what is due in the tick that begins now."""
        mission, scenario = self._swarm.mission, self._swarm.simulator.scenario
        self._swarm.heed_stops(self._swarm.posted.copy())
        following = self._swarm.simulator.tick + 1
        while mission and tick_at(mission[0].time, scenario.tick) <= following:
            index = self._index(mission[0])
            if self._brought and index is not None:
                return
            order = mission.pop(0)
            if index is None:
                continue  # somebody has sent it meanwhile
            try:
                self._send(order, index)
            except MissionError as error:
                self._wait_for_somebody(index, error, [order, *mission])
                return

    def _index(self, order: Order) -> int | None:
        """The first of its indices of which nobody has decided yet; None if there is none, -1 for an order of which the
        scenario knows nothing."""
        indices = [number for number, each in enumerate(self.orders) if is_same(each, order)]
        settled = self._log.sent().keys() | self._log.wordless() | self.left_out
        return next((number for number in indices if number not in settled), None if indices else -1)

    def _refused(self, order: Order, error: MissionError) -> None:
        """The swarm cannot send one that a snapshot brought along."""
        index = self._index(order)
        self._wait_for_somebody(-1 if index is None else index, error, [order, *self._swarm.mission])

    def _send(self, order: Order, number: int, *, confirmed: bool = False) -> None:
        """number: its index, -1 for one of which the scenario knows nothing."""
        ahead, desk = self._swarm.simulator.scenario.tick, self._swarm.desk_for(order)
        sent = cast("Command | None", give(desk, order, confirmed=confirmed, undecided=False, ahead=ahead))
        if sent is None:
            self.left_out |= {number}  # it has an effect, but nobody is told of it
            self._swarm.given.append((order, ""))
        elif number >= 0:
            self._log.note(number, sent.message)
        else:
            self._swarm.given.append((order, sent.id))

    def _wait_for_somebody(self, number: int, error: MissionError, rest: list[Order]) -> None:
        cause = error.__cause__
        self._swarm.mission.clear()
        self._waiting = rest
        self.problem, self.doubt = number, isinstance(cause, DoubtError)
        self._message = cause.shown if isinstance(cause, DoubtError) else str(cause or error)
        self.hold()


def _without(orders: Iterable[Order], order: Order) -> list[Order]:
    """All but the first that is the same."""
    rest = list(orders)
    at = next((number for number, each in enumerate(rest) if is_same(each, order)), len(rest))
    return rest[:at] + rest[at + 1 :]
