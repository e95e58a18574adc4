"""A field as a layer of the map with its scale, in a real Chromium.

As in `test_page`, the browser must have had nothing to complain about.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from console.conftest import COMMANDS
from console.running import PATIENCE, Program, let_run
from console.test_page import opened, pause, pixels, pixels_seen, until
from console.test_page_late import Between, blank
from small_worlds import write

__all__ = ["blank"]

pytestmark = pytest.mark.browser

expect.set_options(timeout=1000 * PATIENCE)

FIELDS = """
[fields.warmth]
unit = "%"
about = "how warm it is"
zones = [{ value = "80%", x = ["0m", "500m"], y = ["0m", "1km"] }]

[fields.grass]
zones = [{ value = 0.2, x = ["0m", "1km"], y = ["0m", "500m"] }]

[fields.grass.growth]
cell = "100m"
most = 1
rate = 0.05
law = "constant"
"""


@pytest.fixture(scope="module")
def meadow(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    folder = tmp_path_factory.mktemp("meadow")
    write(folder, more=COMMANDS + FIELDS)
    with Program("run", folder, "--page", "--speed", "5") as started:
        yield started


@pytest.fixture
def page(meadow: Program, context: BrowserContext) -> Iterator[Page]:
    yield from opened(let_run(meadow), context)


def test_a_field_is_a_layer_with_its_scale(page: Page) -> None:
    scale = page.locator("#field-scale")
    expect(scale.locator(".name")).to_have_text("warmth")
    expect(scale.locator(".low")).to_have_text("0 %")
    expect(scale.locator(".high")).to_have_text("80 %")
    warm = pixels_seen(page, "--field-4", "ground", 1_000)
    box = page.locator("#map").bounding_box()
    assert box is not None
    assert max(x for x, _ in warm) < box["x"] + box["width"] / 2 + 5  # the west of the world
    page.locator("#layers").click()
    page.get_by_label("Which field").select_option("grass")
    expect(scale.locator(".name")).to_have_text("grass")
    expect(scale.locator(".high")).to_have_text("1")  # it grows up to there
    full = pixels_seen(page, "--field-4", "ground", 1_000)
    assert max(y for _, y in full) > box["y"] + box["height"] / 2
    page.get_by_label("Field", exact=True).uncheck()
    expect(scale).to_be_hidden()
    assert not pixels(page, "--field-4", "ground")


def test_the_past_has_the_field_of_then(page: Page) -> None:
    page.locator("#layers").click()
    page.get_by_label("Which field").select_option("grass")
    page.keyboard.press("Escape")
    high = page.locator("#field-scale .high")
    expect(high).to_have_text("1")
    pause(page)
    page.locator("#scrub").focus()
    page.keyboard.press("Home")
    expect(page.locator("#field-scale .told")).to_be_hidden()
    expect(high).to_have_text("0.2")
    page.keyboard.press("F8")
    expect(high).to_have_text("1")


def test_an_answer_of_then_is_not_taken_for_one_of_now(meadow: Program, blank: Page) -> None:
    """A question of now comes to the desk when the page already looks at the past, and is answered with the field of
    then; and the page is back before it has asked again."""
    between = Between(blank)
    blank.goto(let_run(meadow).address)
    high = blank.locator("#field-scale .high")
    blank.locator("#layers").click()
    blank.get_by_label("Which field").select_option("grass")
    blank.keyboard.press("Escape")
    expect(high).to_have_text("1")
    pause(blank)
    between.asking = {"field"}
    blank.keyboard.press("Control+.")
    until(blank, lambda: bool(between.asked))
    blank.locator("#scrub").focus()
    between.passed = set()
    blank.keyboard.press("Home")
    until(blank, lambda: "look" in between.passed)
    between.ask()
    expect(high).to_have_text("0.2")
    blank.keyboard.press("F8")
    expect(high).to_have_text("1")


def test_a_world_without_fields_has_no_such_layer(program: Program, context: BrowserContext) -> None:
    for page in opened(program, context):
        page.locator("#layers").click()
        expect(page.locator("#layer-names")).to_be_visible()
        expect(page.locator("#layer-field")).to_be_hidden()
        expect(page.locator("#layer-sight")).to_be_hidden()  # its robots see nothing
        expect(page.locator("#field-scale")).to_be_hidden()
