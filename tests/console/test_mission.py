"""The mission on the page: the run plays it, all pages show it, and what is doubted waits for somebody."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import BrowserContext, expect

from console.running import PATIENCE, Page, Program, open_page
from sleepcast.api.assembly import assemble, assemble_from
from sleepcast.console.account_table import MAX_ROWS, AccountTable
from sleepcast.console.adapters.mission import SwarmMission
from sleepcast.console.adapters.swarm import SwarmAdapter
from sleepcast.console.backend import Backend
from sleepcast.console.driver import Driver
from sleepcast.console.features.mission import MissionNews, shown_mission
from sleepcast.core.clock import WallClock
from sleepcast.core.errors import MisuseError
from sleepcast.experiments.acceptance import read_test, run_test
from sleepcast.loop import Pace, Swarm, snapshot
from sleepcast.simulator import find_scenario
from sleepcast.station import Station
from sleepcast.station.validation import DoubtError
from small_worlds import write

expect.set_options(timeout=1000 * PATIENCE)

SCRIPT = """\
@0.5s (WHEN (> battery 60%) (JOIN crew))
= matched at least 1, not matched 20
@1s   within 3s (WHEN (IN crew) (GOTO 1m 1m))
@2s   STOP
@3s   RELEASE
@4s   ask battery
"""
DOUBTED = "@0.5s (JOIN crew)\n@1s (WHEN (> batery 1) (ST))\n@1.5s (WHEN (IN crew) (ST))\n"


def scenario_of(folder: Path, script: str = SCRIPT) -> Path:
    write(folder, ('seconds = "1min"', 'seconds = "1min"\nmission = "work.sleep"'))
    (folder / "work.sleep").write_text(script, encoding="utf-8")
    return folder


class Stand:
    """A swarm with its desk, and who plays its mission."""

    def __init__(self, swarm: Swarm, station: Station) -> None:
        self.swarm, self.station = swarm, station
        self.swarm.send_initial_telemetry()
        self.mission = SwarmMission(swarm, station)
        self.held = 0
        self.mission.hold = self._hold
        self._table = AccountTable(station, SwarmAdapter(swarm))

    @classmethod
    def of(cls, folder: Path, script: str = SCRIPT) -> Stand:
        return cls(*assemble(find_scenario(str(scenario_of(folder, script))), None, mission=False, threads=1))

    def _hold(self) -> None:
        self.held += 1

    def run(self, seconds: float) -> Stand:
        self.swarm.run(seconds)
        return self

    @property
    def sent(self) -> list[str]:
        return [command.text for command in self.station.commands()]

    def shown(self, time: float = float("inf")) -> list[tuple[bool, list[bool]]]:
        rows = {row.id: row for row in self._table.rows()}
        lines = shown_mission(self.mission, rows, time).lines
        return [(line.sent is not None, [wanted.met for wanted in line.wanted]) for line in lines]


def desk_of(stand: Stand) -> Backend:
    seen, clock = SwarmAdapter(stand.swarm), WallClock()
    driver = Driver(seen, Pace(clock, stand.swarm, 1.0), clock)
    return Backend(seen, stand.station, driver, clock, mission=stand.mission)


def test_it_is_sent_at_its_times_and_says_what_became_of_it(tmp_path: Path) -> None:
    stand = Stand.of(tmp_path).run(1)
    assert (stand.sent, stand.mission.playing) == ([], False)
    assert stand.mission.play() == "Of 1 command the time has passed: sent at once."
    assert stand.mission.play() == ""  # from another page: once is enough
    stand.run(0.1)
    assert len(stand.sent) == 2
    stand.run(0.3)
    assert stand.shown()[:3] == [(True, [True, False]), (True, []), (False, [])]
    assert stand.shown(0.9)[0] == (False, [False, False])  # for who looks at the past
    stand.run(3)
    assert [text or "-" for text in stand.sent][2:] == ["STOP", "RELEASE", "battery"]  # its own STOP does not end it
    assert not stand.mission.playing
    with pytest.raises(MisuseError, match="All commands of the mission were sent"):
        stand.mission.play()


def test_from_the_start_it_leads_where_a_run_without_a_page_leads(tmp_path: Path) -> None:
    stand = Stand.of(tmp_path)
    stand.mission.play()
    other, _ = assemble(find_scenario(str(tmp_path)), None, mission=True, threads=1)
    other.run(5)
    assert stand.run(5).swarm.simulator.state_hash() == other.simulator.state_hash()


def test_a_stop_by_hand_ends_it_and_the_rest_waits(tmp_path: Path) -> None:
    stand = Stand.of(tmp_path)
    stand.mission.play()
    stand.run(0.9)
    stand.station.stop()  # by a program, say
    stand.run(3)
    assert (stand.sent[1:], stand.mission.playing) == (["STOP"], False)
    assert "STOP ended it" in stand.mission.message
    stand.station.release()
    stand.run(0.2)
    stand.mission.play()
    stand.run(2)
    assert stand.sent[3:] == ["(WHEN (IN crew) (GOTO 1m 1m))", "STOP", "RELEASE", "battery"]


def test_what_is_doubted_waits_for_somebody(tmp_path: Path) -> None:
    stand = Stand.of(tmp_path, DOUBTED)
    stand.mission.play()
    stand.run(3)
    assert (len(stand.sent), stand.held, stand.mission.problem, stand.mission.doubt) == (1, 1, 1, True)
    assert "no robot has batery" in stand.mission.message
    with pytest.raises(DoubtError):
        stand.mission.send(1, confirmed=False, again=False)
    stand.mission.send(1, confirmed=True, again=False)
    stand.run(0.1)
    assert (len(stand.sent), stand.mission.problem, stand.held) == (3, -1, 1)
    with pytest.raises(MisuseError, match="sent already"):  # two pages pressed Send
        stand.mission.send(1, confirmed=True, again=False)
    stand.mission.send(1, confirmed=True, again=True)
    assert len(stand.sent) == 4


def test_a_stop_while_it_waits_for_somebody_ends_it_too(tmp_path: Path) -> None:
    stand = Stand.of(tmp_path, f"{DOUBTED}@2s RELEASE\n")
    stand.mission.play()
    stand.run(2)
    stand.station.stop()  # by a program
    stand.run(0.2)
    stand.mission.skip(1)
    stand.run(1)
    assert (len(stand.sent), stand.mission.playing, bool(stand.swarm.fleet.stopped.all())) == (2, False, True)
    assert "STOP ended it" in stand.mission.message


def test_a_stop_ends_what_a_snapshot_brings_along(tmp_path: Path) -> None:
    stand = Stand.of(tmp_path)
    stand.mission.play()
    other = Stand(*assemble_from(snapshot(stand.run(2.5).swarm), None, 1))
    other.station.stop()
    other.run(2)
    assert (other.mission.playing, bool(other.swarm.fleet.stopped.all())) == (False, True)
    assert "STOP ended it" in other.mission.message


def test_it_is_not_played_under_a_stop_before_its_own(tmp_path: Path) -> None:
    stand = Stand.of(tmp_path)
    stand.station.stop()
    stand.mission.send(2, confirmed=False, again=False)  # its own, on top of that
    with pytest.raises(MisuseError, match="STOP holds"):
        stand.mission.play()


def test_somebody_may_go_on_without_it(tmp_path: Path) -> None:
    stand = Stand.of(tmp_path, DOUBTED)
    stand.mission.play()
    stand.run(2)
    stand.mission.skip(1)
    stand.run(0.1)
    assert [text.split()[-1] for text in stand.sent] == ["crew)", "(ST))"]
    assert stand.mission.left_out == {1}
    with pytest.raises(MisuseError, match="number 8"):
        stand.mission.skip(7)


def test_what_a_person_sends_counts(tmp_path: Path) -> None:
    stand = Stand.of(tmp_path)
    stand.mission.play()
    stand.station.send("(WHEN (> battery 60%)\n  (JOIN crew))")
    stand.mission.send(1, confirmed=False, again=False)
    stand.run(1.5)
    assert len(stand.sent) == 2


def test_a_snapshot_goes_on_with_it(tmp_path: Path) -> None:
    stand = Stand.of(tmp_path)
    stand.mission.play()
    other = Stand(*assemble_from(snapshot(stand.run(1.5).swarm), None, 1))
    assert other.mission.playing
    assert other.shown()[:3] == [(True, [True, False]), (True, []), (False, [])]
    assert other.run(4).sent[2:] == ["STOP", "RELEASE", "battery"]
    assert all(sent for sent, _ in other.shown())


def test_what_a_snapshot_brings_along_waits_for_somebody_too(tmp_path: Path) -> None:
    stand = Stand.of(tmp_path, "@0.5s (JOIN crew)\n@1s (JOIN first)\n")
    stand.mission.play()
    data = snapshot(stand.run(0.7).swarm)
    scenario = stand.swarm.simulator.scenario
    other = Stand(*assemble_from(data, None, 1))
    other.swarm.mission[0] = replace(scenario.mission[1], text="(SETQ x 1)")  # what no robot can run
    other.run(2)
    assert (len(other.sent), other.held, other.mission.playing) == (1, 1, False)
    assert "x" in other.mission.message


def test_what_was_left_out_may_be_sent_after_all_and_what_was_sent_is_not_left_out(tmp_path: Path) -> None:
    stand = Stand.of(tmp_path, DOUBTED)
    stand.mission.skip(1)
    stand.mission.send(1, confirmed=True, again=False)
    assert not stand.mission.left_out
    with pytest.raises(MisuseError, match="It was sent, at"):  # another page went on without it
        stand.mission.skip(1)


def test_equal_commands_at_one_time_are_each_sent_once(tmp_path: Path) -> None:
    stand = Stand.of(tmp_path, "@0.5s (JOIN crew)\n@0.5s (JOIN crew)\n@0.5s (JOIN crew)\n")
    stand.mission.skip(0)
    stand.mission.play()
    stand.mission.send(1, confirmed=False, again=False)
    stand.run(1)
    assert (len(stand.sent), [sent for sent, _ in stand.shown()]) == (2, [False, True, True])


def test_it_is_not_played_while_a_stop_by_hand_holds(tmp_path: Path) -> None:
    stand = Stand.of(tmp_path)
    stand.station.stop()  # on one page, while another one plays the mission, which has a RELEASE
    with pytest.raises(MisuseError, match="STOP holds"):
        stand.mission.play()
    stand.station.release()
    stand.mission.play()
    stand.run(2.5)
    stand.mission.halt("")
    stand.mission.play()  # its own STOP does not hinder it
    assert len(stand.run(3).sent) == 7


def test_a_fork_goes_on_with_what_was_sent_before(tmp_path: Path) -> None:
    stand = Stand.of(tmp_path)
    stand.run(5).mission.play()  # STOP and RELEASE late, so that nothing but the log knows whose they are
    stand.run(0.5)
    other = Stand(*assemble_from(snapshot(stand.swarm), None, 1))
    assert all(sent for sent, _ in other.shown())


def test_what_somebody_sends_of_a_mission_that_a_snapshot_brings_along_is_not_sent_again(tmp_path: Path) -> None:
    stand = Stand.of(tmp_path, "@0.5s (JOIN crew)\n@1.5s (JOIN first)\n@2s (JOIN last)\n")
    stand.mission.play()
    other = Stand(*assemble_from(snapshot(stand.run(0.7).swarm), None, 1))
    other.station.send("(JOIN first)", everybody=True)
    assert other.run(2).sent == ["(JOIN crew)", "(JOIN first)", "(JOIN last)"]


def test_what_became_of_a_command_is_shown_however_many_came_after_it(tmp_path: Path) -> None:
    stand = Stand.of(tmp_path, "@0s (JOIN crew)\n= matched 20\n" + "@1s (JOIN crew)\n" * MAX_ROWS)
    backend = desk_of(stand)
    stand.mission.play()
    stand.run(2)
    (shown,) = (each for each in backend.news(-1) if isinstance(each, MissionNews))
    assert len(stand.sent) == MAX_ROWS + 1
    assert [(each.met, each.number) for each in shown.lines[0].wanted] == [(True, 20)]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    with Program("run", scenario_of(tmp_path_factory.mktemp("mission")), "--page", "--speed", "10", waits=True) as it:
        yield it


def news(page: Page, sent: int) -> dict[str, Any]:
    return page.until("mission", lambda found: sum(line["sent"] is not None for line in found["lines"]) == sent)


def test_two_pages_of_one_run_and_its_test(program: Program, tmp_path: Path) -> None:
    with open_page(program) as page, open_page(program) as other:
        assert [line["at"] for line in news(page, 0)["lines"]] == [0.5, 1.0, 2.0, 3.0, 4.0]
        assert page.ask("play")["type"] == other.ask("play")["type"] == "played"  # time begins
        for each in (page, other):
            assert not news(each, 5)["playing"]
        page.until("commands", lambda found: len(found["rows"]) == 5 and found["rows"][-1]["matched"] == 20)
        assert [row["text"] for row in page.news["commands"]["rows"]][2:] == ["STOP", "RELEASE", "battery"]
        page.tell("look", time=0.7)
        assert news(page, 1)["lines"][0]["wanted"][0]["text"] == "matched at least 1"
        assert "looks at" in page.ask("play")["reason"]
        page.tell("look")
        draft = page.ask("drafttest")
        wanted = {each["id"]: each["counts"]["matched"] for each in draft["commands"]}
        held = {key: [{"count": "matched", "how": "exactly", "number": number}] for key, number in wanted.items()}
        found = page.ask("savetest", tick=draft["tick"], name="again", held=held, goals=[], exact=True)
    file = tmp_path / "again.zip"
    file.write_bytes(base64.b64decode(found["data"]))
    assert len(read_test(file).orders) == 5
    assert run_test(read_test(file), threads=1).missed == ()


@pytest.mark.browser
def test_a_person_plays_it(context: BrowserContext, tmp_path: Path) -> None:
    with Program("run", scenario_of(tmp_path, DOUBTED), "--page", "--speed", "10", waits=True) as program:
        page = context.new_page()
        page.goto(program.address)
        expect(page.locator("#mission .how-far")).to_have_text("3 commands, none is sent by itself.")
        page.locator("#mission .show-mission").click()
        lines = page.locator(".mission-pane li")
        expect(lines).to_have_count(3)
        lines.nth(0).locator(".text").click()
        expect(page.locator("#text")).to_have_value("(JOIN crew)")
        page.locator("#mission .play-mission").click()
        expect(page.locator("#mission .why")).to_contain_text(
            "Command 2, at 0:00:01, was not sent, and time stands still"
        )
        expect(lines.nth(1)).to_contain_text("waits for you")
        expect(lines.nth(1)).to_have_attribute("aria-current", "step")
        expect(page.get_by_role("button", name="Send: command 2, at 0:00:01")).to_be_visible()
        page.locator("#mission .without").click()
        expect(page.locator("#mission .how-far")).to_have_text("2 of 3 commands sent, the rest is left out.")
        lines.nth(1).locator(".send").click()
        expect(page.locator("#mission .told")).to_contain_text("Press Send once more")
        lines.nth(1).locator(".send").click()
        expect(page.locator("#mission .how-far")).to_have_text("all 3 commands sent.")
        expect(lines.nth(1)).to_have_attribute("class", "sent")
        expect(lines.nth(1)).not_to_contain_text("left out")


TOGETHER = """
[sliders.enough]
value = "10%"
low = "0%"
high = "100%"

