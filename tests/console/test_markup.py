"""Names and texts that look like a page's own language are shown as they are, and never become part of the page."""

from __future__ import annotations

import sys
from pathlib import Path
from time import monotonic

import pytest
from playwright.sync_api import BrowserContext, Page, expect

import forkserver
from cli.test_swarm import channel, swarm
from console.running import PATIENCE, Program
from console.test_page import opened, send, type_in
from small_worlds import write

__all__ = ["channel"]

pytestmark = pytest.mark.browser
expect.set_options(timeout=1000 * PATIENCE)

NAME, RULE = "<img/src=x/onerror=__hit=1>", "<svg/onload=__hit=1>"
TEXT = "'><script>__hit=1</script></title><img src=x onerror=__hit=1>"
RIGHT_TO_LEFT = "\u202e</b>{{7*7}}\u2066"


def assert_only_text(page: Page) -> None:
    """None of it has run, nor become an element."""
    assert page.evaluate("window.__hit") is None
    assert page.locator("img, body script:not([src]), [onerror]").count() == 0
    assert "49" not in page.locator("#title").inner_text()


def world(folder: Path) -> Path:
    title = (TEXT + RIGHT_TO_LEFT).replace("\\", "\\\\")
    place = '[places.house]\ntitle = "<img src=x onerror=__hit=1>"'
    ready = f'[[commands]]\ntitle = "{NAME}"\ntext = "(JOIN {NAME})"\nabout = "{TEXT}"\n'
    lines = f'mission = "mission.sleep"\ntitle = "{title}"\nabout = "{TEXT}"'
    file = write(folder, ('title = "a small world"', lines), ("[places.house]", place), more=ready)
    rule = f"(RULE {RULE} (WHEN (> battery 1%) (JOIN {NAME})))"
    said = f'@1s {rule}\n@2s (WHEN (> battery 1%) (REPORT "{TEXT}" battery))\n'
    (folder / "mission.sleep").write_text(said, encoding="utf-8")
    return file


def choose_a_robot(page: Page) -> None:
    """The next one on the map, as soon as there is one."""
    page.locator("#map").focus()
    name = page.locator("#robot-name")
    until = monotonic() + PATIENCE
    while name.inner_text() == "Robot" and monotonic() < until:
        page.keyboard.press("ArrowRight")
        page.wait_for_timeout(100)


def look_at_a_robot(page: Page) -> None:
    """At all that the page tells of one, as a person does."""
    choose_a_robot(page)
    page.locator("#tab-rules").click()
    expect(page.locator("#pane-rules")).to_contain_text(RULE)
    page.locator("#tab-said").click()
    expect(page.locator("#pane-said")).to_contain_text(TEXT)
    page.locator("#tab-values").click()
    expect(page.locator("#pane-values")).to_contain_text("battery")
    expect(page.locator("#legend")).to_contain_text(NAME)
    expect(page.locator("#title")).to_have_text(TEXT + RIGHT_TO_LEFT)
    expect(page).to_have_title(f"{TEXT}{RIGHT_TO_LEFT} · sleepcast")
    assert_only_text(page)


def test_markup_of_a_scenario_and_of_commands_is_text(context: BrowserContext, tmp_path: Path) -> None:
    world(tmp_path)
    with Program("run", tmp_path, "--page", "--speed", "5") as program:
        for page in opened(program, context):
            expect(page.locator("#ready")).to_contain_text(NAME)
            rule = f"(RULE {RULE} (WHEN (> battery 1%) (SETQ marked 1)))"
            type_in(page, f'(WHEN (> battery 1%) {rule} (JOIN {NAME}) (REPORT "{TEXT}" battery))')
            expect(send(page)).to_contain_text(TEXT)
            look_at_a_robot(page)
            page.locator("#tab-why").click()
            expect(page.locator("#pane-why")).to_contain_text(NAME)
            type_in(page, f"(WHEN (> {NAME} 1) (JOIN a))")
            expect(page.locator("#findings")).to_contain_text(NAME)
            assert_only_text(page)


def test_markup_in_a_recording_is_text(context: BrowserContext, tmp_path: Path) -> None:
    world(tmp_path)
    record = ("run", str(tmp_path), "--record", str(tmp_path / "run.mcap"))
    forkserver.run([sys.executable, "-m", "sleepcast", *record], check=True, capture_output=True)
    with Program("replay", tmp_path / "run.mcap") as program:
        page = context.new_page()
        page.goto(program.address)
        expect(page.locator("#commands")).to_contain_text(NAME)
        expect(page.locator("#legend")).to_contain_text(NAME)
        expect(page.locator("#title")).to_have_text(TEXT + RIGHT_TO_LEFT)
        assert_only_text(page)


@pytest.mark.parametrize("prefix", [NAME, "<b>" * 20 + "r" * 3])
def test_markup_in_robots_names_is_text(context: BrowserContext, channel: str, prefix: str) -> None:
    with swarm(2, channel, "--name-prefix", prefix), Program("console", "--channel", channel, "--every", "0.3") as desk:
        page = context.new_page()
        page.goto(desk.address)
        expect(page.locator("#place-text, #scale-text").first).not_to_be_empty()
        choose_a_robot(page)
        expect(page.locator("#robot-name")).to_contain_text(prefix)
        expect(page.locator("#heard")).to_contain_text(prefix)
        assert page.evaluate("window.__hit") is None
        assert page.locator("img, b b, [onerror]").count() == 0
