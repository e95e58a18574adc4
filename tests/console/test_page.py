"""The page in a real Chromium: what a newcomer does with bravo, and what the page must bear.

Every test also sees to it that the page asked nobody but its own server, and that the browser had nothing to complain
about: no exception, no error, no breach of the content policy.
"""

from __future__ import annotations

import json
import re
import struct
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

import pytest
from playwright.sync_api import BrowserContext, ConsoleMessage, Locator, Page, WebSocket, expect

from console.running import PATIENCE, Program, open_page
from small_worlds import SMALL, write

pytestmark = pytest.mark.browser

Found = TypeVar("Found")

SENTENCE = "(WHEN (AND (< (DIST x y vessel_x vessel_y) 5mi) (> fuel 50%) (> ordnance 70%)) (JOIN bravo))"
EXPECTED = range(15, 46)
"""Members of Bravo: about 29 of 1,000 (pi 25 / 400 x 0.5 x 0.3), within three standard deviations."""

expect.set_options(timeout=1000 * PATIENCE)

SLOW = "GPU stall due to ReadPixels"
"""What Chromium says of drawing in three dimensions where there is no graphics card."""


@pytest.fixture
def page(bravo: Program, context: BrowserContext) -> Iterator[Page]:
    """Bravo's page, open and alive."""
    yield from opened(bravo, context)


@pytest.fixture
def rovers(program: Program, context: BrowserContext) -> Iterator[Page]:
    """The small world's page."""
    yield from opened(program, context)


def opened(program: Program, context: BrowserContext) -> Iterator[Page]:
    page = context.new_page()
    complaints: list[str] = []

    def hear(said: ConsoleMessage) -> None:
        if said.type in ("error", "warning") and SLOW not in said.text:
            complaints.append(said.text)

    page.on("console", hear)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: complaints.append(request.url) if program.host not in request.url else None)
    page.goto(program.address)
    await_picture(page)
    expect(page.locator("#yes")).not_to_have_text("–")
    expect(page.locator("#scale-text")).not_to_be_empty()
    yield page
    assert not complaints, complaints


def await_picture(page: Page) -> None:
    """Wait until the page has shown a first picture: before, what hands and keys do on the map is for nothing."""
    expect(page.locator("#run[data-waiting]")).to_have_count(1)


def number(found: Locator) -> int:
    return int(found.inner_text().replace(",", ""))


def type_in(page: Page, text: str, typed: int = 3) -> None:
    """Type over whatever the prompt holds. typed: how many of the last characters go in key by key, each of which the
    page colours, completes and asks its station about; the others are pasted."""
    page.locator("#text").fill(text[:-typed])
    page.locator("#text").press_sequentially(text[-typed:])
    page.keyboard.press("Escape")


def previewed(page: Page, count: str | re.Pattern[str]) -> None:
    expect(page.locator("#yes")).to_have_text(count)


def foretold_within(page: Page, least: int, most: int) -> None:
    """Wait until the preview of what has been typed counts so many; before, it may show what was typed earlier."""
    page.wait_for_function(
        """([least, most]) => {
          const count = Number(document.getElementById("yes").textContent.replace(",", ""));
          return count >= least && count <= most;
        }""",
        arg=[least, most],
        timeout=1000 * PATIENCE,
    )


def send(page: Page) -> Locator:
    """Press Enter in the prompt; gives the account of the command once everybody has answered."""
    field, rows = page.locator("#text"), page.locator("#commands tr")
    # Rows of earlier commands may still arrive, so the new one is known by its text among those that were not there.
    known = rows.evaluate_all("lines => lines.map((line) => line.dataset.id)")
    text = field.input_value()
    field.press("Enter")
    page.wait_for_function(
        """([known, text]) => {
          const first = document.querySelector("#commands tr");
          const typed = text.replace(/\\s+/g, " ");
          return !known.includes(first?.dataset.id) && first?.querySelector("code").textContent === typed;
        }""",
        arg=[known, text],
        timeout=1000 * PATIENCE,
    )
    expect(field).to_have_value("")  # the station's answer may come after the row
    row = rows.first
    expect(row.locator(".silent")).to_have_text("0")
    return row


def pause(page: Page) -> None:
    page.locator("#run").click()
    expect(page.locator("#achieved")).to_have_text("paused")


FIND_PIXELS = """
([name, layer]) => {
  const canvas = document.getElementById(layer);
  const { width, height } = canvas;
  const copy = Object.assign(document.createElement("canvas"), { width, height });
  const pen = copy.getContext("2d", { willReadFrequently: true });
  pen.fillStyle = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  pen.fillRect(0, 0, 1, 1);
  const wanted = pen.getImageData(0, 0, 1, 1).data;
  pen.clearRect(0, 0, 1, 1);
  pen.drawImage(canvas, 0, 0);
  const { data } = pen.getImageData(0, 0, width, height);
  const box = canvas.getBoundingClientRect();
  const found = [];
  for (let i = 0; i < data.length; i += 4) {
    if (data[i] !== wanted[0] || data[i + 1] !== wanted[1] || data[i + 2] !== wanted[2] || data[i + 3] < 255) continue;
    const at = i / 4;
    found.push([box.left + (at % width) * box.width / width, box.top + Math.floor(at / width) * box.height / height]);
  }
  return found;
}
"""


