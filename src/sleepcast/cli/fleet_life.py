"""The minds of a ROS 2 fleet in one process: each is a node as `sleepcast node` has it, with a name, a store and a
session of its own; all share one participant in the ROS domain and one transport of the channel.

Robots are named, or found: then a namespace that has become a robot gets a mind, also later. A robot that goes keeps
its mind, whose body is out of reach until it is back. Whatever goes wrong with one robot is said, and the others go on.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import field
from math import inf
from pathlib import Path

from sleepcast.api.connection import AirOptions, chosen_keys, multiplexer_for, open_store, session_for, store_file
from sleepcast.bridges import OutOfReachError, begin_body
from sleepcast.bridges.ros2.fleet import DiscoveredRobot, Ros2Fleet
from sleepcast.channel.message import MAX_NAME
from sleepcast.channel.session import wait_together
from sleepcast.cli.node_life import NodeProcess, StartScript, Zeroed, number_in, seek_time
from sleepcast.cli.streams import announce, complain
from sleepcast.core.clock import UnixClock, WallClock
from sleepcast.core.errors import SleepcastError, counted
from sleepcast.core.records import dataclass
from sleepcast.loop.real import EmbodiedMind, run_robots
from sleepcast.mind.authority import Tells
from sleepcast.node.store import StoreError
from sleepcast.robot import Limits

MAX_ROBOTS = 200
"""Minds in one process: more than a core can let think."""
LOOK_EVERY = 1.0
"""Seconds between two looks for robots."""
SETTLED = 5.0
"""Seconds for which a namespace may lack something before that is said: topics of a robot are found one by one."""
TRY_AGAIN = 10.0
"""Seconds after which a robot gets another try whose mind could not begin."""


class NoMindError(SleepcastError):
    """A robot that cannot have a mind here, as others can."""


@dataclass(frozen=True, slots=True)
class MindOptions:
    """What all minds have in common.

    locked: rules that nobody changes over the air.
    beginning: what they begin with.
    store: the folder of their stores; None for the one in the user's data.
    forgetful: whether there are no stores.
    limits: of the bodies, besides their own.
    lease: for how long a driven body goes on unattended, s.
    tells: see `Node`.
    tick: s.
    """

    locked: StartScript
    beginning: StartScript
    store: Path | None
    forgetful: bool
    limits: Limits
    lease: float
    tells: Tells
    tick: float
    seed: int


@dataclass(slots=True)
class Watched:
    """A namespace that lacks something.

    since: when it was first so, s.
    reported: whether that was said.
    """

    lacks: list[str]
    since: float
    reported: bool = False


@dataclass(slots=True)
class BridgedRobot:
    """A robot's node, and what is to be closed after it."""

    node: NodeProcess
    mind: EmbodiedMind
    stack: ExitStack = field(default_factory=ExitStack)


