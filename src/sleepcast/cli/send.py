"""`sleepcast send`, `ask` and `release`: one message to robots on the air, and its account."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import click

from sleepcast.api.connection import AirOptions, observing_station
from sleepcast.cli.account import account_lines, as_dict, forecast_text, stages_as_dict
from sleepcast.cli.air import operator
from sleepcast.cli.eval import NegativeNumbersAllowed
from sleepcast.cli.options import QuantityType
from sleepcast.cli.streams import complain, put, somebody_there
from sleepcast.core.errors import SleepcastError, and_more
from sleepcast.core.units import TIME

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sleepcast.station.network import NetworkStation
    from sleepcast.station.remote import TelemetryClient
    from sleepcast.station.sent import Command
    from sleepcast.station.validation import Draft

GRACE = 1.0
"""Seconds after the time for answers for which they are still taken: for a robot's tick, and for repairs."""
PATIENCE = 2.0
"""The same for a question, which is asked again where its answer was lost."""
MAX_HOLD = 86_400.0
"""Seconds for which a command of one line may keep robots going: what drives longer than a day wants a rule."""


anyway_option = click.option(
    "--anyway", is_flag=True, help="Send it although no robot knows a name in it, or it looks like a mistake."
)


@click.command("send", cls=NegativeNumbersAllowed, short_help="Send an expression to robots on the air.")
@click.argument("text")
@click.option("--standing", is_flag=True, help="Reach every robot, including robots that join later.")
@click.option("--all", "everybody", is_flag=True, help="Send it to every robot, without a test.")
@click.option("--only", metavar="NAMES", help="Send it to these robots only, e.g. r1,r2.")
@click.option("--count", type=click.IntRange(1), help="How many robots may obey; asked for if there are many.")
@click.option("--deadline", metavar="TIME", type=QuantityType(), help="Time until it expires (default: 5s).")
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

    \b
    Examples:
      sleepcast send '(WHEN (> fuel 50%) (JOIN bravo))'
      sleepcast send --standing --all '(RULE rest (WHEN (< fuel 10%) (SLEEP)))'
      sleepcast send --only r7 --hold 10s '(SETQ drive_speed 1m/s)'
      sleepcast send --staged --count 48 '(WHEN (> fuel 20%) (GOTO 10mi 5mi))'
    """
    from sleepcast.station.asking import ask_first
    from sleepcast.station.validation import Audience, Draft

    if staged and only is not None:
        raise click.UsageError("--staged and --only do not go together: stages are chosen among all")
    audience = Audience(None if only is None else only.replace(",", " ").split())
    if audience.only == []:
        raise click.UsageError("--only names nobody: wanted robots, as in --only r1,r2")
    draft = Draft(text, standing, deadline, everybody, count, audience, anyway)
    with observing_station(air, complain, strict=strict) as (station, telemetry):
        station.holding = hold is not None
        if not blind:
            _refuse_early(station, draft)
            ask_first(station, telemetry, text, only=audience.only, anyway=anyway)
        warn(station, telemetry, text, audience.only, anyway=anyway)
        if not (blind or anyway):
            insists = refuse_unknown(station, telemetry, text, as_json, only=audience.only, doubts=True)
            draft = replace(draft, undecided=insists)
        draft = _confirmed(station, telemetry, draft, as_json)
        complain(forecast_text(station.forecast(text, only=audience.only, anyway=draft.confirmed)))
        draft = _settled(station, draft, as_json)
        status = _in_stages(station, draft, as_json) if staged else _at_once(station, draft, as_json)
        if hold is not None:
            station.wait(hold)
        return status


def warn(
    station: NetworkStation,
    telemetry: TelemetryClient,
    text: str,
    only: Sequence[str] | None = None,
    *,
    anyway: bool = False,
) -> None:
    """Print what the checker doubts, with the names of the robots that have sent telemetry. only, anyway: as for
    `Station.check`."""
    if telemetry.minds:
        checked = station.check(text, only=only, anyway=anyway)
        for line in (*(finding.render(text) for finding in checked.warnings), *and_more(checked.more)):
            complain(line)


def refuse_unknown(
    station: NetworkStation,
    telemetry: TelemetryClient,
    text: str,
    as_json: bool,
    *,
    only: Sequence[str] | None = None,
    doubts: bool = False,
) -> bool:
    """Let the desk refuse names that no robot has, where all have sent their names; gives whether a person insists.
    doubts: whether a person is asked about these besides."""
    from sleepcast.station.asking import unknown_names
    from sleepcast.station.validation import UnknownNameError

    names, robots = unknown_names(station, telemetry, text, only)
    person = not as_json and somebody_there()
    if person and doubts:  # these are asked about with all else that is doubted
        doubted = {doubt.unknown for doubt in station.check(text, only=only).doubts}
        names = [name for name in names if name not in doubted]
    if not names:
        return False
    if person and click.confirm(f"{UnknownNameError(names, robots).why}. Send it all the same?", err=True):
        return True
    station.caution = replace(station.caution, known=robots)
    return False


def _confirmed(station: NetworkStation, telemetry: TelemetryClient, draft: Draft, as_json: bool) -> Draft:
    """The draft, confirmed if it was doubted and a person at a terminal says so; else `settle` refuses it."""
    from sleepcast.station.validation import DoubtError

    try:
        checked = station.check(draft.text, only=draft.audience.only, anyway=draft.confirmed)
    except SleepcastError:
        return draft  # `settle` says it, and writes it down
    if draft.confirmed or checked.errors or not checked.doubts or as_json or not somebody_there():
        return draft
    if not telemetry.minds:  # else they have been printed
        complain(DoubtError.of(checked).shown)
    click.confirm("Send it as it stands?", abort=True, err=True)
    return replace(draft, confirmed=True)


def _settled(station: NetworkStation, draft: Draft, as_json: bool) -> Draft:
    """The draft as the desk takes it: what the desk wants to know is asked of a person at a terminal. Raises what
    `NetworkStation.validate` raises."""
    from sleepcast.station.validation import CountNeededError, DoubtError

    while True:
        try:
            station.validate(draft)
            return draft
        except CountNeededError as error:
            if draft.count is not None or as_json:
                raise
            draft = replace(draft, count=_typed(error))
        except DoubtError as error:
            if as_json or not somebody_there():
                raise
            complain(error.shown)
            click.confirm("Send it as it stands?", abort=True, err=True)
            draft = replace(draft, confirmed=True)


def _refuse_early(station: NetworkStation, draft: Draft) -> None:
    """Say at once what is wrong whatever robots may tell. Raises what `settle` raises, but for the count."""
    from sleepcast.station.roster import UnknownRobotError

    if station.caution.strict or not station.names:
        return  # which names there are, and who is there, is known only from their telemetry
    try:
        may: int | None = station.forecast(draft.text, only=draft.audience.only, anyway=draft.confirmed).may
    except UnknownRobotError:
        return  # it may be there all the same: all robots are asked for telemetry
    except SleepcastError:
        may = None  # `settle` says it once more, and writes it down
    station.validate(replace(draft, count=may, confirmed=True))  # what is doubted is asked when all is known


def _at_once(station: NetworkStation, draft: Draft, as_json: bool) -> int:
    sent = station.send(
        draft.text,
        standing=draft.standing,
        deadline=draft.deadline,
        everybody=draft.everybody,
        count=draft.count,
        only=draft.audience.only,
        confirmed=draft.confirmed,
        undecided=draft.undecided,
    )
    return gathered(station, sent, GRACE, as_json)


def _in_stages(station: NetworkStation, draft: Draft, as_json: bool) -> int:
    """Send in stages, telling what becomes of each. The exit status is 1 if there was one too few."""
    from sleepcast.station.staging import staged

    stages = []
    for stage in staged(station, draft, GRACE):
        stages.append(stage)
        if not as_json:
            complain(f"stage {len(stages)}, for {stage.account.asked} robots:")
            _show(station, stage.command, as_json)
    whole = stages[-1].last and stages[-1].good
    if as_json:
        put(json.dumps(stages_as_dict(draft.text, [(stage.command, stage.account) for stage in stages])))
    elif not stages[-1].last:
        complain("not sent to the other robots, because this stage had faults or silent robots")
    return 0 if whole else 1


def _typed(error: Exception) -> int:
    """The number that a person types. Raises the error where nobody can, and click.Abort at the end of input."""
    if not somebody_there():
        raise error
    complain(str(error))
    number: int = click.prompt("Robots that are meant", type=int, err=True)
    return number


@click.command("ask", cls=NegativeNumbersAllowed, short_help="Ask robots on the air for a value.")
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

    with observing_station(air, complain) as (station, telemetry):
        if not anyway and may_be_known_to_robots(station, text):
            look_around(station, telemetry, patience=AHEAD)
        warn(station, telemetry, text, anyway=anyway)
        if not anyway:
            refuse_unknown(station, telemetry, text, as_json)
        return gathered(station, station.ask(text, anyway=anyway), PATIENCE, as_json)


@click.command("release", short_help="End a stop.")
@operator
def release(air: AirOptions, as_json: bool) -> int:
    """End `sleepcast stop`. No earlier command resumes by itself.

    \b
    Examples:
      sleepcast release
    """
    from sleepcast.station.asking import AHEAD, look_around

    with observing_station(air, complain) as (station, telemetry):
        decided = station.now
        look_around(station, telemetry, patience=AHEAD)  # whose STOPs hold, which a RELEASE has to name
        return gathered(station, station.release(decided), PATIENCE, as_json)


def gathered(station: NetworkStation, sent: Command, patience: float, as_json: bool) -> int:
    """Collect the answers, and print the account. The exit status is 1 if anything went wrong on a robot."""
    station.gather(sent, patience)
    station.settle(sent, patience)
    _show(station, sent, as_json)
    return 1 if station.accounting(sent.id).n_fault else 0


def _show(station: NetworkStation, sent: Command, as_json: bool) -> None:
    found = station.accounting(sent.id)
    if as_json:
        put(json.dumps(as_dict(sent, found)))
        return
    for line in account_lines(sent, found):
        put(line)
