"""The page when something comes late or twice: answers after somebody has gone on, a choice made again, a lost line.

As in `test_page`, the browser must have had nothing to complain about.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, Page, WebSocketRoute, expect

from console.running import PATIENCE, Program
from console.test_page import opened, pause, send, type_in, until

pytestmark = pytest.mark.browser

CREW = "(WHEN (> battery 66%) (JOIN crew))"
RENEWED = 2500
"""ms in which what the page renews by itself every second has been renewed."""

expect.set_options(timeout=1000 * PATIENCE)


class Between:
    """Stands between a page and its program: holds back what the program says of these types, until it is let go, and
    what the page asks of others."""

    def __init__(self, page: Page) -> None:
        self.held: list[str] = []
        self.holding: set[str] = set()
        self.asked: list[str | bytes] = []
        """What the page asks and is held back."""
        self.asking: set[str] = set()
        self.passed: set[str] = set()
        """The types of what the page has said."""
        self.cut_at = ""
        """The type of a message with which the line is cut instead."""
        self.deaf = self.mute = False
        """Whether what the page says is lost on the way, and what the program says."""
        page.route_web_socket(re.compile("/live"), self._join)

    def _join(self, page: WebSocketRoute) -> None:
        self._page = page
        program = page.connect_to_server()
        program.on_message(self._down)
        page.on_message(lambda data: self._up(program, data))

    def _down(self, data: str | bytes) -> None:
        if self.mute:
            return
        if isinstance(data, str) and json.loads(data)["type"] in self.holding:
            self.held.append(data)
        else:
            self._page.send(data)

    def _up(self, program: WebSocketRoute, data: str | bytes) -> None:
        kind = json.loads(data)["type"]
        if kind == self.cut_at:
            self.cut_at = ""
            self.cut()
        elif kind in self.asking:
            self._program = program
            self.asked.append(data)
        elif not self.deaf:
            self.passed.add(kind)
            program.send(data)

    def say(self, data: str) -> None:
        """Tell the page something that was held back."""
        self._page.send(data)

    def cut(self) -> None:
        """Cut the line; the page gets another one."""
        self._page.close()

    def wait(self, page: Page) -> None:
        """Until something is held back."""
        until(page, lambda: bool(self.held))

    def ask(self) -> None:
        """Let the page's questions pass, those that were held back first."""
        self.asking = set()
        for data in self.asked:
            self._program.send(data)
        self.asked = []

    def let_go(self) -> None:
        self.holding = set()
        for data in self.held:
            self._page.send(data)
        self.held = []


@pytest.fixture
def blank(context: BrowserContext) -> Iterator[Page]:
    """A page that is not open yet."""
    page = context.new_page()
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    yield page
    assert not complaints, complaints


@pytest.fixture
def rovers(program: Program, context: BrowserContext) -> Iterator[Page]:
    yield from opened(program, context)


def test_a_text_that_is_typed_before_the_first_account_stays(program: Program, blank: Page) -> None:
    between = Between(blank)
    between.holding = {"commands"}
    blank.goto(program.address)
    between.wait(blank)
    blank.locator("#text").fill("(WHEN (> battery 10%) (JOIN mine))")
    between.let_go()
    expect(blank.locator("#yes")).to_have_text("20")
    expect(blank.locator("#text")).to_have_value("(WHEN (> battery 10%) (JOIN mine))")


def test_what_is_sent_stays_as_it_is_until_its_answer(program: Program, blank: Page) -> None:
    between = Between(blank)
    blank.goto(program.address)
    text, sort = blank.locator("#text"), blank.locator("#sort")
    expect(blank.locator("#yes")).to_have_text(re.compile(r"\d+"))
    type_in(blank, CREW)
    sort.select_option("standing")
    between.holding = {"refused"}
    text.press("Enter")
    between.wait(blank)
    text.press("End")
    blank.keyboard.type("; I go on")
    blank.get_by_role("button", name="Full ones").click()
    expect(text).to_have_value(CREW)  # or the refusal would be about another text
    expect(sort).to_be_disabled()
    between.let_go()
    expect(blank.locator("#findings")).to_contain_text("send it as a one-shot command")
    expect(sort).to_have_value("standing")
    sort.select_option("once")
    send(blank)
    expect(text).to_have_value("")
    expect(text).to_be_editable()


@pytest.mark.nightly
def test_the_page_says_that_the_simulator_is_being_compiled(context: BrowserContext, tmp_path: Path) -> None:
    """At once, and until robots move, when nothing has ever been compiled."""
    pytest.importorskip("numba")
    with Program("demo", "crowd", "--robots", "40", XDG_CACHE_HOME=str(tmp_path)) as program:
        for page in opened(program, context):
            expect(page.locator("#preparing")).to_be_visible()
            counted = re.compile(r"Compiling the simulator, once on this computer: kernel \d+ of at most \d+\. Then")
            expect(page.locator("#preparing")).to_contain_text(counted)
            expect(page.locator("#achieved")).to_have_text("compiling")
            expect(page.locator("#preparing")).to_be_hidden()
            expect(page.locator("#achieved")).to_have_text(re.compile("running"))
            expect(page.locator("#clock")).not_to_have_text("0:00:00")


