"""Options of what holds bodies back, whatever a mind wants of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import click

Command = TypeVar("Command", bound=Callable[..., object])


def restraints(command: Command) -> Command:
    """The options of a lease on being driven, and of limits: the command gets `lease` and `limits`."""
    limits = click.option(
        "--limits", metavar="FILE", type=click.Path(path_type=Path), help="Limits of the bodies that nothing passes."
    )
    lease = click.option(
        "--lease",
        metavar="TIME|off",
        default="1s",
        show_default=True,
        help="How long a driven body goes on unattended.",
    )
    return lease(limits(command))
