"""Photograph the page of every scenario: light and dark, on a desk's screen, a phone and a wide screen.

    .venv/bin/python docs/pictures/pages.py FOLDER            # every scenario; some minutes
    .venv/bin/python docs/pictures/pages.py FOLDER bravo maze # some of them

FOLDER gets a picture each, and index.html, which shows them side by side. The first picture is what a newcomer sees;
the second one after the ready-made commands have been sent and have had some seconds to work.
"""

from __future__ import annotations

import sys
from html import escape
from pathlib import Path

from make import opened, running
from playwright.sync_api import Page, ViewportSize

from sleepcast.simulator import scenario_names

DESK: ViewportSize = {"width": 1280, "height": 800}
PHONE: ViewportSize = {"width": 390, "height": 844}
WIDE: ViewportSize = {"width": 2560, "height": 1440}
WORK = 4_000
"""ms on the wall that robots get for each command."""
SETTLED = 300
"""ms after which the page has taken another theme or size."""
ANSWER = 500
"""ms after which the station has said whether it sent a command."""
PATIENCE = 60_000
"""ms for whatever the page has to do."""


def photograph(scenario: str, folder: Path) -> list[Path]:
    """All pictures of one scenario."""
    taken: list[Path] = []

    def snap(page: Page, what: str) -> None:
        path = folder / f"{scenario}-{what}.png"
        page.wait_for_timeout(SETTLED)
        page.screenshot(path=path)
        taken.append(path)

    with running("demo", scenario) as address, opened(address, DESK) as page:
        page.set_default_timeout(PATIENCE)
        page.locator("#legend li").first.wait_for()
        page.wait_for_timeout(500)  # the first command is put into the prompt and previewed
        snap(page, "first-light")
        page.locator("#theme").click()
        snap(page, "first-dark")
        send_all(page)
        snap(page, "later-dark")
        page.locator("#theme").click()
        snap(page, "later-light")
        for size, name in ((PHONE, "phone"), (WIDE, "wide")):
            page.set_viewport_size(size)
            snap(page, f"{name}-light")
            page.locator("#theme").click()
            snap(page, f"{name}-dark")
            page.locator("#theme").click()
    return taken


def send_all(page: Page) -> None:
    """Send the ready-made commands one after the other."""
    ready = page.locator("#ready button")
    for number in range(ready.count()):
        ready.nth(number).click()
        page.locator("#preview.known").wait_for()
        while page.locator("#text").input_value():  # what is doubted is sent by a second click
            if page.locator("#everybody").is_visible():
                page.locator("#everybody-yes").check()
            page.locator("#send:enabled").click()
            page.wait_for_timeout(ANSWER)
        page.wait_for_timeout(WORK)


def sheet(pictures: list[Path]) -> str:
    """A page that shows them side by side."""
    images = "".join(
        f'<figure><img src="{escape(path.name)}"><figcaption>{escape(path.stem)}</figcaption></figure>'
        for path in pictures
    )
    style = "body { display: flex; flex-wrap: wrap; gap: 1em; font: 14px sans-serif } img { width: 480px }"
    return f"<!doctype html><title>Pages</title><style>{style}</style>{images}"


def main() -> None:
    if len(sys.argv) < 2:
        raise SystemExit("say where to: pages.py FOLDER [SCENARIO ...]")
    folder, names = Path(sys.argv[1]), sys.argv[2:] or scenario_names()
    if unknown := sorted(set(names) - set(scenario_names())):
        raise SystemExit(f"no scenario is called {unknown[0]}; there are {', '.join(scenario_names())}")
    folder.mkdir(parents=True, exist_ok=True)
    pictures: list[Path] = []
    for name in names:
        pictures += photograph(name, folder)
        print(f"{name}: {len(pictures)} pictures so far", flush=True)
    (folder / "index.html").write_text(sheet(pictures), encoding="utf-8")


if __name__ == "__main__":
    main()
