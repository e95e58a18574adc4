"""The Nomads' page in a real Chromium: programs drive over the wire, a person looks on and takes a hand.

Every test also sees to it that the page asked nobody but its own server, and that the browser had nothing to complain
about.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, Page, expect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from console.running import PATIENCE, Program, let_run, open_page
from console.running import Page as Line
from console.test_page import await_picture, pixels_seen, settle, until
from sleepcast.nomad.client.nomad import Nomad
from sleepcast.nomad.panes.dialogue import MOST_UNDER_WAY

pytestmark = pytest.mark.browser

ROOM = """\
4 -1000 -1000 1000 -1000 1000 -960 -1000 -960
4 -1000 960 1000 960 1000 1000 -1000 1000
4 -1000 -960 -960 -960 -960 960 -1000 960
4 960 -960 1000 -960 1000 960 960 960
"""
"""A room of 16 by 16 feet."""

expect.set_options(timeout=1000 * PATIENCE)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    """Two Scouts in a room, any ports; Ctrl-C ends all of it cleanly."""
    room = tmp_path_factory.mktemp("room") / "room.txt"
    room.write_text(ROOM)
    with Program("nserver", room, "--robots", "2", "--page-port", "0") as started:
        yield started
        assert started.end() == 130
        assert "Traceback" not in started.said


@pytest.fixture
def nomads(server: Program) -> Program:
    """The server in real time, without STOP, and with the walls of the room alone, whatever the test before left behind
    and however that ended."""
    with open_page(let_run(server, 1.0)) as page:
        assert page.ask("load", name="room.txt", text=ROOM)["type"] == "done"
    return server


@pytest.fixture
def fast(nomads: Program) -> None:
    """The server at four times real time, for who waits until a robot has driven somewhere: each second with its sonars
    takes it a tenth of one."""
    let_run(nomads, 4.0)


@pytest.fixture
def robot(nomads: Program) -> Iterator[Nomad]:
    """A program that drives robot 1, from the middle of the room, where it has seen nothing yet."""
    found = re.search(r"port (\d+)", nomads.said)
    assert found
    with Nomad.connect("127.0.0.1", int(found[1]), robot=1) as nomad:
        nomad.refresh()
        nomad.place_robot(0, 0, 0, 0)
        yield nomad


@pytest.fixture
def page(nomads: Program, context: BrowserContext) -> Iterator[Page]:
    """The page, open and alive."""
    page = context.new_page()
    page.set_viewport_size({"width": 1100, "height": 760})
    complaints: list[str] = []
    page.on("console", lambda said: complaints.append(said.text) if said.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: complaints.append(request.url) if nomads.host not in request.url else None)
    page.goto(nomads.address)
    await_picture(page)
    page.locator("#tab-values").click()
    expect(page.locator("#pane-values")).to_contain_text("motion")
    yield page
    assert not complaints, complaints


def numbers(page: Page, kind: str) -> list[int]:
    """x, y, heading and turret as the values tell them: of the kind `encoder` or `actual`."""
    found = page.evaluate(
        """(kind) => [...document.querySelectorAll("#pane-values tbody tr")]
          .filter((row) => row.cells[2].textContent === kind).map((row) => row.cells[1].textContent)""",
        kind,
    )
    return [int(text.split()[0]) for text in found]


def order(page: Page, line: str) -> None:
    """Type a line and send it."""
    page.locator("#order").fill(line)
    page.locator("#order").press("Enter")


LONG_PAST, SHORT_PAST = (
    f"[aria-label^='{sensors} in the last minute']:visible" for sensors in ("Sonars", "Bumper")
)  # hidden until the chosen robot's are known


def change_obstacles(page: Page) -> None:
    """Let clicks on the map be about obstacles."""
    page.locator("#layers").click()
    page.locator("#build").click()


FIND_BOX = """
(name) => {
  const canvas = document.getElementById("ground");
  const { width, height } = canvas;
  const copy = Object.assign(document.createElement("canvas"), { width, height });
  const pen = copy.getContext("2d", { willReadFrequently: true });
  pen.fillStyle = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  pen.fillRect(0, 0, 1, 1);
  const [wanted] = new Uint32Array(pen.getImageData(0, 0, 1, 1).data.buffer);
  pen.drawImage(canvas, 0, 0);
  const pixels = new Uint32Array(pen.getImageData(0, 0, width, height).data.buffer);
  const box = [Infinity, Infinity, -Infinity, -Infinity];
  pixels.forEach((pixel, at) => {
    if (pixel !== wanted) return;
    const [x, y] = [at % width, Math.floor(at / width)];
    box[0] = Math.min(box[0], x); box[1] = Math.min(box[1], y);
    box[2] = Math.max(box[2], x); box[3] = Math.max(box[3], y);
  });
  if (box[0] === Infinity) return null;
  const { left, top, width: across } = canvas.getBoundingClientRect();
  return box.map((value, axis) => (axis % 2 ? top : left) + (value * across) / width);
}
"""
"""Within which pixels of the window the ground has a colour of the theme; null if it is nowhere."""


BESIDE = 16
"""Pixels to the right of a robot, and below it, at which its label is."""


class Map:
    """Where things are in the window: tenths of inches from the middle of the room, which has a side of 2000."""

    def __init__(self, page: Page) -> None:
        left, top, right, bottom = until(page, lambda: page.evaluate(FIND_BOX, "--map-obstacle"))
        self._scale = (right - left) / 2000
        self._x, self._y = (left + right) / 2, (top + bottom) / 2

    def __call__(self, x: float, y: float) -> tuple[float, float]:
        return self._x + x * self._scale, self._y - y * self._scale


def at_hand(page: Page, at: Map) -> bool:
    """Whether the picture has a robot in the middle of the room, as the label beside the one under the pointer says: it
    may come later than the robot's numbers."""
    x, y = at(0, 0)
    page.mouse.move(*at(0, 400))
    page.mouse.move(x, y)
    label = page.locator("#tip").bounding_box()
    return label is not None and (label["x"], label["y"]) == pytest.approx((x + BESIDE, y + BESIDE), abs=2)


