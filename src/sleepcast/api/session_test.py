"""A session as a test: what was sent to a simulated fleet and what became of it, as a folder that can be run again.

    test.toml         the scenario with what was changed in it, the seed, the length, and goals for the end
    mission.sleep     the commands with their times, and how many robots each of them matched

A message goes out in the first tick that ends at its time or later, so the run repeats bit for bit. Where a scenario
names several operators, each line says who sends it, and HOLD and AWAY when a desk began and ended its heartbeats.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, cast

from sleepcast.api.assembly import others_of
from sleepcast.channel import Kind, Message
from sleepcast.channel.desks import sent_by
from sleepcast.channel.message import FOR, LEASE, NOT
from sleepcast.core.errors import MisuseError, and_more
from sleepcast.core.records import NamedTuple
from sleepcast.core.toml_text import toml_value
from sleepcast.loop import Swarm
from sleepcast.loop.mission import named_robots, order_kind
from sleepcast.loop.swarm import give
from sleepcast.simulator import Changes, Scenario, find_scenario, scenario_names
from sleepcast.simulator.packing import pack
from sleepcast.simulator.scenario.mission import MAX_ORDERS, Instruction, Order, OrderKind, Wanted, written_mission
from sleepcast.simulator.scenario.origin import read_origin
from sleepcast.station import Account, Command, Station
from sleepcast.station.account import COUNTED
from sleepcast.station.validation import DEADLINE

if TYPE_CHECKING:
    from sleepcast.loop.rerun import Inputs

FILE, MISSION = "test.toml", "mission.sleep"
FORMAT = 1
MAX_NAMED = 3
"""Commands that a sentence names."""

Hold = Callable[[str, Account], Sequence[Wanted]]
"""What shall become of a command, by its id, when its account is this one."""


class SentOrder(NamedTuple):
    """An order that was sent: by which desk, and the id of its command; "" for HOLD and AWAY."""

    desk: Station
    id: str

    def counts(self) -> dict[str, int]:
        """What is counted of it now."""
        return counts_of(self.desk.accounting(self.id)) if self.id else {}


class SessionOrder(NamedTuple):
    """An order of the test, and the id of the message that it repeats; "" for HOLD and AWAY."""

    order: Order
    id: str = ""


def counts_of(account: Account) -> dict[str, int]:
    """What is counted of a command, by its words in a mission."""
    return {each.replace("_", " "): int(getattr(account, f"n_{each}")) for each in COUNTED}


def as_now(_: str, account: Account) -> Sequence[Wanted]:
    """All counts as they are now."""
    return [Wanted(count, number) for count, number in counts_of(account).items() if count != "held" or number]


def send_order(swarm: Swarm, order: Order) -> SentOrder:
    """Send an order between two ticks, as by hand. Raises MissionError."""
    desk = swarm.desk_for(order)
    sent = give(desk, order, confirmed=True)
    return SentOrder(cast(Station, desk), "" if sent is None else sent.id)


def unmet(order: Order, counts: Mapping[str, int]) -> list[str]:
    """A sentence for each count of an order that is not as wanted."""
    return [
        f"{order.place}: {order.line()}: wanted {wanted}, but it was {counts[wanted.count]}"
        for wanted in order.wanted
        if not wanted.met(counts[wanted.count])
    ]


def unsent(order: Order, end: float) -> list[str]:
    """The same for one that was never sent, since the run ended at `end`, s."""
    return [
        f"{order.place}: {order.line()}: wanted {wanted}, but it was never sent: the run ended at {end:g} s, before "
        f"{order.time:g} s"
        for wanted in order.wanted
    ]


def missed_in(swarm: Swarm, station: Station) -> list[str]:
    """A sentence for each count that the mission of a run wanted of what was sent, and that is otherwise now."""
    desks = {command.id: desk for desk, command in sent_commands(swarm, station)}
    accounts = ((order, desks[sent].accounting(sent)) for order, sent in swarm.given if order.wanted and sent)
    return [each for order, account in accounts for each in unmet(order, counts_of(account))]


def sent_commands(swarm: Swarm, station: Station) -> list[tuple[Station, Command]]:
    """What all operators of a run have sent, oldest first, each with the desk that has sent it. station: the first
    one's."""
    desks = {desk.operator: desk for desk in (station, *others_of(swarm))}
    return [(desks.get(command.message.sender, station), command) for command in sent_by([*desks.values()])]


def never_sent(orders: Iterable[Order]) -> list[dict[str, object]]:
    """Orders that were never sent, for scripts."""
    return [{"time": each.time, "text": each.text, "place": each.place} for each in orders]


