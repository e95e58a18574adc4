"""Which standing commands still count, by their texts; and that robots end alike whatever they had before."""

from __future__ import annotations

import pytest

from sleepcast.channel import Kind, Message
from sleepcast.channel.message import FOR, KEYS, ONLY
from sleepcast.station.baselines import propose


def message(number: int, text: str, **body: object) -> Message:
    return Message("desk", 1, number, Kind.COMMAND, float(number), float("inf"), text, True, body)


def kept(*texts: str) -> list[str]:
    messages = {number: message(number, text) for number, text in enumerate(texts, start=1)}
    return [texts[number - 1] for number in propose(dict(messages)).kept]


@pytest.mark.parametrize(
    ("texts", "wanted"),
    [
        (["(RULE a 1)", "(RULE a 2)", "(RULE a 3)"], [1, 3]),
        (["(RULE a 1)", "(RULE b 1)", "(RULE A 2)", "(RULE b 2)", "(RULE a 3)"], [1, 2, 4, 5]),
        (["(RULE a 1)", "(RULE a 2)", "(FORGET a)"], [3]),
        (["(RULE a 1)", "(FORGET a)", "(RULE a 2)", "(RULE a 3)", "(RULE a 4)"], [2, 3, 5]),
        (["(RULE a 1)", "(DEACTIVATE a)", "(ACTIVATE a)", "(DEACTIVATE a)"], [1, 4]),
        (["(RULE a 1)", "(DEACTIVATE a)", "(RULE a 2)"], [1, 3]),
        (["(SETQQ e5 1)", "(SETQQ expr5 2)", "(ACTIVATE e5)", "(SETQ E5 '3)"], [1, 2, 3, 4]),
        (["(SETQQ e5 1)", "(SETQQ expr5 2)", "(SETQ E5 '3)"], [1, 3]),
        (["(DEFUN f () 1)", "(DEFUN f () 2)", "(DEFUN f () 3)"], [1, 3]),
        (["(JOIN x)", "(LEAVE x)", "(JOIN x)", "(LEAVE x)"], [1, 4]),
        (["(PROGN (RULE a 1) (RULE b 1))", "(RULE a 2)", "(RULE b 2)", "(RULE a 3)"], [1, 3, 4]),
    ],
)
def test_what_a_later_command_wholly_replaces_is_dropped(texts: list[str], wanted: list[int]) -> None:
    assert kept(*texts) == [texts[number - 1] for number in wanted]


@pytest.mark.parametrize(
    "texts",
    [
        ["(RULE a 1)", "(WHEN (> x 1) (RULE a 2))", "(RULE a 3)"],
        ["(DEFUN f () 1)", "(SETQ v (f))", "(DEFUN f () 2)"],
        ["(DEFUN g () (RULE a 1))", "(DEFUN f () (g))", "(f)", "(DEFUN g () 2)", "(RULE a 2)", "(RULE a 3)"],
        ["(RULE a 1)", "(DEFUN a () 1)", "(RULE a 2)"],
        ["(RULE a 1)", "(RULE a 2)", "(ROLLBACK)", "(RULE a 3)"],
        ["(LEASE a 3s)", "(LEASE a 4s)"],
        ["(SETQ x 1)", "(SETQ x 2)"],
        ["(MARK)", "(", "3"],
    ],
)
def test_in_doubt_a_command_is_kept(texts: list[str]) -> None:
    assert kept(*texts) == texts


def test_what_is_for_some_robots_or_changes_keys_or_is_not_stored_is_kept() -> None:
    there = {number: message(number, f"(RULE a {number})") for number in range(1, 4)}
    assert propose({**there, 2: message(2, "(RULE a 2)", **{FOR: ["r1"]})}).kept == [1, 2, 3]
    assert propose({**there, 2: message(2, "", **{KEYS: {}})}).kept == [1, 2, 3]
    assert propose({**there, 2: None}).kept == [1, 2, 3]
    assert propose({**there, 2: message(2, "1", **{ONLY: [1]})}).kept == [1, 3]
