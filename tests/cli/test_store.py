"""Robots as processes that are killed: what they knew, they know again, and nothing is done twice."""

from __future__ import annotations

import json
import os
import signal
import sqlite3
import subprocess
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import AbstractContextManager, closing, contextmanager
from pathlib import Path
from random import Random

import pytest

from channel.test_udp import free_port
from cli.calling import LONGEST, called
from processes import SLEEPCAST, live_in, running
from sleepcast.api.connection import AirOptions, session_for
from sleepcast.channel import Kind, Message
from sleepcast.channel.session import ChannelSession

NAMES = {"r1", "r2", "r3"}
PATIENCE = 5.0
"""Seconds to wait for everybody's answer before saying something again."""


@pytest.fixture
def channel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The address of a channel of our own, of a user with no keys and no memory of any fleet."""
    live_in(tmp_path, monkeypatch)
    return f"udp://239.255.83.78:{free_port()}?interface=lo"


def swarm(channel: str, store: Path, robots: int = 3) -> AbstractContextManager[subprocess.Popen[str]]:
    """Robots that are up, killed at the end."""
    return running(*SLEEPCAST, "swarm", robots, "--channel", channel, "--store", store, up="are up")


@contextmanager
def desk(channel: str) -> Iterator[ChannelSession]:
    """An operator, as `sleepcast send` is one."""
    air = AirOptions(channel, "sleepcast", None, None, None)
    with closing(session_for(air, None, robot=False, say=lambda said: None)) as session:
        yield session


def post(session: ChannelSession, text: str, kind: Kind = Kind.COMMAND, *, standing: bool = False) -> Message:
    said = session.delivery.post(kind, time.time(), text=text, standing=standing)
    session.flush()
    return said


def exchange(session: ChannelSession, text: str, kind: Kind = Kind.COMMAND) -> dict[str, object]:
    """Say this, until all have answered; the values, or for other kinds than questions the outcomes."""
    end = time.monotonic() + LONGEST
    while time.monotonic() < end:
        said, found, until = post(session, text, kind), dict[str, object](), time.monotonic() + PATIENCE
        while time.monotonic() < until:
            session.wait(0.02)
            for message in session.receive():
                if message.body.get("command") == said.id:
                    found[message.sender] = message.body["value" if kind is Kind.ASK else "outcome"]
            if found.keys() >= NAMES:
                return {name: found[name] for name in NAMES}
    raise AssertionError(f"not everybody has answered to {kind} {text}")


def journal(store: Path) -> list[tuple[str, str, str]]:
    """Robot, command and outcome of everything that was evaluated."""
    with closing(sqlite3.connect(f"{store.as_uri()}?mode=ro", uri=True)) as connection:
        return connection.execute("SELECT robot, command, outcome FROM journal ORDER BY number").fetchall()


def test_robots_that_are_killed_go_on_where_they_were(channel: str, tmp_path: Path) -> None:
    store = tmp_path / "three.store"
    with desk(channel) as session:
        with swarm(channel, store):
            text = "(PROGN (DEFVAR n 0) (JOIN crew) (RULE count (SETQ n (+ n 1))) (SETQ drive_turn 0.5))"
            assert exchange(session, text) == dict.fromkeys(NAMES, "matched")
            assert exchange(session, "", Kind.STOP) == dict.fromkeys(NAMES, "stopped")
        with swarm(channel, store):
            asked = exchange(session, "(AND (IN crew) (> n 0))", Kind.ASK)
            assert asked == dict.fromkeys(NAMES, 1.0), "the rule runs, and has run before"
            exchange(session, "(SETQ drive_turn 0.5)")
            before = exchange(session, "heading", Kind.ASK)
            session.wait(0.5)
            assert exchange(session, "heading", Kind.ASK) == before, "STOP holds"
            assert exchange(session, "", Kind.RELEASE) == dict.fromkeys(NAMES, "released")
            exchange(session, "(SETQ drive_turn 0.5)")
            until = time.monotonic() + LONGEST
            while exchange(session, "heading", Kind.ASK) == before:
                assert time.monotonic() < until


def test_kill_at_any_moment_lets_nothing_be_done_twice(channel: str, tmp_path: Path) -> None:
    store, chance = tmp_path / "three.store", Random(5)
    standing = []
    with desk(channel) as session:
        for _ in range(3):
            with swarm(channel, store):
                until = time.monotonic() + 0.2 + 0.6 * chance.random()
                while time.monotonic() < until:
                    standing.append(post(session, f"(RULE a {len(standing)})", standing=True).id)
                    post(session, "(JOIN crew)")
                    session.wait(0.05)
                    session.receive()
        with swarm(channel, store):
            until = time.monotonic() + LONGEST
            while not all((name, standing[-1], "matched") in journal(store) for name in NAMES):
                assert time.monotonic() < until
                session.wait(0.1)
                session.receive()
    found = journal(store)
    assert set(Counter((robot, command) for robot, command, _ in found).values()) == {1}
    assert {outcome for _, _, outcome in found} <= {"matched", "interrupted", "late"}
    for name in NAMES:
        assert [command for robot, command, _ in found if robot == name and command in standing] == standing


def test_robots_with_a_damaged_store_stand_and_every_desk_says_so(channel: str, tmp_path: Path) -> None:
    store, turn = tmp_path / "three.store", "(SETQ drive_turn 0.5)"
    with swarm(channel, store) as process:
        with desk(channel) as session:
            assert exchange(session, turn) == dict.fromkeys(NAMES, "matched")
            assert exchange(session, "", Kind.STOP) == dict.fromkeys(NAMES, "stopped")
        process.send_signal(signal.SIGINT)
        process.wait(LONGEST)
    os.truncate(store, 9_000)
    with swarm(channel, store) as process, desk(channel) as session:
        exchange(session, turn)
        before = exchange(session, "heading", Kind.ASK)
        session.wait(0.5)
        assert exchange(session, "heading", Kind.ASK) == before, "STOP holds"
        robots = json.loads(called("watch", "--once", "--json", "--channel", channel).out)["robots"]
        assert [robot["doubt"] for robot in robots if robot["stopped"]] == ["its store was damaged"] * 3
        told = "until RELEASE stand r1, r2, r3: its store was damaged"
        assert told in called("who", turn, "--told", "--channel", channel).out
        assert told in " ".join(called("watch", "--once", "--channel", channel).out.split())
        assert exchange(session, "", Kind.RELEASE) == dict.fromkeys(NAMES, "released")
        exchange(session, turn)
        until = time.monotonic() + LONGEST
        while exchange(session, "heading", Kind.ASK) == before:
            assert time.monotonic() < until
        robots = json.loads(called("watch", "--once", "--json", "--channel", channel).out)["robots"]
        assert [robot["doubt"] for robot in robots] == [""] * 3
        process.send_signal(signal.SIGINT)
        assert process.stderr
        complaints = process.stderr.read()
    assert f"{store} was damaged (database disk image is malformed). It was set aside as three.store.b" in complaints
    assert "r1 to r3 (3 robots): its store was damaged, so a STOP may be forgotten; stands still until" in complaints


def test_the_rules_of_robots_that_catch_up_wait(channel: str, tmp_path: Path) -> None:
    """They get a rule of an hour ago, and are told that there is more."""
    with swarm(channel, tmp_path / "three.store"), desk(channel) as session:
        assert exchange(session, "(DEFVAR n 0)") == dict.fromkeys(NAMES, "matched")
        delivery, now = session.delivery, time.time()
        text = "(RULE count (SETQ n (+ n 1)))"
        old = delivery.post(Kind.COMMAND, now - 3_600.0, text=text, standing=True)
        told = [delivery.key_id, delivery.epoch, old.sequence + 2]
        delivery.post(Kind.DIGEST, now, body={"have": [told]})
        while exchange(session, "(KNOWN count)", Kind.ASK) != dict.fromkeys(NAMES, 1.0):
            assert time.time() < now + LONGEST
        assert exchange(session, "n", Kind.ASK) == dict.fromkeys(NAMES, 0.0)
        robots = json.loads(called("watch", "--once", "--json", "--channel", channel).out)["robots"]
        assert [robot["catching_up"] for robot in robots] == [True] * 3
        assert called("watch", "--once", "--channel", channel).out.count("catching up") == 3
        post(session, "(RULE more 1)", standing=True)
        while 0.0 in exchange(session, "n", Kind.ASK).values():
            assert time.time() < now + LONGEST
        robots = json.loads(called("watch", "--once", "--json", "--channel", channel).out)["robots"]
        assert [robot["catching_up"] for robot in robots] == [False] * 3


def test_an_operator_goes_on_where_his_last_command_was(channel: str, tmp_path: Path) -> None:
    sent = []
    for number in range(2):
        with desk(channel) as session:
            sent.append(post(session, f"(RULE a{number} 1)", standing=True))
    with swarm(channel, tmp_path / "three.store"), desk(channel) as session:
        sent.append(post(session, "(RULE a2 1)", standing=True))
        until = time.monotonic() + LONGEST
        while len(journal(tmp_path / "three.store")) < 9:
            assert time.monotonic() < until
            session.wait(0.1)
            session.receive()
    assert len({message.epoch for message in sent}) == 1, "one life"
    evaluated = [command for robot, command, _ in journal(tmp_path / "three.store") if robot == "r1"]
    assert evaluated == [message.id for message in sent], "who comes late hears it all, and in its order"


def test_who_joins_a_swarm_hears_what_stands_and_the_others_do_it_once(channel: str, tmp_path: Path) -> None:
    store = tmp_path / "swarm.store"
    with desk(channel) as session:
        with swarm(channel, store):
            sent = [post(session, text, standing=True).id for text in ("(DEFVAR n 0)", "(SETQ n (+ n 1))")]
            until = time.monotonic() + LONGEST
            while len(journal(store)) < 6:
                assert time.monotonic() < until
                session.wait(0.1)
                session.receive()
        with swarm(channel, store, 4):
            while not any(robot == "r4" and command == sent[-1] for robot, command, _ in journal(store)):
                assert time.monotonic() < until
                session.wait(0.1)
                session.receive()
            assert exchange(session, "n", Kind.ASK) == dict.fromkeys(NAMES, 1.0)
    assert Counter((robot, command) for robot, command, _ in journal(store)) == Counter(
        (f"r{number}", command) for number in range(1, 5) for command in sent
    )
