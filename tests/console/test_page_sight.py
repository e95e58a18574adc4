"""What the chosen robot sees as a layer of the map, in a real Chromium."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from console.conftest import page_of
from console.running import PATIENCE, Program
from console.test_page import await_picture, opened, pixels, pixels_seen, until
from console.test_sight import LAMPS, LASER, NEAR, TEXT, WALL

pytestmark = pytest.mark.browser

expect.set_options(timeout=1000 * PATIENCE)


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    """Three robots that stand: one beside the first, one behind a wall; and lamps."""
    with page_of(tmp_path_factory.mktemp("room"), TEXT, WALL + NEAR + LAMPS + LASER) as started:
        yield started


@pytest.fixture
def page(room: Program, context: BrowserContext) -> Iterator[Page]:
    yield from opened(room, context)


def test_lines_go_to_what_it_sees_and_end_at_walls(page: Page) -> None:
    page.set_viewport_size({"width": 1440, "height": 900})  # where lines are longer than rings are wide
    page.reload()
    await_picture(page)
    page.locator("#map").focus()
    page.keyboard.press("ArrowUp")  # the one nearest to the middle
    expect(page.locator("#robot-name")).to_have_text("rover1")
    ring = pixels_seen(page, "--chosen")
    left, right, top = min(x for x, _ in ring), max(x for x, _ in ring), min(y for _, y in ring)

    def lamp() -> list[float]:
        """Where the line to the lamp is, beside all robots."""
        return [x for x, _ in pixels(page, "--lit") if x < left - 20]

    assert not lamp()
    page.locator("#layers").click()
    box = page.get_by_label("Sight of the chosen robot")
    assert box.locator("..").get_attribute("title") == (
        "Lines to other robots and lights in reach, dashed up to what hides the rest. "
        "Dots where the beams of its scanner end"
    )
    before = len(pixels(page, "--place"))
    box.check()
    until(page, lamp)
    assert len(pixels(page, "--place")) > before + 50, "the scan"
    seen = pixels(page, "--chosen")
    assert min(y for _, y in seen) < top - 20, "to the robot above"
    assert max(x for x, _ in seen) <= right + 2, "to none behind the wall"
    page.reload()
    await_picture(page)
    page.locator("#layers").click()
    expect(box).to_be_checked()
    until(page, lamp)
    box.uncheck()
    until(page, lambda: not lamp())
