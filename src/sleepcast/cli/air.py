"""The options of a subcommand that gets onto the air: which channel, fleet, keys, journal and store."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TypeVar

import click

from sleepcast.api.connection import CHANNEL, FLEET, AirOptions, store_file
from sleepcast.cli.options import NumberRange, QuantityType
from sleepcast.core.errors import MisuseError
from sleepcast.core.units import TIME

MOST_SKEW = 3_600.0
"""s that others' clocks may be wrong at most."""

Command = TypeVar("Command", bound=Callable[..., object])


expect_option = click.option(
    "--expect",
    metavar="N|FILE",
    help="Robots of the fleet: their number, or a file of their names. Those never heard then count as "
    "silent. Else what `roster --expect` keeps.",
)


def options(command: Command) -> Command:
    """The options that say which key is ours and whom it believes: the command gets `fleet`, `key`, `trust`, `folder`,
    `skew` and `rate`."""
    for option in (
        click.option("--rate", metavar="N", type=NumberRange(1.0), help="Signatures of a key checked in a second."),
        click.option(
            "--skew",
            metavar="TIME",
            type=QuantityType(TIME, 0.0, MOST_SKEW),
            help="How much others' clocks may be wrong (default: 2s).",
        ),
        click.option("--keys", "folder", type=click.Path(path_type=Path), help="Folder of the keys."),
        click.option("--trust", type=click.Path(path_type=Path), help="The file of trusted keys."),
        click.option("--key", metavar="OWNER", help="Key to sign with (default: that of `keys use`)."),
        click.option(
            "--fleet", default=FLEET, show_default=True, help="The fleet; messages of other fleets are ignored."
        ),
    ):
        command = option(command)
    return command


def operator(command: Callable[..., int]) -> Callable[..., int]:
    """A command of an operator on the air: it gets an `AirOptions` and `as_json` besides what is its own."""
    return on_air(
        click.option("--json", "as_json", is_flag=True, help="Print the account as one JSON object.")(command)
    )


def on_air(command: Callable[..., int]) -> Callable[..., int]:
    """The same without `as_json`."""

    @click.option("--channel", metavar="URI", default=CHANNEL, show_default=True, help="The channel.")
    @options
    @expect_option
    @click.option(
        "--within",
        metavar="TIME",
        type=QuantityType(TIME, 0.0, 60.0),
        help="Time for answers (default: one millisecond per robot).",
    )
    @journal_option
    @wraps(command)
    def placed(
        channel: str,
        fleet: str,
        key: str | None,
        trust: Path | None,
        folder: Path | None,
        within: float | None,
        journal: Path | None,
        skew: float | None,
        rate: float | None,
        expect: str | None,
        **others: object,
    ) -> int:
        return command(
            air=AirOptions(channel, fleet, key, trust, folder, within, journal, skew, rate, expect), **others
        )

    return placed


def journal_option(command: Command) -> Command:
    """`--journal FILE`, as `journal`."""
    option = click.option(
        "--journal",
        metavar="FILE",
        type=click.Path(path_type=Path),
        help="The journal (default: the fleet's own in your data).",
    )
    return option(command)


store_option = click.option(
    "--store",
    "file",
    metavar="FILE",
    type=click.Path(path_type=Path, dir_okay=False),
    help="File for state that survives a restart: rules, groups, STOP, commands received.",
)
no_store_option = click.option("--no-store", "forgetful", is_flag=True, help="Keep no state across restarts.")


def chosen_store(file: Path | None, forgetful: bool, fleet: str, name: str, on_air: bool) -> Path | None:
    """Where the store of a robot lies: where it was said, else, if it hears a channel, in the person's own data. None
    for no store. Raises MisuseError if both are asked for."""
    if forgetful:
        if file is not None:
            raise MisuseError("--store and --no-store do not go together: leave one of them out")
        return None
    if file is not None or not on_air:
        return file
    return store_file("robots", fleet, name)
