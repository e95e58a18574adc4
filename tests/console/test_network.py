"""The page of robots on the air: robots in another process, the page's end of the WebSocket, and a real Chromium."""

from __future__ import annotations

import base64
import re
import struct
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import BrowserContext, expect

from channel.test_udp import free_port
from cli.calling import called
from cli.test_notices import attacked
from cli.test_swarm import swarm
from console.running import PATIENCE, Page, Program, let_run, number, open_page
from console.test_page import until
from processes import live_in

expect.set_options(timeout=1000 * PATIENCE)

TEACHING = """(DEFUN late (n) (> id n))
(RULE keep (WHEN (late 20) (SETQ marked 1)))
"""


@pytest.fixture(scope="module")
def channel(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A channel with twelve robots on it."""
    home = tmp_path_factory.mktemp("home")
    with pytest.MonkeyPatch.context() as patch:
        live_in(home, patch)
        rules = home / "begin.sleep"
        rules.write_text(TEACHING)
        uri = f"udp://239.255.83.78:{free_port()}?interface=lo"
        with swarm(12, uri, "--rules", str(rules)):
            yield uri


@pytest.fixture(scope="module")
def desk(channel: str) -> Iterator[Program]:
    with Program("console", "--channel", channel, "--every", "0.3") as started:
        yield started
        assert started.end() == 130


@pytest.fixture
def on_air(desk: Program) -> Program:
    return let_run(desk)


@pytest.fixture
def air(on_air: Program) -> Iterator[Page]:
    """A page that knows all twelve robots, and perhaps one that another test has added."""
    with open_page(on_air) as found:
        found.until("hello", lambda hello: hello["count"] >= 12)
        yield found


def positions(air: Page) -> list[tuple[float, float, float]]:
    """x, y and heading of every robot in the next frame."""
    if air.frames:  # one may have come while the test waited for something else
        air.tell("drawn", number=number(air.frames[-1]))
    frame = air.frame()
    count = struct.unpack_from("<I", frame, 4)[0]
    found = struct.unpack_from(f"<{3 * count}f", frame, 32)
    return list(zip(found[::3], found[1::3], found[2::3], strict=True))


def all_on_the_map(poses: list[tuple[float, float, float]], area: tuple[float, float, float, float]) -> bool:
    """Whether all are known and within the area."""
    left, low, right, high = area
    return bool(poses) and all(
        left <= x <= right and low <= y <= high and heading == heading for x, y, heading in poses
    )


def test_robots_are_where_they_say_they_are(air: Page) -> None:
    hello = air.news["hello"]
    assert sorted(hello["scene"]["names"], key=lambda name: int(name[1:])) == [f"r{i}" for i in range(1, 13)]
    assert hello["air"]
    end = time.monotonic() + PATIENCE
    while not all_on_the_map(now := positions(air), air.news["hello"]["scene"]["area"]):
        assert time.monotonic() < end, "the map grows until all robots are on it"
    while all(a == b for a, b in zip(now, positions(air), strict=True)):
        assert time.monotonic() < end, "they drive, and it is to be seen"


def test_the_table_and_the_plots_show_telemetry(air: Page) -> None:
    how = {"sort": 1, "descending": True, "where": "(< id 9)", "count": 20, "again": True}
    rows = air.ask_until(lambda found: len(found["rows"]) == 8, "rows", columns=["x", "id"], **how)["rows"]
    assert [cells[1] for _, _, cells in rows] == [str(number) for number in range(8, 0, -1)]
    assert all(cells[0] not in ("", "unknown") for _, _, cells in rows)
    plot = air.ask("plot", kind="time", x="id", what="max")["number"]
    air.ask_until(lambda found: found["columns"][1][-1:] == [12.0], "plotted", number=plot)
    air.ask("unplot", number=plot)


def test_robots_that_stand_because_of_their_store_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    live_in(tmp_path, monkeypatch)
    uri, store = f"udp://239.255.83.78:{free_port()}?interface=lo", tmp_path / "two.store"
    store.write_bytes(b"")
    with (
        swarm(2, uri, "--store", str(store)),
        Program("console", "--channel", uri, "--every", "0.3") as started,
        open_page(started) as page,
    ):
        page.until("safety", lambda news: "Stopped until RELEASE: r1, r2 (its store was empty)." in news["sentence"])
        assert page.news["safety"]["latched"]
        assert called("release", "--channel", uri).status == 0
        page.until("safety", lambda news: "its store" not in news["sentence"])


def test_forgeries_are_told_while_somebody_sends_them(air: Page, channel: str) -> None:
    with attacked(channel) as key:
        air.until("safety", lambda news: f"forged messages a second under key {key} (desk)." in news["noticed"])
    air.until("safety", lambda news: not news["noticed"])


def test_what_is_typed_is_foreseen_counted_sent_and_explained(air: Page, channel: str) -> None:
    text = "(WHEN (AND (late 1) (< id 4)) (JOIN bravo))"
    found = air.ask_until(lambda found: not found["unknown"], "preview", text=text)
    assert (found["yes"], found["no"], found["findings"]) == (2, 10, [])
    assert air.ask("understand", text="r7 joins bravo")["text"] == "(WHEN (= id 7) (JOIN bravo))"
    assert air.ask("phrase", text="(WHEN (IN bravo) (MARK))")["sentence"] == "members of bravo mark themselves"
    sent = air.ask("send", text=text)["command"]

    def answered(news: dict[str, Any]) -> bool:
        return any(row["id"] == sent and row["silent"] == 0 for row in news["rows"])

    row = air.until("commands", answered)["rows"][-1]
    assert (row["id"], row["matched"], row["not_matched"], row["predicted"]) == (sent, 2, 10, 2)
    assert 0.0 <= row["at"] < 600.0
    names = air.news["hello"]["scene"]["names"]
    why = asked_why(air, names.index("r7"), sent)["why"]
    assert (why["matched"], why["reason"]) == (False, "id = 7, needed < 4")
    lost = asked_why(air, names.index("r7"), "desk-1.1")
    assert (lost["type"], "remembers no command" in lost["reason"]) == ("refused", True)
    many = air.ask("send", text="(WHEN (> id 0) (JOIN all))")
    assert (many["type"], many["count"]) == ("refused", True)
    assert many["reason"] == "This is for more than 10 robots: 12 may obey. Type their number to send it."
    assert air.ask("send", text="(WHEN (> id 0) (JOIN all))", count=11)["type"] == "refused"
    assert air.ask("send", text="(WHEN (> id 0) (JOIN all))", count=12)["type"] == "sent"
    watched = names.index("r2")
    air.tell("watch", robot=watched)
    robot = air.until("robot", lambda news: news["robot"] == watched and "bravo" in news["groups"] and news["rules"])
    assert [rule["name"] for rule in robot["rules"]] == ["keep"]
    assert robot["rules"][0]["value"] == "not reported"
    assert {"x", "heading", "fuel"} <= {value["name"] for value in robot["values"]}


def asked_why(air: Page, robot: int, command: str) -> dict[str, Any]:
    """What a robot says of a command, on a busy machine when it is asked again."""
    return air.ask_until(
        lambda found: "has not answered" not in found.get("reason", ""), "why", robot=robot, command=command
    )


def counted(air: Page, text: str, which: str, count: int) -> None:
    """Ask who would obey until so many do, do not, or are unknown."""
    air.ask_until(lambda found: found[which] == count, "preview", text=text)


def matched(news: dict[str, Any], text: str) -> list[int]:
    """On how many robots each command with this text matched, the oldest first."""
    return [row["matched"] for row in news["rows"] if row["text"] == text]


def test_predicates_by_hand_work_on_the_air(air: Page) -> None:
    found = air.ask("pick", marks=base64.b64encode(b"\x07\0").decode())
    assert (found["type"], found["count"]) == ("picked", 3)
    assert found["tests"]
    counted(air, f"(WHEN {found['tests'][0]} (MARK))", "yes", 3)
    spread = air.ask("spread", text="(> id 5)", at=6)
    assert (sum(spread["every"]), spread["whole"]) == (12, True)
    assert air.ask("addalert", text="(KNOWN winked)")["type"] == "refused"  # nobody has that name yet
    assert air.ask("addalert", text="marked")["type"] == "alerted"  # before it winks, which is soon over
    sent = air.ask("wink", robot=4)["command"]
    account = air.until("commands", lambda said: any(row["id"] == sent and row["matched"] for row in said["rows"]))
    assert next(row["silent"] for row in account["rows"] if row["id"] == sent) == 0
    name = air.news["hello"]["scene"]["names"][4]
    firing = air.until("alerts", lambda said: bool(said["firings"]))["firings"][-1]
    assert name in firing["robots"]
    air.ask("removealert", alert=firing["alert"])


def test_in_stages_one_a_tenth_and_all(air: Page) -> None:
    good, bad = "(WHEN (> id 0) (JOIN echo))", "(WHEN (> id 0) (PROGN (JOIN foxtrot) (/ 1 (- id id))))"
    counted(air, good, "yes", 12)
    assert air.ask("send", text=good, sort="stages")["count"], "their number has to be typed"
    assert air.ask("send", text=good, sort="stages", count=12)["type"] == "sent"
    done = air.until("operators", lambda news: news["staging"] and not news["active"])
    assert done["staging"] == "In stages: all 3 stages are done, for 12 robots."
    air.until("commands", lambda news: matched(news, good) == [1, 2, 9])
    assert air.ask("send", text=bad, sort="stages", count=12)["type"] == "sent"
    ended = air.until("operators", lambda news: "ended" in news["staging"])
    assert ended["staging"].startswith("In stages: ended with stage 1 (faults: 1, silent: 0); the other robots were")


def test_a_group_obeys_who_holds_its_lease_and_others_are_heard(air: Page, channel: str) -> None:
    assert air.ask("lease", deed="take", group="not a name", seconds=9)["type"] == "refused"
    assert air.ask("lease", deed="take", group="echo", seconds=30)["type"] == "sent"
    held = air.until("operators", lambda news: news["leases"] and news["leases"][0]["agreed"] >= 12)
    assert (held["leases"][0]["group"], held["leases"][0]["refused"], held["role"]) == ("echo", "", "commander")
    assert called("lease", "request", "echo", "--channel", channel).out
    heard = air.until("operators", lambda news: any("asks for echo" in deed["text"] for deed in news["deeds"]))
    assert any(other["at"] is not None for other in heard["others"])
    assert air.ask("lease", deed="give", group="echo")["type"] == "sent"
    air.until("operators", lambda news: not news["leases"])


def test_a_stop_of_anybody_is_seen(air: Page, channel: str) -> None:
    air.tell("stop")
    own = air.until("safety", lambda news: "all 12 robots" in news["sentence"])
    assert own["latched"]
    assert called("release", "--channel", channel).status == 0
    air.until("safety", lambda news: not news["latched"])
    assert called("stop", "--accepted", "--channel", channel).status == 0, "fast craft brake for half a minute"
    other = air.until("safety", lambda news: news["sentence"].endswith("12 of 12 robots heard so far report stopped."))
    assert (other["latched"], other["sentence"].startswith("STOP by ")) == (True, True)
    air.tell("release")
    air.until("safety", lambda news: not news["latched"])


def test_who_comes_later_is_on_the_map_and_a_pause_asks_nobody(air: Page, channel: str) -> None:
    with swarm(1, channel, "--name-prefix", "late"):
        hello = air.until("hello", lambda news: news["count"] == 13)
        assert hello["scene"]["names"][-1] == "late1"
        while (heading := positions(air)[-1][2]) != heading:
            assert air.news["hello"]["count"] == 13
        counted(air, "(WHEN (> fuel 0) (JOIN bravo))", "yes", 13)
    air.tell("pace", running=False)
    air.tell("watch", robot=0)
    air.until("robot", lambda news: any("last telemetry" in word for word in news["state"]))
    counted(air, "(WHEN (> fuel 0) (JOIN bravo))", "unknown", 13)
    air.tell("pace", running=True)


def test_what_the_air_does_not_carry_is_said(air: Page) -> None:
    found = air.ask("sense", robot=0)
    name = air.news["hello"]["scene"]["names"][0]
    assert found["reason"].startswith(f"On the air, {name} reports its variables, not what its sonars")
    assert air.news["hello"]["note"] == ""  # these robots have no COLOUR


@pytest.mark.browser
def test_a_person_sees_and_commands_them(on_air: Program, context: BrowserContext) -> None:
    page = context.new_page()
    complaints: list[str] = []
    page.on("console", lambda said: complaints.append(said.text) if said.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(on_air.address)
    expect(page.locator("#speed")).to_be_hidden()
    page.locator("#text").fill("(WHEN (> id 0) (JOIN delta))")
    expect(page.locator("#yes")).to_have_text("12")
    page.locator("#text").press("Enter")
    expect(page.locator("#meant-text")).to_contain_text("may obey")
    page.locator("#meant-count").fill(re.findall(r"(\d+) may", page.locator("#meant-text").inner_text())[0])
    page.locator("#meant-count").press("Enter")
    expect(page.locator("#legend")).to_contain_text("delta")
    expect(page.locator("#meant")).to_be_hidden()
    page.locator("#map").focus()
    why = page.locator("#pane-why")

    def obeyed() -> bool:
        """Whether the next robot says that it did: on a busy machine one may not answer in time."""
        page.keyboard.press("ArrowRight")
        expect(why).not_to_be_empty()
        return "matched" in why.inner_text()

    until(page, obeyed)
    bids = page.locator("#commands tr", has_text="BEST").first.locator(".held-up")

    def chosen() -> bool:
        """Whether all bid in time, which they may not on a busy machine."""
        page.locator("#text").fill("(BEST 2 (- id) (IN delta) (JOIN golf))")
        expect(page.locator("#preview .yes")).to_have_text(re.compile("^1[23] would bid, 2 at most will obey$"))
        page.locator("#text").press("Enter")
        expect(page.locator("#text")).to_have_value("")
        expect(bids).to_have_text(re.compile(r"^\d+ bids?(; chosen \S+ \(.*)?$"))
        return re.match(r"1[23] bids; chosen \S+ \(-1[23]\), \S+ \(-1[12]\)$", bids.inner_text()) is not None

    until(page, chosen)
    page.keyboard.press("F9")
    expect(page.locator("#stopped-text")).to_contain_text(re.compile("report stopped|are at rest"))
    page.locator("#release").click()
    expect(page.locator("#stopped")).to_be_hidden()
    assert not complaints


@pytest.mark.browser
def test_what_a_person_should_know_is_on_the_page_though_nobody_has_stopped(
    elsewhere: str, context: BrowserContext
) -> None:
    """Names of several robots, wrong clocks and forgeries were told with STOP only, in its banner."""
    with swarm(2, elsewhere), swarm(2, elsewhere), Program("console", "--channel", elsewhere) as program:
        page = context.new_page()
        page.goto(program.address)
        expect(page.locator("#noticed-text")).to_have_text(
            re.compile(r"^2 robots have each of 2 names: r\d, r\d, one at")
        )
        expect(page.locator("#noticed")).to_be_visible()
        expect(page.locator("#stopped")).to_be_hidden()


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Another channel, of somebody who has never heard a robot."""
    live_in(tmp_path, monkeypatch)
    return f"udp://239.255.83.79:{free_port()}?interface=lo"


@pytest.mark.browser
def test_what_an_observer_may_not_do_is_said(elsewhere: str, context: BrowserContext) -> None:
    assert called("keys", "new", "anna", "--role", "observer").status == 0
    with Program("console", "--channel", elsewhere, "--key", "anna") as program:
        page = context.new_page()
        page.goto(program.address)
        expect(page.locator("#legend")).to_contain_text("0 robots")
        page.locator("#stop").click()
        expect(page.locator("#stopped-text")).to_contain_text("no robot has been heard yet")
        page.locator("#release").click()
        expect(page.locator("#refused-text")).to_have_text(
            "anna is an observer, who may only ask and stop: release needs an operator's key"
        )
        expect(page.locator("#stopped")).to_be_visible()
        page.locator("#refused-close").click()
        expect(page.locator("#refused")).to_be_hidden()


@pytest.mark.browser
def test_the_map_grows_with_where_robots_drive(elsewhere: str, context: BrowserContext) -> None:
    with swarm(1, elsewhere), Program("console", "--channel", elsewhere, "--every", "0.3") as program:
        page = context.new_page()
        page.goto(program.address)
        expect(page.locator("#legend")).to_contain_text("1 robot")
        scale = page.locator("#scale-text")
        far = re.compile(r"^\d00 ft$")
        expect(scale).to_have_text(far, timeout=1e3 * PATIENCE)  # it drives on, and nobody touches the map
        page.locator("#zoom-in").click()  # but who has moved it is left alone
        expect(scale).to_have_text(re.compile("ft$"))
