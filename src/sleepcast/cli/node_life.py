"""The life of one node: its names, its beginning, its ticks, and what is told of them at the end."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import inf
from pathlib import Path

from sleepcast.bridges import RealRobot
from sleepcast.channel.plain_datagrams import Datagrams
from sleepcast.channel.session import ChannelSession
from sleepcast.cli.node_desk import NOTHING_HEARD, NodeDesk, Typed
from sleepcast.cli.streams import announce, complain, pieces, read_file
from sleepcast.cli.time_taken import seek_time
from sleepcast.cli.told import heard_at, news_of
from sleepcast.core.clock import Clock, UnixClock, WallClock, epoch_at
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.language import List, Symbol, read, read_all, show
from sleepcast.loop import vocabulary_of
from sleepcast.loop.real import Watch, run_robot
from sleepcast.node.node import Node
from sleepcast.node.store import Store
from sleepcast.nomad.vocabulary import nomad_vocabulary
from sleepcast.simulator.mission import Order, parse_mission


class BeginningError(SleepcastError):
    """What a robot is to begin with went wrong."""


@dataclass(frozen=True, slots=True)
class Beginning:
    """What a robot begins with: expressions with their places (file and line), and orders for later."""

    expressions: tuple[tuple[str, str], ...] = ()
    orders: tuple[Order, ...] = ()


def read_beginning(path: Path) -> Beginning:
    """A file of expressions, or, where it begins with a time, a mission script. Raises MisuseError."""
    text = read_file(path)
    if any(line.startswith("@") for line in text.split("\n")):
        return Beginning(orders=parse_mission(text, str(path)))
    return Beginning(tuple(_expressions(text, path)))


def _expressions(text: str, path: Path) -> Iterator[tuple[str, str]]:
    for line, piece in pieces(text):
        place = f"{path}:{line}"
        try:
            forms = read_all(piece)
        except SleepcastError as error:
            raise MisuseError(f"{place}: {error}") from error
        yield from ((place, piece[form.start : form.end]) for form in forms)


def begin_with(node: Node, beginning: Beginning) -> None:
    """Evaluate a robot's first expressions. Raises MisuseError for one that it cannot run, BeginningError for one that
    goes wrong."""
    for place, text in beginning.expressions:
        try:
            result = node.evaluate(text)
        except SleepcastError as error:
            raise MisuseError(f"{place}: {error}") from error
        if result.faults:
            raise BeginningError(f"{place}: {result.faults[0]}")


def install(node: Node, golden: Beginning) -> None:
    """Give a robot rules that nobody changes over the air. Raises MisuseError for what is no rule, or is refused."""
    for place, text in golden.expressions:
        match read(text):
            case List(items=(Symbol(key="rule"), Symbol() as name, rule)):
                try:
                    node.install(name.text, show(rule))
                except SleepcastError as error:
                    raise MisuseError(f"{place}: {error}") from error
            case _:
                raise MisuseError(f"{place}: wanted (RULE name expression), not {text!r:.200}")


class Life:
    """A mind in a body. ears: where plain datagrams come in, if they do. session: the radio, if there is one. store:
    what outlives this life, if anything does. nomad: whether functions with Nclient's names take its units. lease: s
    for which a body that is driven goes on while nobody is heard."""

    def __init__(
        self,
        name: str,
        robot: RealRobot,
        ears: Datagrams | None,
        session: ChannelSession | None,
        store: Store | None,
        *,
        nomad: bool,
        number: int,
        seed: int,
        lease: float,
    ) -> None:
        self.robot, self.ears, self.session, self.store, self.watch = robot, ears, session, store, Watch()
        names = vocabulary_of(nomad_vocabulary(robot.model) if nomad else robot.model)
        self.node = Node(name, names, number=number, seed=seed, body=robot, lease=lease, on_air=session is not None)
        self._orders: tuple[Order, ...] = ()

    def begin(self, golden: Beginning, beginning: Beginning) -> None:
        """Go on where the life before this one ended, or evaluate what the robot begins with; see `begin_with`.
        golden: rules that are built in, in every life."""
        self.node.sense(self.robot.sense().values, 0.0)
        install(self.node, golden)
        if self.ears is not None:
            self.node.evaluate(NOTHING_HEARD)
        self._orders = beginning.orders
        self.node.clock = UnixClock()
        self.node.zero = self.node.clock.now()
        if self.session is not None:
            self.session.zero = self.node.zero
            seek_time(self.session.delivery, self.session, [self.node, self.session], complain)
        if self.store is not None and self.store.adopt(
            self.node, None if self.session is None else self.session.delivery
        ):
            complain(f"{self.node.name} goes on where it was ({self.store.file})")
        else:
            begin_with(self.node, beginning)
        if self.store is not None and (standing := self.store.standing()):
            complain(standing)

    def go_on(self, check: Callable[[], None], tick: float, seconds: float | None) -> None:
        """Live, and say at the end how it went. check: raises KeyboardInterrupt when it is time. tick: s, 0 in step.
        seconds: to live, None for ever. Raises SleepcastError when the body fails."""
        clock: Clock = WallClock() if tick else self.robot
        session = self.session
        epoch, authority = epoch_at(self.node.zero), self.node.authority
        desk = NodeDesk(
            self.node.name, clock, self._orders, Typed(), self.ears, session, epoch, lambda: authority.latch.holding
        )
        end = inf if seconds is None else clock.now() + seconds
        news = None if session is None else news_of(session.delivery.admission)

        def going() -> bool:
            for complaint in (*self.robot.complaints(), *(news.lines() if news else ())):
                complain(f"{self.node.name}: {complaint}")
            check()
            return clock.now() < end

        rules = len(self.node.rules())
        told = "1 rule" if rules == 1 else f"{rules} rules"
        announce(f"{self.node.name} is up, with {told}; Ctrl-C stops its body and ends it")
        try:
            sleep = time.sleep if session is None else session.wait
            run_robot(
                *(self.node, self.robot, clock, desk),
                tick=tick,
                going=going,
                watch=self.watch,
                sleep=sleep,
                keeper=self.store,
            )
        finally:
            self.robot.close()
            complain(self._account(desk))

    def _account(self, desk: NodeDesk) -> str:
        said = f"{self.node.name}: {self.watch}"
        if self.session is not None:
            admission = self.session.delivery.admission
            said += f"; {heard_at(admission)}"
            for sender, ahead in admission.offsets.all(UnixClock().now()).items():
                said += f"; our clock is {abs(ahead):.2f} s {'ahead of' if ahead > 0.0 else 'behind'} that of {sender}"
        if self.ears is not None:
            counts = self.ears.counts
            said += f"; {counts.taken} datagrams, {counts.dropped + desk.lost} others dropped"
        if self.robot.lost:
            return f"{said}; its body is out of reach, so nobody here knows what it does: a Nomad stops by itself"
        return f"{said}; its body has been stopped"
