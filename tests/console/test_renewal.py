"""Another run on the same page."""

from __future__ import annotations

import asyncio
import re
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import pytest
from playwright.sync_api import BrowserContext, expect

from console.asking import put
from console.running import PATIENCE, Page, Program, open_page
from sleepcast.api.assembly import assemble
from sleepcast.cli.page_runs import Beginning, PageRuns, run_file
from sleepcast.console import registry
from sleepcast.console.adapters.replay_worker import ReplayWorker
from sleepcast.console.adapters.swarm import SwarmAdapter
from sleepcast.console.backend import Backend
from sleepcast.console.connection import encode
from sleepcast.console.driver import Driver
from sleepcast.console.features.alerts import LOOK_EVERY
from sleepcast.console.features.preview import GetPreview
from sleepcast.console.features.renewal import GetSetup, Renew, Renewed, SetUp
from sleepcast.console.features.send import Send
from sleepcast.console.outgoing import Refused
from sleepcast.console.renewal import Note, RunRequest, RunSwitcher, ShownRun
from sleepcast.console.replay_client import Question
from sleepcast.console.swarm_dialogue import SwarmDialogue
from sleepcast.core.clock import WallClock
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.loop import Pace
from sleepcast.loop.snapshots import copy_of
from sleepcast.simulator import Changes, load
from small_worlds import IN_MAZE, SCOUTS, SMALL, write

SLIDER = '\n[sliders.speed]\nkey = "robots.limits.speed"\nlow = "1m/s"\nhigh = "9m/s"\n'
COMMAND = '\n[sliders.level]\nvalue = "60%"\nlow = "0%"\nhigh = "100%"\n[[commands]]\ntitle = "Full"\n' + (
    'text = "(WHEN (> battery {level}) (MARK))"\n'
)
THIRSTY = SMALL.replace('reach = "20km"', 'reach = "1m"').replace('start = ["20%", "100%"]', 'start = ["50%", "100%"]')


def maker_of(folder: Path, text: str = SMALL + SLIDER + COMMAND) -> PageRuns:
    file = write(folder, text=text)
    return PageRuns(Beginning(str(file), None, Changes(), None, 1, None, None), None, None, WallClock())


@contextmanager
def runs_of(maker: PageRuns) -> Iterator[RunSwitcher]:
    with RunSwitcher(maker.make(maker.current, lambda _: None), maker, WallClock(), waits=True) as runs:
        yield runs


def swarm_size(runs: RunSwitcher) -> int:
    return len(runs.desk.hello().scene.names)


class TestWhatMayBeChosen:
    def test_a_scenario_with_its_numbers(self, tmp_path: Path) -> None:
        maker = maker_of(tmp_path)
        home = maker.current.scenario
        offered = {each.name: each.title for each in maker.scenarios()}
        assert offered[home] == "a small world"
        assert offered["bravo"] == "Task Element Bravo"
        choices = maker.choices(home)
        assert (choices.seed, choices.robots, choices.fixed) == ("3", 20, False)
        assert [(each.name, each.value, each.unit) for each in choices.sliders] == [
            ("speed", 5.0, "m/s"),
            ("level", 60.0, "%"),
        ]

    def test_the_numbers_of_the_run_on_the_page(self, tmp_path: Path) -> None:
        maker = maker_of(tmp_path)
        home = maker.current.scenario
        wish = RunRequest(home, 9, 7, {"speed": 2.0, "level": 35.0})
        with maker.make(wish, lambda _: None).around:
            choices = maker.choices(home)
        assert (choices.seed, choices.robots) == ("9", 7)
        assert [each.value for each in choices.sliders] == [2.0, 35.0]

    @pytest.mark.parametrize(
        ("wish", "said"),
        [
            (RunRequest("/etc/passwd"), "no scenario"),
            (RunRequest("", values={"speed": 10.0}), "wanted 1m/s to 9m/s, not 10m/s"),
            (RunRequest("", values={"speed": float("nan")}), "wanted 1m/s to 9m/s"),
            (RunRequest("", values={"colour": 1.0}), 'no slider "colour"'),
            (RunRequest("", robots=5_000_000), "5,000,000 robots are too many"),
            (RunRequest("", seed=10**19 - 1), "wanted a whole number"),
        ],
    )
    def test_nothing_else(self, wish: RunRequest, said: str, tmp_path: Path) -> None:
        maker = maker_of(tmp_path)
        scenario = wish.scenario or maker.current.scenario
        with pytest.raises(SleepcastError, match=re.escape(said)):
            maker.make(RunRequest(scenario, wish.seed, wish.robots, wish.values), lambda _: None)


