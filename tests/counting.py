"""How often a desk reads and checks a text, foresees who would obey it, and validates what is to be sent."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from sleepcast.station import Station, station, validation, whose_names

ONCE = {"checked": 1, "foreseen": 1, "validated": 1}


@contextmanager
def counted() -> Iterator[Counter[str]]:
    """What is done meanwhile at the desks of this process; all of it is done as ever."""
    found: Counter[str] = Counter()

    def count(name: str, whole: Callable[..., Any]) -> Callable[..., Any]:
        def counting(*given: Any, **named: Any) -> Any:
            found[name] += 1
            return whole(*given, **named)

        return counting

    with pytest.MonkeyPatch.context() as patch:
        for module in (validation, whose_names):
            patch.setattr(module, "check", count("checked", module.check))
        patch.setattr(station, "preview", count("foreseen", station.preview))
        patch.setattr(Station, "_settle", count("validated", Station._settle))
        yield found
