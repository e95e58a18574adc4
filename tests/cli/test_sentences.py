"""`sleepcast check --sentence`: sentences and expressions, each in the other language."""

from __future__ import annotations

import json

import pytest

from sleepcast.cli import main

MISSION = "All scouts within 5 miles of X with more than 50 % fuel and 70 % ordnance are now in Task Element Bravo."


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    status = main(["check", "--sentence", *arguments])
    return status, capsys.readouterr().out


def test_a_sentence_is_printed_as_an_expression_and_back(capsys: pytest.CaptureFixture[str]) -> None:
    status, expression = run(capsys, "--scenario", "bravo", MISSION)
    assert status == 0
    assert expression == (
        "(WHEN (AND (< (DIST x y vessel_x vessel_y) 5mi) (> fuel 50%) (> ordnance 70%)) (JOIN Bravo))\n"
    )
    assert run(capsys, "--scenario", "bravo", expression) == (
        0,
        "scouts within 5 mi of vessel X with more than 50 % fuel and 70 % ordnance join Bravo\n",
    )


def test_what_is_not_understood_has_carets_and_a_status(capsys: pytest.CaptureFixture[str]) -> None:
    text = "scouts with more than 50 % fule stop"
    status, out = run(capsys, "--scenario", "bravo", text)
    assert status == 2
    assert out.splitlines() == [
        'not understood: "fule" is no variable that these robots know (did you mean fuel?)',
        f"  {text}",
        " " * (2 + text.index("fule")) + "^^^^",
    ]


def test_an_expression_that_no_sentence_says_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    status, out = run(capsys, "--scenario", "bravo", "(WHEN (> (+ fuel 1) 1) (ST))")
    assert (status, out.splitlines()[0]) == (2, "not understood: no sentence says this")
    status, out = run(capsys, "--scenario", "bravo", "(WHEN (")
    assert (status, "not closed" in out) == (2, True)


def test_json_holds_both(capsys: pytest.CaptureFixture[str]) -> None:
    status, out = run(capsys, "--json", "--scenario", "bravo", "all scouts stop", "all scouts fly")
    assert status == 2
    assert json.loads(out)["sentences"] == [
        {"text": "all scouts stop", "translation": "(ST)", "unclear": []},
        {
            "text": "all scouts fly",
            "translation": "",
            "unclear": [{"start": 11, "end": 14, "message": '"fly" is nothing that these robots are known to do'}],
        },
    ]


def test_words_need_a_scenario(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "--sentence", "all robots stop"]) == 2
    assert "--scenario NAME" in capsys.readouterr().err
