"""`sleepcast send`, `ask` and `release`: one message to robots on the air, and its account."""

from __future__ import annotations

import json
from functools import partial
from typing import TYPE_CHECKING, Protocol, TypeVar

import click

from sleepcast.api.connection import AirOptions, observing_station
from sleepcast.cli.account import forecast_text, show_account, stages_as_dict
from sleepcast.cli.air import operator
from sleepcast.cli.options import NegativeNumbersAllowed, QuantityType
from sleepcast.cli.streams import complain, put, somebody_there
from sleepcast.core.ages import duration
from sleepcast.core.errors import and_more
from sleepcast.core.time_of_day import instant_of, time_of_day
from sleepcast.core.units import TIME
from sleepcast.language.functions import MAX_WAIT

if TYPE_CHECKING:
    from sleepcast.language import Checked
    from sleepcast.station.network import NetworkStation
    from sleepcast.station.prepared import Prepared, Terms
    from sleepcast.station.remote import TelemetryClient
    from sleepcast.station.sent import Command
    from sleepcast.station.validation import UnknownNameError

Sent = TypeVar("Sent", covariant=True)


class Put(Protocol[Sent]):
    """Sends what was prepared, with the answers of who sends it."""

    def __call__(self, *, count: int | None, confirmed: bool) -> Sent: ...


GRACE = 1.0
"""Seconds after the time for answers for which they are still taken: for a robot's tick, and for repairs."""
PATIENCE = 2.0
"""The same for a question, which is asked again where its answer was lost."""
CALLED_OFF = 1.0
"""Seconds to the instant of a command from which on it is said that robots wait: sooner, nobody calls it off."""
MAX_HOLD = 86_400.0
"""Seconds for which a command of one line may keep robots going: what drives longer than a day wants a rule."""


anyway_option = click.option(
    "--anyway", is_flag=True, help="Send it although no robot knows a name in it, or it looks like a mistake."
)


@click.command("send", cls=NegativeNumbersAllowed)
@click.argument("text")
@click.option("--standing", is_flag=True, help="Reach every robot, including robots that join later.")
@click.option("--all", "everybody", is_flag=True, help="Send it to every robot, without a test.")
@click.option("--only", metavar="NAMES", help="Send it to these robots only, e.g. r1,r2.")
@click.option("--count", type=click.IntRange(1), help="How many robots may obey; asked for if there are many.")
@click.option(
    "--deadline",
    metavar="TIME",
    type=QuantityType(),
    help="Time until it expires (default: 5s, 7.5s for BEST and QUORUM).",
)
@click.option("--at", metavar="TIME", help="Time of day at which all obey at once, within the next hour: 12:30:05.")
@click.option(
    "--staged", is_flag=True, help="Send it to one robot, then to a tenth, then to all, until something fails."
)
@click.option(
    "--hold", metavar="TIME", type=QuantityType(TIME, 0.0, MAX_HOLD), help="Keep driven robots moving so long."
)
@click.option("--strict", is_flag=True, help="Treat warnings as errors.")
@click.option("--blind", is_flag=True, help="Do not ask the robots beforehand who would obey.")
@anyway_option
@operator
def send(
    text: str,
    standing: bool,
    everybody: bool,
    only: str | None,
    count: int | None,
    deadline: float | None,
    at: str | None,
    staged: bool,
    hold: float | None,
    strict: bool,
    blind: bool,
    anyway: bool,
    air: AirOptions,
    as_json: bool,
) -> int:
    """Broadcast an expression: every robot decides for itself whether to obey. Then print which robots matched, which
    did not, which had a fault, and which stayed silent.

    Robots are asked first which of them would obey. If more than ten may, or the expression cannot be undone, type the
    number, or give it with --count. An expression that looks like a mistake (a comparison whose value is not used, a
    PROB of 50) must be confirmed, or sent with --anyway. A driven robot stops by itself when it hears no operator for a
    second; --hold keeps it moving until those seconds are over, or Ctrl-C.

    With --at, robots store the command and obey at that moment, all at once, as well as they know your clock; until
    then they answer that they wait. (AFTER-ISSUE 3s ...) does the same so long after it was sent.

    \b
    Examples:
      sleepcast send '(WHEN (> fuel 50%) (JOIN bravo))'
      sleepcast send --standing --all '(RULE rest (WHEN (< fuel 10%) (SLEEP)))'
      sleepcast send --only r7 --hold 10s '(SETQ drive_speed 1m/s)'
      sleepcast send --staged --count 48 '(WHEN (> fuel 20%) (GOTO 10mi 5mi))'
      sleepcast send --at 12:30:05 '(WHEN (IN bravo) (SETQ drive_speed 1m/s))'
      sleepcast send '(CANCEL)' --all
    """
    from sleepcast.core.clock import UnixClock
    from sleepcast.station.prepared import Terms
    from sleepcast.station.validation import Audience

    if staged and only is not None:
        raise click.UsageError("--staged and --only do not go together: stages are chosen among all")
    audience = Audience(None if only is None else only.replace(",", " ").split())
    if audience.only == []:
        raise click.UsageError("--only names nobody: wanted robots, as in --only r1,r2")
    instant = None if at is None else instant_of(at, UnixClock().now(), MAX_WAIT)
    terms = Terms(standing, deadline, everybody, audience, anyway=anyway, at=instant)
    with observing_station(air, complain, strict=strict) as (station, telemetry):
        station.holding = hold is not None
        prepared = station.prepare(text, terms) if blind else _prepare_with_robots(station, telemetry, text, terms)
        checked, sender = prepared.draft.checked, Sender(count, anyway, not as_json and somebody_there())
        warn(telemetry, checked)
        prepared = sender.asked_about_names(prepared)
        sender.ask_about_text(checked, shown=bool(telemetry.minds))
        complain(forecast_text(prepared.forecast))
        if staged:
            status = _in_stages(station, prepared, sender, as_json)
        else:
            status = gathered(station, sender.settle(partial(station.commit, prepared)), GRACE, as_json)
        if hold is not None:
            station.wait(hold)
        return status


