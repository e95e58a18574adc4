"""The table of requests: what the documentation says of it is so."""

from __future__ import annotations

import re
from math import isnan
from pathlib import Path

import pytest

from sleepcast.nomad.server.answers import HANDLERS
from sleepcast.nomad.server.simulated_robot import COMMANDS
from sleepcast.nomad.wire.encoding import CONNECTING
from sleepcast.nomad.wire.requests import SHAPES, AxisMode, RequestType, firing_order, misfit, moves
from sleepcast.robot import Axes

PAGE = Path(__file__).resolve().parents[3] / "docs" / "nomad-wire.md"


def test_the_documentation_names_every_request() -> None:
    rows = re.findall(r"^\| (\d+) \| `(\w+)` \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert [(int(number), name) for number, name in rows] == [(kind, kind.name.lower()) for kind in RequestType]


def test_every_request_has_a_size_and_does_something() -> None:
    assert set(SHAPES) == set(map(int, RequestType))
    assert {*COMMANDS, *HANDLERS, *CONNECTING} == set(SHAPES)


@pytest.mark.parametrize(
    ("words", "order"),
    [
        ((0, 2, 15), (0, 2, 15)),
        ((0, 1, 255, 3), (0, 1)),
        ((5, -1, 6), (5,)),
        ((255, 1, 2), ()),
        ((3, 3, 4, 3), (3, 4)),
        ((16, 1), ()),
    ],
)
def test_an_order_ends_at_the_first_that_is_no_sensor(words: tuple[int, ...], order: tuple[int, ...]) -> None:
    assert firing_order(words) == order


def test_sizes_are_told_in_words() -> None:
    assert misfit(RequestType.VM, 3) == misfit(RequestType.TK, 4096) == ""
    assert misfit(RequestType.ADD_OBSTACLE, 5) == "add_obstacle takes 7 to 21 words, not 5"
    assert misfit(14, 3) == "there is no request of type 14"


def test_what_mv_wants_in_one_mode() -> None:
    wanted = moves((1, 10, 2, 20, 1, 30), AxisMode.VELOCITY, Axes(1.0, 2.0, 3.0))
    assert (wanted.first, wanted.third) == (1.0, 3.0)
    assert isnan(wanted.second)
