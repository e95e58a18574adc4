"""The repl: from a pipe, and at a terminal as a person meets it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from cli.calling import called
from cli.terminal import terminal
from sleepcast.cli.prompt import shorten

EDITOR = pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are a thing of POSIX")


def test_lines_from_a_pipe_are_answered_one_by_one() -> None:
    done = called("repl", typed="(+ 1 2)\n(DEFVAR fuel\n  80%)\n; a comment\n\nfuel\n(/ 1 0)\n")
    assert done.out.splitlines() == ["3", "0.8", "0.8", "UNKNOWN"]
    warning, *_, fault = done.err.splitlines()
    assert warning == "warning: (/ 1 0) at 1:6 divides by zero, which is a fault"
    assert fault == "fault: division by zero in (/ 1 0)"
    assert done.status == 0


def test_a_text_that_ends_in_the_middle_is_told() -> None:
    done = called("repl", typed="(+ 1\n 2")
    assert done.out == "UNKNOWN\n"
    assert "not closed" in done.err


def test_a_parenthesis_that_is_never_closed_does_not_swallow_everything() -> None:
    done = called("repl", typed="(+ 1\n" + "2 3 4 5 6 7 8 9\n" * 2000 + "(+ 1 2)\n")
    assert "16384" in done.err
    assert done.out.splitlines()[0] == "UNKNOWN"
    assert done.out.splitlines()[-1] == "3"


@pytest.mark.parametrize("leave", [":quit", ":q", ":exit"])
def test_quit_leaves(leave: str) -> None:
    assert called("repl", typed=f"1\n{leave}\n2\n").out == "1\n"


def test_why_says_how_the_last_value_came_about() -> None:
    done = called("repl", typed="(DEFVAR fuel 40%)\n(AND (> fuel 50%) 7)\n:why\n")
    assert "not for this robot: fuel = 40 %, needed > 50 %" in done.out


def test_why_of_nothing_is_a_sentence() -> None:
    done = called("repl", typed=":why\n:why nobody\n1\n")
    assert done.out == "1\n"
    assert done.err.count("\n") == 2
    assert "Traceback" not in done.err


def test_rules_run_with_the_ticks() -> None:
    rule = '(RULE burn (PROGN (SETQ fuel (- fuel 1)) (REPORT "left" fuel)))'
    done = called("repl", typed=f"(DEFVAR fuel 10)\n{rule}\n:rules\n:tick 3\nfuel\n:why burn\n")
    assert f"burn  active  last unknown  fired 0  {rule[11:-1]}" in done.out
    assert done.out.splitlines()[3:8] == ["left: 9", "left: 8", "left: 7", "tick 3, 0.3 s", "7"]


@pytest.mark.parametrize("count", ["0", "10001", "x", "-1", "1.5", "9" * 40])
def test_a_tick_count_that_makes_no_sense_is_refused(count: str) -> None:
    done = called("repl", typed=f":tick {count}\n")
    assert done.err.startswith(":tick takes a number from 1 to 10000")
    assert done.out == ""


def test_vars_lists_what_there_is() -> None:
    done = called("repl", typed="(DEFVAR mine)\n(SETQ active5 1)\n(JOIN bravo)\n:vars\n")
    lines = done.out.splitlines()
    assert "mine      unknown" in lines
    assert "active5   1" in lines
    assert not any(line.startswith("active6") for line in lines)
    assert lines[-1] == "in bravo"


def test_help_on_everything_that_has_a_name() -> None:
    done = called(
        "repl", typed="(DEFVAR mine 1)\n:help\n:help dist\n:help (AND)\n:help id\n:help PI\n:help mine\n:help andd\n"
    )
    assert ":rules" in done.out
    assert "(DIST x1 y1 [z1] x2 y2 [z2])  Distance between two points.\n  (DIST 0 0 3 4) gives 5\n" in done.out
    assert "mine: user variable" in done.out
    assert done.err == 'nothing is known of "andd" (did you mean AND?)\n'


def test_a_question_misspelt() -> None:
    assert called("repl", typed=":rulse\n").err.startswith("unknown question :rulse (did you mean rules?)")


def test_bytes_that_are_no_text_end_it_with_a_sentence() -> None:
    done = called("repl", typed=b"(+ 1 2)\n\xff\xfe\n")
    assert done.out == "3\n"
    assert "is not UTF-8 text: byte 0xff" in done.err
    assert done.status == 2


# ---- at a terminal


@EDITOR
def test_a_conversation_at_a_terminal(tmp_path: Path) -> None:
    with terminal(["repl"], tmp_path) as screen:
        screen.wait_for(":help for help")
        screen.wait_for("sleep>")
        screen.type("(+ 1\r")
        screen.wait_for("...>")
        screen.type("2)\r")
        screen.wait_for("\n3\n")
        screen.wait_for("sleep>")
        screen.type("(DEFVAR ammunition 5)\r")
        screen.wait_for("\n5\n")
        screen.wait_for("sleep>")
        screen.type("(* 2 ammu")
        screen.wait_for("ammunition")  # the menu offers it
        screen.type("\t")
        screen.wait_for("nition")  # and Tab completes it
        screen.type(")\r")
        screen.wait_for("\n10\n")
        screen.wait_for("sleep>")
        screen.type("(SQRT 1 2)\r")
        assert "^^^^^^^^^^" in screen.wait_for("^^^^^^^^^^")
        screen.wait_for("sleep>")
        screen.type("(this is dropped\x03")
        screen.wait_for("sleep>")
        screen.type("(+ 40 2)\r")
        screen.wait_for("\n42\n")
        screen.wait_for("sleep>")
        screen.type("\x04")
        assert screen.status() == 0

    with terminal(["repl"], tmp_path) as screen:
        screen.wait_for("sleep>")
        screen.type("\x1b[A")
        screen.wait_for("(+ 40 2)")
        screen.type("\r")
        screen.wait_for("\n42\n")
        screen.wait_for("sleep>")
        screen.type(":quit\r")
        assert screen.status() == 0


@EDITOR
def test_tab_puts_in_the_only_name_that_fits(tmp_path: Path) -> None:
    """Its letters may be written otherwise than those that were typed."""
    with terminal(["repl"], tmp_path) as screen:
        screen.wait_for("sleep>")
        screen.type("(sqr\t 49)\r")
        screen.wait_for("\n7\n")
        screen.wait_for("sleep>")
        screen.type(":ti\t 3\r")
        screen.wait_for("tick 3")
        screen.wait_for("sleep>")
        screen.type(":quit\r")
        assert screen.status() == 0


@EDITOR
def test_a_home_that_cannot_be_written_costs_the_history_only(tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.write_text("a file where a folder should be")
    with terminal(["repl"], home) as screen:
        screen.wait_for("history of this conversation will not be kept")
        screen.wait_for("sleep>")
        screen.type("(+ 1 2)\r")
        screen.wait_for("\n3\n")
        screen.wait_for("sleep>")
        screen.type("\x04")
        assert screen.status() == 0


def test_a_long_history_loses_its_older_half_at_an_entry(tmp_path: Path) -> None:
    file = tmp_path / "history"
    file.write_text("".join(f"\n# entry {i}\n+(+ {i} 1)\n" for i in range(1000)))
    size = file.stat().st_size
    shorten(file, most=size)
    assert file.stat().st_size == size, "not too long yet"
    shorten(file, most=size - 1)
    kept = file.read_text()
    assert kept.startswith("\n# entry ")
    assert kept.endswith("+(+ 999 1)\n")
    assert 0.4 * size < len(kept) <= 0.5 * size