def pixels(page: Page, colour: str, layer: str = "robots") -> list[list[float]]:
    """Where this canvas has exactly this colour of the theme, in CSS pixels of the window."""
    settle(page)
    # As one text: Playwright takes half a minute for a hundred thousand pairs.
    found: list[list[float]] = json.loads(
        page.evaluate(f"(where) => JSON.stringify(({FIND_PIXELS})(where))", [colour, layer])
    )
    return found


def pixels_seen(page: Page, colour: str, layer: str = "robots", least: int = 1) -> list[list[float]]:
    """The same, as soon as there are so many: what is new at the station comes with a picture some time later."""
    return until(page, lambda: found if len(found := pixels(page, colour, layer)) >= least else [])


def settle(page: Page) -> None:
    """Wait until the page has drawn what it knows, and has heard where the mouse is."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done())))")


def until(page: Page, look: Callable[[], Found]) -> Found:
    """Let the page live until something is so; gives what was found, since a second look may find something else."""
    deadline = time.monotonic() + PATIENCE
    while not (found := look()):
        assert time.monotonic() < deadline
        page.wait_for_timeout(50)
    return found


def clock(page: Page) -> int:
    """Simulated seconds on the page's clock."""
    hours, minutes, seconds = map(int, page.locator("#clock").inner_text().split(":"))
    return 3600 * hours + 60 * minutes + seconds


def counted(page: Page) -> tuple[int, int, int]:
    """Would obey, would not, unknown, of one and the same preview."""
    yes, no, unknown = page.evaluate("['yes', 'no', 'unknown'].map((id) => document.getElementById(id).textContent)")
    return int(yes.replace(",", "")), int(no.replace(",", "")), int(unknown.replace(",", ""))


def pass_until(page: Page, seconds: int) -> None:
    """Let simulated time pass until then, however slowly on a busy machine: it fails only where time stands still."""
    while (now := clock(page)) < seconds:
        until(page, lambda before=now: clock(page) > before)  # type: ignore[misc]  # it has no type of its own


class Poses:
    """Every pose that came to a page, as the bytes of the frames."""

    def __init__(self, page: Page) -> None:
        self.latest = b""
        page.on("websocket", self.listen)

    def listen(self, socket: WebSocket) -> None:
        socket.on("framereceived", self.take)

    def take(self, payload: str | bytes) -> None:
        if isinstance(payload, bytes) and not payload[3]:  # else all are where they were
            self.latest = payload[32 : 32 + 12 * struct.unpack_from("<I", payload, 4)[0]]


# ---- what a newcomer does


def test_a_newcomers_first_minute(page: Page) -> None:
    expect(page.locator("#text")).to_have_value(SENTENCE)
    expect(page.locator("#title")).to_have_text("Task Element Bravo")
    expect(page.locator("#text")).to_be_focused()
    page.locator("#speed").select_option("1")  # from here on nobody gets far, however long this machine takes
    expect(page.locator("#achieved")).to_have_text("running at 1×")
    # At the very start, nobody has told anything yet.
    first, *others = until(page, lambda: found if (found := counted(page))[0] in EXPECTED else None)
    assert first + sum(others) == 1000
    until(page, lambda: 0 < 20 * counted(page)[0] <= len(pixels(page, "--lit")))  # they are lit on the map

    type_in(page, SENTENCE.replace("5mi", "9mi"))
    foretold_within(page, 2 * first + 1, 1000)  # nine miles round X are more than three times the area: before Enter
    assert page.locator("#commands tr").count() == 0

    type_in(page, SENTENCE, typed=len(SENTENCE))
    foretold_within(page, EXPECTED.start, EXPECTED.stop - 1)
    foretold = number(page.locator("#yes"))
    row = send(page)
    matched = number(row.locator(".matched"))
    assert matched in EXPECTED
    assert abs(matched - foretold) <= 5  # they moved on between the preview and the message
    assert number(row.locator(".not-matched")) == 1000 - matched
    assert number(row.locator(".fault")) == 0
    expect(page.locator("#legend")).to_contain_text(f"{matched} bravo")
    expect(page.locator("#text")).to_have_value("")

    pause(page)
    for x, y in pixels_seen(page, "--robot-1")[::9]:  # a member: another colour, another shape
        page.mouse.move(x, y)
        settle(page)
        if "bravo" in page.locator("#tip").inner_text():  # and no other robot lies still nearer to the cursor
            page.mouse.click(x, y)
            break
    expect(page.locator("#robot-state")).to_contain_text("bravo")
    expect(page.locator(".verdict")).to_contain_text("✓ matched")
    expect(page.locator(".tree")).to_contain_text("ordnance")

    page.locator("#map").focus()
    for _ in range(60):  # from robot to robot until one is not in Bravo
        page.keyboard.press("ArrowUp")
        expect(page.locator(".verdict")).to_be_visible()
        if "not matched" in page.locator(".verdict").inner_text():
            break
    reason = page.locator(".reason").inner_text()
    assert re.fullmatch(
        r"(fuel|ordnance) = [\d.]+ %, needed > (50|70) %|\(DIST .*\) = [\d.]+ mi, needed < 5 mi", reason
    )
    culprit = page.locator(".tree .culprit")
    expect(culprit).to_have_count(1)
    expect(culprit.locator("> .note")).to_have_text(reason)
    expect(page.locator(".tree .skipped").first).to_contain_text("skipped")