def _prepare_with_robots(station: NetworkStation, telemetry: TelemetryClient, text: str, terms: Terms) -> Prepared:
    """By what robots tell now. What is wrong whatever they may tell is refused before they are asked, unless only their
    telemetry says which names there are, and who is there."""
    from sleepcast.station.asking import prepare_with_robots

    early = None if station.policy.strict or not station.names else station.draft(text, terms)
    return prepare_with_robots(station, telemetry, text, terms, early)


def warn(telemetry: TelemetryClient, checked: Checked) -> None:
    """Print what the checker doubts, in the names of the robots that have sent telemetry."""
    if telemetry.minds:
        for line in (*(finding.render(checked.text) for finding in checked.warnings), *and_more(checked.more)):
            complain(line)


class Sender:
    """Who sends a command, and what he has said of it: with options, or when asked.

    count, confirmed: see `Station.commit`.
    person: whether somebody is there to be asked.
    """

    def __init__(self, count: int | None, confirmed: bool, person: bool) -> None:
        self.count, self.confirmed, self.person = count, confirmed, person
        self._may: int | None = None
        """The number that was asked for last."""

    def asked_about_names(self, prepared: Prepared) -> Prepared:
        """Ask about names that no robot has, unless they are asked about with all else that is doubted."""
        from sleepcast.station.validation import UnknownNameError

        if not (prepared.unknown and self.person):
            return prepared
        doubted = {doubt.unknown for doubt in prepared.draft.checked.doubts}
        names = [name for name in prepared.unknown if name not in doubted]
        if not names or self.insists(UnknownNameError(names, prepared.informed)):
            return prepared.despite_names()
        self.person = False  # he has answered, and the desk refuses it
        return prepared

    def insists(self, error: UnknownNameError) -> bool:
        """Whether a person wants it although no robot has these names."""
        return self.person and click.confirm(f"{error.why}. Send it all the same?", err=True)

    def ask_about_text(self, checked: Checked, shown: bool) -> None:
        """Ask whether a text is meant that is doubted. shown: whether the doubts were printed."""
        from sleepcast.station.validation import DoubtError

        if self.person and checked.doubts and not self.confirmed:
            self._confirm("" if shown else DoubtError.of(checked).shown)

    def _confirm(self, shown: str) -> None:
        if shown:
            complain(shown)
        click.confirm("Send it as it stands?", abort=True, err=True)
        self.confirmed = True

    def settle(self, put: Put[Sent]) -> Sent:
        """Do what wants answers, and ask a person for them, for the number once more if it is another one by now.
        Raises what that raises where nobody can be asked."""
        from sleepcast.station.validation import CountNeededError, DoubtError

        while True:
            try:
                return put(count=self.count, confirmed=self.confirmed)
            except CountNeededError as error:
                wrong = self.count is not None and self._may in (None, error.may)
                if wrong or not self.person:
                    raise
                complain(str(error))
                self._may, self.count = error.may, click.prompt("Robots that are meant", type=int, err=True)
            except DoubtError as error:
                if not self.person:
                    raise
                self._confirm(error.shown)


