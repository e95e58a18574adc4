"""`sleepcast send`, `ask`, `stop` and `release`: one message to robots on the air, and what became of it.

Who is there is known from those that were heard before: their names and times are kept in a file for each fleet, so
that a robot which says nothing is told as silent, and nobody takes silence for consent.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import wraps
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING

import click

from sleepcast.cli.air import Air, line_for, options
from sleepcast.cli.evaluate import NegativeNumbersAllowed
from sleepcast.cli.streams import complain, put
from sleepcast.errors import MisuseError, printable
from sleepcast.files import data_folder, replace_file

if TYPE_CHECKING:
    from sleepcast.channel import Message
    from sleepcast.station.accounting import Answer

CHANNEL = "udp://239.255.83.76:47123?interface=lo"
"""Unless another one is said: multicast that stays on this machine."""
WITHIN = 0.5
"""Seconds over which answers are spread, unless another time is said: 1,000 robots fill about a tenth of a radio."""
GRACE = 1.0
"""Seconds after that for which answers are still taken: for a robot's tick, and for repairs."""
PAUSE = 0.05
"""Seconds between two looks at whether everybody has answered."""
FEW = 12
"""Names that are listed; of more, their number is told."""

MANY = 1_000
"""Names that scripts get; of more, their number alone."""
COMMAND, ASK, STOP, RELEASE = "command", "ask", "stop", "release"
"""Kinds of messages, by their values: the kinds themselves are loaded when something is sent."""
WORDS = {ASK: "answered", STOP: "stopped", RELEASE: "released"}
"""What those have done that did what they were told."""


def operator(command: Callable[..., int]) -> Callable[..., int]:
    """A command of an operator on the air: it gets an `Air`, `within` and `as_json` besides what is its own."""

    @click.option("--channel", metavar="URI", default=CHANNEL, show_default=True, help="The radio.")
    @options
    @click.option(
        "--within", type=click.FloatRange(0.0, 60.0), default=WITHIN, show_default=True, help="Seconds for answers."
    )
    @click.option("--json", "as_json", is_flag=True, help="Print the account as one JSON object.")
    @wraps(command)
    def on_air(
        channel: str, fleet: str, key: str | None, trust: Path | None, folder: Path | None, **others: object
    ) -> int:
        return command(air=Air(channel, fleet, key, trust, folder), **others)

    return on_air


@click.command("send", cls=NegativeNumbersAllowed, short_help="Send an expression to robots on the air.")
@click.argument("text")
@click.option("--standing", is_flag=True, help="It must reach everybody in the end, also those that come later.")
@click.option("--all", "everybody", is_flag=True, help="It is for every robot that hears it.")
@operator
def send(text: str, standing: bool, everybody: bool, air: Air, within: float, as_json: bool) -> int:
    """Broadcast an expression: every robot decides for itself whether it is meant. Then tell who matched, who did not,
    where it went wrong, and who said nothing.

    \b
    Examples:
      sleepcast send '(WHEN (> front_range 1m) (VM 0.2m/s 0.2m/s))'
      sleepcast send --standing --all '(RULE keep (WHEN (< front_range 10in) (ST)))'
    """
    from sleepcast.cli.learned import LearnedNames
    from sleepcast.language import Vocabulary, check
    from sleepcast.station.preview import is_for_everybody

    program = check(text, LearnedNames(Vocabulary())).required()
    if is_for_everybody(program) and not everybody:
        raise MisuseError(
            f"every robot that hears it would obey {text.strip()!r:.200}: say so with --all, or say for whom it is, as "
            "in (WHEN (IN bravo) (ST))"
        )
    return _exchange(air, COMMAND, text, standing=standing, within=within, as_json=as_json)


@click.command("ask", cls=NegativeNumbersAllowed, short_help="Ask robots on the air for a value.")
@click.argument("text")
@operator
def ask(text: str, air: Air, within: float, as_json: bool) -> int:
    """Ask every robot for the value of an expression, which changes nothing: how many answer, and the least, the mean
    and the greatest value.

    \b
    Examples:
      sleepcast ask battery
    """
    from sleepcast.language import read

    read(text)
    return _exchange(air, ASK, text, within=within, as_json=as_json)


@click.command("stop", short_help="Stop every robot on the air.")
@operator
def stop(air: Air, within: float, as_json: bool) -> int:
    """Stop every robot that hears it, and keep it stopped until `sleepcast release`. Any key that is trusted may.

    \b
    Examples:
      sleepcast stop
    """
    return _exchange(air, STOP, "", within=within, as_json=as_json)


@click.command("release", short_help="End a stop.")
@operator
def release(air: Air, within: float, as_json: bool) -> int:
    """End `sleepcast stop`. Nothing that was asked before resumes by itself.

    \b
    Examples:
      sleepcast release
    """
    return _exchange(air, RELEASE, "", within=within, as_json=as_json)


