"""Numbers that programs give: every integer type is its number, and nothing else is one."""

from __future__ import annotations

import numpy as np
import pytest

from sleepcast.core.errors import MisuseError
from sleepcast.core.given_numbers import MAX_SEED, in_seconds, read_seconds, read_seed


@pytest.mark.parametrize("seed", [7, np.uint64(7), np.int8(7), np.array(7)])
def test_every_integer_type_is_its_number(seed: object) -> None:
    found = read_seed(seed)
    assert (found, type(found)) == (7, int)


@pytest.mark.parametrize(
    "seed", [-1, MAX_SEED + 1, np.uint64(2**63), 7.0, np.float64(7), "7", True, np.True_, np.array([7]), None, [7]]
)
def test_nothing_else_is_a_seed(seed: object) -> None:
    with pytest.raises(MisuseError, match=r"seed .+: wanted a whole number from 0 to 9223372036854775807"):
        read_seed(seed)


def test_seconds_are_numbers() -> None:
    assert [read_seconds(each, "for") for each in (0, 2, np.float32(0.5), np.int64(3))] == [0.0, 2.0, 0.5, 3.0]
    for wrong in ("5", b"5", True, -1.0, float("nan"), float("inf"), 10**400, None, [5]):
        with pytest.raises(MisuseError, match=r"for .+: wanted a number of seconds, 0 or more"):
            read_seconds(wrong, "for")
    for more in (61, "2min"):
        with pytest.raises(MisuseError, match="from 0 to 60"):
            read_seconds(more, "for", 60.0)


def test_times_may_be_texts_with_their_units() -> None:
    for text, seconds in (("30s", 30.0), ("2min", 120.0), (" 1 H ", 3600.0), ("250ms", 0.25)):
        assert read_seconds(text, "for") == in_seconds(text, "for") == seconds
    assert in_seconds(2.5, "for") == 2.5
    for wrong, why in (
        ("soon", "wanted a time such as"),
        ("5m", "a length"),
        ("-5s", "at least 0s"),
        ("5", "its unit"),
    ):
        with pytest.raises(MisuseError, match=f"^for '{wrong}': .*{why}"):
            in_seconds(wrong, "for")
