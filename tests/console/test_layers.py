"""The layers of the map, measuring, exports and touch, in a real Chromium."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from contextlib import suppress
from io import BytesIO
from itertools import pairwise
from pathlib import Path

import pytest
from PIL import Image
from playwright.sync_api import Browser, BrowserContext, Locator, Page, expect
from playwright.sync_api import TimeoutError as TooLateError

from console.running import PATIENCE, Program
from console.test_page import await_picture, pixels, settle, until
from small_worlds import SCOUTS, write

pytestmark = pytest.mark.browser

expect.set_options(timeout=1000 * PATIENCE)

LEAST = 44
"""Pixels that a finger needs."""


@pytest.fixture(scope="module")
def scouts(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    """Three scouts in a room."""
    folder = tmp_path_factory.mktemp("scouts")
    write(folder, ("count = 1", "count = 3"), text=SCOUTS)
    with Program("run", folder, "--page", "--speed", "1") as started:
        yield started


@pytest.fixture
def page(scouts: Program, context: BrowserContext) -> Page:
    found = context.new_page()
    found.goto(scouts.address)
    await_picture(found)
    expect(found.locator("#legend li")).not_to_have_count(0)
    expect(found.locator("#scale-text")).not_to_be_empty()
    return found


@pytest.fixture
def bare(scouts: Program, context: BrowserContext) -> Page:
    """An empty page of the same server, which may use the page's modules."""
    found = context.new_page()
    found.goto(f"http://{scouts.host}/static/style.css")
    return found


def box(found: Locator) -> dict[str, float]:
    place = found.bounding_box()
    assert place is not None
    return {**place}


def run(page: Page, wanted: bool) -> None:
    """Let time run, or stand still; the tests share one program."""
    await_picture(page)  # the program has said how it is
    button = page.locator(f'#run[data-running="{str(not wanted).lower()}"]')
    if button.count():
        with suppress(TooLateError):  # the news that it is so already may come just now
            button.click(timeout=5_000)
    expect(page.locator("#run")).to_have_attribute("data-running", str(wanted).lower())


