"""The session of 1998: every line of the transcript has the value that the documentation's table gives."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from sleepcast.language.classic import ClassicMachine, run_transcript

ROOT = Path(__file__).resolve().parents[2]
SESSION = (ROOT / "examples" / "session.classic").read_text(encoding="utf-8")
UNEXPLAINED = "(COND ((AND 1 0) 99) ((AND 1 1) 88))"
"""The thesis's own evaluator gives 0 for it; 88 is right."""


def table() -> list[tuple[str, int]]:
    """Expressions and values of the table on the page of the classic dialect, in order; without those that end in an
    error, after which a transcript cannot go on."""
    page = (ROOT / "docs" / "classic.md").read_text(encoding="utf-8")
    part = page.partition("## What the thesis reports")[2].partition("```classic")[0]
    found = []
    for row in part.splitlines():
        cells = row.split("|")
        values = re.findall(r"-?\d+", cells[2]) if len(cells) > 2 else []
        texts = re.findall(r"`([^`]+)`", cells[1]) if values else []
        found += list(zip(texts, map(int, values), strict=True))
    return found


@pytest.mark.parametrize("dialect", ["classic", "faithful"])
def test_the_session_gives_what_the_table_says(dialect: str) -> None:
    wanted = [(text, 0 if (text, dialect) == (UNEXPLAINED, "faithful") else value) for text, value in table()]
    entries = run_transcript(SESSION, ClassicMachine(dialect, say=lambda _: None))
    typed = [text.strip() for text in SESSION.split("$")[0].split("@")[:-1]]
    assert [(text, entry.value) for text, entry in zip(typed, entries, strict=True)] == wanted


def test_the_command_runs_it() -> None:
    command = [sys.executable, "-m", "sleepcast", "eval", "--dialect", "faithful", "-"]
    ran = subprocess.run(command, input=SESSION, capture_output=True, text=True, timeout=60, check=True)
    assert ran.stdout.split() == [str(0 if text == UNEXPLAINED else value) for text, value in table()]
