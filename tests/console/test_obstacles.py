"""Obstacles that are built, moved and cleared away from the page."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, expect
from playwright.sync_api import Page as BrowserPage

import sleepcast as sc
from console.running import PATIENCE, Page, Program
from console.test_page import await_picture, pixels, until
from sleepcast.console.adapters.obstacles import editor_of
from sleepcast.console.adapters.swarm import SwarmAdapter
from sleepcast.core.errors import MisuseError
from sleepcast.simulator import Polygon
from sleepcast.simulator.recording.recording import load_recording
from small_worlds import SCOUTS, scouts, write

SQUARE = [(2.0, 2.0), (4.0, 2.0), (4.0, 4.0), (2.0, 4.0)]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    """A scout in a room."""
    folder = tmp_path_factory.mktemp("scout")
    write(folder, text=SCOUTS)
    with Program("run", folder, "--page", "--speed", "1") as started:
        yield started


def test_a_thing_is_built_moved_and_cleared(tmp_path: Path) -> None:
    world = scouts(tmp_path)
    editor = editor_of(world)
    assert editor is not None
    editor.build(SQUARE)
    editor.shift(editor.version, 1, 5.0, -1.0)
    edge, thing = world.world.shapes.values()
    assert thing == Polygon(tuple((x + 5.0, y - 1.0) for x, y in SQUARE))
    editor.clear(editor.version, 1)
    assert list(world.world.shapes.values()) == [edge]


def test_nothing_is_changed_by_mistake(tmp_path: Path) -> None:
    world = scouts(tmp_path)
    editor = editor_of(world)
    assert editor is not None
    for corners, reason in (
        ([(0.0, 0.0), (12.5, 0.0), (5.0, 5.0)], "outside the world of 12 m by 12 m"),
        ([(1.0, 1.0), (1.0, 1.0), (5.0, 5.0)], "the same point twice"),
    ):
        with pytest.raises(MisuseError, match=reason):
            editor.build(corners)
    editor.build(SQUARE)
    seen = editor.version
    editor.build([(x + 5.0, y) for x, y in SQUARE])
    for version, place in ((seen, 1), (editor.version, 3)):
        with pytest.raises(MisuseError, match="have changed meanwhile"):
            editor.clear(version, place)
        with pytest.raises(MisuseError, match="have changed meanwhile"):
            editor.shift(version, place, 1.0, 1.0)
    assert len(world.world.shapes) == 3


def test_a_change_is_undone_and_done_again_unless_somebody_else_has_changed_the_thing(tmp_path: Path) -> None:
    world = scouts(tmp_path)
    editor = editor_of(world)
    assert editor is not None
    built = editor.build(SQUARE)
    editor.build([(x + 5.0, y) for x, y in SQUARE])
    first = dict(world.world.shapes)
    moved = editor.shift(editor.version, 1, 0.1, 0.3)
    assert (built.obstacle, moved.obstacle) == (2, 2)
    second = dict(world.world.shapes)
    cleared = editor.clear(editor.version, 1)
    editor.undo(cleared.change, again=False)
    assert list(world.world.shapes.items()) == list(second.items())  # in the same order, under the same numbers
    editor.undo(moved.change, again=False)
    assert world.world.shapes == first  # to the last bit
    editor.undo(moved.change, again=True)
    assert world.world.shapes == second
    editor.shift(editor.version, 1, 1.0, 1.0)
    for change, again in ((moved, False), (moved, True), (cleared, True)):
        with pytest.raises(MisuseError, match="Obstacle 2 has been changed by somebody else"):
            editor.undo(change.change, again)
    with pytest.raises(MisuseError, match="Only the last 200 changes"):
        editor.undo(99, again=False)


def test_robots_that_feel_nothing_have_a_world_that_stays() -> None:
    with sc.open("bravo", robots=3) as fleet:
        adapter = SwarmAdapter(fleet.swarm)
        assert adapter.editor is None
        assert adapter.scene.version is None


def test_what_was_built_is_recorded(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    folder = tmp_path / "scouts"
    folder.mkdir()
    scenario = str(write(folder, text=SCOUTS))
    with sc.open(scenario, seed=2) as fleet, fleet.record(file):
        fleet.run(1)
        editor = editor_of(fleet.swarm.simulator)
        assert editor is not None
        editor.build([(1.0, 1.0), (2.0, 1.0), (2.0, 2.0)])
        fleet.run(1)
    (change,) = load_recording(file).obstacles
    assert list(change.put.values()) == [Polygon(((1.0, 1.0), (2.0, 1.0), (2.0, 2.0)))]
    assert not change.own


def test_a_page_asks_for_it(page: Page) -> None:
    assert page.news["hello"]["scene"]["version"] == 1  # the wall around the room
    assert page.ask("build", corners=SQUARE)["type"] == "built"
    told = page.until("obstacles", lambda found: len(found["obstacles"]) == 2)
    assert [tuple(corner) for corner in told["obstacles"][1][0]] == SQUARE
    refused = page.ask("clear", version=told["version"] + 1, place=1)
    assert (refused["type"], "changed meanwhile" in refused["reason"]) == ("refused", True)
    assert page.ask("shift", version=told["version"], place=1, across=1.0, up=0.0)["type"] == "built"
    told = page.until("obstacles", lambda found: found["obstacles"][1][0][0][0] == 3.0)
    cleared = page.ask("clear", version=told["version"], place=1)
    assert (cleared["type"], cleared["obstacle"]) == ("built", 2)
    page.until("obstacles", lambda found: len(found["obstacles"]) == 1)
    assert page.ask("undo", change=cleared["change"])["type"] == "undone"
    page.until("obstacles", lambda found: len(found["obstacles"]) == 2)
    assert page.ask("undo", change=cleared["change"], again=True)["type"] == "undone"
    page.until("obstacles", lambda found: len(found["obstacles"]) == 1)
    assert page.ask("undo", change=cleared["change"], again=True)["type"] == "refused"


def top(page: BrowserPage) -> float:
    """The uppermost pixel of any obstacle, 0 where there is none."""
    return min((at[1] for at in pixels(page, "--map-obstacle", "ground")), default=0.0)


@pytest.mark.browser
def test_obstacles_are_drawn_by_hand(program: Program, context: BrowserContext) -> None:
    expect.set_options(timeout=1000 * PATIENCE)
    page = context.new_page()
    page.goto(program.address)
    await_picture(page)
    page.locator("#layers").click()
    page.locator("#build").click()
    place = page.locator("#map").bounding_box()
    assert place is not None
    x, y = place["x"] + place["width"] / 2, place["y"] + place["height"] / 2
    for across, up in ((0, 0), (80, 0), (80, 60)):
        page.mouse.click(x + across, y - up)
    page.keyboard.press("Enter")
    until(page, lambda: len(pixels(page, "--map-obstacle", "ground")) > 1000)
    page.mouse.click(x + 60, y - 20)
    expect(page.locator("#obstacle-bar .remove")).to_be_visible()
    page.mouse.move(x + 60, y - 20)
    page.mouse.down()
    page.mouse.move(x + 60, y + 80, steps=4)
    page.mouse.up()
    until(page, lambda: top(page) > y + 20)
    page.mouse.click(x + 60, y + 80)
    page.keyboard.press("Delete")
    until(page, lambda: not pixels(page, "--map-obstacle", "ground"))
    page.keyboard.press("Control+z")
    expect(page.locator("#undone")).to_have_text(re.compile(r"Undone: remove obstacle \d\s+Redo"))
    until(page, lambda: top(page) > y + 20)
    expect(page.locator("#obstacle-bar .undo")).to_have_text(re.compile(r"Undo: move obstacle \d"))
    page.locator("#obstacle-bar .undo").click()
    until(page, lambda: 0 < top(page) < y - 20)
    page.keyboard.press("Control+z")
    expect(page.locator("#obstacle-bar .undo")).to_be_hidden()
    until(page, lambda: not pixels(page, "--map-obstacle", "ground"))
    page.keyboard.press("Control+z")
    expect(page.locator("#undone")).to_contain_text("Nothing to undo. Commands to robots are never undone")
    page.keyboard.press("Control+Shift+Z")
    until(page, lambda: len(pixels(page, "--map-obstacle", "ground")) > 1000)
    page.locator("#obstacle-bar .done").click()
    expect(page.locator("#obstacle-bar")).to_be_hidden()
    page.locator("#map").press("l")
    page.mouse.click(x, y + 10)
    page.keyboard.press("Control+k")
    page.locator("#finder input").fill("redo move")
    page.keyboard.press("Enter")
    until(page, lambda: top(page) > y + 20)
    page.locator("#layers").click()
    page.locator("#layer-trails").uncheck()
    page.keyboard.press("Control+z")
    expect(page.locator("#layer-trails")).to_be_checked()
    expect(page.locator("#undone")).to_contain_text("Undone: hide trails")
    page.locator("#map").press("Control+z")
    until(page, lambda: 0 < top(page) < y - 20)
