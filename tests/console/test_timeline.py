"""The timeline on a living page: the past is looked at while the run goes on, and one key leads back."""

from __future__ import annotations

import base64
import re
import struct
from math import ceil

import pytest
from playwright.sync_api import BrowserContext, expect

from console.running import PATIENCE, Page, Program, open_page
from console.test_page import clock as clock_of
from console.test_page import until

expect.set_options(timeout=1000 * PATIENCE)


def time_of(frame: bytes) -> float:
    return float(struct.unpack_from("<d", frame, 16)[0])


def next_time(page: Page) -> float:
    return time_of(page.frame())


def running(page: Page, until: float) -> None:
    """Let time run until then at least."""
    page.tell("pace", running=True)
    while next_time(page) < until:
        pass


def test_the_past_is_a_matter_of_one_page(program: Program) -> None:
    with open_page(program) as one, open_page(program) as other:
        running(one, 4.0)
        one.ask("send", text="(WHEN (> battery 50%) (JOIN early))")
        one.ask("send", text="(WHEN (IN early) (RULE guard (/ 1 0)))")
        one.until("failing", lambda found: bool(found["rules"]))
        then = ceil(next_time(one)) + 2.0
        running(one, then + 0.05)  # the tick of then is over
        one.tell("look", time=2.0)
        while next_time(one) != 2.0:
            pass
        span = one.until("span", lambda found: found["at"] == 2.0 and found["exact"])
        assert span["ended"] >= then
        assert span["note"] == ""
        one.until("commands", lambda found: found["rows"] == [])
        one.until("failing", lambda found: not found["rules"])
        assert one.ask("failed", rule="guard")["type"] == "refused"
        assert other.wait_for("span")["at"] is None
        before = next_time(other)
        while next_time(other) < before + 1.0:
            pass
        one.tell("look", time=None)
        while next_time(one) < then + 1.0:
            pass
        one.until("commands", lambda found: len(found["rows"]) == 2)
        (rule,) = one.until("failing", lambda found: bool(found["rules"]))["rules"]
        one.tell("look", time=then)
        one.until("span", lambda found: found["at"] == pytest.approx(then))
        marks = base64.b64decode(one.ask("failed", rule="guard")["outcomes"])
        assert marks.count(1) == rule["robots"]


def test_what_is_sent_and_stopped_acts_on_now(program: Program) -> None:
    with open_page(program) as page:
        running(page, 10.0)
        page.tell("look", time=1.0)
        refused = page.ask("send", text="(WHEN (> battery 50%) (JOIN late))")
        assert refused["type"] == "refused"
        assert "Go back to live (F8)" in refused["reason"]
        page.tell("stop")
        page.until("safety", lambda found: found["latched"])
        page.tell("release")
        page.until("safety", lambda found: not found["latched"])


@pytest.mark.browser
def test_the_past_is_scrubbed_and_left_by_one_key(program: Program, context: BrowserContext) -> None:
    with open_page(program) as page:
        running(page, 20.0)
        page.ask("send", text="(WHEN (> battery 60%) (JOIN marked_ones))")
        running(page, 24.0)
    screen = context.new_page()
    complaints: list[str] = []
    screen.on("pageerror", lambda error: complaints.append(str(error)))
    screen.goto(program.address)
    strip, clock, said = screen.locator("#scrub"), screen.locator("#clock"), screen.locator(".timeline .moment")
    expect(strip).to_be_visible()
    box = strip.bounding_box()
    assert box is not None
    screen.mouse.click(box["x"] + 0.25 * box["width"], box["y"] + 2)
    expect(said).to_contain_text(re.compile(r"ago\. Live goes on\.$"))
    expect(screen.locator("body")).to_have_class(re.compile(r"\bpast\b"))
    ended = float(strip.get_attribute("aria-valuemax") or 0.0)
    until(screen, lambda: clock_of(screen) < 0.5 * ended)  # the picture of then comes later than what is said of it
    stood = clock.inner_text()
    until(screen, lambda: "ago" in said.inner_text() and clock.inner_text() == stood)
    strip.press("Home")
    expect(clock).to_have_text("0:00:00")
    mark = screen.locator(".timeline .mark.command").last
    mark.click()
    expect(screen.locator("#commands tr[aria-selected=true] code")).to_contain_text("marked_ones")
    screen.locator("#map").focus()
    screen.keyboard.press("ArrowRight")
    expect(screen.locator("#pane-why .verdict")).to_contain_text("matched")
    screen.locator("#text").fill("(WHEN (> battery 60%) (ST))")
    screen.keyboard.press("F8")
    expect(screen.locator("body")).not_to_have_class(re.compile(r"\bpast\b"))
    expect(said).to_be_empty()
    until(screen, lambda: clock.inner_text() > "0:00:23")
    assert not complaints


@pytest.mark.browser
def test_why_is_about_the_moment_at_which_the_page_looks(program: Program, context: BrowserContext) -> None:
    with open_page(program) as page:
        running(page, next_time(page) + 1.0)
        page.ask("send", text="(AFTER-ISSUE 8s (JOIN patient))", everybody=True)
        issued = next_time(page)
        running(page, issued + 12.0)
        page.tell("pace", running=False)
    screen = context.new_page()
    screen.goto(program.address)
    screen.locator("#map").focus()
    screen.keyboard.press("ArrowRight")
    why = screen.locator("#pane-why")
    expect(why.locator(".verdict")).to_contain_text("matched")
    strip = screen.locator("#scrub")
    box = strip.bounding_box()
    assert box is not None
    share = (issued + 4.0) / float(strip.get_attribute("aria-valuemax") or 0.0)
    screen.mouse.click(box["x"] + share * box["width"], box["y"] + 2)
    expect(screen.locator("body")).to_have_class(re.compile(r"\bpast\b"))
    expect(why).to_contain_text("waits for the instant of this command")
    screen.keyboard.press("F8")
    expect(why.locator(".verdict")).to_contain_text("matched")
