"""Where a robot's store lies, as the command line says it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from sleepcast.errors import MisuseError

if TYPE_CHECKING:
    from sleepcast.node.store import Store

store_option = click.option(
    "--store",
    "file",
    metavar="FILE",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Where it lies what outlives a restart: rules, groups, STOP, what was heard and done.",
)
no_store_option = click.option("--no-store", "forgetful", is_flag=True, help="Let nothing outlive a restart.")


def open_store(file: Path, say: Callable[[str], None]) -> Store:
    """The store in a file; see `Store`."""
    from sleepcast.clock import UnixClock
    from sleepcast.node.store import Store

    return Store(file, UnixClock(), say)


def chosen_store(file: Path | None, forgetful: bool, fleet: str, name: str, on_air: bool) -> Path | None:
    """Where the store of a robot lies: where it was said, else, if it hears a channel, in the person's own data. None
    for no store. Raises MisuseError if both are asked for."""
    from urllib.parse import quote

    from sleepcast.files import data_folder

    if forgetful:
        if file is not None:
            raise MisuseError("--store and --no-store do not go together: leave one of them out")
        return None
    if file is not None or not on_air:
        return file
    # A leading point would hide the file, or name a folder.
    return data_folder() / "robots" / f"_{quote(fleet, safe='')}" / f"_{quote(name, safe='')}.store"