class TestRenewing:
    def test_another_seed_is_another_maze(self, tmp_path: Path) -> None:
        maker = maker_of(tmp_path, SCOUTS.replace(*IN_MAZE))
        home = maker.current.scenario
        for seed in (3, 4):
            with maker.make(RunRequest(home, seed), lambda _: None).around:
                assert maker.swarm is not None
                wanted = load(Path(home), Changes(seed=seed))
                assert maker.swarm.simulator.scenario.shapes == wanted.shapes

    def test_the_new_run_is_as_wished_and_waits(self, tmp_path: Path) -> None:
        maker = maker_of(tmp_path)
        with runs_of(maker) as runs:
            old = runs.desk
            values = {"speed": 2.0, "level": 35.0}
            asked = Renew(1, maker.current.scenario, "12", 8, values)
            assert asyncio.run(registry.answer(asked, old)) == Renewed(1)
            assert list(old.news(-1)) == [Renewed()]
            assert (runs.number, runs.desk.hello().run, swarm_size(runs)) == (2, 2, 8)
            assert runs.desk.driver.waiting
            assert runs.desk.hello().scene.commands[0].text == "(WHEN (> battery 35%) (MARK))"
            assert any("another world" in said.text for said in runs.desk.news(-1) if isinstance(said, Note))
            found = asyncio.run(put(runs.desk, GetSetup, 2, maker.current.scenario))
            assert isinstance(found, SetUp)
            assert found.choices.seed == "12"

    def test_a_restart_is_the_same_run_to_the_last_bit(self, tmp_path: Path) -> None:
        maker = maker_of(tmp_path)
        with runs_of(maker) as runs:
            hashes = []
            for again in (True, False):
                swarm = maker.swarm
                assert swarm is not None
                swarm.send_initial_telemetry()
                swarm.run(5.0)
                hashes.append(swarm.simulator.state_hash())
                if again:
                    asyncio.run(put(runs.desk, Renew, 1))
            assert hashes[0] == hashes[1]

    def test_alerts_watch_the_new_run_too(self, tmp_path: Path) -> None:
        maker = maker_of(tmp_path)
        with runs_of(maker) as runs:
            said: list[str] = []
            runs.desk.alerts.watch(["marked"], said.append)
            asyncio.run(put(runs.desk, Renew, 1))
            (alert,) = runs.desk.alerts.shown().alerts
            assert (alert.text, alert.count, alert.fired) == ("marked", -1, 0)
            assert maker.swarm is not None
            maker.swarm.send_initial_telemetry()
            runs.desk.alerts.look()
            put(runs.desk, Send, 1, "(WHEN (< id 3) (MARK))", False)
            maker.swarm.run(5.0)
            time.sleep(LOOK_EVERY)
            runs.desk.driver.draw()
            assert said == ["alert at 0:00:05: marked: rover1, rover2"]

    def test_what_cannot_be_built_leaves_the_old_run(self, tmp_path: Path) -> None:
        maker = maker_of(tmp_path)
        with runs_of(maker) as runs:
            runs.desk.driver.set_pace(running=True)
            with pytest.raises(MisuseError, match="no slider"):
                asyncio.run(put(runs.desk, Renew, 1, maker.current.scenario, None, None, {"a": 1.0}))
            assert runs.number == 1
            assert not runs.desk.driver.pace.paused
            assert maker.current.values == {}

    def test_stop_keeps_the_old_run_while_a_new_one_is_built(self, tmp_path: Path) -> None:
        maker = maker_of(tmp_path)
        with runs_of(maker) as runs:
            make = maker.make

            def stopped(request: RunRequest, tell: Callable[[str], None]) -> ShownRun:
                found = make(request, tell)
                runs.desk.stop()
                return found

            maker.make = stopped  # type: ignore[method-assign]
            with pytest.raises(MisuseError, match="STOP was pressed: the new run was not started"):
                asyncio.run(put(runs.desk, Renew, 1))
            assert runs.number == 1
            assert runs.desk.driver.latched

    def test_a_stop_that_is_not_confirmed_keeps_the_old_run(self, tmp_path: Path) -> None:
        maker = maker_of(tmp_path)
        with runs_of(maker) as runs:
            runs.desk.stop()
            with pytest.raises(MisuseError, match="not all robots have confirmed it yet"):
                asyncio.run(put(runs.desk, Renew, 1))
            assert maker.swarm is not None
            maker.swarm.run(3.0)
            asyncio.run(put(runs.desk, Renew, 1))
            assert runs.number == 2
            assert not runs.desk.driver.latched

    def test_a_run_in_which_nobody_can_move_any_more_offers_a_restart(self, tmp_path: Path) -> None:
        maker = maker_of(tmp_path, THIRSTY)
        with runs_of(maker) as runs:
            desk, swarm = runs.desk, maker.swarm
            assert swarm is not None
            put(desk, Send, 1, "(PROGN (WHEN (< id 16) (DRIVE 5m/s 0)) (WHEN (> id 15) (FREEZE)))", True)
            swarm.run(20.0)
            notes = [said for said in desk.news(-1) if isinstance(said, Note)]
            assert notes == [Note("No robot can move any more: 15 have no battery left, and 5 are frozen.", True)]


