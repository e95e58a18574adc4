"""Predicates by hand on the page: a number that is dragged, robots that are selected on the map, alerts and lights.

The rovers of the small world stand still, so what is found for them stays right. As in `test_page`, the browser must
have had nothing to complain about.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from console.running import PATIENCE, Program
from console.test_page import number, opened, pause, pixels_seen, send, type_in, until

pytestmark = pytest.mark.browser

expect.set_options(timeout=1000 * PATIENCE)


@pytest.fixture
def rovers(program: Program, context: BrowserContext) -> Iterator[Page]:
    """The small world's page."""
    yield from opened(program, context)


def threshold(page: Page) -> float:
    """The number in the prompt."""
    found = re.search(r"([\d.]+)%", page.locator("#text").input_value())
    assert found is not None
    return float(found[1])


def count(page: Page) -> int:
    """Robots that would obey, of a preview that has come."""
    expect(page.locator("#yes")).not_to_have_text("–")
    return number(page.locator("#yes"))


def test_a_number_is_dragged_and_the_counts_follow(rovers: Page) -> None:
    type_in(rovers, "(WHEN (> battery 60%) (MARK))")
    before = count(rovers)
    box = until(rovers, lambda: rovers.locator("#backdrop .number").bounding_box())  # none while it is drawn anew
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    rovers.mouse.move(x, y)
    rovers.mouse.down()
    expect(rovers.locator("#spread")).to_be_visible()
    expect(rovers.locator("#spread .what")).to_have_text("battery: decides for 20")
    rovers.mouse.move(x + 30, y, steps=5)
    middle = until(rovers, lambda: found if (found := threshold(rovers)) != 60 else 0.0)
    assert 60 < middle < 100
    until(rovers, lambda: count(rovers) < before)
    rovers.mouse.move(x - 300, y, steps=5)
    expect(rovers.locator("#yes")).to_have_text("20")
    expect(rovers.locator("#spread canvas")).to_have_attribute(
        "aria-label", re.compile(r"^battery of all robots, from [\d.]+% to [\d.]+%; the number is 0%$")
    )
    assert threshold(rovers) < middle
    rovers.mouse.up()
    assert rovers.locator("#text").input_value().endswith("%) (MARK))")
    rovers.keyboard.press("Control+z")
    expect(rovers.locator("#text")).to_have_value("(WHEN (> battery 60%) (MARK))")
    expect(rovers.locator("#yes")).to_have_text(str(before))


def test_a_number_is_stepped_with_the_keyboard(rovers: Page) -> None:
    type_in(rovers, "(WHEN (> battery 60%) (MARK))")
    for _ in range(len(") (MARK))")):
        rovers.keyboard.press("ArrowLeft")
    rovers.keyboard.press("Alt+ArrowUp")
    expect(rovers.locator("#text")).to_have_value("(WHEN (> battery 61%) (MARK))")
    expect(rovers.locator("#spread")).to_be_visible()
    rovers.keyboard.press("Alt+Shift+ArrowDown")
    expect(rovers.locator("#text")).to_have_value("(WHEN (> battery 51%) (MARK))")
    rovers.keyboard.press("Escape")
    expect(rovers.locator("#spread")).to_be_hidden()


def draw_lasso(page: Page, *, left: float, right: float) -> None:
    """Round a part of the map's width, from 0 to 1."""
    box = page.locator("#map").bounding_box()
    assert box is not None
    x = [box["x"] + share * box["width"] for share in (left, right)]
    y = [box["y"] + share * box["height"] for share in (0.98, 0.02)]  # not from the legend
    page.mouse.move(x[0], y[0])
    page.mouse.down()
    for at in ((x[1], y[0]), (x[1], y[1]), (x[0], y[1])):
        page.mouse.move(*at, steps=3)
    page.mouse.up()


