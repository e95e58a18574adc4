"""Where a scenario was found and what a run has changed in it, as one text that is kept with the scenario.

So a run can be begun again from the scenario's own file: the text is JSON, the name by which the scenario was found and
the `Changes`.
"""

from __future__ import annotations

import json
from dataclasses import asdict

from sleepcast.core.errors import MisuseError
from sleepcast.simulator.scenario.world_settings import Changes


def written_origin(name: str, changes: Changes) -> str:
    """The text; "" for changes that are no plain data."""
    try:
        return json.dumps({"name": name} | asdict(changes))
    except (TypeError, ValueError):
        return ""


def read_origin(text: str) -> tuple[str, Changes]:
    """The name and the changes. Raises MisuseError for a text that is none."""
    try:
        values = json.loads(text)
        over = tuple((str(key), value) for key, value in values.pop("over"))
        return str(values.pop("name")), Changes(**values, over=over)
    except (ValueError, TypeError, KeyError, AttributeError):
        raise MisuseError("nobody knows from which file this scenario was read") from None
