"""Mission scripts: times and expressions in order, and mistakes told with their file and line."""

from __future__ import annotations

from pathlib import Path

import pytest

from sleepcast.simulator import MissionError, parse_mission, read_mission
from sleepcast.simulator.scenario.mission import MAX_ORDERS, Order, Wanted, instruction, written_mission


def test_orders_with_times_and_comments() -> None:
    orders = parse_mission("; first\n\n@12.5s (ST)\n@2min (GOTO 1 2) ; there\n", "m.sleep")
    assert [(order.time, order.place) for order in orders] == [(12.5, "m.sleep:3"), (120.0, "m.sleep:4")]
    assert orders[0].text == "(ST)"


def test_an_order_goes_on_over_lines_that_begin_with_a_blank() -> None:
    orders = parse_mission("@1s\n    (WHEN (IN a)\n      ; slowly\n      (ST))\n@1s (ST)", "m.sleep")
    assert [order.text for order in orders] == ["(WHEN (IN a)\n  (ST))", "(ST)"]


def test_an_order_with_several_times_is_sent_at_each() -> None:
    orders = parse_mission('@0s,2s,.5min (ST)\n@1s (TK "a")\n@1s,3s\n  (WANDER)', "m.sleep")
    sent = [(0.0, "(ST)"), (1.0, '(TK "a")'), (1.0, "(WANDER)"), (2.0, "(ST)"), (3.0, "(WANDER)"), (30.0, "(ST)")]
    assert [(order.time, order.text) for order in orders] == sent


def test_nothing_is_a_mission() -> None:
    assert parse_mission("; nothing\n", "m.sleep") == ()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("(ST)", "m.sleep:1: wanted an order such as @12.5s (ST)"),
        ("  (ST)", "m.sleep:1: wanted an order"),
        ("@12 (ST)", "m.sleep:1: wanted a time with its unit, such as @12.5s or @2min, not @12"),
        ("@12m (ST)", "m.sleep:1: wanted a time with its unit"),
        ("@soon (ST)", "not @soon"),
        ("@-1s (ST)", "not @-1s"),
        ("\n@5s (ST)\n@4s (ST)", "m.sleep:3: 4 s comes before the order above it (5 s)"),
        ("@1s,1s (ST)", "m.sleep:1: 1 s does not come after 1 s"),
        ("@1s, 2s (ST)", "wanted a time with its unit, such as @12.5s or @2min, not @1s,"),
        ("@1s,2 (ST)", "not @1s,2"),
        ("@9s (ST)\n@1s,10s (ST)", "1 s comes before the order above it (9 s)"),
        ("@1s,2s (ST)\n" * (MAX_ORDERS // 2 + 1), f"more than {MAX_ORDERS} orders"),
        ("@5s\n@6s (ST)", "m.sleep:1: a time without an expression"),
        ("@5s ; later", "m.sleep:1: a time without an expression"),
        ("@" + "9" * 400 + "h (ST)", "is too far away"),
        ("@1s (ST)\n" * (MAX_ORDERS + 1), f"more than {MAX_ORDERS} orders"),
    ],
    ids=lambda value: value[:12],
)
def test_a_mistake_is_told_with_its_line(text: str, said: str) -> None:
    with pytest.raises(MissionError) as caught:
        parse_mission(text, "m.sleep")
    assert said in str(caught.value)


def test_a_file_is_read(tmp_path: Path) -> None:
    file = tmp_path / "a.sleep"
    file.write_text("@1s (ST)\n")
    assert read_mission(file)[0].place == f"{file}:1"


@pytest.mark.parametrize(("raw", "said"), [(b"@1s \n\xff", ":2: not UTF-8"), (b";" * 1_048_577, "too long")])
def test_a_file_that_is_no_script(tmp_path: Path, raw: bytes, said: str) -> None:
    file = tmp_path / "a.sleep"
    file.write_bytes(raw)
    with pytest.raises(MissionError, match=said):
        read_mission(file)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(MissionError, match="cannot be read"):
        read_mission(tmp_path / "a.sleep")


WORDS = """@1s STOP ; now
= matched at least 3, not matched 0
@2s standing
    (RULE a
      (ST))
@3s ask only a1,b2 fuel
@3s once within 3s but a1 STOP
@4s RELEASE
"""


def test_words_before_an_expression_say_how_it_is_sent() -> None:
    orders = parse_mission(WORDS, "m.sleep")
    assert [instruction(order)[:2] for order in orders] == [
        *(("STOP", ""), ("standing", "(RULE a\n  (ST))"), ("ask", "fuel"), ("once", "STOP"), ("RELEASE", "")),
    ]
    assert orders[0].wanted == (Wanted("matched", 3, "at least"), Wanted("not matched", 0))
    assert instruction(orders[2]).only == ("a1", "b2")
    assert (instruction(orders[3]).within, instruction(orders[3]).but) == (3.0, ("a1",))
    again = parse_mission(written_mission(orders), "m.sleep")
    assert [(each.time, each.text, each.wanted) for each in again] == [(o.time, o.text, o.wanted) for o in orders]
    for order in orders:
        assert instruction(Order(0.0, instruction(order).written(), "")) == instruction(order)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("= matched 1", "wanted an order before"),
        ("@1s,2s (ST)\n= matched 1", "write it once for each"),
        ("@1s (ST)\n= obeyed 1", "m.sleep:2: wanted counts such as = matched 98"),
        ("@1s (ST)\n= matched", "not 'matched'"),
        ("@1s ask ; nothing", "wanted an expression after ask"),
        ("@1s within 5kg (ST)", "wanted a time with its unit"),
    ],
)
def test_words_that_are_none(text: str, said: str) -> None:
    with pytest.raises(MissionError, match=said):
        parse_mission(text, "m.sleep")
