"""What packages add to a page: files, pieces of HTML and questions; and what is said of one that is wrong."""

from __future__ import annotations

import asyncio
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from packages import install
from sleepcast.console import registry
from sleepcast.console.feature import HANDLERS, NOT_HERE_AT_ALL
from sleepcast.console.page_parts import STATIC, PagePart, added_parts, whole_page, with_parts
from sleepcast.core.errors import MisuseError
from sleepcast.nomad.panes import features

registry.collect(features)
QUESTION = """
import asyncio
from pathlib import Path
from typing import Protocol
from sleepcast.console.page_parts import Done, PageMessage, PagePart, Serial, answers

PAGE = PagePart(Path(__file__).parent, "lawn.js")

class Mow(PageMessage, tag="lawn_mow"):
    serial: Serial
class Ask(PageMessage, tag="lawn_ask"):
    serial: Serial
class Lawn(Protocol):
    grass: float

@answers()
def mow(source: Lawn, asked: Mow) -> Done:
    return Done(asked.serial, str(1.0 / source.grass))

@answers()
async def ask(source: Lawn, asked: Ask) -> Done:
    await asyncio.sleep(0.0)
    return Done(asked.serial, str(1.0 / source.grass))
"""
POINTS = "[sleepcast.pages]\nlawn = lawn_page:PAGE\n"


class Meadow:
    """What a page shows. grass: a number."""

    recorded, lacks = False, NOT_HERE_AT_ALL

    def __init__(self, grass: float) -> None:
        self.grass = grass


@pytest.fixture(autouse=True)
def questions() -> Iterator[None]:
    """Those of this test are gone after it."""
    before = dict(HANDLERS)
    yield
    HANDLERS.clear()
    HANDLERS.update(before)
    sys.modules.pop("lawn_page", None)


def added(
    folder: Path, monkeypatch: pytest.MonkeyPatch, text: str, points: str = POINTS
) -> tuple[list[str], list[str]]:
    """The names of parts that a page has with this package, and what was said."""
    install(folder, monkeypatch, "lawn-bots", points, lawn_page=text)
    (folder / "lawn.js").write_text("")
    said: list[str] = []
    return [name for name, _ in added_parts(said.append)], said


def test_a_package_adds_questions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert added(tmp_path, monkeypatch, QUESTION) == (["lawn"], [])
    asked = registry.decode('{"type": "lawn_mow", "serial": 3}')
    assert registry.answer(asked, Meadow(4.0)).note == "0.25"  # type: ignore[union-attr]
    with pytest.raises(MisuseError, match="not supported for these robots"):
        registry.answer(asked, Meadow(None))  # type: ignore[arg-type]


async def wait_for(reply: object) -> object:
    return await reply  # type: ignore[misc]


@pytest.mark.parametrize("tag", ["lawn_mow", "lawn_ask"])
@pytest.mark.parametrize(
    ("answer", "why"),
    [
        ("Done(asked.serial, str(1.0 / source.grass))", "ZeroDivisionError: float division by zero"),
        ("exit(3)", "SystemExit: 3"),
        ("7", "TypeError: an answer is a DeskMessage, no int"),
        ("Done(asked.serial, object())", "TypeError: Encoding objects of type object is unsupported"),
    ],
)
def test_an_answer_that_fails_costs_only_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, tag: str, answer: str, why: str
) -> None:
    text = QUESTION.replace("Done(asked.serial, str(1.0 / source.grass))", answer)
    added(tmp_path, monkeypatch, text)
    asked = registry.decode(f'{{"type": "{tag}", "serial": 3}}')
    with pytest.raises(MisuseError, match=f"lawn_page has failed: {why}"):
        asyncio.run(wait_for(registry.answer(asked, Meadow(0.0))))


class Past:
    """Another time than now."""

    time, tick = 1.0, 1


def test_an_answer_about_another_time_costs_only_itself_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    added(tmp_path, monkeypatch, QUESTION.replace("@answers()", "@answers(then=lambda source, asked, then: 1 / 0)"))
    asked = registry.decode('{"type": "lawn_mow", "serial": 3}')
    with pytest.raises(MisuseError, match="lawn_page has failed: ZeroDivisionError"):
        registry.answer(asked, Meadow(4.0), then=Past())  # type: ignore[arg-type]


