"""What packages add to pages: ES modules, style sheets, pieces of HTML, and questions with their answers.

Each is a `PagePart`, an entry point in the group `sleepcast.pages`. A part that is `whole` is a page of its own, with
other panes than those of a swarm, and is asked for by its name, as that of Nomads is. Every other part is added to the
page of a swarm, of a recording and of robots on the air. Its files are served at `static/NAME/`, by this server as all
others are: the page loads nothing from elsewhere.

What questions and answers of packages are made of (`answers`, `PageMessage`, `DeskMessage` and so on) can be imported
from here, so that no package has to know where in this room it stands.

A part that cannot be loaded, or not within `LOAD_WITHIN`, costs a page only that part: the person at the terminal is
told which package is to blame, and the page, with its STOP, opens without it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, wait
from contextlib import suppress
from functools import partial
from html.parser import HTMLParser
from importlib import resources
from pathlib import Path
from time import monotonic
from types import ModuleType

from sleepcast.console import registry
from sleepcast.console.feature import answers, only_now, run_again
from sleepcast.console.incoming import PageMessage, Serial
from sleepcast.console.outgoing import DeskMessage, Done
from sleepcast.console.package_code import thread_of
from sleepcast.console.values import Values
from sleepcast.core.errors import MisuseError
from sleepcast.core.extensions import OWN, PAGES, Extension, extensions, find_extension, load_extension
from sleepcast.core.records import dataclass

__all__ = [
    "STATIC",
    "DeskMessage",
    "Done",
    "PageMessage",
    "PagePart",
    "Parts",
    "Serial",
    "Values",
    "added_parts",
    "answers",
    "only_now",
    "run_again",
    "whole_page",
    "with_parts",
]

STATIC = Path(str(resources.files("sleepcast.console"))) / "static"
NAME = re.compile(r"[a-z][a-z0-9_-]{0,40}")
"""A name that can stand in an address and in a class of the page's body."""
ROOM = re.compile(r"[ \t]*<!-- room: ([\w-]+) -->\n?")
"""A place in `static/index.html` for pieces of a part, and in a file of pieces the place for what follows."""
VOID = frozenset(["area", "base", "br", "col", "embed", "hr", "img", "input", "link", "meta", "source", "track", "wbr"])
"""Elements of HTML that have no end."""
ENDS_BY_ITSELF = frozenset(
    ["dd", "dt", "li", "optgroup", "option", "p", "rp", "rt", "tbody", "td", "tfoot", "th", "thead", "tr"]
)
"""Elements whose end need not be written."""


@dataclass(frozen=True, slots=True)
class PagePart:
    """What a package adds to pages.

    static: the folder of its files.
    module: the ES module in it that the page loads; `page` of `../main.js` is what it has to do with.
    style: the style sheet in it, "" for none.
    pieces: the file in it with pieces of HTML for the rooms of `index.html`, "" for none.
    features: the package (a folder of modules) with its questions, see `console.feature`; None for none.
    whole: whether it is a page of its own, see the module; its module is loaded before `main.js`.
    """

    static: Path
    module: str
    style: str = ""
    pieces: str = ""
    features: ModuleType | None = None
    whole: bool = False


LOAD_WITHIN = 10.0
"""Seconds for all parts together: long for an import, short for who waits for the page's STOP."""
Parts = Sequence[tuple[str, PagePart]]
"""Parts of one page with their names."""


def whole_page(name: str) -> Parts:
    """The page of its own that has this name. Raises MisuseError where there is none."""
    added = find_extension(PAGES, name)
    if added is None:
        raise MisuseError(f'no page "{name:.80}": no installed package adds one in {PAGES}')
    part, questions = registry.apart(partial(_load, added))
    registry.add(questions, added.package)
    return [(name, part)]


def added_parts(say: Callable[[str], None]) -> Parts:
    """What installed packages add to the page of a swarm; each is loaded in the thread of its package. say: tells the
    person at the terminal what cannot be loaded."""
    until, parts = monotonic() + LOAD_WITHIN, []
    added = [each for each in extensions(PAGES).values() if each.package != OWN]  # whose pages are of their own
    loading = [thread_of(each.package).begin(partial(registry.apart, partial(_load, each))) for each in added]
    for each, loaded in zip(added, loading, strict=True):
        try:
            part = _loaded(each, loaded, until)
        except MisuseError as error:
            say(f"{error}; the page opens without it")
            continue
        if not part.whole:
            parts.append((each.name, part))
    return parts


