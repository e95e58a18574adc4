"""The program with its page, started as a person starts it, and Chromium as the person's browser."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from playwright.sync_api import Page

PATIENCE = 300.0
"""Seconds until a program that has not said its address is given up."""
QUIET = ("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking")


class Program:
    """`sleepcast` with `arguments`, and any free port, until the end of a `with` block. environment: instead of ours.

    address: of its page. Raises RuntimeError if it ends before it has said that.
    """

    def __init__(self, *arguments: str | Path, environment: Mapping[str, str] | None = None) -> None:
        command = [sys.executable, "-m", "sleepcast", *arguments, "--no-browser", "--port", "0"]
        self.process = subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=environment,
        )
        said: list[str] = []
        watchdog = threading.Timer(PATIENCE, self.process.kill)
        watchdog.start()
        try:
            self.address = self._listen(said)
        finally:
            watchdog.cancel()

    def _listen(self, said: list[str]) -> str:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            said.append(line)
            if found := re.search(r"http://\S+", line):
                return found[0]
        raise RuntimeError(f"the program said no address, only: {''.join(said).strip()}")

    def cpu(self) -> float:
        """Seconds of the processor that it has used. Raises OSError where the system does not tell."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def __enter__(self) -> Program:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.send_signal(signal.SIGINT)
        assert self.process.stdout is not None
        self.process.stdout.read()
        self.process.wait()


def chromium() -> str | None:
    """The browser of this machine, None if there is none or Python cannot drive it."""
    try:
        import playwright.sync_api  # noqa: F401
    except ImportError:
        return None
    return shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@contextmanager
def opened(address: str, width: int = 1440, height: int = 900) -> Iterator[Page]:
    """The page at `address`, alive, in a Chromium without a window."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium(), args=QUIET)
        page = browser.new_page(viewport={"width": width, "height": height}, color_scheme="light")
        page.goto(address)
        page.locator("#ready button").first.wait_for()
        yield page
        browser.close()


def send_first(page: Page) -> None:
    """Send the first of the ready-made commands to everybody, as a person does."""
    page.locator("#ready button").first.click()
    page.wait_for_function("""() => document.getElementById("yes").textContent !== "–" """)
    if page.locator("#everybody").is_visible():
        page.locator("#everybody-yes").check()
    page.locator("#text").press("Enter")
    page.locator("#commands tr").first.wait_for()
