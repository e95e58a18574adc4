"""A robot's own answer to a question stands beside it on the map, in a real Chromium.

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

LABELS = """
async () => {
  const { Labels } = await import("/static/labels.js");
  const { View } = await import("/static/view.js");
  const { palette } = await import("/static/shapes.js");
  const scene = { names: ["r1", "r2", "r3"], places: [], lights: [], areas: [], obstacles: [] };
  const frame = { count: 3, poses: Float32Array.of(10, 10, 0, 50, 50, 0, 90, 90, 0), groups: new Uint8Array(3) };
  const replies = { of: (robot) => ["7 %", "", "fault"][robot] };
  const view = new View();
  view.resize(800, 800);
  view.fit([0, 0, 100, 100]);
  const marks = { chosen: 2, pointed: -1 };
  const what = { scene, frame, marks, colours: palette(), ratio: 1, sizes: () => 5, replies, robots: true };
  const texts = () => new Labels().arrange(view, what, (text) => 7 * text.length).map(({ text }) => text).sort();
  const named = texts();
  what.robots = false;
  const bare = texts();
  what.replies = null;
  return [named, bare, texts()];
}
"""


@pytest.fixture
def rovers(program: Program, context: BrowserContext) -> Iterator[Page]:
    yield from opened(program, context)


def test_answers_stand_beside_their_robots(rovers: Page) -> None:
    named, bare, plain = rovers.evaluate(LABELS)
    assert named == ["r1  7 %", "r2", "r3  fault"]
    assert bare == ["7 %", "r3  fault"]  # where names are not shown, answers are, and the chosen robot's name
    assert plain == ["r3"]


def test_a_question_is_answered_on_the_map_until_the_next_one_or_escape(rovers: Page) -> None:
    rovers.locator("#text").fill("battery")
    rovers.locator("#sort").select_option("ask")
    send(rovers)
    rovers.locator("#map").focus()
    rovers.keyboard.press("ArrowRight")  # chooses the robot in the middle
    name = rovers.locator("#robot-name").inner_text()
    tip = rovers.locator("#tip")
    point_at(rovers, name)
    expect(tip).to_have_text(re.compile(rf"^{name} · answered \d+(\.\d+)? %$"))
    rovers.locator("#sort").select_option("once")
    rovers.locator("#text").fill("(WHEN (> id 1) (SETQ seen 1))")
    send(rovers)
    point_at(rovers, name)
    expect(tip).to_contain_text("answered")  # a command asks nothing
    rovers.locator("#map").press("Escape")
    expect(tip).not_to_contain_text("answered")


def point_at(page: Page, name: str) -> None:
    """Point at the chosen robot, in the middle of the map."""
    page.locator("#map").press("c")
    box = page.locator("#map").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 5, box["y"] + 5)
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    expect(page.locator("#tip")).to_contain_text(name)
