"""What became of a command on the air, as a script and as a person want to have it."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from sleepcast.cli.streams import put
from sleepcast.core.errors import printable
from sleepcast.core.units import value_in_words

if TYPE_CHECKING:
    from sleepcast.core.model import RestState
    from sleepcast.language import Vocabulary
    from sleepcast.station.account import Account
    from sleepcast.station.prepared import Forecast
    from sleepcast.station.rest import RestAccount
    from sleepcast.station.sent import Command

FEW = 12
"""Names that are listed; of more, their number is shown."""
MANY = 1_000
"""Names that scripts get; of more, their number alone."""
ASK, STOP, RELEASE = "ask", "stop", "release"
"""Kinds of messages, by their values: the kinds themselves are loaded when something is sent."""
WORDS = {ASK: "answered", STOP: "stopped", RELEASE: "released"}
"""What robots have done that obeyed."""


SORTS = ("matched", "held", "not_matched", "unknown", "not_stored", "fault", "silent")


def as_dict(command: Command, account: Account) -> dict[str, object]:
    """The account as plain data: counts always, names while they are few."""
    names = {"predicted": command.predicted} | {outcome: getattr(account, outcome) for outcome in SORTS}
    about = {"id": command.id, "kind": str(command.kind), "text": command.message.text} | among(account)
    faults = {"faults": account.faults} if len(account.fault) <= MANY else {}
    counts = _counted(names) | {"n_silent": account.n_silent}
    more = census(account) if command.kind == ASK else resting(account.rest) if account.rest is not None else {}
    conflicts = {"conflicts": dict(account.conflicts)} if account.conflicts else {}
    auction = {} if account.auction is None else {"auction": account.auction.to_dict()}
    instant: dict[str, object] = {} if account.instant is None else at_instant(account)
    return {**about, **counts, **faults, **conflicts, **auction, **instant, **more}


def at_instant(account: Account) -> dict[str, object]:
    """Who waits for the instant of a command, when that is, in s of the desk's clock, and by how many s a robot may
    have missed it at most, None while none has obeyed."""
    bound = None if account.bound != account.bound else account.bound
    return {"instant": account.instant, "bound": bound, **_counted({"waiting": account.waiting})}


def resting(rest: RestAccount) -> dict[str, object]:
    """Who of those that have accepted a STOP is at rest, who still moves and how far each may still go, and who does
    not tell."""
    from sleepcast.station.account import rest_counts

    counts: dict[str, object] = {f"n_{kind}": count for kind, count in rest_counts(rest).items()}
    if rest.n_stopping <= MANY:
        counts["stopping"] = {name: state_as_dict(state) for name, state in rest.stopping.items()}
    few = {"at_rest": rest.at_rest, "accepted": rest.accepted}
    return counts | {kind: list(_sorted(names)) for kind, names in few.items() if len(names) <= MANY}


def state_as_dict(state: RestState) -> dict[str, object]:
    """How a stopped robot moves: its speed and how far it may still go, SI; None for unknown."""
    speed, distance = (None if each != each else each for each in state)
    return {"at_rest": state.at_rest, "speed": speed, "distance": distance}


def among(account: Account) -> dict[str, object]:
    """Among how many robots silence was counted, and whether these are all that are expected or those heard so far; how
    many of the silent ones were never heard, so their names are unknown."""
    return {"robots": account.total, "expected": bool(account.size), "n_nameless": account.n_nameless}


def stages_as_dict(text: str, stages: Sequence[tuple[Command, Account]]) -> dict[str, object]:
    """The account of a command that was sent in stages: of all together, and of each."""
    names: dict[str, Collection[str]] = {"predicted": set().union(*(command.predicted for command, _ in stages))}
    names |= {outcome: set().union(*(getattr(account, outcome) for _, account in stages)) for outcome in SORTS}
    about = {"id": stages[0][0].id, "kind": str(stages[0][0].kind), "text": text} | among(stages[-1][1])
    counts = _counted(names)
    counts["n_silent"] = len(names["silent"]) + stages[-1][1].n_nameless
    return {**about, **counts, "stages": [as_dict(*stage) for stage in stages]}


def _counted(names: Mapping[str, Collection[str]]) -> dict[str, object]:
    from sleepcast.channel.message import natural_order

    few = {outcome: robots for outcome, robots in names.items() if len(robots) <= MANY}
    listed: dict[str, object] = {outcome: sorted(robots, key=natural_order) for outcome, robots in few.items()}
    return listed | {f"n_{outcome}": len(robots) for outcome, robots in names.items()}


def census(account: Account) -> dict[str, object]:
    """How many answered, how many know the value; its least, mean and greatest, and how it is spread between them."""
    spread, bars = account.values, account.histogram
    answers = {"answers": account.n_matched + account.n_not_matched + account.n_unknown + account.n_fault}
    if spread is None or bars is None:
        return {**answers, "n": 0, "min": None, "mean": None, "max": None, "histogram": None}
    histogram = {"low": bars.low, "high": bars.high, "counts": list(bars.counts)}
    least, mean, greatest = spread.least, spread.mean, spread.greatest
    return {**answers, "n": spread.count, "min": least, "mean": mean, "max": greatest, "histogram": histogram}


def forecast_text(forecast: Forecast) -> str:
    """Who would obey, as far as the desk knows: printed before anything is sent."""
    from sleepcast.station.validation import chosen_in_words

    if not forecast.may + len(forecast.no) + len(forecast.undecided):
        return "no robot was heard before, so it is unknown which robots will obey"
    unheard = f", and {forecast.nameless} that were never heard" if forecast.nameless else ""
    may = f"{listed('cannot say', forecast.unknown)}{unheard}"
    what = "test unknown" if forecast.most is None else "test or cost unknown"
    undecided = f"; {listed(what, forecast.undecided)}" if len(forecast.undecided) else ""
    would, chosen = (
        ("would obey", "") if forecast.most is None else ("would bid", f"; {chosen_in_words(forecast.most)}")
    )
    return f"{listed(would, forecast.yes)}; {may}; would not {len(forecast.no)}{undecided}{chosen}"


def account_lines(command: Command, account: Account, vocabulary: Vocabulary | None = None) -> Iterator[str]:
    """The account, for a person. vocabulary: says in which units speeds and places are read."""
    from sleepcast.station.account import spread_in_words

    if not account.total:
        asked = "is a node up on this channel, with these keys?"
        yield f"{command.id}: no robot answered, and none was heard before: {asked}"
        return
    leasing = "lease" in command.message.body
    verb = "granted in the group by" if leasing else WORDS.get(str(command.kind), "matched")
    yield f"{command.id}: {listed(verb, account.matched)}"
    if command.kind == ASK and account.values is not None:
        yield f"  {account.values.count} know it: {spread_in_words(account.values, account.unit)}"
    elif command.kind == ASK and len(account.matched):
        yield "  none of them knows the value: it is unknown there"
    elif account.rest is not None and account.n_matched and vocabulary is not None:
        yield f"  {account.rest.sentence(vocabulary, FEW)}"
    elif command.kind == "command":
        yield f"  {listed('noted outside it by' if leasing else 'did not match', account.not_matched)}"
        if account.auction is not None:
            yield f"  {printable(account.auction.sentence())}"
            for by, names in [*account.auction.outbid_by().items()][:FEW]:
                outbid = f" by {printable(', '.join(by))}"
                yield f"  {listed('outbid', names)}{outbid}" if by else f"  {listed('too late', names)}"
        if account.n_unknown:
            what = "test unknown" if account.auction is None else "test or cost unknown"
            yield f"  {listed(what, account.unknown)}"
        if account.n_waiting:
            yield f"  {listed('waiting', account.waiting)}"
        elif account.bound == account.bound:
            yield f"  at the instant, each within {value_in_words(account.bound, 's')}"
        if account.n_held:
            yield f"  {listed('held by STOP, so they did not move', account.held)}"
    if account.n_not_stored:
        yield f"  {listed('not stored, so a restart may forget it', account.not_stored)}"
    for name in _sorted(tuple(account.flawed))[:FEW]:
        yield f"  fault on {name}, which {verb} all the same: {printable(account.flawed[name])}"
    for name in _sorted(account.fault)[:FEW]:
        yield f"  fault on {name}: {printable(account.answers[name].fault or '')}"
    if len(account.fault) > FEW:
        yield f"  faults on {len(account.fault)} robots in all"
    for name in _sorted(tuple(account.conflicts))[:FEW]:
        yield f"  {printable(account.conflicts[name])}"
    if len(account.conflicts) > FEW:
        yield f"  several robots have each of {len(account.conflicts)} names in all"
    yield f"  {account.silence(FEW)}"


def show_account(
    command: Command,
    account: Account,
    as_json: bool = False,
    vocabulary: Vocabulary | None = None,
    *,
    more: Mapping[str, object] = {},
    show: Callable[[str], None] = put,
) -> None:
    """Print the account, as JSON or as lines for a person.

    vocabulary: says in which units speeds and places are read.
    more: what the JSON holds besides.
    show: prints a line.
    """
    if as_json:
        show(json.dumps({**more, **as_dict(command, account)}))
        return
    for line in account_lines(command, account, vocabulary):
        show(line)


def listed(what: str, names: Sequence[str], count: int | None = None) -> str:
    """`matched 3: r1, r2, r3`. count: how many there are, if not all are given."""
    count = len(names) if count is None else count
    shown = printable(", ".join(_sorted(names)[:FEW])) + (", ..." if count > FEW else "")
    return f"{what} {count}" + (f": {shown}" if count else "")


def _sorted(names: Sequence[str]) -> Sequence[str]:
    """Sorted by number, unless there are too many to read."""
    from sleepcast.channel.message import natural_order

    return sorted(names, key=natural_order) if len(names) <= MANY else names
