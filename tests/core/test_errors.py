"""Sentences about files have one place."""

from __future__ import annotations

import pytest

from sleepcast.core.errors import in_file, listed, nearest


@pytest.mark.parametrize(
    ("place", "sentence", "shown"),
    [
        ("a.sleep:4", 'unknown name "fule" at 3:12\n  x\n  ^', 'a.sleep:6: unknown name "fule"\n  x\n  ^'),
        ("a.sleep:4", 'the "(" at 1:1 is not closed', 'a.sleep:4: the "(" is not closed'),
        ("a.sleep:4", "no such group", "a.sleep:4: no such group"),
        ("the answer", "1 22 at 1:3", "the answer: 1 22 at 1:3"),
        ("C:x.sleep:2", "(f at 9:9) takes 1 argument at 1:2", "C:x.sleep:2: (f at 9:9) takes 1 argument"),
    ],
)
def test_a_sentence_about_a_file_has_one_line_count(place: str, sentence: str, shown: str) -> None:
    assert in_file(place, sentence) == shown


@pytest.mark.parametrize(
    ("name", "found"), [("SEED", "seed"), ("Seed", "seed"), ("SEDE", "SEED"), ("sede", "seed"), ("x", None)]
)
def test_the_nearest_name_is_another_one(name: str, found: str | None) -> None:
    assert nearest(name, ["seed", "tick"]) == found


@pytest.mark.parametrize(
    ("names", "total", "shown"),
    [
        ([], None, ""),
        (["r1", "r2"], None, "r1, r2"),
        ([1, 2, 3], None, "1, 2 and 1 more"),
        (["r1"], 1, "r1"),
        (["r1"], 3, "r1 and 2 more"),
        (["r1", "r2"], 2_002, "r1, r2 and 2,000 more"),
    ],
)
def test_a_long_list_says_how_many_it_leaves_out(names: list[object], total: int | None, shown: str) -> None:
    assert listed(names, 2, total) == shown