def solid(page: Page, place: tuple[float, float]) -> bool:
    """Whether the ground shows an obstacle there."""
    settle(page)
    pixel, wall = page.evaluate(
        """([x, y]) => {
          const canvas = document.getElementById("ground");
          const { left, top, width } = canvas.getBoundingClientRect();
          const ratio = canvas.width / width;
          const copy = Object.assign(document.createElement("canvas"), { width: 2, height: 1 });
          const pen = copy.getContext("2d", { willReadFrequently: true });
          pen.drawImage(canvas, (x - left) * ratio, (y - top) * ratio, 1, 1, 0, 0, 1, 1);
          pen.fillStyle = getComputedStyle(document.documentElement).getPropertyValue("--map-obstacle").trim();
          pen.fillRect(1, 0, 1, 1);
          return [0, 1].map((at) => [...pen.getImageData(at, 0, 1, 1).data]);
        }""",
        place,
    )
    return bool(pixel == wall)


# ---- what a program does is seen


@pytest.mark.usefixtures("fast")
def test_a_program_drives_and_the_page_shows_it(page: Page, robot: Nomad) -> None:
    expect(page.locator("#robot-state")).to_contain_text("driven by 127.0.0.1")
    robot.dp(100, 0)
    robot.pr(300, 300)
    robot.draw_line(-500, -500, 500, -500, 4)
    robot.tk("Ouch.")
    state = robot.ws(True, True, seconds=200)
    until(page, lambda: numbers(page, "encoder") == list(state.words[34:38]))
    real = numbers(page, "actual")
    assert real[0] == pytest.approx(300, abs=5)  # dp has told it otherwise, and it stands where it stood
    assert real[1:] == [0, 0, 0]

    heard = page.locator("[aria-label^='Sonars in in,']")

    def readings() -> list[int]:
        return [round(float(text)) for text in re.findall(r"[\d.]+", heard.get_attribute("aria-label") or "")]

    until(page, lambda: readings() == list(robot.gs().words[17:33]))
    page.locator("#tab-said").click()
    expect(page.locator("#pane-said")).to_contain_text("Ouch.")
    page.locator("#tab-told").click()
    expect(page.locator("#pane-told")).to_contain_text("pr(300, 300, 0)")
    assert pixels_seen(page, "--robot-1", least=100)

    page.locator("#layers").click()
    for layer in ("actual", "encoder"):
        page.locator(f"#layer-{layer}").uncheck()
    until(page, lambda: ink(page) > 0)  # the line alone
    page.locator("[data-erase=refresh_client_graphics]").click()
    until(page, lambda: ink(page) == 0)
    page.locator("#layer-actual").check()
    until(page, lambda: ink(page) > 0)
    page.locator("[data-erase=refresh_actual_trace]").click()
    until(page, lambda: ink(page) == 0)