def test_why_is_about_the_command_that_was_for_the_robot(bravo: Program, context: BrowserContext) -> None:
    """Followed as README and tutorial say: Bravo is formed and sent; a scout that did not join says what it lacked."""
    page = context.new_page()
    page.goto(bravo.address)
    await_picture(page)
    for text in (SENTENCE, "(WHEN (IN bravo) (GOTO vessel_x vessel_y))"):
        type_in(page, text)
        page.locator("#text").press("Enter")
        expect(page.locator("#text")).to_have_value("")
    page.locator("#map").focus()
    for _ in range(60):
        page.keyboard.press("ArrowUp")
        expect(page.locator(".verdict")).to_be_visible()
        if "not matched" in page.locator(".verdict").inner_text():
            break
    expect(page.locator(".reason")).to_have_text(
        re.compile(r"(fuel|ordnance) = [\d.]+ %, needed > (50|70) %|\(DIST .*\) = [\d.]+ mi, needed < 5 mi")
    )
    which = page.locator("#why-command")
    which.select_option(index=1)  # the newest of all
    expect(page.locator(".reason")).to_have_text("not a member of bravo")
    which.select_option(index=0)
    expect(page.locator(".reason")).to_contain_text("needed")


def test_bravo_drives_where_it_is_told(bravo: Program, context: BrowserContext) -> None:
    page = context.new_page()
    page.goto(bravo.address)
    previewed(page, re.compile(r"^\d+$"))
    send(page)
    for title in ("cover vessel X", "render assistance"):
        button = page.get_by_role("button", name=title)
        expect(button).to_have_class(re.compile("next"))  # the page says what comes next
        button.click()
        previewed(page, re.compile(r"^\d{2}$"))
        row = send(page)
        assert number(row.locator(".matched")) in EXPECTED
        expect(button).to_have_class(re.compile("sent"))
    page.close()  # it would draw all the way
    with open_page(bravo) as line:
        members = [i for i, (x, y) in enumerate(places(line.frame())) if near_x(x, y) < 5.5]
        assert len(members) > 50
        line.tell("pace", factor=10_000.0)
        while seconds(frame := line.frame()) < 15 * 60:
            pass
    there = places(frame)
    together = sum(near_x(*there[i]) < 0.5 for i in members)
    assert together >= 15  # nearly all of Bravo lies beside X; of the others about eight robots in a thousand pass by


def seconds(frame: bytes) -> float:
    """When this was, in simulated seconds."""
    return float(struct.unpack_from("<d", frame, 16)[0])


def places(frame: bytes) -> list[tuple[float, float]]:
    """Where each robot is, in m."""
    flat = struct.unpack_from(f"<{3 * int.from_bytes(frame[4:8], 'little')}f", frame, 32)
    return list(zip(flat[0::3], flat[1::3], strict=True))


def near_x(x: float, y: float) -> float:
    """Miles from the vessel."""
    return float(((x / 1609.344 - 11) ** 2 + (y / 1609.344 - 9) ** 2) ** 0.5)


def test_stop_stops_every_body_and_release_lets_go(bravo: Program, context: BrowserContext) -> None:
    page = context.new_page()
    poses = Poses(page)
    page.goto(bravo.address)
    previewed(page, re.compile(r"^\d+$"))
    page.locator("#text").focus()
    page.keyboard.press("F9")  # while the prompt has the focus
    expect(page.locator("#stopped")).to_be_visible()
    expect(page.locator("#stopped-text")).to_have_text(
        re.compile(r"^STOP: all 1,000 robots (report stopped; [\d,]+ still move: |are at rest\.$)")
    )  # a busy page may first see them at rest
    expect(page.locator("#text")).to_have_value(SENTENCE)  # nothing was typed, sent or asked
    expect(page.locator("#commands tr.stop .matched")).to_have_text("1,000")
    told = clock(page)
    pass_until(page, told + 2 * 60)  # time to come to rest at 0.5 m/s2
    expect(page.locator("#stopped-text")).to_have_text("STOP: all 1,000 robots are at rest.")
    stood = poses.latest
    shown = page.locator("#clock").inner_text()
    expect(page.locator("#clock")).not_to_have_text(shown)
    assert poses.latest == stood  # not one of them has moved a millimetre, though time runs
    send(page)  # an order to STOPped robots is heard, but moves nobody
    assert poses.latest == stood
    page.locator("#release").click()
    expect(page.locator("#stopped")).to_be_hidden()
    page.get_by_role("button", name="render assistance").click()
    previewed(page, re.compile(r"^\d{2}$"))
    send(page)
    until(page, lambda: poses.latest != stood)


