"""Prints how the operator's page holds up in Chromium without a graphics card, and the bars beside it.

    python -m benchmarks.page [--quick] [--json] [--only-space]

Frames a second with every pane open, for 1,000, 10,000 and 100,000 robots of `bravo` (with the table in the drawer, and
with the plots; the slower of the two counts); how evenly the table of 100,000 scrolls; the bytes that a page is sent
while time runs and no robot moves; the time from the STOP key to the first picture in which every robot is stopped,
while the table of 100,000 is sorted time and again; the time from a move of the pointer, which drags a number in the
prompt, to the picture with the new count of 10,000 robots; and what memory the page and the program gain in eight
simulated hours; what a frame spends on the names of 1,000 robots; and frames a second of the view in three dimensions
beside the map, 1280 x 720 pixels, while a recording of copters is replayed: the median of 300. A frame counts when the
page says that it has drawn it, and there when its picture is put on the page.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from typing import TYPE_CHECKING

from benchmarks.programs import QUIET, Program, chromium
from benchmarks.report import Bar, described, machine, middle, number, table

if TYPE_CHECKING:
    from playwright.sync_api import Page

FRAMES = {1_000: 30.0, 10_000: 30.0, 100_000: 10.0}
"""Frames a second at least, by number of robots."""
FLYING = {1_000: 30.0, 10_000: 10.0}
"""The same of the view in three dimensions, by number of copters."""
FLIGHTS, QUICK_FLIGHTS = 300, 20
"""Frames of it."""
COPTERS = """
format = 1
title = "Copters in the air"
seconds = "10s"
tick = "0.1s"
seed = 7
mission = "fly.sleep"

[world]
width = "{side}m"
height = "{side}m"

[robots]
like = "copter"
count = {count}
z = ["1m", "25m"]
"""
FLY = "@0s (PROGN (SETQ drive_speed 3m/s) (SETQ drive_turn 20deg/s) (SETQ drive_climb (GAUSS 0m/s 0.3m/s)))"
"""Each goes in circles, up or down."""
EACH = 100.0
"""m2 of ground for each."""
ROOM = "{ position: 'fixed', inset: '0 auto auto 0', width: '1281px', height: '720px', zIndex: 9 }"
"""Where the view is while it is measured, with its border."""
TIMED = """
  window.__times = [];
  const put = ImageBitmapRenderingContext.prototype.transferFromImageBitmap;
  ImageBitmapRenderingContext.prototype.transferFromImageBitmap = function (picture) {
    window.__times.push(performance.now());
    window.__pixels = `${picture.width} x ${picture.height} pixels`;
    put.call(this, picture);
  };
"""
AGAIN = """
  (frames) => {
    if (document.getElementById("run").dataset.running === "false") document.getElementById("run").click();
    return window.__times.length > frames;
  }
"""
"""Whether there were so many frames; at its end the recording begins anew."""
REST = 60.0
"""kB a second at most, to a page whose robots stand."""
STOP = 100.0
"""ms at most from the key to the picture in which every robot is stopped."""
HITCH = 100.0
"""ms: a frame of the screen that takes longer is seen as a hitch while one scrolls."""
DRAG = 50.0
"""ms at most from the pointer that drags a number to the picture with the new count."""
MOVES, QUICK_MOVES = 50, 5
NAMES = 1.0
"""ms of a frame at most for placing and drawing the names of 1,000 robots."""
GROWTH = 10.0
"""Per cent at most that the page's memory may grow between the first quarter and the end of a long run."""
PAST = 400.0
"""MB at most that the program may gain meanwhile: it keeps pictures (128 MiB) and states (256 MiB) of the run's past,
and thins them when these bounds are reached."""
HOURS = 8.0
SECONDS, QUICK_SECONDS = 6.0, 1.0
STOPS, QUICK_STOPS = 25, 2
PATIENCE = 300.0
"""Seconds for what a busy machine may take."""