def ink(page: Page) -> int:
    """How many pixels of the layer of traces and drawings are not clear."""
    settle(page)
    found: int = page.evaluate(
        """() => {
          const canvas = document.getElementById("trails");
          const { width, height } = canvas;
          const copy = Object.assign(document.createElement("canvas"), { width, height });
          const pen = copy.getContext("2d", { willReadFrequently: true });
          pen.drawImage(canvas, 0, 0);
          const { data } = pen.getImageData(0, 0, width, height);
          return data.reduce((sum, value, place) => sum + (place % 4 === 3 && value > 0), 0);
        }"""
    )
    return found


def test_a_click_answers_a_program_that_asks_for_a_place(page: Page, robot: Nomad) -> None:
    with ThreadPoolExecutor() as pool:
        asked = pool.submit(robot.get_robot_conf, PATIENCE)
        expect(page.locator("#asked")).to_be_visible()
        box = page.locator("#own").bounding_box()
        assert box
        page.locator("#own").click(position={"x": box["width"] / 2 + 60, "y": box["height"] / 2})
        x, y, *_ = asked.result(PATIENCE)
    assert x > 50  # to the right of where it believes to be
    assert y == pytest.approx(0, abs=20)
    expect(page.locator("#asked")).to_be_hidden()


# ---- what a person does


@pytest.mark.usefixtures("fast")
def test_orders_from_the_page_move_the_robot(page: Page, robot: Nomad) -> None:
    order(page, "pr 300 300")
    expect(page.locator("#answer")).to_have_text("Robot 1 was given: pr 300 300")
    until(page, lambda: numbers(page, "actual")[:2] == [300, 0])
    page.locator("[data-order=place_robot]").click()
    page.locator("#fields [name=x]").fill("-200")
    page.locator("#fields [name=steering]").fill("900")
    page.locator("#fields").get_by_role("button").click()
    until(page, lambda: numbers(page, "actual") == [-200, 0, 900, 900])
    assert tuple(robot.gs().words[34:37]) == (-200, 0, 900)
    order(page, "tk Hello there.")
    expect(page.locator("#pane-said")).to_contain_text("Hello there.")

    for line, sentence in (
        ("wm 50 50", "there is no order 'wm', as there is vm, pr or st"),
        ("place_robt 1 2", "there is no order 'place_robt' (did you mean place_robot?)"),
        ("vm 50", "vm takes right left [third]; this has 1 number"),
        ("vm fast 50", "“fast” is no whole number: vm takes right left [third]."),
        ("conf_tm 256", "conf_tm: s must lie from 0 to 255, not be 256"),
    ):
        order(page, line)
        expect(page.locator("#answer.wrong")).to_contain_text(sentence)
    page.locator("#order").fill("")
    page.locator("#order").press_sequentially("plac")
    page.locator("#order").press("Tab")
    expect(page.locator("#order")).to_have_value("place_robot ")


def test_a_robot_that_is_chosen_again_is_shown_as_before(page: Page, robot: Nomad) -> None:
    order(page, "tk Still here.")
    said = page.locator("#pane-said")
    expect(said).to_contain_text("Still here.")
    page.locator("#map").focus()
    for key in "211":
        page.keyboard.press(key)
    at = Map(page)
    until(page, lambda: at_hand(page, at))
    page.mouse.click(*at(0, 0))
    page.wait_for_timeout(500)
    expect(said).to_contain_text("Still here.")


def test_an_order_takes_as_long_as_it_likes_and_is_given_once(page: Page, robot: Nomad) -> None:
    given: list[str | bytes] = []
    page.on("websocket", lambda socket: socket.on("framesent", lambda data: given.append(data)))
    page.clock.install()
    page.reload()
    page.locator("#tab-values").click()
    expect(page.locator("#pane-values")).to_contain_text("motion")
    page.locator("#run").click()
    expect(page.locator("#achieved")).to_have_text("paused")
    order(page, "zr")
    page.locator("#order").press("Enter")  # once more, or a key that is held
    expect(page.locator("#answer")).to_have_text("Robot 1 is to do: zr")
    order(page, "wm 50 50")
    wrong = page.locator("#answer.wrong")
    expect(wrong).to_contain_text("there is no order 'wm'")
    page.clock.fast_forward(60_000)
    assert sum('"zr"' in str(message) for message in given) == 1
    page.locator("#run").click()
    expect(page.locator("#achieved")).not_to_have_text("paused")
    page.locator("#tab-told").click()
    expect(page.locator("#pane-told")).to_contain_text("zr()")
    page.wait_for_timeout(1000)
    assert "there is no order 'wm'" in wrong.inner_text()  # what was done in the end does not hide it


