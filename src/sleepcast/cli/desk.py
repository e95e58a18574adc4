"""`sleepcast desk`: a full-screen desk in a terminal, for robots on the air."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

import click

from sleepcast.api.connection import AirOptions, observing_station
from sleepcast.cli.air import on_air
from sleepcast.cli.options import QuantityType
from sleepcast.cli.streams import complain
from sleepcast.core.errors import MisuseError
from sleepcast.core.units import TIME

if TYPE_CHECKING:
    from sleepcast.cli.tui.session import TuiSession

LOOK_EVERY = "2s"
"""Between two looks at the robots, unless another time is said: often enough for a preview."""
DUMB = frozenset({"", "dumb", "unknown"})
"""Terminals that cannot put a letter where it is wanted."""


@click.command("desk")
@click.option(
    "--look",
    metavar="TIME",
    type=QuantityType(TIME, 0.0, 3600.0),
    default=LOOK_EVERY,
    show_default=True,
    help="Time between two telemetry requests; 0: only on :look.",
)
@on_air
def desk(look: float, air: AirOptions) -> int:
    """Command robots from a terminal, also over ssh: while you type, it counts who would obey; every command is
    accounted for; F9 stops every robot at once.

    F1 shows the keys. What is sent and heard is written into the fleet's journal (`sleepcast journal`).

    \b
    Examples:
      sleepcast desk
      sleepcast desk --channel udp://192.168.1.255:47123 --key desk --look 5
    """
    _check_terminal()
    import asyncio

    from sleepcast.cli.tui.screen import Screen
    from sleepcast.cli.tui.session import TuiSession

    with observing_station(air, complain) as (station, telemetry):
        session = TuiSession(station, telemetry, look)
        try:
            asyncio.run(Screen(session, air.channel).run())
        except EOFError:
            complain("the terminal is gone, so the desk has ended")
        finally:
            _tell_end(session)
    return 0


def _check_terminal() -> None:
    """Raises MisuseError where there is no terminal that can show a desk."""
    instead = "use sleepcast send, watch and stop instead, which need none"
    if not all(stream is not None and stream.isatty() for stream in (sys.stdin, sys.stdout)):
        raise MisuseError(f"the desk needs a terminal: {instead}")
    if os.environ.get("TERM", "") in DUMB:
        raise MisuseError(f"this terminal (TERM={os.environ.get('TERM', '')}) cannot show the desk: {instead}")


def _tell_end(session: TuiSession) -> None:
    """Leave behind on the plain screen what became of a STOP."""
    from sleepcast.channel import Kind
    from sleepcast.cli.account import FEW

    latch = session.latch
    if latch is not None and latch.kind is Kind.STOP:
        account = session.station.accounting(latch.id)
        complain(f"STOP holds: stopped {account.n_matched}, {account.silence(FEW)}; sleepcast release ends it")