def _exchange(air: Air, kind: str, text: str, *, standing: bool = False, within: float, as_json: bool) -> int:
    """Send, collect the answers, and print the account. The exit status is 1 if anything went wrong on a robot."""
    from contextlib import closing

    from sleepcast.channel import Kind
    from sleepcast.channel.bodies import WITHIN as ASKED
    from sleepcast.station.accounting import Outcome, answer_from

    roster = Known(air.fleet)
    expected = roster.names
    answers: dict[str, Answer] = {}
    with closing(line_for(air, None, robot=False, say=complain)) as line:
        now = time.time()
        sent = line.mailbox.post(Kind(kind), now, text=text, standing=standing, body={ASKED: within})
        until = now + within + GRACE
        while (now := time.time()) < until and not (expected and expected <= answers.keys()):
            line.wait(min(PAUSE, until - now))
            for message in line.receive():
                roster.hear(message, now)
                answer = answer_from(message.body, now) if message.body.get("command") == sent.id else None
                if answer is not None:
                    answers.setdefault(message.sender, answer)
    complaint = roster.save()
    if complaint:
        complain(complaint)
    account = {
        outcome.name.casefold(): sorted(name for name, answer in answers.items() if answer.outcome is outcome)
        for outcome in Outcome
    } | {"silent": sorted(roster.names - answers.keys())}
    if as_json:
        put(json.dumps(_as_dict(sent, account, answers)))
    else:
        for told in _told(sent, account, answers, roster):
            put(told)
    return 1 if account["fault"] else 0


Account = dict[str, list[str]]
"""Names of robots, sorted, by what they answered; `silent`: of those that are known and said nothing."""


def _as_dict(sent: Message, account: Account, answers: Mapping[str, Answer]) -> dict[str, object]:
    found: dict[str, object] = {"id": sent.id, "kind": str(sent.kind), "text": sent.text}
    found |= {f"n_{sort}": len(names) for sort, names in account.items()}
    found |= {sort: names for sort, names in account.items() if len(names) <= MANY}
    return found | ({"answers": len(answers), **_census(answers)} if sent.kind == ASK else {})


def _census(answers: Mapping[str, Answer]) -> dict[str, float | int | None]:
    """How many know the value, and its least, mean and greatest."""
    values = [answer.value for answer in answers.values() if answer.value is not None]
    if not values:
        return {"n": 0, "min": None, "mean": None, "max": None}
    return {"n": len(values), "min": min(values), "mean": fmean(values), "max": max(values)}


def _told(sent: Message, account: Account, answers: Mapping[str, Answer], roster: Known) -> Iterator[str]:
    """The account, for a person."""
    from sleepcast.language import format_value

    now = time.time()
    if not roster.names:
        yield f"{sent.id}: nobody answered, and nobody was heard before: is a node up on this channel, with these keys?"
        return
    verb = WORDS.get(str(sent.kind), "matched")
    yield f"{sent.id}: {_list(verb, account['matched'])}"
    if sent.kind == ASK:
        census = _census(answers)
        if census["n"]:
            spread = ", ".join(f"{what} {format_value(float(census[what] or 0.0))}" for what in ("min", "mean", "max"))
            yield f"  {census['n']} know it: {spread}"
    elif sent.kind == COMMAND:
        yield f"  {_list('did not match', account['not_matched'])}"
    for name in account["fault"][:FEW]:
        yield f"  fault on {name}: {printable(answers[name].fault or '')}"
    if len(account["fault"]) > FEW:
        yield f"  faults on {len(account['fault'])} robots in all"
    yield f"  {_list('silent', [roster.ago(name, now) for name in account['silent']])}"


def _list(what: str, names: Sequence[str]) -> str:
    listed = ", ".join(names[:FEW]) + (", ..." if len(names) > FEW else "")
    return f"{what} {len(names)}" + (f": {listed}" if names else "")


class Known:
    """The robots of a fleet that were heard before, and when (s of Unix time); see the module."""

    def __init__(self, fleet: str) -> None:
        self._file = data_folder() / "rosters" / f"{fleet.encode().hex()}.json"
        try:
            found = json.loads(self._file.read_text(encoding="utf-8"))
            self._heard = {str(name): float(heard) for name, heard in found.items()}
        except (OSError, ValueError, TypeError, AttributeError, RecursionError):
            self._heard = {}  # none yet, or none that could be read: it fills again by itself

    @property
    def names(self) -> set[str]:
        return set(self._heard)

    def hear(self, message: Message, now: float) -> None:
        """A robot has said something."""
        from sleepcast.channel.message import TO_OPERATOR
        from sleepcast.station.roster import MAX_ROBOTS

        if message.kind in TO_OPERATOR and (message.sender in self._heard or len(self._heard) < MAX_ROBOTS):
            self._heard[message.sender] = now

    def ago(self, name: str, now: float) -> str:
        """How long ago a robot was heard."""
        return f"{name} (last heard {max(0.0, now - self._heard[name]):.0f} s ago)"

    def save(self) -> str:
        """Keep it; gives what a person must know if that fails."""
        try:
            self._file.parent.mkdir(parents=True, exist_ok=True)
            replace_file(self._file, json.dumps(self._heard).encode())
        except OSError as error:
            return f"cannot remember who was heard ({self._file}: {error.strerror}): silence will not be told next time"
        return ""
