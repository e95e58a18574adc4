"""`fleet.view()`: map and prompt of a fleet in a real JupyterLab, in a real Chromium; and what a notebook gets."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from socket import socket

import pytest
from playwright.sync_api import BrowserContext, FrameLocator, Page, expect

import sleepcast as sc
from console.running import PATIENCE
from sleepcast.notebook.page import page as page_text

expect.set_options(timeout=1000 * PATIENCE)

BEGIN = """
import sleepcast as sc
fleet = sc.open("bravo", robots=200, seed=7)
fleet.run(2, quiet=True)
fleet.view()
"""
ASK = 'print("members:", len(fleet.groups.get("bravo", ())), "after", fleet.time > 2)'
TELL = 'fleet.send("(WHEN (> ordnance 90%) (JOIN charlie))"); print("sent")'


def free_port() -> int:
    with closing(socket()) as taken:
        taken.bind(("127.0.0.1", 0))
        return int(taken.getsockname()[1])


@contextmanager
def jupyter_lab(folder: Path) -> Iterator[str]:
    """A JupyterLab on this folder that knows nothing of the user; gives its address up to the token."""
    places = {
        "JUPYTER_CONFIG_DIR": "config",
        "JUPYTER_DATA_DIR": "data",
        "JUPYTER_RUNTIME_DIR": "runtime",
        "IPYTHONDIR": "ipython",
        "JUPYTERLAB_SETTINGS_DIR": "settings",
        "JUPYTERLAB_WORKSPACES_DIR": "workspaces",
    }
    own = {name: str(folder / "jupyter" / place) for name, place in places.items()}
    command = [
        *(
            sys.executable,
            "-m",
            "jupyterlab",
            "--no-browser",
            "--ip=127.0.0.1",
            f"--port={free_port()}",
            "--allow-root",
        ),
        *("--ServerApp.port_retries=50", "--IdentityProvider.token=secret", f"--ServerApp.root_dir={folder}"),
        *("--LabApp.news_url=", "--LabApp.check_for_updates_class=jupyterlab.NeverCheckForUpdate"),
        *(
            "--LabApp.extension_manager=readonly",
            "--ServerApp.jpserver_extensions={'jupyter_lsp': False, 'jupyter_server_terminals': False}",
        ),
    ]
    with subprocess.Popen(
        command, env={**os.environ, **own}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        assert process.stdout is not None
        said, deadline = "", time.monotonic() + PATIENCE
        try:
            while not (found := re.search(r"http://127\.0\.0\.1:(\d+)/lab\?token", said)):
                line = process.stdout.readline()
                assert line, said
                said += line
            while not listening(port := int(found[1])):  # it says its address before it listens
                assert time.monotonic() < deadline
                time.sleep(0.05)
            yield f"http://127.0.0.1:{port}"
        finally:
            process.terminate()
            process.stdout.read()


def listening(port: int) -> bool:
    with socket() as asked:
        return asked.connect_ex(("127.0.0.1", port)) == 0


def run_cell(page: Page, number: int) -> None:
    """A notebook forgets a cell that is run before its kernel has come."""
    cell = page.locator(".jp-Notebook .jp-CodeCell").nth(number)
    expect(page.get_by_text(re.compile(r"Python 3.*\| Idle"))).to_be_visible()
    cell.locator(".cm-content").click()
    expect(cell).to_have_class(re.compile("jp-mod-active"))
    page.keyboard.press("Shift+Enter")
    expect(cell.locator(".jp-InputPrompt")).to_have_text(re.compile(r"\[[\d*]+\]"))


@pytest.mark.browser
def test_a_view_and_the_cells_command_the_same_fleet(context: BrowserContext, tmp_path: Path) -> None:
    new = {"cell_type": "code", "execution_count": None, "metadata": {}, "outputs": []}
    cells = [{**new, "id": f"cell-{text[:5].strip()}", "source": text.strip()} for text in (BEGIN, ASK, TELL)]
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
    notebook = {"cells": cells, "metadata": kernel, "nbformat": 4, "nbformat_minor": 5}
    (tmp_path / "try.ipynb").write_text(json.dumps(notebook))
    with jupyter_lab(tmp_path) as address:
        page = context.new_page()
        page.goto(f"{address}/lab/tree/try.ipynb?token=secret", timeout=1000 * PATIENCE)
        expect(page.locator(".jp-Notebook .jp-CodeCell")).to_have_count(3)
        run_cell(page, 0)
        view = page.frame_locator("iframe[title='Map and prompt of the fleet']")
        expect(view.locator("#legend")).to_contain_text("200 scouts")
        expect(view.locator("#clock")).to_have_text("0:00:02")
        drawn(view, 201)  # robots are on the map
        view.locator("#run").click()  # let time pass
        text = view.locator("#text")
        text.fill("(WHEN (> fuel 50%) (JOIN bravo))")
        expect(view.locator("#yes")).to_have_text(re.compile(r"^(8|9|1[0-2])\d$"))  # about half of them
        text.press("Enter")
        row = view.locator("#commands tr").first
        expect(row).to_contain_text("(JOIN bravo)")
        expect(row.locator(".silent")).to_have_text("0")
        matched = row.locator(".matched").inner_text()
        view.locator("#run").click()
        expect(view.locator("#achieved")).to_have_text("paused")
        run_cell(page, 1)
        expect(page.locator(".jp-OutputArea-output", has_text="members:")).to_have_text(
            f"members: {matched} after True\n"
        )
        run_cell(page, 2)  # what a cell sends is seen in the view
        expect(view.locator("#commands tr").first).to_contain_text("charlie")
        page.close()


def drawn(view: FrameLocator, least: int) -> None:
    """Wait until so many pixels of the robots' canvas are not empty: the map is drawn later than the clock."""
    deadline = time.monotonic() + PATIENCE
    while pixels(view) < least:
        assert time.monotonic() < deadline
        time.sleep(0.05)


