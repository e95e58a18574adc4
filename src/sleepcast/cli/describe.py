"""What an entry of the journal, an answer or a report says, and what was heard, in a few words for a person."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import partial

from sleepcast.channel.admission import Admission
from sleepcast.channel.clock_sync import differs
from sleepcast.channel.drops import NoticeLog
from sleepcast.channel.message import TOOK, outcome_of
from sleepcast.core.clock import UnixClock, WallClock
from sleepcast.core.errors import printable
from sleepcast.core.units import value_in_words
from sleepcast.language.reading_units import report_in_words
from sleepcast.station.journal.journal import CONFLICT, JournalEntry, JournalEvent

SHOWN = 5
"""Names that are listed."""
COUNTED = {
    "matched": "matched",
    "held": "held by STOP",
    "not_stored": "not stored",
    "not_matched": "did not match",
    "unknown": "unknown",
    "waiting": "waiting",
    "fault": "fault",
    "silent": "silent",
}
"""What is counted of a command, and how it is said."""
RARE = frozenset({"held", "unknown", "waiting", "not_stored"})
"""What is only said where it happened."""


def entry_text(entry: JournalEntry) -> str:
    """What an entry says."""
    about = f"{entry.subject}: " if entry.subject else ""
    return about + TELLERS.get(entry.event, _other)(entry)


def answer_text(body: Mapping[str, object]) -> str:
    """What an answer or a report says."""
    match body.get(TOOK), body.get("values"):
        case str() as whose, [float() as behind]:
            return f"took its time from {printable(whose)}: its clock was {differs(-behind)}"
    if "label" in body:
        return report_in_words(body["label"], body.get("values"))
    outcomes = body.get("outcomes")
    if isinstance(outcomes, dict):
        return ", ".join(f"{outcome} {count}" for outcome, count in outcomes.items())
    outcome, value, fault = outcome_of(body), body.get("value"), body.get("fault")
    if not isinstance(outcome, str):
        return json.dumps({key: value for key, value in body.items() if key not in ("kind", "command")})
    known = f" {value_in_words(value, '')}" if isinstance(value, float) and value == value else ""
    return f"{outcome}{known}{f': {fault}' if fault else ''}"


def heard_text(admission: Admission) -> str:
    """How many messages came in, and what did not, by reason."""
    dropped = ", ".join(f"{count} {reason}" for reason, count in sorted(admission.counts.items()))
    return f"{admission.passed} messages heard{f', dropped: {dropped}' if dropped else ''}"


def notices_of(admission: Admission) -> NoticeLog:
    """What is going on at a robot's door, as lines for a terminal."""
    return NoticeLog(admission.drops, admission.trust, WallClock(), partial(admission.warnings, UnixClock()))


def _sent(entry: JournalEntry) -> str:
    details, text = entry.details, _one_line(entry.text)
    kind = str(details.get("kind", "")).upper()
    named = text if kind == "COMMAND" else f"{kind} {text}".strip()
    predicted = details.get("predicted")
    names = [str(name) for name in predicted] if isinstance(predicted, list) else []
    count = details.get("n_predicted", len(names))
    listed = ", ".join(names[:SHOWN]) + (", ..." if len(names) > SHOWN else "")
    expected = f"  [{count} expected: {listed}]" if names else ""
    return f"{named}{'  [standing]' if details.get('standing') else ''}{expected}"


def _refused(entry: JournalEntry) -> str:
    reason = str(entry.details.get("reason", "")).partition("\n")[0]
    return f"{_one_line(entry.text)} ({reason})"


def _heard(entry: JournalEntry) -> str:
    return entry.text if entry.details.get("kind") == CONFLICT else answer_text(entry.details)


def _repeated(entry: JournalEntry) -> str:
    return f"{entry.text}, as {entry.details.get('silent')} are silent"


def _accounted(entry: JournalEntry) -> str:
    details = entry.details
    outcomes = [outcome for outcome in COUNTED if outcome not in RARE or details.get(f"n_{outcome}")]
    counts = [f"{COUNTED[outcome]} {details.get(f'n_{outcome}')}" for outcome in outcomes]
    names = details.get("silent")
    silent = [str(name) for name in names] if isinstance(names, list) else []
    listed = ", ".join(silent[:SHOWN]) + (", ..." if len(silent) > SHOWN else "")
    return ", ".join(counts) + (f": {listed}" if silent else "")


def _other(entry: JournalEntry) -> str:
    return f"{_one_line(entry.text)} {json.dumps(dict(entry.details), ensure_ascii=False)}".strip()


TELLERS: Mapping[JournalEvent, Callable[[JournalEntry], str]] = {
    JournalEvent.SENT: _sent,
    JournalEvent.REFUSED: _refused,
    JournalEvent.HEARD: _heard,
    JournalEvent.REPEATED: _repeated,
    JournalEvent.ACCOUNTED: _accounted,
}


def _one_line(text: str) -> str:
    return " ".join(text.split())