def _loaded(added: Extension, loaded: Future[tuple[PagePart, registry.Questions]], until: float) -> PagePart:
    """A part, if it is there until then, s of `monotonic`. Raises MisuseError."""
    wait([loaded], max(0.0, until - monotonic()))
    if not loaded.done():
        thread_of(added.package).give_up()
        raise MisuseError(f"{_who(added)} is not loaded after {LOAD_WITHIN:g} s")
    part, questions = loaded.result()
    try:
        registry.add(questions, added.package)
    except MisuseError as error:
        raise MisuseError(f"{_who(added)} cannot be loaded: {error}") from error
    return part


def _who(added: Extension) -> str:
    return f'page "{added.name}" of the package {added.package}'


def _load(added: Extension) -> PagePart:
    """A part with its questions. Raises MisuseError."""
    who = _who(added)
    if not NAME.fullmatch(added.name) or (STATIC / added.name).exists():
        raise MisuseError(f"{who}: wanted another name, of small letters and digits, that no folder of the page has")
    try:
        part = load_extension(added, "page")
        if not isinstance(part, PagePart):
            raise MisuseError(f"{who} is no PagePart but {part!r:.60}")
        files = (part.module, part.style, part.pieces)
        if lacking := [file for file in files if file and not (part.static / file).is_file()]:
            raise MisuseError(f"{who} has no file {', '.join(lacking)} in {part.static}")
        if open_tag := _unbalanced(_pieces(part)):
            raise MisuseError(f"{who} has pieces that would take the rest of the page with them: {open_tag}")
        if part.features is not None:
            registry.collect(part.features)
    except (MisuseError, KeyboardInterrupt):
        raise
    except BaseException as error:  # a module that is imported may do anything
        raise MisuseError(f"{who} cannot be loaded: {type(error).__name__}: {error}") from error
    return part


def _pieces(part: PagePart) -> str:
    """Its HTML with the names of rooms. Raises OSError and UnicodeError."""
    return (part.static / part.pieces).read_text("utf-8") if part.pieces else ""


class _Balance(HTMLParser):
    """Looks for what would go on behind a piece, or end what stands around it. wrong: what that is, "" for nothing."""

    def __init__(self) -> None:
        super().__init__()
        self.wrong = ""
        self._open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        while self._open and self._open[-1] != tag and self._open[-1] in ENDS_BY_ITSELF:
            self._open.pop()
        if self._open and self._open[-1] == tag:
            self._open.pop()
        elif tag not in VOID:
            self.wrong = self.wrong or f"</{tag}> ends what it has not begun"

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """One without content, as in SVG."""

    def finish(self) -> str:
        """What is wrong with the piece that was read."""
        left = [tag for tag in self._open if tag not in ENDS_BY_ITSELF]
        if not self.wrong and (left or self.rawdata):
            self.wrong = f"<{left[-1]}> has no end" if left else f"{self.rawdata[:20]} has no end"
        return self.wrong


def _unbalanced(pieces: str) -> str:
    """What is wrong with the first piece that is not whole, "" for nothing: a comment or an element that goes on behind
    it would swallow what the page's own scripts look for, STOP among it."""
    for piece in ROOM.split(pieces)[2::2]:
        balance = _Balance()
        balance.feed(f"{piece}<br>")  # which leaves nothing to be read, unless something takes it in
        if wrong := balance.finish():
            return wrong
    return ""


def with_parts(text: str, parts: Parts) -> str:
    """The page's HTML with what parts add."""
    rooms: dict[str, str] = {}
    for name, part in parts:
        with suppress(OSError, UnicodeError):  # it was there when the page opened, but a package may be changed since
            pieces = ROOM.split(_pieces(part))
            _put(rooms, zip(pieces[1::2], pieces[2::2], strict=True))
        script = f'<script type="module" src="static/{name}/{part.module}"></script>\n'
        _put(rooms, [("first" if part.whole else "scripts", script)])
        if part.style:
            _put(rooms, [("styles", f'<link rel="stylesheet" href="static/{name}/{part.style}">\n')])
    page = ROOM.sub(lambda room: rooms.get(room[1], ""), text)
    classes = " ".join(name for name, part in parts if part.whole)
    return page.replace("<body>", f'<body class="{classes}">', 1) if classes else page


def _put(rooms: dict[str, str], pieces: Iterable[tuple[str, str]]) -> None:
    for room, piece in pieces:
        rooms[room] = rooms.get(room, "") + piece
