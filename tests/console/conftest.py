"""Fixtures of the console's tests: the real program with a small world, and with bravo in a real Chromium."""

from __future__ import annotations

import asyncio
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, sync_playwright

from console.running import PATIENCE, Page, Program, let_run, open_page
from small_worlds import write

NAMES = "chromium-headless-shell", "chromium", "chromium-browser", "google-chrome"
CHROMIUM = next(filter(None, map(shutil.which, NAMES)), None)
"""The first is the same browser without menus and windows, which nobody sees: it takes a quarter less time."""
QUIET = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"]
QUIET += ["--disable-background-networking", "--disable-component-update", "--disable-sync"]
USUAL = (
    "AimEnabled,AvoidCorsURLLoaderRestartOnRedirect,AvoidUnnecessaryBeforeUnloadCheckSync,DestroyProfileOnBrowserClose,"
    "HttpsFirstBalancedModeAutoEnable,HttpsUpgrades,LensOverlay,MediaRouter,NetworkTimeServiceQuerying,"
    "OptimizationHints,PaintHolding,PreconnectToSearch,ThirdPartyStoragePartitioning"
)
"""What Playwright turns off. Chromium minds the last such list only, so it is part of ours."""
QUIET += [f"--disable-features={USUAL},WebUIOmniboxPopup,WebUIOmniboxAimPopup,WebUIOmniboxFullPopup"]
"""Without the pages of the address bar, which nobody sees: they took more than half a second of the processor for each
window, that is, for each test."""
COMMANDS = """
[[commands]]
title = "Full ones to the crew"
text = "(WHEN (> battery 60%) (JOIN crew))"
"""


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    """Twenty rovers on a page."""
    folder = tmp_path_factory.mktemp("small")
    write(folder, more=COMMANDS)
    with Program("run", folder, "--page") as started:
        yield started


@pytest.fixture
def program(small: Program) -> Program:
    """Twenty rovers on a page, at five times real time; what they were told before, they know."""
    return let_run(small, 5.0)


@pytest.fixture
def page(program: Program) -> Iterator[Page]:
    """A page of `program` as the test's own WebSocket."""
    with open_page(program) as found:
        yield found


@pytest.fixture(scope="session")
def kept_chromium() -> Iterator[tuple[Browser, asyncio.AbstractEventLoop]]:
    """The system's Chromium, one for all test files of this process, and Playwright's event loop. Without one these
    tests are skipped, but never where CI must run them."""
    if CHROMIUM is None:
        if os.environ.get("CI"):
            pytest.fail("CI has no Chromium, so nobody has seen the page: install chromium")
        pytest.skip("there is no Chromium here: install chromium to test the page")
    with sync_playwright() as playwright:
        loop = asyncio.get_running_loop()
        with playwright.chromium.launch(executable_path=CHROMIUM, args=QUIET, timeout=1000 * PATIENCE) as browser:
            asyncio._set_running_loop(None)
            yield browser, loop
            asyncio._set_running_loop(loop)


@pytest.fixture(scope="module")
def chromium(kept_chromium: tuple[Browser, asyncio.AbstractEventLoop]) -> Iterator[Browser]:
    """It counts as running for one module only: Playwright's event loop is in this thread, where no other test could
    start one."""
    browser, loop = kept_chromium
    asyncio._set_running_loop(loop)
    yield browser
    asyncio._set_running_loop(None)


@pytest.fixture
def context(chromium: Browser) -> Iterator[BrowserContext]:
    """A fresh profile on a desk's screen, light."""
    with chromium.new_context(viewport={"width": 1440, "height": 900}, color_scheme="light") as found:
        found.set_default_timeout(1000 * PATIENCE)
        yield found


@pytest.fixture
def bravo(tmp_path: Path) -> Iterator[Program]:
    with Program("demo", "bravo", "--seed", "7") as started:
        yield started
