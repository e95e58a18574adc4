"""The past of a run: what is run again of a moment is what was so then, to the last bit."""

from __future__ import annotations

import asyncio
import inspect
import json
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from math import inf
from pathlib import Path

import msgspec
import numpy as np
import pytest

import sleepcast as sc
from cli.calling import called_here
from console.asking import put
from exporting.coming import FLOCK, STEPS, THERE, flock
from fleet.test_scanners import TEXT as SCANNERS
from sleepcast.console import outgoing
from sleepcast.console.adapters.live_past import LivePast
from sleepcast.console.adapters.recorded_past import RecordedPast
from sleepcast.console.adapters.recording import load_timeline
from sleepcast.console.adapters.swarm import SwarmAdapter
from sleepcast.console.backend import Backend
from sleepcast.console.connection import encode
from sleepcast.console.driver import Driver
from sleepcast.console.features.preview import GetPreview, Previewed
from sleepcast.console.features.time import ShowMoment
from sleepcast.console.features.why import Explained, Why, show_why
from sleepcast.console.marks import clock_time
from sleepcast.console.past_view import ExactMoment
from sleepcast.console.recorded_values import RecordedValues
from sleepcast.console.replay_client import RerunError
from sleepcast.console.swarm_dialogue import SwarmDialogue
from sleepcast.console.timeline import news_of
from sleepcast.core.clock import ManualClock, WallClock
from sleepcast.core.errors import SleepcastError
from sleepcast.loop import Pace
from sleepcast.simulator import Changes, Circle, find_scenario, read_scenario
from sleepcast.simulator.recording.recording import load_recording
from sleepcast.station import Station
from sleepcast.station.sent import MATCHED, NOT_MATCHED, SILENT, NoExplanationError
from swarms import desk_of, drive, swarm_of

ROBOTS, LAST = 12, 60
WALL_AT = 33


@dataclass
class Run:
    """A run with its past, and what was seen of it when it went on. robots: by tick and index, as JSON."""

    past: LivePast
    desk: Backend
    robots: dict[tuple[int, int], bytes] = field(default_factory=dict)
    poses: dict[int, bytes] = field(default_factory=dict)
    whys: dict[tuple[int, str], bytes] = field(default_factory=dict)


@pytest.fixture(scope="module")
def run() -> Iterator[Run]:
    """Some robots of crowd, with all sorts of commands, a STOP, and a wall that somebody puts there."""
    scenario = find_scenario("crowd", Changes(robots=ROBOTS))
    swarm = swarm_of(scenario, seed=4)
    station, view, clock = desk_of(swarm), SwarmAdapter(swarm), WallClock()
    past = LivePast(view, swarm, station, clock)
    found = Run(past, Backend(view, station, Driver(view, Pace(clock, swarm, 1.0), clock), clock))
    for _ in range(LAST):
        if swarm.simulator.tick == WALL_AT:
            swarm.simulator.world.add(Circle(scenario.width / 2, scenario.height / 2, 1.0))
        drive(swarm, 1)
        found.poses[view.tick] = view.poses()
        for robot in (0, 7):
            news = found.desk.news(robot)
            found.robots[view.tick, robot] = next(
                encode(each) for each in news if isinstance(each, outgoing.WatchedRobot)
            )
    for command in station.commands():
        for robot in range(ROBOTS):
            try:
                why = put(found.desk, Why, 1, robot, command.id)
            except SleepcastError:
                continue
            assert isinstance(why, msgspec.Struct)
            found.whys[robot, command.id] = encode(why)
    yield found
    past.close()


def values(robot: bytes) -> object:
    """What is known of a robot but for its reports, which the station keeps."""
    return msgspec.structs.replace(msgspec.json.decode(robot, type=outgoing.WatchedRobot), reports=[])


def test_every_moment_is_as_it_was(run: Run) -> None:
    async def look() -> None:
        for tick in (50, 20, 21, 34, 33, 12, 60):
            for robot in (0, 7):
                found = await run.past.look(tick, robot)
                assert found.tick == tick
                assert found.poses == run.poses[tick]
                assert values(found.message) == values(run.robots[tick, robot]), f"{robot} at {tick}"

    asyncio.run(look())


def test_every_robot_says_why_as_it_did(run: Run) -> None:
    assert len(run.whys) > 40

    async def ask() -> None:
        for (robot, command), wanted in run.whys.items():
            assert bytes(await run.past.why(LAST, Why(1, robot, command))) == wanted

    asyncio.run(ask())


