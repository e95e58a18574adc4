"""`sleepcast baseline`: which standing commands newcomers still need."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import click

from sleepcast.api.connection import AirOptions, observing_station
from sleepcast.cli.account import show_account
from sleepcast.cli.air import operator
from sleepcast.cli.streams import complain, put, somebody_there
from sleepcast.core.errors import MisuseError, SleepcastError, printable
from sleepcast.core.records import dataclass

if TYPE_CHECKING:
    from sleepcast.channel import Message
    from sleepcast.station.network import NetworkStation
    from sleepcast.station.remote import TelemetryClient

PATIENCE = 4.0
"""Seconds beyond the time for answers for which robots are waited for: one that lacks commands asks for them first."""
SHOWN = 20
"""Commands that are printed of those that are kept, the latest, and of those that are dropped."""
WIDTH = 90
"""Characters of a command that are printed."""


class BaselineError(SleepcastError):
    """No baseline may be sent now."""


@dataclass(frozen=True, slots=True)
class BaselinePlan:
    """The standing commands of our stream that count so far, by number (None: not stored here any more), and which of
    them are to count from now on."""

    messages: Mapping[int, Message | None]
    kept: list[int]
    touched: frozenset[str]

    @property
    def dropped(self) -> list[int]:
        """The numbers of those that do not count any more, but for earlier baselines."""
        from sleepcast.station.baselines import is_baseline

        kept = set(self.kept)
        return [number for number, each in self.messages.items() if number not in kept and not is_baseline(each)]

    def as_dict(self) -> dict[str, object]:
        """For a script."""
        kept = [{"number": number, "text": self._text(number)} for number in self.kept]
        return {"standing": len(self.messages), "n_kept": len(kept), "n_dropped": len(self.dropped), "kept": kept}

    def lines(self) -> Iterator[str]:
        """For a person."""
        yield f"{len(self.messages):,} standing commands, of which {len(self.kept):,} still count:"
        yield from self._some("keep", self.kept)
        yield from self._some("drop", self.dropped)

    def _some(self, what: str, numbers: list[int]) -> Iterator[str]:
        if len(numbers) > SHOWN:
            yield f"  {what} {len(numbers) - SHOWN:,} earlier ones (--json names all that are kept)"
        for number in numbers[-SHOWN:]:
            text = printable(self._text(number)).replace("\n", " ")
            yield f"  {what} {number}: {text if len(text) <= WIDTH else text[:WIDTH] + '…'}"

    def _text(self, number: int) -> str:
        message = self.messages[number]
        if message is None:
            return "(not stored here any more)"
        return message.text or f"({', '.join(sorted(message.body.keys() - message.link.written().keys()))})"


@click.command("baseline")
@click.option("--yes", is_flag=True, help="Send it without asking.")
@operator
def baseline(yes: bool, air: AirOptions, as_json: bool) -> int:
    """Say which of your standing commands still count, so that robots which join later need not take all that you ever
    sent, but only these.

    A command is dropped if later ones of yours have wholly replaced what it did, such as a RULE by another RULE or a
    FORGET of the same name; in doubt it is kept. Before anything is sent, all known robots have to confirm that they
    have every standing command, and to tell what they have learned; it is computed that robots end the same without the
    dropped ones, new ones as well as those that were away. Otherwise nothing is sent, and the exit status is 1.

    It needs a commander's key, and speaks only of what was sent with that key from here. Robots of version 0.2.0 and
    small computers still take everything.

    \b
    Examples:
      sleepcast baseline
      sleepcast baseline --yes --json
    """
    with observing_station(air, complain) as (station, telemetry):
        _refuse_others_than_commanders(station)
        plan = _plan(station)
        if plan.dropped:
            plan = _checked(station, telemetry, plan)
        if not plan.dropped:
            return _nothing_to_drop(plan, as_json)
        if not as_json:
            for line in plan.lines():
                put(line)
        if not yes:
            _confirm(plan, as_json)
        return _send(station, plan, as_json)


def _refuse_others_than_commanders(station: NetworkStation) -> None:
    """Raises MisuseError for the key of anybody else."""
    from sleepcast.channel.message import Role

    delivery = station.session.delivery
    if delivery.role is not Role.COMMANDER:
        raise MisuseError(
            f"the key of {printable(delivery.name)} is that of an {delivery.role}, who sends no standing commands: "
            "take a commander's with --key"
        )


def _plan(station: NetworkStation) -> BaselinePlan:
    from sleepcast.station.baselines import propose

    messages = station.session.delivery.own_rules
    return BaselinePlan(messages, *propose(messages))


def _nothing_to_drop(plan: BaselinePlan, as_json: bool) -> int:
    if as_json:
        put(json.dumps(plan.as_dict() | {"sent": False}))
    elif plan.messages:
        put(f"all {len(plan.messages):,} standing commands still count: there is nothing to drop")
    else:
        put("no standing command was sent from here with this key: there is nothing to drop")
    return 0


def _checked(station: NetworkStation, telemetry: TelemetryClient, plan: BaselinePlan) -> BaselinePlan:
    """The plan without what robots refuse. Raises BaselineError unless all known robots have everything, and would have
    the same without what is dropped."""
    from sleepcast.cli.baseline_check import cases
    from sleepcast.station.asking import look_around
    from sleepcast.station.baselines import propose

    known = {number: message for number, message in plan.messages.items() if message is not None}
    if len(known) < len(plan.messages):
        raise BaselineError("no baseline was sent: not all standing commands are stored here any more")
    robots = _up_to_date(station)
    look_around(station, telemetry, patience=PATIENCE)
    compared = cases(telemetry.minds, robots, plan.touched)
    if isinstance(compared, str):
        raise BaselineError(f"no baseline was sent: {compared}")
    refused: set[int] = set()
    for case in compared:
        case.learned(known.values(), refused)
    plan = BaselinePlan(plan.messages, *propose(plan.messages, refused))
    if why := next(filter(None, (case.objection(known, plan.kept) for case in compared)), ""):
        raise BaselineError(f"no baseline was sent: {why}")
    return plan


def _up_to_date(station: NetworkStation) -> list[str]:
    """The robots, all of which have every standing command. Raises BaselineError if one may lack any."""
    from sleepcast.channel import Kind
    from sleepcast.station.baselines import BASELINE_TEXT

    # A command waits at each robot until all standing ones before it have been evaluated there, so its answer tells.
    sent = station.post(Kind.COMMAND, text=BASELINE_TEXT)
    station.gather(sent, PATIENCE)
    station.settle(sent, PATIENCE)
    account = station.accounting(sent.id)
    if not account.complete or not account.total:
        raise BaselineError(
            f"no baseline was sent: not every robot says that it has all standing commands ({account.silence()}). "
            "Try again when they are in reach, or remove those that are gone: sleepcast roster --forget NAMES"
        )
    if account.conflicts:
        names = printable(", ".join(account.conflicts))
        raise BaselineError(f"no baseline was sent: several robots are called {names}")
    return [*account.matched, *account.not_matched, *account.unknown, *account.fault]


def _confirm(plan: BaselinePlan, as_json: bool) -> None:
    asked = f"Drop {len(plan.dropped):,} of {len(plan.messages):,} standing commands for good?"
    if as_json or not somebody_there():
        raise MisuseError(f"{asked} Nobody can be asked here: say --yes")
    click.confirm(asked, abort=True, err=True)


def _send(station: NetworkStation, plan: BaselinePlan, as_json: bool) -> int:
    from sleepcast.station.baselines import post_baseline

    sent = post_baseline(station, plan.kept)
    station.gather(sent, PATIENCE)
    station.settle(sent, PATIENCE)
    account = station.accounting(sent.id)
    show_account(sent, account, as_json, more={**plan.as_dict(), "sent": True})
    return 0 if account.n_matched and not account.n_fault else 1