def test_a_line_that_is_lost_right_after_a_command_went_out(program: Program, blank: Page) -> None:
    between = Between(blank)
    blank.goto(program.address)
    expect(blank.locator("#yes")).to_have_text(re.compile(r"\d+"))
    type_in(blank, "(WHEN (> battery 64%) (JOIN crew))")
    between.cut_at = "commands"
    blank.locator("#text").press("Enter")
    expect(blank.locator("#commands tr").first).to_contain_text("64%")  # once there is a line again
    expect(blank.locator("#offline")).to_be_hidden()


def test_names_that_come_late_leave_a_choice_alone(program: Program, blank: Page) -> None:
    between = Between(blank)
    blank.goto(program.address)
    expect(blank.locator("#yes")).to_have_text(re.compile(r"\d+"))
    pause(blank)  # what drives on is drawn, and nobody looks at it
    option = blank.locator("#completions [role=option]")
    for leave in (False, True):
        blank.locator("#text").fill("")
        blank.locator("#text").press_sequentially("(di")
        expect(option.filter(has_text=re.compile("^DIST"))).to_be_visible()
        blank.wait_for_timeout(RENEWED)  # the names are old now, and are asked for anew
        between.holding = {"named"}
        blank.keyboard.type("s")
        between.wait(blank)
        expect(option.first).to_be_visible()
        if leave:
            blank.locator("#map").focus()
            between.let_go()
            blank.wait_for_timeout(200)
            expect(blank.locator("#completions")).to_be_hidden()
        else:
            blank.keyboard.press("ArrowDown")
            between.let_go()
            blank.wait_for_timeout(200)
            expect(option.first).to_have_attribute("aria-selected", "true")
            blank.keyboard.press("Enter")  # chooses, and sends nothing
            expect(blank.locator("#text")).to_have_value("(DIST")


def test_the_lights_are_of_what_was_touched_last(rovers: Page) -> None:
    type_in(rovers, CREW)
    row = send(rovers)
    lit = rovers.locator("#legend .lit")
    expect(lit).to_contain_text("matched")
    type_in(rovers, "(WHEN (> battery 5%) (JOIN others))")
    expect(lit).to_have_text("20 would obey")
    row.click()  # no longer
    row.click()
    expect(lit).to_contain_text("matched")
    rovers.wait_for_timeout(RENEWED)
    assert "matched" in lit.inner_text()
    row.click()
    expect(lit).to_have_text("20 would obey")
    row.click()
    expect(lit).to_contain_text("matched")
    rovers.locator("#text").press("End")
    rovers.keyboard.type(" ")
    expect(lit).to_have_text("20 would obey")


def test_a_robot_that_is_chosen_again_is_shown_again(rovers: Page) -> None:
    pause(rovers)  # so that nothing new is to be told of it
    rows = rovers.locator("#pane-values tr", has_text="battery")
    rovers.locator("#map").focus()
    rovers.keyboard.press("ArrowRight")
    rovers.locator("#tab-values").click()
    expect(rows).to_have_count(1)
    rovers.locator("#map").focus()
    rovers.keyboard.press("Escape")
    expect(rovers.locator("#no-robot")).to_be_visible()
    rovers.keyboard.press("ArrowRight")
    expect(rows).to_have_count(1)
    rovers.locator("#run").click()
    expect(rovers.locator("#achieved")).not_to_have_text("paused")


def test_a_text_that_is_too_long_is_refused_in_words(rovers: Page) -> None:
    for count in (16_385, 200_000):
        rovers.locator("#text").fill("; " + "x" * (count - 2))
        expect(rovers.locator("#findings")).to_have_text(
            f"This has {count:,} characters, and a command may have 16,384: send it in parts."
        )
        rovers.locator("#text").press("Enter")
        expect(rovers.locator("#findings")).to_contain_text("send it in parts")
    expect(rovers.locator("#offline")).to_be_hidden()


LEAPS = """
async () => {
  const { Trails } = await import("/static/trails.js");
  const trails = new Trails();
  return [[0, 1000], [2, 1200], [500, 1400], [502, 1600], [90, 1800], [92, 2000]].map(([tick, now]) => {
    trails.sample({ count: 1, tick, time: tick / 10, wanted: 1, poses: new Float32Array([tick, 0, 0]) }, now);
    return trails.samples.length;
  });
}
"""


def test_no_trail_leads_to_where_a_slider_was_moved(modules: Page) -> None:
    assert modules.evaluate(LEAPS) == [1, 2, 1, 2, 1, 2]


AROUND = """
async () => {
  const { Trails } = await import("/static/trails.js");
  const trails = new Trails();
  [9, 9.5, 0.2, 0.7].forEach((x, tick) => {
    const poses = new Float32Array([x, 5, 0]);
    trails.sample({ count: 1, tick, time: tick, wanted: 5, poses }, 1000 + 200 * tick);
  });
  const lines = [];
  window.Path2D = class {
    moveTo(x) { this.x = x; }
    lineTo(x) { lines.push([this.x, x].map((each) => Math.round(10 * each) / 10)); this.x = x; }
  };
  const view = { toScreenX: (x) => x, toScreenY: (y) => y, width: 10, height: 10 };
  trails.path(trails.samples, view, [0], 0, [0, 0, 10, 10]);
  return lines;
}
"""