OPERATORS = "".join(
    f'[operators.{name}]\nrole = "{role}"\n'
    for name, role in {"chief": "commander", "anna": "operator", "bert": "commander"}.items()
)


class TestSeveralOperators:
    def test_each_desk_goes_back_with_a_run_that_goes_on_from_an_earlier_moment(self, tmp_path: Path) -> None:
        maker = maker_of(tmp_path, SMALL + OPERATORS)
        with runs_of(maker) as runs:
            swarm = maker.swarm
            assert swarm is not None
            early = put(runs.desk, Send, 1, "(WHEN (< id 6) (MARK))", by="anna").command
            swarm.run(2.0)
            state = copy_of(swarm).packed()
            swarm.run(0.1)
            late = put(runs.desk, Send, 2, "(WHEN (> id 6) (MARK))", by="anna").command
            put(runs.desk, Send, 3, "(WHEN (> id 9) (MARK))", by="bert")
            swarm.run(2.0)
            forked = maker.fork(runs._run, state)
            assert isinstance(forked.swarm, SwarmAdapter)
            assert forked.past is not None
            chief, anna, bert = forked.swarm.desks
            assert [len(desk.commands()) for desk in (chief, anna, bert)] == [0, 1, 0]
            assert anna.accounting(early).n_matched == 5
            assert [(row.id, row.by) for row in forked.past.timeline.rows.values][-1] == (early, "anna")
            assert anna.send("(WHEN (> id 6) (MARK))").message.sequence > int(late.partition(".")[2])

    def test_a_moment_of_the_past_has_their_desks(self, tmp_path: Path) -> None:
        maker = maker_of(tmp_path, SMALL + OPERATORS)
        with runs_of(maker) as runs:
            assert maker.swarm is not None
            maker.swarm.run(2.0)
            assert runs.desk.past is not None
            asked = encode(GetPreview(1, "(WHEN (< id 6) (MARK))", by="anna"))
            answer = ReplayWorker(lambda: False).answer(Question("answer", runs.desk.past.moment(15), message=asked))
            assert (answer.error, msgspec.json.decode(answer.message or b"{}").get("yes")) == ("", 5)

    def test_a_stop_of_any_of_them_must_be_confirmed_first(self, tmp_path: Path) -> None:
        maker = maker_of(tmp_path, SMALL + OPERATORS)
        with runs_of(maker) as runs:
            runs.desk.stop("bert")
            with pytest.raises(MisuseError, match="not all robots have confirmed it yet"):
                asyncio.run(put(runs.desk, Renew, 1))

    def test_a_rule_that_fails_is_told_of_the_command_that_brought_it(self, tmp_path: Path) -> None:
        maker = maker_of(tmp_path, SMALL + OPERATORS)
        with runs_of(maker) as runs:
            swarm = maker.swarm
            assert swarm is not None
            rule = "(WHEN (> id {}) (RULE odd (SETQ drive_speed (/ 1 0))))"
            brought = {
                by: put(runs.desk, Send, 1, rule.format(id), by=by).command for by, id in (("chief", 0), ("bert", 15))
            }
            swarm.run(2.0)
            refused = put(runs.desk, Send, 1, rule.format(0), by="anna").command
            swarm.run(2.0)
            failing = {row.id: [each.robots for each in row.failing] for row in runs.desk.commands().rows}
            assert failing == {brought["chief"]: [15], brought["bert"]: [5], refused: []}


