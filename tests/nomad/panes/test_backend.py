"""The Nomads' page without a browser: what a page lacks, which orders there are, and a hand that leaves the keys."""

from __future__ import annotations

import json
import struct
from collections import deque
from pathlib import Path

import pytest

from sleepcast.core.clock import ManualClock
from sleepcast.core.errors import MisuseError
from sleepcast.nomad import Nserver, ServerPace, Windows
from sleepcast.nomad.panes.adapter import NomadsAdapter
from sleepcast.nomad.panes.backend import NomadsBackend
from sleepcast.nomad.panes.dialogue import NomadDialogue
from sleepcast.nomad.panes.orders import END_OF_ORDER, ORDERS, check
from sleepcast.nomad.panes.windows import Added, Tail
from sleepcast.nomad.wire.requests import SHAPES, RequestType
from sleepcast.nomad.world.building import nomad_world

HELLO = Path(__file__).parent / "hello.json"
"""The first words to the page of a robot in an empty room, byte for byte."""


def opened() -> tuple[Nserver, NomadDialogue]:
    """A server of one robot in an empty room, where nobody listens, and a page of it."""
    clock, world = ManualClock(), nomad_world()
    nserver = Nserver(world, windows=Windows(1))
    nomads = NomadsAdapter(nserver, ServerPace(clock, 1.0), "a room", world.area)
    return nserver, NomadDialogue(NomadsBackend(nomads, clock))


def test_the_first_words_to_a_page_stay_as_they_are() -> None:
    """Its modules read them, and so do programs that watch a server. Who changes them changes the file as well."""
    _, dialogue = opened()
    assert dialogue.hello() == HELLO.read_text("utf-8").rstrip("\n")


def test_a_page_begins_with_how_everything_is_now() -> None:
    """And not with what a page saw last that was closed some time ago."""
    nserver, before = opened()
    before.leave()
    nserver.step()
    NomadDialogue(before._desk)
    (time,) = struct.unpack_from("<d", before.source.frame, 16)
    assert time == nserver.world.time > 0.0


def test_a_page_that_looks_at_a_robot_once_more_is_told_of_it_from_the_beginning() -> None:
    """Whoever says that it looks at a robot has forgotten what it was sent of it, be it the same one or another."""
    nserver, dialogue = opened()
    for _ in range(50):
        nserver.step()
    (whole,) = dialogue.with_frame()
    dialogue.watch(0)
    (again,) = dialogue.with_frame()
    rows = [json.loads(each)["chosen"]["near"] for each in (whole, again)]
    assert len(rows[0][1]) > 1
    assert rows[0] == rows[1]


class TestTail:
    def test_only_what_is_new_is_told(self) -> None:
        row, tail = deque([(0.0, 0.0), (1.0, 0.0)], maxlen=4), Tail[tuple[float, float]]()
        assert tail.take(row) == Added(True, [(0.0, 0.0), (1.0, 0.0)])
        assert tail.take(row) == Added(False, [])
        row.append((float("1"), 0.0))  # the same place once more is another entry
        row.append((3.0, 0.0))
        assert tail.take(row) == Added(False, [(1.0, 0.0), (3.0, 0.0)])

    def test_what_was_erased_is_begun_anew(self) -> None:
        row, tail = deque([(0.0, 0.0)]), Tail[tuple[float, float]]()
        tail.take(row)
        row.clear()
        assert tail.take(row) == Added(True, [])
        assert tail.take(row) == Added(False, [])
        row.append((5.0, 0.0))
        assert tail.take(row).items == [(5.0, 0.0)]

    def test_a_page_that_missed_too_much_gets_what_there_still_is(self) -> None:
        row, tail = deque([(0.0, 0.0)], maxlen=2), Tail[tuple[float, float]]()
        tail.take(row)
        row.extend([(1.0, 0.0), (2.0, 0.0), (3.0, 0.0)])
        assert tail.take(row) == Added(True, [(2.0, 0.0), (3.0, 0.0)])


class TestOrders:
    @pytest.mark.parametrize("name", [name for name, order in ORDERS.items() if not order.text])
    def test_each_is_a_request_of_the_wire_with_as_many_words(self, name: str) -> None:
        order, shape = ORDERS[name], SHAPES[RequestType[name.upper()]]
        if order.beside:
            corners = [1, 2] * 3
            assert len(check(name, [3, *corners, *range(order.beside - 1)])) == shape.least
            assert order.at_most == shape.most
        else:
            least = [0 if field.least <= 0 else field.least for field in order.fields]
            assert shape.least <= len(check(name, least)) <= shape.most

    def test_what_is_left_out_at_the_end_is_as_usual(self) -> None:
        assert check("vm", [50, -50]) == [50, -50, 0]
        assert check("draw_line", [0, 0, 10, 10]) == [0, 0, 10, 10, 1]
        assert check("conf_sn", [15, 0, 2]) == [15, 0, 2, *[END_OF_ORDER] * 14]
        assert check("conf_sn", [15, -1]) == [15, -1, *[END_OF_ORDER] * 15]

    def test_axes_are_called_as_the_body_has_them(self) -> None:
        with pytest.raises(MisuseError, match=r"vm takes way steering \[turret\]"):
            check("vm", [1], steers=True)

    @pytest.mark.parametrize(
        ("name", "numbers", "sentence"),
        [
            ("quit_server", [], "there is no order 'quit_server'"),
            ("vm", [1], r"vm takes right left \[third\]; this has 1 number$"),
            ("vm", [1, 2, 3, 4], "this has 4 numbers"),
            ("st", [1], "st takes no numbers; this has 1 number$"),
            ("conf_sn", [1] * 18, r"conf_sn takes \[rate\] \.\.\."),
            ("conf_tm", [256], "conf_tm: s must lie from 0 to 255, not be 256"),
            ("add_obstacle", [4, 0, 0, 1, 0, 1, 1], "4 corners make 9 numbers, not 7"),
            ("mv", [7, 1, 0, 0, 0, 0], "right mode must lie from 0 to 5"),
        ],
    )
    def test_what_cannot_be_is_refused_in_words(self, name: str, numbers: list[int], sentence: str) -> None:
        with pytest.raises(MisuseError, match=sentence):
            check(name, numbers)