@pytest.mark.usefixtures("fast")
def test_arrow_keys_drive_for_as_long_as_they_are_held(page: Page, robot: Nomad) -> None:
    page.locator("#map").focus()
    page.keyboard.down("ArrowUp")
    until(page, lambda: numbers(page, "actual")[0] > 50)
    page.keyboard.up("ArrowUp")
    expect(page.locator("#pane-values")).to_contain_text("standing")
    page.keyboard.down("ArrowLeft")
    until(page, lambda: 100 < numbers(page, "actual")[2] < 3500)
    page.locator("#order").focus()  # the map has lost the keys
    expect(page.locator("#pane-values")).to_contain_text("standing")
    page.keyboard.up("ArrowLeft")

    robot.place_robot(-800, 0, 0, 0)
    page.locator("#map").focus()
    page.keyboard.down("ArrowUp")
    expect(page.locator("#pane-values")).to_contain_text("moving")
    page.goto("about:blank")  # nobody says any more that it is to drive
    until(page, lambda: not any(robot.gs().words[38:40]))


def test_a_page_that_falls_silent_leaves_its_robot_at_rest(nomads: Program, robot: Nomad) -> None:
    with open_page(nomads) as page:
        page.tell("watch", robot=0)
        speeds = [0]
        while not any(speeds):  # said on until it is seen to move
            page.tell("drive", robot=0, numbers=[60, 60, 0])
            speeds = told_speeds(page)
        while any(speeds):  # and no more until it rests
            speeds = told_speeds(page)


def told_speeds(page: Line) -> list[int]:
    """How fast the axes of the watched robot turn, as soon as that is told anew."""
    values = page.wait_for("robot")["values"]
    return [int(value["shown"].split()[0]) for value in values if "speed" in value["name"]]


def test_robots_and_obstacles_are_put_elsewhere_by_hand(page: Page, robot: Nomad) -> None:
    at = Map(page)
    until(page, lambda: numbers(page, "actual") == [0, 0, 0, 0])
    until(page, lambda: at_hand(page, at))
    page.mouse.down()
    page.mouse.move(*at(250, 150), steps=3)
    page.mouse.move(*at(500, 300))
    page.mouse.up()
    until(page, lambda: numbers(page, "actual")[:2] == pytest.approx([500, 300], abs=15))

    change_obstacles(page)
    for corner in ((-600, -600), (-300, -600), (-300, -300)):
        page.mouse.click(*at(*corner))
    page.locator("#map").press("Enter")
    until(page, lambda: solid(page, at(-350, -500)))
    page.mouse.click(*at(-350, -500))
    expect(page.locator("#obstacle-bar .remove")).to_be_visible()
    page.mouse.move(*at(-350, -500))
    page.mouse.down()
    page.mouse.move(*at(-200, -400), steps=3)
    page.mouse.move(*at(250, -500))
    page.mouse.up()
    until(page, lambda: solid(page, at(250, -500)) and not solid(page, at(-350, -500)))
    page.mouse.click(*at(250, -500))
    page.locator("#map").press("Delete")
    until(page, lambda: not solid(page, at(250, -500)))
    page.locator("#obstacle-bar .undo").click()
    until(page, lambda: solid(page, at(250, -500)))
    page.locator("#map").press("Control+Shift+Z")
    until(page, lambda: not solid(page, at(250, -500)))


@pytest.mark.usefixtures("fast")
def test_the_pad_drives_at_its_first_press_after_a_click_on_the_map(page: Page, robot: Nomad) -> None:
    at = Map(page)
    page.mouse.click(*at(-700, -700))  # the keys belong to the map now
    box = page.locator("[data-way=forward]").bounding_box()
    assert box
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    until(page, lambda: numbers(page, "actual")[0] > 100)  # and it goes on for as long as it is held
    expect(page.locator("[data-way=forward]")).to_have_class("held")
    page.mouse.up()
    expect(page.locator("#pane-values")).to_contain_text("standing")

    page.locator("#map").focus()
    page.keyboard.down("ArrowDown")
    expect(page.locator("#pane-values")).to_contain_text("moving")
    page.locator("#pad").focus()  # the map has lost the keys
    expect(page.locator("#pane-values")).to_contain_text("standing")
    page.keyboard.up("ArrowDown")


