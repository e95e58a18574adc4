"""A pane of sleepcast's page: who has the least charge left. Found by its entry point in `sleepcast.pages`.

The page's module (`line_static/charge.js`) asks `line_charge`; the function below `@answers` answers it, wherever
robots have values: in a simulated swarm, a recording, or on the air.
"""

from pathlib import Path
from typing import Protocol

import numpy as np

from sleepcast.console.page_parts import DeskMessage, PageMessage, PagePart, Serial, Values, answers, run_again

PAGE = PagePart(Path(__file__).parent / "line_static", "charge.js")
FEWEST = 5


class GetCharge(PageMessage, tag="line_charge"):
    """Who has the least charge left."""

    serial: Serial


class Charge(DeskMessage, tag="line_charge"):
    """Names and charges, 1 for a full battery, the least first."""

    serial: int
    rows: list[tuple[str, float]]


class ChargeSource(Protocol):
    """Robots whose values are known."""

    @property
    def values(self) -> Values: ...


@answers(then=run_again)
def charge(source: ChargeSource, asked: GetCharge) -> Charge:
    """Those robots that say how full their batteries are, the emptiest first."""
    charges, _ = source.values.of("battery")
    names = source.values.names
    emptiest = np.argsort(charges, kind="stable")[:FEWEST]
    return Charge(asked.serial, [(names[i], float(charges[i])) for i in emptiest if not np.isnan(charges[i])])
