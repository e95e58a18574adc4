"""Simulated time on the command line: `30s`, `2min`, or a bare number of seconds."""

from __future__ import annotations

import re
from math import isfinite

import click

from sleepcast.units import TIME, UNITS, to_si

_TIME = re.compile(r"(\d++(?:\.\d*+)?+|\.\d++)\s*([A-Za-z]*)")


class SimulatedTime(click.ParamType):  # type: ignore[type-arg]  # takes one only where click is new
    """A time with its unit; gives seconds."""

    name = "time"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> float:
        match = _TIME.fullmatch(str(value).strip())
        unit = match[2].casefold() or "s" if match else ""
        if match is None or unit not in UNITS or UNITS[unit].dimension != TIME:
            self.fail(f"wanted a time such as 30s or 2min, not {str(value)[:40]!r}", param, ctx)
        seconds = to_si(float(match[1]), unit)
        if not isfinite(seconds):
            self.fail(f"{str(value)[:40]!r} is too far away", param, ctx)
        return seconds