def test_who_drives_a_robot_that_a_program_drives_is_told(page: Page, robot: Nomad, nomads: Program) -> None:
    order(page, "vm 20 20")
    expect(page.locator("#answer")).to_have_text("Robot 1 was given: vm 20 20")
    expect(page.locator("#contest")).to_be_hidden()
    with ThreadPoolExecutor() as pool:
        driving = True

        def drive() -> None:
            while driving:
                robot.vm(30, -30)

        done = pool.submit(drive)
        try:
            until(page, lambda: numbers(page, "actual")[2] > 0)
            order(page, "vm 50 50")
            both = r"given: vm 50 50\. It is driven by 127\.0\.0\.1:\d+ \(process \d+\) and the page: each replaces"
            expect(page.locator("#answer")).to_contain_text(re.compile(both))
            page.locator("#map").focus()
            page.keyboard.down("ArrowLeft")  # the page goes on asking
            expect(page.locator("#contest")).to_contain_text("and the page: each replaces what the other asks.")
            page.keyboard.up("ArrowLeft")
        finally:
            driving = False
            done.result(PATIENCE)
    expect(page.locator("#contest")).to_be_hidden()  # once the page has asked nothing for a while
    robot.st()
    contest, rivals = page.locator("#contest"), page.locator("#chooser .rivals")
    with connected(nomads) as other:

        def told() -> str:
            """What the page says while both drive on."""
            robot.vm(10, 10)
            other.vm(-10, -10)
            return contest.inner_text() if contest.is_visible() and rivals.count() == 1 else ""

        assert "the page" not in until(page, told)


def connected(nomads: Program) -> Nomad:
    """One more program for robot 1."""
    found = re.search(r"port (\d+)", nomads.said)
    assert found
    return Nomad.connect("127.0.0.1", int(found[1]), robot=1)


@pytest.mark.usefixtures("fast")
def test_gs_and_ws_say_how_the_robot_is(page: Page, robot: Nomad) -> None:
    robot.place_robot(123, -45, 900, 900)
    order(page, "gs")
    expect(page.locator("#answer")).to_contain_text(
        "Robot 1 was given: gs. x 123, y -45, steering 900, turret 900; speeds 0 0 0; sonars "
    )
    expect(page.locator("#answer")).to_contain_text("bumper 0")
    order(page, "pr 200 200")
    order(page, "ws")
    expect(page.locator("#answer")).to_contain_text("Robot 1 was given: ws. x 123, y 155")


@pytest.mark.usefixtures("fast")
def test_no_trace_leads_to_where_a_robot_was_put(page: Page, robot: Nomad) -> None:
    robot.refresh()
    robot.place_robot(-500, 0, 0, 0)
    robot.pr(200, 200)
    robot.ws(True, True, seconds=100)
    until(page, lambda: numbers(page, "actual")[:2] == [-300, 0] and ink(page) > 0)
    seen = [0]
    until(page, lambda: seen.append(ink(page)) or seen[-1] == seen[-2])  # the trace has come whole
    before = seen[-1]
    robot.place_robot(700, 500, 0, 0)
    until(page, lambda: numbers(page, "actual")[:2] == [700, 500])
    page.wait_for_timeout(300)
    assert ink(page) < 1.2 * before  # a line over there would be five times as long
    robot.dp(-700, -500)
    until(page, lambda: numbers(page, "encoder")[:2] == [-700, -500])
    page.wait_for_timeout(300)
    assert ink(page) < 1.2 * before
    robot.da(0, 0)
    robot.zr()
    until(page, lambda: numbers(page, "actual") == [0, 0, 0, 0])
    page.wait_for_timeout(300)
    assert ink(page) < 1.2 * before


