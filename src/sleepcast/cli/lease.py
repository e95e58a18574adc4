"""`sleepcast lease`: who alone may command the robots of a group."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from sleepcast.api.connection import AirOptions, observing_station
from sleepcast.cli.air import operator
from sleepcast.cli.options import QuantityType
from sleepcast.cli.send import GRACE, gathered
from sleepcast.cli.streams import complain
from sleepcast.core.errors import printable

if TYPE_CHECKING:
    from sleepcast.channel.message import LeaseAction
    from sleepcast.station.network import NetworkStation

SECONDS = "60s"
"""For which a lease is had unless another time is said: long enough for a task, short enough to be waited for."""
ACTIONS = ("take", "give", "request", "grant", "force")


@click.command("lease")
@click.argument("action", type=click.Choice(ACTIONS))
@click.argument("group")
@click.option(
    "--seconds",
    metavar="TIME",
    type=QuantityType(),
    default=SECONDS,
    show_default=True,
    help="For how long.",
)
@click.option("--to", default="", metavar="NAME", help="The operator to grant it to.")
@click.option("--keep", is_flag=True, help="Renew it until Ctrl-C, then give it back.")
@operator
def lease(action: str, group: str, seconds: float, to: str, keep: bool, air: AirOptions, as_json: bool) -> int:
    """Control a GROUP exclusively: while you hold its lease, its robots refuse other operators' commands, and tell them
    why. Everybody may always send STOP and questions. Leases do not affect commanders' standing commands.

    \b
    take     take or renew it, which never shortens it; refused while another operator holds it
    give     give it back
    request  like take, and tell its holder that you ask for it
    grant    hand it to another operator (--to NAME)
    force    take it from its holder; for commanders

    \b
    Examples:
      sleepcast lease take bravo --seconds 5min
      sleepcast lease take bravo --keep
      sleepcast lease grant bravo --to bert
    """
    from sleepcast.channel.message import LeaseAction
    from sleepcast.station.leases import doubt_of

    if keep and action not in ("take", "request", "force"):
        raise click.UsageError("--keep goes with take, request and force")
    with observing_station(air, complain) as (station, _):
        if doubt := doubt_of(group, station.learned):
            complain(doubt)
        status = _done(station, LeaseAction(action), group, seconds, to, as_json)
        if keep and status == 0:
            _keep(station, group, seconds, as_json)
        return status


def _done(station: NetworkStation, action: LeaseAction, group: str, seconds: float, to: str, as_json: bool) -> int:
    """Send it, and print the account; gives the exit status, 1 if no robot answered."""
    sent = station.lease(action, group, seconds, to)
    status = gathered(station, sent, GRACE, as_json)
    return status if len(sent.answers) else 1


def _keep(station: NetworkStation, group: str, seconds: float, as_json: bool) -> None:
    """Renew the lease until Ctrl-C, telling what others say about it; then give it back."""
    from sleepcast.channel.message import LeaseAction
    from sleepcast.station.leases import describe_request

    complain(f"{group} is yours until Ctrl-C")
    renewed = station.now
    try:
        while True:
            station.wait(0.1)
            while station.news:
                if request := describe_request(station.news.popleft()):
                    complain(printable(request))
            if station.now - renewed >= seconds / 3.0:
                renewed = station.now
                sent = station.lease(LeaseAction.TAKE, group, seconds)
                station.gather(sent, GRACE)
                account = station.accounting(sent.id)
                if account.n_fault:
                    complain(printable(f"{group} is not all yours: {next(iter(account.faults.values()))}"))
    finally:
        _done(station, LeaseAction.GIVE, group, 0.0, "", as_json)
