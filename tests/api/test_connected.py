"""The front door to a real fleet: a swarm in a process of its own, heard over UDP."""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections.abc import Iterator
from functools import partial
from math import inf
from pathlib import Path

import numpy as np
import pytest

import sleepcast as sc
from api.test_fleet import count_tags
from channel.test_udp import free_port
from cli.calling import LONGEST
from cli.test_swarm import channel, swarm
from counting import ONCE, counted
from processes import live_in
from sleepcast.api import connected
from sleepcast.simulator import MissionError
from sleepcast.station import CountNeededError, UnknownRobotError, asking
from sleepcast.station.asking import SilentError, look_around
from sleepcast.station.validation import UnknownNameError

__all__ = ["channel"]

PATIENT = 60.0
"""Seconds for answers: a method returns as soon as all have come."""


@pytest.fixture(scope="module")
def six(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The channel of six robots."""
    uri = f"udp://239.255.83.78:{free_port()}?interface=lo"
    with pytest.MonkeyPatch.context() as patch:
        live_in(tmp_path_factory.mktemp("home"), patch)
        with swarm(6, uri):
            yield uri


@pytest.fixture
def fleet(six: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[sc.ConnectedFleet]:
    """All six are waited for whenever the desk looks around, as it goes on as soon as all have answered."""
    monkeypatch.setattr(connected, "look_around", partial(look_around, patience=PATIENT))
    for module in (asking, connected):
        monkeypatch.setattr(module, "AHEAD", PATIENT)
    with sc.connect(six, expect=6) as fleet:
        until = time.monotonic() + LONGEST
        while len(fleet) < 6 or np.isnan(fleet["id"]).any():
            assert time.monotonic() < until
        yield fleet


def names(*numbers: int) -> tuple[str, ...]:
    return tuple(f"r{number}" for number in numbers)


def alike(found: tuple[str, ...], *numbers: int) -> bool:
    return sorted(found) == sorted(names(*numbers))


class TestCommands:
    def test_a_preview_and_what_becomes_of_the_command_agree(self, fleet: sc.ConnectedFleet) -> None:
        assert alike(fleet.preview("(> id 3)").yes, 4, 5, 6)
        text = "(WHEN (> id 3) (JOIN late))"
        assert alike(fleet.preview(text).no, 1, 2, 3)
        with counted() as found:
            sent = fleet.send(text, wait=PATIENT)
        assert found == ONCE
        assert alike(sent.matched, 4, 5, 6)
        assert alike(sent.not_matched, 1, 2, 3)
        assert sent.silent == sent.fault == ()
        assert "id" in sent.why("r2").reason
        assert fleet.why("r2").matched is False
        assert fleet.why("r2", sent.id).reason == sent.why("r2").reason
        assert alike(fleet.groups["late"], 4, 5, 6)
        assert sorted(sent.table()["outcome"]) == ["matched"] * 3 + ["not matched"] * 3

    def test_a_question(self, fleet: sc.ConnectedFleet) -> None:
        asked = fleet.ask("(* 2 id)", only=["r2", "r5"], wait=PATIENT)
        assert asked.values == {"r2": 4.0, "r5": 10.0}

    def test_stop_and_release(self, fleet: sc.ConnectedFleet) -> None:
        assert len(fleet.stop(wait=PATIENT).matched) == 6
        assert fleet.stopped.all()
        assert len(fleet.release(wait=PATIENT).matched) == 6
        assert not fleet.stopped.any()

    def test_a_release_of_a_script_ends_no_stop_of_another_desk(self, six: str, fleet: sc.ConnectedFleet) -> None:
        with sc.connect(six, expect=6) as other:
            assert len(other.stop(wait=PATIENT).matched) == 6
            fleet.play("@0s STOP\n@0.2s RELEASE", wait=PATIENT)
            other._looked = -inf
            assert other.stopped.all()
            with pytest.raises(MissionError, match="the script:2: on the air no script ends STOPs of other operators"):
                fleet.play("@0s (ST)\n@0.2s RELEASE ALL")
            assert len(other.release(wait=PATIENT).matched) == 6

    def test_robots_are_driven_while_it_runs(self, fleet: sc.ConnectedFleet) -> None:
        fleet.send("(WHEN (> id 5) (DRIVE 1m/s 0))", wait=PATIENT)
        at, until = fleet.names.index("r6"), time.monotonic() + LONGEST
        before = fleet.x[at], fleet.y[at]
        while np.hypot(fleet.x[at] - before[0], fleet.y[at] - before[1]) < 3.0:  # more than a second's way
            assert time.monotonic() < until
            fleet.run(1.0, quiet=True)

    def test_several_threads_take_turns(self, fleet: sc.ConnectedFleet) -> None:
        ended = []

        def run() -> None:
            with pytest.raises(sc.errors.MisuseError, match="closed"):
                fleet.run(10 * LONGEST, quiet=True)
            ended.append(True)

        running = threading.Thread(target=run, daemon=True)
        running.start()
        assert len(fleet.stop(wait=PATIENT).matched) == 6
        assert len(fleet.release(wait=PATIENT).matched) == 6
        fleet.close()
        running.join(LONGEST)
        assert ended

    def test_stop_waits_for_no_question_of_another_thread(self, six: str, monkeypatch: pytest.MonkeyPatch) -> None:
        with sc.connect(six, expect=7) as fleet:  # one of them never answers, so telemetry is waited for
            monkeypatch.setattr(connected, "look_around", partial(look_around, patience=5.0))
            fleet._looked = -inf
            before = len(fleet.telemetry._looks)
            asking = threading.Thread(target=lambda: fleet.groups, daemon=True)
            asking.start()
            until = time.monotonic() + LONGEST
            while len(fleet.telemetry._looks) == before:
                assert time.monotonic() < until
            fleet.stop(wait=0.0)
            assert asking.is_alive()
            fleet.release(wait=0.0)
            asking.join(LONGEST)

    def test_a_program_with_asyncio(self, fleet: sc.ConnectedFleet) -> None:
        async def both() -> tuple[sc.ConnectedFleet, sc.CommandResult]:
            return await asyncio.gather(fleet.arun(0.2), fleet.aask("id", wait=PATIENT))

        ran, asked = asyncio.run(both())
        assert ran is fleet
        assert len(asked.values) == 6

    def test_what_is_cancelled_ends(self, fleet: sc.ConnectedFleet) -> None:
        async def impatient() -> sc.CommandResult:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(0.2):
                    await fleet.arun(1e6)
            return fleet.stop(wait=PATIENT)

        assert len(asyncio.run(impatient()).matched) == 6  # it has waited until all threads have ended
        assert len(fleet.release(wait=PATIENT).matched) == 6

    def test_events(self, fleet: sc.ConnectedFleet) -> None:
        async def watch() -> dict[str, sc.FleetEvent]:
            text = '(WHEN (= id 4) (PROGN (JOIN seen) (REPORT "number" id) (/ 1 0)))'
            fleet.send(text, wait=0, sure=True)
            found: dict[str, sc.FleetEvent] = {}
            async for event in fleet.events(LONGEST):
                found.setdefault(event.kind, event)
                if len(found) == 4:
                    break
            return found

        found = asyncio.run(watch())
        assert (found["say"].robot, found["say"].text) == ("r4", "number 4")
        assert (found["join"].robot, found["join"].text) == ("r4", "seen")
        assert (found["fault"].robot, found["answer"].text) == ("r4", "not matched")


class TestReading:
    def test_numbers_of_all_robots(self, fleet: sc.ConnectedFleet) -> None:
        assert sorted(fleet["id"]) == [1, 2, 3, 4, 5, 6]
        assert (fleet["(* 2 id)"] == 2 * fleet["id"]).all()
        assert np.isfinite([fleet.x, fleet.y, fleet.heading]).all()
        assert (fleet["(IF (> (SONAR 0) 900km) 0 id)"] == fleet["id"]).all(), "robots are asked for that"
        with pytest.raises(ValueError, match="read-only"):
            fleet.x[0] = 1
        table = fleet.table("id", "x")
        assert list(table.columns) == ["robot", "id", "x"]
        assert list(table["robot"]) == list(fleet.names)
        assert set(fleet.table().columns) > {"robot", "x", "y"}

    @pytest.mark.parametrize(
        ("text", "complaint"),
        [("idd", "did you mean id"), ("(", "is not closed"), ("(JOIN a)", "cannot be previewed"), ("(FOO)", "FOO")],
    )
    def test_what_cannot_be_read_is_refused(self, fleet: sc.ConnectedFleet, text: str, complaint: str) -> None:
        with pytest.raises(sc.errors.SleepcastError, match=complaint):
            fleet[text]

    def test_shown(self, fleet: sc.ConnectedFleet, six: str) -> None:
        assert repr(fleet).startswith(f"{six}: 6 robots after ")
        assert count_tags(fleet._repr_html_())["tr"] == 7


class TestRefused:
    def test_commands_that_are_hardly_meant(self, fleet: sc.ConnectedFleet) -> None:
        with pytest.raises(sc.errors.MisuseError, match="this command has no test"):
            fleet.send("(MARK)")
        with pytest.raises(UnknownNameError, match="none of the 6 robots"):
            fleet.send("(WHEN (> feul 50%) (MARK))")
        with pytest.raises(UnknownNameError, match="none of the 6 robots"):
            fleet.ask("feul")
        assert set(fleet.ask("feul", sure=True, wait=PATIENT).values.values()) == {None}
        with pytest.raises(UnknownRobotError):
            fleet.why("nobody")
        with pytest.raises(CountNeededError, match="you gave 4"):
            fleet.send("(WHEN (> id 0) (MARK))", count=4)
        assert len(fleet.send("(WHEN (> feul 50%) (MARK))", sure=True, wait=PATIENT).unknown) == 6

    @pytest.mark.parametrize("seconds", [-1.0, float("nan"), float("inf")])
    def test_a_time_that_is_none(self, fleet: sc.ConnectedFleet, seconds: float) -> None:
        with pytest.raises(sc.errors.MisuseError, match="cannot run for"):
            fleet.run(seconds)

    def test_a_closed_fleet(self, channel: str) -> None:
        fleet = sc.connect(channel)
        fleet.close()
        fleet.close()
        with pytest.raises(sc.errors.MisuseError, match="closed"):
            fleet.run(1)
        with pytest.raises(sc.errors.MisuseError, match="closed"):
            fleet.stop()

    def test_what_is_no_channel_key_or_number(self, channel: str, tmp_path: Path) -> None:
        with pytest.raises(sc.errors.MisuseError):
            sc.connect("nothing://")
        with pytest.raises(sc.errors.MisuseError, match="no key 'desk'"):
            sc.connect(channel, key=tmp_path / "desk.key")
        with pytest.raises(sc.errors.MisuseError, match="no key 'nobody'"):
            sc.connect(channel, key="nobody")
        with pytest.raises(sc.errors.MisuseError, match="within nan s"):
            sc.connect(channel, within=float("nan"))
        with pytest.raises(sc.errors.SleepcastError):
            sc.connect(channel, expect=tmp_path / "nowhere.txt")


def test_who_falls_silent_is_named(channel: str) -> None:
    with swarm(2, channel) as process, sc.connect(channel, expect=2) as fleet:
        while len(fleet) < 2:
            fleet.run(0.1)
        process.kill()
        process.wait()
        assert alike(fleet.stop(wait=0.1).silent, 1, 2)
        told = fleet["id"]
        assert (np.isnan(told) | (told > 0)).all(), "until telemetry is too old"
        with pytest.raises(SilentError, match="r1 does not answer"):
            fleet.why("r1")


def test_a_key_may_be_a_file(channel: str, tmp_path: Path) -> None:
    from cli.calling import called

    keys = tmp_path / "mine"
    for owner, role in (("anna", "commander"), ("r*", "robot")):
        assert called("keys", "new", owner, "--role", role, "--keys", str(keys)).status == 0
    with (
        swarm(1, channel, "--keys", str(keys), "--key", "r*"),
        sc.connect(channel, key=keys / "anna.key") as fleet,
    ):
        while len(fleet) < 1:
            fleet.run(0.1)
        assert repr(fleet).endswith("as anna")
        assert fleet.ask("id", wait=PATIENT).values == {"r1": 1.0}
