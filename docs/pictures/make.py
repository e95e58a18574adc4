"""Make the pictures of the documentation: real runs, and the real page in Chromium.

    .venv/bin/python docs/pictures/make.py            # after python3 go.py test has set up the tools
    .venv/bin/python docs/pictures/make.py maze       # one of them

bravo: the program is started as a newcomer starts it, a browser types what a newcomer types, and what the page shows is
photographed as fast as the machine can; each photograph is shown for as long as it was true.

maze: 100,000 Scouts run the mission of the scenario `maze` for some simulated minutes, recorded and without a page;
then the recording is shown on the page, and its last moment is photographed.

show: the figures on its page, and what the view in three dimensions shows of its letters and its sphere.

nomads: two Scouts wander through a room, driven by programs, and what the page of their server shows is photographed.

first-study: the figure of docs/howto/first-study.md, by its files and commands.

stop: sixty runs of the scenario `stop`, without a page, and histograms of where its robots came to rest.

sockets: the benchmark of one broadcast beside many connections, and its figure.

gallery: a moment of each scenario, for docs/gallery.md; or of some, such as gallery:vicsek gallery:search.

The name of another scenario, such as search: the figures on its page, by the commands that stand there.
"""

from __future__ import annotations

import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import pairwise, product
from pathlib import Path
from tempfile import TemporaryDirectory

import apng
import nomads
import stops
from playwright.sync_api import Page, ViewportSize, sync_playwright

import sleepcast as sc
from sleepcast.api.picture import drawing
from sleepcast.simulator import find_scenario, scenario_names

FOLDER = Path(__file__).resolve().parent
SIZE: ViewportSize = {"width": 1040, "height": 650}
SEED = "7"
FRAME = 0.35
"""Seconds between two photographs: smooth enough for scouts, and few enough for a small file."""
KEYS = 8
"""Characters typed from one photograph to the next."""
LAST = 2.5
"""Seconds for which the last photograph stays, to be read."""
SENTENCE = "(WHEN (AND (< (DIST x y vessel_x vessel_y) 5mi) (> fuel 50%) (> ordnance 70%)) (JOIN bravo))"


MANY, SECONDS = 100_000, 90
"""Robots in the maze, and simulated seconds until the photograph."""
DESK: ViewportSize = {"width": 1240, "height": 800}
"""Of the page with the Nomads."""
WIDE: ViewportSize = {"width": 1400, "height": 1010}
"""Of the page with the maze: the map is then nearly a square."""
ADDRESS = re.compile(r"http://\S+")
WANDERING = 14.0
"""Seconds on the wall until the photograph of the Nomads."""
SKY: ViewportSize = {"width": 1400, "height": 620}
"""Of the page with the show: its view in three dimensions is then about a square."""
OPENING = 3.0
"""Seconds until the view in three dimensions is there."""
FINE = 2
"""Pixels of the photograph of the maze for each of the page's: points are half as wide then."""


