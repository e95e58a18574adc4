"""Where stores lie: a robot's, as the command line says it, and an operator's."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from sleepcast.core.errors import MisuseError

if TYPE_CHECKING:
    from sleepcast.node.store import Store

MAX_LIVES = 16
"""Processes of one operator at a time whose lives go on; one more begins a new life."""

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
    from sleepcast.core.clock import UnixClock
    from sleepcast.node.store import Store

    return Store(file, UnixClock(), say)


def operator_store(fleet: str, owner: str, say: Callable[[str], None]) -> Store | None:
    """Where an operator's life goes on: the first of his stores that no other process of his uses. None if he must
    begin a new one, because nothing can be written."""
    from sleepcast.node.store import InUseError, StoreError

    for number in range(1, MAX_LIVES + 1):
        try:
            store = open_store(_file("operators", fleet, f"{owner}-{number}"), say)
        except InUseError:
            continue
        except StoreError as error:
            say(f"{error}. Until then what is sent begins a new life, as if nothing had been sent before")
            return None
        if store.lasts:
            return store
        store.close()
        return None
    return None


def _file(what: str, fleet: str, name: str) -> Path:
    from urllib.parse import quote

    from sleepcast.core.files import data_folder

    # A leading point would hide the file, or name a folder.
    return data_folder() / what / f"_{quote(fleet, safe='')}" / f"_{quote(name, safe='')}.store"


def chosen_store(file: Path | None, forgetful: bool, fleet: str, name: str, on_air: bool) -> Path | None:
    """Where the store of a robot lies: where it was said, else, if it hears a channel, in the person's own data. None
    for no store. Raises MisuseError if both are asked for."""
    if forgetful:
        if file is not None:
            raise MisuseError("--store and --no-store do not go together: leave one of them out")
        return None
    if file is not None or not on_air:
        return file
    return _file("robots", fleet, name)
