"""Nodes and an operator as processes of their own on a channel: who obeys, who answers, who is silent."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path

import pytest

from channel.test_udp import free_port
from cli.calling import LONGEST, Called, called_here, called_warm
from cli.test_swarm import account
from nomad.serving import Served, serving
from processes import SLEEPCAST, live_in, running
from sleepcast.nomad.world.building import nomad_world
from sleepcast.simulator.engine import NumPyMachine


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user with no keys and no memory of any fleet."""
    live_in(tmp_path, monkeypatch)
    return tmp_path


@pytest.fixture
def channel() -> str:
    return f"udp://239.255.83.76:{free_port()}?interface=lo"


@pytest.fixture
def served() -> Iterator[Served]:
    world = nomad_world(None, "ideal", 3, 1, machine=NumPyMachine())
    with serving(world, speed=1.0, headless=True) as found:
        yield found


def node(name: str, served: Served, channel: str, *options: str) -> AbstractContextManager[subprocess.Popen[str]]:
    """A node that is up."""
    body = f"nomad://127.0.0.1:{served.port}#{name[1:]}"
    arguments = ("node", "--name", name, "--body", body, "--channel", channel, *options)
    return running(*SLEEPCAST, *arguments, up="is up", stdin=subprocess.PIPE)


def on_air(channel: str, *arguments: str) -> Called:
    return called_warm(*arguments, "--channel", channel)


def test_robots_on_the_air_obey_answer_and_are_missed(home: Path, served: Served, channel: str) -> None:
    with node("r1", served, channel), node("r2", served, channel) as second:
        rule = account(channel, "send", "--standing", "--all", "(RULE go (VM 0.1m/s 0.1m/s))")
        assert (rule["matched"], rule["silent"]) == (["r1", "r2"], [])
        told = account(channel, "send", "(WHEN (> id 1) (SETQ drive_turn 0.3))")
        assert (told["matched"], told["not_matched"], told["fault"]) == (["r2"], ["r1"], [])
        assert account(channel, "send", "--anyway", "(WHEN (FOO 1) (ST))")["fault"] == ["r1", "r2"]
        asked = account(channel, "ask", "id")
        assert [asked[key] for key in ("n", "min", "mean", "max")] == [2, 1.0, 1.5, 2.0]
        assert account(channel, "stop")["matched"] == ["r1", "r2"]
        until = time.monotonic() + LONGEST
        while any(served.nserver.world.observe(robot).moving[0] for robot in (0, 1)):
            assert time.monotonic() < until
            time.sleep(0.01)
        assert account(channel, "release")["matched"] == ["r1", "r2"]
        os.kill(second.pid, signal.SIGKILL)
        second.wait(LONGEST)
        missed = account(channel, "send", '(WHEN (> id 0) (REPORT "here" id))')
        assert (missed["matched"], missed["silent"], missed["n_silent"]) == (["r1"], ["r2"], 1)
        with node("r3", served, channel):  # who comes late hears what stands
            until = time.monotonic() + LONGEST
            while not served.nserver.world.observe(2).moving[0]:
                assert time.monotonic() < until
                time.sleep(0.01)


def test_keys_decide_who_is_obeyed(home: Path, served: Served, channel: str) -> None:
    for owner, role in (("desk", "operator"), ("watch", "observer"), ("r*", "robot")):
        assert called_warm("keys", "new", owner, "--role", role).status == 0
    with ExitStack() as stack:
        stack.enter_context(node("r1", served, channel, "--key", "r*"))
        assert account(channel, "ask", "id", "--key", "watch")["matched"] == ["r1"]
        refused = on_air(channel, "send", "(WHEN (> id 0) (VM 1 1))", "--key", "watch")
        assert (refused.status, refused.out) == (2, "")
        assert "watch is an observer, who may only ask and stop" in refused.err
        assert account(channel, "send", "(WHEN (> id 0) (VM 0 0))", "--key", "desk")["matched"] == ["r1"]
        assert account(channel, "ask", "id")["matched"] == [], "the development key is nobody's here"
        assert account(channel, "stop", "--key", "watch")["matched"] == ["r1"]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("send", "(ST)"), "you mean all robots (--all)"),
        (("send", "(ST"), "is not closed"),
        (("ask", "(+ 1"), "is not closed"),
        (("send", "(WHEN (> x 1) (ST))", "--key", "desk"), "sleepcast keys new desk makes it"),
        (("send", "(WHEN (> x 1) (ST))", "--trust", "none.json"), "cannot read none.json"),
    ],
)
def test_what_is_not_sent(
    home: Path, channel: str, arguments: tuple[str, ...], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    refused = called_here(capsys, *arguments, "--channel", channel)
    assert (refused.status, refused.out) == (2, "")
    assert complaint in refused.err


@pytest.mark.parametrize("uri", ["", "udp://", "udp://1.2.3.4:5?interfac=lo", "zmq://a"])
def test_a_channel_that_means_nothing_is_refused(home: Path, uri: str, capsys: pytest.CaptureFixture[str]) -> None:
    refused = called_here(capsys, "stop", "--channel", uri)
    assert refused.status == 2
    assert "wanted" in refused.err


def test_nobody_there_is_told_as_nobody(home: Path, channel: str) -> None:
    found = on_air(channel, "ask", "id", "--within", "0")
    assert found.status == 0
    assert "no robot answered, and none was heard before" in found.out
    assert "development keys of this machine" in found.err