@contextmanager
def started(*arguments: str | Path) -> Iterator[str]:
    """What the program says until it has said the address of its page, while it runs."""
    command = [sys.executable, "-m", "sleepcast", *arguments, "--no-browser", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        assert process.stdout is not None
        said = ""
        while not ADDRESS.search(said):
            line = process.stdout.readline()
            if not line:
                raise SystemExit(f"the program ended before it said its address: {said}")
            said += line
        try:
            yield said
        finally:
            process.send_signal(signal.SIGINT)


@contextmanager
def running(*arguments: str | Path) -> Iterator[str]:
    """The address of the page, while the program runs."""
    with started(*arguments) as said:
        yield address_in(said)


def address_in(said: str) -> str:
    found = ADDRESS.search(said)
    assert found is not None
    return found[0]


class Camera:
    """Photographs of a page, each with the moment at which it was taken."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._taken: list[tuple[float, bytes]] = []

    def film(self, seconds: float) -> None:
        """Photograph the page for so long, at least once."""
        end = time.monotonic() + seconds
        self.snap()
        while time.monotonic() < end:
            self.snap()

    def snap(self) -> None:
        """Take one photograph, not sooner than `FRAME` after the last one."""
        if self._taken:
            time.sleep(max(0.0, self._taken[-1][0] + FRAME - time.monotonic()))
        self._taken.append((time.monotonic(), self._page.screenshot()))

    def develop(self, path: Path) -> None:
        """Write the moving picture."""
        times = [taken for taken, _ in self._taken]
        delays = [after - before for before, after in pairwise(times)] + [LAST]
        apng.write(path, [apng.decoded(picture) for _, picture in self._taken], delays)
        print(f"{path.name}: {len(times)} frames, {sum(delays):.1f} s, {path.stat().st_size / 1e6:.2f} MB")


def play(page: Page, camera: Camera) -> None:
    """What a newcomer does: type the sentence, send it, send Bravo to the vessel, ask a scout why."""
    prompt = page.locator("#text")
    prompt.fill("")
    camera.film(0.3)
    for start in range(0, len(SENTENCE), KEYS):
        prompt.press_sequentially(SENTENCE[start : start + KEYS])
        camera.snap()
    camera.film(1.2)
    prompt.press("Enter")
    camera.film(1.2)
    page.locator("#ready button").nth(1).click()
    camera.film(0.7)
    prompt.press("Enter")
    camera.film(3.0)
    page.locator("#commands tr").last.click()
    ask_a_bystander(page)
    camera.film(0.7)


def ask_a_bystander(page: Page) -> None:
    """Click scouts in the middle of the map until one says that it lacked fuel or ordnance."""
    area = page.locator("#map").bounding_box()
    assert area is not None
    for across, up in product((0.55, 0.6, 0.5, 0.65, 0.45), (0.5, 0.45, 0.4, 0.6, 0.65)):
        page.locator("#map").click(position={"x": area["width"] * across, "y": area["height"] * up})
        page.wait_for_timeout(300)
        if re.search(r"(fuel|ordnance) = [\d.]+ %, needed", page.locator("#pane-why").inner_text()):
            return
    raise SystemExit("no scout in the middle of the map lacked fuel or ordnance; try another seed")


def bravo() -> None:
    with running("demo", "bravo", "--seed", SEED) as address, opened(address, SIZE) as page:
        page.locator("#ready button").first.wait_for()
        camera = Camera(page)
        play(page, camera)
    camera.develop(FOLDER / "bravo.png")
    figures("bravo")


def maze() -> None:
    with at_its_end("maze", SECONDS, WIDE, "--robots", str(MANY)) as page:
        page.locator("#legend", has_text="home").wait_for()  # the groups of that moment are news that come later
        page.locator("#scrub").blur()  # its ring would reach into the picture
        taken = page.locator(".world").screenshot()
    apng.write(FOLDER / "maze.png", [apng.decoded(taken)], [LAST])
    print(f"maze.png: {(FOLDER / 'maze.png').stat().st_size / 1e6:.2f} MB")


@contextmanager
def at_its_end(scenario: str, seconds: int, size: ViewportSize, *options: str) -> Iterator[Page]:
    """The page of a recording, at its last moment: so many simulated seconds of a scenario's mission, run without a
    page."""
    with TemporaryDirectory() as folder:
        file = Path(folder, f"{scenario}.mcap")
        options = (*options, "--seconds", str(seconds), "--record-pictures", str(seconds))
        subprocess.run([sys.executable, "-m", "sleepcast", "run", scenario, *options, "--record", file], check=True)
        with running("replay", file) as address, opened(address, size, FINE) as page:
            page.locator("#scrub").press("End")
            page.wait_for_function(f"""() => {{
              const [hours, minutes, seconds] = document.getElementById("clock").textContent.split(":").map(Number);
              return 3600 * hours + 60 * minutes + seconds >= {seconds};
            }}""")
            yield page


def show() -> None:
    figures("show")
    for name, seconds in (("letters", 60), ("sphere", 110)):
        with at_its_end("show", seconds, SKY) as page:
            page.locator("#layers").click()
            page.locator("#layer-names").uncheck()
            page.locator("#map").press("v")
            page.wait_for_timeout(1000 * OPENING)
            view = page.get_by_role("application", name="View of the robots in three dimensions")
            for key in ("Shift+ArrowDown", "+"):  # from lower down, and closer
                view.press(key)
            taken = view.screenshot()
        picture = SCENARIOS / "show" / f"{name}.png"
        apng.write(picture, [apng.decoded(taken)], [LAST])
        print(f"{picture.name}: {picture.stat().st_size / 1e6:.2f} MB")


@contextmanager
def opened(address: str, size: ViewportSize, fine: float = 1) -> Iterator[Page]:
    """The page at this address, light, in a browser without a window. fine: pixels of its screen for each of a page."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"))
        page = browser.new_page(viewport=size, device_scale_factor=fine, color_scheme="light")
        page.goto(address)
        yield page
        browser.close()


