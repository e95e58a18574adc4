"""What the page says first, and what it does not hide: long commands, highlights, banners, windows of another size.

As in `test_page`, the browser must have had nothing to complain about.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import BrowserContext, FloatRect, Page, expect

from console.running import PATIENCE, Program
from console.test_page import FIND_PIXELS, SENTENCE, opened, pixels, previewed, send, settle, type_in, until

pytestmark = pytest.mark.browser

WIDTH = "bar => bar.style.width"
LOWEST = f"(where) => ({FIND_PIXELS})(where).reduce((most, [, y]) => Math.max(most, y), 0)"
"""Looked for by the page: they are too many to be handed over."""

expect.set_options(timeout=1000 * PATIENCE)


@pytest.fixture
def crowd(context: BrowserContext) -> Iterator[Page]:
    with Program("demo", "crowd", "--robots", "40", waits=True) as program:
        yield from opened(program, context)


def box(page: Page, selector: str) -> FloatRect:
    found = page.locator(selector).bounding_box()
    assert found is not None
    return found


def lowest_ground(page: Page) -> float:
    """How far down the screen the world reaches."""
    settle(page)
    found: float = page.evaluate(LOWEST, ["--map-area", "ground"])
    return found


def test_a_long_command_is_folded_and_nothing_has_to_be_scrolled(crowd: Page) -> None:
    crowd.set_viewport_size({"width": 1280, "height": 800})
    previewed(crowd, "40")
    expect(crowd.locator("#folded-title")).to_have_text("Ten rules for all robots")
    expect(crowd.locator("#folded-length")).to_contain_text("43 lines")
    expect(crowd.locator("#send")).to_be_enabled()  # its author meant it for all robots
    assert not pixels(crowd, "--lit")  # where all would obey, a highlight says nothing
    assert box(crowd, "#text")["height"] < 40
    for part in ("html", ".accounting .table"):
        assert crowd.locator(part).evaluate("part => part.scrollHeight <= part.clientHeight"), part
    crowd.set_viewport_size({"width": 640, "height": 400})  # a phone on its side
    expect(crowd.locator("#send")).to_be_in_viewport(ratio=1.0)
    crowd.set_viewport_size({"width": 1280, "height": 800})
    crowd.get_by_role("button", name="Show all").click()
    expect(crowd.locator("#folded")).to_be_hidden()
    assert box(crowd, "#text")["height"] > 100
    crowd.get_by_role("button", name="Ten rules").click()
    expect(crowd.locator("#folded")).to_be_visible()
    crowd.locator("#text").press("Delete")
    expect(crowd.locator("#folded")).to_be_hidden()  # who edits it wants to see it


def test_the_map_fits_itself_until_it_is_moved_and_stop_hides_none_of_it(crowd: Page) -> None:
    before = box(crowd, "#map")
    crowd.locator("#text").press("F9")
    expect(crowd.locator("#stopped-text")).to_contain_text("STOP")
    assert box(crowd, "#map") == before
    bar, banner = box(crowd, "header.bar"), box(crowd, "#stopped")
    assert bar["y"] <= banner["y"]
    assert banner["y"] + banner["height"] <= bar["y"] + bar["height"]
    expect(crowd.locator("#stop")).to_be_in_viewport(ratio=1.0)
    scale = crowd.locator("#scale-bar")
    for height in (500, 800):
        crowd.set_viewport_size({"width": 1280, "height": height})
        until(
            crowd, lambda: 0.7 < lowest_ground(crowd) / (box(crowd, "#map")["y"] + box(crowd, "#map")["height"]) < 1.0
        )
    fitted = scale.evaluate(WIDTH)
    crowd.locator("#zoom-in").click()
    moved = until(crowd, lambda: found if (found := scale.evaluate(WIDTH)) != fitted else "")
    crowd.set_viewport_size({"width": 1280, "height": 600})
    expect(crowd.locator("#ground")).to_have_js_property("height", round(box(crowd, "#map")["height"]))
    assert scale.evaluate(WIDTH) == moved


def test_a_ready_made_command_has_sliders_and_the_light_of_those_that_obeyed_goes_out(
    bravo: Program, context: BrowserContext
) -> None:
    page = context.new_page()
    page.clock.install()
    page.goto(bravo.address)
    previewed(page, re.compile(r"^\d{2}$"))
    expect(page.locator("#ready .early")).to_have_count(2)  # the second and the third need the first
    near = page.get_by_role("slider", name="how near to X")
    near.fill("9")
    expect(page.locator("#text")).to_have_value(SENTENCE.replace("5mi", "9mi"))
    near.fill("5")
    expect(page.locator("#text")).to_have_value(SENTENCE)
    page.locator("#text").press_sequentially(" ")  # now it is a text of one's own
    expect(near).to_have_count(0)
    page.locator("#text").press("Backspace")
    row = send(page)
    expect(page.locator("#ready .early")).to_have_count(0)
    until(page, lambda: pixels(page, "--lit"))
    page.clock.fast_forward(10_000)
    until(page, lambda: not pixels(page, "--lit"))
    expect(row).to_have_attribute("aria-selected", "true")
    row.click()
    row.click()
    until(page, lambda: pixels(page, "--lit"))
    type_in(page, "(WHEN (> fuel 50%) (JOIN charlie))")
    row = send(page)
    expect(row).to_have_attribute("aria-selected", "true")
    row.click()
    row.click()  # before it goes out: whoever chooses it again wants to see it for longer
    until(page, lambda: pixels(page, "--lit"))
    page.clock.fast_forward(10_000)
    page.clock.fast_forward(10_000)
    settle(page)
    assert pixels(page, "--lit")
