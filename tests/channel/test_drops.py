"""What was dropped: counted by reason and key, within bounds, and told in sentences."""

from __future__ import annotations

import pytest

from sleepcast.channel.drops import AGAIN, MAX_STRANGERS, DropCounter, DropReason, NoticeLog
from sleepcast.channel.keys import KeyPair, Trust
from sleepcast.channel.message import Role
from sleepcast.core.clock import ManualClock

DESK = KeyPair("desk", Role.OPERATOR, b"d" * 32)
STRANGER = KeyPair("stranger", Role.OPERATOR, b"s" * 32)
TRUST = Trust((DESK.public,))
SHORT, STRANGE = DESK.id.hex()[:4], STRANGER.id.hex()[:4]


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock(1_000.0)


@pytest.fixture
def drops(clock: ManualClock) -> DropCounter:
    return DropCounter(clock)


def flood(
    drops: DropCounter, clock: ManualClock, reason: DropReason, key: bytes, rate: int, seconds: float = 2.0
) -> None:
    """So many a second, for so long."""
    for _ in range(round(seconds / 0.01)):
        drops.add(reason, key, rate // 100)
        clock.advance(0.01)


def told(drops: DropCounter) -> list[str]:
    return [notice.text for notice in drops.notices(TRUST)]


def test_drops_are_counted_by_reason_and_by_key(drops: DropCounter) -> None:
    drops.add(DropReason.FORGED, DESK.id)
    drops.add(DropReason.FORGED, DESK.id, 4)
    drops.add(DropReason.MALFORMED)
    assert drops.counts == {DropReason.FORGED: 5, DropReason.MALFORMED: 1}
    assert drops.by_key == {(DESK.id, DropReason.FORGED): 5, (b"", DropReason.MALFORMED): 1}


@pytest.mark.parametrize(
    ("reason", "key", "sentence"),
    [
        (DropReason.FORGED, DESK, f"somebody sends 9,000 forged messages a second under key {SHORT} (desk)"),
        (
            DropReason.TOO_MANY,
            DESK,
            f"9,000 messages a second under key {SHORT} (desk) are more than can be checked, and are dropped",
        ),
        (DropReason.UNKNOWN_KEY, STRANGER, f"9,000 messages a second come under key {STRANGE}, not trusted here"),
        (DropReason.REVOKED, DESK, f"9,000 messages a second come under key {SHORT} (desk), which is revoked"),
        (
            DropReason.NOT_ALLOWED,
            DESK,
            f"9,000 messages a second come under key {SHORT} (desk), whose role may not send them",
        ),
        (DropReason.OTHER_FLEET, DESK, f"9,000 messages a second under key {SHORT} (desk) are for another fleet"),
        (
            DropReason.REPEATED,
            DESK,
            f"somebody sends 9,000 messages a second of key {SHORT} (desk) again that were heard before",
        ),
    ],
)
def test_a_flood_is_told_in_one_sentence(
    drops: DropCounter, clock: ManualClock, reason: DropReason, key: KeyPair, sentence: str
) -> None:
    flood(drops, clock, reason, key.id, 9_000)
    assert told(drops) == [sentence]


def test_what_was_not_checked_beside_forgeries_is_taken_for_forged(drops: DropCounter, clock: ManualClock) -> None:
    for _ in range(200):
        drops.add(DropReason.FORGED, DESK.id, 20)
        drops.add(DropReason.TOO_MANY, DESK.id, 780)
        clock.advance(0.01)
    assert told(drops) == [f"somebody sends 80,000 forged messages a second under key {SHORT} (desk)"]


def test_one_forgery_is_told_and_what_every_air_has_is_not(drops: DropCounter, clock: ManualClock) -> None:
    drops.add(DropReason.REPEATED, DESK.id, 100)
    drops.add(DropReason.NOT_FOR_US, count=100_000)
    assert told(drops) == []
    drops.add(DropReason.FORGED, DESK.id)
    assert "forged" in told(drops)[0]


def test_what_is_over_is_told_no_more_though_it_stays_counted(drops: DropCounter, clock: ManualClock) -> None:
    flood(drops, clock, DropReason.FORGED, DESK.id, 9_000)
    clock.advance(3.0)
    assert told(drops)  # the last seconds had something
    clock.advance(3.0)
    assert told(drops) == []
    assert drops.counts[DropReason.FORGED] == 18_000


def test_invented_keys_fill_no_memory_and_hide_no_known_one(drops: DropCounter, clock: ManualClock) -> None:
    for number in range(100_000):
        drops.add(DropReason.UNKNOWN_KEY, number.to_bytes(8))
    assert len(drops.by_key) == MAX_STRANGERS + 1
    drops.add(DropReason.FORGED, DESK.id, 200_000)
    sentences = told(drops)
    assert f"key {SHORT} (desk)" in sentences[0]
    assert "under many keys, not trusted here" in sentences[1]
    assert sum(drops.by_key.values()) == drops.counts.total() == 300_000


def test_a_clock_that_is_set_back_or_ahead_does_no_harm(drops: DropCounter, clock: ManualClock) -> None:
    flood(drops, clock, DropReason.FORGED, DESK.id, 9_000)
    clock._now -= 3_600.0
    flood(drops, clock, DropReason.FORGED, DESK.id, 9_000)
    assert "9,000 forged" in told(drops)[0]
    clock.advance(7_200.0)
    drops.add(DropReason.FORGED, DESK.id)
    assert told(drops)


def test_lines_that_stay_tell_a_thing_once_a_minute_and_when_it_is_worse(
    drops: DropCounter, clock: ManualClock
) -> None:
    news = NoticeLog(drops, TRUST, clock)
    lines = []
    for _ in range(round(3.5 * AGAIN)):
        flood(drops, clock, DropReason.FORGED, DESK.id, 900, 1.0)
        lines += news.lines()
    assert len(lines) == 4
    flood(drops, clock, DropReason.FORGED, DESK.id, 90_000, 2.0)
    (worse,) = news.lines()
    assert "90,000 forged" in worse
    assert news.lines() == []
