"""Messages of an experiment's page and to it, each an exact shape; those of the page are bounded."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from sleepcast.console.incoming import PageMessage, Serial, read
from sleepcast.console.outgoing import DeskMessage
from sleepcast.experiments.findings import Curves, ListedRun, Progress

MAX_NAME = 4_000
"""Characters of a key, of one of its values, or of a measure."""

Name = Annotated[str, Meta(max_length=MAX_NAME)]


class ChooseCurves(PageMessage, tag="look"):
    """Show the measure `y` over `x`, with a curve for each value of `by`, from now on."""

    x: Name
    y: Name
    by: Name = ""


class Runs(PageMessage):
    """Which runs are behind the mark at the value `x` of the curve `name`?"""

    serial: Serial
    x: Name
    name: Name = ""


Incoming = ChooseCurves | Runs
_DECODER: msgspec.json.Decoder[Incoming] = msgspec.json.Decoder(Incoming)


def decode(data: str | bytes) -> Incoming:
    """The message in `data`. Raises MessageError."""
    return read(_DECODER, data)


class ExperimentHello(DeskMessage, tag="hello"):
    """The first message.

    scenario: its name.
    folder: of the results.
    x, y, by: what can be chosen.
    measures: what each name means.
    goal: of a search, in words.
    notes: what else is to be known of it, each a sentence.
    """

    scenario: str
    folder: str
    x: tuple[str, ...]
    y: tuple[str, ...]
    by: tuple[str, ...]
    measures: dict[str, str]
    goal: str = ""
    notes: tuple[str, ...] = ()


class ProgressNews(DeskMessage, tag="come"):
    """How far the sweep has come."""

    progress: Progress


class DrawnCurves(DeskMessage, tag="drawing"):
    """The curves of the view that this page has chosen."""

    x: str
    y: str
    by: str
    found: Curves


class Listed(DeskMessage):
    """The runs behind a mark, the first ones of them if there are many."""

    serial: int
    runs: list[ListedRun]
