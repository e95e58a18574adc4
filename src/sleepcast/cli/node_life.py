"""One node's process: its names, its start, its ticks, what is printed at the end.

Without a channel it takes orders with their times, typed lines and plain datagrams in the channel's place. Nothing here
waits.
"""

from __future__ import annotations

import os
import select
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import inf, nan
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from sleepcast.bridges import RealRobot
from sleepcast.bridges.ground_station import GroundStation, Wish
from sleepcast.channel import Channel, Kind, Message
from sleepcast.channel.clock_sync import differs, took
from sleepcast.channel.message import ENDS, MAX_TEXT, TOOK
from sleepcast.channel.plain_datagrams import Datagrams, Numbers
from sleepcast.channel.reliable import ReliableDelivery
from sleepcast.channel.session import ChannelSession
from sleepcast.cli.describe import heard_text, notices_of
from sleepcast.cli.standard_memory import reported_body
from sleepcast.cli.streams import announce, complain, pieces, read_file, still_open
from sleepcast.core.clock import MADE, Clock, UnixClock, WallClock, epoch_at
from sleepcast.core.errors import MisuseError, SleepcastError, printable
from sleepcast.language import List, Symbol, format_value, read, read_all, show
from sleepcast.loop import vocabulary_of
from sleepcast.loop.real import Watch, run_robot
from sleepcast.node.node import Node
from sleepcast.node.store import Store
from sleepcast.nomad.vocabulary import nomad_vocabulary
from sleepcast.simulator.scenario.mission import Order, parse_mission

if TYPE_CHECKING:
    from sleepcast.simulator import Order


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
            raise MisuseError(f"{place}: {error}") from error
        yield from ((place, piece[form.start : form.end]) for form in forms)


def run_start_script(node: Node, beginning: StartScript) -> None:
    """Evaluate a robot's first expressions. Raises MisuseError for one that it cannot run, BeginningError for one that
    goes wrong."""
    for place, text in beginning.expressions:
        try:
            result = node.evaluate(text)
        except SleepcastError as error:
            raise MisuseError(f"{place}: {error}") from error
        if result.faults:
            raise StartScriptError(f"{place}: {result.faults[0]}")


def install(node: Node, golden: StartScript) -> None:
    """Give a robot rules that cannot be changed over the air. Raises MisuseError for a malformed or refused one."""
    for place, text in golden.expressions:
        match read(text):
            case List(items=(Symbol(key="rule"), Symbol() as name, rule)):
                try:
                    node.install(name.text, show(rule))
                except SleepcastError as error:
                    raise MisuseError(f"{place}: {error}") from error
            case _:
                raise MisuseError(f"{place}: wanted (RULE name expression), not {text!r:.200}")


class NodeProcess:
    """A mind in a body. listener: where plain datagrams come in, if they do. session: the radio, if there is one.
    store: what outlives this life, if anything does. nomad: whether functions with Nclient's names take its units.
    lease: s for which a body that is driven goes on while no operator is heard. ground: the ground station that sees
    it, if one does."""

    def __init__(
        self,
        name: str,
        robot: RealRobot,
        listener: Datagrams | None,
        session: ChannelSession | None,
        store: Store | None,
        *,
        nomad: bool,
        number: int,
        seed: int,
        lease: float,
        ground: GroundStation | None = None,
    ) -> None:
        self.robot, self.listener, self.session, self.store, self.watch = robot, listener, session, store, Watch()
        self.ground = ground
        names = vocabulary_of(nomad_vocabulary(robot.model) if nomad else robot.model)
        self.node = Node(name, names, number=number, seed=seed, body=robot, lease=lease, on_air=session is not None)
        self._orders: tuple[Order, ...] = ()

    def begin(self, golden: StartScript, beginning: StartScript) -> None:
        """Go on where the life before this one ended, or evaluate what the robot begins with; see `begin_with`.
        golden: rules that are built in, in every life."""
        self.node.sense(self.robot.sense().values, 0.0)
        install(self.node, golden)
        if self.listener is not None:
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
            run_start_script(self.node, beginning)
        if self.store is not None and (standing := self.store.standing()):
            complain(standing)

    def go_on(self, check: Callable[[], None], tick: float, seconds: float | None) -> None:
        """Live, and say at the end how it went. check: raises KeyboardInterrupt when it is time. tick: s, 0 in step.
        seconds: to live, None for ever. Raises SleepcastError when the body fails."""
        clock: Clock = WallClock() if tick else self.robot
        session = self.session
        epoch, authority = epoch_at(self.node.zero), self.node.authority
        desk = LocalInput(
            self.node.name,
            clock,
            self._orders,
            TypedLines(),
            self.listener,
            session,
            epoch,
            lambda: authority.latch.holding,
            self.ground,
            [actuator.name for actuator in self.robot.model.actuators],
        )
        end = inf if seconds is None else clock.now() + seconds
        news = None if session is None else notices_of(session.delivery.admission)

        def going() -> bool:
            for line in news.lines() if news else ():
                complain(f"{self.node.name}: {line}")
            for sentence in self.robot.complaints():
                self._say(sentence)
            if self.ground is not None:
                for sentence in self.ground.complaints():
                    self._say(sentence)
                self.ground.tell(dict(self.node.variables()), stopped=self.node.stopped)
            check()
            return clock.now() < end

        rules = len(self.node.rules())
        rules_text = "1 rule" if rules == 1 else f"{rules} rules"
        announce(f"{self.node.name} is up, with {rules_text}; Ctrl-C stops its body and ends it")
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

    def _say(self, sentence: str) -> None:
        """What has gone wrong with the body: here, and, where there is a channel, at every desk."""
        if self.session is None:
            complain(f"{self.node.name}: {sentence}")
        else:
            self.node.remark(sentence[:MAX_SENTENCE])

    def _account(self, desk: LocalInput) -> str:
        said = f"{self.node.name}: {self.watch}"
        if self.session is not None:
            admission = self.session.delivery.admission
            said += f"; {heard_text(admission)}"
            for sender, ahead in admission.offsets.all(UnixClock().now()).items():
                said += f"; our clock is {abs(ahead):.2f} s {'ahead of' if ahead > 0.0 else 'behind'} that of {sender}"
        if self.listener is not None:
            counts = self.listener.counts
            said += f"; {counts.taken} datagrams, {counts.dropped + desk.lost} others dropped"
        if self.robot.lost:
            return f"{said}; its body is out of reach, so nobody here knows what it does"
        return f"{said}; its body has been stopped"


