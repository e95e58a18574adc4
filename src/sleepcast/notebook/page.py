"""The page as one text: its modules, its style and its markup, which a server sends as files elsewhere."""

from __future__ import annotations

import re
from functools import cache

from sleepcast.console.joining import joined_modules, read

_STYLE = re.compile(r'<link rel="stylesheet" href="static/([\w/.]+)">')
_LIBRARY = re.compile(r'<script defer src="static/([\w/.]+)"></script>')
_SCRIPT = '<script type="module" src="static/main.js"></script>'
_ICON = re.compile(r"<link rel=\"icon\"[^>]*>\n")
_BEGIN = 'take("main");'


@cache
def page() -> str:
    """The markup of the page for a frame in a notebook; it asks for no other file."""
    text = _ICON.sub("", read("index.html"))
    text = _STYLE.sub(lambda old: f"<style>\n{read(old[1])}</style>", text)
    text = _LIBRARY.sub(lambda old: f"<script>\n{_inside_script(read(old[1]))}</script>", text)
    parts = {
        _SCRIPT: f'<script type="module">\n{_inside_script(joined_modules())}{_BEGIN}\n</script>',
        "<body>": '<body class="embedded">',
    }
    for old, new in parts.items():
        if text.count(old) != 1:
            raise ValueError(f"the page cannot be put together: {old} is not once in it")
        text = text.replace(old, new)
    return text


def _inside_script(text: str) -> str:
    """A script as it may stand in the markup. Raises ValueError for one that would end there."""
    if "</script" in text:
        raise ValueError("the page cannot be put together: a script ends within itself")
    return text
