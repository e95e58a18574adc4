"""As whom to send: the page of a run that names operators, in a real Chromium."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from console.running import PATIENCE, Program
from console.test_page import opened, send

pytestmark = pytest.mark.browser

expect.set_options(timeout=1000 * PATIENCE)


@pytest.fixture
def desks(context: BrowserContext) -> Iterator[Page]:
    with Program("demo", "two-desks") as program:
        yield from opened(program, context)


def test_commands_and_stop_go_out_as_the_chosen_operator(desks: Page) -> None:
    by, rows = desks.locator("#by"), desks.locator("#commands tr")
    expect(by.locator("option")).to_have_text(["chief, commander", "anna, operator", "bert, operator"])
    by.select_option("bert")
    desks.locator("#text").fill("(WHEN (> id 0) (RULE shy (WHEN (< x 10m) (ST))))")
    send(desks)
    refused = rows.filter(has_text="RULE shy")
    expect(refused.locator(".by")).to_have_text("bert")
    expect(refused).to_contain_text("12")  # only a commander may change rules: all twelve refuse
    desks.locator("#stop").click()
    expect(rows.filter(has_text="STOP").locator(".by")).to_have_text("bert")
    expect(desks.locator(".glance")).to_contain_text("12 stopped or held")
    by.select_option("anna")
    desks.locator("#release").click()
    expect(rows.filter(has_text="RELEASE").locator(".by")).to_have_text("anna")
    expect(desks.locator(".glance")).to_contain_text("0 stopped or held")  # whoever stopped them
