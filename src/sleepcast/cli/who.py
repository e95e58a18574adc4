"""`sleepcast who` and `why`: which robots would obey an expression, and why a robot did what it did."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import field
from typing import TYPE_CHECKING

import click

from sleepcast.api.connection import AirOptions, observing_station
from sleepcast.cli.account import FEW, MANY, listed
from sleepcast.cli.air import operator
from sleepcast.cli.options import NegativeNumbersAllowed
from sleepcast.cli.streams import complain, put
from sleepcast.core.errors import and_more, printable
from sleepcast.core.records import dataclass

if TYPE_CHECKING:
    from sleepcast.station.network import NetworkStation

NO_ANSWER = "it did not answer"


@dataclass(slots=True)
class Obeyers:
    """Who would obey.

    yes, no: names.
    unknown: names, each with the reason.
    everybody: whether all that hear it would.
    oldest: age of the oldest telemetry behind a yes or no, s; None where the robots were asked themselves.
    standing: see `RemoteMinds`.
    nameless: how many expected robots were never heard.
    expected: whether the number of robots was given.
    """

    yes: list[str] = field(default_factory=list)
    no: list[str] = field(default_factory=list)
    unknown: dict[str, str] = field(default_factory=dict)
    everybody: bool = False
    oldest: float | None = None
    standing: str = ""
    nameless: int = 0
    expected: bool = False

    @property
    def total(self) -> int:
        """How many robots there are, as far as that is known."""
        return len(self.yes) + len(self.no) + len(self.unknown) + self.nameless

    def as_dict(self, text: str) -> dict[str, object]:
        """For a script: counts always, names while they are few."""
        groups = {"yes": self.yes, "no": self.no, "unknown": self.unknown}
        summary: dict[str, object] = {"text": text, "polled": self.oldest is None, "everybody": self.everybody}
        summary |= {"robots": self.total, "expected": self.expected, "n_nameless": self.nameless}
        summary |= {f"n_{kind}": len(names) for kind, names in groups.items()}
        summary["n_unknown"] = len(self.unknown) + self.nameless
        summary["standing"] = self.standing
        return summary | {"oldest": self.oldest} | {s: names for s, names in groups.items() if len(names) <= MANY}

    def lines(self) -> Iterator[str]:
        """For a person."""
        from sleepcast.station.roster import of_robots

        if not self.total:
            yield "nobody is known here: is a node up on this channel, with these keys?"
            return
        yield listed("would obey", self.yes)
        yield f"  {listed('would not', self.no)}"
        if self.unknown or self.nameless:
            few = [f"{name} ({printable(why)})" for name, why in list(self.unknown.items())[: FEW + 1]]
            unheard = f"; {self.nameless} more that were never heard" if self.nameless else ""
            yield f"  {listed('unknown', few, len(self.unknown))}{unheard}"
        yield f"  {of_robots(self.total, self.expected)}"
        if self.standing:
            yield f"  {self.standing}"
        if self.oldest is not None and (self.yes or self.no):
            yield f"  from telemetry up to {self.oldest:.1f} s ago"


@click.command("who", cls=NegativeNumbersAllowed)
@click.argument("text")
@click.option("--poll", is_flag=True, help="Let every robot evaluate it itself.")
@click.option("--told", is_flag=True, help="Send nothing: use the telemetry received before.")
@operator
def who(text: str, poll: bool, told: bool, air: AirOptions, as_json: bool) -> int:
    """Show which robots would obey an expression if it were sent now; nothing is done. For a test alone, such as
    (> fuel 50%), it shows for which robots it is true.

    Robots are asked for telemetry, and the test is evaluated here: certainly yes, certainly no, or unknown with the
    reason. With --poll each robot evaluates it itself, with its sonars and its chance, and does nothing. With --told
    nothing is sent, and telemetry older than five seconds counts as unknown. The exit status is 1 if no robot is known.

    \b
    Examples:
      sleepcast who '(WHEN (> fuel 50%) (JOIN bravo))'
      sleepcast who '(> fuel 50%)'
      sleepcast who --poll '(WHEN (< (SONAR 0) 1m) (ST))'
    """
    from sleepcast.station.asking import look_around
    from sleepcast.station.validation import is_predicate_only

    with observing_station(air, complain) as (station, telemetry):
        if not (poll or told):
            look_around(station, telemetry)
        checked = station.check(text)
        asked = f"(WHEN {text} 1)" if is_predicate_only(checked.required()) else text
        obeyers = _polled(station, asked) if poll else _foreseen(station, asked)
        obeyers.standing = telemetry.minds.standing()
        obeyers.expected = station.fleet_size > 0
        for finding in checked.findings:
            complain(finding.render(text))
        for line in and_more(checked.more):
            complain(line)
    if as_json:
        put(json.dumps(obeyers.as_dict(text)))
    else:
        for line in obeyers.lines():
            put(line)
    return 0 if obeyers.total else 1


def _foreseen(station: NetworkStation, text: str) -> Obeyers:
    """By the robots' telemetry."""
    preview = station.preview(text)
    return Obeyers(
        sorted(preview.yes),
        sorted(preview.no),
        dict(sorted(preview.unknown.items())),
        preview.everybody,
        preview.oldest,
        nameless=preview.nameless,
    )


def _polled(station: NetworkStation, text: str) -> Obeyers:
    """By what the robots say."""
    from sleepcast.station.asking import PATIENCE
    from sleepcast.station.validation import NO, TEST_UNKNOWN, UNDECIDED, YES

    asked, poll = station.poll(text, PATIENCE)
    obeyers, account = Obeyers(everybody=station.preview(text).everybody), station.accounting(asked.id)
    obeyers.nameless = account.n_nameless
    faults = account.faults
    for name in sorted((*account.matched, *account.not_matched, *account.unknown, *account.fault)):
        answer = poll.said.get(name)
        if answer == YES:
            obeyers.yes.append(name)
        elif name in faults:
            obeyers.unknown[name] = faults[name]
        elif answer == NO:
            obeyers.no.append(name)
        else:
            obeyers.unknown[name] = TEST_UNKNOWN if answer == UNDECIDED else "it does not say"
    obeyers.unknown |= {name: f"{NO_ANSWER}: {account.ago(name)}" for name in account.silent}
    return obeyers


@click.command("why")
@click.argument("robot")
@click.argument("command", required=False)
@operator
def why(robot: str, command: str | None, air: AirOptions, as_json: bool) -> int:
    """Ask ROBOT how it evaluated COMMAND: every part of the expression with its value at that moment, the first test
    that was false, and by how much. COMMAND is the id that `sleepcast send` prints, or the name of a rule, which is
    evaluated now without doing anything; by default, the last command received.

    \b
    Examples:
      sleepcast why r7
      sleepcast why r7 desk-1763763151000.4
      sleepcast why r7 keep
    """
    from sleepcast.station.asking import ask_why

    with observing_station(air, complain) as (station, telemetry):
        explanation = ask_why(station, telemetry, robot, command)
    if as_json:
        put(json.dumps({"robot": robot, **explanation.to_dict()}))
    else:
        put(printable(f"{robot}, {explanation.command or 'the last command'}: {explanation.verdict}"))
        put(printable(explanation.render()))
    return 0
