"""Mission scripts: what an operator would send, with the times at which to send it.

    @10s   (WHEN (> fuel 50%) (JOIN bravo))   ; a comment
    @1min  (WHEN (IN bravo)                   ; an order continues on lines that begin with a blank
             (GOTO vessel_x vessel_y))
    @{LATE} (WHEN (> fuel {ENOUGH}) (ST))     ; numbers from the scenario's [constants]

Times are simulated time since the start of the run, in ascending order. Expressions are stored as text; the program
that runs the mission checks them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
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

_TIME = re.compile(r"@(\d++(?:\.\d*+)?+|\.\d++)\s*([A-Za-z%/0-9]*)(?=\s|$)")


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
    orders: list[Order] = []
    for number, line in enumerate(text.split("\n"), 1):
        place = f"{name}:{number}"
        if not line.partition(";")[0].strip():
            continue
        if line.startswith("@"):
            orders.append(_order(line, place, orders[-1].time if orders else 0.0))
        elif line[0].isspace() and orders:
            orders[-1] = Order(orders[-1].time, f"{orders[-1].text}\n{line.rstrip()}", orders[-1].place)
        else:
            raise MissionError(
                f"{place}: wanted an order such as @12.5s (ST), or a line of the order above that begins with a "
                f"blank, not {line.strip()[:40]}"
            )
        if len(orders) > MAX_ORDERS:
            raise MissionError(f"{place}: more than {MAX_ORDERS} orders in one mission")
    for order in orders:
        if not _bare(order.text):
            raise MissionError(f"{order.place}: a time without an expression after it")
    return tuple(Order(order.time, dedent(order.text).strip(), order.place) for order in orders)


def _bare(text: str) -> str:
    """`text` without its comments."""
    return "".join(line.partition(";")[0].strip() for line in text.split("\n"))


def _order(line: str, place: str, before: float) -> Order:
    match = _TIME.match(line)
    unit = match[2].casefold() if match else ""
    if match is None or unit not in UNITS or UNITS[unit].dimension != TIME:
        raise MissionError(f"{place}: wanted a time with its unit, such as @12.5s or @2min, not {line.split()[0][:40]}")
    time = to_si(float(match[1]), unit)
    if not isfinite(time):
        raise MissionError(f"{place}: {line.split()[0][:40]} is too far away")
    if time < before:
        raise MissionError(f"{place}: {time:g} s comes before the order above it ({before:g} s); sort them by time")
    return Order(time, line[match.end() :].strip(), place)
