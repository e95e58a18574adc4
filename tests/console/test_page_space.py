"""The view in three dimensions beside the map, in a real Chromium, and the arithmetic under it.

As in `test_page`, the browser must have had nothing to complain about.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import BrowserContext, Page, expect

from console.conftest import page_of
from console.running import PATIENCE, Program
from console.test_page import clock, opened, pixels, pixels_seen, send, settle, type_in, until
from sleepcast.console.adapters.swarm import scene_of
from sleepcast.console.page_parts import STATIC
from sleepcast.simulator import load, read_scenario
from small_worlds import write

browser = pytest.mark.browser
COPTERS = """
format = 1
title = "Copters over a yard"
seconds = "1min"
tick = "0.1s"

[world]
width = "60m"
height = "40m"

[robots]
like = "copter"
most = 5
starts = [["10m", "20m", "0deg"], { x = "31m", y = "20m", z = "10m" }, { x = "50m", y = "20m", z = "20m" }]
"""

LAMP = """
[lights.lamp]
x = "30m"
y = "38m"

[robots]"""

HILLS = """ground = { file = "hills.png", high = "16m" }

[robots]"""

expect.set_options(timeout=1000 * PATIENCE)


@pytest.fixture
def rovers(program: Program, context: BrowserContext) -> Iterator[Page]:
    """The small world's page."""
    yield from opened(program, context)


