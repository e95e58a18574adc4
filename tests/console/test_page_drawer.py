"""The table of robots and the plots, in Chromium. As in `test_page`, the browser must have had nothing to complain
about."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from console.conftest import COMMANDS
from console.running import PATIENCE, Program
from console.test_page import opened, until
from small_worlds import write

pytestmark = pytest.mark.browser

expect.set_options(timeout=1000 * PATIENCE)


@pytest.fixture
def rovers(program: Program, context: BrowserContext) -> Iterator[Page]:
    """The small world's page."""
    yield from opened(program, context)


def cells(page: Page, column: int) -> list[str]:
    """What stands in a column of the table, from the top."""
    found: list[str] = page.locator(".table-rows").evaluate(
        """(body, column) => [...body.querySelectorAll(".table-row:not([hidden])")]
            .sort((a, b) => a.dataset.at - b.dataset.at).map((row) => row.children[column].textContent)""",
        column,
    )
    return found


def column(page: Page, name: str) -> int:
    heads: list[str] = page.locator(".table-sort").all_inner_texts()
    return next(index for index, head in enumerate(heads) if head.split() and head.split()[0] == name)


def saved(page: Page, button: str, folder: Path) -> Path:
    """The file that a button gives."""
    with page.expect_download() as download:
        page.locator(button).first.click()
    file = folder / download.value.suggested_filename
    download.value.save_as(file)
    return file


def read(file: Path) -> list[list[str]]:
    return list(csv.reader(file.read_text(encoding="utf-8").splitlines()))


@pytest.fixture
def breeding(tmp_path: Path, context: BrowserContext) -> Iterator[Page]:
    """The same, where rovers come and go."""
    write(tmp_path, ("[robots]\n", "[robots]\nhatch = true\n"), more=COMMANDS)
    with Program("run", tmp_path, "--page") as program:
        yield from opened(program, context)


def test_who_is_gone_is_neither_counted_nor_selected_and_another_in_its_place_has_its_own_name(breeding: Page) -> None:
    page = breeding

    def send(text: str, told: str) -> None:
        page.locator("#text").fill(text)
        page.locator("#text").press("Enter")
        expect(page.locator(".table-told")).to_have_text(told)

    page.locator("#drawer-table").click()
    page.locator(".table-row[data-at='0']").click()
    page.locator(".table-row[data-at='2']").click(modifiers=["Shift"])
    expect(page.locator(".table-told")).to_have_text("20 robots, 3 selected")
    send("(WHEN (= id 1) (DIE))", "19 robots, 2 selected")
    send("(WHEN (= id 9) (HATCH rover 1))", "20 robots, 2 selected")
    until(page, lambda: cells(page, 0)[:2] == ["rover21", "rover2"])
    page.locator("#drawer-table").press("Control+z")
    expect(page.locator(".table-told")).to_have_text("20 robots")
    page.locator("#drawer-table").press("Control+Shift+z")  # rover21, where rover1 was, was never selected
    expect(page.locator(".table-told")).to_have_text("20 robots, 2 selected")
    page.locator("#scrub").press("Home")
    until(page, lambda: cells(page, 0)[:2] == ["rover1", "rover2"])
    page.locator("#scrub").press("F8")
    until(page, lambda: cells(page, 0)[:2] == ["rover21", "rover2"])


def test_robots_are_sorted_filtered_chosen_and_saved(rovers: Page, tmp_path: Path) -> None:
    page = rovers
    page.locator("#drawer-table").click()
    expect(page.locator(".table-told")).to_have_text("20 robots")
    until(page, lambda: cells(page, 0)[:2] == ["rover1", "rover2"])
    battery = column(page, "battery")
    page.locator(".table-sort").nth(battery).click()
    until(page, lambda: (found := levels(page, battery)) == sorted(found) and len(found) > 3)
    page.locator(".table-sort").nth(battery).click()
    until(page, lambda: (found := levels(page, battery)) == sorted(found)[::-1] and len(found) > 3)

    page.locator("#table-filter").fill("(> battery 60%)")
    page.locator("#table-filter").press("Enter")
    expect(page.locator(".table-told")).to_have_text(re.compile(r"^\d+ of 20 robots$"))
    page.locator("#table-add").fill("(* 2 battery)")
    page.locator("#table-add").press("Enter")
    until(page, lambda: "(*" in [head.split()[0] for head in page.locator(".table-sort").all_inner_texts()])

    first = cells(page, 0)[0]
    page.locator(".table-row[data-at='0']").click()
    expect(page.locator("#robot-name")).to_have_text(first)
    page.locator(".table-row[data-at='2']").click(modifiers=["Shift"])
    expect(page.locator("#selection .count")).to_have_text("3 selected")
    file = saved(page, ".table-download", tmp_path)
    lines = read(file)
    assert lines[0][:2] == ["robot", "groups"]
    assert (len(lines), lines[1][0]) == (4, first)