def test_who_stands_at_a_moment_sees_it_as_soon_as_it_can_be_run_again(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    early = True

    def check(tick: int) -> None:
        if early:
            raise RerunError("not yet")

    async def stand() -> None:
        nonlocal early
        changed = asyncio.Event()
        exact = ExactMoment(run.past, changed.set)
        assert exact.of(40, -1) is None
        await changed.wait()
        assert (exact.note, exact.of(40, -1)) == ("not yet", None)
        early = False
        while (found := exact.of(40, -1)) is None:
            changed.clear()
            await changed.wait()
        assert (exact.note, found.poses) == ("", run.poses[40])
        exact.leave()

    monkeypatch.setattr(run.past, "check", check)
    monkeypatch.setattr("sleepcast.console.past_view.LOOK_AGAIN", 0.05)
    asyncio.run(stand())


def test_a_command_of_later_was_not_evaluated_yet(run: Run) -> None:
    last = max(run.past.inputs.posted, key=lambda each: each[0] if each[1].kind == "command" else -1)[1]
    with pytest.raises(RerunError, match="was sent later"):
        asyncio.run(run.past.why(5, Why(1, 0, last.id)))


def test_what_would_have_obeyed_then_is_told(run: Run) -> None:
    async def ask() -> Previewed:
        found = await run.past.answer(40, GetPreview(1, "(WHEN (IN chosen_ones) (ST))"))
        return msgspec.json.decode(bytes(found), type=Previewed)

    found = asyncio.run(ask())
    assert found.counted
    assert found.yes + found.no == ROBOTS
    assert found.yes > 0


def test_a_run_that_was_changed_otherwise_is_not_guessed() -> None:
    scenario = find_scenario("crowd", Changes(robots=ROBOTS))
    swarm = swarm_of(scenario, seed=4)
    past = LivePast(SwarmAdapter(swarm), swarm, desk_of(swarm), ManualClock())  # so no state but the first is kept
    drive(swarm, 11)
    swarm.simulator.bodies.place(3, 1.0, 1.0, 0.0)  # as no command does
    drive(swarm, 20)
    with pytest.raises(RerunError, match="not where they were seen from 0:00:01 on"):
        asyncio.run(past.look(25, 0))
    past.close()


def test_no_moment_says_falsely_that_a_robot_received_nothing() -> None:
    """The page said `it did not receive it` of a command that the account knew as answered by all."""
    scenario = find_scenario("bravo", Changes(robots=6))
    swarm = swarm_of(scenario, seed=4)
    station, view, clock = desk_of(swarm), SwarmAdapter(swarm), WallClock()
    swarm.mission.clear()
    past = LivePast(view, swarm, station, clock)
    desk = Backend(view, station, Driver(view, Pace(clock, swarm, 1.0), clock), clock)
    said: dict[str, str] = {}

    async def why(tick: int, command: str) -> str:
        try:
            await past.why(tick, Why(1, 0, command))
        except RerunError as error:
            return str(error)
        return ""

    async def ask() -> None:
        drive(swarm, 5)
        sent = [station.send("(WHEN (> id 0) (JOIN bravo))"), station.ask("id"), station.stop(), station.release()]
        drive(swarm, 1)
        went = swarm.simulator.tick
        while any(each.n_silent for each in sent):
            drive(swarm, 1)
        for tick in range(went, swarm.simulator.tick + 1):
            known = desk.outcomes(sent[0].id, tick * scenario.tick)
            reason = await why(tick, sent[0].id)
            assert reason in ("", f"scout1 had not evaluated this command yet at {clock_time(tick * scenario.tick)}.")
            assert not reason or known[0] == SILENT
        assert [await why(swarm.simulator.tick, each.id) for each in sent[1:]] == [
            "A question is answered with its value and changes nothing: robots keep no explanation of it.",
            "STOP is obeyed as it is heard: there is no expression that robots could explain.",
            "RELEASE is obeyed as it is heard: there is no expression that robots could explain.",
        ]
        late = station.send("(WHEN (> id 0) (JOIN bravo))", deadline=0.01)
        drive(swarm, 10)
        said["late"] = await why(swarm.simulator.tick, late.id)
        # a moment of a tick that is not over
        last = station.send("(WHEN (> id 0) (JOIN bravo))")
        drive(swarm, 1)
        asked = asyncio.ensure_future(why(swarm.simulator.tick + 3, last.id))
        await asyncio.sleep(0.1)
        assert not asked.done()
        drive(swarm, 3)
        assert await asked == ""

    asyncio.run(ask())
    past.close()
    assert "before its deadline" in said["late"]
    assert "did not receive it in time" in said["late"]


def test_who_asks_why_at_once_is_told_no_falsehood() -> None:
    """The command waited for its tick, and the page said that it was never sent, or later than now."""
    swarm = swarm_of(find_scenario("bravo", Changes(robots=6)), seed=4)
    station, view, clock = desk_of(swarm), SwarmAdapter(swarm), WallClock()
    swarm.mission.clear()
    past = LivePast(view, swarm, station, clock)
    desk = Backend(view, station, Driver(view, Pace(clock, swarm, 1.0), clock), clock)
    desk.past = past

    async def ask() -> None:
        drive(swarm, 5)
        sent = station.send("(WHEN (> id 0) (JOIN bravo))", everybody=True)
        found = put(desk, Why, 1, 0, sent.id)
        assert inspect.isawaitable(found)
        asked = asyncio.ensure_future(found)
        await asyncio.sleep(0.1)
        assert not asked.done(), "it is not on the air yet"
        drive(swarm, 1)
        (said,) = await asyncio.gather(asked, return_exceptions=True)
        assert str(said).startswith("scout1 had not evaluated this command yet at ") or b"(JOIN bravo)" in encode(said)
        while sent.n_silent:
            drive(swarm, 1)
        found = put(desk, Why, 2, 0, sent.id)
        assert b"(JOIN bravo)" in encode(await found if inspect.isawaitable(found) else found)

    asyncio.run(ask())
    past.close()


def test_a_tick_that_does_not_end_is_said_to_be_none_of_the_past(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sleepcast.console.past.LOOK", 0.0)
    with pytest.raises(RerunError, match="is not over yet"):
        asyncio.run(run.past.look(LAST + 1, -1))


SEEING = (
    "(WHEN (< id 9) (JOIN bravo))",
    "(RULE steer (PROGN (DEFVAR v 0) (SETQ v (SUM-OVER (n 4m) (* (OF n distance) (OF n heading)))) "
    "(FOR-NEIGHBOURS (n 2m) (SETQ v (+ (/ v 2) (OF n x)))) "
    "(DRIVE (* 0.3 (MIN 1 (SCAN-MIN -30deg 30deg))) (CLAMP (SUM-OVER (n 4m) (OF n bearing)) -1 1))))",
)
ASKED = (
    "(WHEN (> (SUM-OVER (n 4m) (OF n distance)) (SCAN-MIN -45deg 45deg)) "
    '(REPORT "sees" v (COUNT-OVER (n 4m) (OF n bravo)) (BEST-OVER (n 4m) (OF n distance)) (OF (NEAREST_ID 4m) y)))'
)


def test_what_robots_saw_of_neighbours_and_by_scanners_is_played_back(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario, file = tmp_path / "scenario.toml", tmp_path / "run.mcap"
    scenario.write_text(
        SCANNERS.replace("count = 40", "count = 20").replace("[neighbours]", '[neighbours]\nshows_groups = ["bravo"]')
    )
    with sc.open(scenario, seed=2) as fleet, fleet.record(file, pictures=0.5):
        for text in SEEING:
            fleet.send(text, everybody=True)
        fleet.run(1.0)
        sent = fleet.send(ASKED, everybody=True)
        fleet.run(1.0)
        whys = [encode(Explained(1, show_why(fleet.why(name, sent)))) for name in fleet.names]
        assert 0 < sent.account.n_matched < 20
        assert np.isfinite(fleet["v"]).all()
        view = SwarmAdapter(fleet.swarm)
        tick, poses, asked = view.tick, view.poses(), sent.id
        fleet.run(1.0)
    verified = called_here(capsys, "replay", str(file), "--verify", "--json")
    assert verified.status == 0, verified.err
    assert json.loads(verified.out)["verified"] == {"same": True, "compared": 2, "differs_from_tick": None}
    recording = load_recording(file)
    past = RecordedPast(recording, load_timeline(recording))

    async def ask() -> None:
        async with run_again(past):
            assert past.kept.startswith("Kept since")
            assert (await past.look(tick, 0)).poses == poses
            assert [bytes(await past.why(tick, Why(1, robot, asked))) for robot in range(20)] == whys

    asyncio.run(ask())


def there(names: Sequence[str]) -> list[str]:
    return sorted(filter(None, names))


@asynccontextmanager
async def run_again(past: RecordedPast) -> AsyncIterator[None]:
    """The past of a recording once the run has been run again."""
    running = asyncio.create_task(past.live())
    while "being run again" in past.kept:
        await asyncio.sleep(0.01)
    yield
    running.cancel()


def test_robots_have_the_names_of_then_in_the_past_of_a_run() -> None:
    swarm = swarm_of(read_scenario(FLOCK), seed=1)
    view = SwarmAdapter(swarm)
    past = LivePast(view, swarm, desk_of(swarm), WallClock())
    past._every = 2  # so that the moments between are run again
    seen = [view.scene.names]
    for name, text in STEPS:
        swarm.minds[name].evaluate(text)
        swarm.step()
        seen.append(view.scene.names)
    assert [there(names) for names in seen] == [*THERE]
    for second in (0, 2, 4):
        assert past.timeline.names_at(second) == seen[second]
        (roll,) = (each for each in news_of(past.timeline, second, -1) if isinstance(each, outgoing.Roll))
        assert roll.names == seen[second]
    past.close()


@pytest.mark.parametrize("opened", [0, len(STEPS)], ids=["from the start", "as after a fork"])
def test_a_page_has_the_names_of_the_time_at_which_it_looks(opened: int) -> None:
    swarm = swarm_of(read_scenario(FLOCK), seed=1)
    station, view, clock = desk_of(swarm), SwarmAdapter(swarm), WallClock()
    past = LivePast(view, swarm, station, clock)
    past._every = 1
    pages = []
    for step, (name, text) in enumerate([*STEPS, ("", "")]):
        if step == opened:
            desk = Backend(view, station, Driver(view, Pace(clock, swarm, 1.0), clock), clock, past=past)
            pages.append(SwarmDialogue(desk))
        if name:
            swarm.minds[name].evaluate(text)
            swarm.step()
    (page,) = pages
    shown: list[list[str]] = []

    def hear() -> None:
        told = map(json.loads, page.news())
        shown.extend(there(each["names"]) for each in told if each["type"] == "roll")

    async def look() -> None:
        for second in (0, 3, 1):
            page.answer(ShowMoment(float(second)))
            for _ in range(2):  # what is told again and again must not turn to now
                hear()
        page.leave()
        hear()

    asyncio.run(look())
    assert shown == [[*THERE[0]], [*THERE[3]], [*THERE[1]], [*THERE[-1]]]
    past.close()


def test_a_robot_is_not_taken_for_the_one_that_had_its_place_before(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    with sc.open(FLOCK, seed=1) as fleet, fleet.record(file, pictures=9):
        sent = fleet.send("(WHEN (= id 1) (DIE))", wait=2)
        fleet.run(1)  # a place is free one tick after somebody has left it
        fleet.send("(WHEN (= id 2) (HATCH sheep 1))", wait=2)
        fleet.run(1)
        view, station = SwarmAdapter(fleet.swarm), fleet.swarm.desk
        assert isinstance(station, Station)
        assert view.scene.names[:2] == ("sheep3", "sheep2")
        assert station.outcomes(sent.id, inf, view.scene.names)[:2].tolist() == [SILENT, NOT_MATCHED]
        assert station.outcomes(sent.id, inf, ("sheep1", "sheep2"))[:2].tolist() == [MATCHED, NOT_MATCHED]
        with pytest.raises(NoExplanationError, match="sheep3 was not there yet when this command was sent"):
            fleet.why("sheep3", sent)
        end = view.tick
    recording = load_recording(file)
    past = RecordedPast(recording, load_timeline(recording))

    async def ask() -> None:
        async with run_again(past):
            with pytest.raises(RerunError, match="sheep3 was not there yet when this command was sent"):
                await past.why(end, Why(1, 0, sent.id))
            assert b"id = 2, needed = 1" in bytes(await past.why(end, Why(1, 1, sent.id)))

    asyncio.run(ask())


def test_robots_have_the_names_and_numbers_of_then_in_a_recording(tmp_path: Path) -> None:
    recording = load_recording(flock(tmp_path / "flock.mcap"))
    timeline = load_timeline(recording)
    assert [there(timeline.names_at(second)) for second in range(5)] == [*THERE]
    values = RecordedValues(timeline, lambda: 3.0)
    assert values.names[:4] == ("sheep5", "sheep2", "sheep3", "sheep4")
    assert values.of("id")[0][:4].tolist() == [5.0, 2.0, 3.0, 4.0]
    past = RecordedPast(recording, timeline)
    marked = [(mark.at, mark.kind) for mark in past.marks.all]
    assert marked == [(1.0, "birth"), (2.0, "death"), (3.0, "birth"), (4.0, "death")]
    past.close()


def test_what_is_run_again_tells_who_was_there_in_that_very_tick(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    with sc.open(FLOCK, seed=1) as fleet, fleet.record(file, pictures=9):
        fleet.send("(WHEN (= id 1) (HATCH sheep 1))")
        fleet.run(9)
        names = SwarmAdapter(fleet.swarm).scene.names
    recording = load_recording(file)
    past = RecordedPast(recording, load_timeline(recording))

    async def look() -> None:
        async with run_again(past):
            found = await past.look(6, 2)
            assert there(found.names) == there(names) == ["sheep1", "sheep2", "sheep3"]
            news = {type(each): each for each in news_of(past.timeline, 6.0, 2, found)}
            assert msgspec.to_builtins(news[outgoing.Roll])["names"] == names
            assert outgoing.WatchedRobot in news, "there is no picture of it yet"

    asyncio.run(look())
    past.close()
