"""A recording on the page: what it shows at which time, and that nothing can be commanded there."""

from __future__ import annotations

import asyncio
import base64
import re
import struct
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import BrowserContext, expect
from playwright.sync_api import Page as Screen

import forkserver
import sleepcast as sc
from console.asking import put
from console.running import PATIENCE, Page, Program, number, open_page
from console.test_page import until
from sleepcast.console.account_table import MAX_ROWS
from sleepcast.console.adapters.recorded_past import RecordedPast
from sleepcast.console.adapters.recording import load_timeline
from sleepcast.console.driver import FRAME_PERIOD
from sleepcast.console.features.failing import Failed
from sleepcast.console.features.members import Members
from sleepcast.console.outgoing import Failing, Groups, ShownGroup
from sleepcast.console.replay import ReplayBackend, ReplayDriver
from sleepcast.console.timeline import Track
from sleepcast.core.clock import ManualClock
from sleepcast.core.errors import MisuseError
from sleepcast.fleet.failing import RECENT
from sleepcast.simulator.recording.foxglove import read_poses
from sleepcast.simulator.recording.recorder import FAILING
from sleepcast.simulator.recording.recording import entries, load_recording
from small_worlds import write

MISSION = """
@5s (WHEN (> battery 50%) (JOIN full))
@10s (WHEN (IN full) (DRIVE 2m/s 10deg/s) (REPORT "left with" battery) (DEFVAR Plan 7))
@20s (WHEN (IN full) (RULE turn (IF (> x 600m) (ST))))
"""
SECONDS = 60.0

