"""Turns: a transmitter sends one message after the other, the rest waits, and what finds no room is dropped."""

from __future__ import annotations

import numpy as np
import pytest

from channel.test_radio import inboxes, radio
from channel_contract import message
from sleepcast.channel import Kind
from sleepcast.channel.message_batch import Answers, MessageBatch
from sleepcast.channel.name_index import NameIndex
from sleepcast.channel.simulated_radio import OPERATOR, Radio, RadioModel
from sleepcast.channel.transmit_queue import TransmitQueue
from sleepcast.core.clock import ManualClock
from sleepcast.core.errors import MisuseError

ONE = np.array([0])


def heard(on_air: Radio, robot: int = 0) -> list[int]:
    """The sequence numbers of what this robot has heard."""
    return [each.sequence for each in inboxes(on_air).get(robot, [])]


class TestTransmitters:
    def test_each_message_takes_its_time(self) -> None:
        turns = TransmitQueue(2, 4.0, 10)
        assert [turns.take(ONE, 1.0)[0].item() for _ in range(3)] == [1.0, 1.25, 1.5]
        assert turns.take(np.array([1]), 1.0)[0].item() == 1.0  # another transmitter
        assert turns.take(ONE, 1.6)[0].item() == 1.75
        assert turns.take(ONE, 9.0)[0].item() == 9.0

    def test_as_many_wait_as_there_is_room_for(self) -> None:
        turns = TransmitQueue(1, 10.0, 3)
        assert [turns.take(ONE, 0.0)[1].item() for _ in range(6)] == [True] * 4 + [False] * 2
        assert [turns.take(ONE, 0.1)[1].item() for _ in range(2)] == [True, False]

    def test_without_a_queue_only_a_free_transmitter_sends(self) -> None:
        turns = TransmitQueue(1, 10.0, 0)
        assert [turns.take(ONE, now)[1].item() for now in (0.0, 0.05, 0.1, 0.15)] == [True, False, True, False]

    def test_what_is_urgent_goes_before_all_that_waits_and_takes_its_time(self) -> None:
        turns = TransmitQueue(1, 10.0, 2)
        for _ in range(5):
            turns.take(ONE, 0.0)
        begin, room = turns.take(ONE, 0.0, urgent=True)
        assert (begin.item(), room.item()) == (0.0, True)
        assert turns.free.item() == pytest.approx(0.4)


class TestOnTheRadio:
    def test_broadcasts_go_out_one_after_the_other(self) -> None:
        on_air, clock = radio(RadioModel(rate=2.0, delay=0.05), robots=3)
        for sequence in range(1, 4):
            on_air.send(OPERATOR, message(sequence=sequence))
        found = []
        for _ in range(12):
            clock.advance(0.1)
            found.append(heard(on_air))
        assert [tick for tick, some in enumerate(found, 1) if some] == [1, 6, 11]
        assert on_air.counts.sent == on_air.counts.delivered == 9  # three robots, three messages

    def test_what_finds_the_queue_full_is_dropped_and_counted(self) -> None:
        on_air, clock = radio(RadioModel(rate=1.0, queue=2), robots=2)
        for sequence in range(1, 6):
            on_air.send(OPERATOR, message(sequence=sequence))
        clock.advance(10.0)
        assert heard(on_air) == [1, 2, 3]
        assert (on_air.counts.crowded, on_air.counts.sent) == (2, 6)

    def test_a_stop_does_not_wait(self) -> None:
        on_air, clock = radio(RadioModel(rate=1.0, queue=1), robots=2)
        for sequence in range(1, 5):
            on_air.send(OPERATOR, message(sequence=sequence))
        on_air.send(OPERATOR, message(sequence=9, kind=Kind.STOP))
        assert 9 in heard(on_air)
        clock.advance(10.0)

    def test_robots_do_not_take_each_others_turns(self) -> None:
        on_air, _ = radio(RadioModel(rate=1.0, queue=0), robots=3)
        for robot in range(3):
            on_air.send(robot, message(sender=f"r{robot}"))
            on_air.send(robot, message(sender=f"r{robot}", sequence=2))
        assert {robot: len(found) for robot, found in inboxes(on_air).items()} == {0: 2, 1: 2, 2: 2}
        assert on_air.counts.crowded == 3

    @pytest.mark.parametrize(("rate", "queue"), [(0.0, 1), (-1.0, 1), (float("nan"), 1), (1.0, -1)])
    def test_what_cannot_be_is_refused(self, rate: float, queue: int) -> None:
        with pytest.raises(MisuseError, match="rate must be above 0 and its queue 0 or more"):
            RadioModel(rate=rate, queue=queue)

    def test_without_a_rate_nothing_waits(self) -> None:
        assert Radio(RadioModel(), np.zeros(2), np.zeros(2), seed=1, clock=ManualClock()).turns is None


def chorus(names: NameIndex, robots: list[int], sequence: int) -> MessageBatch:
    """The same answer of these robots."""
    count = len(robots)
    return MessageBatch(
        Kind.ANSWER,
        names,
        1,
        np.array(robots),
        np.arange(count),
        np.full(count, sequence, np.int32),
        np.zeros(count),
        5.0,
        Answers.alike("desk:1:1", count, "matched"),
    )


def test_many_robots_at_once_take_the_turns_that_each_would_take() -> None:
    model = RadioModel(rate=2.0, queue=1, operator=(0.0, 0.0), operator_reach=25.0)
    names = NameIndex(prefix="r", count=6)
    said = [[0, 2, 5], [0, 1, 2], [0, 2, 3], [0, 4]]
    together, first_clock = radio(model, robots=6)
    alone, second_clock = radio(model, robots=6)
    for sequence, robots in enumerate(said, 1):
        together.send_all(chorus(names, robots, sequence))
        for robot, each in zip(robots, chorus(names, robots, sequence).messages(), strict=True):
            alone.send(robot, each)
    heard: list[list[tuple[str, int]]] = [[], []]
    for _ in range(5):
        for place, (on_air, clock) in enumerate(((together, first_clock), (alone, second_clock))):
            found = sorted((each.sender, each.sequence) for each in on_air.receive(OPERATOR))
            heard[place] += [(f"{name} at {clock.now():g}", sequence) for name, sequence in found]
            clock.advance(0.3)
    assert heard[0] == heard[1]
    assert together.counts == alone.counts
    assert together.counts.crowded == 3  # two of robot 0 and one of robot 2
    assert [name for name, _ in heard[0]] == ["r1 at 0", "r2 at 0", "r3 at 0", "r1 at 0.6", "r3 at 0.6"]
