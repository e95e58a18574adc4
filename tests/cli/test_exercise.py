"""`sleepcast check-exercise`: tasks, and whether an answer does what was asked."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sleepcast.cli import main


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    status = main(["check-exercise", *arguments])
    return status, capsys.readouterr().out


def test_it_lists_the_exercises_and_shows_a_task(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys)[1].startswith(" 1  mark    Mark who can help\n 2  team")
    _, shown = run(capsys, "mark")
    assert "more than half of its fuel" in shown
    assert "in the end: share marked > 0" in shown
    assert "Hint" not in shown
    assert "(WHEN test ...)" in run(capsys, "mark", "--hint")[1]
    assert [each["name"] for each in json.loads(run(capsys, "--json")[1])][:2] == ["mark", "team"]


def test_an_answer_passes_or_does_not_yet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "mark", "(WHEN (> fuel 50%) (MARK))", "--quiet") == (0, "mark: passed\n")
    file = tmp_path / "answer.sleep"
    file.write_text("(WHEN (> fuel 40%) (MARK))")
    status, shown = run(capsys, "mark", str(file), "--hint")
    assert status == 1
    assert shown.startswith(
        "mark: not yet\n  in 3 of 3 runs: wanted share (AND marked (< fuel 49.9%)) <= 0, but it was"
    )
    assert "\nhint: A message is heard by all." in shown
    found = json.loads(run(capsys, "mark", str(file), "--json")[1])
    assert not found["passed"]
    assert [len(each["missed"]) for each in found["runs"]] == [1, 1, 1]


@pytest.mark.parametrize("arguments", [("mork",), ("mark", "(MARK"), ("mark", "none.sleep"), ("mark", "")])
def test_misuse_exits_2(arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, *arguments)[0] == 2
