"""A thousand Scouts in real time with their page open in Chromium, and recorded: what share of a core that takes.

The processor's time is that of the program: the loop, the server and the thread that saves. The browser's own is the
browser's.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from typing import TYPE_CHECKING

from benchmarks.programs import Program, chromium, opened, send_first

if TYPE_CHECKING:
    from playwright.sync_api import Page

ROBOTS = 1_000
SETTLE = 6.0
"""Seconds after the command went out until measuring begins: answers and native code lie behind then."""


@dataclass(frozen=True)
class Share:
    """cores: of the processor, used in a second; speed: simulated seconds in one; written: bytes in one."""

    cores: float
    speed: float
    written: float


def measure(robots: int, seconds: float) -> Share | str:
    """Measure for so many seconds; or why that is not possible here."""
    if chromium() is None:
        return "no Chromium, or playwright is not installed"
    with TemporaryDirectory() as folder:
        file = Path(folder, "crowd.mcap")
        options = ("--robots", str(robots), "--speed", "1", "--seed", "7", "--record", file)
        with Program("demo", "crowd", *options) as program, opened(program.address) as page:
            send_first(page)
            sleep(SETTLE)

            def look() -> tuple[float, float, float, int]:
                return _next_second(page), monotonic(), program.cpu(), file.stat().st_size

            before = look()
            sleep(seconds)
            after = look()
    simulated, wall, cpu, written = (b - a for a, b in zip(before, after, strict=True))
    return Share(cpu / wall, simulated / wall, written / wall)


def _next_second(page: Page) -> float:
    """Simulated seconds, at the moment when the page's clock goes on to them."""
    page.wait_for_function(
        """shown => document.getElementById("clock").textContent !== shown""", arg=page.locator("#clock").inner_text()
    )
    total = 0.0
    for part in page.locator("#clock").inner_text().split(":"):
        total = 60.0 * total + float(part)
    return total
