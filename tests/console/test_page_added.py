"""A pane of an installed package in a real Chromium, beside one that is broken."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, expect

from console.running import PATIENCE, Program
from packages import install
from small_worlds import write

pytestmark = pytest.mark.browser

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "line_rover"

THEN = """async (patience) => {
  const { page } = await import("/static/main.js");
  while (!(page.world.frame?.time > 2)) await new Promise(requestAnimationFrame);
  page.wire.tell("look", { time: 1 });
  return (await page.wire.ask("line_charge", {}, patience)).rows;
}"""
"""What the pane would ask of a moment of the past."""

expect.set_options(timeout=1000 * PATIENCE)


def test_the_pane_of_a_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, context: BrowserContext) -> None:
    world, folder = tmp_path / "small", tmp_path / "installed"
    world.mkdir()
    write(world)
    points = (EXAMPLE / "pyproject.toml").read_text().partition('."sleepcast.pages"]')[2].partition("\n[")[0]
    install(folder, monkeypatch, "line-rover", f"[sleepcast.pages]{points.replace(chr(34), '')}")
    install(folder, monkeypatch, "lawn-bots", "[sleepcast.pages]\nlawn = lawn:PAGE\n", lawn="1 / 0")
    (folder / "line_page.py").symlink_to(EXAMPLE / "line_page.py")
    (folder / "line_static").symlink_to(EXAMPLE / "line_static")
    complaints: list[str] = []
    with Program("run", world, "--page", "--speed", "5", PYTHONPATH=str(folder)) as program:
        page = context.new_page()
        page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(program.address)
        page.get_by_role("tab", name="Charge").click()
        lines = page.locator(".charge li")
        expect(lines).to_have_count(5)
        expect(lines.first).to_have_text(re.compile(r"\w+: \d+ %"))
        assert len(page.evaluate(THEN, 1000 * PATIENCE)) == 5, (
            "the process that runs the past again knows the question, too"
        )
        assert complaints == []
        program.end()
    assert (
        'page "lawn" of the package lawn-bots cannot be loaded: ZeroDivisionError: division by zero; the page opens'
        in (program.said)
    )