def test_stop_button_does_the_same_as_its_key(rovers: Page) -> None:
    rovers.locator("#stop").click()
    expect(rovers.locator("#stopped-text")).to_have_text("STOP: all 20 robots are at rest.")
    rovers.locator("#release").click()
    expect(rovers.locator("#stopped")).to_be_hidden()


# ---- the prompt


def test_errors_stand_under_the_text_with_a_caret(rovers: Page) -> None:
    type_in(rovers, "(WHEN (> batery 60%) (JOIN crew))")
    findings = rovers.locator("#findings")
    expect(findings).to_contain_text('unknown name "batery" at 1:10 (did you mean battery?)')
    lines = rovers.locator("#findings pre").first.inner_text().split("\n")
    assert lines[1:] == ["  (WHEN (> batery 60%) (JOIN crew))", "           ^^^^^^"]
    expect(rovers.locator("#backdrop .found")).to_have_text("batery")

    type_in(rovers, "(WHEN (> battery 60%) (SETQ x 5))")
    expect(rovers.locator("#findings pre.error")).to_contain_text("x")
    expect(rovers.locator("#send")).to_be_disabled()

    type_in(rovers, "(WHEN (> battery 60%) (JOIN crew")
    expect(rovers.locator("#findings pre.unfinished")).to_contain_text("is not closed: add 2")

    type_in(rovers, "(WHEN (> battery 60%) (JOIN crew))")
    expect(findings).to_be_hidden()
    expect(rovers.locator("#send")).to_be_enabled()


def test_what_is_for_everybody_must_be_meant(rovers: Page) -> None:
    before = rovers.locator("#commands tr").count()
    type_in(rovers, "(MARK)")
    box = rovers.get_by_label("This applies to all 20 robots. Send anyway?")
    expect(box).to_be_visible()
    expect(rovers.locator("#send")).to_be_disabled()
    rovers.locator("#text").press("Enter")
    expect(box).to_be_focused()  # Enter does not send, it asks
    assert rovers.locator("#commands tr").count() == before
    rovers.keyboard.press("Space")
    rovers.locator("#text").focus()
    row = send(rovers)
    expect(row.locator(".matched")).to_have_text("20")
    type_in(rovers, "(UNMARK)")
    expect(box).not_to_be_checked()  # meant once is not meant for ever


def test_enter_twice_sends_to_everybody_but_a_held_key_does_not(rovers: Page) -> None:
    before = rovers.locator("#commands tr").count()
    type_in(rovers, "(UNMARK)")
    box = rovers.get_by_label("This applies to all 20 robots. Send anyway?")
    expect(box).to_be_visible()
    rovers.locator("#text").focus()
    expect(rovers.locator("#everybody-text")).to_contain_text("(Enter twice)")
    for _ in range(4):  # without the key let go, as a keyboard repeats it
        rovers.keyboard.down("Enter")
    expect(box).to_be_focused()
    expect(box).not_to_be_checked()
    assert rovers.locator("#commands tr").count() == before
    rovers.keyboard.up("Enter")
    expect(rovers.locator("#everybody-text")).to_contain_text("(Enter once more)")
    rovers.keyboard.press("Enter")
    expect(rovers.locator("#commands tr")).to_have_count(before + 1)
    expect(rovers.locator("#text")).to_have_value("")


def test_what_is_hardly_meant_is_sent_by_a_second_enter(rovers: Page) -> None:
    before = rovers.locator("#commands tr").count()
    type_in(rovers, "(WHEN (> battery 1%) (< battery 101%) (MARK))")
    previewed(rovers, "20")
    rovers.locator("#text").press("Enter")
    expect(rovers.locator("#findings")).to_contain_text("Press Enter once more to send it as it stands.")
    expect(rovers.locator("#findings")).to_contain_text("did you mean (AND (> battery 1%) (< battery 101%))?")
    assert rovers.locator("#commands tr").count() == before
    row = send(rovers)
    expect(row.locator(".matched")).to_have_text("20")


def test_a_question_is_asked_from_the_keyboard_and_changes_nothing(rovers: Page) -> None:
    before = rovers.locator("#commands tr").count()
    type_in(rovers, "(PROGN (JOIN asked) battery)")
    previewed(rovers, "20")
    expect(rovers.locator("#everybody")).to_be_visible()
    rovers.keyboard.press("Tab")
    expect(rovers.locator("#sort")).to_be_focused()
    rovers.keyboard.press("a")
    expect(rovers.locator("#sort")).to_have_value("ask")
    expect(rovers.locator("#everybody")).to_be_hidden()  # nobody is ordered to do anything
    expect(rovers.locator("#preview .asked")).to_be_visible()
    expect(rovers.locator("#legend .lit")).to_have_count(0)
    rovers.keyboard.press("Tab")
    expect(rovers.locator("#send")).to_be_focused()
    expect(rovers.locator("#send")).to_have_text(re.compile("^Ask"))
    rovers.keyboard.press("Enter")
    expect(rovers.locator("#commands tr")).to_have_count(before + 1)
    row = rovers.locator("#commands tr").first
    expect(row.locator(".silent")).to_have_text("0")
    expect(row.locator(".sort")).to_have_text("ask")
    expect(row.locator(".values")).to_have_text(re.compile(r"^20 values: min [\d.]+ %, mean [\d.]+ %, max [\d.]+ %$"))
    expect(rovers.locator("#sort")).to_have_value("once")  # the next one is no question unless it is said to be
    assert "asked" not in rovers.locator("#legend").inner_text()
    type_in(rovers, "battery")
    rovers.locator("#sort").select_option("ask")
    values = send(rovers).locator(".values")
    expect(values).to_have_text(re.compile(r"^20 values: min [\d.]+ %, mean [\d.]+ %, max [\d.]+ %$"))


