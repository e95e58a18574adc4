"""Robots as processes that are killed: what they knew, they know again, and nothing is done twice."""

from __future__ import annotations

import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from random import Random

import pytest

from channel.test_udp import free_port
from cli.calling import LONGEST, called

NAMES = ["r1", "r2", "r3"]


@pytest.fixture
def channel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The address of a channel of our own, of a user with no keys and no memory of any fleet."""
    monkeypatch.setenv("HOME", str(tmp_path))
    for name in ("XDG_CONFIG_HOME", "XDG_DATA_HOME"):
        monkeypatch.delenv(name, raising=False)
    return f"udp://239.255.83.78:{free_port()}?interface=lo"


@contextmanager
def swarm(channel: str, store: Path, *options: str) -> Iterator[subprocess.Popen[str]]:
    """Three robots that are up, killed at the end."""
    arguments = ("swarm", "3", "--channel", channel, "--store", str(store), *options)
    process = subprocess.Popen(
        [sys.executable, "-m", "sleepcast", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout
        assert "are up" in process.stdout.readline()
        yield process
    finally:
        os.kill(process.pid, signal.SIGKILL)
        process.communicate()


def account(channel: str, *arguments: str) -> dict[str, object]:
    found = called(*arguments, "--channel", channel, "--json")
    assert found.out, found.err
    told: dict[str, object] = json.loads(found.out)
    return told


def heading(channel: str) -> float:
    """Of all robots, on average, rad."""
    found = account(channel, "ask", "heading")["mean"]
    assert isinstance(found, float)
    return found


def journal(store: Path) -> list[tuple[str, str, str]]:
    """Robot, command and outcome of everything that was evaluated."""
    with closing(sqlite3.connect(f"{store.as_uri()}?mode=ro", uri=True)) as connection:
        return connection.execute("SELECT robot, command, outcome FROM journal ORDER BY number").fetchall()


def test_robots_that_are_killed_go_on_where_they_were(channel: str, tmp_path: Path) -> None:
    store = tmp_path / "three.store"
    with swarm(channel, store):
        text = "(PROGN (DEFVAR n 0) (JOIN crew) (RULE count (SETQ n (+ n 1))))"
        assert account(channel, "send", "--all", text)["matched"] == NAMES
        assert account(channel, "stop")["matched"] == NAMES
    with swarm(channel, store):
        assert account(channel, "ask", "(AND (IN crew) (> n 0))")["min"] == 1.0, "the rule runs, and has run before"
        before = heading(channel)
        assert account(channel, "send", "--all", "(SETQ drive_turn 0.5)")["matched"] == NAMES
        assert heading(channel) == before, "STOP holds"
        assert account(channel, "release")["matched"] == NAMES
        assert account(channel, "send", "--all", "(SETQ drive_turn 0.5)")["matched"] == NAMES
        until = time.monotonic() + LONGEST
        while heading(channel) == pytest.approx(before, abs=0.1):
            assert time.monotonic() < until


def test_kill_at_any_moment_lets_nothing_be_done_twice(channel: str, tmp_path: Path) -> None:
    store, chance = tmp_path / "three.store", Random(5)
    for _ in range(2):
        with swarm(channel, store):
            sends = [
                subprocess.Popen(
                    [sys.executable, "-m", "sleepcast", "send", *how, "--all", text, "--channel", channel],
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                )
                for how, text in (((), "(DEFVAR a 1)"), (("--standing",), "(DEFVAR b 2)"))
            ]
            time.sleep(0.3 + 0.5 * chance.random())
        for send in sends:
            send.wait(LONGEST)
    with swarm(channel, store):
        assert account(channel, "send", "--standing", "--all", "(DEFVAR b 2)")["matched"] == NAMES
        assert account(channel, "ask", "b")["min"] == 2.0
    found = journal(store)
    assert set(Counter((robot, command) for robot, command, _ in found).values()) == {1}
    assert {outcome for _, _, outcome in found} <= {"matched", "interrupted", "late"}


def test_an_operator_goes_on_where_his_last_command_was(channel: str, tmp_path: Path) -> None:
    first = account(channel, "send", "--standing", "--all", "(RULE a (SETQ drive_turn 0.1))")
    assert (first["matched"], first["silent"]) == ([], [])
    second = account(channel, "send", "--standing", "--all", "(RULE b (SETQ drive_turn 0.2))")
    lives = [str(sent["id"]).rpartition(".") for sent in (first, second)]
    assert lives[0][0] == lives[1][0], "one life"
    assert int(lives[0][2]) < int(lives[1][2])
    with swarm(channel, tmp_path / "three.store") as process:
        third = account(channel, "send", "--standing", "--all", "(RULE c (SETQ drive_turn 0.3))")
        assert third["matched"] == NAMES
        assert process.poll() is None
    evaluated = [command for robot, command, outcome in journal(tmp_path / "three.store") if robot == "r1"]
    assert evaluated == [first["id"], second["id"], third["id"]], "who comes late hears it all, and in its order"
