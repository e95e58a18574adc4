"""`sleepcast swarm`: many robots' minds in one process, with bodies in the simulator, on a real channel."""

from __future__ import annotations

from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from sleepcast.api.connection import AirOptions, keeper_for, open_store, sessions_for
from sleepcast.cli.air import store_option, with_keys
from sleepcast.cli.interrupts import Interrupts
from sleepcast.cli.options import SEED, QuantityType, each_rules_option, restraints
from sleepcast.cli.streams import announce, complain
from sleepcast.core.errors import MisuseError
from sleepcast.core.records import dataclass

if TYPE_CHECKING:
    from sleepcast.cli.node_life import StartScript
    from sleepcast.loop.real import NetworkSwarm
    from sleepcast.mind.authority import Tells
    from sleepcast.node.store import Store
    from sleepcast.simulator import Scenario

MAX_NODES = 10_000
"""Nodes in one process: more than a core can let think; a simulated swarm (`sleepcast run`) takes a million."""
FEW = 500
"""Bodies that NumPy moves in a few milliseconds a tick; for more it is worth to load and compile kernels."""
MAX_ID = 1_000_000
"""The highest number of a robot: what its name ends in."""
CHANNEL = "udp://239.255.83.76:47123?interface=lo"
"""Unless another one is said: multicast that stays on this machine."""
SCENARIO = "bravo"
"""The world, unless another one is said."""


@dataclass(frozen=True, slots=True)
class SwarmOptions:
    """Which robots.

    names: of all of them.
    first: the number of the first one.
    scenario: of their bodies, by name or file.
    seed: what chance depends on; None for the scenario's.
    lease: for how long a driven body goes on unattended, s.
    limits: the file of the bodies' limits.
    tells: what they may have each other do.
    """

    names: list[str]
    first: int
    scenario: str
    seed: int | None
    lease: float
    limits: Path | None
    tells: Tells


@click.command("swarm")
@click.argument("count", metavar="N", type=click.IntRange(1, MAX_NODES))
@click.option(
    "--channel", metavar="URI", default=CHANNEL, show_default=True, help="The channel on which commands arrive."
)
@click.option(
    "--scenario", metavar="NAME|FILE", default=SCENARIO, show_default=True, help="The world in which the robots move."
)
@click.option("--name-prefix", "prefix", default="r", show_default=True, help="Prefix of the robots' names.")
@click.option(
    "--first", type=click.IntRange(0, MAX_ID), default=1, show_default=True, help="Number of the first robot."
)
@each_rules_option
@store_option
@restraints
@with_keys
@click.option("--seed", type=SEED, help="Random seed (default: the scenario's).")
@click.option("--seconds", metavar="TIME", type=QuantityType(), help="End after this time (default: at Ctrl-C).")
def swarm(
    count: int,
    channel: str,
    scenario: str,
    prefix: str,
    first: int,
    rules: Path | None,
    file: Path | None,
    lease: str,
    limits: Path | None,
    tells: str,
    air: AirOptions,
    seed: int | None,
    seconds: float | None,
) -> int:
    """Run N robots, r1 to rN, each with its own mind, until Ctrl-C, which stops their bodies first.

    Their bodies live in the world of a scenario, in real time; they obey commands from the air (`sleepcast send`). Each
    process has a world of its own: with --first, several of them, on one computer or many, make one large fleet.

    \b
    Examples:
      sleepcast swarm 200
      sleepcast swarm 50 --store fifty.store
      sleepcast swarm 50 --first 51 --channel udp://192.168.1.255:47123
      sleepcast swarm 20 --scenario maze --name-prefix scout --rules wall.sleep
    """
    _check_names(prefix, first, count)
    with Interrupts() as interrupts, ExitStack() as stack:
        from sleepcast.cli.describe import notices_of
        from sleepcast.cli.node_life import StartScript, read_start_script
        from sleepcast.mind.authority import Tells, read_lease

        beginning = None if rules is None else read_start_script(rules)
        if beginning is not None and beginning.orders:
            raise MisuseError(f"{rules} is a mission script: a swarm begins with expressions, without times")
        names = [f"{prefix}{first + i}" for i in range(count)]
        store = None if file is None else stack.enter_context(closing(open_store(file, complain)))
        chosen = SwarmOptions(names, first, scenario, seed, read_lease(lease), limits, Tells(tells))
        crew = _crew(stack, replace(air, channel=channel), chosen, store)
        interrupts.defer()
        _begin(crew, beginning or StartScript(), store)
        names = [member.node.name for member in crew.members]
        announce(f"{names[0]} to {names[-1]} are up: {count} robots; Ctrl-C stops their bodies and ends them")
        clock = crew.clock
        end = None if seconds is None else clock.now() + seconds
        news = notices_of(crew.receiver.delivery.admission)

        def going() -> bool:
            for line in news.lines():
                complain(line)
            interrupts.check()
            return end is None or clock.now() < end

        try:
            crew.run(going)
        finally:
            complain(_account(crew))
    return 0