def test_robots_in_a_lasso_become_a_test_and_a_test_becomes_a_selection(rovers: Page) -> None:
    selected, tests = rovers.locator("#selection .count"), rovers.locator("#selection .tests")
    rovers.locator("#lasso").click()
    draw_lasso(rovers, left=0.02, right=0.5)
    expect(tests).to_be_visible()
    assert pixels_seen(rovers, "--chosen")
    robots = int(selected.inner_text().split()[0])
    assert 0 < robots < 20
    rovers.locator("#selection .use").click()
    expect(rovers.locator("#text")).to_have_value(re.compile(r"^\(WHEN \(.+\) \)$"))
    text = rovers.locator("#text").input_value()
    assert rovers.locator("#text").evaluate("field => field.selectionStart") == len(text) - 1
    rovers.keyboard.type("(MARK)")
    expect(rovers.locator("#yes")).to_have_text(str(robots))

    rovers.locator("#selection .clear").click()
    expect(rovers.locator("#selection")).to_be_hidden()
    rovers.locator("#select-lit").click()
    expect(selected).to_have_text(f"{robots} selected")


def test_robots_are_selected_one_by_one(rovers: Page) -> None:
    selected = rovers.locator("#selection .count")
    rovers.locator("#map").focus()
    for index, key in enumerate(("ArrowRight", "ArrowLeft"), 1):
        rovers.keyboard.press(key)
        rovers.keyboard.press("Space")
        expect(selected).to_have_text(f"{index} selected")
    expect(rovers.locator("#selection .tests")).to_be_visible()
    rovers.keyboard.press("Space")
    expect(selected).to_have_text("1 selected")
    rovers.keyboard.down("Shift")
    draw_lasso(rovers, left=0.02, right=0.98)
    rovers.keyboard.up("Shift")
    expect(selected).to_have_text("20 selected")
    rovers.locator("#map").focus()
    rovers.keyboard.press("Escape")
    expect(rovers.locator("#selection")).to_be_hidden()


def test_an_alert_tells_of_robots_and_lights_them(rovers: Page) -> None:
    type_in(rovers, "(UNMARK)")
    rovers.locator("#everybody-yes").check()
    send(rovers)
    rovers.locator("#drawer-alerts").click()
    test = rovers.get_by_label("Tell when")
    test.fill("(> fule 1)")
    test.press("Enter")
    expect(rovers.locator(".alerts .problem")).to_contain_text('unknown name "fule"')
    test.fill("marked")
    test.press("Enter")
    expect(rovers.locator(".alerts .about").first).to_have_text("for anybody: true for 0 now")
    type_in(rovers, "(WHEN (< id 3) (MARK))")
    send(rovers)
    notice = rovers.locator("#alerted")
    expect(notice).to_contain_text("marked: rover1, rover2")
    assert pixels_seen(rovers, "--light")
    notice.locator(".show").click()
    expect(notice).to_be_hidden()
    expect(rovers.locator("#legend .lit")).to_contain_text("2 alert")
    rovers.get_by_label("Mute marked").click()
    expect(rovers.locator(".alerts .about").first).to_contain_text("muted")
    rovers.get_by_label("Remove marked").click()
    expect(rovers.locator(".alerts .about")).to_have_count(0)


def test_lights_get_a_meaning_and_a_robot_winks(rovers: Page) -> None:
    rovers.locator("#drawer-alerts").click()
    meaning = rovers.get_by_label("A robot shines while")
    meaning.fill("(> battery 60%)")
    meaning.press("Enter")
    expect(rovers.locator("#text")).to_have_value("(RULE light (IF (> battery 60%) (MARK) (UNMARK)))")
    rovers.locator("#map").focus()
    rovers.keyboard.press("ArrowRight")
    name = rovers.locator("#robot-name").inner_text()
    pause(rovers)  # or it may have blinked to the end before it is asked once more
    rovers.locator("#wink").click()
    row = rovers.locator("#commands tr").first
    expect(row.locator("code")).to_contain_text("RULE wink")
    rovers.locator("#wink").click()
    expect(rovers.locator("#refused-text")).to_have_text(f"{name} blinks already.")
    rovers.locator("#run").click()
    expect(row.locator(".matched")).to_contain_text("1")
    rovers.locator("#tab-rules").click()
    expect(rovers.locator("#pane-rules")).to_contain_text("wink")
