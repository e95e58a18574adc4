"""Mission scripts: what an operator would send, with the times at which to send it.

    @10s   (WHEN (> fuel 50%) (JOIN bravo))   ; a comment
    @1min  (WHEN (IN bravo)                   ; an order continues on lines that begin with a blank
             (GOTO vessel_x vessel_y))
    @{LATE} (WHEN (> fuel {ENOUGH}) (ST))     ; numbers from the scenario's [constants]
    @2min  standing (RULE shy (...))          ; or: ask fuel, only scout1,scout2 (ST), within 60s (ST)
    = matched 98, unknown at most 3           ; what shall have become of it when the run ends
    @3min  STOP                               ; or RELEASE, which ends the STOPs of its sender
    @3min  RELEASE ALL                        ; ends the STOPs of all operators
    @4min  as bert (ST)                       ; sent by this one of the scenario's [operators]; else by the first
    @4min  as anna lease take bravo for 60s   ; or: give, request, force; grant bravo to bert
    @4min  as anna HOLD                       ; robots hear all the time that she is there, until AWAY

Times are simulated time since the start of the run, in ascending order. An order may have several of them, `@0s,2s,4s`:
it is sent again at each, since the radio of a swarm loses messages. Expressions are stored as text; the program that
runs the mission checks them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import lru_cache
from math import isfinite
from pathlib import Path
from textwrap import dedent, indent
from typing import Literal, TypeAlias

from sleepcast.channel.message import LeaseAction
from sleepcast.core.errors import MisuseError, decimal_comma
from sleepcast.core.records import NamedTuple, dataclass
from sleepcast.core.settings import SettingsError, read_text
from sleepcast.core.ticks import tick_at
from sleepcast.core.units import TIME, UNITS, to_si
from sleepcast.robot import BodyConstant
from sleepcast.simulator.scenario.groups import filled

MAX_BYTES = 1_048_576
"""Bytes of one script, comments included."""
MAX_ORDERS = 1_000
"""Orders in one mission: what an operator types in a long day."""

SHOWN = 60
"""Characters of an order in a sentence about it."""

COUNTS = ("matched", "held", "not matched", "unknown", "fault", "silent")
"""What is counted of an order: robots that obeyed, those among them that STOP held, and so on."""
BOUNDS = ("exactly", "at least", "at most")

OrderKind: TypeAlias = Literal["once", "standing", "ask", "lease", "STOP", "RELEASE", "RELEASE ALL", "HOLD", "AWAY"]
_WORDLESS: dict[str, OrderKind] = {
    "STOP": "STOP",
    "RELEASE": "RELEASE",
    "RELEASE ALL": "RELEASE ALL",
    "HOLD": "HOLD",
    "AWAY": "AWAY",
}
_KINDS: dict[str, OrderKind] = {"once": "once", "standing": "standing", "ask": "ask"}
_ONE = r"(\d++(?:\.\d*+)?+|\.\d++)\s*([A-Za-z%/0-9]*)"
_TIME = re.compile(_ONE)
_TIMES = re.compile(rf"@({_ONE}(?:,{_ONE})*)(?=\s|$)")


class MissionError(MisuseError):
    """An error in a mission script; the text begins with the file and the line."""


_KIND = re.compile(r"(once|standing|ask)(?=\s)")
_WITHIN = re.compile(rf"within\s+{_ONE}(?=\s)")
_NAMED = re.compile(r"(only|but)\s+([^\s,();]+(?:,[^\s,();]+)*)(?=\s)")
_BY = re.compile(r"as\s+([^\s,();]+)(?=\s)")
_LEASE = re.compile(
    rf"lease\s+({'|'.join(LeaseAction)})\s+([^\s,();]+)(?:\s+to\s+([^\s,();]+))?(?:\s+for\s+{_ONE})?\s*(?:;.*)?"
)
LEASE_SECONDS = 60.0
"""For which a lease is had unless another time is said."""
_WANTED = re.compile(rf"({'|'.join(COUNTS)})\s+(?:({'|'.join(BOUNDS)})\s+)?([0-9]{{1,9}})")


@dataclass(frozen=True, slots=True)
class Wanted:
    """How many robots of which kind (one of `COUNTS`) there shall be when the run ends. bound: one of `BOUNDS`."""

    count: str
    number: int
    bound: str = "exactly"

    def met(self, number: int) -> bool:
        """Whether so many are enough, and not too many."""
        if self.bound == "exactly":
            return number == self.number
        return number >= self.number if self.bound == "at least" else number <= self.number

    def __str__(self) -> str:
        return f"{self.count} {'' if self.bound == 'exactly' else f'{self.bound} '}{self.number}"


@dataclass(frozen=True, slots=True)
class Order:
    """One expression to send at `time` (s since the start), with the words before it; `place` is its file and line, for
    errors. wanted: what shall have become of it when the run ends."""

    time: float
    text: str
    place: str
    wanted: tuple[Wanted, ...] = ()

    def in_short(self) -> str:
        """Its time and its text in one line, shortened, for a sentence about it."""
        return f"@{self.time:g}s {self.line()}"

    def line(self) -> str:
        """Its text in one line, shortened."""
        line = " ".join(self.text.split())
        return line if len(line) <= SHOWN else f"{line[: SHOWN - 1]}…"


class Instruction(NamedTuple):
    """What an order comes to.

    text: "" where there are no words; of a lease what is done about it
    within: s for which it is good, or for which the lease is had, None for the usual
    only, but: for these robots, or for all except these
    to: who is granted a lease
    by: the operator who sends it, "" for the first
    """

    kind: OrderKind
    text: str = ""
    within: float | None = None
    only: tuple[str, ...] | None = None
    but: tuple[str, ...] | None = None
    by: str = ""
    to: str = ""

    @property
    def is_expression(self) -> bool:
        """Whether robots evaluate its text."""
        return self.kind in _KINDS

    def written(self) -> str:
        """The text of the order that comes to this."""
        return f"as {self.by} {self._said()}" if self.by else self._said()

    def _said(self) -> str:
        if self.kind in _WORDLESS:
            return self.kind
        if self.kind == "lease":
            to, seconds = f" to {self.to}" if self.to else "", f" for {self.within!r}s" if self.within else ""
            return f"lease {self.text}{to}{seconds}"
        words: list[str] = [self.kind] if self.kind != "once" or not self.text.startswith("(") else []
        words += [f"within {self.within!r}s"] if self.within is not None else []
        words += [f"only {','.join(self.only)}"] if self.only is not None else []
        words += [f"but {','.join(self.but)}"] if self.but is not None else []
        line = "\n" if "\n" in self.text else " "
        return line.join((*([" ".join(words)] if words else []), self.text))


@lru_cache(maxsize=256)  # each is asked for several times, and in each run of a sweep
def instruction(order: Order) -> Instruction:
    """What an order comes to. Raises MissionError for words without an expression."""
    parsed, rest = Instruction("once"), order.text
    if match := _BY.match(rest):
        parsed, rest = parsed._replace(by=match[1]), rest[match.end() :].lstrip()
    if (whole := " ".join(_bare(rest).split())) in _WORDLESS:
        return parsed._replace(kind=_WORDLESS[whole])
    if match := _LEASE.fullmatch(rest.strip()):
        seconds = _seconds(match[4], match[5], order.place) if match[4] else None
        return parsed._replace(kind="lease", text=f"{match[1]} {match[2]}", to=match[3] or "", within=seconds)
    while True:
        if match := _KIND.match(rest):
            parsed = parsed._replace(kind=_KINDS[match[1]])
        elif match := _WITHIN.match(rest):
            parsed = parsed._replace(within=_seconds(match[1], match[2], order.place))
        elif match := _NAMED.match(rest):
            names = tuple(match[2].split(","))
            parsed = parsed._replace(only=names) if match[1] == "only" else parsed._replace(but=names)
        else:
            return parsed._replace(text=dedent(rest).strip())
        rest = rest[match.end() :].lstrip(" \t").removeprefix("\n")
        if not _bare(rest):
            raise MissionError(f"{order.place}: wanted an expression after {order.text.strip()[:40]}")


def after_end(orders: Iterable[Order], last: int, tick: float) -> list[Order]:
    """The orders that a run which ends with the tick `last` does not come to. tick: s in each."""
    return [order for order in orders if tick_at(order.time, tick) > last]


def written_mission(orders: Sequence[Order]) -> str:
    """The script of these orders, without comments; `parse_mission` gives the same ones."""
    lines = []
    for order in orders:
        one = "\n" not in order.text
        lines.append(f"@{order.time!r}s {order.text}" if one else f"@{order.time!r}s\n{indent(order.text, '    ')}")
        if order.wanted:
            lines.append(f"= {', '.join(map(str, order.wanted))}")
    return "".join(f"{line}\n" for line in lines)


def read_mission(path: Path, constants: Sequence[BodyConstant] = ()) -> tuple[Order, ...]:
    """The orders of the script at `path`, in time order, with the numbers of `constants` for their `{NAME}`. Raises
    MissionError."""
    try:
        text = read_text(path, MAX_BYTES, "a mission")
    except SettingsError as error:
        raise MissionError(str(error)) from error
    lines = []
    for number, line in enumerate(text.split("\n"), 1):
        words, semicolon, comment = line.partition(";")
        lines.append(f"{filled(words, constants, f'{path}:{number}')}{semicolon}{comment}")
    return parse_mission("\n".join(lines), str(path))


def parse_mission(text: str, name: str) -> tuple[Order, ...]:
    """The orders in `text`, in time order; errors show `name` as the file. Raises MissionError."""
    orders: list[tuple[tuple[float, ...], Order]] = []
    count = 0
    for number, line in enumerate(text.split("\n"), 1):
        place = f"{name}:{number}"
        if not line.partition(";")[0].strip():
            continue
        if line.startswith("="):
            if not orders:
                raise MissionError(f"{place}: wanted an order before what shall become of it")
            times, order = orders[-1]
            if len(times) > 1:
                raise MissionError(f"{place}: what is sent several times has several answers: write it once for each")
            orders[-1] = times, replace(order, wanted=order.wanted + _wanted(line, place))
        elif line.startswith("@"):
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
        instruction(order)
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
    times: list[float] = []
    for number, unit in _TIME.findall(match[1]):
        time = _seconds(number, unit, place, line.split()[0])
        if times and time <= times[-1]:
            raise MissionError(f"{place}: {time:g} s does not come after {times[-1]:g} s; sort an order's times")
        if time < before:
            raise MissionError(f"{place}: {time:g} s comes before the order above it ({before:g} s); sort them by time")
        times.append(time)
    return tuple(times), line[match.end() :].strip()


def _seconds(number: str, unit: str, place: str, shown: str = "") -> float:
    """A time in s. shown: as it stands in the script, if it is more than these two."""
    shown = shown or f"{number}{unit}"
    if unit.casefold() not in UNITS or UNITS[unit.casefold()].dimension != TIME:
        raise _no_time(shown, place)
    time = to_si(float(number), unit.casefold())
    if not isfinite(time):
        raise MissionError(f"{place}: {shown[:40]} is too far away")
    return time


def _wanted(line: str, place: str) -> tuple[Wanted, ...]:
    """What a line says that shall become of the order above it."""
    wanted = []
    for part in line[1:].partition(";")[0].split(","):
        match = _WANTED.fullmatch(part.strip())
        if match is None:
            raise MissionError(
                f"{place}: wanted counts such as = matched 98, unknown at most 3, not {part.strip()[:40]!r}; what is "
                f"counted: {', '.join(COUNTS)}"
            )
        wanted.append(Wanted(match[1], int(match[3]), match[2] or "exactly"))
    return tuple(wanted)


def _no_time(line: str, place: str) -> MissionError:
    word = line.split()[0]
    comma = decimal_comma(word.removeprefix("@"))
    return MissionError(f"{place}: wanted a time with its unit, such as @12.5s or @2min, not {word[:40]}{comma}")