class Zeroed(Protocol):
    """Something whose time began at a moment, s of Unix time."""

    zero: float


def seek_time(
    listening: ReliableDelivery, session: ChannelSession, zeroed: Iterable[Zeroed], say: Callable[[str], None]
) -> None:
    """If the clock is plainly wrong, ask for the time; the robots' own time goes on as it does. listening: what hears
    for them; session: of the one that tells the operators; zeroed: all whose time began by the wrong clock."""
    if UnixClock().now() >= MADE:
        return
    everything = list(zeroed)

    def take(behind: float, whose: str) -> None:
        UnixClock.advance(behind)
        for each in everything:
            each.zero += behind
        body: dict[str, object] = {"label": "clock", "values": [behind], TOOK: whose}
        session.delivery.post(Kind.REPORT, UnixClock().now(), body=body)
        session.flush()
        say(took([session.delivery.name], whose, differs(-behind)))

    say("this computer's clock is plainly wrong: nothing but STOP is obeyed until an operator has sent the time")
    listening.seek_time(take)


OPERATOR, SENDER, GROUND = "terminal", "datagram", "ground-station"
"""Who sends what is typed and what stands in a file, who sends plain datagrams, and who sends MAVLink."""
MAX_SENTENCE = 300
"""Characters of a sentence about the body that goes to the desks: one datagram has room for it."""
MAX_WAITING = 64
"""Datagrams that wait: the robot receives one in each tick; only a fault makes them come faster."""
PIECE = 65_536
"""Bytes of standard input that are looked at in one tick."""
SAFETY = {"stopped": "and at rest until RELEASE", "released": "and free to be moved again"}
"""What a robot answers to STOP and RELEASE, in words: these have no value."""
NOTHING_HEARD = "(DEFVAR message FALSE)"
"""Evaluated at the start, so that rules can ask whether a datagram has come."""


def heard(numbers: Numbers) -> str:
    """What a plain datagram says, as an expression. Its numbers become variables when the first one comes, so that a
    robot's own rules may have given them other values for the time before."""
    setting = " ".join(f"(DEFVAR m{i} {n:.9f}) (SETQ m{i} {n:.9f})" for i, n in enumerate(numbers))
    return f"(PROGN {setting} (DEFVAR message FALSE) (SETQ message TRUE))"


def wished(wish: Wish, actuators: Sequence[str]) -> str:
    """What a ground station wants, as an expression, STOP or RELEASE. actuators: the names of speed and turn rate. A
    place becomes two variables, which the robot's own rules may drive to."""
    if wish.sort == "drive":
        return f"(PROGN {' '.join(f'(SETQ {n} {v:.4f})' for n, v in zip(actuators, wish.values, strict=False))})"
    if wish.sort == "goal":
        pairs = zip(("goal_x", "goal_y"), wish.values, strict=True)
        return f"(PROGN {' '.join(f'(DEFVAR {n} {v:.3f}) (SETQ {n} {v:.3f})' for n, v in pairs)})"
    return wish.sort.upper()


