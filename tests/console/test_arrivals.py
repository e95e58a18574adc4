"""Robots that are added from the page."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import BrowserContext, expect

import sleepcast as sc
from console.running import PATIENCE, Page, Program
from console.test_page import await_picture
from sleepcast.console.adapters.swarm import SwarmAdapter

YARD = """
format = 2
title = "Yard"
seconds = "1min"

[world]
width = "10m"
height = "10m"

[[robots]]
type = "digger"
count = 2
most = 4
starts = [["1m", "1m"], ["2m", "1m"]]
motion = "still"
like = "scout"

[[robots]]
type = "carrier"
count = 1
most = 9
motion = "still"
like = "scout"
"""


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    """Robots that stand in a yard with room for more, and time that stands still."""
    folder = tmp_path_factory.mktemp("yard")
    (folder / "scenario.toml").write_text(YARD, encoding="utf-8")
    with Program("run", folder, "--page", waits=True) as started:
        yield started


def test_only_a_run_with_room_lets_people_add_robots() -> None:
    with sc.open("bravo", robots=3) as fleet:
        adapter = SwarmAdapter(fleet.swarm)
        assert (adapter.scene.addable, adapter.add_robot) == ((), None)
    with sc.open(YARD) as fleet:
        assert SwarmAdapter(fleet.swarm).scene.addable == ("digger", "carrier")


def test_a_page_adds_robots_also_while_time_stands_still(page: Page) -> None:
    assert page.ask("addrobot", kind="digger", x=5.0, y=5.0)["robot"] == "digger4"
    told = page.until("roll", lambda found: "digger4" in found["names"])
    assert told["names"][:4] == ["digger1", "digger2", "digger4", ""]
    refused = page.ask("addrobot", kind="digger")
    assert (refused["type"], "say where this one is to stand" in refused["reason"]) == ("refused", True)
    refused = page.ask("addrobot", kind="digger", x=5.0, y=5.0)
    assert (refused["type"], "has no room at 5, 5 m" in refused["reason"]) == ("refused", True)
    assert page.ask("addrobot", kind="carrier")["robot"] == "carrier5"


@pytest.mark.browser
def test_robots_are_added_by_hand(program: Program, context: BrowserContext) -> None:
    expect.set_options(timeout=1000 * PATIENCE)
    page = context.new_page()
    page.goto(program.address)
    await_picture(page)
    expect(page.locator("#robot")).to_be_hidden()  # nobody is chosen, least of all a row without a robot
    page.locator("#layers").click()
    page.locator("#add-robot").click()
    expect(page.locator("#layer-menu")).to_be_hidden()  # it would lie over the place, and over the bar
    said = page.locator("#arrival-bar .said")
    expect(said).to_contain_text("Click where the robot is to stand")
    page.locator("#arrival-bar .kinds").select_option("carrier")
    place = page.locator("#map").bounding_box()
    assert place is not None
    page.mouse.click(place["x"] + 0.5 * place["width"], place["y"] + 0.4 * place["height"])
    expect(said).to_contain_text("is there.")
    page.locator("#map").press("Enter")
    expect(said).to_contain_text("is there.")
    page.mouse.click(place["x"] + 0.5 * place["width"], place["y"] + 0.4 * place["height"])
    expect(said).to_contain_text("a carrier has no room at")
    page.locator("#map").press("Escape")
    expect(page.locator("#arrival-bar")).to_be_hidden()
    page.keyboard.press("Control+k")
    page.locator("#finder input").fill("add robots")
    page.keyboard.press("Enter")
    expect(page.locator("#arrival-bar")).to_be_visible()
    page.locator("#build").evaluate("button => button.click()")
    expect(page.locator("#arrival-bar")).to_be_hidden()
    expect(page.locator("#obstacle-bar")).to_be_visible()
