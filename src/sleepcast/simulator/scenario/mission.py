"""Mission scripts: what an operator would send, with the times at which to send it.

    @10s   (WHEN (> fuel 50%) (JOIN bravo))   ; a comment
    @1min  (WHEN (IN bravo)                   ; an order continues on lines that begin with a blank
             (GOTO vessel_x vessel_y))
    @{LATE} (WHEN (> fuel {ENOUGH}) (ST))     ; numbers from the scenario's [constants]

Times are simulated time since the start of the run, in ascending order. An order may have several of them, `@0s,2s,4s`:
it is sent again at each, since the radio of a swarm loses messages. Expressions are stored as text; the program that
runs the mission checks them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from textwrap import dedent

from sleepcast.core.errors import MisuseError
from sleepcast.core.settings import SettingsError, read_text
from sleepcast.core.units import TIME, UNITS, to_si
from sleepcast.robot import BodyConstant
from sleepcast.simulator.scenario.groups import filled

MAX_BYTES = 1_048_576
"""Bytes of one script, comments included."""
MAX_ORDERS = 1_000
"""Orders in one mission: what an operator types in a long day."""

_ONE = r"(\d++(?:\.\d*+)?+|\.\d++)\s*([A-Za-z%/0-9]*)"
_TIME = re.compile(_ONE)
_TIMES = re.compile(rf"@({_ONE}(?:,{_ONE})*)(?=\s|$)")


class MissionError(MisuseError):
    """An error in a mission script; the text begins with the file and the line."""


@dataclass(frozen=True, slots=True)
class Order:
    """One expression to send at `time` (s since the start); `place` is its file and line, for errors."""

    time: float
    text: str
    place: str


def read_mission(path: Path, constants: Sequence[BodyConstant] = ()) -> tuple[Order, ...]:
    """The orders of the script at `path`, in time order, with the numbers of `constants` for their `{NAME}`. Raises
    MissionError."""
    try:
        text = read_text(path, MAX_BYTES, "a mission")
    except SettingsError as error:
        raise MissionError(str(error)) from error
    lines = []
    for number, line in enumerate(text.split("\n"), 1):
        said, semicolon, comment = line.partition(";")
        lines.append(f"{filled(said, constants, f'{path}:{number}')}{semicolon}{comment}")
    return parse_mission("\n".join(lines), str(path))


def parse_mission(text: str, name: str) -> tuple[Order, ...]:
    """The orders in `text`, in time order; errors show `name` as the file. Raises MissionError."""
    orders: list[tuple[tuple[float, ...], Order]] = []
    count = 0
    for number, line in enumerate(text.split("\n"), 1):
        place = f"{name}:{number}"
        if not line.partition(";")[0].strip():
            continue
        if line.startswith("@"):
            times, rest = _times(line, place, orders[-1][1].time if orders else 0.0)
            orders.append((times, Order(times[0], rest, place)))
            count += len(times)
        elif line[0].isspace() and orders:
            times, order = orders[-1]
            orders[-1] = times, replace(order, text=f"{order.text}\n{line.rstrip()}")
        else:
            raise MissionError(
                f"{place}: wanted an order such as @12.5s (ST), or a line of the order above that begins with a "
                f"blank, not {line.strip()[:40]}"
            )
        if count > MAX_ORDERS:
            raise MissionError(f"{place}: more than {MAX_ORDERS} orders in one mission")
    for _, order in orders:
        if not _bare(order.text):
            raise MissionError(f"{order.place}: a time without an expression after it")
    sent = [replace(order, time=time, text=dedent(order.text).strip()) for times, order in orders for time in times]
    return tuple(sorted(sent, key=lambda order: order.time))


def _bare(text: str) -> str:
    """`text` without its comments."""
    return "".join(line.partition(";")[0].strip() for line in text.split("\n"))


def _times(line: str, place: str, before: float) -> tuple[tuple[float, ...], str]:
    """The times of an order, in s and ascending, and what follows them. before: of the order above."""
    match = _TIMES.match(line)
    if match is None:
        raise _no_time(line, place)
    found: list[float] = []
    for number, unit in _TIME.findall(match[1]):
        if unit.casefold() not in UNITS or UNITS[unit.casefold()].dimension != TIME:
            raise _no_time(line, place)
        time = to_si(float(number), unit.casefold())
        if not isfinite(time):
            raise MissionError(f"{place}: {line.split()[0][:40]} is too far away")
        if found and time <= found[-1]:
            raise MissionError(f"{place}: {time:g} s does not come after {found[-1]:g} s; sort an order's times")
        if time < before:
            raise MissionError(f"{place}: {time:g} s comes before the order above it ({before:g} s); sort them by time")
        found.append(time)
    return tuple(found), line[match.end() :].strip()


def _no_time(line: str, place: str) -> MissionError:
    return MissionError(f"{place}: wanted a time with its unit, such as @12.5s or @2min, not {line.split()[0][:40]}")
