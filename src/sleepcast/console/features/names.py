"""The names that a text may use, for whoever completes one."""

from __future__ import annotations

from typing import Protocol

from sleepcast.console.completion import ShownName
from sleepcast.console.feature import answers, run_again
from sleepcast.console.incoming import PageMessage, Serial
from sleepcast.console.outgoing import DeskMessage


class GetNames(PageMessage, tag="names"):
    """The names that a text may use, with the ranges of their values now."""

    serial: Serial


class Named(DeskMessage):
    """The names that a text may use now."""

    serial: int
    names: list[ShownName]


class NameSource(Protocol):
    """Robots that know names."""

    def known_names(self) -> list[ShownName]:
        """The names that a text may use, with the ranges of their values now."""


@answers(then=run_again)
def known_names(source: NameSource, asked: GetNames) -> Named:
    """The names that a text may use."""
    return Named(asked.serial, source.known_names())
