"""The page as one text: its plain modules, its style and its markup, which a server sends as files elsewhere.

Each module becomes a function that is called once, after those that it imports; what it exports is what the function
gives. The page's modules keep to the two forms that are known here: `import { a, b as c } from "./x.js";` on a line of
its own, and `export` before a class, a function or a constant.
"""

from __future__ import annotations

import re
from functools import cache
from graphlib import TopologicalSorter

from sleepcast.console.page_parts import STATIC

ENTRY = "main"
"""The module with which the page begins."""

_IMPORT = re.compile(r'^import \{ ([^}]+) \} from "\./(\w+)\.js";$', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:async )?(?:class|function|const) (\w+))", re.MULTILINE)
_OTHER = re.compile(r"^(?:import|export)\b.*$", re.MULTILINE)
_STYLE = re.compile(r'<link rel="stylesheet" href="static/([\w/.]+)">')
_LIBRARY = re.compile(r'<script defer src="static/([\w/.]+)"></script>')
_SCRIPT = '<script type="module" src="static/main.js"></script>'
_ICON = re.compile(r"<link rel=\"icon\"[^>]*>\n")


@cache
def page() -> str:
    """The markup of the page for a frame in a notebook; it asks for no other file."""
    text = _ICON.sub("", _read("index.html"))
    text = _STYLE.sub(lambda old: f"<style>\n{_read(old[1])}</style>", text)
    text = _LIBRARY.sub(lambda old: f"<script>\n{_inside_script(_read(old[1]))}</script>", text)
    parts = {
        _SCRIPT: f'<script type="module">\n{_inside_script(bundle())}</script>',
        "<body>": '<body class="embedded">',
    }
    for old, new in parts.items():
        if text.count(old) != 1:
            raise ValueError(f"the page cannot be put together: {old} is not once in it")
        text = text.replace(old, new)
    return text


def _read(name: str) -> str:
    return (STATIC / name).read_text(encoding="utf-8")


def _inside_script(text: str) -> str:
    """A script as it may stand in the markup. Raises ValueError for one that would end there."""
    if "</script" in text:
        raise ValueError("the page cannot be put together: a script ends within itself")
    return text


def bundle() -> str:
    """All modules of the page as one. Raises ValueError for one that is written in another way."""
    texts: dict[str, str] = {}
    needs: dict[str, set[str]] = {}
    waiting = [ENTRY]
    while waiting:
        name = waiting.pop()
        if name in texts:
            continue
        texts[name] = _read(f"{name}.js")
        needs[name] = {other for _, other in _IMPORT.findall(texts[name])}
        waiting += needs[name]
    return "".join(_as_function(name, texts[name]) for name in TopologicalSorter(needs).static_order())


def _as_constants(match: re.Match[str]) -> str:
    """What stands for an import: a name may be taken in by another one."""
    return f"const {{ {match[1].replace(' as ', ': ')} }} = module_{match[2]};"


def _as_function(name: str, text: str) -> str:
    exported = ", ".join(_EXPORT.findall(text))
    body = _EXPORT.sub("", _IMPORT.sub(_as_constants, text))
    if other := _OTHER.search(body):
        raise ValueError(f"{name}.js: {other[0]!r} is not a form that can be put together")
    return f"const module_{name} = (() => {{\n{body}\nreturn {{ {exported} }};\n}})();\n"