def test_a_standing_command_says_so_and_one_that_cannot_stand_is_refused(rovers: Page) -> None:
    type_in(rovers, "(WHEN (> battery 60%) (JOIN crew))")
    rovers.locator("#sort").select_option("standing")
    rovers.locator("#text").press("Enter")
    findings = rovers.locator("#findings")
    expect(findings).to_contain_text("send it as a one-shot command")
    rovers.wait_for_timeout(2500)  # the preview is renewed every second
    assert "send it as a one-shot command" in findings.inner_text()
    rovers.locator("#sort").select_option("once")
    expect(findings).to_be_hidden()  # why it cannot stand is not said of what need not
    rovers.locator("#sort").select_option("standing")
    type_in(rovers, "(WHEN (> battery 60%) (RULE watch (WHEN (< battery 1%) (ST))))")
    row = send(rovers)
    expect(row.locator(".sort")).to_have_text("standing")
    expect(rovers.locator("#sort")).to_have_value("once")


def test_names_are_completed_with_the_values_of_the_fleet(rovers: Page) -> None:
    rovers.locator("#text").fill("")
    rovers.locator("#text").press_sequentially("(WHEN (> batt")
    option = rovers.locator("#completions [role=option]")
    expect(option).to_have_count(1)
    expect(option).to_contain_text("battery")
    expect(option.locator(".range")).to_have_text(re.compile(r"^\d[\d.]* % … \d[\d.]* %$"))
    rovers.keyboard.press("Tab")
    expect(rovers.locator("#text")).to_have_value("(WHEN (> battery")
    rovers.keyboard.type(" 60%) (got")
    expect(option.first).to_contain_text("GOTO")
    rovers.keyboard.press("ArrowDown")
    rovers.keyboard.press("Enter")  # chooses from the open list, and sends nothing
    expect(rovers.locator("#text")).to_have_value("(WHEN (> battery 60%) (GOTO")
    expect(rovers.locator("#usage")).to_contain_text("(GOTO")
    rovers.keyboard.type(" ba")
    expect(option.first).to_be_visible()
    rovers.keyboard.press("Escape")
    expect(rovers.locator("#completions")).to_be_hidden()


def test_the_matching_parenthesis_is_shown(rovers: Page) -> None:
    type_in(rovers, "(AND (> x 1) 2)")
    expect(rovers.locator("#backdrop .pair")).to_have_count(2)
    rovers.keyboard.press("End")
    rovers.keyboard.type(")")
    expect(rovers.locator("#backdrop .unpaired")).to_have_count(1)


def test_several_lines_and_history_that_outlives_the_page(rovers: Page) -> None:
    type_in(rovers, "(WHEN (> battery 61%)")
    rovers.keyboard.press("Shift+Enter")
    rovers.keyboard.type("  (JOIN crew))")
    expect(rovers.locator("#send")).to_be_enabled()
    send(rovers)
    type_in(rovers, "(WHEN (> battery 62%) (JOIN crew))")
    previewed(rovers, re.compile(r"^\d+$"))
    send(rovers)
    rovers.reload()
    expect(rovers.locator("#commands tr").first).to_be_visible()  # with them the prompt is filled
    text = rovers.locator("#text")
    text.fill("draft")
    text.press("ArrowUp")
    expect(text).to_have_value("(WHEN (> battery 62%) (JOIN crew))")
    text.press("ArrowUp")
    expect(text).to_have_value("(WHEN (> battery 61%)\n  (JOIN crew))")
    text.press("ArrowDown")
    text.press("ArrowDown")
    expect(text).to_have_value("draft")
    text.press("Control+r")
    rovers.keyboard.type("61 crew")
    expect(rovers.locator("#search-found [role=option]")).to_have_count(1)
    rovers.keyboard.press("Enter")
    expect(text).to_have_value("(WHEN (> battery 61%)\n  (JOIN crew))")
    expect(text).to_be_focused()


# ---- the world


SCALED = """
() => [...document.querySelectorAll("#map canvas")].filter((canvas) => {
  const { width, height } = canvas.getBoundingClientRect();
  return width * devicePixelRatio !== canvas.width || height * devicePixelRatio !== canvas.height;
}).map(({ id }) => id)
"""
"""Canvases that are shown larger or smaller than they are, which software does slowly; the map may well end between two
pixels."""