def late_sentence(orders: Sequence[Order], end: float) -> str:
    """That these orders come after the end of a run, at `end` s, so that they are never sent; for people."""
    some = "; ".join((*(each.in_short() for each in orders[:MAX_NAMED]), *and_more(len(orders) - MAX_NAMED)))
    one = len(orders) == 1
    return (
        f"{len(orders)} {'command comes' if one else 'commands come'} after the end at {end:g} s and "
        f"{'is' if one else 'are'} never sent: {some}"
    )


def orders_of(swarm: Swarm, station: Station, inputs: Inputs, hold: Hold) -> list[SessionOrder]:
    """What was sent, as the orders of a mission, in the order of their times. Raises MisuseError for what a mission
    cannot repeat.

    station: the first operator's desk.
    inputs: all that came from outside since the first tick.
    hold: what shall become of each command of which its desk keeps an account.
    """
    if inputs.changes:
        first = inputs.changes[0]
        at = first.tick * swarm.simulator.scenario.tick
        what, instead = (
            ("A robot was added", "with at = ...") if first.came else ("Obstacles were changed", "as an event")
        )
        raise MisuseError(
            f"{what} by hand at {at:g} s, which a test cannot repeat. Put that into the scenario {instead}, and play "
            "it again."
        )
    tick = swarm.simulator.scenario.tick
    desks = {command.id: desk for desk, command in sent_commands(swarm, station)}
    orders, own = list[SessionOrder](), is_run_again(inputs, tick)
    for sent, message in _sent_first(inputs):
        by_itself = _is_missions(sent, message, tick)
        if order_kind(message) is None or (own and by_itself):
            continue
        line = _instruction(message, tick if by_itself else 0.0)._replace(by=_by(message, station))
        desk = desks.get(message.id)
        wanted = () if desk is None else tuple(hold(message.id, desk.accounting(message.id)))
        orders.append(SessionOrder(Order(_time(sent, tick), line.written(), "", wanted), message.id))
    orders += _presence(swarm, station, inputs)
    if len(orders) > MAX_ORDERS:
        raise MisuseError(f"{len(orders):,} commands were sent; at most {MAX_ORDERS:,} fit into one test")
    return sorted(orders, key=lambda each: each.order.time)


def _by(message: Message, station: Station) -> str:
    """Who sends it, as a mission says it: nobody is named for the first operator."""
    return "" if message.sender == station.operator else message.sender


def _presence(swarm: Swarm, station: Station, inputs: Inputs) -> Iterator[SessionOrder]:
    """When desks began to send heartbeats (HOLD), and when they ended that (AWAY), as far as robots could hear it."""
    tick, pause = swarm.simulator.scenario.tick, swarm.simulator.scenario.minds.lease / 3.0
    last: dict[str, int] = {}
    """The tick at whose end each operator's last heartbeat was sent."""

    def order(word: OrderKind, before: int, by: str) -> SessionOrder:
        return SessionOrder(Order(_time(before, tick), Instruction(word, by=by).written(), ""))

    def next_after(sent: int) -> int:
        """The tick at whose end the next heartbeat is sent."""
        number = sent + max(1, int(pause / tick))
        while not pause < number * tick - sent * tick:
            number += 1
        return number

    for message in (message for _, message in inputs.posted if message.kind is Kind.HEARTBEAT):
        sent, by = round(message.issued / tick), _by(message, station)
        if by in last and sent > next_after(last[by]):
            yield order("AWAY", last[by] + 1, by)
        if by not in last or sent > next_after(last[by]):
            yield order("HOLD", sent, by)
        last[by] = sent
    for by, sent in last.items():
        if next_after(sent) < swarm.simulator.tick:  # one of this tick goes on the air in the next one
            yield order("AWAY", sent + 1, by)


def is_run_again(inputs: Inputs, tick: float) -> bool:
    """Whether the desk has sent the scenario's mission by itself, and will send the same in a test: somebody's STOP
    ends a mission, and what was sent of that one is the test's own then.

    tick: how long each lasts, s.
    """
    missions = [(message.kind, _is_missions(sent, message, tick)) for sent, message in _sent_first(inputs)]
    return any(by_itself for _, by_itself in missions) and (Kind.STOP, False) not in missions


def _sent_first(inputs: Inputs) -> list[tuple[int, Message]]:
    """The messages with the ticks in which they were sent first: the desk repeats a STOP until all have answered. What
    it says as the caller of auctions comes by itself."""
    first = dict[str, tuple[int, Message]]()
    for sent, message in inputs.posted:
        if message.kind is not Kind.REQUEST:
            first.setdefault(message.id, (sent, message))
    return list(first.values())


def _is_missions(sent: int, message: Message, tick: float) -> bool:
    """Whether the desk has sent it by itself, within a tick; what people send lies between two ticks."""
    return round(message.issued / tick) == sent


