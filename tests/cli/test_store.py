"""Robots as processes that are killed: what they knew, they know again, and nothing is done twice."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, closing, contextmanager
from pathlib import Path
from random import Random

import pytest

from channel.test_udp import free_port
from cli.calling import LONGEST, called_warm
from processes import SLEEPCAST, live_in, running, start
from sleepcast.api.connection import AirOptions, session_for
from sleepcast.channel import Kind, Message
from sleepcast.channel.message import NOT_STORED
from sleepcast.channel.session import ChannelSession

NAMES = {"r1", "r2", "r3"}
STOPPED, RELEASED = dict.fromkeys(NAMES, "stopped"), dict.fromkeys(NAMES, "released")
LOST, LOST_RELEASE = dict.fromkeys(NAMES, "stopped not stored"), dict.fromkeys(NAMES, "released not stored")
PATIENCE = 5.0
"""Seconds to wait for everybody's answer before saying something again."""


@pytest.fixture
def channel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The address of a channel of our own, of a user with no keys and no memory of any fleet."""
    live_in(tmp_path, monkeypatch)
    return f"udp://239.255.83.78:{free_port()}?interface=lo"


def swarm(
    channel: str, store: Path, robots: int = 3, before: Sequence[str] = ()
) -> AbstractContextManager[subprocess.Popen[str]]:
    """Robots that are up, killed at the end. before: what stands before the command."""
    return running(*before, *SLEEPCAST, "swarm", robots, "--channel", channel, "--store", store, up="are up")


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
    """Say this, until all have answered; the values, or for other kinds than questions the outcomes, with what could
    not be stored."""
    end = time.monotonic() + LONGEST
    while time.monotonic() < end:
        said, found, until = post(session, text, kind), dict[str, object](), time.monotonic() + PATIENCE
        while time.monotonic() < until:
            session.wait(0.02)
            for message in session.receive():
                if message.body.get("command") == said.id:
                    body = message.body
                    lost = f" {body['fault']}" if body["fault"] == NOT_STORED else ""
                    found[message.sender] = body["value"] if kind is Kind.ASK else f"{body['outcome']}{lost}"
            if found.keys() >= NAMES:
                return {name: found[name] for name in NAMES}
    raise AssertionError(f"not everybody has answered to {kind} {text}")


def stopped(channel: str) -> list[bool]:
    """Whether each robot is."""
    robots = json.loads(called_warm("watch", "--once", "--json", "--channel", channel).out)["robots"]
    return [robot["stopped"] for robot in robots]


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
    assert {outcome for _, command, outcome in found if command in standing} <= {"matched", "interrupted"}
    assert {outcome for _, _, outcome in found} <= {"matched", "interrupted", "late"}, "what counts for seconds"
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
        robots = json.loads(called_warm("watch", "--once", "--json", "--channel", channel).out)["robots"]
        assert [robot["doubt"] for robot in robots if robot["stopped"]] == ["its store was damaged"] * 3
        told = "stopped until RELEASE: r1, r2, r3 (its store was damaged)"
        assert told in called_warm("who", turn, "--told", "--channel", channel).out
        assert told in " ".join(called_warm("watch", "--once", "--channel", channel).out.split())
        assert exchange(session, "", Kind.RELEASE) == dict.fromkeys(NAMES, "released")
        exchange(session, turn)
        until = time.monotonic() + LONGEST
        while exchange(session, "heading", Kind.ASK) == before:
            assert time.monotonic() < until
        robots = json.loads(called_warm("watch", "--once", "--json", "--channel", channel).out)["robots"]
        assert [robot["doubt"] for robot in robots] == [""] * 3
        process.send_signal(signal.SIGINT)
        assert process.stderr
        complaints = process.stderr.read()
    assert f"{store} was damaged (database disk image is malformed). It was set aside as three.store.b" in complaints
    assert "r1 to r3 (3 robots): its store was damaged, so a STOP may be forgotten; stopped until" in complaints


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
        robots = json.loads(called_warm("watch", "--once", "--json", "--channel", channel).out)["robots"]
        assert [robot["catching_up"] for robot in robots] == [True] * 3
        assert called_warm("watch", "--once", "--channel", channel).out.count("catching up") == 3
        post(session, "(RULE more 1)", standing=True)
        while 0.0 in exchange(session, "n", Kind.ASK).values():
            assert time.time() < now + LONGEST
        robots = json.loads(called_warm("watch", "--once", "--json", "--channel", channel).out)["robots"]
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


def test_what_was_confirmed_is_known_after_a_kill_at_that_moment(channel: str, tmp_path: Path) -> None:
    """More of them, later and of other robots: `python -m benchmarks.channel durable`."""
    store = tmp_path / "three.store"
    with desk(channel) as session:
        for kind, confirmed, before in (
            (Kind.STOP, STOPPED, False),
            (Kind.RELEASE, RELEASED, True),
            (Kind.STOP, STOPPED, False),
        ):
            with swarm(channel, store):
                assert stopped(channel) == [before] * 3
                assert exchange(session, "", kind) == confirmed
        with swarm(channel, store):
            assert stopped(channel) == [True] * 3


# ---- disks that refuse


UNSYNCED = """
#include <errno.h>
#include <stdlib.h>
#include <unistd.h>
static int refused(void) {
    return access(getenv("REFUSED"), F_OK) == 0 ? (errno = EIO, -1) : 0;
}
int fsync(int file) { return refused(); }
int fdatasync(int file) { return refused(); }
"""
"""A library in which the disk says that it could not write, while a file is there."""


def test_a_robot_without_free_files_and_one_whose_fsync_fails_stop_and_say_so(channel: str, tmp_path: Path) -> None:
    if sys.platform != "linux" or shutil.which("gcc") is None:
        pytest.skip("needs Linux, and a compiler for a library in which fsync fails (apt install gcc)")
    import resource

    store, refused = tmp_path / "three.store", tmp_path / "refused"
    (tmp_path / "unsynced.c").write_text(UNSYNCED)
    subprocess.run(["gcc", "-shared", "-fPIC", "-o", "unsynced.so", "unsynced.c"], cwd=tmp_path, check=True)
    before = ("env", f"LD_PRELOAD={tmp_path / 'unsynced.so'}", f"REFUSED={refused}")
    with desk(channel) as session:
        with swarm(channel, store, before=before) as process:
            soft, hard = resource.prlimit(process.pid, resource.RLIMIT_NOFILE)
            resource.prlimit(process.pid, resource.RLIMIT_NOFILE, (1, hard))  # not one more can be opened
            assert exchange(session, "", Kind.STOP) == STOPPED
            assert exchange(session, "", Kind.RELEASE) == RELEASED
            assert exchange(session, "(RULE a 1)") == dict.fromkeys(NAMES, "matched")
            refused.touch()
            assert exchange(session, "", Kind.STOP) == LOST
            resource.prlimit(process.pid, resource.RLIMIT_NOFILE, (soft, hard))
            refused.unlink()
            assert exchange(session, "", Kind.RELEASE) == RELEASED
            assert exchange(session, "", Kind.STOP) == STOPPED
            refused.touch()
            assert exchange(session, "", Kind.RELEASE) == LOST_RELEASE
        refused.unlink()
        with swarm(channel, store):
            exchange(session, "", Kind.RELEASE)  # whichever of the two the disk has


@contextmanager
def small_disk(folder: Path) -> Iterator[tuple[str, ...]]:
    """A disk in memory of 2 MB, which only processes see that are started with these words before their command."""
    enter = "mount -t tmpfs -o size=2m none " + str(folder) + " && echo mounted && exec sleep 600"
    with start("unshare", "--map-root-user", "--mount", "sh", "-c", enter) as holder:
        try:
            assert holder.stdout is not None
            if "mounted" not in holder.stdout.readline():
                pytest.skip("this system lets nobody mount a disk of his own")
            yield ("nsenter", f"--target={holder.pid}", "--user", "--mount", "--preserve-credentials")
        finally:
            holder.kill()


@pytest.mark.skipif(sys.platform != "linux" or shutil.which("nsenter") is None, reason="needs namespaces of Linux")
def test_a_robot_whose_disk_is_full_stops_says_so_and_begins_stopped(channel: str, tmp_path: Path) -> None:
    folder = tmp_path / "small"
    folder.mkdir()
    store, rest = folder / "three.store", folder / "rest"
    with small_disk(folder) as before, desk(channel) as session:
        with swarm(channel, store, before=before):
            assert exchange(session, "(SETQ drive_turn 0.5)") == dict.fromkeys(NAMES, "matched")
            subprocess.run([*before, "sh", "-c", f"cat /dev/zero > {rest}"], check=False, capture_output=True)
            assert exchange(session, "", Kind.STOP) == LOST
            assert exchange(session, "", Kind.RELEASE) == LOST_RELEASE
            assert exchange(session, "", Kind.STOP) == LOST
        with swarm(channel, store, before=before):
            assert stopped(channel) == [True] * 3
            subprocess.run([*before, "rm", rest], check=True)
            until = time.monotonic() + LONGEST
            while exchange(session, "", Kind.RELEASE) != RELEASED:
                assert time.monotonic() < until
            assert stopped(channel) == [False] * 3