def levels(page: Page, battery: int) -> list[float]:
    return [float(cell.removesuffix(" %")) for cell in cells(page, battery) if cell]


def test_a_wrong_filter_says_what_is_wrong(rovers: Page) -> None:
    rovers.locator("#drawer-table").click()
    rovers.locator("#table-filter").fill("(> batery 60%)")
    rovers.locator("#table-filter").press("Enter")
    expect(rovers.locator(".table-told")).to_contain_text("did you mean battery?")


def test_the_keyboard_reaches_every_row(rovers: Page) -> None:
    rovers.locator("#drawer-table").click()
    until(rovers, lambda: "rover1" in cells(rovers, 0))
    rovers.locator(".table-rows").focus()
    rovers.keyboard.press("End")
    until(rovers, lambda: cells(rovers, 0)[-1] == "rover20")
    rovers.keyboard.press("Enter")
    expect(rovers.locator("#robot-name")).to_have_text("rover20")


def test_plots_are_added_drawn_and_taken_along(rovers: Page, tmp_path: Path) -> None:
    page = rovers
    page.locator("#drawer-plots").click()
    expect(page.locator(".plots-empty")).to_be_visible()
    page.locator("#plots-x").fill("battery")
    page.locator(".plots-add").click()
    expect(page.locator(".plot-name")).to_have_text("range of battery")
    expect(page.locator(".plot-told")).to_have_text(
        re.compile(r"^0:\d\d:\d\d: mean [\d.]+ %, min [\d.]+ %, max [\d.]+ %")
    )
    page.locator(".plots-kind").select_option("scatter")
    page.locator("#plots-x").fill("x")
    page.locator("#plots-y").fill("y")
    page.locator("#plots-where").fill("(> battery 50%)")
    page.locator("#plots-where").press("Enter")
    expect(page.locator(".plot-name")).to_have_text(["range of battery", "y over x, where (> battery 50%)"])
    until(page, lambda: page.locator(".plot canvas").count() == 2)
    until(page, lambda: painted(page) > 0)

    def whole() -> list[list[str]]:
        """What the first plot holds, once there is more than one moment."""
        found = read(saved(page, ".plot >> text=CSV", tmp_path))
        return found if len(found) > 2 else []

    head, *lines = until(page, whole)
    assert head == ["time (s)", "mean battery (%)", "min battery (%)", "max battery (%)"]
    assert all(float(low) <= float(mean) <= float(high) for _, mean, low, high in lines)
    assert saved(page, ".plot >> text=PNG", tmp_path).read_bytes().startswith(b"\x89PNG")
    drawing = saved(page, ".plot >> text=SVG", tmp_path).read_text(encoding="utf-8")
    assert "range of battery" in drawing
    assert drawing.count("<path") > 10

    page.locator(".plots-kind").select_option("histogram")
    page.locator("#plots-x").fill("batery")
    page.locator(".plots-add").click()
    expect(page.locator(".plots-told")).to_contain_text("did you mean battery?")
    for left in (1, 0):
        page.locator(".plot button", has_text="×").first.click()
        expect(page.locator(".plot")).to_have_count(left)
    expect(page.locator(".plots-empty")).to_be_visible()


def painted(page: Page) -> int:
    """Pixels of the first chart that are drawn in the colour of its main line."""
    found: int = page.locator(".plot canvas").first.evaluate(
        """(canvas) => {
          const pen = canvas.getContext("2d", { willReadFrequently: true });
          const { data } = pen.getImageData(0, 0, canvas.width, canvas.height);
          let count = 0;
          for (let i = 3; i < data.length; i += 4) count += data[i] > 0;
          return count;
        }"""
    )
    return found
