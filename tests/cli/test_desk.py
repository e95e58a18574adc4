"""`sleepcast desk` in a terminal: what a person at it sees, types, and can rely on."""

from __future__ import annotations

import json
import os
import re
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from cli.calling import called
from cli.terminal import Terminal, terminal
from cli.test_swarm import at_rest, channel, swarm

__all__ = ["channel"]

ENTER, TAB, ESCAPE, PAGE_DOWN = "\r", "\t", "\x1b", "\x1b[6~"
F1, F3, F7, F9 = "\x1bOP", "\x1bOR", "\x1b[18~", "\x1b[20~"
CTRL_C, CTRL_D, CTRL_Q, CTRL_X = "\x03", "\x04", "\x11", "\x18"


@pytest.fixture
def desk(channel: str, tmp_path: Path) -> Iterator[Terminal]:
    """A desk of 80 by 24, at which three robots are seen."""
    with (
        swarm(3, channel, *at_rest(tmp_path)),
        terminal(("desk", "--channel", channel, "--look", "0.5"), tmp_path, size=(80, 24)) as found,
    ):
        found.wait_to_see("Robots 3: S 0, L 0", "o  r1", "o  r3")
        yield found


def test_a_command_is_foreseen_sent_and_accounted_for(desk: Terminal) -> None:
    desk.type("(WHEN (> id 1")
    desk.wait_to_see("would obey: yes 2, no 1, unknown 0 (2 parentheses are open)")
    desk.type(") (JOIN bravo))")
    desk.wait_to_see("would obey: yes 2, no 1, unknown 0")
    desk.type(ENTER)
    desk.wait_to_see("matched 2, did not match 1, fault 0, silent 0")
    listed = re.compile(r"o  r1 +N +\S+ +│.*o  r2 +M +\S+ +bravo .*o  r3 +M +\S+ +bravo ", re.DOTALL)
    lines = desk.wait_until(listed.search, "who is in bravo")
    assert all(len(line) <= 80 for line in lines)
    desk.type(TAB + TAB)
    desk.wait_to_see("bravo> ")
    desk.type(F3 + F3 + F3)
    desk.wait_to_see("bravo ASK> ")
    desk.type("id" + ENTER)
    desk.wait_to_see("min 2, mean 2.5, max 3")
    desk.type(F3 + ":to r1" + ENTER)
    desk.wait_to_see("r1> ")
    desk.type("(SETQ marked 1)" + ENTER)
    desk.wait_to_see("matched 1, did not match 0")
    desk.type(":show id marked" + ENTER)
    values = re.compile(r"L 0; id, marked *│.*r1 +M +\S+ +1  1 .*r2 +\S+ +2  0  br.*r3 +\S+ +3  0  br", re.DOTALL)
    desk.wait_until(values.search, "what robots have for id and marked")
    desk.type(":why r1" + ENTER)
    desk.wait_to_see("Esc closes this page", "(SETQ marked 1)")
    desk.type(ENTER)
    desk.wait_to_see("Commands")
    desk.type(CTRL_Q)
    assert desk.status() == 0


def test_stop_is_one_key_and_its_account_is_true(desk: Terminal, channel: str, tmp_path: Path) -> None:
    with swarm(1, channel, "--first", "9", *at_rest(tmp_path)) as ninth:
        desk.wait_to_see("o  r9")
        os.kill(ninth.pid, signal.SIGKILL)
        ninth.wait()
    desk.type("(WHEN (> id 1) (VM 1 1")  # what is half typed is in nobody's way
    desk.wait_to_see("parenthes")
    desk.type(F9)
    lines = desk.wait_to_see("stopped 3, silent 1 of 4 robots heard so far: r9", "S  r1", "S  r3")
    assert lines[1].startswith(" STOP ")
    desk.type(CTRL_C + CTRL_Q)
    desk.wait_to_see("STOP is still sent to 1 robot: leave once more to give up")
    desk.type(F7)
    desk.wait_to_see("press it once more to release every robot")
    assert "S  r1" in str(desk.picture)
    desk.press_until(F7, "released 3, silent 1", "o  r1", "o  r3")
    desk.type(CTRL_X)
    desk.wait_to_see("stopped 3, silent 1", "S  r1")
    desk.type(CTRL_Q + CTRL_Q)
    assert desk.status() == 0
    assert "STOP holds: stopped 3, silent 1 of 4 robots heard so far: r9" in desk.screen
    events = [json.loads(line) for line in called("journal", "export").out.splitlines()]
    kinds = [event["details"]["kind"] for event in events if event["event"] == "sent"]
    assert kinds == ["stop", "release", "stop"]
    assert called("journal", "verify").status == 0


@pytest.fixture
def alone(channel: str, tmp_path: Path) -> Iterator[Terminal]:
    """A desk of 80 by 24 that hears nobody."""
    with terminal(("desk", "--channel", channel), tmp_path, size=(80, 24)) as found:
        found.wait_to_see("no robot heard yet")
        yield found


def test_what_is_wrong_is_shown_where_it_is(alone: Terminal) -> None:
    desk = alone
    desk.type("(VM 1 1) x")
    lines = desk.wait_to_see("one more expression at 1:10")
    (typed,) = [number for number, line in enumerate(lines) if line.startswith("sleep> (VM 1 1) x")]
    assert lines[typed + 1] == " " * len("sleep> (VM 1 1) ") + "^"
    desk.type("\b\b" + ENTER)
    desk.wait_to_see("every robot that hears it would obey", "press Shift-Tab and then Enter", "sleep> (VM 1 1)")
    desk.type(CTRL_C)
    desk.wait_to_see("no command sent yet")
    desk.type(":fly" + ENTER)
    desk.wait_to_see("unknown :fly")
    desk.type(CTRL_C + F1)
    lines = desk.wait_to_see("F9 or Ctrl-X  STOP every robot")
    assert not any("…" in line for line in lines[2:-1]), "the help fits"
    desk.type(PAGE_DOWN)
    desk.wait_to_see("- silent")
    desk.type(ESCAPE)
    desk.wait_to_see("Commands")
    desk.type(CTRL_C)
    assert desk.status() == 130
    assert "Traceback" not in desk.screen


@pytest.mark.parametrize(("size", "status"), [((40, 10), 0), ((200, 60), 130)])
def test_it_fits_every_terminal_and_ends_in_good_order(
    channel: str, tmp_path: Path, size: tuple[int, int], status: int
) -> None:
    with terminal(("desk", "--channel", channel, "--look", "0"), tmp_path, size=size) as desk:
        lines = desk.wait_to_see("STOP: F9 or Ctrl-X", "sleep> ", "F9 STOP")
        assert lines[-1].startswith(" F9 STOP")
        if status:
            desk.process.send_signal(signal.SIGTERM)
        else:
            desk.type(CTRL_D)
        assert desk.status() == status
        assert "Traceback" not in desk.screen


def test_a_terminal_that_cannot_show_it_gets_a_sentence(channel: str, tmp_path: Path) -> None:
    with terminal(("desk", "--channel", channel), tmp_path, {"TERM": "dumb"}) as desk:
        assert desk.status() == 2
        assert "this terminal (TERM=dumb) cannot show the desk" in desk.screen
    refused = called("desk", "--channel", channel)
    assert (refused.status, refused.out) == (2, "")
    assert "the desk needs a terminal" in refused.err