LISTEN = """
  window.__page = { drawn: 0, bytes: 0, stoppedAt: 0, pressedAt: 0 };
  const Real = window.WebSocket;
  window.WebSocket = class extends Real {
    constructor(...how) {
      super(...how);
      this.addEventListener("message", ({ data }) => {
        const found = window.__page;
        found.bytes += data.byteLength ?? data.length;
        if (typeof data === "string" || found.stoppedAt || !found.pressedAt) return;
        const view = new DataView(data);
        const count = view.getUint32(4, true);
        if (view.getUint8(3) === 1) return;
        const flags = new Uint8Array(data, 32 + 13 * count, count);
        if (flags.every((flag) => flag & 1)) found.stoppedAt = performance.now();
      });
    }
    send(text) {
      if (text.includes('"drawn"')) window.__page.drawn += 1;
      super.send(text);
    }
  };
  window.addEventListener("keydown", (event) => {
    if (event.key === "F9") Object.assign(window.__page, { pressedAt: performance.now(), stoppedAt: 0 });
  }, true);
"""
DRAGGED = """
  () => {
    const found = (window.__dragged = []);
    let moved = 0;
    document.getElementById("text").addEventListener("pointermove", () => (moved = performance.now()), true);
    new MutationObserver(() => {
      const begun = moved;
      if (!begun) return;
      moved = 0;
      requestAnimationFrame(() => setTimeout(() => found.push(performance.now() - begun)));
    }).observe(document.getElementById("yes"), { childList: true, characterData: true, subtree: true });
  }
"""
SCROLL = """
  (seconds) => new Promise((done) => {
    const body = document.querySelector(".table-rows");
    const begun = performance.now();
    const times = [];
    let last = begun;
    const step = (now) => {
      times.push(now - last);
      last = now;
      body.scrollTop = (body.scrollTop + 3000) % (body.scrollHeight - body.clientHeight);
      if (now - begun < 1000 * seconds) requestAnimationFrame(step);
      else done(times.slice(1));
    };
    requestAnimationFrame(step);
  })
"""


NAMED = """
  async () => {
    const { Labels } = await import("/static/labels.js");
    const real = Labels.prototype.draw;
    window.__names = [];
    Labels.prototype.draw = function draw(...what) {
      const begun = performance.now();
      real.apply(this, what);
      window.__names.push(performance.now() - begun);
    };
  }
"""


@dataclass(frozen=True)
class Found:
    """A value that was measured. bar: what it is held against."""

    bar: Bar
    detail: str = ""


@contextmanager
def visited(address: str, script: str) -> Iterator[Page]:
    """The page at this address in a browser of its own, where the script has run before any other."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium(), args=QUIET)
        page = browser.new_page(viewport={"width": 1440, "height": 900}, color_scheme="light")
        page.set_default_timeout(1000 * PATIENCE)
        page.add_init_script(script)
        page.goto(address)
        yield page
        browser.close()


@contextmanager
def opened(robots: int, *options: str) -> Iterator[tuple[Program, Page]]:
    """Bravo's page, with time running, a robot chosen and everything shown that there is; and the program behind it."""
    arguments = ("demo", "bravo", "--robots", str(robots), "--seed", "7", "--run", *options)
    with Program(*arguments) as program, visited(program.address, LISTEN) as page:
        page.wait_for_function("() => window.__page.drawn > 3")
        page.locator("#map").focus()
        page.keyboard.press("ArrowRight")
        yield program, page


def show(page: Page, pane: str) -> None:
    """Open a pane of the drawer."""
    tab = page.locator(f"#drawer-{pane}")
    if tab.get_attribute("aria-selected") != "true":
        tab.click()
    if pane == "table":
        page.wait_for_function("() => document.querySelector('.table-row .table-cell')?.textContent")
    else:
        page.wait_for_function("() => document.querySelector('.plot canvas')")


