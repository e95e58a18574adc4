"""Values and keys as they are written in TOML."""

from __future__ import annotations

import json
import re

_PLAIN_KEY = re.compile(r"[\w-]+(?:\.[\w-]+)*")


def toml_key(name: str) -> str:
    """A key; one that is like `radio.loss` leads into tables."""
    return name if _PLAIN_KEY.fullmatch(name) else _quoted(name)


def toml_value(value: object) -> str:
    """Truth, a number, a text, or a list or a table of these. Raises TypeError for anything else."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{_quoted(name)} = {toml_value(each)}' for name, each in value.items())} }}"
    if isinstance(value, int | float):
        return repr(value)
    raise TypeError(f"a {type(value).__name__} cannot be written in TOML")


def _quoted(text: str) -> str:
    """A basic string of TOML, whose escapes are those of JSON."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")