def _time(sent: int, tick: float) -> float:
    """A short number for the time of this tick, which lies after the tick before and not after this one."""
    end = sent * tick
    short = float(f"{end:.9g}")
    return short if short <= end else (sent - 0.5) * tick


def _instruction(message: Message, ahead: float) -> Instruction:
    """What a message says.

    ahead: s by which a test sends it before this was sent, so that it has to last longer.
    """
    match message.body.get(LEASE):
        case {"do": str() as action, "group": str() as group, "seconds": float() as seconds, "to": str() as to}:
            return Instruction("lease", f"{action} {group}", seconds, to=to)
    kind = order_kind(message)
    assert kind is not None
    lasts = message.deadline - message.issued
    usual = message.kind is not Kind.COMMAND or lasts == inf or abs(lasts - DEADLINE) < 1e-9
    only, but = (named_robots(message, key) for key in (FOR, NOT))
    return Instruction(kind, message.text.strip(), None if usual else round(lasts + ahead, 9), only, but)


def source_of(scenario: Scenario, seed: int) -> tuple[str, Changes]:
    """The name by which this scenario is found again, and what a run changes in it. Raises MisuseError for one that
    cannot be had again."""
    name, changes = read_origin(scenario.origin)
    if name not in scenario_names():
        name = os.path.abspath(name) if os.path.exists(name) else name
    for tried in dict.fromkeys((seed, changes.seed, scenario.seed)):
        changed = replace(changes, seed=tried)
        if pack(_anywhere(find_scenario(name, changed))) == pack(_anywhere(scenario)):
            return name, changed
    raise MisuseError(f"{name} is not any more the scenario with which this run began: start it again, and then save")


def _anywhere(scenario: Scenario) -> Scenario:
    """Without what depends on where its files lie, and on how somebody wrote that."""
    mission = tuple(replace(order, place="") for order in scenario.mission)
    return replace(scenario, origin="", seed=0, mission=mission)


def session_files(
    swarm: Swarm,
    station: Station,
    inputs: Inputs,
    title: str,
    *,
    hold: Hold = as_now,
    goals: Sequence[str] = (),
    exact: bool = False,
    home: Path | None = None,
) -> dict[str, str]:
    """The files of the test, by name. Raises MisuseError for a session that cannot be repeated.

    station: the first operator's desk.
    inputs: all that came from outside since the first tick.
    hold: what shall become of each command.
    goals: measures with a bound, that hold at the end.
    exact: whether the final state must match exactly.
    home: the folder for the files; None where nobody knows it.
    """
    simulator = swarm.simulator
    scenario = simulator.scenario
    if simulator.tick < 1:
        raise MisuseError("Nothing has happened yet: let time run first.")
    if simulator.payload is not None:
        raise MisuseError("Robots of a class of your own cannot be saved: a test has only the scenario's robots.")
    orders = orders_of(swarm, station, inputs, hold)
    name, changes = source_of(scenario, simulator.seed)
    if home is not None and os.path.isabs(name):
        name = os.path.relpath(name, home)
    lines = [
        f"format = {FORMAT}",
        f"title = {toml_value(title)}",
        f"scenario = {toml_value(name)}",
        f"seed = {simulator.seed}",
        f'seconds = "{_time(simulator.tick, scenario.tick)!r}s"',
        f'mission = "{MISSION}"',
    ]
    lines += [f"world_seed = {changes.seed}"] if changes.seed not in (None, simulator.seed) else []
    lines += ["own_mission = true"] if is_run_again(inputs, scenario.tick) else []
    lines += [f"robots = {changes.robots}"] if changes.robots is not None else []
    lines += [f"area_per_robot = {changes.area_per_robot!r}"] if changes.area_per_robot is not None else []
    lines += [] if changes.walls else ["walls = false"]
    lines += [f'state = "{simulator.state_hash()}"'] if exact else []
    over = [f"{toml_value(key)} = {toml_value(value)}" for key, value in changes.over]
    lines += ["", "[over]", *over] if over else []
    for goal in goals:
        lines += ["", "[[goals]]", f"holds = {toml_value(goal)}"]
    return {FILE: "".join(f"{line}\n" for line in lines), MISSION: written_mission([each.order for each in orders])}


def write_files(folder: Path, files: Mapping[str, str]) -> None:
    """Make a folder of these files. Raises MisuseError for one that exists, or cannot be made."""
    try:
        folder.mkdir(parents=True)
        for name, text in files.items():
            (folder / name).write_text(text, encoding="utf-8", newline="\n")
    except FileExistsError:
        raise MisuseError(f"{folder} already exists: choose another name") from None
    except OSError as error:
        raise MisuseError(f"{folder} cannot be written: {error.strerror or error}") from None