def test_the_map_zooms_to_the_cursor_pans_and_fits(rovers: Page) -> None:
    assert rovers.evaluate(SCALED) == []
    box = rovers.locator("#map").bounding_box()
    assert box is not None
    x, y = round(box["x"] + box["width"] * 0.6), round(box["y"] + box["height"] * 0.4)
    rovers.mouse.move(x, y)
    whole, here = rovers.locator("#scale-text").inner_text(), until(rovers, lambda: pointed_at(rovers))
    assert whole.endswith(" km")
    for _ in range(6):
        rovers.mouse.wheel(0, -240)
    expect(rovers.locator("#scale-text")).to_have_text(re.compile(r"^\d+ m$"))
    rovers.mouse.move(x + 1, y)
    rovers.mouse.move(x, y)
    settle(rovers)
    assert pointed_at(rovers) == pytest.approx(here, abs=0.011)  # the point under the cursor stayed there
    rovers.mouse.down()
    rovers.mouse.move(x + 80, y + 50, steps=4)
    rovers.mouse.up()
    settle(rovers)
    assert pointed_at(rovers) == pytest.approx(here, abs=0.011)  # and came along when it was dragged
    rovers.locator("#fit").click()
    expect(rovers.locator("#scale-text")).to_have_text(whole)


def pointed_at(page: Page) -> list[float]:
    """The place under the cursor, x and y, as the page tells it."""
    return [float(found) for found in re.findall(r"[\d.]+", page.locator("#place-text").inner_text())]


RINGS = """
async () => {
  const { Pings } = await import("/static/pings.js");
  const { View } = await import("/static/view.js");
  const { palette } = await import("/static/shapes.js");
  const view = new View();
  view.resize(300, 100);
  view.fit([0, 0, 30, 10]);
  const pen = Object.assign(document.createElement("canvas"), { width: 300, height: 100 })
    .getContext("2d", { willReadFrequently: true });
  const frame = { count: 3, poses: new Float32Array([5, 5, 0, 15, 5, 0, 25, 5, 0]), pings: new Uint8Array([4, 0, 5]) };
  const pings = new Pings();
  pings.take(frame, 1000);
  const alive = [1100, 1900].map((now) => {
    pen.clearRect(0, 0, 300, 100);
    const more = pings.draw(pen, view, frame, () => 5, palette(), now);
    const thirds = [0, 100, 200].map((x) => pen.getImageData(x, 0, 100, 100).data.some((value) => value > 0));
    return [more, ...thirds];
  });
  return alive;
}
"""


def test_a_ping_is_a_short_ring_round_who_sent_it(rovers: Page) -> None:
    assert rovers.evaluate(RINGS) == [[True, True, False, True], [False, False, False, False]]
    rovers.emulate_media(reduced_motion="reduce")
    assert rovers.evaluate(RINGS) == [[False] * 4] * 2


def test_the_map_works_from_the_keyboard(rovers: Page) -> None:
    rovers.locator("#map").focus()
    rovers.keyboard.press("ArrowRight")
    expect(rovers.locator("#heard")).to_contain_text("rover")
    first = rovers.locator("#robot-name").inner_text()
    rovers.keyboard.press("ArrowRight")
    expect(rovers.locator("#robot-name")).not_to_have_text(first)
    before = rovers.locator("#scale-text").inner_text()
    for _ in range(6):
        rovers.keyboard.press("+")
    expect(rovers.locator("#scale-text")).not_to_have_text(before)
    rovers.keyboard.press("f")
    expect(rovers.locator("#scale-text")).to_have_text(before)
    rovers.keyboard.press("t")
    expect(rovers.locator("#layer-trails")).not_to_be_checked()
    rovers.keyboard.press("Escape")
    expect(rovers.locator("#robot-name")).to_have_text("Robot")
    rovers.keyboard.press("/")
    expect(rovers.locator("#text")).to_be_focused()


def test_a_robot_shows_its_values_rules_and_reports(rovers: Page) -> None:
    for order in ("(RULE careful (WHEN (< battery 1%) (ST)) :priority 2)", '(REPORT "level" battery)'):
        type_in(rovers, order)
        rovers.locator("#everybody-yes").check()
        rovers.locator("#text").focus()
        send(rovers)
    rovers.locator("#map").focus()
    rovers.keyboard.press("ArrowRight")
    rovers.locator("#tab-values").click()
    expect(rovers.locator("#pane-values tr", has_text="battery")).to_contain_text("%")
    rovers.keyboard.press("ArrowRight")
    expect(rovers.locator("#pane-rules tr", has_text="careful (priority 2)")).to_contain_text("● yes")
    rovers.keyboard.press("ArrowRight")
    expect(rovers.locator("#pane-said")).to_contain_text("level: 0.")


