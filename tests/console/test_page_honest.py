"""What the page says where a command has not done what was meant: a misspelt name, STOP, a pause, a rule that fails.

As in `test_page`, the browser must have had nothing to complain about.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from console.running import PATIENCE, Program
from console.test_page import opened

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


def test_what_is_not_done_is_not_shown_as_done(rovers: Page) -> None:
    if rovers.locator("#run").get_attribute("data-running") == "false":
        rovers.locator("#run").click()
    enter(rovers, "(WHEN (> batery 50%) (MARK))")
    expect(rovers.locator("#unknown")).to_have_text("20")
    expect(rovers.locator("#findings")).to_contain_text("no robot has batery")
    expect(rovers.locator("#findings")).to_contain_text("Press Enter once more")
    rovers.locator("#text").press("Enter")
    expect(rovers.locator(first(rovers, ".unknown"))).to_have_text("20")
    expect(rovers.locator(first(rovers, ".not-matched"))).to_have_text("0")

    enter(rovers, "(WHEN (> battery 50%) (RULE guard (SETQ drive_speed (/ 1 0))))")
    badge = rovers.locator("#failing")
    expect(badge).to_contain_text("rule guard fails on")
    failing = badge.locator("b").inner_text()
    expect(rovers.locator(first(rovers, ".matched"))).to_have_text(failing)
    expect(rovers.locator(first(rovers, ".failing"))).to_have_text(f"! rule guard fails: {failing}")
    badge.click()
    expect(rovers.locator("#legend .lit")).to_have_text(re.compile(rf"{failing}\s*a rule fails"))
    rovers.locator(first(rovers, ".failing")).click()
    expect(rovers.locator("#legend .lit")).to_have_text(re.compile(rf"{failing}\s*rule guard fails"))

    rovers.keyboard.press("F9")
    expect(rovers.locator("#stopped-text")).to_contain_text("all 20 robots")
    enter(rovers, "(WHEN (> battery 50%) (SETQ drive_speed 1))")
    expect(rovers.locator(first(rovers, ".held-up"))).to_have_text(f"held by STOP: {failing}")
    rovers.locator("#release").click()
    expect(rovers.locator("#stopped")).to_be_hidden()

    rovers.keyboard.press("Control+Space")
    expect(rovers.locator("#achieved")).to_have_text("paused")
    enter(rovers, "(WHEN (> battery 50%) (FORGET guard))")
    expect(rovers.locator(first(rovers, ".held-up"))).to_have_text("waiting: paused")
    expect(rovers.locator(first(rovers, ".silent"))).to_have_text("–")
    rovers.keyboard.press("Control+Space")
    expect(rovers.locator(first(rovers, ".held-up"))).to_have_text("")
    expect(rovers.locator(first(rovers, ".silent"))).to_have_text("0")
    expect(badge).to_be_hidden()