expect.set_options(timeout=1000 * PATIENCE)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recording of a minute in a small world."""
    folder = tmp_path_factory.mktemp("recorded")
    scenario = write(folder)
    scenario.write_text('mission = "mission.sleep"\n' + scenario.read_text(encoding="utf-8"), encoding="utf-8")
    (folder / "mission.sleep").write_text(MISSION, encoding="utf-8")
    command = [sys.executable, "-m", "sleepcast", "run", str(folder), "--record", str(folder / "run.mcap")]
    forkserver.run([*command, "--record-readings", "1"], check=True, capture_output=True)
    return folder / "run.mcap"


@pytest.fixture(scope="module")
def player(file: Path) -> Iterator[Program]:
    with Program("replay", str(file)) as started:
        yield started


@pytest.fixture
def replay(player: Program) -> Program:
    """It stands at its beginning, whatever the test before has left behind."""
    with open_page(player) as page:
        page.tell("pace", running=False, factor=1.0)
        page.tell("seek", time=0.0)
    return player


@pytest.fixture
def page(replay: Program) -> Iterator[Page]:
    with open_page(replay) as found:
        yield found


def at(page: Page, time: float) -> bytes:
    """The frame of a time to which the page has gone."""
    page.tell("seek", time=time)
    if page.frames:
        page.tell("drawn", number=number(page.frames[-1]))
    while struct.unpack_from("<d", frame := page.frame(), 16)[0] != time:
        pass
    return frame


def test_the_page_is_told_how_long_the_recording_is(page: Page) -> None:
    assert page.news["hello"]["recorded"] == SECONDS
    assert page.news["hello"]["count"] == 20


@pytest.mark.parametrize("time", [0.0, 12.0, 60.0, 30.0])
def test_a_frame_shows_where_the_robots_were(page: Page, file: Path, time: float) -> None:
    recording = load_recording(file)
    (wanted,) = (e.data for e in entries(file, recording) if e.topic == "/poses" and e.time == time)
    frame = at(page, time)
    assert struct.unpack_from("<I", frame, 12)[0] == round(time / 0.1)
    found = np.frombuffer(frame, "<f4", 60, 32).reshape(20, 3)
    np.testing.assert_array_equal(found, read_poses(wanted, 20))


def test_groups_accounts_and_a_robot_are_as_they_were_then(page: Page) -> None:
    at(page, 3.0)
    page.until("commands", lambda found: found["rows"] == [])
    assert bytes(at(page, 3.0)[32 + 12 * 20 :]) == bytes(40)
    frame = at(page, 30.0)
    rows = page.until("commands", lambda found: len(found["rows"]) == 3)["rows"]
    assert [row["at"] for row in rows] == [5.0, 10.0, 20.0]
    matched = rows[0]["matched"]
    assert 0 < matched < 20
    assert rows[0]["matched"] + rows[0]["not_matched"] == 20
    groups = frame[32 + 12 * 20 : 32 + 13 * 20]
    assert groups.count(1) == matched
    page.until("groups", lambda found: [each["count"] for each in found["groups"]] == [matched])
    page.tell("watch", robot=groups.index(1))
    told = page.wait_for("robot", lambda found: bool(found["rules"]))
    assert told["groups"] == ["full"]
    assert told["rules"][0]["text"] == "(IF (> x 600m) (ST))"
    assert told["said"][-1]["text"].startswith("left with: ")
    assert {value["name"] for value in told["values"]} >= {"x", "y", "battery"}
    at(page, 3.0)
    page.wait_for("robot", lambda found: found["groups"] == [] and found["rules"] == [] and found["said"] == [])


def test_a_picture_that_comes_late_delays_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "run.mcap"
    with sc.open("shepherding", seed=1) as fleet, fleet.record(file, pictures=1.0):
        fleet.run(5)
    clock = ManualClock()
    driver = ReplayDriver(load_timeline(load_recording(file)), clock)
    driver.set_pace(factor=1.0)

    async def wake_late(seconds: float) -> None:
        clock.advance(max(0.0, seconds) + 0.003)
        if clock.now() > 4.0:
            raise EOFError

    monkeypatch.setattr("sleepcast.console.replay.asyncio.sleep", wake_late)
    with pytest.raises(EOFError):
        asyncio.run(driver.run())
    assert driver.number == pytest.approx(4.0 / FRAME_PERIOD, abs=2.0)


def test_second_groups_and_colours_are_recorded(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    with sc.open("shepherding", seed=1) as fleet, fleet.record(file, pictures=1.0):
        fleet.send("(WHEN (<= id 2) (JOIN a) (COLOUR 5))")
        fleet.send("(WHEN (= id 1) (JOIN b))")
        fleet.run(5)
    timeline = load_timeline(load_recording(file))
    desk = ReplayBackend(timeline, ReplayDriver(timeline, ManualClock()))
    desk.seek(timeline.seconds)
    marks = timeline.marks_at(timeline.seconds)
    assert (marks.groups[:3], marks.second[:3], marks.colours[:3]) == (b"\2\1\0", b"\1\0\0", b"\5\5\0")
    assert desk.driver.frame[2] == 6  # both columns are in the frame
    assert desk.driver.frame.endswith(marks.second + marks.colours)
    assert [put(desk, Members, 1, code).members[:3] for code in (1, 2, 3)] == [b"\1\1\0", b"\1\0\0", b"\0\0\0"]
    told = {type(said).__name__: said for said in desk.news(0)}
    assert told["Groups"] == Groups([ShownGroup("a", 2, 1), ShownGroup("b", 1, 1)])
    assert told["WatchedRobot"].groups == ["a", "b"]  # type: ignore[attr-defined]


def test_rules_that_fail_are_recorded_once_for_each_change(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    with sc.open("shepherding", seed=1) as fleet, fleet.record(file, pictures=0.5):
        fleet.send("(WHEN (<= id 2) (RULE guard (/ 1 (- (MOD tick 4) 2))))")  # fails in every fourth tick
        fleet.run(6)
        fleet.send("(WHEN (= id 2) (FORGET guard))")
        fleet.run(4)
    recording = load_recording(file)
    assert len([entry for entry in entries(file, recording) if entry.topic == FAILING]) == 2
    timeline = load_timeline(recording)
    desk = ReplayBackend(timeline, ReplayDriver(timeline, ManualClock()))

    def told(time: float) -> list[tuple[str, int]]:
        desk.seek(time)
        (found,) = (said for said in desk.news(-1) if isinstance(said, Failing))
        assert found.recent == RECENT * timeline.speed
        return [(each.rule, each.robots) for each in found.rules]

    assert (told(0.0), told(4.0)) == ([], [("guard", 2)])
    assert put(desk, Failed, 1, "Guard").outcomes[:4] == b"\1\1\0\0"
    assert told(10.0) == [("guard", 1)]
    assert put(desk, Failed, 1, "").outcomes[:4] == b"\1\0\0\0"
    past = RecordedPast(recording, timeline)
    past.close()
    (mark,) = (mark for mark in past.marks.all if mark.kind == "fault")
    assert mark.text.startswith("rule guard fails on 2 robots: division by zero")
    timeline.failures = Track()  # a recording of before this was recorded
    assert told(4.0) == []
    with pytest.raises(MisuseError, match="does not fail on any robot at this time"):
        put(desk, Failed, 1, "guard")


@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        ("send", {"text": "(ST)", "everybody": True}),
        ("preview", {"text": "(ST)"}),
        ("outcomes", {"command": "desk-1.1"}),
    ],
)
def test_a_recording_takes_no_commands(page: Page, kind: str, fields: dict[str, object]) -> None:
    answer = page.ask(kind, **fields)
    assert answer["type"] == "refused"
    assert "recording" in answer["reason"]


def test_a_robot_of_a_recording_says_why(page: Page) -> None:
    frame = at(page, 30.0)
    groups = frame[32 + 12 * 20 : 32 + 13 * 20]
    page.until("span", lambda found: bool(found["kept"].startswith("Kept")))
    for robot, matched in ((groups.index(1), True), (groups.index(0), False)):
        why = page.ask("why", robot=robot, command="desk-1.1")["why"]
        assert why["matched"] is matched
        assert ("battery" in why["reason"]) is not matched
    at(page, 3.0)
    assert "sent later" in page.ask("why", robot=0, command="desk-1.1")["reason"]


def test_a_moment_between_two_pictures_is_found_by_running_again(page: Page, file: Path) -> None:
    at(page, 10.5)
    page.tell("watch", robot=3)
    told = page.until("robot", lambda found: "drive_speed" in {value["name"] for value in found["values"]})
    assert told["robot"] == 3
    while struct.unpack_from("<I", page.frames[-1], 12)[0] != 105:
        page.frame()
    recording = load_recording(file)
    (before,) = (e.data for e in entries(file, recording) if e.topic == "/poses" and e.time == 10.0)
    found = np.frombuffer(page.frames[-1], "<f4", 60, 32).reshape(20, 3)
    assert not np.array_equal(found, read_poses(before, 20))


def test_stepping_goes_from_picture_to_picture(page: Page) -> None:
    at(page, 10.5)
    page.tell("step")
    while (time := struct.unpack_from("<d", page.frame(), 16)[0]) == 10.5:
        pass  # the picture is drawn again when it is known exactly
    assert time == 11.0


def test_playing_stops_at_the_end_and_begins_anew(page: Page) -> None:
    at(page, 59.0)
    page.tell("pace", running=True, factor=10.0)
    while struct.unpack_from("<d", frame := page.frame(), 16)[0] < SECONDS or frame[1] & 1:
        pass
    page.tell("pace", running=True)
    while struct.unpack_from("<d", page.frame(), 16)[0] > 30.0:
        pass


def test_a_living_swarm_cannot_be_put_back(program: Program) -> None:
    with open_page(program) as live:
        live.tell("seek", time=1.0)
        while not live.refused:
            live.receive()
    assert "record the run" in live.refused[0]


@pytest.fixture
def screen(replay: Program, context: BrowserContext) -> Iterator[Screen]:
    found = context.new_page()
    complaints: list[str] = []
    found.on("console", lambda said: complaints.append(said.text) if said.type in ("error", "warning") else None)
    found.on("pageerror", lambda error: complaints.append(str(error)))
    found.goto(replay.address)
    expect(found.locator("#scrub")).to_be_visible()
    yield found
    assert not complaints, complaints


def rows(page: Page, *columns: str, **how: object) -> dict[str, Any]:
    """The table at the time of the last frame."""
    return page.ask("rows", columns=list(columns), count=30, again=True, **how)


def test_the_table_shows_what_was_recorded_at_that_time(page: Page) -> None:
    at(page, 0.0)
    assert {row[1] for row in rows(page, "x")["rows"]} == {""}
    at(page, 20.0)
    found = rows(page, "x", "battery", "(DIST x y 500m 400m)", "(IN full)", where="(> battery 50%)", sort=1)
    assert [column["problem"] for column in found["columns"]] == [""] * 4
    assert 0 < found["total"] < 20
    levels = [float(row[2][1].removesuffix(" %")) for row in found["rows"]]
    assert levels == sorted(levels)
    assert levels[0] > 50.0
    assert {row[1] for row in found["rows"]} == {"full"}
    assert {row[2][3] for row in found["rows"]} == {"1"}
    assert found["source"] == "recorded at 0:00:20"
    names = {name["name"]: name["range"] for name in page.ask("names")["names"]}
    assert (names["battery"][-2:], names["full"]) == (" %", f"{found['total']} robots")
    (wrong,) = rows(page, "Plan")["columns"]
    assert "Plan" in wrong["problem"]
    assert "is found by running it again" in wrong["problem"]


def test_robots_that_are_selected_have_a_test(page: Page) -> None:
    at(page, 20.0)
    robots = {row[0] for row in rows(page, "x", where="(> battery 50%)")["rows"]}
    assert 0 < len(robots) < 20
    marks = sum(1 << robot for robot in robots).to_bytes(3, "little")
    found = page.ask("pick", marks=base64.b64encode(marks).decode())
    assert (found["type"], found["count"], found["sentence"]) == ("picked", len(robots), "")
    assert "(IN full)" in found["tests"]
    for test in found["tests"]:
        assert {row[0] for row in rows(page, "x", where=test)["rows"]} == robots


def test_alerts_watch_a_recording(page: Page) -> None:
    at(page, 20.0)
    assert page.ask("addalert", text="(> time 30s)", above=3)["type"] == "alerted"
    page.until("alerts", lambda said: bool(said["alerts"]) and said["alerts"][0]["count"] == 0)
    at(page, 40.0)
    said = page.until("alerts", lambda said: bool(said["firings"]))
    (firing,) = said["firings"]
    assert (firing["at"], firing["count"]) == (40.0, 20)
    assert base64.b64decode(page.ask("fired", firing=firing["firing"])["marks"]) == b"\1" * 20
    at(page, 20.0)
    page.until("alerts", lambda said: said["alerts"][0]["count"] == 0)
    at(page, 50.0)
    page.until("alerts", lambda said: len(said["firings"]) == 2)
    page.ask("removealert", alert=said["alerts"][0]["alert"])


def plotted(page: Page, number: int) -> dict[str, Any]:
    """A plot that has come whole; some of it is there at once."""

    def whole(found: dict[str, Any]) -> bool:
        assert found["columns"][0]
        return not found["more"]

    return page.ask_until(whole, "plotted", number=number)


def test_a_plot_of_a_recording_shows_all_of_it(page: Page) -> None:
    at(page, 30.0)
    number = page.ask("plot", kind="time", x="battery", what="mean")["number"]
    found = plotted(page, number)
    times, mean = found["columns"]
    assert (times[0], times[-1], times) == (0.0, SECONDS, sorted(times))
    assert mean[0] > mean[-1] > 0.0  # rovers drive, which takes charge
    counted = page.ask("plot", kind="time", x="(IN full)", what="count")["number"]
    found = plotted(page, counted)
    members = dict(zip(*found["columns"], strict=True))
    assert {count for time, count in members.items() if time < 4.9} == {0.0}
    assert {count for time, count in members.items() if time > 6.0} == {max(members.values())} != {0.0}
    assert found["told"] == "256 moments, as recorded"
    page.ask("unplot", number=counted)
    (shown,) = page.until("plots", lambda said: len(said["plots"]) == 1)["plots"]
    assert shown["units"] == ["s", "%"]
    page.ask("unplot", number=number)


def test_what_was_not_recorded_is_plotted_by_running_again(page: Page) -> None:
    page.until("span", lambda found: bool(found["kept"].startswith("Kept")))
    number = page.ask("plot", kind="time", x="(+ Plan 1)", what="max", where="(IN full)")["number"]

    def enough(found: dict[str, Any]) -> bool:
        """All 64 moments take some seconds."""
        known = len(found["columns"][0]) >= 9
        assert known or found["more"]
        return known

    found = page.ask_until(enough, "plotted", number=number)
    assert (found["told"], found["problem"]) == (f"{len(found['columns'][0])} moments, run again", "")
    planned = dict(zip(*found["columns"], strict=True))
    assert {value for time, value in planned.items() if time < 9.9} == {None}
    assert {value for time, value in planned.items() if time > 11.0} == {8.0}
    page.ask("unplot", number=number)
    refused = page.ask("plot", kind="histogram", x="Plan")
    assert "in a plot over time" in refused["reason"]
    refused = page.ask("plot", kind="time", x="Plam", what="mean")
    assert (refused["type"], "did you mean Plan?" in refused["reason"]) == ("refused", True)


@pytest.mark.browser
def test_the_slider_reaches_the_end_of_a_recording_of_any_length(
    file: Path, tmp_path: Path, context: BrowserContext
) -> None:
    short = tmp_path / "short.mcap"  # 2.2 s: two hundred steps of 0.011 s would end beyond
    command = [sys.executable, "-m", "sleepcast", "run", str(file.parent), "--seconds", "2.2", "--record", str(short)]
    forkserver.run(command, check=True, capture_output=True)
    with Program("replay", str(short)) as program:
        page = context.new_page()
        times: list[float] = []

        def take(payload: str | bytes) -> None:
            if isinstance(payload, bytes):
                times.append(struct.unpack_from("<d", payload, 16)[0])

        page.on("websocket", lambda socket: socket.on("framereceived", take))
        page.goto(program.address)
        expect(page.locator("#scrub")).to_be_visible()  # before that, keys are for nothing
        page.locator("#run").click()
        page.locator("#scrub").focus()

        def reached(key: str, time: float) -> bool:
            page.keyboard.press(key)  # again, if the page was not ready for it
            return times[-1:] == [time]

        for key, time in (("Home", 0.0), ("End", 2.2)):
            until(page, lambda key=key, time=time: reached(key, time))  # type: ignore[misc]


MANY = 60
"""Commands of a mission: more than a page shows at one time."""


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    """The recording of a minute with a command every 0.9 s."""
    folder = tmp_path_factory.mktemp("many")
    scenario = write(folder)
    scenario.write_text('mission = "mission.sleep"\n' + scenario.read_text(encoding="utf-8"), encoding="utf-8")
    lines = [
        f"@{0.9 * number:.1f}s (WHEN (> battery {number + 20}%) (JOIN g{number}))" for number in range(1, MANY + 1)
    ]
    (folder / "mission.sleep").write_text("\n".join(lines), encoding="utf-8")
    command = [sys.executable, "-m", "sleepcast", "run", str(folder), "--record", str(folder / "run.mcap")]
    forkserver.run(command, check=True, capture_output=True)
    with Program("replay", str(folder / "run.mcap")) as started:
        yield started


def test_no_account_is_forgotten_again(many: Program) -> None:
    with open_page(many) as page:
        page.tell("pace", running=False)
        at(page, SECONDS)
        rows = page.until("commands", lambda found: bool(found["rows"]) and found["rows"][-1]["at"] == 54.0)["rows"]
        assert len(rows) == MAX_ROWS
        assert [row["text"] for row in rows if row["matched"] + row["not_matched"] != 20] == []


@pytest.mark.browser
def test_the_newest_command_is_at_the_top_wherever_one_comes_from(many: Program, context: BrowserContext) -> None:
    page = context.new_page()
    page.goto(many.address)
    lines = page.locator("#commands tr")
    expect(page.locator("#scrub")).to_be_visible()  # before that, keys are for nothing
    page.locator("#scrub").focus()
    for key, time, newest, oldest in (
        ("End", "0:01:00", 60, 11),
        ("PageDown", "0:00:54", 60, 11),
        ("PageDown", "0:00:48", 53, 4),
        ("PageDown", "0:00:42", 46, 1),
    ):
        page.keyboard.press(key)
        expect(page.locator("#clock")).to_have_text(time)
        expect(page.locator("#scrub")).to_have_attribute("aria-valuetext", time)
        expect(lines.first).to_contain_text(f"g{newest})")
        expect(lines.last).to_contain_text(f"g{oldest})")
    numbers = [int(re.findall(r"g(\d+)", text)[0]) for text in lines.all_inner_texts()]
    assert numbers == sorted(numbers, reverse=True)
    expect(lines.first).to_have_attribute("tabindex", "0")  # the keyboard reaches it


@pytest.mark.browser
def test_a_legend_of_many_groups_stays_on_the_map(many: Program, context: BrowserContext) -> None:
    page = context.new_page()
    page.set_viewport_size({"width": 390, "height": 700})
    page.goto(many.address)
    expect(page.locator("#scrub")).to_be_visible()  # before that, keys are for nothing
    page.locator("#scrub").focus()
    page.keyboard.press("End")
    expect(page.locator("#legend li")).to_have_count(27)
    page.locator("#legend-fold").click()
    legend, scale = page.locator("#legend").bounding_box(), page.locator("#scale-text").bounding_box()
    assert legend is not None
    assert scale is not None
    assert legend["y"] + legend["height"] <= scale["y"]

    def scrolled() -> bool:
        page.locator("#legend").hover()
        page.mouse.wheel(0, 100)
        return bool(page.locator("#legend").evaluate("legend => legend.scrollTop > 0"))

    until(page, scrolled)


@pytest.mark.browser
def test_the_slider_goes_to_any_time_and_is_reached_by_keys(screen: Screen) -> None:
    clock, slider = screen.locator("#clock"), screen.locator("#scrub")
    slider.focus()
    screen.keyboard.press("End")
    expect(clock).to_have_text("0:01:00")
    expect(screen.locator("#run")).to_have_attribute("data-running", "false")
    expect(screen.locator("#commands tr")).to_have_count(3)
    screen.keyboard.press("Home")
    expect(clock).to_have_text("0:00:00")
    expect(screen.locator("#commands tr")).to_have_count(0)
    for key, time in [
        ("PageUp", "0:00:06"),
        ("PageUp", "0:00:12"),
        ("ArrowLeft", "0:00:11"),
        ("ArrowRight", "0:00:12"),
    ]:
        screen.keyboard.press(key)
        expect(clock).to_have_text(time)
        expect(slider).to_have_attribute("aria-valuetext", time)
    screen.keyboard.press("Home")
    screen.locator("#run").click()
    expect(clock).to_have_text(re.compile(r"0:00:0[2-9]|0:00:[1-5]\d|0:01:00"))  # time goes on
    screen.keyboard.press("Control+Space")
    expect(screen.locator("#run")).to_have_attribute("data-running", "false")


@pytest.mark.browser
def test_what_commands_a_swarm_is_not_there(screen: Screen) -> None:
    expect(screen.locator("#recorded")).to_be_visible()
    for name in ("#stop", "#text", "#send"):
        expect(screen.locator(name)).to_be_hidden()


@pytest.mark.browser
def test_on_a_narrow_screen_the_slider_has_a_line_of_its_own(screen: Screen) -> None:
    screen.set_viewport_size({"width": 390, "height": 800})
    slider = screen.locator("#scrub").bounding_box()
    assert slider is not None
    assert slider["width"] > 330
    assert screen.evaluate("document.documentElement.scrollWidth") <= 390
