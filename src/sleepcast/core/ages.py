"""How long something takes, and how long ago it was, in words: seconds in the units in which people think."""

from __future__ import annotations

MARGIN = 2.0
"""Seconds by which two clocks may differ, or one may be moved, before the time of something counts as wrong."""
YEAR = 365.25 * 86_400.0
"""Seconds in a year."""
UNITS = ((86_400.0, "days"), (3_600.0, "h"), (60.0, "min"))


def duration(seconds: float) -> str:
    """`0.25 s`, `2 min 5 s`, `23 h 59 min`, `5 days`, `3 years`; `seconds` is not negative."""
    if seconds < 59.5:
        return f"{seconds:.3g} s"
    if seconds >= 2.0 * YEAR:
        return f"{seconds / YEAR:.0f} years" if seconds < 1e12 else f"{seconds / YEAR:.6g} years"
    if seconds >= 2.0 * 86_400.0:
        return f"{seconds / 86_400.0:.0f} days"
    minutes, second = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {second} s" if second else f"{minutes} min"
    hours, minute = divmod(round(seconds / 60.0), 60)
    return f"{hours} h {minute} min" if minute else f"{hours} h"


def ago(seconds: float) -> str:
    """`8 s ago`, `3 h ago`; what would only be in the future has a time from a clock that was wrong."""
    if seconds < -MARGIN:
        return "at an unknown time, since a clock was wrong"
    for length, unit in UNITS:
        if seconds >= 2.0 * length:
            return f"{seconds / length:.0f} {unit} ago"
    return f"{max(0.0, seconds):.0f} s ago"


def age(seconds: float) -> str:
    """In few characters, for a column of a table: `0.5 s`, `42 s`, `5 min`, `3 h`."""
    if seconds < 100.0:
        return f"{max(0.0, seconds):.1f} s" if seconds < 10.0 else f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 6_000.0 else f"{seconds / 3_600.0:.0f} h"
