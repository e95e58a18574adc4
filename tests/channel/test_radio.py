"""The radio of a simulated swarm: it keeps the channel's promises, and its faults come from the seed alone."""

from __future__ import annotations

from collections import Counter
from math import inf

import numpy as np
import pytest

from channel_contract import Air, ChannelContract, message
from sleepcast.channel import Kind, Message
from sleepcast.channel.message_batch import AnswerColumns, MessageBatch, NameIndex
from sleepcast.channel.simulated_radio import OPERATOR, Radio, RadioModel, TransmitQueue
from sleepcast.core.clock import ManualClock
from sleepcast.core.counter_rng import key, mix, uniform
from sleepcast.core.errors import MisuseError


def radio(model: RadioModel | None = None, robots: int = 1000, seed: int = 7) -> tuple[Radio, ManualClock]:
    """A radio among robots 10 m apart on a line that begins at the origin."""
    clock = ManualClock()
    x = np.arange(robots) * 10.0
    return Radio(model or RadioModel(), x, np.zeros(robots), seed=seed, clock=clock), clock


@pytest.fixture(params=[RadioModel(), RadioModel(delay=0.3)], ids=["instant", "delayed"])
def air(request: pytest.FixtureRequest) -> Air:
    on_air, clock = radio(request.param, robots=3)
    return Air(on_air.endpoint(OPERATOR), [on_air.endpoint(i) for i in range(3)], lambda: clock.advance(1.0))


class TestMemory(ChannelContract):
    pass


def inboxes(on_air: Radio) -> dict[int, list[Message]]:
    """What each robot hears that hears anything."""
    found: dict[int, list[Message]] = {}
    for heard, robots in on_air.receive_all():
        assert (np.diff(robots) > 0).all()
        for robot in robots.tolist():
            found.setdefault(robot, []).append(heard)
    return found


def heard_by(on_air: Radio) -> set[int]:
    return set(inboxes(on_air))


class TestReach:
    def test_robots_tell_as_far_as_they_reach(self) -> None:
        on_air, _ = radio(RadioModel(reach=20.0))
        on_air.send(5, message(sender="r5"))
        assert heard_by(on_air) == {3, 4, 6, 7}
        assert on_air.counts.out_of_reach == 995

    def test_positions_are_those_of_the_moment(self) -> None:
        clock = ManualClock()
        x = np.array([0.0, 100.0])
        on_air = Radio(RadioModel(reach=20.0), x, np.zeros(2), seed=0, clock=clock)
        on_air.send(0, message(sequence=1))
        x[1] = 20.0
        on_air.send(0, message(sequence=2))
        assert [heard.sequence for heard in on_air.receive(1)] == [2]

    def test_an_operator_with_a_place_reaches_and_hears_only_so_far(self) -> None:
        on_air, _ = radio(RadioModel(operator=(0.0, 0.0), operator_reach=25.0), robots=5)
        on_air.send(OPERATOR, message())
        assert heard_by(on_air) == {0, 1, 2}
        for number in range(5):
            on_air.send(number, message(Kind.ANSWER, sender=f"r{number}"))
        assert [heard.sender for heard in on_air.receive(OPERATOR)] == ["r0", "r1", "r2"]
        assert on_air.samples().tolist() == [0, 1, 2]

    def test_an_operator_without_a_place_reaches_everybody(self) -> None:
        on_air, _ = radio(RadioModel(reach=1.0))
        on_air.send(OPERATOR, message())
        assert len(heard_by(on_air)) == 1000


class TestTime:
    def test_delay(self) -> None:
        on_air, clock = radio(RadioModel(delay=0.5))
        on_air.send(OPERATOR, message())
        clock.advance(0.4)
        assert inboxes(on_air) == {}
        clock.advance(0.1)
        assert len(inboxes(on_air)) == 1000

    def test_jitter_spreads_arrivals_evenly(self) -> None:
        on_air, clock = radio(RadioModel(delay=1.0, jitter=1.0))
        on_air.send(OPERATOR, message())
        arrived = []
        for _ in range(20):
            clock.advance(0.1)
            arrived.append(len(inboxes(on_air)))
        assert sum(arrived[:9]) == 0
        assert all(60 < count < 140 for count in arrived[10:20])
        assert sum(arrived) == 1000

    def test_reordering_holds_some_back(self) -> None:
        on_air, clock = radio(RadioModel(reordering=0.3, held_back=2.0))
        on_air.send(OPERATOR, message(sequence=1))
        clock.advance(1.0)
        on_air.send(OPERATOR, message(sequence=2))
        clock.advance(5.0)
        orders = Counter(tuple(m.sequence for m in heard) for heard in inboxes(on_air).values())
        assert set(orders) == {(1, 2), (2, 1)}
        assert 150 < orders[2, 1] < 270  # 0.3 * 0.7 of 1,000

    def test_what_comes_together_stays_in_the_order_of_sending(self) -> None:
        on_air, clock = radio(RadioModel(jitter=0.5), robots=5)
        for sequence in range(20):
            on_air.send(OPERATOR, message(sequence=sequence))
            clock.advance(1.0)
        for heard in inboxes(on_air).values():
            assert [m.sequence for m in heard] == list(range(20))