def pixels(view: FrameLocator) -> int:
    """How many pixels of the robots' canvas are not empty."""
    found: int = view.locator("#robots").evaluate(
        """(canvas) => {
          const copy = Object.assign(document.createElement("canvas"), { width: canvas.width, height: canvas.height });
          const pen = copy.getContext("2d");
          pen.drawImage(canvas, 0, 0);
          const { data } = pen.getImageData(0, 0, copy.width, copy.height);
          let count = 0;
          for (let i = 3; i < data.length; i += 4) count += data[i] > 0;
          return count;
        }"""
    )
    return found


def test_the_page_asks_for_no_file() -> None:
    text = page_text()
    assert "static/" not in re.sub(r"//.*", "", text)
    assert text.count("<script") == text.count("</script") == 2  # the library of the plots, and the page


def test_where_no_browser_is_a_view_is_a_picture() -> None:
    fleet = sc.open("bravo", robots=20, seed=7)
    found = fleet.view()._repr_mimebundle_()
    assert found is not None
    data, _ = found
    assert "<svg" in str(data["text/html"])
    assert str(data["text/plain"]).startswith("view of bravo: 20 robots")


class Listener:
    """What a view tells its page, as the page would read it."""

    def __init__(self) -> None:
        self.rows: list[dict[str, object]] = []

    def tell(self, content: dict[str, object], picture: bytes | None = None) -> None:
        said = json.loads(str(content.get("say", "{}")))
        if said.get("type") == "commands":
            self.rows = said["rows"]


def test_what_is_sent_while_time_stands_still_waits(tmp_path: Path) -> None:
    fleet = sc.open("bravo", robots=20, seed=7).run(1, quiet=True)
    fleet.view()
    desk, page = fleet._desk, Listener()
    assert desk is not None
    desk.view(page).take({"open": True})
    fleet.send("(WHEN (> fuel 50%) (MARK))", wait=0)
    assert [(row["waiting"], row["silent"], row["matched"]) for row in page.rows] == [("paused", 20, 0)]
    fleet.run(2, quiet=True)
    assert [(row["waiting"], row["silent"]) for row in page.rows] == [("", 0)]


def test_too_many_robots_are_refused() -> None:
    with pytest.raises(sc.errors.MisuseError, match="too many for a view in a notebook"):
        sc.open("bravo", robots=50_001, seed=7).view()


def test_without_anywidget_a_sentence_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.startswith(("sleepcast.notebook", "anywidget"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "anywidget", None)
    with pytest.raises(sc.errors.MisuseError, match=r"fleet\.view\(\) needs anywidget; to install it: "):
        sc.open("bravo", robots=2, seed=7).view()
