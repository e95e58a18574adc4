"""Names by place and places by name, numbered ones included that are nowhere kept."""

from __future__ import annotations

import pytest

from sleepcast.channel.message_batch import NameIndex


def test_numbered_names_are_made_when_they_are_asked_for() -> None:
    names = NameIndex(prefix="scout", count=1_000_000)
    assert len(names) == 1_000_000
    assert (names[0], names[-1]) == ("scout1", "scout1000000")
    assert names[8:11] == ("scout9", "scout10", "scout11")
    assert (names.index_of("scout1"), names.index_of("scout1000000")) == (0, 999_999)


@pytest.mark.parametrize(
    "name", ["scout0", "scout01", "scout1000001", "scout", "scout-1", "scout1.0", "Scout1", "scout²", "x" * 99, ""]
)
def test_what_is_no_name_has_no_place(name: str) -> None:
    names = NameIndex(prefix="scout", count=1_000_000)
    assert names.index_of(name) is None
    assert name not in names


def test_names_that_are_added_come_after_the_numbered_ones_and_are_kept_once() -> None:
    names = NameIndex(["late", "scout2"], prefix="scout", count=3)
    assert list(names) == ["scout1", "scout2", "scout3", "late"]
    assert names.add("late") == 3
    assert names.add("later") == 4
    copied = names.copy()
    copied.add("latest")
    assert (len(names), len(copied)) == (5, 6)


def test_a_number_alone_is_a_name_as_well() -> None:
    names = NameIndex(prefix="", count=12)
    assert (names[11], names.index_of("12"), names.index_of("13")) == ("12", 11, None)


def test_there_is_nothing_beyond_the_last() -> None:
    with pytest.raises(IndexError):
        NameIndex(["a"])[1]