class TestLossAndDuplication:
    def test_loss_takes_its_share_down_and_up(self) -> None:
        on_air, _ = radio(RadioModel(loss=0.3))
        on_air.send(OPERATOR, message())
        assert 650 < len(heard_by(on_air)) < 750
        for number in range(1000):
            on_air.send(number, message(Kind.ANSWER, sender=f"r{number}"))
        assert 650 < len(on_air.receive(OPERATOR)) < 750
        assert 650 < len(on_air.samples()) < 750
        assert on_air.counts.sent == 2000
        assert on_air.counts.lost == 2000 - on_air.counts.delivered

    def test_everything_can_be_lost(self) -> None:
        on_air, _ = radio(RadioModel(loss=1.0))
        on_air.send(OPERATOR, message())
        assert heard_by(on_air) == set()
        assert on_air.samples().size == 0

    def test_duplicates_are_the_same_message(self) -> None:
        on_air, _ = radio(RadioModel(duplication=0.25))
        on_air.send(OPERATOR, message())
        lengths = Counter(len(heard) for heard in inboxes(on_air).values())
        assert 200 < lengths[2] < 300
        assert lengths[1] + lengths[2] == 1000
        assert on_air.counts.duplicated == lengths[2]

    def test_a_repeat_has_a_fate_of_its_own(self) -> None:
        on_air, _ = radio(RadioModel(loss=0.5))
        for _ in range(10):
            on_air.send(OPERATOR, message())
        assert len(heard_by(on_air)) > 990


class TestChance:
    def bad(self, seed: int = 7) -> tuple[Radio, ManualClock]:
        return radio(RadioModel(loss=0.3, jitter=0.5, duplication=0.2, reordering=0.2), robots=50, seed=seed)

    def test_the_order_of_calls_changes_nothing(self) -> None:
        outcomes = []
        for order in (range(50), reversed(range(50))):
            on_air, clock = self.bad()
            for number in order:
                on_air.send(number, message(sender=f"r{number}"))
            clock.advance(10.0)
            outcomes.append(inboxes(on_air))
        assert outcomes[0] == outcomes[1]

    def test_what_else_is_on_the_air_changes_nothing(self) -> None:
        outcomes = []
        for other in (False, True):
            on_air, clock = self.bad()
            if other:
                on_air.send(OPERATOR, message(sender="other"))
            on_air.send(OPERATOR, message())
            clock.advance(10.0)
            heard = inboxes(on_air)
            outcomes.append({i: [m for m in heard.get(i, []) if m.sender == "desk"] for i in range(50)})
        assert outcomes[0] == outcomes[1]

    def test_another_seed_makes_another_run(self) -> None:
        outcomes = []
        for seed in (7, 8):
            on_air, clock = self.bad(seed)
            on_air.send(OPERATOR, message())
            clock.advance(10.0)
            outcomes.append(inboxes(on_air))
        assert outcomes[0] != outcomes[1]

    def test_draws_are_even_and_independent_of_their_neighbours(self) -> None:
        drawn = uniform(key("test"), np.arange(100_000, dtype=np.uint64))
        assert drawn.min() >= 0.0
        assert drawn.max() < 1.0
        counts, _ = np.histogram(drawn, bins=20, range=(0, 1))
        assert np.abs(counts - 5_000).max() < 5 * np.sqrt(5_000)
        assert abs(np.corrcoef(drawn[:-1], drawn[1:])[0, 1]) < 0.02

    def test_the_hash_is_splitmix64(self) -> None:
        # The generator's first outputs for seed 0 are mix(1 * golden), mix(2 * golden), ...: its published values.
        golden = np.uint64(0x9E37_79B9_7F4A_7C15)
        first = mix(np.arange(1, 4, dtype=np.uint64) * golden)
        assert [hex(int(each)) for each in first] == ["0xe220a8397b1dcdaf", "0x6e789e6aa1b965f4", "0x6c45d188009454f"]