class TypedLines:
    """Lines of standard input, as far as there are any: nothing waits for them."""

    def __init__(self) -> None:
        self._descriptor = _standard_input()
        self._rest = b""

    def texts(self) -> Iterator[str]:
        """The expressions that have been typed since the last call; one goes on until its parentheses are closed."""
        if self._descriptor is None or not self._ready(self._descriptor):
            return
        try:
            data = os.read(self._descriptor, PIECE)
        except OSError:
            data = b""
        ended = not data
        lines = (self._rest + data).split(b"\n")
        self._rest = b"" if ended else lines.pop()
        waiting: list[bytes] = []
        for line in lines:
            waiting.append(line)
            text = b"\n".join(waiting).decode(errors="replace")
            if still_open(text) <= 0:
                waiting = []
                if any(line.partition(";")[0].strip() for line in text.split("\n")):
                    yield text.strip()
        if ended:
            self._descriptor = None
            if waiting:
                yield b"\n".join(waiting).decode(errors="replace")
            return
        self._rest = b"\n".join((*waiting, self._rest))
        if len(self._rest) > MAX_TEXT:
            complain(f"what is typed has grown beyond {MAX_TEXT} characters without an end, and is dropped")
            self._rest = b""

    @staticmethod
    def _ready(descriptor: int) -> bool:
        try:
            if os.isatty(descriptor) and os.tcgetpgrp(descriptor) != os.getpgrp():
                return False  # who reads from a terminal in the background is suspended, and so would the mind be
        except OSError:  # it is not the terminal that controls this process, so it suspends nobody
            pass
        return bool(select.select([descriptor], [], [], 0)[0])


def _standard_input() -> int | None:
    try:
        return None if sys.stdin is None else sys.stdin.fileno()
    except (OSError, ValueError):
        return None


class LocalInput:
    """The channel of one node: see the module.

    orders: what is to be done when, s after the start. typed: where an operator types. listener: plain datagrams, of
    which one is delivered in each tick. session: the radio, if there is one. They are polled in this order. epoch: of
    the messages that are made of typed lines and datagrams. stops: those that hold the robot; a RELEASE that is typed
    here ends them.
    """

    def __init__(
        self,
        name: str,
        clock: Clock,
        orders: Sequence[Order],
        typed: TypedLines,
        listener: Datagrams | None,
        session: Channel | None = None,
        epoch: int = 0,
        stops: Callable[[], Sequence[object]] = tuple,
        ground: GroundStation | None = None,
        actuators: Sequence[str] = (),
    ) -> None:
        self._ground, self._actuators = ground, actuators
        self._name, self._clock, self._start = name, clock, clock.now()
        self._orders, self._typed, self._listener, self._session = deque(orders), typed, listener, session
        self._waiting: deque[Numbers] = deque()
        self._epoch, self._sequence, self._stops = epoch, 0, stops
        self.lost = 0
        """Datagrams that found no room."""

    def receive(self) -> list[Message]:
        """What has come since the last call."""
        found: list[Message] = []
        while self._orders and self._orders[0].time <= self._clock.now() - self._start:
            found.append(self._message(self._orders.popleft().text))
        found += map(self._message, self._typed.texts())
        if self._listener is not None:
            found += self._next_datagram(self._listener)
        if self._ground is not None:
            found += [self._message(wished(wish, self._actuators), GROUND) for wish in self._ground.wishes()]
        if self._session is not None:
            found += self._session.receive()
        return found

    def _next_datagram(self, listener: Datagrams) -> Iterator[Message]:
        for numbers in listener.receive():
            if len(self._waiting) < MAX_WAITING:
                self._waiting.append(numbers)
            else:
                self.lost += 1
        if self._waiting:
            yield self._message(heard(self._waiting.popleft()), SENDER)

    def _message(self, text: str, sender: str = OPERATOR) -> Message:
        kind = {"STOP": Kind.STOP, "RELEASE": Kind.RELEASE}.get(text.upper(), Kind.COMMAND)
        self._sequence += 1
        said = text[:MAX_TEXT] if kind is Kind.COMMAND else ""
        ends_all = kind is Kind.RELEASE and sender == OPERATOR
        body: dict[str, object] = {ENDS: list(self._stops())} if ends_all else {}
        return Message(sender, self._epoch, self._sequence, kind, self._clock.now() - self._start, text=said, body=body)

    def send(self, message: Message) -> None:
        """Print what the robot says to the terminal, and send all else."""
        body = message.body
        if self._session is not None and not str(body.get("command", "")).startswith((f"{OPERATOR}-", f"{GROUND}-")):
            self._session.send(message)
            if message.kind is not Kind.REPORT:
                return
        if message.kind is Kind.REPORT:
            said = printable(reported_body(body))
            announce(f"{self._name}: {said}")
            if self._ground is not None:
                self._ground.say(said)
        elif message.kind is Kind.ANSWER:
            value, fault = body.get("value"), body.get("fault")
            outcome, whose = str(body.get("outcome")), str(body.get("command"))
            if whose.startswith((f"{SENDER}-", f"{GROUND}-")) and not fault and outcome not in SAFETY:
                return  # nobody waits for the answer to a datagram, nor to a setpoint
            said = SAFETY.get(outcome) or format_value(value if isinstance(value, float) else nan)
            announce(f"{self._name}: {outcome}, {said}")
            if fault:
                complain(printable(f"{self._name}: {fault}"))
        elif message.kind is Kind.COMMAND:
            announce(f"{self._name} tells others, whom nobody reaches from here: {printable(message.text)}")
