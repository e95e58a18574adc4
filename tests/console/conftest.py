"""Fixtures of the console's tests: the real program with a small world, and with bravo."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from console.running import Page, Program, let_run, open_page
from small_worlds import SMALL, write

if TYPE_CHECKING:
    from playwright.sync_api import BrowserContext
    from playwright.sync_api import Page as Window

COMMANDS = """
[[commands]]
title = "Full ones to the crew"
text = "(WHEN (> battery 60%) (JOIN crew))"
"""


def page_of(folder: Path, text: str = SMALL, more: str = "") -> Program:
    """The program with the page of the world that this text makes, with COMMANDS and `more` at its end; in a folder."""
    write(folder, more=COMMANDS + more, text=text)
    return Program("run", folder, "--page")


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    """Twenty rovers on a page."""
    with page_of(tmp_path_factory.mktemp("small")) as started:
        yield started


@pytest.fixture
def program(small: Program) -> Program:
    """Twenty rovers on a page, at five times real time; what they were told before, they know."""
    return let_run(small, 5.0)


@pytest.fixture
def modules(small: Program, context: BrowserContext) -> Iterator[Window]:
    """Where the page's modules can be called, without the page: it takes most of the time of a test that opens it."""
    window, complaints = context.new_page(), list[str]()
    window.on("pageerror", lambda error: complaints.append(str(error)))
    window.goto(f"http://{small.host}/static/icon.svg")
    yield window
    assert not complaints, complaints


@pytest.fixture
def page(program: Program) -> Iterator[Page]:
    """A page of `program` as the test's own WebSocket."""
    with open_page(program) as found:
        yield found


@pytest.fixture
def bravo(tmp_path: Path) -> Iterator[Program]:
    with Program("demo", "bravo", "--seed", "7") as started:
        yield started
