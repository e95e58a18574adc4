"""The legend in a real Chromium: its lines light and follow robots; and the looks of the map are those of pictures."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect

from console.running import PATIENCE, Program, let_run
from console.test_page import await_picture, pause, pixels, send, type_in, until
from sleepcast.api.looks import LOOKS, of_colour, of_group

pytestmark = pytest.mark.browser

expect.set_options(timeout=1000 * PATIENCE)


@pytest.fixture(scope="module")
def flock() -> Iterator[Program]:
    with Program("demo", "shepherding") as started:
        yield started


@pytest.fixture
def page(flock: Program, context: BrowserContext) -> Page:
    found = context.new_page()
    found.goto(let_run(flock).address)
    await_picture(found)
    expect(found.locator("#legend li")).not_to_have_count(0)
    return found


def test_a_line_lights_its_robots_and_follows_them(page: Page, chromium: Browser, flock: Program) -> None:
    lines = page.locator("#legend-lines button:first-child")
    expect(lines).to_have_text(["20 sheep", "1 dog"])
    for text in ("(WHEN (<= id 3) (JOIN a))", "(WHEN (<= id 2) (JOIN b))", "(WHEN (= id 21) (COLOUR 7))"):
        type_in(page, text)
        row = send(page)
    expect(lines).to_have_text(["17 sheep", "3 a", "2 b", "1 colour 7"])
    pause(page)
    page.keyboard.press("Escape")
    expect(row).to_have_attribute("aria-selected", "true")
    row.click()
    row.click()  # chosen again, their light does not go out some seconds later
    until(page, lambda: pixels(page, "--lit"))

    group = lines.nth(1)
    group.click()
    expect(group).to_have_attribute("aria-pressed", "true")
    expect(page.locator("#legend .lit")).to_have_count(0)
    page.locator(".legend-follow").click()
    page.locator("#zoom-in").click()
    box = page.locator("#map").bounding_box()
    assert box is not None
    middle = [box["x"] + box["width"] / 2, box["y"] + box["height"] / 2]
    # The three of them are together, and the middle of the map is that of all three.
    found = until(page, lambda: pixels(page, "--lit"))
    mean = [sum(axis) / len(found) for axis in zip(*found, strict=True)]
    assert abs(mean[0] - middle[0]) < 80
    assert abs(mean[1] - middle[1]) < 80
    page.locator("#map").press("Shift+ArrowLeft")
    expect(page.locator(".legend-follow")).to_have_attribute("aria-pressed", "false")
    lines.nth(3).click()
    expect(group).to_have_attribute("aria-pressed", "false")
    lines.nth(3).click()
    expect(page.locator("#legend .lit")).to_be_visible()  # those that the last command matched

    # Another visitor, with a phone: one line until it is tapped, and robots beside it.
    with chromium.new_context(viewport={"width": 390, "height": 844}, has_touch=True, color_scheme="dark") as small:
        small.set_default_timeout(1000 * PATIENCE)
        phone = small.new_page()
        phone.goto(flock.address)
        fold = phone.locator("#legend-fold")
        expect(fold).to_have_text(re.compile("21 robots · 2 groups"))
        expect(phone.locator("#legend-lines li").first).to_be_hidden()
        fold.tap()
        expect(phone.locator("#legend-lines button:first-child")).to_have_text(["17 sheep", "3 a", "2 b", "1 colour 7"])
        fold.tap()
        expect(phone.locator("#legend-lines li").first).to_be_hidden()


CRASH = """
format = 2
title = "Two that fly into each other, and one beside them"
seconds = "1min"

[world]
width = "20m"
height = "20m"

[robots]
like = "copter"
starts = [["5m", "9m", "0deg", "a", "8m"], ["6.1m", "9m", "0deg", "b", "8m"], ["15m", "9m", "0deg", "c", "8m"]]
"""


def test_who_has_crashed_has_a_line_and_a_cross_and_its_report(tmp_path: Path, context: BrowserContext) -> None:
    (tmp_path / "crash.toml").write_text(CRASH, encoding="utf-8")
    with Program("run", tmp_path / "crash.toml", "--page") as program:
        page = context.new_page()
        page.goto(program.address)
        await_picture(page)
        type_in(page, "(WHEN (= id 1) (GOTO 8m 9m))")
        send(page)
        line = page.locator("#legend-lines button:first-child").last
        expect(line).to_have_text("2 crashed")
        assert until(page, lambda: pixels(page, "--bad"))
        line.click()
        assert until(page, lambda: pixels(page, "--lit"))
        expect(page.locator(".glance")).to_contain_text("2 crashed")
        reports = ["ahas crashed into b", "bhas crashed into a"]
        expect(page.locator(".glance li")).to_have_text([re.compile("|".join(reports))] * 2)
        page.locator(".glance li button", has_text="a").click()
        expect(page.locator("#robot-state")).to_have_text("crashed")
        page.locator("#tab-said").click()
        expect(page.locator("#pane-said")).to_contain_text("has crashed into")


def test_the_icon_of_the_robot_follows_the_theme(page: Page) -> None:
    page.locator("#map").focus()
    page.keyboard.press("ArrowUp")
    icon = page.locator("#robot-state canvas")
    expect(icon).to_be_visible()
    read = "canvas => canvas.toDataURL()"
    light = icon.evaluate(read)
    page.locator("#theme").click()
    until(page, lambda: icon.evaluate(read) != light)
    page.locator("#theme").click()
    until(page, lambda: icon.evaluate(read) == light)


def test_the_map_and_pictures_agree_on_looks(page: Page) -> None:
    found = page.evaluate(
        """async () => {
          const { inkOf, LOOKS, lookOfColour, lookOfGroup } = await import("./static/shapes.js");
          const numbers = Array.from({ length: 255 }, (_, number) => number + 1);
          const inks = Array.from({ length: LOOKS }, (_, look) => inkOf(look));
          return [inks, numbers.map(lookOfGroup), numbers.map(lookOfColour)];
        }"""
    )
    assert found[0][: len(LOOKS)] == [look.ink for look in LOOKS]  # those of Nomads follow
    assert found[1:] == [[of_group(code) for code in range(1, 256)], [of_colour(code) for code in range(1, 256)]]
