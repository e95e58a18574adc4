"""One node in its process: its names, its start, its ticks, what is printed at the end."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from math import inf
from pathlib import Path
from typing import Protocol

from sleepcast.api.connection import keeper_for
from sleepcast.bridges import RealRobot
from sleepcast.bridges.mavlink.ground_station import GroundStation
from sleepcast.channel import Kind
from sleepcast.channel.clock_sync import differs, took
from sleepcast.channel.message import TOOK
from sleepcast.channel.plain_datagrams import Datagrams
from sleepcast.channel.reliable import ReliableDelivery
from sleepcast.channel.session import ChannelSession
from sleepcast.cli.describe import heard_text, notices_of
from sleepcast.cli.local_input import GROUND, LocalInput, TypedLines
from sleepcast.cli.streams import announce, complain, pieces, read_file
from sleepcast.core.clock import MADE, Clock, UnixClock, WallClock, epoch_at
from sleepcast.core.errors import MisuseError, SleepcastError, counted, in_file
from sleepcast.core.records import dataclass
from sleepcast.language import List, Symbol, read, read_all, show
from sleepcast.language.parts import ONLY_PRIORITY, rank_of
from sleepcast.loop import vocabulary_of
from sleepcast.loop.real import EmbodiedMind, TickTiming, run_robots
from sleepcast.mind.authority import Tells
from sleepcast.mind.instants import MeasuredClocks, UnknownClocks
from sleepcast.node.node import Node
from sleepcast.node.store import Store
from sleepcast.simulator.scenario.mission import Order, parse_mission

MAX_SENTENCE = 300
"""Characters of a sentence about the body that goes to the desks: one datagram has room for it."""
NOTHING_HEARD = "(DEFVAR message FALSE)"
"""Evaluated at the start, so that rules can ask whether a datagram has come."""


class StartScriptError(SleepcastError):
    """What a robot is to begin with went wrong."""


@dataclass(frozen=True, slots=True)
class StartScript:
    """What a robot begins with: expressions with their places (file and line), and orders for later."""

    expressions: tuple[tuple[str, str], ...] = ()
    orders: tuple[Order, ...] = ()


def read_start_script(path: Path) -> StartScript:
    """A file of expressions, or, where it begins with a time, a mission script. Raises MisuseError."""
    text = read_file(path)
    if any(line.startswith("@") for line in text.split("\n")):
        return StartScript(orders=parse_mission(text, str(path)))
    return StartScript(tuple(_expressions(text, path)))


def _expressions(text: str, path: Path) -> Iterator[tuple[str, str]]:
    for line, piece in pieces(text):
        place = f"{path}:{line}"
        try:
            forms = read_all(piece)
        except SleepcastError as error:
            raise MisuseError(in_file(place, str(error))) from error
        yield from ((place, piece[form.start : form.end]) for form in forms)


def run_start_script(node: Node, beginning: StartScript) -> None:
    """Evaluate a robot's first expressions. Raises MisuseError for one that it cannot run, StartScriptError for one
    that goes wrong."""
    for place, text in beginning.expressions:
        try:
            result = node.evaluate(text)
        except SleepcastError as error:
            raise MisuseError(in_file(place, str(error))) from error
        if result.faults:
            raise StartScriptError(f"{place}: {result.faults[0]}")


def install(node: Node, locked: StartScript) -> None:
    """Give a robot rules that cannot be changed over the air. Raises MisuseError for a malformed or refused one."""
    for place, text in locked.expressions:
        match read(text):
            case List(items=(Symbol(key="rule"), Symbol() as name, rule, *behind)):
                rank = rank_of(behind)
                if rank is None:
                    raise MisuseError(f"{place}: RULE stores one expression: {ONLY_PRIORITY}, in {text!r:.200}")
                try:
                    node.install(name.text, show(rule), priority=rank)
                except SleepcastError as error:
                    raise MisuseError(in_file(place, str(error))) from error
            case _:
                raise MisuseError(f"{place}: wanted (RULE name expression), not {text!r:.200}")


class NodeProcess:
    """A mind in a body.

    listener: where plain datagrams come in, if they do.
    session: the radio, if there is one.
    store: what outlives this process, if anything does.
    lease: for how long a driven body goes on while no operator is heard, s.
    tells: see `Node`.
    ground: the ground station that sees it, if one does.
    typed: whether lines of standard input are for it.
    """

    def __init__(
        self,
        name: str,
        robot: RealRobot,
        listener: Datagrams | None,
        session: ChannelSession | None,
        store: Store | None,
        *,
        number: int,
        seed: int,
        lease: float,
        tells: Tells = Tells.ALL,
        ground: GroundStation | None = None,
        typed: bool = True,
    ) -> None:
        self.robot, self.listener, self.session, self.store, self.watch = robot, listener, session, store, TickTiming()
        self.ground, self._typed = ground, typed
        names = vocabulary_of(robot.model)
        air = session is not None
        self.node = Node(name, names, number=number, seed=seed, body=robot, lease=lease, tells=tells, on_air=air)
        self._orders: tuple[Order, ...] = ()

    def begin(self, locked: StartScript, beginning: StartScript, *, seeks_time: bool = True) -> None:
        """Go on where the process before this one ended, or evaluate what the robot begins with; see
        `run_start_script`.

        locked: rules that nobody changes over the air, after every start.
        seeks_time: see `seek_time`.
        """
        self.node.sense(self.robot.sense().values, 0.0)
        install(self.node, locked)
        if self.listener is not None:
            self.node.evaluate(NOTHING_HEARD)
        self._orders = beginning.orders
        self.node.clock = UnixClock()
        self.node.zero = self.node.clock.now()
        if self.session is not None:
            self.session.zero = self.node.zero
            self.node.timing.clocks = MeasuredClocks(self.session.delivery.trips, lambda: self.node.zero)
            if seeks_time:
                seek_time(self.session.delivery, self.session, [self.node, self.session], complain)
        if self.store is not None and self.store.adopt(
            self.node, None if self.session is None else self.session.delivery
        ):
            complain(f"{self.node.name} goes on where it was ({self.store.file})")
        else:
            run_start_script(self.node, beginning)
        if self.store is not None and (standing := self.store.standing()):
            complain(standing)

    def _unit_of(self, command: str) -> str:
        """The unit in which people read the value of a command, by its id."""
        try:
            return self.node.why(command).root.unit
        except SleepcastError:  # it could not be read, say
            return ""

    def mind(self, *, in_step: bool = False) -> EmbodiedMind:
        """What is to run, once it has begun. in_step: whether the body's time is the mind's, too."""
        clock: Clock = self.robot if in_step else MindClock(self.node)
        authority = self.node.authority
        self._news = None if self.session is None else notices_of(self.session.delivery.admission)
        self._desk = LocalInput(
            self.node.name,
            clock,
            self._orders,
            TypedLines() if self._typed else None,
            self.listener,
            self.session,
            epoch_at(self.node.zero),
            lambda: [mark.named for mark in authority.latch.holding],
            self.ground,
            [actuator.name for actuator in self.robot.model.actuators],
            self._unit_of,
        )
        start = clock.now() if in_step else 0.0
        if in_step:  # its time is not that of those who send
            self.node.timing.clocks = UnknownClocks()
        session = self.session
        keeper = self.store if session is None else keeper_for([self.node], session.delivery, self.store)
        return EmbodiedMind(
            *(self.node, self.robot, clock, self._desk, self.watch, keeper, start),
            is_catching_up=lambda: session is not None and session.is_catching_up,
        )

    def tend(self) -> None:
        """Say what has gone wrong; to be called before each tick."""
        for line in self._news.lines() if self._news else ():
            complain(f"{self.node.name}: {line}")
        for sentence in self.robot.complaints():
            self.say(sentence)
        if self.ground is not None:
            for sentence in self.ground.complaints():
                self.say(sentence)
            held = bool(self.node.doubt) or any(mark.sender != GROUND for mark in self.node.authority.latch.holding)
            released = self._desk.is_releasing and not held
            self.ground.tell(dict(self.node.variables()), stopped=self.node.stopped and not released, held=held)

    def rules_text(self) -> str:
        """How many rules it has, in words."""
        return counted(len(self.node.rules()), "rule")

    def go_on(self, check: Callable[[], None], tick: float, seconds: float | None) -> None:
        """Run, and say at the end how it went. Raises SleepcastError when the body fails.

        check: raises KeyboardInterrupt when it is time to end.
        tick: s; 0: in step with the body.
        seconds: for how long; None: for ever.
        """
        clock: Clock = WallClock() if tick else self.robot
        mind = self.mind(in_step=not tick)
        end = inf if seconds is None else clock.now() + seconds

        def going() -> bool:
            self.tend()
            check()
            return clock.now() < end

        announce(f"{self.node.name} is up, with {self.rules_text()}; Ctrl-C stops its body and ends it")
        try:
            run_robots(
                [mind], clock, tick=tick, going=going, sleep=time.sleep if self.session is None else self.session.wait
            )
        finally:
            self.robot.close()
            complain(self.account())

    def say(self, sentence: str) -> None:
        """What has gone wrong with the body: here, and, where there is a channel, at every desk."""
        if self.session is None:
            complain(f"{self.node.name}: {sentence}")
        else:
            self.node.remark(sentence[:MAX_SENTENCE])

    def account(self) -> str:
        """How it went, in a sentence."""
        parts = [f"{self.node.name}: {self.watch}"]
        if self.session is not None:
            admission = self.session.delivery.admission
            parts.append(heard_text(admission))
            for sender, ahead in admission.offsets.all(UnixClock().now()).items():
                than = "ahead of" if ahead > 0.0 else "behind"
                parts.append(f"our clock is {abs(ahead):.2f} s {than} that of {sender}")
        if self.listener is not None:
            counts = self.listener.counts
            parts.append(f"{counts.taken} datagrams, {counts.dropped + self._desk.lost} others dropped")
        stopped = "its body has been stopped"
        parts.append("its body is out of reach, so nobody here knows what it does" if self.robot.lost else stopped)
        return "; ".join(parts)


def number_in(name: str) -> int:
    """The id of a robot of which only the name is known: the number at its end, or 0."""
    digits = name[len(name.rstrip("0123456789")) :]
    return int(digits[-6:] or "0")


class MindClock:
    """The time of a node's mind, s since its zero, by which deadlines count: its start, and a sleep of the computer,
    are in it."""

    def __init__(self, node: Node) -> None:
        self._node, self._clock = node, UnixClock()

    def now(self) -> float:
        return self._clock.now() - self._node.zero


class Zeroed(Protocol):
    """Something whose time began at a moment, s of Unix time."""

    zero: float


def seek_time(
    listening: ReliableDelivery, session: ChannelSession, zeroed: Sequence[Zeroed], say: Callable[[str], None]
) -> None:
    """If the clock is plainly wrong, ask for the time; the robots' own time goes on as it does.

    listening: what hears for them.
    session: of the one that tells the operators.
    zeroed: all whose time began by the wrong clock, to which more may come.
    say: prints a sentence.
    """
    if UnixClock().now() >= MADE:
        return

    def take(behind: float, whose: str) -> None:
        UnixClock.advance(behind)
        for each in zeroed:
            each.zero += behind
        body: dict[str, object] = {"label": "clock", "values": [behind], TOOK: whose}
        session.delivery.post(Kind.REPORT, UnixClock().now(), body=body)
        session.flush()
        say(took([session.delivery.name], whose, differs(-behind)))

    say("this computer's clock is plainly wrong: nothing but STOP is obeyed until an operator has sent the time")
    listening.seek_time(take)