def _in_stages(station: NetworkStation, prepared: Prepared, sender: Sender, as_json: bool) -> int:
    """Send in stages, telling what becomes of each. The exit status is 1 if there was one too few."""
    from sleepcast.station.staging import Stages

    stages = []
    for stage in sender.settle(partial(Stages, station, prepared)).run(GRACE):
        stages.append(stage)
        if not as_json:
            complain(f"stage {len(stages)}, for {stage.account.asked} robots:")
            show_account(stage.command, station.accounting(stage.command.id))
    whole = stages[-1].last and stages[-1].good
    if as_json:
        put(json.dumps(stages_as_dict(prepared.draft.text, [(stage.command, stage.account) for stage in stages])))
    elif not stages[-1].last:
        complain("not sent to the other robots, because this stage had faults or silent robots")
    return 0 if whole else 1


@click.command("ask", cls=NegativeNumbersAllowed)
@click.argument("text")
@anyway_option
@operator
def ask(text: str, anyway: bool, air: AirOptions, as_json: bool) -> int:
    """Ask every robot for the value of an expression; nothing changes. Prints how many answered, the minimum, the mean
    and the maximum, and the distribution. If a name is not known here, robots are asked for their names first.

    \b
    Examples:
      sleepcast ask fuel
      sleepcast ask '(DIST x y 0 0)' --json
    """
    from sleepcast.station.asking import AHEAD, look_around, may_be_known_to_robots
    from sleepcast.station.validation import UnknownNameError

    with observing_station(air, complain) as (station, telemetry):
        checked = station.check(text, anyway=anyway)
        if not anyway and may_be_known_to_robots(station, checked):
            look_around(station, telemetry, patience=AHEAD)
            checked = station.check(text)
        warn(telemetry, checked)
        names, robots = ([], 0) if anyway else station.unknown_names(checked)
        sender = Sender(None, anyway, not as_json and somebody_there())
        insists = anyway or (bool(names) and sender.insists(UnknownNameError(names, robots)))
        return gathered(station, station.ask(checked, anyway=insists), PATIENCE, as_json)


@click.command("release")
@operator
def release(air: AirOptions, as_json: bool) -> int:
    """End `sleepcast stop`. No earlier command resumes by itself.

    \b
    Examples:
      sleepcast release
    """
    from sleepcast.station import asking

    with observing_station(air, complain) as (station, telemetry):
        return gathered(station, asking.release(station, telemetry), PATIENCE, as_json)


def gathered(station: NetworkStation, sent: Command, patience: float, as_json: bool) -> int:
    """Collect the answers, and print the account. The exit status is 1 if anything went wrong on a robot."""
    if sent.instant is not None and (left := sent.instant - station.now) >= CALLED_OFF:
        complain(f"robots wait for {time_of_day(sent.instant)}, in {duration(left)}; (CANCEL) or STOP discards it")
    station.gather(sent, patience)
    station.settle(sent, patience)
    account = station.accounting(sent.id)
    show_account(sent, account, as_json)
    return 1 if account.n_fault else 0