def rate(page: Page, what: str, seconds: float) -> float:
    """How much more there is in a second of one of the page's counts."""
    before, begun = float(page.evaluate(f"window.__page.{what}")), monotonic()
    sleep(seconds)
    after, ended = float(page.evaluate(f"window.__page.{what}")), monotonic()
    return (after - before) / (ended - begun)


def frames(robots: int, seconds: float) -> Found:
    """Frames a second with all panes open."""
    name = f"{robots:,} robots, all panes open"
    with opened(robots) as (_, page):
        rates, costs = {}, []
        work = worked(page)
        for pane in ("table", "plots"):
            show(page, pane)
            sleep(min(2.0, seconds))
            before, drawn = work(), float(page.evaluate("window.__page.drawn"))
            rates[pane] = rate(page, "drawn", seconds)
            after = float(page.evaluate("window.__page.drawn"))
            costs.append(1000.0 * (work() - before) / max(1.0, after - drawn))
    slowest = min(rates, key=lambda pane: rates[pane])
    detail = ", ".join(f"{pane} {number(each)}" for pane, each in rates.items())
    detail += f"; {number(max(costs))} ms of the processor a frame"
    return Found(Bar(name, rates[slowest], FRAMES[robots], "frames/s"), detail)


def worked(page: Page) -> Callable[[], float]:
    """What gives the seconds of the processor that the page's own thread has used from now on."""
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable", {"timeDomain": "threadTicks"})

    def work() -> float:
        metrics = session.send("Performance.getMetrics")["metrics"]
        return float(next(each["value"] for each in metrics if each["name"] == "TaskDuration"))

    return work


def at_rest(seconds: float) -> Found:
    """What a page is sent while robots stand and time runs; moving they need some more."""
    with opened(1_000) as (_, page):
        show(page, "table")
        moving = rate(page, "bytes", seconds) / 1000.0
        page.keyboard.press("F9")
        page.wait_for_function("() => window.__page.stoppedAt > 0")
        sleep(2.0)
        found = rate(page, "bytes", max(3.0, seconds)) / 1000.0
    bar = Bar("1,000 robots at rest, with the table open", found, REST, "kB/s", at_least=False)
    return Found(bar, f"while they move {number(moving)}")


def large_table(seconds: float, stops: int) -> list[Found]:
    """The table of 100,000: how it scrolls, and how soon STOP holds while it is sorted."""
    with opened(100_000) as (_, page):
        show(page, "table")
        page.locator("#run").click()
        times = page.evaluate(SCROLL, seconds)
        page.locator("#run").click()
        page.evaluate(
            """window.__sorting = setInterval(() => document.querySelectorAll(".table-sort")[3].click(), 50)"""
        )
        latencies = []
        for _ in range(stops):
            sleep(0.7)
            page.keyboard.press("F9")
            page.wait_for_function("() => window.__page.stoppedAt > 0")
            latencies.append(float(page.evaluate("window.__page.stoppedAt - window.__page.pressedAt")))
            page.locator("#release").click()
            page.wait_for_function("() => document.getElementById('stopped').hidden")
            page.evaluate("window.__page.pressedAt = 0")
    hitches = sum(time > HITCH for time in times)
    return [
        Found(
            Bar("scrolling the table of 100,000: hitches", float(hitches), 0.0, "frames over 100 ms", at_least=False),
            f"{len(times)} frames of the screen, the longest {max(times):.0f} ms",
        ),
        Found(
            Bar("STOP, while the table of 100,000 is sorted", middle(latencies), STOP, "ms", at_least=False),
            f"{min(latencies):.0f} to {max(latencies):.0f}, {stops} times",
        ),
    ]


