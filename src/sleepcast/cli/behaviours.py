"""`sleepcast check --from hoskins`: Hoskins' behaviours as SLEEP rules."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import TYPE_CHECKING

from sleepcast.cli.streams import put
from sleepcast.core.errors import in_file

if TYPE_CHECKING:
    from sleepcast.language import ReadError


def translate(texts: Iterable[tuple[str, str]], as_json: bool) -> int:
    """Print the rules of all texts, each with its place ("" where it was typed); gives how many are not understood."""
    from sleepcast.language import ReadError
    from sleepcast.language.behaviours import Behaviour, behaviours, rules

    found: list[Behaviour] = []
    unclear: list[tuple[str, ReadError]] = []
    for place, text in texts:
        try:
            found += behaviours(text)
        except ReadError as refused:
            unclear.append((place, refused))
    made = rules(found)
    if as_json:
        put(json.dumps({"rules": made, "unclear": [_as_dict(place, error) for place, error in unclear]}))
        return len(unclear)
    for rule in made:
        put(rule)
    for place, error in unclear:
        put(in_file(f"{place}:1", str(error)) if place else f"not understood: {error}")
    return len(unclear)


def _as_dict(place: str, error: ReadError) -> dict[str, object]:
    return {"place": place, "start": error.start, "end": error.end, "message": error.reason}