def laboratory() -> None:
    with (
        TemporaryDirectory() as folder,
        started(*nomads.arguments(Path(folder))) as said,
        opened(address_in(said), DESK) as page,
        nomads.wandering(said),
    ):
        page.wait_for_timeout(1000 * WANDERING)
        taken = page.screenshot()
    apng.write(FOLDER / "nomads.png", [apng.decoded(taken)], [LAST])
    print(f"nomads.png: {(FOLDER / 'nomads.png').stat().st_size / 1e6:.2f} MB")


def stop() -> None:
    stops.stop(FOLDER / "stop.svg")


def sockets() -> None:
    command = [sys.executable, "-m", "benchmarks.sockets", "--out", str(FOLDER / "sockets.svg")]
    subprocess.run(command, cwd=FOLDER.parents[1], check=True)


def first_study() -> None:
    """Follow the page: write its files, sweep, plot, and keep the figure."""
    page = (FOLDER.parent / "howto" / "first-study.md").read_text("utf-8")
    with TemporaryDirectory() as folder:
        for name, text in re.findall(r"^```\w+ (\S+)\n(.*?)^```$", page, re.MULTILINE | re.DOTALL):
            Path(folder, name).write_text(text, "utf-8")
        for command in re.findall(r"^\$ (sleepcast (?:sweep \.|plot) .+)$", page, re.MULTILINE):
            subprocess.run([sys.executable, "-m", *shlex.split(command)], cwd=folder, check=True)
        shutil.copy(Path(folder, "apart.svg"), FOLDER / "first-study.svg")


SCENARIOS = FOLDER.parents[1] / "src" / "sleepcast" / "scenarios"


def figures(scenario: str) -> None:
    """Follow the page of a scenario: sweep, plot, and keep the figures."""
    page = SCENARIOS / scenario / "README.md"
    with TemporaryDirectory() as folder:
        for command in re.findall(r"^    (sleepcast (?:sweep|plot) .+)$", page.read_text("utf-8"), re.MULTILINE):
            print(f"{scenario}: {command}", flush=True)
            subprocess.run([sys.executable, "-m", *shlex.split(command)], cwd=folder, check=True)
        for figure in Path(folder).glob("*.svg"):
            shutil.copy(figure, page.parent)


GALLERY = FOLDER / "gallery"
MOMENTS = {
    "barrier": 156.0,
    "bravo": 120.0,
    "couzin-3d": 25.0,
    "election": 20.0,
    "explore": 50.0,
    "follow-the-gap": 30.0,
    "formations": 115.0,
    "leave-room": 15.0,
    "line-sweep": 200.0,
    "mixed": 65.0,
    "opening": 15.0,
    "overwhelm": 44.0,
    "recruit": 50.0,
    "recruit-best": 49.0,
    "rehearsal": 20.0,
    "search": 20.0,
    "search-from-above": 40.0,
    "show": 110.0,
}
"""Simulated seconds until the moment of a scenario that is shown; else half of its run."""
FRAMED = """<style>svg { color: #1c2733; background: #ffffff; font-family: system-ui, sans-serif }
@media (prefers-color-scheme: dark) { svg { color: #dfe6ee; background: #12181f } }</style>"""
"""A picture stands on its own, so that it brings its colours."""


def moment(scenario: str) -> None:
    """Let a scenario run its mission until something is to be seen, and draw it."""
    with sc.open(scenario, mission=True) as fleet:
        fleet.run(MOMENTS.get(scenario, find_scenario(scenario).seconds / 2.0), quiet=True)
        drawn = drawing(fleet.swarm, scenario)
    GALLERY.mkdir(exist_ok=True)
    start = drawn.index(">") + 1
    (GALLERY / f"{scenario}.svg").write_text(f"{drawn[:start]}{FRAMED}{drawn[start:]}\n", "utf-8")


def gallery() -> None:
    for scenario in scenario_names():
        print(f"gallery: {scenario}", flush=True)
        moment(scenario)


PICTURES: dict[str, Callable[[], None]] = {
    **{file.parent.name: partial(figures, file.parent.name) for file in sorted(SCENARIOS.glob("*/experiment.toml"))},
    "bravo": bravo,
    "maze": maze,
    "show": show,
    "nomads": laboratory,
    "stop": stop,
    "sockets": sockets,
    "first-study": first_study,
    "gallery": gallery,
    **{f"gallery:{name}": partial(moment, name) for name in scenario_names()},
}


def main() -> None:
    names = sys.argv[1:] or [name for name in PICTURES if not name.startswith("gallery:")]
    if unknown := [name for name in names if name not in PICTURES]:
        raise SystemExit(f"no picture is called {unknown[0]}; there are {', '.join(PICTURES)}")
    for name in names:
        PICTURES[name]()


if __name__ == "__main__":
    main()