def dragged(robots: int, moves: int) -> Found:
    """How soon the counts follow a number that is dragged. Moves that change no count are not counted."""
    with opened(robots) as (_, page):
        page.evaluate(DRAGGED)
        box = page.locator("#backdrop .number").first.bounding_box()
        if box is None:
            raise RuntimeError("no number stands in the prompt")
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        page.mouse.move(x, y)
        page.mouse.down()
        for move in range(2, moves + 2):
            page.mouse.move(x + 4 * move, y)
            sleep(0.12)
        times = sorted(page.evaluate("() => window.__dragged"))
        page.mouse.up()
    late = times[int(0.95 * len(times))]
    return Found(
        Bar(f"a number that is dragged, {robots:,} robots", middle(times), DRAG, "ms", at_least=False),
        f"{len(times)} counts, 95 of 100 within {late:.0f} ms",
    )


def names(seconds: float) -> Found:
    """What names cost while 1,000 robots move, and the map is zoomed in and out."""
    with opened(1_000) as (_, page):
        page.evaluate(NAMED)
        for key in "+++---":
            page.keyboard.press(key)
            sleep(seconds / 6.0)
        times = sorted(page.evaluate("() => window.__names"))
    return Found(
        Bar("names of 1,000 robots", middle(times), NAMES, "ms a frame", at_least=False),
        f"{len(times)} frames, 95 of 100 within {times[int(0.95 * len(times))]:.2f} ms",
    )


def flying(count: int, frames: int) -> Found:
    """How often the view in three dimensions shows so many copters anew beside the map, and what that takes."""
    with TemporaryDirectory() as folder, replayed(Path(folder), count) as page:
        work = worked(page)
        begun, drawing = work(), processor_of("gpu-process")
        page.evaluate("window.__times.length = 0")
        page.wait_for_function(AGAIN, arg=frames)
        costs = [1000.0 * (now - before) for now, before in ((work(), begun), (processor_of("gpu-process"), drawing))]
        times = page.evaluate("window.__times")
        pixels = page.evaluate("window.__pixels")
    gaps = [after - before for before, after in pairwise(times)]
    detail = ", ".join(
        f"{number(cost / len(gaps))} ms of the processor {what}"
        for cost, what in zip(costs, ("for the page", "for drawing"), strict=True)
    )
    bar = Bar(f"{count:,} copters in three dimensions", 1000.0 / middle(gaps), FLYING[count], "frames/s")
    return Found(bar, f"{detail}, a frame; at last {pixels}")


@contextmanager
def replayed(folder: Path, count: int) -> Iterator[Page]:
    """A page that replays so many copters, forty new pictures a second, with the view open and at its size."""
    (folder / "scenario.toml").write_text(COPTERS.format(count=count, side=round((EACH * count) ** 0.5)))
    (folder / "fly.sleep").write_text(FLY)
    file = folder / "run.mcap"
    record = ("run", folder, "--quiet", "--record", file, "--record-pictures", "0.1s")
    subprocess.run([sys.executable, "-m", "sleepcast", *record], check=True, stdout=subprocess.DEVNULL)
    with Program("replay", file, "--speed", "4") as program, visited(program.address, TIMED) as page:
        page.locator("#space").click()
        page.evaluate(f"() => Object.assign(document.querySelector('.space').style, {ROOM})")
        page.wait_for_function("() => document.getElementById('space-over').width === 1280")
        page.wait_for_function(AGAIN, arg=10)
        yield page


def processor_of(kind: str) -> float:
    """Seconds of the processor that processes of Chromium of this kind have used, of those that this one has begun."""
    parents, used, kinds = {}, {}, {}
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):  # it has ended meanwhile
            fields = (process / "stat").read_text().rpartition(")")[2].split()
            parents[process.name], used[process.name] = fields[1], int(fields[11]) + int(fields[12])
            kinds[process.name] = f"--type={kind}" in (process / "cmdline").read_text()

    def is_ours(process: str | None) -> bool:
        return process == str(os.getpid()) or (process is not None and is_ours(parents.get(process)))

    return sum(used[each] for each, it in kinds.items() if it and is_ours(each)) / os.sysconf("SC_CLK_TCK")