def frame_of(page: Page, tick: int) -> bytes:
    while struct.unpack_from("<I", frame := page.frame(), 12)[0] < tick:
        pass
    return frame


def test_all_pages_hear_of_it_and_each_run_has_a_recording(tmp_path: Path) -> None:
    write(tmp_path)
    file = tmp_path / "runs.mcap"
    with Program("run", tmp_path, "--page", "--record", file, waits=True) as program:
        with open_page(program) as page, open_page(program) as other:
            page.tell("pace", running=True, factor=10.0)
            frame_of(page, 10)
            answer = page.ask("renew", scenario=str(tmp_path), seed="4", robots=5)
            assert answer["type"] == "renewed"
            other.until("renewed", lambda found: True)
        with open_page(program) as page:
            assert page.news["hello"]["run"] == 2
            assert page.news["hello"]["count"] == 5
            first = page.frame()
            assert struct.unpack_from("<I", first, 12)[0] == 0
            page.tell("pace", running=True, factor=10.0)
            frame_of(page, 10)
    for number in (1, 2):
        assert run_file(file, number).stat().st_size > 1000


def test_a_page_that_nothing_may_follow_says_so(tmp_path: Path) -> None:

    swarm, station = assemble(load(write(tmp_path)), None, mission=False)
    seen, clock = SwarmAdapter(swarm), WallClock()
    desk = Backend(seen, station, Driver(seen, Pace(clock, swarm, 1.0), clock), clock)
    found = SwarmDialogue(desk).answer(Renew(4))
    assert isinstance(found, Refused)
    assert "start it again where it was started" in found.reason


@pytest.mark.browser
def test_a_person_starts_another_run_from_the_bar(context: BrowserContext, tmp_path: Path) -> None:
    expect.set_options(timeout=1000 * PATIENCE)
    with Program("run", write(tmp_path, text=SMALL + SLIDER + COMMAND).parent, "--page", waits=True) as program:
        page = context.new_page()
        page.goto(program.address)
        expect(page.locator("#achieved")).to_have_text("not started")
        page.get_by_role("button", name="Start", exact=True).click()
        expect(page.locator("#achieved")).to_have_text(re.compile("running"))
        page.locator("#text").press("F9")
        expect(page.locator("#stopped-text")).to_have_text("STOP: all 20 robots are at rest.")
        page.locator("#renew").click()
        expect(page.get_by_role("spinbutton", name="Robots")).to_have_value("20")
        page.locator("#new-run").get_by_role("spinbutton", name="Robots").fill("7")
        page.locator("#new-run").get_by_role("slider", name="level").fill("35")
        page.get_by_role("button", name="Start over").click()
        expect(page.locator("#legend")).to_contain_text("7 rovers")
        expect(page.locator("#note-text")).to_contain_text("STOP")
        expect(page.locator("#stopped")).to_be_hidden()
        expect(page.locator("#achieved")).to_have_text("not started")
        expect(page.locator("#text")).to_have_value("(WHEN (> battery 35%) (MARK))")
        assert page.url == f"http://{program.host}/"
