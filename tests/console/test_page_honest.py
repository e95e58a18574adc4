"""What the page says where a command has not done what was meant: a misspelt name, STOP, a pause, a rule that fails.

As in `test_page`, the browser must have had nothing to complain about.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from console.running import PATIENCE, Program
from console.test_page import opened, send

pytestmark = pytest.mark.browser

expect.set_options(timeout=1000 * PATIENCE)


@pytest.fixture
def rovers(program: Program, context: BrowserContext) -> Iterator[Page]:
    """The small world's page."""
    yield from opened(program, context)


def enter(page: Page, text: str) -> None:
    """Type a text, wait until it is counted, and press Enter."""
    page.locator("#text").fill(text)
    expect(page.locator("#preview")).to_have_class(re.compile("known"))
    page.locator("#text").press("Enter")


def first(page: Page, cell: str) -> str:
    """The selector of a cell of the latest command."""
    return f"#commands tr:first-child {cell}"


GUARD = "(WHEN (> battery 50%) (RULE guard (SETQ drive_speed (/ 1 0))))"


@pytest.fixture
def running(rovers: Page) -> Page:
    """The same, while time goes on, without the rule that fails and without STOP."""
    if rovers.locator("#run").get_attribute("data-running") == "false":
        rovers.locator("#run").click()
    return rovers


@pytest.fixture
def failing(running: Page) -> Iterator[str]:
    """How many robots have a rule that fails; they forget it afterwards."""
    enter(running, GUARD)
    badge = running.locator("#failing")
    expect(badge).to_contain_text("rule guard fails on")
    yield badge.locator("b").inner_text()
    enter(running, "(WHEN (> battery 50%) (FORGET guard))")
    expect(badge).to_be_hidden()


def test_a_name_that_no_robot_has_is_told_before_and_counts_as_unknown_after(running: Page) -> None:
    enter(running, "(WHEN (> batery 50%) (MARK))")
    expect(running.locator("#unknown")).to_have_text("20")
    expect(running.locator("#findings")).to_contain_text("no robot has batery")
    expect(running.locator("#findings")).to_contain_text("Press Enter once more")
    running.locator("#text").press("Enter")
    expect(running.locator(first(running, ".unknown"))).to_have_text("20")
    expect(running.locator(first(running, ".not-matched"))).to_have_text("0")


def test_a_rule_that_fails_stands_with_its_command_and_lights_its_robots(running: Page, failing: str) -> None:
    expect(running.locator(first(running, ".matched"))).to_have_text(failing)
    expect(running.locator(first(running, ".failing"))).to_have_text(f"! rule guard fails: {failing}")
    running.locator("#failing").click()
    expect(running.locator("#legend .lit")).to_have_text(re.compile(rf"{failing}\s*a rule fails"))
    running.locator(first(running, ".failing")).click()
    expect(running.locator("#legend .lit")).to_have_text(re.compile(rf"{failing}\s*rule guard fails"))


def test_what_a_stop_holds_is_not_done(running: Page) -> None:
    running.locator("#text").fill("(WHEN (> battery 50%) (MARK))")
    meant = send(running).locator(".matched").inner_text()
    running.keyboard.press("F9")
    expect(running.locator("#stopped-text")).to_contain_text("all 20 robots")
    enter(running, "(WHEN (> battery 50%) (SETQ drive_speed 1))")
    expect(running.locator(first(running, ".held-up"))).to_have_text(f"held by STOP: {meant}")
    running.locator("#release").click()
    expect(running.locator("#stopped")).to_be_hidden()


def test_what_is_sent_while_time_stands_still_waits(running: Page) -> None:
    running.keyboard.press("Control+Space")
    expect(running.locator("#achieved")).to_have_text("paused")
    enter(running, "(WHEN (> battery 50%) (UNMARK))")
    expect(running.locator(first(running, ".held-up"))).to_have_text("waiting: paused")
    expect(running.locator(first(running, ".silent"))).to_have_text("–")
    running.keyboard.press("Control+Space")
    expect(running.locator(first(running, ".held-up"))).to_have_text("")
    expect(running.locator(first(running, ".silent"))).to_have_text("0")


def test_what_waits_for_its_instant_counts_down_and_can_be_called_off(running: Page) -> None:
    running.locator("#text").fill("(AFTER-ISSUE 1h (WHEN (> battery 50%) (MARK)))")
    running.locator("#text").press("Enter")
    row = running.locator("#commands tr", has_text="AFTER-ISSUE").first
    expect(row.locator(".countdown span")).to_have_text(re.compile(r"^20 waiting, at 1:\d\d:\d\d, in 0:5\d:\d\d$"))
    expect(row.locator(".silent")).to_have_text("0")
    row.get_by_role("button", name="Cancel").click()
    expect(row.locator(".countdown")).to_be_hidden()
    expect(row.locator(".fault")).to_have_text("20")
    expect(running.locator(first(running, "code"))).to_have_text("(CANCEL)")