def choose(page: Page) -> tuple[float, float]:
    """Choose a robot by keys; gives where it is."""
    page.locator("#map").focus()
    page.keyboard.press("ArrowUp")
    expect(page.locator("#robot-name")).to_have_text(re.compile(r"scout\d"))
    xs, ys = zip(*until(page, lambda: pixels(page, "--chosen")), strict=True)
    return (min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2


def test_layers_are_shown_remembered_and_switched_by_keys(page: Page) -> None:
    run(page, False)
    choose(page)

    sensors = page.locator("#layer-sensors")

    def drawn(shown: bool) -> str:
        sensors.set_checked(shown)
        settle(page)
        found: str = page.locator("#robots").evaluate("canvas => canvas.toDataURL()")
        return found

    def are_its_sonars_all_that_changes() -> bool:
        """On a busy machine the first look at who would obey may light robots between two of these pictures."""
        before, with_them, after = drawn(False), drawn(True), drawn(False)
        return before == after != with_them

    page.locator("#layers").click()
    until(page, are_its_sonars_all_that_changes)
    sensors.check()
    page.locator("#layer-trails").uncheck()
    page.locator("#layer-density").check()
    page.keyboard.press("Escape")
    expect(page.locator("#layer-menu")).to_be_hidden()
    expect(page.locator("#layers")).to_be_focused()
    page.reload()
    page.locator("#layers").click()
    expect(page.locator("#layer-sensors")).to_be_checked()
    expect(page.locator("#layer-trails")).not_to_be_checked()
    expect(page.locator("#layer-density")).to_be_checked()
    page.locator("#map").press("t")
    expect(page.locator("#layer-trails")).to_be_checked()


LABELS = """
async () => {
  const { Labels } = await import("/static/labels.js");
  const { View } = await import("/static/view.js");
  const [count, side] = [1000, 1000];
  let seed = 7;
  const chance = () => (seed = (seed * 48271) % 2147483647) / 2147483647;
  const poses = Float32Array.from({ length: 3 * count }, () => side * chance());
  const groups = new Uint8Array(count);
  for (let i = 0; i < 9; i += 1) {
    groups[i] = 1;
    poses.set([500 + i, 500 - i, 0], 3 * i);
  }
  const scene = {
    names: Array.from({ length: count }, (_, i) => `robot${i}`), groups: [{ name: "bravo" }],
    places: [{ name: "home", x: 300, y: 300 }, { name: "home too", x: 302, y: 300 }], lights: [], areas: [],
    obstacles: [],
  };
  const picked = new Uint8Array(count);
  picked[777] = 1;
  const what = {
    scene, frame: { count, poses, groups }, marks: { chosen: 555, pointed: -1 },
    sizes: () => 5, picked, robots: true, ratio: 1,
    colours: { ground: "#fff", ink: "#000", quiet: "#555", place: "#a00", robots: Array(9).fill("#00a") },
  };
  const view = new View();
  view.resize(1200, 800);
  view.fit([0, 0, side, side]);
  const labels = new Labels();
  const wide = (text) => 7 * text.length;
  const look = () => {
    const found = labels.arrange(view, what, wide);
    const over = found.filter((a, i) => found.slice(i + 1).some((b) =>
      Math.abs(a.y - b.y) < 16 && a.x < b.x + wide(b.text) && b.x < a.x + wide(a.text)));
    return { texts: found.map(({ text }) => text), over: over.length };
  };
  const far = look();
  const panned = [far];
  for (let step = 0; step < 40; step += 1) {
    view.pan(3, 2);
    panned.push(look());
  }
  const inside = (robot) => robot < 0
    || (view.toScreenX(poses[3 * robot]) < 1100 && view.toScreenY(poses[3 * robot + 1]) < 700);
  const lost = panned.slice(1).map(({ texts }, at) =>
    panned[at].texts.filter((text) => !texts.includes(text) && inside(scene.names.indexOf(text))));
  view.fit([0, 0, side, side]);
  const zoomed = [];
  for (let step = 0; step < 30; step += 1) {
    zoomed.push(look());
    view.zoom(1.1);
  }
  view.fit([0, 0, side, side]);
  what.robots = false;
  const plain = look();
  what.robots = true;
  const row = (apart) => {
    const frame = { count: 10, poses: new Float32Array(30), groups: new Uint8Array(10) };
    for (let i = 0; i < 10; i += 1) frame.poses.set([20 + apart * i, 500, 0], 3 * i);
    const few = { ...what, frame, picked: null, marks: { chosen: -1, pointed: -1 }, scene: { ...scene, places: [] } };
    const names = new Labels().arrange(view, few, wide);
    const middles = Array.from({ length: 10 }, (_, i) => [view.toScreenX(20 + apart * i), view.toScreenY(500)]);
    const hidden = middles.filter(([x, y]) =>
      names.some((name) => x > name.x - 5 && x < name.x + wide(name.text) + 5 && Math.abs(y - name.y) < 9 + 5));
    return [names.length, hidden.length];
  };
  const rows = [30, 100].map((apart) => row(apart));
  const pen = Object.assign(document.createElement("canvas"), { width: 1200, height: 800 }).getContext("2d");
  const times = [];
  for (let step = 0; step < 120; step += 1) {
    view.fit([0, 0, side, side]);
    view.pan(step, 0);
    const begun = performance.now();
    labels.draw(pen, view, what);
    times.push(performance.now() - begun);
  }
  return { far, lost, zoomed, plain, rows, over: [...panned, ...zoomed].filter(({ over }) => over).length, times };
}
"""


def test_names_thin_out_and_stay_while_the_map_moves(bare: Page) -> None:
    found = bare.evaluate(LABELS)
    assert found["over"] == 0  # no name lies over another
    first = found["far"]["texts"]
    assert {"robot555", "robot777", "home", "bravo"} < set(first)  # the chosen one, the selected one, a place, a group
    assert "home too" not in first
    assert found["lost"] == [[]] * 40  # who has a name keeps it
    numbers = [len(look["texts"]) for look in found["zoomed"]]
    assert numbers[0] < 15
    assert max(numbers) > 35
    assert max(abs(after - before) for before, after in pairwise(numbers)) < 12  # by and by
    assert found["plain"]["texts"] == ["robot555", "home"]
    (named, hidden), beside = found["rows"]
    assert 3 <= named < 10
    assert hidden == 0  # names of few robots hide none of them
    assert beside == [10, 0]
    assert sorted(found["times"])[len(found["times"]) // 2] < 1.0  # ms a frame


POINTS = """
async (groups) => {
  const { drawSwarm } = await import("/static/swarm.js");
  const { looksOf, sortsOf } = await import("/static/shapes.js");
  const { View } = await import("/static/view.js");
  const count = 8000;
  const side = 100;
  const frame = { count, poses: new Float32Array(3 * count), flags: new Uint8Array(count) };
  frame.groups = new Uint8Array(count);
  for (let i = 0; i < count; i += 1) frame.poses.set([(i % side) + 0.5, Math.floor(i / side) + 0.5, 0], 3 * i);
  for (let group = 1; group <= groups; group += 1) frame.groups[side * 40 + 5 * group] = group;
  const scene = { area: [0, 0, side, 80], sizes: [[count, 0.1]] };
  const canvas = Object.assign(document.createElement("canvas"), { width: 850, height: 680 });
  const view = new View();
  view.resize(850, 680);
  view.fit(scene.area);
  const pen = canvas.getContext("2d");
  const lit = new Uint8Array(count);
  lit[0] = 1;
  const colours = { lit: "#f0a000", chosen: "#000", robots: Array(9).fill("#0000aa") };
  const look = (marks, at, half) => {
    pen.clearRect(0, 0, 850, 680);
    const looks = looksOf(frame, sortsOf(scene.sizes, count));
    drawSwarm(pen, view, scene, frame, looks, { chosen: -1, pointed: -1, ...marks }, colours, 1);
    return at.map((robot) => {
      const x = Math.round(view.toScreenX(frame.poses[3 * robot]));
      const y = Math.round(view.toScreenY(frame.poses[3 * robot + 1]));
      const { data } = pen.getImageData(x - half, y - half, 2 * half + 1, 2 * half + 1);
      return Array.from({ length: (2 * half + 1) ** 2 }, (_, pixel) => data[4 * pixel + 3]);
    });
  };
  const members = Array.from({ length: groups }, (_, group) => side * 40 + 5 * (group + 1));
  return {
    shapes: look({ lit: null, glow: 1 }, members, 3),
    dim: look({ lit, glow: 1 }, [1, 0], 0),
    gone: look({ lit, glow: 0 }, [1], 0),
  };
}
"""


def test_points_of_groups_differ_without_colour(bare: Page) -> None:
    found = bare.evaluate(POINTS, 7)
    assert len({tuple(shape) for shape in found["shapes"]}) == 7
    (other,), (lit,) = found["dim"]
    assert (lit, 60 < other < 100) == (255, True)  # who is not lit steps back
    assert found["gone"] == [[255]]


def middle(page: Page) -> list[int]:
    """The colour of the ground's pixel a little beside the middle."""
    found: list[int] = page.locator("#ground").evaluate(
        """(canvas) => Array.from(
          canvas.getContext("2d").getImageData(canvas.width / 2 + 9, canvas.height / 2 + 9, 1, 1).data)"""
    )
    return found


def test_a_picture_lies_under_the_world_and_stays_in_this_browser(page: Page) -> None:
    run(page, False)
    plain = middle(page)
    page.locator("#layers").click()
    file = page.locator(".ground-picture .file")
    said = page.locator(".ground-picture .said")
    file.set_input_files({"name": "map.svg", "mimeType": "image/svg+xml", "buffer": b"<svg/>"})
    expect(said).to_have_text("Choose a picture in PNG, JPEG or WebP.")
    file.set_input_files({"name": "map.png", "mimeType": "image/png", "buffer": b"<svg/>"})
    expect(said).to_contain_text("no picture that can be read")
    picture = BytesIO()
    Image.new("RGB", (60, 60), (200, 0, 0)).save(picture, "PNG")
    file.set_input_files({"name": "map.png", "mimeType": "image/png", "buffer": picture.getvalue()})
    expect(said).to_be_hidden()
    expect(page.locator(".ground-picture .resolution")).to_have_value("0.2")  # as wide as the room of 12 m
    until(page, lambda: middle(page)[0] > middle(page)[1] + 50)
    seen = middle(page)
    page.locator(".ground-picture .opacity").fill("30")
    until(page, lambda: seen[1] < middle(page)[1] < plain[1])
    page.locator(".ground-picture .x").fill("8")
    page.locator(".ground-picture .x").press("Tab")
    until(page, lambda: middle(page) == plain)
    page.locator("#map").press("Control+z")
    expect(page.locator("#undone")).to_contain_text("Undone: move the picture")
    until(page, lambda: middle(page) != plain)
    page.reload()
    until(page, lambda: middle(page)[0] > middle(page)[1] + 20)
    page.locator("#layers").click()
    expect(page.locator(".ground-picture .opacity")).to_have_value("30")
    page.locator("#layer-picture").uncheck()
    until(page, lambda: middle(page) == plain)
    page.locator("#layer-picture").check()
    page.locator(".ground-picture .remove").click()
    expect(page.locator(".ground-picture .remove")).to_be_hidden()
    until(page, lambda: middle(page) == plain)


def test_the_map_of_a_scenario_lies_under_it_by_itself(tmp_path: Path, context: BrowserContext) -> None:
    Image.new("L", (24, 24), 205).save(tmp_path / "lab.png")  # nobody knows what is there
    (tmp_path / "lab.yaml").write_text(
        "image: lab.png\nresolution: 0.5\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.19\n"
    )
    write(tmp_path, ("[world]", '[world]\nmap = "lab.yaml"'), text=SCOUTS)
    with Program("run", tmp_path, "--page", "--speed", "1") as program:
        page = context.new_page()
        page.goto(program.address)
        until(page, lambda: 217 < middle(page)[0] < 233)  # 60 per cent of the map's grey
        page.emulate_media(color_scheme="dark")
        until(page, lambda: 28 < middle(page)[0] < 44)  # and of its negative
        page.locator("#layers").click()
        expect(page.locator(".ground-picture .opacity")).to_be_visible()
        expect(page.locator(".ground-picture .remove")).to_be_hidden()  # it is the scenario's


def test_a_distance_is_measured_in_the_unit_of_the_map(page: Page) -> None:
    world = box(page.locator("#map"))
    x, y = world["x"] + 300, world["y"] + 200
    page.locator("#map").press("m")
    expect(page.locator("#measure")).to_have_attribute("aria-pressed", "true")
    page.mouse.move(x, y)
    before = until(page, lambda: page.locator("#place-text").inner_text())
    page.mouse.down()
    page.mouse.move(x + 120, y - 160, steps=4)
    page.mouse.up()
    metres = float(page.locator("#scale-text").inner_text().removesuffix(" m"))
    expected = 200 * metres / box(page.locator("#scale-bar"))["width"]
    expect(page.locator("#heard")).to_have_text(re.compile(r"^[\d.]+ m$"))
    said = page.locator("#heard").inner_text()
    assert float(said.removesuffix(" m")) == pytest.approx(expected, rel=0.02)
    page.mouse.move(x, y)
    expect(page.locator("#place-text")).to_have_text(before)  # the map has not been moved
    page.keyboard.press("m")
    expect(page.locator("#measure")).to_have_attribute("aria-pressed", "false")


def test_the_label_stays_with_its_robot(page: Page) -> None:
    run(page, False)
    x, y = choose(page)
    page.mouse.move(x, y)
    tip = page.locator("#tip")
    expect(tip).to_contain_text("scout")
    before = box(tip)
    page.mouse.down()
    page.mouse.move(x + 50, y + 30, steps=3)

    def came_along() -> bool:
        moved = box(tip)
        return (moved["x"] - before["x"], moved["y"] - before["y"]) == pytest.approx((50, 30), abs=2)

    until(page, came_along)
    page.mouse.up()
    page.locator("#map").press("Shift+ArrowLeft")  # the robot goes away from under the pointer, and its label with it
    expect(tip).to_be_hidden()


def test_the_map_is_saved_as_a_picture_and_as_a_film(page: Page, tmp_path: Path) -> None:
    run(page, True)
    page.locator("#layers").click()
    with page.expect_download() as picture:
        page.locator("#save-picture").click()
    picture.value.save_as(tmp_path / "map.png")
    assert re.fullmatch(r"scouts-\d+\.\d\d\.\d\d\.png", picture.value.suggested_filename)
    data = (tmp_path / "map.png").read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    size = page.locator("#ground").evaluate("canvas => [canvas.width, canvas.height]")
    assert list(struct.unpack(">2I", data[16:24])) == size
    assert len(data) > 5_000  # something is on it

    film = page.locator("#save-film")
    film.click()
    expect(film).to_have_text(re.compile(r"Stop and save the film \([\d,]+ kB\)"))  # the first pictures are in it
    with page.expect_download() as saved:
        film.click()
    saved.value.save_as(tmp_path / "map.webm")
    data = (tmp_path / "map.webm").read_bytes()
    assert data[:4] == b"\x1a\x45\xdf\xa3"
    assert b"webm" in data[:64]
    expect(film).to_have_text("Film the map (WebM)")


def test_fingers_find_what_they_press_and_read_where_they_touch(scouts: Program, chromium: Browser) -> None:
    phone = {"width": 390, "height": 844}
    with chromium.new_context(viewport=phone, has_touch=True, is_mobile=True) as context:
        context.set_default_timeout(1000 * PATIENCE)
        page = context.new_page()
        page.goto(scouts.address)
        await_picture(page)
        expect(page.locator("#legend li")).not_to_have_count(0)
        page.locator("#map").tap(position={"x": 200, "y": 200})
        expect(page.locator("#place-text")).to_have_text(re.compile(r"x -?\d+\.\d\d  y -?\d+\.\d\d m"))
        page.locator("#layers").tap()
        expect(page.locator("#layer-menu")).to_be_visible()
        small = page.evaluate(
            """(least) => [...document.querySelectorAll("button, select, .layer-menu label")]
              .filter((each) => each.checkVisibility() && each.getBoundingClientRect().width > 0)
              .map((each) => [each.id || each.textContent, each.getBoundingClientRect()])
              .filter(([, { width, height }]) => height < least - 0.5 || width < least - 0.5)
              .map(([name, { width, height }]) => `${name}: ${width} x ${height}`)""",
            LEAST,
        )
        assert small == []
