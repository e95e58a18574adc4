"""Where the journals of commands on the air lie, and the option that names another one."""

from __future__ import annotations

from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar
from urllib.parse import quote

import click

from sleepcast.core.files import data_folder

if TYPE_CHECKING:
    from sleepcast.station.journal.sqlite import LateJournal

LONGEST = 200
"""Bytes of a file's name for a fleet, so that the names of its archives fit into 255."""

HASTE = 0.25
"""Seconds that a desk waits for another writer: it has robots to hear, and writes later what it could not."""

Command = TypeVar("Command", bound=Callable[..., object])


def journal_option(command: Command) -> Command:
    """`--journal FILE`, as `journal`."""
    option = click.option(
        "--journal",
        metavar="FILE",
        type=click.Path(path_type=Path),
        help="The journal, if not the fleet's own in your data.",
    )
    return option(command)


def journal_of(fleet: str) -> Path:
    """The file of a fleet's own journal."""
    name = quote(fleet, safe=" ")
    return data_folder() / "journals" / f"{name if len(name) <= LONGEST else sha256(fleet.encode()).hexdigest()}.db"


def opened(journal: Path | None, fleet: str) -> LateJournal:
    """A journal for a desk to write to: the file, or that of the fleet."""
    from sleepcast.core.clock import UnixClock
    from sleepcast.station.journal.sqlite import LateJournal

    return LateJournal(journal or journal_of(fleet), UnixClock(), HASTE)
