"""Options that several subcommands share: times, a page's hosts, what minds begin with, limits of bodies."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from math import inf, isnan
from pathlib import Path
from typing import TypeVar

import click

from sleepcast.core.errors import decimal_comma
from sleepcast.core.given_numbers import MAX_SEED
from sleepcast.core.memory import read_size
from sleepcast.core.quantities import QuantityError, in_si
from sleepcast.core.units import LENGTH, TIME, Dimension

METAVARS = {TIME: "TIME", LENGTH: "LENGTH"}
"""What help pages show for a value of a dimension."""
SEED = click.IntRange(0, MAX_SEED)
_NEGATIVE_NUMBER = re.compile(r"-\.?[0-9]")


class NegativeNumbersAllowed(click.Command):
    """A command whose arguments may begin with a minus sign and a digit without being taken for options."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As click does it; a blank before such an argument keeps it from looking like an option."""
        return super().parse_args(ctx, [f" {arg}" if _NEGATIVE_NUMBER.match(arg) else arg for arg in args])


class NumberRange(click.FloatRange):
    """A number between two bounds; not "nan", which lies between any two. suffix: what people write behind it, such as
    the x of 30x, and may leave out."""

    def __init__(self, low: float | None = None, high: float | None = None, *, suffix: str = "") -> None:
        super().__init__(low, high)
        self._suffix = suffix

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> float:
        if comma := decimal_comma(value):
            self.fail(f"{str(value)[:40]!r} is not a number{comma}", param, ctx)
        written = value.strip().removesuffix(self._suffix) if isinstance(value, str) else value
        number: float = super().convert(written, param, ctx)  # type: ignore[arg-type]  # takes a text, too
        if isnan(number):
            self.fail(f"wanted a number, not {str(value)[:40]!r}", param, ctx)
        return number


class QuantityType(click.ParamType):  # type: ignore[type-arg]  # takes one only where click is new
    """A value with its unit, or a plain number in SI, as in files and in Python; gives SI. low, high: bounds, SI."""

    def __init__(self, dimension: Dimension = TIME, low: float = 0.0, high: float = inf) -> None:
        self.name = METAVARS[dimension].lower()
        self._wanted = dimension, low, high

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> float:
        try:
            return in_si(value.strip() if isinstance(value, str) else value, *self._wanted)
        except QuantityError as error:
            self.fail(str(error), param, ctx)


class ByteSize(click.ParamType):  # type: ignore[type-arg]  # as above
    """A size with its unit, between two bounds in bytes; gives bytes."""

    name = "size"

    def __init__(self, least: int, most: int) -> None:
        self._least, self._most = least, most

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> int:
        if isinstance(value, int):
            return value
        size = read_size(str(value))
        if size is None:
            self.fail(f"wanted a size such as 300MB or 2GB, not {str(value)[:40]!r}", param, ctx)
        if not self._least <= size <= self._most:
            self.fail(
                f"wanted {self._least / 1e6:g} MB to {self._most / 1e9:g} GB, not {str(value)[:40]!r}", param, ctx
            )
        return round(size)


class MomentType(click.ParamType):  # type: ignore[type-arg]  # as above
    """A moment: so long ago, a time of today, or a date with or without a time, local unless it says otherwise; gives
    s of Unix time."""

    name = "moment"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> float:
        if isinstance(value, float):
            return value
        text = str(value).strip()
        with suppress(QuantityError):
            return time.time() - in_si(text, TIME, 0.0)
        when = _moment(text)
        if when is None:
            comma = decimal_comma(text)
            self.fail(f"wanted 10min, 14:30 or 2026-11-21T14:30, not {text[:40]!r}{comma}", param, ctx)
        return when


def _moment(text: str) -> float | None:
    today = datetime.now().strftime("%Y-%m-%dT")
    for written in (text, today + text):
        try:
            return datetime.fromisoformat(written).timestamp()
        except (ValueError, OverflowError, OSError):
            continue
    return None


allow_host_option = click.option(
    "--allow-host",
    "allow",
    metavar="NAME",
    multiple=True,
    help="Page: an extra allowed Host name, as robots.local or robots.local:80; may be repeated.",
)


Command = TypeVar("Command", bound=Callable[..., object])


alert_option = click.option(
    "--alert",
    "alerts",
    metavar="TEST",
    multiple=True,
    help='Page: raise an alert when this becomes true for a robot, as "(< fuel 20%)"; may be repeated.',
)


LONGEST_TICK = 0.5
"""s: a body that its mind does not look at for a second is brought to rest."""
tick_option = click.option(
    "--tick",
    metavar="TIME",
    type=QuantityType(TIME, 0.01, LONGEST_TICK),
    default="0.1s",
    show_default=True,
    help="How long a tick lasts.",
)
each_rules_option = click.option(
    "--rules", metavar="FILE", type=click.Path(path_type=Path), help="Expressions that each robot starts with."
)
locked_option = click.option(
    "--golden",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Locked rules, which cannot be changed over the air.",
)


def every_option(what: str) -> Callable[[Command], Command]:
    """How often robots are asked: the command gets `every`, s. what: between two of which."""
    return click.option(
        "--every",
        metavar="TIME",
        type=QuantityType(TIME, 0.2, 60.0),
        default="1s",
        show_default=True,
        help=f"Time between two {what}.",
    )


def restraints(command: Command) -> Command:
    """The options of a lease on being driven, of limits, and of what robots have each other do: the command gets
    `lease`, `limits` and `tells`."""
    limits = click.option(
        "--limits", metavar="FILE", type=click.Path(path_type=Path), help="Safety limits of the bodies."
    )
    lease = click.option(
        "--lease",
        metavar="TIME|off",
        default="1s",
        show_default=True,
        help="How long a driven body keeps moving without hearing an operator.",
    )
    tells = click.option(
        "--tells",
        type=click.Choice(["none", "marks", "all"]),
        default="all",
        show_default=True,
        help="What other robots may have it do by TELL: nothing; set marks, variables and groups; all.",
    )
    return lease(limits(tells(command)))
