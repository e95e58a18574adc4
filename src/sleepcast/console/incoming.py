"""Messages from the page, each a bounded, exact shape: what does not fit is refused with a sentence.

Here is what all of them have in common, and those that go the shortest way; the others are in `features/`. `serial`
numbers a question; the answer carries it back. Messages without one get no answer.
"""

from __future__ import annotations

from typing import Annotated, TypeVar

import msgspec
from msgspec import Meta

from sleepcast.core.errors import MisuseError

MAX_BYTES = 131_072
"""Of one message: the longest expression, every character escaped, fits."""
MAX_FACTOR = 10_000.0
"""Simulated seconds in a second that may be wanted; no machine reaches it, so it means as fast as possible."""
MIN_FACTOR = 0.01
"""The slowest motion in which anything is still seen to move."""

Serial = Annotated[int, Meta(ge=1, le=2**53 - 1)]
Text = Annotated[str, Meta(max_length=16_384)]
Number = Annotated[int, Meta(ge=1, le=2**53 - 1)]
Id = Annotated[str, Meta(max_length=160)]
Operator = Annotated[str, Meta(max_length=64)]
Metres = Annotated[float, Meta(ge=-1e7, le=1e7)]
T = TypeVar("T")
Index = Annotated[int, Meta(ge=-1, le=10_000_000)]
Expression = Annotated[str, Meta(max_length=2_000)]
Place = Annotated[int, Meta(ge=0, le=2**31 - 1)]


class PageMessage(msgspec.Struct, forbid_unknown_fields=True, tag_field="type", tag=str.lower):
    """Anything that the page says."""


class Stop(PageMessage):
    """Stop every body. by: the operator as whom, "" for the first."""

    by: Operator = ""


class Release(PageMessage):
    """End STOP. by: the operator as whom, "" for the first."""

    by: Operator = ""


class Drawn(PageMessage):
    """The frame with this number is on the screen."""

    number: Annotated[int, Meta(ge=0, le=2**32 - 1)]


AT_ONCE: tuple[type[PageMessage], ...] = (Stop, Release, Drawn)
"""What is no question, and goes the shortest way."""


class PageMessageError(MisuseError):
    """Something from the page that is no message."""


def read(decoder: msgspec.json.Decoder[T], data: str | bytes) -> T:
    """The message in `data` as `decoder` knows it. Raises PageMessageError."""
    try:
        return decoder.decode(data)
    except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
        raise PageMessageError(f"not a message of this page: {error}") from None


def serial_in(data: str | bytes) -> int | None:
    """The serial number of something that is otherwise no message, so that its sender hears of it."""
    try:
        return msgspec.json.decode(data, type=_Numbered).serial
    except (msgspec.DecodeError, UnicodeError, RecursionError):
        return None


class _Numbered(msgspec.Struct):
    serial: Serial
