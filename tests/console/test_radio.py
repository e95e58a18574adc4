"""The Radio pane: what is counted of the radio of a simulated swarm, and who is refused."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from playwright.sync_api import BrowserContext, expect

from console.asking import put
from console.running import PATIENCE, Program, open_page
from console.test_backend import Stand, stand
from sleepcast.channel import Kind, Message
from sleepcast.channel.envelope import encoded_size
from sleepcast.channel.message_batch import MessageBatch
from sleepcast.console.feature import NO_ROBOTS, NOT_HERE_AT_ALL
from sleepcast.console.features.radio import FATES, KINDS, GetRadio, RadioSums
from sleepcast.console.features.send import Send
from sleepcast.core.errors import MisuseError
from small_worlds import SMALL, write

__all__ = ["stand"]

SOURCE = Path(__file__).parents[2] / "src"
SUFFIXES = {".py", ".js", ".html", ".css"}


class Ear:
    """A witness that measures every single message."""

    def __init__(self) -> None:
        self.sizes: dict[Kind, list[int]] = {}

    def ticking(self) -> None: ...

    def ticked(self) -> None: ...

    def posted(self, message: Message) -> None:
        self.sizes.setdefault(message.kind, []).append(encoded_size(message, ""))

    def said(self, batch: MessageBatch) -> None:
        for message in batch.messages():
            self.posted(message)


def sums(found: RadioSums) -> list[dict[str, float]]:
    """The latest sums of each chart, by the names of its lines."""
    return [
        {name: found.columns[1 + chart.first + at][-1] or 0.0 for at, name in enumerate(chart.lines)}
        for chart in found.charts
    ]


def test_copies_messages_and_bytes_are_those_that_went_out(stand: Stand) -> None:
    ear = Ear()
    stand.swarm.witnesses.append(ear)
    put(stand.desk, Send, 1, '(RULE talk (EVERY 1s (REPORT "at" x y)))', True)
    put(stand.desk, Send, 2, "battery", False, "ask")
    stand.desk.station.send("(BEST 1 battery TRUE (MARK))")
    stand.run(1.0)
    stand.desk.stop()
    stand.run(5.0)
    found = put(stand.desk, GetRadio, 3)
    copies, messages, sizes = sums(found)
    assert copies == {name: getattr(stand.swarm.radio.counts, counted) for name, counted in FATES.items()}
    assert copies["delivered"] > 0
    for name, kinds in KINDS.items():
        heard = [size for kind in kinds for size in ear.sizes.get(kind, [])]
        assert messages[name] == len(heard) > 0, name
        assert sizes[name] == pytest.approx(sum(heard), rel=0.02), name


def test_only_what_is_new_is_told(stand: Stand) -> None:
    before = put(stand.desk, GetRadio, 1)
    stand.run(3.0)
    after = put(stand.desk, GetRadio, 2, before.columns[0][-1], before.thinned)
    assert (before.added, after.added) == (False, True)
    assert after.columns[0][0] > before.columns[0][-1]
    whole = put(stand.desk, GetRadio, 3)
    assert whole.columns == [[*old, *new] for old, new in zip(before.columns, after.columns, strict=True)]


@pytest.mark.parametrize(
    ("recorded", "lacks", "sentence"),
    [
        (False, NOT_HERE_AT_ALL, "On the air, the desk hears only what reaches it"),
        (True, NO_ROBOTS, "A recording does not tell message by message what went over the radio."),
    ],
)
def test_who_cannot_tell_is_refused(recorded: bool, lacks: str, sentence: str) -> None:
    source: Any = SimpleNamespace(recorded=recorded, lacks=lacks)
    with pytest.raises(MisuseError, match=sentence):
        put(source, GetRadio, 1)


def test_a_pane_is_at_most_four_files() -> None:
    """Everything that knows of this pane: so many files a new one touches."""
    names = re.compile(r"RadioPane|GetRadio|RadioMeter|features\.radio|drawer-radio|radio\.js")
    paths = (path for path in SOURCE.rglob("*") if path.suffix in SUFFIXES)
    found = [path.name for path in paths if names.search(path.read_text(encoding="utf-8"))]
    assert sorted(found) == ["radio.js", "radio.py", "swarmpanes.js"]


@pytest.mark.browser
def test_the_pane_draws_what_the_desk_counts(context: BrowserContext, tmp_path: Path) -> None:
    write(tmp_path, text=SMALL)
    with Program("run", tmp_path, "--page", "--speed", "20") as program:
        page = context.new_page()
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(program.address)
        with open_page(program) as other:
            other.ask("send", text='(RULE talk (EVERY 1s (REPORT "at" x y)))', everybody=True, confirmed=True)
        page.locator("#drawer-radio").click()
        cards = page.locator(".chart-pane .plot")
        expect(cards).to_have_count(3, timeout=1000 * PATIENCE)
        expect(cards.nth(1)).to_contain_text(re.compile(r"commands 1 "))
        expect(cards.nth(1)).to_contain_text(re.compile(r"reports [1-9]"))
        expect(cards.nth(1).locator(".plot-told")).to_contain_text("reports")
        expect(cards.locator("canvas")).to_have_count(3)
        assert errors == []
