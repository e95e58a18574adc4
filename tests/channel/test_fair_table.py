"""A table in which nobody can take the room of others."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from sleepcast.channel.fair_table import FairTable


def test_the_entry_used_longest_ago_gives_way() -> None:
    table = FairTable[int, str, str](3)
    for key in range(3):
        table.put("anna", key, "x")
    table.use(0)
    table.put("anna", 3, "x")
    assert sorted(table) == [0, 2, 3]
    table.put("anna", 2, "y")
    table.put("anna", 4, "x")
    assert (sorted(table), table.get(2), table.get(0)) == ([2, 3, 4], "y", None)


def test_whoever_makes_many_entries_loses_their_own() -> None:
    lost: list[tuple[str, int]] = []
    table = FairTable[int, str, str](8, lost=lambda owner, key: lost.append((owner, key)))
    for key in range(4):
        table.put("anna", key, "hers")
    for key in range(100, 200):
        table.put("mallory", key, "his")
    assert [key for key, value in table.items() if value == "hers"] == [0, 1, 2, 3]
    assert [owner for owner, _ in lost] == ["mallory"] * 96


def test_of_owners_with_one_entry_each_the_one_silent_longest_loses_it() -> None:
    table = FairTable[str, int, str](3)
    for name in "abcd":
        table.put(name, name, 0)
    assert sorted(table) == ["b", "c", "d"]


def test_what_lasts_gives_way_to_nothing_that_does_not() -> None:
    """Whoever can only make brief entries takes no room of lasting ones, however many these are."""
    table = FairTable[int, bool, str](8, lasting=bool)
    for key in range(7):
        table.put("anna", key, True)
    for key in range(100, 120):
        table.put("mallory", key, False)
    assert [key for key, lasts in table.items() if lasts] == list(range(7))
    assert list(table)[7:] == [119]


def test_an_owner_may_have_a_bound_of_their_own() -> None:
    table = FairTable[int, int, str](100, each=2)
    for key in range(5):
        table.put("anna", key, key)
    table.put("bert", 9, 9)
    assert sorted(table) == [3, 4, 9]


def test_an_entry_may_pass_to_another_owner() -> None:
    table = FairTable[int, int, str](2)
    table.put("anna", 1, 1)
    table.put("bert", 1, 2)
    table.put("anna", 2, 2)
    table.put("anna", 3, 3)
    assert sorted(table) == [1, 3]
    assert (table.pop(1), table.pop(1), len(table)) == (2, None, 1)
    table.clear()
    assert not len(table)


@given(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 30), st.booleans()), max_size=200), st.booleans())
def test_nobody_loses_an_entry_while_others_have_more(puts: list[tuple[int, int, bool]], lasting: bool) -> None:
    table = FairTable[tuple[int, int], bool, int](16, lasting=bool if lasting else None)
    for owner, number, lasts in puts:
        before = set(table)
        table.put(owner, (owner, number), lasts)
        gone = before - set(table)
        assert len(table) <= 16
        assert len(gone) <= 1
        assert table.get((owner, number)) is lasts
        for loser, _ in gone:
            counts = [sum(of == each for of, _ in before | {(owner, number)}) for each in range(5)]
            assert lasting or counts[loser] == max(counts)
