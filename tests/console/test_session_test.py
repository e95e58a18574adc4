"""A session on the page becomes a test, which a process of its own repeats."""

from __future__ import annotations

import base64
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, expect

import forkserver
from console.running import PATIENCE, Page, Program, open_page
from console.test_page import opened
from sleepcast.core.errors import MisuseError
from sleepcast.experiments.acceptance import read_test, run_test
from small_worlds import write

expect.set_options(timeout=1000 * PATIENCE)

RADIO = ('delay = "0s"', 'delay = "0.25s"\njitter = "0.3s"\nloss = 0.1')


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    """Rovers on a bad radio, whose time runs."""
    folder = tmp_path_factory.mktemp("session")
    write(folder, RADIO)
    with Program("run", folder, "--page", "--speed", "10", "--seed", "9", "--robots", "30") as started:
        yield started


def everybody_heard(page: Page, count: int) -> None:
    """So many commands have been sent, and time has gone on after the last of them."""
    page.until("commands", lambda found: len(found["rows"]) >= count and found["rows"][-1]["matched"] > 0)


def saved(page: Page, file: Path, *, goals: list[dict[str, object]], exact: bool = True) -> dict[str, object]:
    draft = page.ask("drafttest")
    held = {
        each["id"]: [{"count": name, "how": "exactly", "number": number} for name, number in each["counts"].items()]
        for each in draft["commands"]
    }
    fields = {"tick": draft["tick"], "name": "again", "held": held, "goals": goals, "exact": exact}
    found = page.ask("savetest", **fields)
    file.write_bytes(base64.b64decode(found["data"]))
    return draft


def test_what_was_done_by_hand_is_repeated_in_another_process(session: Program, tmp_path: Path) -> None:
    with open_page(session) as page:
        page.ask("send", text="(WHEN (> battery 60%) (JOIN crew))")
        everybody_heard(page, 1)
        page.ask("send", text="(RULE roam (WHEN (IN crew) (GOTO 1m 1m)))", sort="standing", everybody=True)
        page.tell("stop")
        everybody_heard(page, 3)
        page.tell("release")
        page.tell("pace", running=False)
        page.ask("send", text="battery", sort="ask")
        page.tell("pace", running=True)
        everybody_heard(page, 5)
        draft = page.ask("drafttest")
        assert draft["ran"] is True
        members = page.ask("counttrue", text="(IN crew)")["number"]
        goals = [{"text": "(IN crew)", "how": "exactly", "number": members}]
        file = tmp_path / "again.zip"
        assert saved(page, file, goals=goals)["tick"] == draft["tick"]
        again = [sys.executable, "-m", "sleepcast", "run", str(file), "--quiet"]
        done = forkserver.run(again, capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.startswith("again: passed\n")
        assert "seed 9: 30 robots" in done.stdout
        other = tmp_path / "other.zip"
        saved(page, other, goals=[{"text": "(IN crew)", "how": "at least", "number": members + 1}])
        (missed,) = run_test(read_test(other), threads=1).missed
        assert missed.startswith(f"wanted count (IN crew) >= {members + 1}, but it was {members} at ")

        page.tell("step")
        refused = page.ask("savetest", tick=draft["tick"], name="again")
        assert "Time has gone on" in refused["reason"]
        assert "not closed" in page.ask("counttrue", text="(IN crew")["reason"]


@pytest.mark.browser
def test_the_dialog_saves_a_zip_file(program: Program, context: BrowserContext, tmp_path: Path) -> None:
    for page in opened(program, context):
        page.locator("#text").fill("(WHEN (> battery 60%) (JOIN crew))")
        page.keyboard.press("Enter")
        expect(page.locator("#commands tr")).to_have_count(1)
        page.locator("#as-test").click()
        expect(page.locator("#test-ended")).to_contain_text("Time stands still")
        expect(page.locator("#test-commands li")).to_have_count(1)
        page.locator("#test-text").fill("(IN crew)")
        page.keyboard.press("Enter")
        expect(page.locator("#test-goals li")).to_have_count(1)
        with page.expect_download() as waiting:
            page.locator("#test-save").click()
        waiting.value.save_as(tmp_path / waiting.value.suggested_filename)
        expect(page.locator("#save-test")).to_be_hidden()
    (file,) = tmp_path.glob("*.zip")
    test = read_test(file)
    assert (len(test.orders), len(test.goals)) == (1, 1)
    assert run_test(test, threads=1).missed == ()
    with pytest.raises(MisuseError, match="cannot be read"):
        read_test(tmp_path / "missing.zip")