def test_a_world_is_saved_and_loaded(page: Page, robot: Nomad, nomads: Program, tmp_path: Path) -> None:
    at = Map(page)
    change_obstacles(page)
    for corner in ((-600, -600), (-300, -600), (-300, -300)):
        page.mouse.click(*at(*corner))
    page.locator("#map").press("Enter")
    until(page, lambda: solid(page, at(-350, -500)))
    with page.expect_download() as download:
        page.locator("#save").click()
    expect(page.locator("#answer")).to_have_text("The obstacles were saved as world.txt.")
    saved = tmp_path / "saved.txt"
    download.value.save_as(saved)
    lines = [line for line in saved.read_text().splitlines() if not line.startswith("#")]
    assert lines[:4] == ROOM.splitlines()
    assert len(lines) == 5

    other = tmp_path / "other.txt"
    other.write_text(ROOM + "4 400 400 700 400 700 700 400 700  # a box\n")
    page.locator("#file").set_input_files(other)
    expect(page.locator("#answer")).to_have_text("The obstacles are those of other.txt.")
    until(page, lambda: solid(page, at(550, 550)) and not solid(page, at(-350, -500)))
    for text, wrong in (
        ("4 0 0 1 1\n", "bad.txt:1: wanted x and y of 4 corners, 8 numbers, not 4"),
        (
            "3 0 0 100 0 200 0\n",
            "bad.txt: its 1 polygons are too many for a running server, or one of them has no area",
        ),
        ("#" * 100_001, "bad.txt has more than 100000 bytes: start the server with it"),
    ):
        bad = tmp_path / "bad.txt"
        bad.write_text(text)
        page.locator("#file").set_input_files(bad)
        expect(page.locator("#answer.wrong")).to_contain_text(wrong)
    assert solid(page, at(550, 550)), "what is wrong changes nothing"
    page.locator("#file").set_input_files(saved)
    until(page, lambda: solid(page, at(-350, -500)) and not solid(page, at(550, 550)))
    with Program("nserver", saved, "--page-port", "0") as again:  # the same file begins a server
        second = page.context.new_page()
        second.goto(again.address)
        until(second, lambda: solid(second, Map(second)(-350, -500)))
        second.close()
    page.mouse.click(*at(-350, -500))
    page.locator("#map").press("Delete")
    until(page, lambda: not solid(page, at(-350, -500)))


@pytest.mark.usefixtures("fast")
def test_the_sensors_have_a_past(page: Page, robot: Nomad) -> None:
    past, bumps = page.locator(LONG_PAST), page.locator(SHORT_PAST)
    page.locator("#map").focus()
    page.keyboard.press("2")
    expect(bumps).to_have_attribute(
        "aria-label", "Bumper in the last minute: hit 0 times"
    )  # by no test before this one
    page.keyboard.press("1")
    robot.refresh()
    robot.place_robot(780, 0, 0, 0)
    robot.vm(30, 30)  # against the wall
    until(page, lambda: "hit" in (page.locator("[aria-label^='Bumper: ']").get_attribute("aria-label") or ""))
    robot.st()
    robot.place_robot(0, 0, 0, 0)
    page.locator("#run").click()  # while time stands still, the last minute stays as it is
    expect(page.locator("#achieved")).to_have_text("paused")
    expect(bumps).to_have_attribute("aria-label", "Bumper in the last minute: hit once")
    expect(past).to_have_attribute("aria-label", re.compile("the nearest reading was [6-9] in"))
    page.locator("#map").focus()
    page.keyboard.press("2")
    expect(bumps).to_have_attribute("aria-label", "Bumper in the last minute: hit 0 times")
    page.keyboard.press("1")
    expect(bumps).to_have_attribute("aria-label", "Bumper in the last minute: hit once")
    expect(page).to_have_url(re.compile("#robot=1$"))  # the address keeps up with what is seen, a moment later
    second = page.context.new_page()  # the server keeps it
    second.goto(page.url)
    expect(second.locator(SHORT_PAST)).to_have_attribute("aria-label", "Bumper in the last minute: hit once")
    second.close()
    page.locator("#run").click()
    expect(page.locator("#achieved")).not_to_have_text("paused")
    robot.refresh()
    expect(bumps).to_have_attribute("aria-label", "Bumper in the last minute: hit 0 times")


def test_stop_holds_against_a_program_that_drives_on(page: Page, robot: Nomad) -> None:
    robot.vm(100, -100)  # on the spot, or a wall would end it
    expect(page.locator("#pane-values")).to_contain_text("moving")
    page.locator("#order").focus()
    page.keyboard.press("F9")
    expect(page.locator("#stopped-text")).to_contain_text("every robot is kept at rest")
    expect(page.locator("#robot-state")).to_contain_text("held by the page")
    until(page, lambda: not any(robot.vm(100, -100).words[38:40]))
    page.locator("#release").click()
    expect(page.locator("#stopped")).to_be_hidden()
    until(page, lambda: all(robot.vm(100, -100).words[38:40]))


