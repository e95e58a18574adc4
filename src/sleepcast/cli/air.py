"""The options of a subcommand on the air: which channel, fleet, keys, journal and store."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from pathlib import Path
from typing import TypeVar

import click

from sleepcast.api.connection import CHANNEL, FLEET, AirOptions, store_file
from sleepcast.cli.options import NumberRange, QuantityType
from sleepcast.core.errors import MisuseError
from sleepcast.core.units import TIME

MAX_SKEW = 3_600.0
"""s that others' clocks may be wrong at most."""

Command = TypeVar("Command", bound=Callable[..., object])


expect_option = click.option(
    "--expect",
    metavar="N|FILE",
    help="Robots of the fleet: their number, or a file of their names. Those never heard then count as "
    "silent. Else what `roster --expect` has stored.",
)


def with_keys(command: Callable[..., int]) -> Callable[..., int]:
    """The options that say which key is ours and whom it believes: the command gets `air`, an `AirOptions` with no
    channel yet."""

    @click.option("--fleet", default=FLEET, show_default=True, help="The fleet; messages of other fleets are ignored.")
    @click.option("--key", metavar="OWNER", help="Key to sign with (default: that of `keys use`).")
    @click.option("--trust", type=click.Path(path_type=Path), help="The file of trusted keys.")
    @click.option("--keys", "folder", type=click.Path(path_type=Path), help="Folder of the keys.")
    @click.option(
        "--skew",
        metavar="TIME",
        type=QuantityType(TIME, 0.0, MAX_SKEW),
        help="How much others' clocks may be wrong (default: 2s).",
    )
    @click.option("--rate", metavar="N", type=NumberRange(1.0), help="Signatures of a key checked in a second.")
    @wraps(command)
    def with_air(
        fleet: str,
        key: str | None,
        trust: Path | None,
        folder: Path | None,
        skew: float | None,
        rate: float | None,
        **others: object,
    ) -> int:
        return command(air=AirOptions("", fleet, key, trust, folder, skew=skew, rate=rate), **others)

    return with_air


def operator(command: Callable[..., int]) -> Callable[..., int]:
    """A command of an operator on the air: it gets an `AirOptions` and `as_json` besides what is its own."""
    return on_air(
        click.option("--json", "as_json", is_flag=True, help="Print the account as one JSON object.")(command)
    )


def on_air(command: Callable[..., int]) -> Callable[..., int]:
    """The same without `as_json`."""

    @click.option("--channel", metavar="URI", default=CHANNEL, show_default=True, help="The channel.")
    @with_keys
    @expect_option
    @click.option(
        "--within",
        metavar="TIME",
        type=QuantityType(TIME, 0.0, 60.0),
        help="Time for answers (default: one millisecond per robot).",
    )
    @journal_option
    @wraps(command)
    def with_channel(
        air: AirOptions,
        channel: str,
        within: float | None,
        journal: Path | None,
        expect: str | None,
        **others: object,
    ) -> int:
        return command(air=replace(air, channel=channel, within=within, journal=journal, expect=expect), **others)

    return with_channel


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
    """Where the store of a robot lies; None for no store. Raises MisuseError if both a file and none are asked for.

    file: where it was said to lie.
    forgetful: whether there is to be none.
    on_air: whether the robot hears a channel: then it has one in the person's own data, unless something else is said.
    """
    if forgetful:
        if file is not None:
            raise MisuseError("--store and --no-store do not go together: leave one of them out")
        return None
    if file is not None or not on_air:
        return file
    return store_file("robots", fleet, name)
