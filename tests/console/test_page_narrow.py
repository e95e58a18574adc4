"""A narrow screen, and lists that are longer than their room: what matters is in sight without scrolling by hand.

As in `test_page`, the browser must have had nothing to complain about.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect

from console.running import PATIENCE, Program
from console.test_page import opened, send, until

pytestmark = pytest.mark.browser

expect.set_options(timeout=1000 * PATIENCE)

MIDDLE = """
() => {
  const map = document.getElementById("map");
  window.scrollTo(0, 0); // a new account may have moved the page
  const box = map.getBoundingClientRect();
  const over = new Set();
  for (let across = -30; across <= 80; across += 5) {
    for (let down = -25; down <= 25; down += 5) {
      const top = document.elementFromPoint(box.left + box.width / 2 + across, box.top + box.height / 2 + down);
      if (!map.contains(top)) over.add(top === null ? "out of sight" : top.id || top.className || top.tagName);
    }
  }
  return [...over];
}
"""
"""What lies over the middle of the map, where vessel X is, with its name to the right of it."""


@pytest.fixture
def phone(chromium: Browser) -> Iterator[BrowserContext]:
    with chromium.new_context(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True) as found:
        found.set_default_timeout(1000 * PATIENCE)
        yield found


def in_sight(page: Page) -> bool:
    """Whether the newest line of the account is seen, and nothing lies over it."""
    found: bool = page.locator("#commands tr").first.evaluate(
        """line => {
          const { left, right, top, bottom, width } = line.getBoundingClientRect();
          return [top + 3, bottom - 3].every((y) => line.contains(document.elementFromPoint(left + width / 2, y)));
        }"""
    )
    return found


def test_nothing_covers_the_vessel_on_a_phone(bravo: Program, phone: BrowserContext) -> None:
    for page in opened(bravo, phone):
        assert page.evaluate(MIDDLE) == []
        page.locator("#send").tap()
        fold = page.locator("#legend-fold")
        expect(fold).to_be_visible()
        assert page.evaluate(MIDDLE) == []
        fold.tap()
        expect(page.locator("#legend li").nth(1)).to_be_visible()
        assert page.evaluate(MIDDLE) == []
        page.locator("#layers").tap()
        expect(page.locator("#layer-menu")).to_be_visible()
        assert page.evaluate(MIDDLE) == []


@pytest.mark.parametrize("size", [(1440, 500), (390, 844)], ids=["wide", "narrow"])
def test_the_account_of_a_new_command_comes_into_sight(
    program: Program, context: BrowserContext, size: tuple[int, int]
) -> None:
    for page in opened(program, context):
        command_until_the_list_is_long(page, size)


def command_until_the_list_is_long(page: Page, size: tuple[int, int]) -> None:
    page.set_viewport_size({"width": size[0], "height": size[1]})
    for number in range(4):
        page.locator("#text").fill(f"(WHEN (> battery {number}%) (SETQ seen {number}))")
        send(page)
    page.locator(".accounting .table").evaluate("table => table.scrollTo(0, table.scrollHeight)")
    page.locator("#text").scroll_into_view_if_needed()
    page.locator("#text").fill("(WHEN (> battery 50%) (SETQ seen 9))")
    send(page)
    until(page, lambda: in_sight(page))
    expect(page.locator("#text")).to_be_focused()
