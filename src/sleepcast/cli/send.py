"""`sleepcast send`, `ask`, `stop` and `release`: one message to robots on the air, and what became of it."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING

import click

from sleepcast.cli.account import as_dict, silence, told
from sleepcast.cli.air import Air, operator, station_for
from sleepcast.cli.evaluate import NegativeNumbersAllowed
from sleepcast.cli.streams import complain, put

if TYPE_CHECKING:
    from sleepcast.station.accounting import Command
    from sleepcast.station.aired import AirStation

GRACE = 1.0
"""Seconds after the time for answers for which they are still taken: for a robot's tick, and for repairs."""
PATIENCE = 2.0
"""The same for a question, which is asked again where its answer was lost."""
UNWATCHED = 10.0
"""Seconds after which a STOP gives up on silent robots where nobody sits at a terminal who could."""
TELL_EVERY = 1.0
"""Seconds between two sentences on how far a STOP has come."""


@click.command("send", cls=NegativeNumbersAllowed, short_help="Send an expression to robots on the air.")
@click.argument("text")
@click.option("--standing", is_flag=True, help="It must reach everybody in the end, also those that come later.")
@click.option("--all", "everybody", is_flag=True, help="It is for every robot that hears it.")
@click.option("--only", metavar="NAMES", help="It is for these robots alone, as r1,r2.")
@click.option("--count", type=click.IntRange(0), help="So many robots may obey: asked for where they are many.")
@click.option("--deadline", metavar="S", type=float, help="Seconds for which it is good; else 5.")
@operator
def send(
    text: str,
    standing: bool,
    everybody: bool,
    only: str | None,
    count: int | None,
    deadline: float | None,
    air: Air,
    as_json: bool,
) -> int:
    """Broadcast an expression: every robot decides for itself whether it is meant. Then tell who matched, who did not,
    where it went wrong, and who said nothing.

    Where more than ten robots may obey, or the expression cannot be undone, their number must be typed, or said with
    --count.

    \b
    Examples:
      sleepcast send '(WHEN (> front_range 1m) (VM 0.2m/s 0.2m/s))'
      sleepcast send --standing --all '(RULE keep (WHEN (< front_range 10in) (ST)))'
      sleepcast send --only r7 --deadline 30 '(VM 0.2m/s 0.2m/s)'
    """
    from sleepcast.station.settling import CountNeededError

    names = None if only is None else [name for name in only.replace(",", " ").split() if name]

    def sending(station: AirStation, said: int | None) -> Command:
        return station.send(text, standing=standing, deadline=deadline, everybody=everybody, count=said, only=names)

    with station_for(air, complain) as station:
        try:
            sent = sending(station, count)
        except CountNeededError as error:
            if count is not None or as_json:
                raise
            sent = sending(station, _typed(error))
        return _gathered(station, sent, GRACE, as_json)


def _typed(error: Exception) -> int | None:
    """The number that a person types. Raises the error where nobody can, and click.Abort at the end of input."""
    if sys.stdin is None or not sys.stdin.isatty():
        raise error
    complain(str(error))
    number: int = click.prompt("Robots that are meant", type=int, err=True)
    return number


@click.command("ask", cls=NegativeNumbersAllowed, short_help="Ask robots on the air for a value.")
@click.argument("text")
@operator
def ask(text: str, air: Air, as_json: bool) -> int:
    """Ask every robot for the value of an expression, which changes nothing: how many answer, the least, the mean and
    the greatest value, and how they are spread.

    \b
    Examples:
      sleepcast ask battery
    """
    with station_for(air, complain) as station:
        return _gathered(station, station.ask(text), PATIENCE, as_json)


@click.command("stop", short_help="Stop every robot on the air.")
@click.option(
    "--seconds", metavar="S", type=click.FloatRange(0.0), help="Give up on silent robots after so long; else at Ctrl-C."
)
@operator
def stop(air: Air, seconds: float | None, as_json: bool) -> int:
    """Stop every robot that hears it, and keep it stopped until `sleepcast release`. Any key that is trusted may.

    It is sent again until every robot that was ever heard is accounted for. Ctrl-C gives the others up; where nobody
    sits at a terminal, ten seconds do. The exit status is 0 only if all robots say that they are stopped.

    \b
    Examples:
      sleepcast stop
      sleepcast stop --seconds 30 --json
    """
    with station_for(air, complain) as station:
        sent = station.stop()
        watched = sys.stdin is not None and sys.stdin.isatty()
        until = sent.message.issued + (seconds if seconds is not None else float("inf") if watched else UNWATCHED)
        try:
            _insist(station, sent, until, watched and not as_json)
        finally:
            _show(station, sent, as_json)
        found = station.accounting(sent.id)
        return 0 if found.complete and found.n_matched else 1


def _insist(station: AirStation, sent: Command, until: float, aloud: bool) -> None:
    """Go on until everybody is accounted for, or it is time to give up."""
    station.gather(sent, GRACE if not sent.addressed else 0.0)
    told_at = station.now
    while sent.n_silent and station.now < until:
        station.wait(min(0.05, until - station.now))
        if aloud and station.now - told_at >= TELL_EVERY:
            told_at = station.now
            found = station.accounting(sent.id)
            complain(f"stopped {found.n_matched}, {silence(found)}")


@click.command("release", short_help="End a stop.")
@operator
def release(air: Air, as_json: bool) -> int:
    """End `sleepcast stop`. Nothing that was asked before resumes by itself.

    \b
    Examples:
      sleepcast release
    """
    with station_for(air, complain) as station:
        return _gathered(station, station.release(), PATIENCE, as_json)


def _gathered(station: AirStation, sent: Command, patience: float, as_json: bool) -> int:
    """Collect the answers, and print the account. The exit status is 1 if anything went wrong on a robot."""
    station.gather(sent, patience)
    _show(station, sent, as_json)
    return 1 if station.accounting(sent.id).n_fault else 0


def _show(station: AirStation, sent: Command, as_json: bool) -> None:
    found = station.accounting(sent.id)
    if as_json:
        put(json.dumps(as_dict(sent, found)))
        return
    for line in told(sent, found):
        put(line)