@pytest.fixture(scope="module")
def yard(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    """Three copters: on the ground, at 10 m and at 20 m; and a lamp."""
    with page_of(tmp_path_factory.mktemp("yard"), COPTERS.replace("\n[robots]", LAMP)) as started:
        yield started


@pytest.fixture
def copters(yard: Program, context: BrowserContext) -> Iterator[Page]:
    """The page of those."""
    yield from opened(yard, context)


@pytest.fixture
def neighbours(tmp_path: Path, context: BrowserContext) -> Iterator[Page]:
    """The page of those, of which the second is beside the third."""
    beside = COPTERS.replace('{ x = "31m", y = "20m", z = "10m" }', '{ x = "51.2m", y = "20m", z = "20m" }')
    with page_of(tmp_path, beside) as started:
        yield from opened(started, context)


@pytest.fixture(scope="module")
def hills(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    """The same three over ground that rises by 16 m to the east, half of it in the middle."""
    folder = tmp_path_factory.mktemp("hills")
    Image.fromarray(np.tile(np.uint16([0, 0, 65_535, 65_535]), (2, 1))).save(folder / "hills.png")
    with page_of(folder, COPTERS.replace("[robots]", HILLS)) as started:
        yield started


@pytest.fixture
def hilly(hills: Program, context: BrowserContext) -> Iterator[Page]:
    """The page of those."""
    yield from opened(hills, context)


def await_view(page: Page) -> None:
    """Wait until a picture stands there: more than its first colour fills a part of it."""
    page.wait_for_function(
        """() => {
          const [canvas] = document.querySelectorAll(".space-map canvas");
          if (!canvas.width || !canvas.height) return false;
          const pen = new OffscreenCanvas(32, 32).getContext("2d");
          pen.imageSmoothingEnabled = false;
          pen.drawImage(canvas, 0, 0, 32, 32);
          const counts = {};
          const seen = new Uint32Array(pen.getImageData(0, 0, 32, 32).data.buffer);
          for (const each of seen) counts[each] = (counts[each] ?? 0) + 1;
          return Object.values(counts).filter((count) => count > 4).length > 1;
        }""",
        polling=100,
        timeout=1000 * PATIENCE,
    )


def ring(page: Page) -> tuple[float, float]:
    """The middle of the ring round the chosen robot."""
    found = pixels_seen(page, "--chosen", "space-over")
    return tuple((min(each) + max(each)) / 2.0 for each in zip(*found, strict=True))


@browser
def test_the_view_is_fetched_when_it_is_opened_and_picks_robots_as_the_map_does(rovers: Page) -> None:
    fetched: list[str] = []
    rovers.on("request", lambda request: fetched.append(request.url.rsplit("/", 1)[-1]))
    rovers.locator("#run").click()  # robots that stand can be pointed at
    rovers.locator("#map").focus()
    rovers.keyboard.press("ArrowUp")
    assert fetched == []
    rovers.keyboard.press("v")
    view = rovers.get_by_role("application", name="View of the robots in three dimensions")
    expect(view).to_be_visible()
    expect(rovers.locator("#space")).to_have_attribute("aria-pressed", "true")
    x, y = ring(rovers)
    assert set(fetched) == {"painter.js", "solids.js", "joined.js", "three.module.min.js", "three.core.min.js"}
    chosen = rovers.locator("#robot-name").inner_text()

    view.focus()
    rovers.keyboard.press("ArrowRight")
    expect(rovers.locator("#robot-name")).not_to_have_text(chosen)
    expect(rovers.locator("#heard")).not_to_contain_text(chosen)
    until(rovers, lambda: ring(rovers)[0] > x)  # the next one to the right, as this view shows it
    rovers.mouse.click(x, y)
    expect(rovers.locator("#robot-name")).to_have_text(chosen)
    expect(rovers.locator(".space .tip")).to_contain_text(chosen)
    expect(rovers.locator("#tip")).to_be_hidden()

    before = ring(rovers)
    view.focus()
    rovers.keyboard.press("Shift+ArrowRight")
    until(rovers, lambda: ring(rovers) != before)
    rovers.keyboard.press("l")  # what the map does with its other keys
    expect(rovers.locator("#lasso")).to_have_attribute("aria-pressed", "true")
    x, y = ring(rovers)
    rovers.mouse.move(x - 12, y - 12)
    rovers.mouse.down()
    for dx, dy in ((12, -12), (12, 12), (-12, 12), (-12, -12)):
        rovers.mouse.move(x + dx, y + dy, steps=3)
    rovers.mouse.up()
    expect(rovers.locator("#selection .count")).to_contain_text("selected")

    view.focus()
    rovers.keyboard.press("Shift+C")
    expect(rovers.locator("#follow")).to_have_attribute("aria-pressed", "true")
    expect(rovers.locator("#heard")).to_have_text(f"Following {chosen}")
    rovers.keyboard.press("Control+ArrowRight")
    expect(rovers.locator("#follow")).to_have_attribute("aria-pressed", "false")
    expect(rovers.locator(".space .from")).to_contain_text(
        re.compile(r"^From the south, 34° up, \d+\.?\d* m away from x ")
    )
    rovers.keyboard.press("v")
    expect(view).to_be_hidden()
    expect(rovers.locator("#map")).to_be_focused()


@browser
def test_a_browser_without_webgl_says_so_and_keeps_the_map(program: Program, context: BrowserContext) -> None:
    without = "OffscreenCanvas.prototype.getContext = () => null;"
    painter = without + (STATIC / "painter.js").read_text()
    context.route("**/painter.js", lambda route: route.fulfill(body=painter, content_type="text/javascript"))
    for page in opened(program, context):
        page.locator("#space").click()
        assert_refused(page, "the browser has no WebGL")
        context.unroute("**/painter.js")
        page.locator("#space").click()
        await_view(page)  # it is tried again


@browser
def test_so_does_one_that_starts_no_threads(program: Program, context: BrowserContext) -> None:
    context.add_init_script("window.Worker = class { constructor() { throw new Error('it starts no threads'); } };")
    for page in opened(program, context):
        page.locator("#space").click()
        assert_refused(page, "it starts no threads")


@browser
def test_where_the_browser_takes_the_graphics_away_the_view_gets_others(
    program: Program, context: BrowserContext
) -> None:
    told = """
      const real = OffscreenCanvas.prototype.getContext;
      OffscreenCanvas.prototype.getContext = function (kind, ...how) {
        const made = real.call(this, kind, ...how);
        if (kind === "webgl2") self.made = made;
        return made;
      };
    """
    painter = told + (STATIC / "painter.js").read_text()
    context.route("**/painter.js", lambda route: route.fulfill(body=painter, content_type="text/javascript"))
    for page in opened(program, context):
        page.locator("#space").click()
        await_view(page)
        (first,) = page.workers
        first.evaluate("made.getExtension('WEBGL_lose_context').loseContext()")
        until(page, lambda page=page, first=first: page.workers and page.workers[0] is not first)
        before = colours_of(page)
        page.locator("#theme").click()
        until(page, lambda page=page, before=before: not colours_of(page) & before)  # the second thread draws
        expect(page.locator(".space")).to_be_visible()


@browser
def test_pictures_of_the_ground_are_closed_once_they_are_drawn(program: Program, context: BrowserContext) -> None:
    """Each takes up to 16 MB, and where robots change the ground there are several a second."""
    kept = """
      self.sheets = [];
      addEventListener("message", ({ data }) => {
        for (const given of data.flat(2)) if (given instanceof ImageBitmap) self.sheets.push(given);
      });
      const tell = self.postMessage.bind(self);
      self.postMessage = (...what) => setTimeout(() => tell(...what), 300);  // so long a picture takes
    """
    painter = kept + (STATIC / "painter.js").read_text()
    context.route("**/painter.js", lambda route: route.fulfill(body=painter, content_type="text/javascript"))
    context.add_init_script("""
      window.sheets = [];
      const real = OffscreenCanvas.prototype.transferToImageBitmap;
      OffscreenCanvas.prototype.transferToImageBitmap = function () {
        const made = real.call(this);
        window.sheets.push(made);
        return made;
      };
    """)
    for page in opened(program, context):
        page.locator("#space").click()
        await_view(page)
        page.evaluate("""async () => {
          for (let turn = 0; turn < 5; turn += 1) {  // faster than they are drawn
            document.getElementById("theme").click();
            await new Promise((done) => requestAnimationFrame(done));
          }
        }""")
        (painter_thread,) = page.workers
        for thread in (page, painter_thread):
            until(page, lambda thread=thread: thread.evaluate("sheets.length > 1"))
            until(page, lambda thread=thread: thread.evaluate("sheets.every(({ width }) => width === 0)"))


@browser
def test_an_error_of_the_drawing_thread_is_no_lack_of_webgl(program: Program, context: BrowserContext) -> None:
    fault = "Solids.prototype.setShadow = () => { throw new Error('no shadow'); };"
    painter = (STATIC / "painter.js").read_text() + fault
    context.route("**/painter.js", lambda route: route.fulfill(body=painter, content_type="text/javascript"))
    page = context.new_page()
    page.goto(program.address)
    page.locator("#space").click()
    again = (
        "This is a fault of the page: its button opens the view again, and a report of these words helps to mend it."
    )
    assert_refused(page, "Uncaught Error: no shadow", again)
    context.unroute("**/painter.js")
    page.locator("#space").click()
    await_view(page)


def assert_refused(page: Page, reason: str, advice: str = "Turn on WebGL in its settings, or use another one.") -> None:
    """The view is closed again, the page says why, and the map goes on."""
    expect(page.locator("#refused-text")).to_have_text(
        f"The view in three dimensions cannot be shown: {reason}. {advice}"
    )
    expect(page.locator(".space")).to_be_hidden()
    expect(page.locator("#space")).to_have_attribute("aria-pressed", "false")
    before = clock(page)
    until(page, lambda: clock(page) > before)


@browser
def test_shades_and_labels_tell_how_high_robots_are(copters: Page) -> None:
    page = copters
    expect(page.locator("#height-scale")).to_have_text("up to 20 m high")
    highest, middle = (pixels_seen(page, f"--field-{shade}", least=50) for shade in (4, 2))
    assert min(x for x, _ in highest) > max(x for x, _ in middle) + 20.0, "the right one is the highest"
    page.locator("#map").focus()
    page.keyboard.press("ArrowDown")  # the one nearest to the middle of the map
    expect(page.locator("#heard")).to_contain_text("10 m up")
    page.locator("#layers").click()
    page.get_by_role("checkbox", name="Height").uncheck()
    expect(page.locator("#height-scale")).to_be_hidden()
    until(page, lambda: not pixels(page, "--field-4"))


@browser
def test_nothing_lies_under_the_buttons_of_the_map(copters: Page) -> None:
    """Beside the view the map is narrow: what it says at its edge, and names, had come to lie under its buttons."""
    page = copters
    page.locator("#space").click()
    scale, buttons = page.locator("#height-scale"), page.locator(".zoom")
    expect(scale).to_have_text("up to 20 m high")
    for width in (480, 1024):
        page.set_viewport_size({"width": width, "height": 768})
        settle(page)
        (left, _, wide, _), (edge, *_) = (tuple((each.bounding_box() or {}).values()) for each in (scale, buttons))
        assert left + wide <= edge, width
    found = calculated(
        page,
        "labels",
        """({ Labels }) => {
          const view = { width: 300, height: 200, scale: 1, toScreenX: (x) => x, toScreenY: (y) => y };
          view.toWorld = (x, y) => [x, 200 - y];
          const frame = { count: 2, poses: [30, 100, 0, 220, 100, 0], groups: [0, 0] };
          const scene = { names: ["copter1", "copter2"], groups: [], places: [], lights: [], areas: [], obstacles: [] };
          const what = { scene, frame, sizes: () => 5, robots: true, colours: { robots: [] } };
          return [-1, 1].map((chosen) => [[], [252, 50, 300, 150]].map((covered) =>
            new Labels().arrange(view, { ...what, marks: { chosen, pointed: -1 }, covered }, () => 40)
              .sort((one, other) => one.x - other.x).map(({ x, y }) => [x, y])));
        }""",
    )
    first, beside, above = [44, 100], [234, 100], [200, 84]
    assert found == [[[first, beside], [first, above]]] * 2


@browser
def test_ground_and_sky_are_those_of_the_map_and_a_line_leads_down(copters: Page) -> None:
    page = copters
    page.locator("#map").focus()
    page.keyboard.press("ArrowDown")
    page.locator("#space").click()
    x, y = ring(page)
    drop = [py for px, py in pixels(page, "--chosen", "space-over") if abs(px - x) < 3.0]
    assert max(drop) > y + 20.0, "a line leads down to the ground"
    for area, sky in (("#f8fafb", "#e6ebf0"), ("#101820", "#0a0f14")):  # light, dark
        until(page, lambda wanted={area, sky}: wanted <= colours_of(page))
        page.locator("#theme").click()


@browser
def test_the_ground_lies_as_on_the_map(copters: Page) -> None:
    page = copters
    page.locator("#space").click()
    await_view(page)
    glow = until(page, lambda: rows_of(page, lambda rgb: rgb[..., 0] > rgb[..., 2] + 60))
    area = rows_of(page, lambda rgb: (rgb == (0xF8, 0xFA, 0xFB)).all(axis=-1))
    assert np.mean(glow) < np.mean(area), "the lamp stands in the north"


def rows_of(page: Page, wanted: Callable[[np.ndarray], np.ndarray]) -> list[int]:
    """The row of each pixel of the view whose colour is wanted."""
    with Image.open(BytesIO(page.locator(".space-map").screenshot())) as image:
        rows, _ = np.nonzero(wanted(np.asarray(image.convert("RGB"), int)))
    return [int(row) for row in rows]


@browser
def test_hills_are_shaded_on_the_map_and_rise_in_space(hilly: Page) -> None:
    page = hilly
    shaded = until(page, lambda: (found := len(shades(page))) > 20 and found)
    heights = calculated(
        page,
        "relief",
        """({ Relief }) => {
          const cells = btoa(String.fromCharCode(0, 0, 255, 255, 0, 0, 255, 255, 0, 0, 255, 255));
          const world = { addEventListener() {}, repaint() {}, colours: { ink: "#000000" } };
          const relief = new Relief(world, document.createElement("div"));
          relief.setScene({ area: [0, 0, 10, 20], relief: { columns: 2, rows: 3, cells, low: 2, high: 6 } });
          return [[0, 0], [10, 20], [5, 7], [-3, 5], [12, 30]].map((place) => world.relief.at(...place));
        }""",
    )
    assert heights == pytest.approx([2.0, 6.0, 4.0, 2.0, 6.0])
    page.locator("#layers").click()
    page.get_by_role("checkbox", name="Hills").uncheck()
    until(page, lambda: len(shades(page)) < shaded / 2)
    page.keyboard.press("Escape")
    page.locator("#map").focus()
    page.keyboard.press("ArrowDown")
    expect(page.locator("#heard")).to_contain_text("10 m up")
    page.locator("#space").click()
    x, y = ring(page)
    drop = [py for px, py in pixels(page, "--chosen", "space-over") if abs(px - x) < 3.0]
    assert max(drop) - y < 100.0, "the line down ends on the hill, 2 m below it"


def test_the_scene_says_how_high_the_ground_is(tmp_path: Path) -> None:
    Image.fromarray(np.array([[0, 255]], np.uint8)).save(tmp_path / "hills.png")
    write(tmp_path, text=COPTERS.replace("[robots]", HILLS))
    relief = scene_of(load(tmp_path), tuple("abc")).relief
    assert relief is not None
    assert (relief.columns, relief.rows, relief.low, relief.high) == (128, 85, 0.0, 16.0)
    steps = np.frombuffer(relief.cells, "<u2").reshape(85, 128)
    assert (steps == steps[0]).all()
    wanted = np.interp(np.linspace(0.0, 60.0, 128), (15.0, 45.0), (0.0, 65_535.0))
    assert steps[0] == pytest.approx(wanted, abs=1.0)
    assert scene_of(read_scenario(COPTERS), tuple("abc")).relief is None


def shades(page: Page) -> set[tuple[int, ...]]:
    """The colours of the ground along a line through the lower part of the map."""
    with Image.open(BytesIO(page.locator("#map").screenshot())) as image:
        row = image.convert("RGB").crop((0, int(0.6 * image.height), image.width, int(0.6 * image.height) + 1))
        return {colour for _, colour in row.getcolors(image.width) or ()}


def colours_of(page: Page, least: int = 1001) -> set[str]:
    """The colours that fill much of the view: so many pixels."""
    with Image.open(BytesIO(page.locator(".space-map").screenshot())) as image:
        counts = image.convert("RGB").getcolors(image.width * image.height)
    return {f"#{bytes(colour).hex()}" for count, colour in counts if count >= least}


def calculated(page: Page, module: str, script: str) -> Any:
    """What a function, given the exports of one of the page's modules, comes to."""
    return page.evaluate(f"""async () => ({script})(await import("/static/{module}.js"))""")


@browser
def test_forms_and_the_camera_are_right(modules: Page) -> None:
    counts = calculated(
        modules,
        "forms",
        """(f) => ['copter', 'farCopter', 'plane', 'farPlane', 'rover', 'farRover'].map(
          (kind) => f[kind]().triangles.length / 3
        )""",
    )
    assert counts == [29, 4, 16, 6, 10, 3]
    cross = calculated(modules, "forms", "(f) => f.cross().triangles.length / 3")
    assert max(counts) + cross <= 60

    square, hole, island = ([[a, a], [b, a], [b, b], [a, b]] for a, b in ((0, 10), (2, 8), (4, 6)))
    given = calculated(
        modules,
        "forms",
        f"""(f) => {{
          const parts = [];
          f.prisms([{[square, hole, island]}], () => 2, (contour, holes) => {{
            parts.push([contour.length, holes.length, contour[0][0]]);
            return [];
          }});
          return parts;
        }}""",
    )
    assert given == [[4, 1, 0], [4, 0, 4]], "what an odd number of outlines encloses is solid"
    tops = calculated(
        modules,
        "forms",
        f"""(f) => [0, 1].map((one) => {{
          const form = f.prisms([[{square}], [{hole}]].slice(one, one + 1), () => [3, 7][one], () => []);
          return Math.max(...form.corners.filter((_, at) => at % 3 === 2));
        }})""",
    )
    assert tops == [3, 7]

    seen = calculated(
        modules,
        "orbit",
        """({ Orbit }) => {
          const orbit = new Orbit();
          orbit.resize(800, 600);
          orbit.turn(37, -20);
          orbit.fit([-30, 0, 50, 20], 15);
          const corners = [-30, 0, 0, 50, 0, 0, -30, 20, 0, 50, 20, 0, -30, 0, 0, 50, 20, 0];
          const [pixels, depths] = [new Float32Array(18), new Float32Array(6)];
          orbit.project(corners, [0, 0, 0, 0, 15, 15], pixels, depths);
          const under = orbit.under(500, 400);
          orbit.zoom(2, 500, 400);
          const [there, behind] = [9, -9].map((far) => orbit.eye.map((at, axis) => at + far * orbit.axes.into[axis]));
          const beside = there.map((at, axis) => at + 3 * orbit.axes.right[axis]);
          const outline = orbit.outline([there, behind, beside]);
          return { pixels: [...pixels], depths: [...depths], under, then: orbit.under(500, 400), outline };
        }""",
    )
    assert all(0.0 <= x <= 800.0 for x in seen["pixels"][::3])
    assert all(0.0 <= -y <= 600.0 for y in seen["pixels"][1::3])
    assert min(seen["depths"]) > 0.0
    assert seen["then"] == pytest.approx(seen["under"]), "one comes closer to what is under the pointer"
    middle, *cut, right = seen["outline"]
    assert middle == pytest.approx([400.0, 300.0])
    assert right == pytest.approx([400.0 + 300.0 / 3.0 / math.tan(math.pi / 8.0), 300.0])
    assert len(cut) == 2, "what is behind the eye is cut off"


@browser
def test_who_has_crashed_has_a_cross_there_too(neighbours: Page) -> None:
    page = neighbours

    def crosses() -> bool:
        bad = page.evaluate("getComputedStyle(document.documentElement).getPropertyValue('--bad')").strip()
        return bad in colours_of(page, 20)

    page.locator("#space").click()
    await_view(page)
    assert not crosses()
    type_in(page, "(WHEN (= id 2) (GOTO 50m 20m))")  # it touches the third, and both crash
    send(page)
    until(page, crosses)


@browser
def test_where_pictures_take_long_they_are_coarse_while_something_moves(modules: Page) -> None:
    found = calculated(
        modules,
        "fineness",
        """async ({ Fineness }) => {
          let again;
          const rest = new Promise((done) => (again = done));
          const fineness = new Fineness(again);
          const parts = [];
          const see = (moves, time) => {
            for (let picture = 0; picture < 40; picture += 1) fineness.took(time);
            parts.push(fineness.next(moves));
          };
          see(true, 20);
          see(true, 40);
          await rest;
          see(false, 40);
          see(true, 20);
          see(true, 10);
          return parts;
        }""",
    )
    assert found == [1, 0.7, 1, 0.7, 1]


@browser
def test_each_robot_has_the_form_of_its_type(modules: Page) -> None:
    found = calculated(
        modules,
        "solids",
        """(s) => {
          const { members, forms, places } = s.membersOf(6, [[2, 'plane'], [1, 'rover'], [2, 'plane']], 'copter');
          return { members, forms, places: [...places] };
        }""",
    )
    assert found["members"] == {"plane": 4, "rover": 1, "copter": 1}
    assert found["forms"] == ["plane", "plane", "rover", "plane", "plane", "copter"]
    assert found["places"] == [0, 1, 0, 2, 3, 0]


def test_the_scene_says_which_form_each_type_has() -> None:
    several = """
[[robots]]
like = "plane"
count = 2

[[robots]]
like = "copter"
count = 1

[[robots]]
like = "omni"
body = { bumpers = 0 }
count = 3
"""
    world = COPTERS[: COPTERS.index("[robots]")].replace("60m", "600m").replace("40m", "400m")
    scene = scene_of(read_scenario(world + several), tuple("abcdef"))
    assert list(zip(scene.sizes, scene.forms, strict=True)) == [
        ((2, 0.7), "plane"),
        ((1, 0.5), "copter"),
        ((3, 0.2), "rover"),
    ]


def test_the_library_is_unchanged() -> None:
    folder = STATIC / "vendor" / "three"
    sums = [line.split() for line in (folder / "VERSION.txt").read_text().partition("sha256:\n")[2].splitlines()]
    assert {name for _, name in sums} | {"VERSION.txt"} == {file.name for file in folder.iterdir()}
    for wanted, name in sums:
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == wanted, name