def test_no_trail_crosses_the_map_where_a_robot_leaves_a_torus(modules: Page) -> None:
    assert modules.evaluate(AROUND) == [[0.7, 0.2], [9.5, 9]]


def test_two_pages_keep_one_history(rovers: Page, context: BrowserContext, program: Program) -> None:
    other = context.new_page()
    other.goto(program.address)
    expect(other.locator("#commands tr").first).to_be_visible()

    def kept(page: Page) -> list[str]:
        """The levels of the last three, as this page reads them."""
        texts = json.loads(page.evaluate("localStorage.getItem('sleepcast.history') ?? '[]'"))
        return [re.findall(r"\d+", text)[0] for text in texts[-3:]]

    def told(level: str) -> bool:
        """Whether the browser has brought it to both."""
        return kept(rovers)[-1:] == kept(other)[-1:] == [level]

    for page, level in ((rovers, "41"), (rovers, "42"), (other, "43")):
        type_in(page, f"(WHEN (> battery {level}%) (JOIN crew))")
        send(page)
        until(page, partial(told, level))
    assert kept(rovers) == kept(other) == ["41", "42", "43"]


def test_a_stop_that_nobody_answers_says_so_and_goes_out_again(program: Program, blank: Page) -> None:
    between = Between(blank)
    blank.goto(program.address)
    expect(blank.locator("#yes")).to_have_text(re.compile(r"\d+"))
    stopped = blank.locator("#stopped-text")
    between.deaf = True
    blank.keyboard.press("F9")
    expect(stopped).to_have_text("STOP was sent, but the station has not confirmed it. Do not rely on it.")
    between.deaf = False
    between.cut()  # what was sent on that line is lost
    expect(stopped).to_have_text("STOP: all 20 robots are at rest.")
    blank.locator("#release").click()
    expect(stopped).to_be_hidden()
    blank.wait_for_timeout(1500)
    assert stopped.is_hidden()


def test_a_line_on_which_nothing_is_heard_is_told(program: Program, blank: Page) -> None:
    between = Between(blank)
    blank.goto(program.address)
    expect(blank.locator("#yes")).to_have_text(re.compile(r"\d+"))
    pause(blank)
    blank.locator("#text").fill("")  # nothing is asked, and there is nothing new
    offline = blank.locator("#offline")
    blank.wait_for_timeout(8000)
    assert offline.is_hidden()
    between.mute = True
    expect(offline).to_contain_text("No data from the station for several seconds.")
    between.mute = False
    expect(offline).to_be_hidden()
    blank.locator("#run").click()
    expect(blank.locator("#achieved")).not_to_have_text("paused")


def test_the_page_works_where_nothing_may_be_kept(program: Program, blank: Page) -> None:
    forbidden = (
        "Object.defineProperty(window, 'localStorage', { get() { throw new DOMException('', 'SecurityError') } })"
    )
    blank.add_init_script(forbidden)
    blank.goto(program.address)
    expect(blank.locator("#title")).to_have_text("a small world")
    expect(blank.locator("#yes")).not_to_have_text("–")  # the prompt has been filled, and will not be again
    for level in (51, 52):
        type_in(blank, f"(WHEN (> battery {level}%) (JOIN crew))")
        send(blank)
    for level in (52, 51):
        blank.locator("#text").press("ArrowUp")
        expect(blank.locator("#text")).to_have_value(f"(WHEN (> battery {level}%) (JOIN crew))")
    blank.locator("#theme").click()
    expect(blank.locator("html")).to_have_attribute("data-theme", "dark")


def test_what_was_said_before_the_page_turned_does_not_turn_it_back(program: Program, blank: Page) -> None:
    between = Between(blank)
    blank.goto(program.address)
    body, clock = blank.locator("body"), blank.locator("#clock")
    expect(clock).not_to_have_text("0:00:00")
    pause(blank)
    between.holding = {"span"}
    blank.locator("#run").click()  # so that something of now is said
    between.wait(blank)
    pause(blank)
    blank.locator("#scrub").press("Home")
    expect(clock).to_have_text("0:00:00")
    of_now, of_then = between.held[0], until(blank, lambda: between.held[-1] if at(between.held[-1]) == 0.0 else "")
    assert at(of_now) is None
    blank.wait_for_timeout(RENEWED)  # later than any hand still moves
    between.say(of_now)
    blank.wait_for_timeout(100)
    expect(body).to_have_class(re.compile(r"\bpast\b"))
    blank.keyboard.press("F8")
    expect(clock).not_to_have_text("0:00:00")
    between.say(of_then)
    blank.wait_for_timeout(100)
    expect(body).not_to_have_class(re.compile(r"\bpast\b"))


def at(span: str) -> float | None:
    """What a page looks at, as it was told."""
    found: float | None = json.loads(span)["at"]
    return found
