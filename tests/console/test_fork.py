"""A run goes on from an earlier moment: the other future stays to be seen, and the first difference is named."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from functools import cache
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import BrowserContext, expect

from console.running import PATIENCE, Page, Program, open_page
from sleepcast.columns.values import Rows
from sleepcast.console.account_table import CommandRow
from sleepcast.console.differences import first_difference
from sleepcast.console.failing import ShownFailing
from sleepcast.console.marks import MAX_MARKS, Marks
from sleepcast.console.snapshots import SnapshotStore
from sleepcast.language.vocabulary import Variable, VariableKind
from sleepcast.loop import Swarm, resume
from sleepcast.loop.snapshots import copy_of
from sleepcast.simulator import Changes, find_scenario
from sleepcast.station import Station
from small_worlds import write
from swarms import desk_of, drive, station_of, swarm_of

expect.set_options(timeout=1000 * PATIENCE)

ALTERNATE = 255


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    folder = tmp_path_factory.mktemp("forked")
    write(folder)
    with Program("run", folder, "--page", "--speed", "5") as started:
        yield started


def time_of(frame: bytes) -> float:
    return float(struct.unpack_from("<d", frame, 16)[0])


def run_to(page: Page, until: float) -> None:
    page.tell("pace", running=True)
    while page.frame()[0] == ALTERNATE or time_of(page.frames[-1]) < until:
        pass


def sampled_after(page: Page, plot: int, time: float) -> dict[str, Any]:
    """What is drawn of a plot, as soon as it has a sample of a later time: a busy machine takes few."""
    return page.ask_until(lambda drawn: max(drawn["columns"][0], default=-1.0) > time, "plotted", number=plot)


def test_a_run_goes_on_from_an_earlier_moment(program: Program) -> None:
    with open_page(program) as page:
        run_to(page, 3.0)
        plot = page.ask("plot", kind="time", x="battery", what="mean")["number"]
        sampled_after(page, plot, 0.0)
        page.ask("send", text="(WHEN (> battery 50%) (JOIN early))")
        page.until("commands", lambda found: bool(found["rows"]) and found["rows"][0]["silent"] == 0)
        then = ceil(time_of(page.frame())) + 1.0
        run_to(page, then + 1.0)
        page.ask("send", text="(WHEN (IN early) (DRIVE 2m/s 0))")
        run_to(page, then + 4.0)
        sampled_after(page, plot, then + 3.0)
        assert page.until("span", lambda found: found["may_fork"])["forked"] is None
        assert page.ask("fork", time=then)["type"] == "renewed"
    with open_page(program) as page:
        span = page.until("span", lambda found: found["forked"] is not None)
        assert (span["forked"], span["difference"]) == (pytest.approx(then), "")
        while page.frame()[0] == ALTERNATE:
            pass
        assert time_of(next(frame for frame in page.frames if frame[0] != ALTERNATE)) == pytest.approx(then)
        rows = page.until("commands", lambda found: bool(found["rows"]))["rows"]
        assert [row["text"] for row in rows] == ["(WHEN (> battery 50%) (JOIN early))"]
        assert rows[0]["matched"] + rows[0]["not_matched"] == 20
        page.ask("send", text="(WHEN (NOT (IN early)) (PROGN (DEFVAR Plan) (SETQ Plan 7)))")
        run_to(page, then + 4.0)
        span = page.until("span", lambda found: found["difference"] != "")
        assert re.search(r"\(tick \d+\): Plan of \S+ is 7, and was unknown before", span["difference"])
        assert then < span["differs"] < then + 1.0
        assert any(frame[0] == ALTERNATE and len(frame) == 8 + 12 * 20 for frame in page.frames)
        drawn = sampled_after(page, plot, then)
        assert drawn["columns"][0][0] < then < drawn["columns"][0][-1]
        assert drawn["earlier"][0][0] <= then < then + 3.0 < drawn["earlier"][0][-1]
        page.tell("look", time=1.0)
        page.until("span", lambda found: found["at"] == 1.0 and found["exact"])
        why = page.ask("why", robot=0, command=rows[0]["id"])
        assert "sent later" in why["reason"]


@pytest.mark.browser
def test_both_futures_are_in_the_plots_and_what_is_saved_of_them(
    program: Program, context: BrowserContext, tmp_path: Path
) -> None:
    with open_page(program) as page:
        page.ask("plot", kind="time", x="(IN late)", what="count")
        end = page.wait_for("span")["ended"]
        run_to(page, end + 2.0)
        page.ask("fork", time=end)
    with open_page(program) as page:
        page.ask("send", text="(WHEN (> id 5) (JOIN late))")
        run_to(page, end + 5.0)
        page.until("span", lambda found: found["differs"] is not None)
        page.tell("pace", running=False)
    screen = context.new_page()
    complaints: list[str] = []
    screen.on("pageerror", lambda error: complaints.append(str(error)))
    screen.goto(program.address)
    screen.locator("#drawer-plots").click()
    card = screen.locator(".plot", has_text="count of (IN late)")
    expect(card.locator(".plot-key")).to_contain_text(
        re.compile(r"this run earlier future · first difference at .* is in late, and was not before")
    )
    expect(card.locator(".plot-told")).to_contain_text(re.compile(r": 15 ·"))

    def saved(kind: str) -> Path:
        with screen.expect_download() as download:
            card.get_by_text(kind, exact=True).click()
        file = tmp_path / kind
        download.value.save_as(file)
        return file

    head, *lines = (line.split(",") for line in saved("CSV").read_text(encoding="utf-8").splitlines())
    assert head == ["time (s)", "count (IN late)", '"count (IN late)', ' earlier future"']
    assert any(now == "15" for _, now, _ in lines)
    assert {then for _, _, then in lines} == {"", "0"}
    drawing = saved("SVG").read_text(encoding="utf-8")
    assert drawing.count('stroke-dasharray="7 4"') == 2
    assert all(text in drawing for text in (">earlier future<", ">first difference<", "is in late, and was not before"))
    assert saved("PNG").read_bytes().startswith(b"\x89PNG")
    assert complaints == []


def test_the_first_difference_names_a_group_a_variable_or_a_place() -> None:
    state = early_state()
    one, other = resume(state), resume(state)
    assert first_difference(one, other) is None
    desk = Station(other.vocabulary, other.minds, other.post, other, epoch=2)
    other.desk = desk
    desk.send("(WHEN (= id 3) (JOIN lonely))", everybody=True)
    one.desk = station_of(one)
    while not other.fleet.members().get("lonely"):
        one.step()
        other.step()
    assert "is not in lonely, and was before" in str(first_difference(one, other))
    moved = resume(state)
    moved.simulator.bodies.place(5, 1.0, 1.0, 0.0)
    found = first_difference(resume(state), moved)
    assert found is not None
    assert found.startswith(f"the true x of {moved.simulator.names[5]} is")


@cache
def early_state() -> bytes:
    swarm = swarm_of(find_scenario("crowd", Changes(robots=12)), seed=4)
    drive(swarm, 15)
    return copy_of(swarm).packed()


def apart(text: str, ours: str = "", ticks: int = 20) -> tuple[str | None, Swarm, Swarm]:
    """The first difference between a run in which this was sent and one in which something else was."""
    state = early_state()
    one, other = resume(state), resume(state)
    for swarm, said in ((one, text), (other, ours)):
        swarm.desk = desk = Station(swarm.vocabulary, swarm.minds, swarm.post, swarm, epoch=2)
        if said:
            desk.send(said, everybody=True)
    for _ in range(ticks):
        one.step()
        other.step()
        found = first_difference(one, other)
        if found is not None:
            return found, one, other
    return None, one, other


def test_the_first_difference_names_a_variable_that_robots_have_learned() -> None:
    found, one, _ = apart("(WHEN (= id 3) (PROGN (DEFVAR Threat) (SETQ Threat 5)))")
    assert found == f"Threat of {one.simulator.names[2]} is 5, and was unknown before"
    both = "(PROGN (DEFVAR Threat) (SETQ Threat (* 2 id)))"
    found, one, _ = apart(both, both.replace("2 id", "3 id"))
    assert found == f"Threat of {one.simulator.names[0]} is 2, and was 3 before; 11 more differ"


def test_the_first_difference_names_what_a_sensor_says() -> None:
    assert apart("")[0] is None
    watching = "(WHEN (= id 2) (RULE look (WHEN (< fuel -1) (MARK))))"
    found, one, other = apart(watching, watching)
    assert found is None
    for swarm, x in ((one, 30.0), (other, 40.0)):
        swarm.simulator.bodies.place(1, x, 20.0, 0.0)
        swarm.step()
    sensor = re.fullmatch(r"(\w+) of (\S+) is (\S+ \S+), and was (\S+ \S+) before", str(first_difference(one, other)))
    assert sensor is not None
    assert sensor[2] == one.simulator.names[1]
    kind = one.vocabulary.bindings[sensor[1].casefold()]
    assert isinstance(kind, Variable)
    assert kind.kind is VariableKind.SENSOR
    other.thought = Rows.run(0, 0)
    unasked = first_difference(one, other)
    assert str(unasked).startswith("the true x of"), "what was measured for one of them only does not count"


def test_a_desk_goes_back_to_what_it_knew() -> None:
    swarm = swarm_of(find_scenario("crowd", Changes(robots=12)), seed=4)
    drive(swarm, 41)
    desk = desk_of(swarm)
    sent = desk.commands()
    before = swarm.now() - 2.0
    desk.go_back(before)
    kept = desk.commands()
    assert 0 < len(kept) < len(sent)
    assert all(command.message.issued < before for command in kept)
    assert all(answer.heard <= before for command in kept for answer in command.answers.values())
    assert max(at for at in desk.roster.values() if at is not None) <= before
    assert desk.send("(WHEN (= id 1) (MARK))").message.sequence > sent[-1].message.sequence


def test_a_command_that_is_not_on_the_air_yet_is_forgotten_too() -> None:
    """A run that goes on from this very moment never gets it: its account would say "silent" of all for ever."""
    swarm = swarm_of(find_scenario("crowd", Changes(robots=12)), seed=4)
    drive(swarm, 3)
    desk = desk_of(swarm)
    known = len(desk.commands())
    desk.send("(WHEN (= id 1) (MARK))")
    desk.go_back(swarm.now())
    assert len(desk.commands()) == known


def test_states_are_thinned_by_their_age() -> None:
    states = SnapshotStore(0.1, 50 * 100)
    for tick in range(0, 300_000, 100):
        states.add(tick, bytes(100))
    assert len(states) == 50
    assert states.size <= 50 * 100
    assert states.first == 0
    assert states.last == 299_900
    ticks = np.array(states._ticks)
    gaps = np.diff(ticks)
    assert gaps[-10:].mean() < gaps[:10].mean() / 2  # what was just now is kept densely
    assert states.before(299_950) == (299_900, bytes(100))
    early = states.until(150_000)
    assert early.last is not None
    assert early.last < 150_000
    assert len(states) == 50


def test_marks_tell_how_many_have_come_and_gone_since_the_last_one() -> None:
    marks = Marks()
    marks.names(1.0, ("wolf1", "", ""))
    marks.names(2.0, ("wolf1", "wolf2", "wolf3"))
    marks.names(2.1, ("", "wolf2", "wolf3"))
    marks.names(2.2, ("wolf4", "", "wolf3"))
    marks.names(2.3, ("wolf4", "wolf5", ""))
    marks.names(9.0, ("wolf4", "wolf5", ""))
    assert [(mark.at, mark.kind, mark.text) for mark in marks.all] == [
        (2.0, "birth", "2 robots came"),
        (2.3, "turnover", "2 robots came, 3 robots gone"),
    ]


def test_marks_tell_what_happened_once() -> None:
    def row(fault: int) -> CommandRow:
        return CommandRow("desk-1.1", "command", "(RULE a\n (/ 1 0))", 2.0, 5, 0, fault, 0, 5)

    marks = Marks()
    marks.rows(2.1, [row(0)])
    marks.groups(3.0, ["bravo"], [0])
    marks.groups(4.0, ["bravo"], [7])
    marks.groups(4.01, ["bravo"], [8])
    marks.rows(5.0, [row(3)])
    marks.rows(6.0, [row(4)])
    rule = ShownFailing("a", 2, 2, "divides by zero")
    marks.failing(6.0, [rule])
    marks.failing(7.0, [rule])
    assert [(mark.kind, mark.at, mark.seen, mark.text) for mark in marks.all] == [
        ("command", 2.0, 2.1, "(RULE a"),
        ("join", 4.0, 4.0, "bravo: 7 robots"),
        ("fault", 5.0, 5.0, "3 robots: fault in (RULE a"),
        ("fault", 6.0, 6.0, "rule a fails on 2 robots: divides by zero"),
    ]
    following = Marks()
    following.take(marks, 4.5)
    assert [mark.kind for mark in following.all] == ["command", "join"]
    for number in range(2 * MAX_MARKS):
        marks.add(10.0 + number, "alert", "(< fuel 20%)")
    assert len(marks.all) == MAX_MARKS