def test_a_click_on_a_command_lights_those_that_it_matched(rovers: Page) -> None:
    type_in(rovers, "(WHEN (> battery 75%) (JOIN full))")
    row = send(rovers)
    matched = row.locator(".matched").inner_text()
    expect(rovers.locator("#legend .lit")).to_have_text(f"{matched} matched")
    expect(row).to_have_attribute("aria-selected", "true")
    row.click()
    expect(rovers.locator("#legend .lit")).to_have_count(0)
    assert_lit(rovers, False)
    row.click()
    expect(rovers.locator("#legend .lit")).to_have_text(f"{matched} matched")
    assert_lit(rovers, True)


def assert_lit(page: Page, wanted: bool) -> None:
    """Robots are lit, or none is, at the latest a few pictures from now."""
    until(page, lambda: bool(pixels(page, "--lit")) == wanted)


def test_more_robots_than_shapes_can_tell_apart_become_points(context: BrowserContext) -> None:
    with Program("demo", "bravo", "--robots", "7000", "--speed", "1") as program:
        page = context.new_page()
        page.goto(program.address)
        previewed(page, re.compile(r"^\d{3}$"))
        pause(page)
        assert_lit(page, True)
        page.locator("#text").fill("")  # beside robots that are lit, others are faint
        assert len(pixels_seen(page, "--robot-0", least=7001)) > 7000  # of two by two pixels, some over one another
        assert (
            page.evaluate("document.querySelectorAll('*').length") < 1_000
        )  # the page's own, and none for any of them
        x, y = pixels(page, "--robot-0")[0]
        page.mouse.click(x, y)
        expect(page.locator("#robot-name")).to_have_text(re.compile(r"scout\d+"))


A_SQUARE = """
[[world.polygons]]
corners = [[400.0, 100.0], [600.0, 100.0], [600.0, 300.0], [400.0, 300.0]]
"""


def test_obstacles_stand_on_the_map(context: BrowserContext, tmp_path: Path) -> None:
    with Program("run", write(tmp_path, text=SMALL + A_SQUARE).parent, "--page") as program:
        page = context.new_page()
        page.goto(program.address)
        expect(page.locator("#legend")).to_contain_text("20 rovers")
        found = pixels_seen(page, "--map-obstacle", "ground")
        left, right = min(x for x, _ in found), max(x for x, _ in found)
        top, bottom = min(y for _, y in found), max(y for _, y in found)
        assert abs((right - left) - (bottom - top)) <= 2  # as wide as high
        box = page.locator("#map").bounding_box()
        assert box is not None
        assert (left + right) / 2 == pytest.approx(box["x"] + box["width"] / 2, abs=2)  # in the middle, as x = 500 m
        assert (top + bottom) / 2 > box["y"] + box["height"] / 2  # and below it, as y = 200 m


def test_robots_together_in_a_large_world_are_seen(context: BrowserContext, tmp_path: Path) -> None:
    small = SMALL.replace('[places.house]\nx = "500m"\ny = "400m"', "").replace(
        "[robots.limits]", "[robots.disc]\nx = 500\ny = 500\nradius = 10\n\n[robots.limits]"
    )
    with Program("run", write(tmp_path, text=small).parent, "--page", "--speed", "10") as program:
        page = context.new_page()
        page.goto(program.address)
        scale, fit = page.locator("#scale-text"), page.locator("#fit")
        expect(scale).to_have_text(re.compile(r"^\d+ m$"))
        near = scale.inner_text()
        fit.click()
        expect(scale).to_have_text(re.compile(r"^0\.\d km$"))  # all of the world
        fit.click()
        expect(scale).to_have_text(near)
        send_to_all(page, "(DRIVE 5m/s 0)")
        expect(scale).not_to_have_text(near)  # they drive apart, and all stay in sight


def send_to_all(page: Page, text: str) -> None:
    type_in(page, text)
    page.get_by_label(re.compile("This applies to all")).check()
    page.locator("#text").press("Enter")
    expect(page.locator("#commands tr")).to_have_count(1)


TWO_SORTS = """
format = 1
title = "Small and large"
seconds = "1min"

[world]
width = "12m"
height = "12m"

[[robots]]
like = "disc"
type = "small"
count = 2
x = ["2m", "4m"]
y = ["5m", "7m"]
motion = "still"
[robots.body]
radius = "0.15m"

[[robots]]
like = "disc"
type = "large"
count = 1
x = ["8m", "8.1m"]
y = ["5m", "5.1m"]
motion = "still"
[robots.body]
radius = "0.3m"
"""


