"""`sleepcast stop`: stop every robot on the air, and go on until each of them has confirmed it and is at rest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from math import inf
from typing import TYPE_CHECKING

import click

from sleepcast.api.connection import AirOptions, expectation, station_for
from sleepcast.cli.account import FEW, listed, show_account
from sleepcast.cli.air import operator
from sleepcast.cli.interrupts import Interrupts, Terminated
from sleepcast.cli.options import QuantityType
from sleepcast.cli.progress import Status
from sleepcast.cli.streams import complain, somebody_there
from sleepcast.core.errors import MisuseError, counted, printable

if TYPE_CHECKING:
    from sleepcast.station.network import NetworkStation
    from sleepcast.station.roster import Expectation
    from sleepcast.station.sent import Command

GRACE = 1.0
"""Seconds after the time for answers for which they are taken while no robots are known."""
UNWATCHED = 10.0
"""Seconds after which a STOP gives up on silent robots where it is not known which robots there are, and no person at a
terminal could give up."""
PATIENCE = 2.0
"""Seconds without any answer after which the possible reasons are printed."""
PAUSE = 0.05
"""Seconds between two looks at what has come, and whether a person wants to end it."""
STRANGERS = 4
"""Unknown keys on the air that are printed, those with the most messages."""
NOT_LASTING = "STOP could not be stored everywhere, so a restart may forget it"
CONFLICT = "several robots have one name, so no account by names is sure: give each a name of its own"
ENDED = "they may move, and what they said of this STOP holds no more"
NAMED = 3
"""Silent robots that are named while it goes on; the account at the end names more."""


@click.command("stop")
@click.option(
    "--timeout",
    "--seconds",
    "seconds",
    metavar="TIME",
    type=QuantityType(),
    help="Give up on silent robots after this time (default: at Ctrl-C).",
)
@click.option("--accepted", is_flag=True, help="End when all robots have accepted STOP, at rest or not.")
@operator
def stop(air: AirOptions, seconds: float | None, accepted: bool, as_json: bool) -> int:
    """Stop every robot that receives it, and keep it stopped until `sleepcast release`. Any trusted key may do so.

    STOP is repeated until every robot that is expected (--expect, `sleepcast roster --expect`) or was ever heard has
    confirmed it, or until Ctrl-C. Without a terminal, and without a list of expected robots, it gives up after ten
    seconds. A robot that confirms STOP brakes, which takes its time: the command goes on until those that tell their
    speed are at rest, for 30 seconds at most, and says how far each may still go. With --accepted it does not wait for
    that. The exit status is 0 only if all robots confirm that they have stopped, and stay so over a restart, none
    says that it still moves, and each has a name of its own.

    \b
    Examples:
      sleepcast stop
      sleepcast stop --accepted
      sleepcast stop --expect 100
      sleepcast stop --timeout 30s --json
    """
    with Interrupts() as interrupts:
        interrupts.defer()  # STOP goes out whatever comes
        expected, sure = _expected(air)
        with station_for(air, complain, expected=expected) as station:
            sent = station.stop()
            complain(f"STOP goes out with {_our_key(station)}")
            patience = inf if somebody_there() or expected else UNWATCHED
            until = sent.message.issued + (patience if seconds is None else seconds)
            try:
                _insist(station, sent, until, interrupts.check)
                if not accepted:
                    _await_rest(station, sent, interrupts.check)
            except (KeyboardInterrupt, Terminated) as error:
                complain(f"ended by {str(error) or 'Ctrl-C'}; STOP is not sent any more")
            account = station.accounting(sent.id)
            show_account(sent, account, as_json, station.vocabulary)
            if sent.ended_by:
                complain(printable(f"{sent.ended_by} has released the robots meanwhile: {ENDED}"))
            if not account.complete:
                complain(f"not confirmed by {account.n_silent} {account.scope}")
            if account.conflicts:
                complain(f"{CONFLICT}: {listed('names', tuple(account.conflicts))}")
            if account.n_not_stored:
                complain(
                    f"{NOT_LASTING}: keep {counted(account.n_not_stored, 'robot')} powered, or in sight, until RELEASE"
                )
            moving = 0 if accepted or sent.ended_by or account.rest is None else account.rest.n_stopping
            if moving and account.rest is not None:
                complain(f"not at rest: {account.rest.who_moves(station.vocabulary, FEW)}")
        wrong = account.conflicts or account.n_not_stored or account.flawed or moving or sent.ended_by
        sound = account.complete and account.n_matched and not wrong
        return 0 if sure and sound else 1


def _expected(air: AirOptions) -> tuple[Expectation, bool]:
    """Which robots there are, and whether that is known as it was meant: STOP waits for no file."""
    from sleepcast.station.roster import NOBODY_SAID

    try:
        return expectation(air), True
    except MisuseError as error:
        complain(f"{error}. STOP is sent all the same, and counts only robots heard so far")
        return NOBODY_SAID, False


def _insist(station: NetworkStation, sent: Command, until: float, check: Callable[[], None]) -> None:
    """Go on until everybody has confirmed, or it is time to give up, telling how far it has come. check: raises what
    ends it early."""
    nobody = not (sent.size or sent.addressed)
    until = min(until, station.answered(sent) + GRACE) if nobody else until
    from sleepcast.station.retransmission import SETTLE

    reasons = sent.message.issued + PATIENCE
    with Status() as status:

        def confirmed() -> bool:
            nonlocal reasons
            check()
            account = station.accounting(sent.id)
            silent_names = printable(", ".join(account.first_silent(NAMED)))
            silent = f"silent {account.n_silent} {account.scope}{silent_names and f': {silent_names}'}"
            status.show(f"stopped {account.n_matched}, {silent}")
            if not account.n_matched and station.now >= reasons:
                reasons = inf
                _tell_reasons(station, status.clear)
            answered = station.listened >= station.answered(sent) + SETTLE  # others of the same names, too
            return (not (sent.n_silent or nobody or station.is_deciding) and answered) or station.is_over(sent)

        station.wait_until(confirmed, until, PAUSE)
        if not sent.answers and reasons < inf:
            _tell_reasons(station, status.clear)


def _await_rest(station: NetworkStation, sent: Command, check: Callable[[], None]) -> None:
    """Go on until nobody who has confirmed says that it still moves, as long as the desk asks them, telling how far
    they may still go. check: raises what ends it early."""
    from sleepcast.station.rest import REST_SECONDS

    with Status() as status:

        def rests() -> bool:
            check()
            rest = sent.resting
            moving = rest.who_moves(station.vocabulary, NAMED)
            status.show(f"at rest {rest.n_at_rest}, still moving {rest.n_stopping}{moving and f': {moving}'}")
            return not rest.n_stopping or bool(sent.ended_by)

        station.wait_until(rests, max(sent.answers.latest, sent.message.issued) + REST_SECONDS, PAUSE)


def _our_key(station: NetworkStation) -> str:
    delivery = station.session.delivery
    return printable(f"the key of {delivery.name} ({delivery.role}, {delivery.key_id.hex()})")


def _tell_reasons(station: NetworkStation, clear: Callable[[], None]) -> None:
    clear()
    for reason in _reasons(station):
        complain(printable(reason))


def _reasons(station: NetworkStation) -> Iterator[str]:
    """Possible reasons why no robot answered, certain ones first."""
    from sleepcast.channel.drops import DropReason
    from sleepcast.channel.message import Role
    from sleepcast.cli.describe import heard_text

    delivery = station.session.delivery
    drops, keys = delivery.admission.drops, [key for key in delivery.admission.trust.keys if not key.revoked]
    yield f"no robot has confirmed STOP yet: {heard_text(delivery.admission)}"
    yield from (f"  {notice}" for notice in station.notices())
    strangers = {
        key.hex(): count for (key, why), count in drops.by_key.items() if why is DropReason.UNKNOWN_KEY and key
    }
    for key, count in Counter(strangers).most_common(STRANGERS):
        yield f"  somebody is there under key {key}, which our trust file does not know: {count} messages"
    if all(key.id != delivery.key_id for key in keys):
        yield f"  our own trust file does not believe {_our_key(station)}: perhaps robots do not, either"
    if all(key.role is not Role.ROBOT for key in keys):
        yield "  our trust file knows no robot's key, so that no answer is believed (sleepcast keys trust)"
    yield (
        f"  a robot obeys only if it trusts {_our_key(station)}, is of the fleet {delivery.admission.fleet!r}, "
        "and hears this channel; see --key, --fleet and --channel"
    )