def test_who_gives_up_waiting_for_an_answer_can(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A page that goes away cancels what it waits for, also from another package."""
    added(tmp_path, monkeypatch, QUESTION.replace("asyncio.sleep(0.0)", "asyncio.Event().wait()"))
    asked = registry.decode('{"type": "lawn_ask", "serial": 3}')

    async def give_up() -> None:
        waiting = asyncio.ensure_future(wait_for(registry.answer(asked, Meadow(4.0))))
        await asyncio.sleep(0.0)
        waiting.cancel()
        await waiting

    with pytest.raises(asyncio.CancelledError):
        asyncio.run(give_up())


@pytest.mark.parametrize(
    ("text", "points", "why"),
    [
        ("1 / 0", POINTS, "cannot be loaded: ZeroDivisionError: division by zero"),
        (f"{QUESTION}\nPAGE = 7", POINTS, "is no PagePart but 7"),
        (QUESTION.replace("lawn.js", "moss.js"), POINTS, "has no file moss.js in "),
        (QUESTION.replace("lawn_ask", "stop"), POINTS, 'the tag "stop" is that of two questions'),
        (QUESTION.replace("lawn_ask", "spread"), POINTS, 'the tag "spread" is that of two questions'),
        (
            QUESTION.replace("serial: Serial", "serial: Serial | dict[str, int] | PageMessage"),
            POINTS,
            "cannot be loaded",
        ),
        (QUESTION, POINTS.replace("lawn =", "vendor ="), "wanted another name"),
        (QUESTION, POINTS.replace("lawn =", "../lawn ="), "wanted another name"),
    ],
    ids=["import", "type", "file", "stop", "tag", "message", "folder", "name"],
)
def test_a_part_that_is_wrong_is_told_and_costs_only_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, points: str, why: str
) -> None:
    before = dict(HANDLERS)
    names, (said,) = added(tmp_path, monkeypatch, text, points)
    assert names == []
    assert "of the package lawn-bots" in said
    assert why in said
    assert said.endswith("; the page opens without it")
    assert before == HANDLERS, "none of its questions stays"
    registry.decode('{"type": "stop"}')


@pytest.mark.parametrize(
    ("piece", "why"),
    [
        (b"<p>A lawn \xff", "cannot be loaded: UnicodeDecodeError"),
        (b"<!-- A lawn", "<!-- A lawn<br> has no end"),
        (b"<textarea>", "<textarea> has no end"),
        (b"<section><p>A lawn.", "<section> has no end"),
        (b"<script>let tag = '</p>'", "<script> has no end"),
        (b"</body>", "</body> ends what it has not begun"),
        (b"<b title='", "has no end"),
    ],
)
def test_a_piece_that_would_swallow_the_page_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, piece: bytes, why: str
) -> None:
    (tmp_path / "pieces.html").write_bytes(b"<!-- room: side -->\n<p>Whole.</p>\n<!-- room: styles -->\n" + piece)
    names, (said,) = added(tmp_path, monkeypatch, QUESTION.replace('"lawn.js"', '"lawn.js", "", "pieces.html"'))
    assert names == []
    assert why in said


def test_pieces_may_be_written_as_html_allows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = "<ul><li>A<li>1 < 2 &amp</ul><table><tr><td><input checked></table><svg><path d=''/></svg>"
    (tmp_path / "pieces.html").write_text(f"<!-- room: side -->{text}<script>let tag = '</p>'</script><p>Grass & moss")
    names, said = added(tmp_path, monkeypatch, QUESTION.replace('"lawn.js"', '"lawn.js", "", "pieces.html"'))
    assert (names, said) == (["lawn"], [])


def test_a_page_opens_without_pieces_that_are_gone(tmp_path: Path) -> None:
    """A package may be taken away, or become another version, while a page is served."""
    assert 'id="stop"' in with_parts(
        (STATIC / "index.html").read_text("utf-8"), [("lawn", PagePart(tmp_path, "lawn.js", "", "pieces.html"))]
    )


def test_the_page_has_what_parts_add(tmp_path: Path) -> None:
    (tmp_path / "pieces.html").write_text("<!-- room: side -->\n<p>A lawn.</p>\n<!-- room: keys -->\n<tr></tr>\n")
    index = (STATIC / "index.html").read_text("utf-8")
    bare = with_parts(index, [])
    assert "<!-- room:" not in bare
    page = with_parts(index, [("lawn", PagePart(tmp_path, "lawn.js", "lawn.css", "pieces.html"))])
    assert '<link rel="stylesheet" href="static/lawn/lawn.css">' in page
    assert "<p>A lawn.</p>" in page
    ours, theirs = (page.index(f'src="static/{name}"') for name in ("main.js", "lawn/lawn.js"))
    assert ours < theirs, "it finds a page that has begun"
    whole = with_parts(index, [("lawn", PagePart(tmp_path, "lawn.js", whole=True))])
    assert '<body class="lawn">' in whole
    assert whole.index('src="static/lawn/lawn.js"') < whole.index('src="static/main.js"'), (
        "it says which panes there are"
    )


def test_a_page_of_its_own_is_asked_for_by_its_name() -> None:
    ((name, part),) = whole_page("nomads")
    assert (name, part.whole) == ("nomads", True)
    assert added_parts(print) == [], "and stands on no other page"
    with pytest.raises(MisuseError, match='no page "lawn"'):
        whole_page("lawn")


def test_every_room_of_nomads_is_in_the_page() -> None:
    """A piece for a room that the page has not got would be lost."""
    ((_, part),) = whole_page("nomads")
    rooms = [
        set(re.findall(r"<!-- room: ([\w-]+) -->", file.read_text("utf-8")))
        for file in (part.static / part.pieces, STATIC / "index.html")
    ]
    assert rooms[0] <= rooms[1]