[[commands]]
title = "Remember"
text = "(PROGN (DEFVAR far) (SETQ far 500m))"
together = true

[[commands]]
title = "Drive"
text = "(RULE away (GOTO far far))"
needs = 1
together = true

[[commands]]
title = "Stand"
text = "(WHEN (> battery {enough}) (ST))"
"""


@pytest.mark.browser
def test_commands_that_work_only_together_are_sent_at_one_press(context: BrowserContext, tmp_path: Path) -> None:
    write(tmp_path, ('delay = "0s"', 'delay = "0s"\nloss = 0.04'), more=TOGETHER)
    with Program("run", tmp_path, "--page", "--speed", "10", waits=True) as program:
        page = context.new_page()
        page.goto(program.address)
        page.locator("#ready").get_by_text("Stand").click()
        page.get_by_role("slider", name="enough").press("ArrowRight")  # the buttons are made anew
        page.locator("#sort").select_option("ask")  # what stands there, not what is sent now
        page.locator("#ready .all").click()
        expect(page.locator("#commands tr")).to_have_count(4)  # in their order, twice on a radio that loses some
        expect(page.locator("#text")).to_have_value("(WHEN (> battery 11%) (ST))")  # what comes next is not sent
        expect(page.locator("#ready .sent")).to_have_count(2)
        expect(page.locator("#mission")).to_be_hidden()
