"""The page of an experiment in a real Chromium, and what its server refuses."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import closing
from http.client import HTTPConnection
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, Page, expect
from websockets.exceptions import InvalidStatus

from console.running import PATIENCE, Program, open_page

expect.set_options(timeout=1000 * PATIENCE)

SWEEP = (
    *("--over", "robots.count=5,10,20", "--over", "radio.loss=0,0.5,0.50", "--seeds", "2", "--seconds", "3s"),
    *("--every", "1s", "--measure", "charge=mean battery", "--measure", "odd=mean (/ 1 0)", "--workers", "1"),
)


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    out = tmp_path_factory.mktemp("sweep") / "rooms"
    with Program("sweep", "crowd", *SWEEP, "--page", "--out", out) as started:
        yield started


def status(program: Program, path: str, host: str = "") -> int:
    with closing(HTTPConnection(program.host, timeout=PATIENCE)) as asked:
        asked.request("GET", path, headers={"Host": host or program.host})
        return asked.getresponse().status


class TestServer:
    def test_nobody_comes_in_without_the_token(self, sweep: Program) -> None:
        assert status(sweep, f"/?token={sweep.token}") == 200
        assert status(sweep, "/") == 200, "what tells a browser that was here before to show the token again"
        for path in ("/?token=x", "/run?number=0", "/run?token=x&number=0"):
            assert status(sweep, path) == 403, path
        for path in (f"/?token={sweep.token}", f"/run?token={sweep.token}&number=0"):
            assert status(sweep, path, "evil.example") == 403, "DNS rebinding"

    def test_another_site_s_page_cannot_connect(self, sweep: Program) -> None:
        with pytest.raises(InvalidStatus), open_page(sweep, origin="http://evil.example"):
            pass

    @pytest.mark.parametrize("number", ["", "x", "-1", "99999", "9" * 400, "%00"])
    def test_a_run_that_there_is_not_is_not_opened(self, sweep: Program, number: str) -> None:
        assert status(sweep, f"/run?token={sweep.token}&number={number}") == 404

    def test_what_is_no_message_or_cannot_be_drawn_is_refused(self, sweep: Program) -> None:
        with open_page(sweep) as page:
            for fields in ({"x": "nix", "y": "charge"}, {"x": "time", "y": 5}, {"x": "time", "y": "charge", "z": ""}):
                before = len(page.refused)
                page.tell("look", **fields)
                while len(page.refused) == before:
                    page.receive()
            page.tell("look", x="robots.count", y="charge", by="radio.loss")
            drawn = page.wait_for("drawing", lambda found: found["by"] == "radio.loss")
            assert drawn["x"] == "robots.count"


@pytest.fixture
def page(sweep: Program, context: BrowserContext) -> Iterator[Page]:
    complaints: list[str] = []
    page = context.new_page()
    page.on("console", lambda said: complaints.append(said.text) if said.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: complaints.append(request.url) if sweep.host not in request.url else None)
    page.goto(sweep.address)
    yield page
    assert not complaints, complaints


@pytest.mark.browser
class TestPage:
    def test_progress_and_curves_come_to_their_end(self, page: Page) -> None:
        expect(page.locator("#title")).to_have_text("crowd")
        expect(page.locator("#rest")).to_have_text("finished")
        expect(page.locator("#counts")).to_have_text(re.compile(r"12 of 12 runs done, 48 values unknown"))
        expect(page.locator("#notes li")).to_have_text(
            "over radio.loss: 0.5 was given more than once, and is done once."
        )
        expect(page.locator(".mark")).to_have_count(3)
        page.locator("#by").select_option("radio.loss")
        expect(page.locator(".mark")).to_have_count(6)
        expect(page.locator("#legend li")).to_have_text(["radio.loss = 0", "radio.loss = 0.5"])
        page.locator("#x").select_option("time")
        expect(page.locator(".mark")).to_have_count(8)
        page.locator("#y").select_option("odd")
        expect(page.locator(".mark")).to_have_count(0)
        expect(page.locator("#nothing")).to_be_visible()

    def test_a_point_lists_its_runs_and_each_of_them_opens(self, page: Page, sweep: Program) -> None:
        expect(page.locator("#rest")).to_have_text("finished")
        mark = page.locator(".mark[aria-label^='robots.count = 20']")
        mark.press("Enter")
        expect(mark).to_have_attribute("aria-pressed", "true")
        rows = page.locator("#runs tr")
        expect(rows).to_have_count(4)
        row = rows.filter(has_text="radio.loss = 0.5").nth(1)
        expect(row.locator("td").nth(1)).to_have_text("2")
        context = page.context
        with context.expect_page() as opened:
            row.locator("a").click()
        run = opened.value
        expect(run.locator("#legend")).to_contain_text("20 ")
        assert sweep.host not in run.url, "a page of its own"
        first = run.url
        run.close()
        with context.expect_page() as opened:
            row.locator("a").click()
        opened.value.wait_for_url(first)  # it is still open, so it is the same one

    def test_it_is_usable_on_a_narrow_screen_and_in_the_dark(self, page: Page) -> None:
        expect(page.locator(".mark")).to_have_count(3)
        page.set_viewport_size({"width": 400, "height": 800})
        page.locator("#theme").click()
        expect(page.locator("html")).to_have_attribute("data-theme", "dark")
        assert page.evaluate("document.documentElement.scrollWidth") <= 400
        page.locator(".mark").last.click()
        expect(page.locator("#runs tr")).to_have_count(4)


def test_ctrl_c_ends_the_sweep_its_page_and_its_runs(tmp_path: Path) -> None:
    program = Program("sweep", "crowd", *SWEEP, "--page", "--out", tmp_path / "rooms")
    with open_page(program) as page:
        page.until("come", lambda found: found["progress"]["state"] == "finished")
        with closing(HTTPConnection(program.host, timeout=PATIENCE)) as asked:
            asked.request("GET", f"/run?token={program.token}&number=3", headers={"Host": program.host})
            answer = asked.getresponse()
            assert answer.status == 303
            place = answer.headers["Location"]
        host, _, rest = place.removeprefix("http://").partition("/")
        with closing(HTTPConnection(host, timeout=PATIENCE)) as run:
            run.request("GET", f"/{rest}")
            assert run.getresponse().status == 200
        assert program.end() == 0
    assert "12 of 12 runs done" in program.said
    assert "Traceback" not in program.said
    with closing(HTTPConnection(host, timeout=PATIENCE)) as run, pytest.raises(ConnectionRefusedError):
        run.request("GET", f"/{rest}")


def test_a_port_in_use_is_named_before_anything_runs(tmp_path: Path, sweep: Program) -> None:
    from sleepcast.cli import main

    port = sweep.host.rpartition(":")[2]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        assert main(["sweep", "crowd", *SWEEP, "--page", "--port", port, "--no-browser", "--out", "rooms"]) == 1