def _check_names(prefix: str, first: int, count: int) -> None:
    from sleepcast.channel.message import MAX_NAME, is_robot_name

    last = f"{prefix}{first + count - 1}"
    if first + count - 1 > MAX_ID:
        raise MisuseError(f"--first {first} and {count} robots lead to {last}: numbers go up to {MAX_ID}")
    if not is_robot_name(last):
        raise MisuseError(f"--name-prefix {prefix!r:.80}: wanted names of at most {MAX_NAME} letters without blanks")


def _crew(stack: ExitStack, air: AirOptions, wanted: SwarmOptions, store: Store | None) -> NetworkSwarm:
    """The minds with their bodies and their lines. Raises what the channel and the simulator raise."""
    from sleepcast.cli.node_life import seek_time
    from sleepcast.core.clock import UnixClock, WallClock
    from sleepcast.core.counter_rng import key
    from sleepcast.loop import vocabulary_of
    from sleepcast.loop.real import Member, NetworkSwarm
    from sleepcast.mind.instants import MeasuredClocks
    from sleepcast.node.node import Node
    from sleepcast.simulator import (
        Changes,
        SafetyLimits,
        Simulator,
        choose,
        find_scenario,
        limited,
        named_by_starts,
        read_limits,
    )

    limits = None if wanted.limits is None else read_limits(wanted.limits)
    scenario = find_scenario(wanted.scenario, Changes(len(wanted.names), None, True))
    scenario = _from_start(scenario if limits is None else limited(scenario, limits), wanted.first)
    seed, first = scenario.seed if wanted.seed is None else wanted.seed, wanted.first
    names = named_by_starts(scenario.each_type, wanted.names)
    if len({*names}) < len(names):
        raise MisuseError(f"two robots of {scenario.path} would have one name: choose another --name-prefix")
    machine = choose("numpy", 1) if len(wanted.names) <= FEW else None
    # Others elsewhere begin in other places.
    simulator = Simulator(scenario, key(seed, "crew", first) >> 1, machine, threads=1)
    simulator.bodies.first_id = first
    vocabulary = vocabulary_of(simulator.model)
    multiplexer, receiver, sessions = sessions_for(air, names, complain, store)
    stack.enter_context(closing(receiver))
    members = []
    for i, (name, session) in enumerate(zip(names, sessions, strict=True)):
        stack.enter_context(closing(session))
        body = simulator.robots[i]
        node = Node(
            *(name, vocabulary),
            number=first + i,
            seed=seed,
            body=body,
            lease=wanted.lease,
            tells=wanted.tells,
            on_air=True,
        )
        members.append(Member(node, i, session))
    receiver.zero = zero = UnixClock().now()
    for member in members:
        member.node.zero = member.session.zero = zero
        member.node.clock = UnixClock()
        member.node.timing.clocks = MeasuredClocks(receiver.delivery.trips, lambda: receiver.zero)
    everybody = [each for member in members for each in (member.node, member.session)]
    seek_time(receiver.delivery, sessions[0], [receiver, *everybody], complain)
    guard = None if limits is None else SafetyLimits(simulator, limits)
    keeper = keeper_for([member.node for member in members], receiver.delivery, store)
    return NetworkSwarm(simulator, members, multiplexer, receiver, WallClock(), UnixClock(), guard=guard, keeper=keeper)


def _from_start(scenario: Scenario, first: int) -> Scenario:
    """The scenario with the starts of the robots from number `first` on."""
    from sleepcast.simulator import later_starts

    robots = scenario.robots
    if scenario.sorts or not isinstance(robots.starts, tuple) or not robots.starts:
        return scenario
    with_later = later_starts(robots, max(first - 1, 0))
    if with_later is None:
        raise MisuseError(
            f"--first {first} and {robots.count} robots lead to {first - 1 + robots.count}, and {scenario.path} has "
            f"{len(robots.starts)} starts: write more of them, or use fewer robots"
        )
    return replace(scenario, robots=with_later)


def _begin(crew: NetworkSwarm, beginning: StartScript, store: Store | None) -> None:
    """Let every mind go on where it was, or evaluate what it begins with."""
    from sleepcast.cli.node_life import run_start_script

    readings = crew.simulator.readings()
    for member in crew.members:
        member.node.sense(readings[member.number], 0.0)
        if store is None or not store.adopt(member.node, None):
            run_start_script(member.node, beginning)
    if store is not None and (standing := store.standing()):
        complain(standing)


def _account(crew: NetworkSwarm) -> str:
    """How it went, in a sentence."""
    from sleepcast.cli.describe import heard_text

    heard = heard_text(crew.receiver.delivery.admission)
    return f"{len(crew.members)} robots: {crew.watch}; {heard}; their bodies have been stopped"
