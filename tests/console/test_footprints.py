"""What cameras that look down see, on the map in a real Chromium, in its scene and in pictures."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import BrowserContext, Page, expect

import sleepcast as sc
from console.conftest import page_of
from console.running import PATIENCE, Program
from console.test_page import opened, settle, until
from sleepcast.console.adapters.swarm import scene_of
from sleepcast.simulator import read_scenario

browser = pytest.mark.browser
TEXT = """
format = 2
title = "A copter over rovers"
seconds = "1min"

[world]
width = "60m"
height = "40m"

[neighbours]
reach = "5m"

[[robots]]
like = "copter"
starts = [{ x = "30m", y = "20m", z = "12m" }, ["10m", "20m"]]

[robots.camera]
angle = "90deg"

[[robots]]
type = "rover"
motion = "still"
starts = [["50m", "5m", "0deg"]]

[robots.limits]
speed = "1m/s"
turn_rate = "90deg/s"
acceleration = "1m/s2"

[robots.body]
radius = "0.3m"
"""
WITHOUT = TEXT.replace('[robots.camera]\nangle = "90deg"\n', "")

expect.set_options(timeout=1000 * PATIENCE)


@pytest.fixture(scope="module")
def field(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    with page_of(tmp_path_factory.mktemp("field"), TEXT) as started:
        yield started


@pytest.fixture
def copters(field: Program, context: BrowserContext) -> Iterator[Page]:
    yield from opened(field, context)


def covered(page: Page, canvas: str = "robots") -> int:
    """How many pixels on this canvas are as pale as a footprint."""
    settle(page)
    found: int = page.evaluate(
        """(id) => {
          const canvas = document.getElementById(id);
          const copy = Object.assign(document.createElement("canvas"), { width: canvas.width, height: canvas.height });
          const pen = copy.getContext("2d", { willReadFrequently: true });
          pen.drawImage(canvas, 0, 0);
          const { data } = pen.getImageData(0, 0, copy.width, copy.height);
          let seen = 0;
          for (let i = 3; i < data.length; i += 4) seen += Math.abs(data[i] - 0.14 * 255) < 3;
          return seen;
        }""",
        canvas,
    )
    return found


@browser
def test_a_disc_shows_what_each_sees_while_its_layer_is_shown(copters: Page) -> None:
    copters.locator("#space").click()
    for canvas in ("robots", "space-over"):
        until(copters, lambda canvas=canvas: covered(copters, canvas) > 1000)
    copters.locator("#layers").click()
    copters.get_by_role("checkbox", name="Footprints of cameras").uncheck()
    for canvas in ("robots", "space-over"):
        until(copters, lambda canvas=canvas: covered(copters, canvas) < 1000)
    copters.get_by_role("checkbox", name="Footprints of cameras").check()


@browser
def test_where_nobody_has_a_camera_there_is_no_such_layer(program: Program, context: BrowserContext) -> None:
    for page in opened(program, context):
        page.locator("#layers").click()
        expect(page.locator("#layer-sensors")).to_be_visible()
        expect(page.locator("#layer-footprints")).to_be_hidden()


def test_the_scene_tells_how_wide_they_are() -> None:
    names = ("copter1", "copter2", "rover1")
    assert scene_of(read_scenario(TEXT), names).cameras == pytest.approx((1.0, 0.0))
    assert scene_of(read_scenario(WITHOUT), names).cameras == ()


def test_a_picture_has_a_disc_below_whoever_flies() -> None:
    with sc.open(TEXT) as fleet, sc.open(WITHOUT) as others:
        (disc,) = re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)" r="([\d.]+)"', fleet._repr_html_())
        assert [float(each) for each in disc] == pytest.approx([320.0, 213.3, 128.0], abs=0.1)
        assert "<circle" not in others._repr_html_()
