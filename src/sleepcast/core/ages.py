"""How long ago something was, in words."""

from __future__ import annotations

MARGIN = 2.0
"""Seconds by which two clocks may differ, or one may be moved, before the time of something counts as wrong."""
UNITS = ((86_400.0, "days"), (3_600.0, "h"), (60.0, "min"))


def ago(seconds: float) -> str:
    """`8 s ago`, `3 h ago`; what would only be in the future has a time from a clock that was wrong."""
    if seconds < -MARGIN:
        return "at an unknown time, since a clock was wrong"
    for length, unit in UNITS:
        if seconds >= 2.0 * length:
            return f"{seconds / length:.0f} {unit} ago"
    return f"{max(0.0, seconds):.0f} s ago"
