"""`sleepcast swarm`: many robots in one process, each a party of its own on the air."""

from __future__ import annotations

import json
import signal
import subprocess
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import pytest

from channel.test_udp import free_port
from cli.calling import LONGEST, Called, again_until, called_here, called_warm
from processes import SLEEPCAST, live_in, running
from small_worlds import write


@pytest.fixture
def channel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The address of a channel of our own, of a user with no keys and no memory of any fleet."""
    live_in(tmp_path, monkeypatch)
    return f"udp://239.255.83.77:{free_port()}?interface=lo"


def swarm(count: int, channel: str, *options: str) -> AbstractContextManager[subprocess.Popen[str]]:
    """A swarm that is up."""
    return running(*SLEEPCAST, "swarm", count, "--channel", channel, *options, up=f"are up: {count} robots")


def at_rest(folder: Path) -> tuple[str, str]:
    """Options for robots that stand still: a craft of bravo begins at 30 kn, and brakes for half a minute."""
    return "--scenario", str(write(folder))


def in_time(channel: str, *arguments: str) -> Called:
    """A call with `--json`. On a busy machine robots may be late to tell what they are; what cannot be foreseen is not
    sent then, and is said again."""
    return again_until(
        lambda found: not too_late(found.out, found.err),
        lambda: called_warm(*arguments, "--channel", channel, "--json"),
    )


def account(channel: str, *arguments: str) -> dict[str, Any]:
    """What becomes of a command that is said in time."""
    found = in_time(channel, *arguments)
    assert found.out, found.err
    told: dict[str, Any] = json.loads(found.out)
    return told


def too_late(out: str, err: str) -> bool:
    """Whether nothing was sent because robots had not told enough in time."""
    return not out and ("cannot say" in err or "no robot was heard" in err)


def test_each_robot_of_a_swarm_decides_for_itself(channel: str, tmp_path: Path) -> None:
    rules = tmp_path / "begin.sleep"
    rules.write_text("(DEFVAR mine (* 2 id))")
    with swarm(
        4, channel, "--first", "7", "--name-prefix", "scout", "--rules", str(rules), *at_rest(tmp_path)
    ) as process:
        asked = account(channel, "ask", "mine")
        assert [asked[key] for key in ("n", "min", "max")] == [4, 14.0, 20.0]
        told = account(channel, "send", "(WHEN (> id 8) (DRIVE 1 0))")
        assert (set(told["matched"]), set(told["not_matched"])) == ({"scout9", "scout10"}, {"scout7", "scout8"})
        assert account(channel, "send", "--standing", "--all", "(RULE still (DRIVE 0 0))")["n_matched"] == 4
        assert account(channel, "stop")["n_matched"] == 4
        assert account(channel, "release")["n_matched"] == 4
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=LONGEST)
        assert process.returncode == 130
        assert "their bodies have been stopped" in said
        assert "Traceback" not in said


def test_names_may_be_as_long_as_any(channel: str) -> None:
    with swarm(2, channel, "--name-prefix", "a" * 63):
        assert account(channel, "ask", "id")["n"] == 2


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("0",), "0 is not in the range"),
        (("2", "--name-prefix", "a b"), "without blanks"),
        (("2", "--first", "1000000"), "numbers go up to"),
        (("2", "--scenario", "brav"), "bravo"),
        (("2", "--rules", "none.sleep"), "none.sleep"),
        (("2", "--lease", "never"), "or off"),
        (("2", "--limits", "none.toml"), "none.toml"),
    ],
)
def test_what_is_no_swarm(
    channel: str, arguments: tuple[str, ...], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    refused = called_here(capsys, "swarm", *arguments, "--channel", channel)
    assert (refused.status, refused.out) == (2, "")
    assert complaint in refused.err