def long_run(hours: float) -> list[Found]:
    """What memory grows in so many simulated hours, as fast as they pass, with the plots open and a command an hour."""
    first: tuple[float, float] | None = None
    with opened(200, "--speed", "10000") as (program, page):
        show(page, "plots")
        quarter, told = hours / 4.0, 0
        while (now := hour(page)) < hours:
            if first is None and now >= quarter:
                first = memory(program, page)
            if int(now) > told:
                told = int(now)
                page.locator("#text").fill(f"(WHEN (> fuel {told}%) (JOIN g{told}))")
                page.keyboard.press("Enter")
            sleep(0.2)
        last = memory(program, page)
        drawn = int(page.evaluate("window.__page.drawn"))
    assert first is not None
    page_grown, gained = 100.0 * (last[0] / first[0] - 1.0), last[1] - first[1]
    name = f"{hours:g} simulated hours: memory of the"
    return [
        Found(
            Bar(f"{name} page", page_grown, GROWTH, "%", at_least=False),
            f"from {first[0]:.1f} to {last[0]:.1f} MB in {drawn:,} frames",
        ),
        Found(
            Bar(f"{name} program", gained, PAST, "MB more", at_least=False),
            f"from {first[1]:.0f} to {last[1]:.0f} MB, the past that it keeps among them",
        ),
    ]


def hour(page: Page) -> float:
    """Simulated hours on the page's clock."""
    parts = [float(part) for part in page.locator("#clock").inner_text().split(":")]
    return parts[0] + parts[1] / 60.0 + parts[2] / 3600.0


def memory(program: Program, page: Page) -> tuple[float, float]:
    """MB in use by the page's script, after what is not needed was let go; and by the program."""
    session = page.context.new_cdp_session(page)
    session.send("HeapProfiler.collectGarbage")
    session.send("Performance.enable")
    metrics = {each["name"]: each["value"] for each in session.send("Performance.getMetrics")["metrics"]}
    session.detach()
    status = Path(f"/proc/{program.process.pid}/status").read_text()
    resident = next(line.split()[1] for line in status.splitlines() if line.startswith("VmRSS"))
    return metrics["JSHeapUsedSize"] / 1e6, float(resident) / 1e3


def measure(*, quick: bool, space: bool) -> Iterator[Found]:
    """Everything, one after the other. space: only the view in three dimensions."""
    for robots in [1_000] if quick else FLYING:
        yield flying(robots, QUICK_FLIGHTS if quick else FLIGHTS)
    if space:
        return
    seconds = QUICK_SECONDS if quick else SECONDS
    for robots in [1_000] if quick else FRAMES:
        yield frames(robots, seconds)
    yield at_rest(seconds)
    yield dragged(1_000, QUICK_MOVES) if quick else dragged(10_000, MOVES)
    if not quick:
        yield names(seconds)
        yield from large_table(seconds, STOPS)
    yield from long_run(0.2 if quick else HOURS)


def shown(found: Sequence[Found]) -> str:
    """The table."""
    rows = []
    for each in found:
        bar = each.bar
        wanted = f"{'>=' if bar.at_least else '<='} {number(bar.wanted)}"
        verdict = "met" if bar.met else "MISSED"
        rows.append([bar.name, number(bar.value or 0.0), bar.unit, wanted, verdict, each.detail])
    return table(["what", "found", "", "wanted", "", "in detail"], rows)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.page", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="few robots, short: to see that it works")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of a table")
    parser.add_argument("--only-space", action="store_true", help="only the view in three dimensions")
    options = parser.parse_args()
    if chromium() is None:
        sys.exit("no Chromium, or playwright is not installed")
    about, found = machine(), []
    for each in measure(quick=options.quick, space=options.only_space):
        print(each.bar.text, file=sys.stderr, flush=True)
        found.append(each)
    if options.json:
        rows = [{**asdict(each), "met": each.bar.met} for each in found]
        print(json.dumps({"machine": about, "rows": rows, "met": all(each.bar.met for each in found)}))
        return
    print(f"{described(about)}\n\n{shown(found)}")


if __name__ == "__main__":
    main()
