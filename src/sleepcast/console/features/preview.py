"""What is wrong in a text, and who would obey it now: the page asks with every key."""

from __future__ import annotations

from typing import Protocol

import msgspec

from sleepcast.console.feature import answers, run_again
from sleepcast.console.incoming import Operator, PageMessage, Serial, Text
from sleepcast.console.outgoing import DeskMessage, ShownFinding
from sleepcast.console.view import Scene
from sleepcast.core.errors import and_more
from sleepcast.language import ReadError
from sleepcast.station import NO, UNKNOWN, YES, Station

MAX_REASONS = 5
"""Reasons for unknown robots that a preview names."""


class GetPreview(PageMessage, tag="preview"):
    """Check a text and say who would obey it now. by: the operator who would send it, "" for the first."""

    serial: Serial
    text: Text
    by: Operator = ""


class Previewed(DeskMessage):
    """What the station thinks of a text.

    counted: whether it could be previewed at all
    lit: a byte for each robot
    most: how many are chosen of those who would bid, None for a command that chooses nobody
    """

    serial: int
    findings: list[ShownFinding]
    cost: int = 0
    counted: bool = False
    yes: int = 0
    no: int = 0
    unknown: int = 0
    everybody: bool = False
    oldest: float = 0.0
    reasons: list[tuple[str, int]] = msgspec.field(default_factory=list)
    lit: bytes = b""
    most: int | None = None


class PreviewSource(Protocol):
    """Who can check and preview texts, for the robots on the map."""

    def desk_of(self, operator: str) -> Station:
        """The desk of an operator. Raises MisuseError for one who has none here."""

    @property
    def scene(self) -> Scene: ...


@answers(then=run_again)
def get_preview(source: PreviewSource, asked: GetPreview) -> Previewed:
    """What is wrong in a text, and who would obey it now."""
    serial, text, station = asked.serial, asked.text, source.desk_of(asked.by)
    try:
        checked = station.check(text)
    except ReadError as error:
        return Previewed(serial, [ShownFinding("error", error.reason, error.start, error.end, str(error))])
    findings = [ShownFinding(f.severity, f.message, f.start, f.end, f.render(text)) for f in checked.findings]
    findings += [ShownFinding("warning", line, 0, 0, line) for line in and_more(checked.more)]
    if checked.errors and checked.by:
        findings.append(ShownFinding("error", checked.by, 0, 0, checked.by))
    if checked.program is None:
        return Previewed(serial, findings, checked.cost)
    preview = station.preview(checked)
    return Previewed(
        serial,
        findings,
        checked.cost,
        True,
        preview.count(YES),
        preview.count(NO),
        preview.count(UNKNOWN),
        preview.everybody,
        preview.oldest,
        list(preview.reasons.items())[:MAX_REASONS],
        preview.codes[: len(source.scene.names)].tobytes(),  # others that speak on the channel are not on the map
        preview.most,
    )
