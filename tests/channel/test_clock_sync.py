"""Clocks that differ: heartbeats show by how much, and deadlines are kept by the clock of whoever set them."""

from __future__ import annotations

from random import Random

import pytest

from channel.air import DESK, ROBOTS
from sleepcast.channel import Kind
from sleepcast.channel.admission import Admission
from sleepcast.channel.clock_sync import ENOUGH, FRESH, MAX_OFFSETS, ClockOffsets
from sleepcast.channel.drops import DropReason
from sleepcast.channel.keys import Trust
from sleepcast.channel.reliable import ReliableDelivery
from sleepcast.channel.session import ChannelSession
from sleepcast.channel.transports.memory import MemoryTransport
from sleepcast.core.clock import ManualClock

BOUND = 2.0


class Shifted:
    """A clock that is ahead of another one by `by` s."""

    def __init__(self, clock: ManualClock, by: float) -> None:
        self._clock, self._by = clock, by

    def now(self) -> float:
        return self._clock.now() + self._by


class Pair:
    """A desk, and a robot whose clock is ahead of the desk's; each message takes `way` s."""

    def __init__(self, ahead: float, way: float = 0.02, skew: float = BOUND) -> None:
        self.clock = ManualClock(1_000.0)
        uri = f"memory:skew-{ahead}-{way}?delay={way}"
        trust = Trust((DESK.public, ROBOTS.public))
        admission = Admission(trust, "lab", self.clock, robot=False)
        self.desk = ChannelSession(
            MemoryTransport(uri, self.clock),
            ReliableDelivery("desk", 1, DESK, admission, Random(1)),
            self.clock,
            Random(2),
        )
        clock = Shifted(self.clock, ahead)
        self.admission = Admission(trust, "lab", clock, robot=True, skew=skew)
        self.robot = ChannelSession(
            MemoryTransport(uri, self.clock),
            ReliableDelivery("r1", 1, ROBOTS, self.admission, Random(3)),
            clock,
            Random(4),
        )
        self.now = clock.now

    def beat(self, times: int) -> None:
        for _ in range(times):
            self.desk.delivery.post(Kind.HEARTBEAT, self.clock.now())
            self.run(0.3)

    def run(self, seconds: float) -> list[float]:
        """Let time pass; gives by how much each command's deadline lies ahead when it is heard."""
        until, found = self.clock.now() + seconds, []
        while self.clock.now() < until:
            self.clock.advance(0.005)
            self.desk.pump()
            heard = [message for message in self.robot.receive() if message.kind is Kind.COMMAND and not message.ahead]
            found += [message.deadline - self.now() for message in heard]
        return found

    def __enter__(self) -> Pair:
        return self

    def __exit__(self, *_: object) -> None:
        self.desk.close()
        self.robot.close()


@pytest.mark.parametrize("ahead", [-1.5, -0.2, 0.0, 0.2, 1.5])
def test_a_deadline_is_kept_by_the_clock_of_whoever_set_it(ahead: float) -> None:
    with Pair(ahead) as pair:
        pair.desk.delivery.post(Kind.COMMAND, pair.clock.now(), text="(before)", deadline=pair.clock.now() + 1.0)
        assert pair.run(0.3) == [pytest.approx(1.0 - 0.02 - ahead, abs=0.01)], "as if all clocks were right"
        pair.beat(ENOUGH)
        pair.desk.delivery.post(Kind.COMMAND, pair.clock.now(), text="(after)", deadline=pair.clock.now() + 1.0)
        (left,) = pair.run(0.3)
        assert left == pytest.approx(1.0, abs=0.03)
        assert pair.admission.offsets.all(pair.now()) == (
            {} if ahead == 0.0 else {"desk": pytest.approx(ahead, abs=0.03)}
        )


def test_beyond_the_bound_nothing_is_heard_and_the_bound_is_a_setting() -> None:
    for skew, counts in ((BOUND, {DropReason.LATE: 1, DropReason.REPEATED: 4}), (10.0, {})):
        with Pair(8.0, skew=skew) as pair:
            pair.desk.delivery.post(Kind.COMMAND, pair.clock.now(), text="(ST)")
            assert bool(pair.run(0.5)) is not bool(counts)
            assert pair.admission.counts == counts
    with Pair(-2.5) as pair:
        pair.beat(ENOUGH)
        assert pair.admission.counts == {DropReason.EARLY: ENOUGH}
        assert not pair.admission.offsets.all(pair.now())


def test_the_shortest_way_counts_and_delays_move_nothing_beyond_the_bound() -> None:
    offsets = ClockOffsets(BOUND)
    for way in (0.9, 0.07, 0.4, 0.6):
        offsets.note("desk", 100.0, 101.0 + way)
    assert offsets.of("desk", 103.0) == pytest.approx(1.07)
    assert offsets.of("desk", 103.0 + FRESH) == 0.0
    for _ in range(20):
        offsets.note("desk", 100.0, 120.0)
    assert offsets.of("desk", 120.0) == BOUND
    for number in range(MAX_OFFSETS):
        offsets.note(f"other{number}", 1.0, 2.0)
    assert offsets.of("desk", 120.0) == 0.0
    assert offsets.of("other0", 2.0) == 0.0, "one heartbeat tells nothing"
