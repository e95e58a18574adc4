"""A real Chromium for the tests of all pages. `tests/conftest.py` has these fixtures: had some folders their own, a
process would start a Chromium for each."""

from __future__ import annotations

import asyncio
import os
import shutil
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from console.running import PATIENCE

if TYPE_CHECKING:
    from playwright.sync_api import Browser, BrowserContext

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


@pytest.fixture(scope="session")
def kept_chromium() -> Iterator[tuple[Browser, asyncio.AbstractEventLoop]]:
    """The system's Chromium, one for all test files of this process, and Playwright's event loop. Without one these
    tests are skipped, but never where CI must run them."""
    from playwright.sync_api import sync_playwright  # most tests need none of it

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


SLOW_SCREEN = """
{
  const { send } = WebSocket.prototype;
  WebSocket.prototype.send = function (data) {
    const later = () => this.readyState === WebSocket.OPEN && send.call(this, data);
    if (String(data).startsWith('{"type":"drawn"')) setTimeout(later, 80);
    else send.call(this, data);
  };
}
"""
"""A page that has drawn a picture says so 80 ms later, as one of a slow computer does, and only then gets the next. Ten
pictures a second show all that tests look at, and take half as much of the processor as thirty."""


@pytest.fixture
def context(chromium: Browser) -> Iterator[BrowserContext]:
    """A fresh profile on a desk's small screen, light: a large one has the same layout, and takes longer to draw."""
    with chromium.new_context(viewport={"width": 1280, "height": 720}, color_scheme="light") as found:
        found.set_default_timeout(1000 * PATIENCE)
        found.add_init_script(SLOW_SCREEN)
        yield found