def test_time_stands_still_and_goes_on(page: Page, robot: Nomad) -> None:
    page.locator("#run").click()
    expect(page.locator("#achieved")).to_have_text("paused")
    robot.vm(100, 100)
    before = robot.gs().words[34]
    page.locator("#step").click()
    until(page, lambda: robot.gs().words[38] > 0)  # one tick, and it is faster
    assert robot.gs().words[34] - before <= 1
    page.locator("#run").click()
    until(page, lambda: robot.gs().words[34] > before + 50)


def test_a_narrow_window_needs_no_scrolling_aside(page: Page) -> None:
    page.set_viewport_size({"width": 420, "height": 860})
    settle(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= 420
    page.evaluate("window.scrollTo(0, document.body.scrollHeight)")
    expect(page.locator("#stop")).to_be_in_viewport()


def test_a_program_that_may_ends_the_page_as_well(tmp_path: Path) -> None:
    room = tmp_path / "room.txt"
    room.write_text(ROOM)
    with Program("nserver", room, "--page-port", "0", "--may-quit") as program, open_page(program) as page:
        found = re.search(r"port (\d+)", program.said)
        assert found
        nomad = Nomad.connect("127.0.0.1", int(found[1]))
        nomad.quit_server()
        nomad.connection.close()
        with pytest.raises(ConnectionClosed):
            page.drain()
        assert program.process.stdout is not None
        with program.process.stdout as output:
            assert "Traceback" not in output.read()
        assert program.process.wait(PATIENCE) == 0


# ---- what nobody may do


def test_what_is_no_message_of_the_page_is_refused(nomads: Program) -> None:
    with open_page(nomads) as page:
        assert len(page.ask("sense", robot=1)["body"]["sonars"]) == 16  # what any robot's page may ask
        for kind, fields, reason in (
            ("perform", {"robot": 7, "order": "st", "numbers": []}, "there is no robot 8: there are 2"),
            ("perform", {"robot": 0, "order": "quit_server", "numbers": []}, "there is no order 'quit_server'"),
            ("perform", {"robot": 0, "order": "vm", "numbers": [2**40, 0, 0]}, "not a message of this page"),
            ("perform", {"robot": 0, "order": "vm", "numbers": [20_000, 0, 0]}, "right must lie from -10000 to 10000"),
            ("perform", {"robot": 0, "order": "add_obstacle", "numbers": [5, 1, 2]}, "5 corners make 11 numbers"),
            ("perform", {"robot": 0, "order": "st", "numbers": [], "text": "x"}, "takes numbers, not words"),
            ("perform", {"robot": 0, "order": "tk", "numbers": [1], "text": "x"}, "takes words, and no numbers"),
            ("click", {"robot": 0, "x": 0.0, "y": 0.0}, "no program waits for a place"),
            ("click", {"robot": 0, "x": 1e300, "y": 0.0}, "not a message of this page"),
            ("build", {"corners": [[0, 0], [1, 1]]}, "not a message of this page"),
            ("build", {"corners": [[0, 0], [1, 1], [2, 2]]}, "This cannot be put up"),
            ("clear", {"version": 1, "place": 400}, "The obstacles have changed meanwhile"),
            ("preview", {"text": "(MARK)"}, "This is not supported for these robots"),
            ("clack", {}, "not a message of this page"),
        ):
            answer = page.ask(kind, **fields)
            assert (answer["type"], reason in answer["reason"]) == ("refused", True), answer
        for _ in range(300):
            page.socket.send("[" * 50)
        with pytest.raises(ConnectionClosed, match="too many messages"):
            page.drain()


def test_orders_that_wait_to_be_done_are_bounded(nomads: Program) -> None:
    with open_page(nomads) as page:
        page.tell("pace", running=False)
        for serial in range(1, MOST_UNDER_WAY + 2):  # none is done as long as time stands still
            page.tell("perform", serial=serial, robot=1, order="zr", numbers=[])
        refused = page.wait_for("refused")
        assert (refused["serial"], "too many orders wait" in refused["reason"]) == (MOST_UNDER_WAY + 1, True)
        page.tell("pace", running=True)
        page.wait_for("done", lambda found: found["serial"] == 1)


def test_only_the_page_itself_comes_in(nomads: Program) -> None:
    with pytest.raises(InvalidStatus, match="403"), open_page(nomads, origin="http://elsewhere.example"):
        pass