def test_each_sort_of_robots_is_drawn_in_its_own_size(context: BrowserContext, tmp_path: Path) -> None:
    with Program("run", write(tmp_path, text=TWO_SORTS).parent, "--page") as program:
        page = context.new_page()
        page.goto(program.address)
        expect(page.locator("#legend")).to_contain_text("3 robots")
        middle = sum(page.locator("#map").bounding_box()[side] / part for side, part in (("x", 1), ("width", 2)))
        small, large = pixels_seen(page, "--robot-0"), pixels_seen(page, "--robot-8")
        assert all(x < middle for x, _ in small)
        assert all(x > middle for x, _ in large)
        # Twice as long as each of the two, and its shape has twice the area for its length.
        assert 3.5 < len(large) / len(small) < 7.0
        page.mouse.click(*large[len(large) // 2])
        expect(page.locator("#robot-name")).to_have_text("large1")


# ---- time, looks, trouble


def test_time_pauses_steps_and_changes_its_speed(rovers: Page) -> None:
    pause(rovers)
    clock = rovers.locator("#clock")
    stood = clock.inner_text()
    for _ in range(10):  # ten ticks of 0.1 s
        rovers.locator("#step").click()
    expect(clock).not_to_have_text(stood)
    rovers.locator("#run").click()
    expect(rovers.locator("#achieved")).to_have_text("running at 5×")
    rovers.locator("#speed").select_option("10")
    expect(rovers.locator("#achieved")).to_have_text("running at 10×")
    rovers.locator("#speed").select_option("5")


CORNER = """
() => {
  const pen = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  pen.drawImage(document.getElementById("ground"), 0, 0);
  return [...pen.getImageData(2, 2, 1, 1).data];
}
"""


def test_light_and_dark(rovers: Page, context: BrowserContext) -> None:
    expect(rovers.locator("html")).to_have_attribute("data-theme", "light")
    rovers.locator("#theme").click()
    expect(rovers.locator("html")).to_have_attribute("data-theme", "dark")
    rovers.reload()
    expect(rovers.locator("html")).to_have_attribute("data-theme", "dark")  # kept
    expect(rovers.locator("#scale-text")).not_to_be_empty()
    until(rovers, lambda: rovers.evaluate(CORNER)[3] == 255)  # the map is drawn
    assert max(rovers.evaluate(CORNER)[:3]) < 60  # it is dark as well


def test_it_opens_with_few_files_and_each_module_once(program: Program, context: BrowserContext) -> None:
    page = context.new_page()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(program.address)
    await_picture(page)
    assert len(asked) < 12, asked
    both = "[(await import('/static/main.js')).page.wire, (await import('/static/wire.js')).Wire]"
    assert page.evaluate(f"(async () => {{ const [wire, Wire] = {both}; return wire instanceof Wire; }})()")


AGAIN = """
async () => {
  const { page } = await import("/static/main.js");
  const again = [];
  const hidden = new MutationObserver((records) => {
    for (const { target, oldValue } of records) if ((oldValue !== null) === target.hidden) again.push(target.id);
  });
  const hiding = { attributeFilter: ["hidden"], attributeOldValue: true, subtree: true };
  hidden.observe(document.querySelector(".world"), hiding);
  const look = (records) => {
    for (const { target, removedNodes, addedNodes } of records) {
      const textOf = (nodes) => [...nodes].map((node) => node.textContent).join();
      if (textOf(removedNodes) === textOf(addedNodes)) again.push(target.id || target.className);
    }
  };
  const observer = new MutationObserver(look);
  observer.observe(document.querySelector(".top"), { childList: true, subtree: true });
  const frames = await new Promise((done) => {
    let frames = 0;
    page.wire.addEventListener("frame", () => (frames += 1) === 20 && done(frames));
  });
  look(observer.takeRecords());
  return [frames, again];
}
"""


def test_what_the_bar_says_is_written_when_it_changes_only(rovers: Page) -> None:
    """A text that is written again is laid out again, and all that lies over the map is put together again with it: at
    each of thirty frames a second, though nothing was to be seen. It is the same if what is hidden is hidden again."""
    assert rovers.evaluate(AGAIN) == [20, []]


def test_on_a_tablet_stop_stays_in_sight(rovers: Page) -> None:
    rovers.set_viewport_size({"width": 800, "height": 1100})
    rovers.mouse.move(400, 1000)
    rovers.mouse.wheel(0, 5000)
    expect(rovers.locator("#stop")).to_be_in_viewport(ratio=1.0)
    expect(rovers.locator(".robot")).to_be_in_viewport()
    settle(rovers)
    assert rovers.evaluate("document.documentElement.scrollWidth") <= 800
    rovers.locator("#stop").click()
    expect(rovers.locator("#release")).to_be_in_viewport(ratio=1.0)
    rovers.locator("#release").click()
    expect(rovers.locator("#stopped")).to_be_hidden()


def test_a_lost_connection_is_said_and_stop_waits_for_it(context: BrowserContext, tmp_path: Path) -> None:
    with Program("run", write(tmp_path).parent, "--page") as program:
        page = context.new_page()
        page.goto(program.address)
        expect(page.locator("#legend")).to_contain_text("20 rovers")
        program.end()
        expect(page.locator("#offline")).to_contain_text("No connection to the station")
        page.keyboard.press("F9")
        expect(page.locator("#stopped-text")).to_contain_text("STOP could not be sent")


def test_the_page_of_a_wrong_address_says_what_to_do(program: Program, context: BrowserContext) -> None:
    page = context.new_page()
    answer = page.goto(program.address[:-3])
    assert answer is not None
    assert answer.status == 403
    expect(page.locator("body")).to_contain_text("Open the address that was printed")
