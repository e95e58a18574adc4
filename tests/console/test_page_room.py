"""The room that panes take on the page, the finder, and links that open the same view.

As in `test_page`, the browser must have had nothing to complain about.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from console.running import PATIENCE, Program
from console.test_page import opened, until

pytestmark = pytest.mark.browser

expect.set_options(timeout=1000 * PATIENCE)


@pytest.fixture
def rovers(program: Program, context: BrowserContext) -> Iterator[Page]:
    """The small world's page."""
    yield from opened(program, context)


def find(page: Page, text: str) -> None:
    """Type into the finder, and take what it offers first."""
    page.keyboard.press("Control+k")
    page.locator("#finder input").press_sequentially(text)
    page.keyboard.press("Enter")
    expect(page.locator("#finder")).to_be_hidden()


def length_of_scale(page: Page) -> float:
    """Of the bar under the map, in pixels."""
    return float(page.locator("#scale-bar").evaluate("bar => Number.parseFloat(bar.style.width)"))


def test_the_finder_finds_robots_commands_and_actions(rovers: Page) -> None:
    rovers.keyboard.press("Control+k")
    rovers.locator("#finder input").press_sequentially("rover1")
    names = rovers.locator("#finder-found .name")
    expect(names.first).to_have_text("rover1")
    assert set(rovers.locator("#finder-found .kind").all_inner_texts()) == {"robot"}
    rovers.keyboard.press("ArrowDown")
    second = names.nth(1).inner_text()
    rovers.keyboard.press("Enter")
    expect(rovers.locator("#robot-name")).to_have_text(second)

    rovers.locator("#text").fill("")
    find(rovers, "full crew")
    expect(rovers.locator("#text")).to_have_value("(WHEN (> battery 60%) (JOIN crew))")
    find(rovers, "light or dark")
    assert rovers.evaluate("document.documentElement.dataset.theme") == "dark"

    rovers.keyboard.press("Control+k")
    rovers.locator("#finder input").press_sequentially("nothing is called this")
    expect(rovers.locator("#finder-found")).to_be_hidden()
    rovers.keyboard.press("Escape")
    expect(rovers.locator("#finder")).to_be_hidden()


def test_a_link_opens_the_same_view(rovers: Page, context: BrowserContext) -> None:
    find(rovers, "rover3")
    until(rovers, lambda: "robot=rover3" in rovers.url)
    before = rovers.url
    rovers.locator("#zoom-in").click()
    until(rovers, lambda: rovers.url != before and "view=" in rovers.url)
    scale = length_of_scale(rovers)
    other = context.new_page()
    other.goto(rovers.url)
    expect(other.locator("#robot-name")).to_have_text("rover3")
    until(other, lambda: length_of_scale(other) == pytest.approx(scale, rel=1e-4))
    other.close()


def test_the_side_is_made_wider_by_hand_and_stays_so(rovers: Page) -> None:
    rovers.set_viewport_size({"width": 1440, "height": 900})  # in a smaller one it is soon as wide as can be
    bar, side = rovers.locator(".side > .splitter"), rovers.locator(".side")
    before = side.evaluate("side => side.offsetWidth")
    bar.focus()
    rovers.keyboard.press("ArrowLeft")
    rovers.keyboard.press("ArrowLeft")
    wider = side.evaluate("side => side.offsetWidth")
    assert wider == before + 48
    box = bar.bounding_box()
    assert box is not None
    rovers.mouse.move(box["x"] + 4, box["y"] + 200)
    rovers.mouse.down()
    rovers.mouse.move(box["x"] + 104, box["y"] + 210, steps=3)
    rovers.mouse.up()
    narrower = side.evaluate("side => side.offsetWidth")
    assert narrower == wider - 100
    rovers.reload()
    expect(rovers.locator("#scale-text")).not_to_be_empty()
    assert side.evaluate("side => side.offsetWidth") == narrower


def test_a_square_world_has_the_height_and_the_side_is_never_empty(rovers: Page) -> None:
    boxes = [rovers.locator(name).bounding_box() for name in ("#map", ".side", ".desk.of-swarm")]
    assert all(box is not None for box in boxes)
    world, side, desk = (box for box in boxes if box is not None)
    assert world["height"] > 0.9 * (side["height"] + desk["height"])
    assert desk["x"] == pytest.approx(side["x"])
    assert desk["y"] == pytest.approx(side["y"] + side["height"])
    glance = rovers.locator(".glance")
    expect(glance.get_by_role("row").filter(has_text="battery")).to_contain_text("%")
    expect(glance).to_contain_text("0 stopped or held")
    find(rovers, "rover3")
    expect(glance).to_be_hidden()
    rovers.set_viewport_size({"width": 1024, "height": 768})
    below = rovers.locator(".desk.of-swarm").bounding_box()
    assert below is not None
    assert below["x"] == 0


def test_the_sensors_of_the_chosen_robot_are_drawn(rovers: Page) -> None:
    rovers.locator("#drawer-sensors").click()
    pane = rovers.locator(".sensing")
    expect(pane).to_contain_text("Click any robot")
    find(rovers, "rover3")
    expect(pane.locator("canvas").last).to_be_visible()
    expect(pane.get_by_label(re.compile("^Bumper: (free|hit at)"))).to_be_visible()
    rovers.locator("#drawer-sensors").click()
    expect(pane).to_be_hidden()
