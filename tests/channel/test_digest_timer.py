"""How soon a party sends its digest: the sooner the better, unless so many do that nobody hears the first in time."""

from __future__ import annotations

from random import Random

import pytest
from benchmarks.channel.crowds import digests
from benchmarks.channel.repairs import Network

from sleepcast.channel.sequencer import CROWD, LATEST, SOONEST, SOONEST_SLOW, DigestTimer


def interval(timer: DigestTimer, now: float, alike: int) -> float:
    """Let an interval pass in which so many equal digests come; returns when it is over, s."""
    for _ in range(alike):
        timer.agree()
    while not (ends := timer.due()) > now + 10 * LATEST:
        before = timer._ends
        timer.is_due(ends)
        if timer._ends != before:
            return ends
    raise AssertionError("it never ends")


@pytest.mark.parametrize("network", [Network(0.3), Network(0.3072, beacons=True)], ids=str)
def test_on_a_slow_network_few_of_forty_send_a_digest_after_a_command(network: Network) -> None:
    assert sum(digests(40, network, 4)[1:]) < 3 * 30, "it was twice as many"


def test_on_a_fast_network_digests_come_as_soon_as_ever() -> None:
    assert max(digests(40, Network(0.001), 3)) <= 12


def test_many_equal_digests_make_the_shortest_interval_longer_and_few_make_it_shorter_again() -> None:
    timer, now = DigestTimer(Random(1)), 0.0
    timer.restart(now)
    now = interval(timer, now, CROWD)
    assert timer.soonest == SOONEST
    now = interval(timer, now, 100)
    assert SOONEST < timer.soonest <= SOONEST_SLOW
    timer.restart(now)
    slow = timer.soonest
    for _ in range(9):
        now = interval(timer, now, 10**6)
    assert timer.soonest == SOONEST_SLOW >= slow, "no flood of them makes it longer than a slow network needs"
    for _ in range(40):
        now = interval(timer, now, 2)
    assert timer.soonest == SOONEST