class TestBounds:
    def test_more_than_fits_is_refused_and_counted(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("sleepcast.channel.simulated_radio.MAX_WAITING", 1500)
        on_air, clock = radio(RadioModel(delay=1.0))
        for sequence in range(3):
            on_air.send(OPERATOR, message(sequence=sequence))
        clock.advance(1.0)
        assert sum(len(heard) for heard in inboxes(on_air).values()) == 1500
        assert on_air.counts.refused == 1500

    @pytest.mark.parametrize("wrong", [{"loss": -0.1}, {"loss": 1.1}, {"delay": -1.0}, {"reach": float("nan")}])
    def test_an_impossible_radio_is_refused(self, wrong: dict[str, float]) -> None:
        name = next(iter(wrong))
        with pytest.raises(MisuseError, match=name):
            RadioModel(**wrong)  # type: ignore[arg-type]

    def test_infinite_reach_is_possible(self) -> None:
        assert RadioModel(reach=inf).reach == inf


def test_the_operator_keeps_its_messages_while_robots_collect_theirs() -> None:
    on_air, _ = radio(robots=3)
    answer = Message("r1", 0, 1, Kind.ANSWER, 0.0)
    on_air.send(1, answer)
    assert inboxes(on_air) == {}
    assert on_air.receive(OPERATOR) == [answer]


# ---- transmit queues: a transmitter sends one message after another, the rest waits, and what finds no room is dropped

ONE = np.array([0])


def heard(on_air: Radio, robot: int = 0) -> list[int]:
    """The sequence numbers of what this robot has heard."""
    return [each.sequence for each in inboxes(on_air).get(robot, [])]


class TestTransmitters:
    def test_each_message_takes_its_time(self) -> None:
        queue = TransmitQueue(2, 4.0, 10)
        assert [queue.take(ONE, 1.0)[0].item() for _ in range(3)] == [1.0, 1.25, 1.5]
        assert queue.take(np.array([1]), 1.0)[0].item() == 1.0  # another transmitter
        assert queue.take(ONE, 1.6)[0].item() == 1.75
        assert queue.take(ONE, 9.0)[0].item() == 9.0

    def test_as_many_wait_as_there_is_room_for(self) -> None:
        queue = TransmitQueue(1, 10.0, 3)
        assert [queue.take(ONE, 0.0)[1].item() for _ in range(6)] == [True] * 4 + [False] * 2
        assert [queue.take(ONE, 0.1)[1].item() for _ in range(2)] == [True, False]

    def test_without_a_queue_only_a_free_transmitter_sends(self) -> None:
        queue = TransmitQueue(1, 10.0, 0)
        assert [queue.take(ONE, now)[1].item() for now in (0.0, 0.05, 0.1, 0.15)] == [True, False, True, False]

    def test_what_is_urgent_goes_before_all_that_waits_and_takes_its_time(self) -> None:
        queue = TransmitQueue(1, 10.0, 2)
        for _ in range(5):
            queue.take(ONE, 0.0)
        begin, room = queue.take(ONE, 0.0, urgent=True)
        assert (begin.item(), room.item()) == (0.0, True)
        assert queue.free.item() == pytest.approx(0.4)


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
        assert Radio(RadioModel(), np.zeros(2), np.zeros(2), seed=1, clock=ManualClock()).transmit_queue is None


def batch(names: NameIndex, robots: list[int], sequence: int) -> MessageBatch:
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
        AnswerColumns.alike("desk:1:1", count, "matched"),
    )


def test_many_robots_at_once_take_the_turns_that_each_would_take() -> None:
    model = RadioModel(rate=2.0, queue=1, operator=(0.0, 0.0), operator_reach=25.0)
    names = NameIndex(prefix="r", count=6)
    said = [[0, 2, 5], [0, 1, 2], [0, 2, 3], [0, 4]]
    together, first_clock = radio(model, robots=6)
    alone, second_clock = radio(model, robots=6)
    for sequence, robots in enumerate(said, 1):
        together.send_all(batch(names, robots, sequence))
        for robot, each in zip(robots, batch(names, robots, sequence).messages(), strict=True):
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