class FleetProcess:
    """See the module. named: the namespaces of robots, if they are not to be found. Raises what the channel raises."""

    def __init__(self, fleet: Ros2Fleet, air: AirOptions, options: MindOptions, named: Sequence[str]) -> None:
        self._fleet, self._air, self._options, self._named = fleet, air, options, named
        self._clock = WallClock()
        self._began = self._clock.now()
        self._complained: set[str] = set()
        chosen_keys(air, True, self._say_once)  # what is wrong with them is told now, and not of each robot
        self._multiplexer = multiplexer_for(air)
        self._anchor = self._multiplexer.port(())
        """Keeps the transport open while there is no robot."""
        self._members: dict[str, BridgedRobot] = {}
        self._minds: list[EmbodiedMind] = []
        self._zeroed: list[Zeroed] = []
        self._watched: dict[str, Watched] = {}
        self._refused: dict[str, tuple[str, float]] = {}
        """Why a namespace has got no mind, and when that is tried again."""
        self._look_at = -inf
        self._waiting: list[str] = []
        """Namespaces of robots that are to get minds: one in each tick, since a store takes its time to open."""

    def run(self, check: Callable[[], None], seconds: float | None) -> None:
        """Let all minds live, and say at the end how it went. check: raises KeyboardInterrupt when it is time."""
        end = inf if seconds is None else self._clock.now() + seconds

        def going() -> bool:
            self._look()
            if self._waiting:
                self._join(self._waiting.pop(0))
            for member in self._members.values():
                member.node.tend()
            check()
            return self._clock.now() < end

        def sleep(seconds: float) -> None:
            sessions = [member.node.session for member in self._members.values() if member.node.session]
            if sessions:
                wait_together(sessions, self._multiplexer, seconds, UnixClock())
            else:  # what comes is for nobody
                time.sleep(seconds)
                self._anchor.receive()

        try:
            run_robots(self._minds, self._clock, tick=self._options.tick, going=going, sleep=sleep, fails=self._drop)
        finally:
            self._close()

    # ---- robots come and go

    def _look(self) -> None:
        now = self._clock.now()
        if now < self._look_at:
            return
        self._look_at = now + LOOK_EVERY
        try:
            seen = self._fleet.look()
        except OutOfReachError as error:
            self._say_once(str(error))
            return
        if not seen and now - self._began >= SETTLED:
            self._say_once(self._fleet.nobody())
        for robot in seen.values():
            self._watch(robot, now)
        if not self._waiting:
            wanted = self._named or [namespace for namespace, robot in seen.items() if robot.is_robot]
            self._waiting = [each for each in wanted if self._name(each) not in self._members]
        for namespace in self._watched.keys() - seen.keys():
            del self._watched[namespace]

    def _watch(self, robot: DiscoveredRobot, now: float) -> None:
        """Say what a namespace lacks, if it has lacked it for a while: of a robot with a mind here and at the desks,
        where its body itself says what does not fit."""
        name = self._name(robot.namespace)
        member = self._members.get(name)
        lacks = robot.lacks(only_missing=member is not None)
        watched = self._watched.get(robot.namespace)
        if watched is None or watched.lacks != lacks:
            watched = self._watched[robot.namespace] = Watched(lacks, now)
        if not lacks or watched.reported or now - watched.since < SETTLED:
            return
        watched.reported = True
        if member is not None:
            member.node.say("; ".join(lacks))
        elif not robot.is_robot and not self._named:
            complain(f"skipped {name}, which is no robot of this mapping: {'; '.join(lacks)}")

    def _join(self, namespace: str) -> None:
        """Give the robot in this namespace a mind, if it has none."""
        name, now = self._name(namespace), self._clock.now()
        why, again = self._refused.get(namespace, ("", -inf))
        if name in self._members or now < again:
            return
        try:
            with ExitStack() as stack:
                member = self._begun(name, namespace, stack)
                member.stack = stack.pop_all()
        except SleepcastError as error:
            if not self._members and not isinstance(error, StoreError | NoMindError | OutOfReachError):
                raise  # options that will not do for any robot
            if str(error) != why:
                complain(f"skipped {name}: {error}")
            self._refused[namespace] = str(error), now + TRY_AGAIN
            return
        self._members[name] = member
        self._minds.append(member.mind)
        alike = [each for each in self._members if each != name and number_in(each) == number_in(name)]
        if alike:
            complain(f"{name} has the same id as {alike[0]}, {number_in(name)}: what asks for an id means both")
        announce(f"{name} is up, with {member.node.rules_text()}; {counted(len(self._members), 'robot')}")

    def _begun(self, name: str, namespace: str, stack: ExitStack) -> BridgedRobot:
        """The mind of a robot that has begun. stack: closes what it has."""
        if len(name) > MAX_NAME:
            raise NoMindError(f"its name is longer than {MAX_NAME} characters")
        if len(self._members) >= MAX_ROBOTS:
            raise NoMindError(f"there are {MAX_ROBOTS} already: let another process take some, with --robot")
        air, options, store = self._air, self._options, None
        if not options.forgetful:
            file = store_file("robots", air.fleet, name)
            file = file if options.store is None else options.store / file.name
            store = stack.enter_context(closing(open_store(file, complain)))
        body = self._fleet.body(namespace)
        begin_body(body, options.limits)
        stack.callback(body.close)
        session = session_for(air, name, robot=True, say=self._say_once, store=store, multiplexer=self._multiplexer)
        stack.enter_context(closing(session))
        node = NodeProcess(
            name,
            body,
            None,
            session,
            store,
            number=number_in(name),
            seed=options.seed,
            lease=options.lease,
            tells=options.tells,
            typed=False,
        )
        node.begin(options.locked, options.beginning, seeks_time=False)
        self._zeroed += (node.node, session)
        if not self._members:
            seek_time(session.delivery, session, self._zeroed, complain)
        return BridgedRobot(node, node.mind())

    def _name(self, namespace: str) -> str:
        return namespace.removeprefix("/") or self._fleet.mapping.name

    def _say_once(self, sentence: str) -> None:
        if sentence not in self._complained:
            self._complained.add(sentence)
            complain(sentence)

    def _drop(self, mind: EmbodiedMind, error: SleepcastError) -> None:
        """End a mind that cannot go on."""
        name = mind.node.name
        complain(f"{name}: {error}; its mind ends, and the others go on")
        mind.end()
        self._minds.remove(mind)
        self._members.pop(name).stack.close()

    def _close(self) -> None:
        """Close all bodies at once, since each may wait until its last commands have arrived."""
        members = list(self._members.values())
        if members:
            with ThreadPoolExecutor(len(members)) as pool:
                list(pool.map(lambda member: member.node.robot.close(), members))
        for member in members:
            complain(member.node.account())
            member.stack.close()
        self._anchor.close()
