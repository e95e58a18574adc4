"""`sleepcast baseline` on the air: newcomers get what still counts, and end like the others."""

from __future__ import annotations

import json
import sqlite3
import time
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

from cli.calling import called_warm
from cli.test_key_changes import keys
from cli.test_swarm import account, channel, swarm
from sleepcast.api.connection import FLEET, AirOptions, observing_station, station_for
from sleepcast.channel import Kind
from sleepcast.station.asking import look_around

__all__ = ["channel"]  # a fixture

LONGEST = 60.0


def options(channel: str, key: str | None = None) -> AirOptions:
    return AirOptions(channel, FLEET, key, None, None)


def send_many(channel: str, texts: list[str], key: str | None = None) -> None:
    """As a desk with this key, in one life with all that the command line sends."""
    with station_for(options(channel, key), print) as station:
        for text in texts:
            sent = station.post(Kind.COMMAND, text=text, standing=True)
            station.wait_until(lambda sent=sent: not sent.n_silent, time.time() + LONGEST)


def minds(channel: str, count: int) -> dict[str, bytes]:
    """The digest of what each robot has learned, once so many answer."""
    until = time.monotonic() + LONGEST
    while True:
        with observing_station(options(channel), print) as (station, telemetry):
            look_around(station, telemetry)
            found = {name: mind.telemetry.mind for name, mind in telemetry.minds.items() if name in station.present()}
        if len(found) >= count:
            return found
        assert time.monotonic() < until, found


def alike(channel: str, count: int) -> dict[str, bytes]:
    """The same, once all have learned the same."""
    until = time.monotonic() + LONGEST
    while len({*(found := minds(channel, count)).values()}) > 1:
        assert time.monotonic() < until, found
    return found


def baseline(channel: str, *more: str) -> Any:
    found = called_warm("baseline", "--yes", "--json", "--channel", channel, *more)
    assert found.status == 0, found.err
    return json.loads(found.out)


def test_a_newcomer_ends_like_the_others_with_few_commands(channel: str, tmp_path: Path) -> None:
    texts = [f"(RULE r{number % 5} (SETQ x{number % 3} {number}))" for number in range(120)]
    texts += ["(DEFUN f (a) (+ a 1))", "(DEFUN f (a) (+ a 2))", "(FORGET r4)", "(JOIN bravo)"]
    with ExitStack() as stack:
        stack.enter_context(swarm(2, channel, "--name-prefix", "old", "--store", str(tmp_path / "old.store")))
        account(channel, "ask", "id")
        send_many(channel, texts)
        told = baseline(channel)
        assert told["sent"]
        assert told["n_kept"] < 16
        assert told["n_kept"] + told["n_dropped"] == told["standing"] == len(texts)
        assert told["n_matched"] == 2
        again = called_warm("baseline", "--channel", channel)
        assert (again.status, "still count" in again.out) == (0, True), again
        stack.enter_context(swarm(1, channel, "--name-prefix", "new", "--store", str(tmp_path / "new.store")))
        assert set(alike(channel, 3)) == {"old1", "old2", "new1"}
    assert standing_in(tmp_path / "new.store") <= told["n_kept"] + 1
    with ExitStack() as stack:  # it alone, after a restart
        for name in ("new", "later"):
            stack.enter_context(swarm(1, channel, "--name-prefix", name, "--store", str(tmp_path / f"{name}.store")))
        assert len(alike(channel, 2)) == 2
    assert standing_in(tmp_path / "later.store") <= told["n_kept"] + 1


def standing_in(store: Path) -> int:
    """How many standing commands were received here."""
    with closing(sqlite3.connect(store)) as opened:
        return int(opened.execute("SELECT COUNT(*) FROM standing").fetchone()[0])


def test_nothing_is_sent_while_a_robot_is_missing_or_differs_or_the_key_may_not(channel: str, tmp_path: Path) -> None:
    folder = keys(tmp_path)
    assert folder.exists()
    with swarm(2, channel, "--key", "*"):
        account(channel, "ask", "id", "--key", "desk")
        send_many(channel, ["(RULE a 1)", "(RULE a 2)", "(RULE a 3)"], "desk")
        may_not = called_warm("baseline", "--channel", channel, "--key", "anna")
        assert (may_not.status, "commander" in may_not.err) == (2, True), may_not
        unasked = called_warm("baseline", "--channel", channel, "--key", "desk", "--expect", "2")
        assert (unasked.status, "say --yes" in unasked.err) == (2, True), unasked
        missing = called_warm("baseline", "--yes", "--channel", channel, "--key", "desk", "--expect", "3")
        assert (missing.status, "not every robot" in missing.err) == (1, True), missing
        send_many(channel, ["(RULE a 9)"], "chief")
        differs = called_warm("baseline", "--yes", "--channel", channel, "--key", "desk")
        assert (differs.status, "differ in the rule a" in differs.err) == (1, True), differs
        send_many(channel, ["(RULE a 4)"], "desk")
        done = called_warm("baseline", "--yes", "--channel", channel, "--key", "desk")
        assert (done.status, "matched 2" in done.out) == (0, True), done
