"""The loop: it alone controls the time of a simulated swarm, and every tick is one function with one order.

    act      actuators that the minds have assigned go to the bodies
    advance  the bodies move by one tick
    deliver  the operator's messages are sent, and messages due on the radio are received
    sense    robots that have something to evaluate get their readings
    think    they evaluate it
    report   robots' messages are sent, the operator receives what is due, telemetry is sampled
    turn     robots come and go, where the scenario lets them

A robot without rules and messages costs nothing but its motion. Randomness comes from the seed, and time is the
number of the tick, so a run repeats to the last bit at any speed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from functools import cached_property
from math import isinf
from typing import Protocol

from msgspec import structs

from sleepcast.channel import Message
from sleepcast.channel.desks import desk_of, sent_by
from sleepcast.channel.message import LeaseAction, Role
from sleepcast.channel.message_batch import MessageBatch, NameIndex
from sleepcast.channel.simulated_radio import OPERATOR, Radio
from sleepcast.columns.values import Column, Index, Rows
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError, SleepcastError, in_file
from sleepcast.core.memory import same
from sleepcast.core.model import Constant
from sleepcast.core.ticks import Carried, tick_at
from sleepcast.core.units import NONE, UNITS
from sleepcast.fleet import Fleet, RobotView
from sleepcast.language.vocabulary import Vocabulary
from sleepcast.loop.mission import is_stopped_by_others, readable
from sleepcast.loop.population import Briefing, turn_over
from sleepcast.loop.quiet import QuietWorld
from sleepcast.mind.authority import Tells
from sleepcast.mind.views import Result
from sleepcast.robot import RobotModel
from sleepcast.simulator import MissionError, Order, Simulator
from sleepcast.simulator.bodies.arrivals import Arrival
from sleepcast.simulator.scenario.mission import LEASE_SECONDS, Instruction, instruction

MAX_MINDS = 1_000_000
"""Robots of one run: with their minds and the desk they take a good gigabyte, and a tick takes some tenths of a
second."""
LONGEST_CATCH_UP = 0.25
"""Real seconds that a paced run tries to catch up after a delay; longer delays are dropped."""
WINDOW = 1.0
"""Real seconds over which the speed of a run is measured."""


class SentCommand(Protocol):
    """What a desk keeps account of a message by."""

    @property
    def id(self) -> str: ...
    @property
    def message(self) -> Message: ...


class Desk(Protocol):
    """The operator's desk as the loop uses it."""

    def commands(self) -> Sequence[SentCommand]:
        """What it has sent, oldest first."""

    def send(
        self,
        text: str,
        *,
        standing: bool,
        deadline: float | None,
        everybody: bool,
        only: Sequence[str] | None,
        but: Sequence[str] | None,
        confirmed: bool,
        undecided: bool,
    ) -> SentCommand:
        """Broadcast an expression.

        everybody: confirms that it is meant for all robots.
        confirmed: as it stands.
        undecided: even if its test is unknown on all of them.

        The rest: see `Instruction`. Gives what keeps account of it.
        """

    def ask(self, text: str, *, only: Sequence[str] | None, but: Sequence[str] | None) -> SentCommand:
        """Ask robots for the value of an expression."""

    def stop(self) -> SentCommand:
        """Stop every body."""

    def release(self) -> SentCommand:
        """End the STOPs that this desk has sent."""

    def release_all(self) -> SentCommand:
        """End those of all other operators, too, of which it knows."""

    def on_air(self, message: Message) -> None:
        """A message of its own goes out now, in this tick: it may have been posted before the tick began."""

    def lease(self, action: LeaseAction, group: str, seconds: float, to: str) -> SentCommand:
        """Do something about the lease of a group. to: who is granted it."""

    def hold(self, lasts: bool) -> None:
        """Let robots hear all the time that the operator is there, from now on or no more."""

    def hear(self, message: Message) -> None:
        """Receive a robot's message."""

    def hear_many(self, batch: MessageBatch) -> None:
        """Receive messages that many robots have sent at once."""

    def observe_many(self, now: float, robots: Index) -> None:
        """Receive telemetry of these robots, sampled at `now` (s)."""

    @property
    def counts_latest(self) -> bool:
        """Whether it is enough to be told of the latest of several samples."""

    def turn_over(self, names: NameIndex, children: Index, dead: Index) -> None:
        """Robots have come to these rows, and others have gone. names: by their rows, "" for none."""

    def attend(self) -> None:
        """Called at every tick, or rarely while it has nothing to do."""

    @property
    def next_due(self) -> float:
        """Before when `attend` has nothing to do, s, as long as it hears nothing."""

    def state(self) -> bytes:
        """The desk's whole state, for a snapshot."""

    def restore(self, state: bytes) -> None:
        """Restore a desk's state. Raises ValueError if it is invalid."""


class Witness(Protocol):
    """An observer that changes nothing: a recording. Of quiet ticks that are made at once, one whose
    attribute `patient` is true sees the beginning of the first and the end of the last."""

    def ticking(self) -> None:
        """A tick begins."""

    def posted(self, message: Message) -> None:
        """The operator's message is sent."""

    def said(self, batch: MessageBatch) -> None:
        """Robots' messages are sent."""

    def ticked(self) -> None:
        """A tick has ended."""

    def came(self, arrival: Arrival) -> None:
        """Somebody has added a robot between two ticks."""


class Swarm:
    """A simulator, a mind for each body, and the radio between them and the operator; also their common clock.

    fleet: all minds together.
    minds: each by its robot's name.
    desk: the operator's desk, if there is one; it sends through `post`.
    mission: orders that the desk sends automatically.
    vocabulary: of robots of this simulator's model; None makes one.

    Raises MissionError for an order that is not an expression, MisuseError for too many robots, VocabularyError if
    names of the scenario clash with the language's.
    """

    def __init__(
        self, simulator: Simulator, mission: Sequence[Order] = (), vocabulary: Vocabulary | None = None
    ) -> None:
        if len(simulator.names) > MAX_MINDS:
            raise MisuseError(f"{len(simulator.names)} robots are too many: at most {MAX_MINDS} minds fit into one run")
        self.simulator = simulator
        self.vocabulary = vocabulary_of(simulator.model) if vocabulary is None else vocabulary
        self.fleet = Fleet(
            simulator.names,
            self.vocabulary,
            numbers=None if simulator.population is None else (simulator.population.numbers + 1).tolist(),
            seed=simulator.seed,
            pool=simulator.pool,
            bodies=simulator.robots,
            sensed=simulator.sensed,
            lease=simulator.scenario.minds.lease,
            tells=Tells(simulator.scenario.minds.tells),
            on_air=bool(simulator.scenario.operators),
        )
        self.minds: Mapping[str, RobotView] = self.fleet
        scenario = simulator.scenario
        self.fleet.telemetry.tick = self.fleet.timing.tick = scenario.tick
        sight, flight = simulator.bodies.sight, simulator.bodies.flight
        self.radio = Radio(
            scenario.radio,
            simulator.x,
            simulator.y,
            seed=simulator.seed,
            clock=self,
            around=scenario.around,
            desks=max(1, len(scenario.operators)),
            z=None if flight is None else flight.z,
            operator_z=scenario.ground_at(*(scenario.radio.operator or (0.0, 0.0))),
            between=sight.count_between if scenario.radio.wall else sight.any_between,
            party=self.party_of,
            numbers=None if simulator.population is None else simulator.population.numbers,
        )
        if simulator.population is not None:
            self.fleet.state.present = simulator.population.present
            self.fleet.authority.tells_hatch = simulator.scenario.minds.tells_hatch
        self.operators = {operator.name: Role(operator.role) for operator in scenario.operators}
        """The role of each operator, the first one's first; empty where whoever sends may do anything."""
        self._numbers = {name: OPERATOR - index for index, name in enumerate(self.operators)}
        for rule in scenario.minds.locked:
            self.fleet.install(rule.name, rule.text, robots=self.fleet.state.everybody())
        self.actuators = tuple(actuator.name for actuator in simulator.model.actuators)
        self.sonars = same(frozenset(self.vocabulary.first_sensor + row for row in simulator.sonar_rows))
        """The slots of variables that are measured only on request."""
        self.desk: Desk | None = None
        self.others: list[Desk] = []
        """The desks of further operators, in the scenario's order."""
        self.briefing = Briefing()
        """What robots that come later are to know, kept where any may."""
        self.witnesses: list[Witness] = []
        """They see each tick, in this order."""
        self.senders: list[Callable[[], None]] = []
        """Called before each tick, to let the desk send what is due in it as if by hand."""
        self.mission = [readable(order) for order in mission]
        """The orders that were not sent yet."""
        self.refused: Callable[[Order, MissionError], None] | None = None
        """Told of an order of the mission that cannot be sent; without it that is raised."""
        self.given: list[tuple[Order, str]] = []
        """The orders of the mission that were sent, with the ids of their messages; "" for HOLD and AWAY."""
        self.halted = False
        """Whether somebody's STOP has ended the mission."""
        self.carried = Carried(scenario.tick)
        """What runs so far have left over, since a tick is the least that time moves."""
        self.telemetry_ticks = max(1, round(scenario.telemetry / scenario.tick))
        """Telemetry period of a robot, in ticks."""
        self.posted: list[Message] = []
        self.thought = Rows.run(0, 0)
        """The robots that were evaluated in the last tick."""
        self.whole = True
        """Whether the swarm is between two ticks: not during one, nor after one that an error or a second Ctrl-C has
        interrupted."""

    def now(self) -> float:
        """Simulated seconds since the start."""
        return self.simulator.time

    def post(self, message: Message) -> None:
        """Queue an operator's message for the next tick. May be called from any thread."""
        self.posted.append(message)

    def is_stopped_by_others(self, messages: Iterable[Message]) -> bool:
        """See `mission.is_stopped_by_others`."""
        return is_stopped_by_others(messages, {sent for _, sent in self.given})

    def heed_stops(self, messages: Collection[Message]) -> None:
        """End the mission if a STOP is among the operator's messages that it has not sent itself."""
        if self.mission and messages and self.is_stopped_by_others(messages):
            self.mission.clear()
            self.halted = True

    @property
    def desks(self) -> list[Desk]:
        """All desks, the first operator's first."""
        return [] if self.desk is None else [self.desk, *self.others]

    def commands(self) -> list[SentCommand]:
        """What all operators have sent, oldest first."""
        return sent_by(self.desks)

    def desk_for(self, order: Order) -> Desk:
        """The desk that sends an order. Raises MissionError where nobody of this name sits at one."""
        with placed(order):
            return self.desk_of(instruction(order).by)

    def desk_of(self, operator: str) -> Desk:
        """The desk of an operator ("": the first). Raises MisuseError where nobody of this name sits at one."""
        return desk_of(operator, self.operators, self.desks)

    def number_of(self, sender: str) -> int:
        """The number of an operator on the radio."""
        return self._numbers.get(sender, OPERATOR)

    def party_of(self, name: str) -> int:
        """The number of a robot or an operator on the radio."""
        robot = self.fleet.names.index_of(name)
        return self.number_of(name) if robot is None else robot

    def admitted(self, message: Message) -> Message:
        """A message as robots get it: where operators are named, with the role of its sender."""
        if not self.operators:
            return message
        return structs.replace(message, role=self.operators.get(message.sender, Role.ROBOT), heard=self.now())

    def step(self) -> None:
        """One tick."""
        self.advance(1)

    def run(self, seconds: float) -> None:
        """Run for that many simulated seconds, as fast as possible. What is less than a tick is carried over."""
        left = self.carried.ticks(seconds)
        while left:
            left -= self.advance(left)

    def advance(self, most: int) -> int:
        """Make one tick, or as many quiet ones at once as may be, at most `most`; gives how many. See `loop.quiet`."""
        made = self.quiet.make(most)
        if made:
            return made
        step_swarm(self)
        return 1

    @cached_property
    def quiet(self) -> QuietWorld:
        """What makes its quiet ticks."""
        return QuietWorld(self)

    def report(self) -> None:
        """The last part of a tick, see the module."""
        _report(self)

    def follow(self) -> None:
        """The rest of a tick in which bodies have moved."""
        self.simulator.follow()
        _deliver(self)
        _think(self)
        _report(self)

    def evaluate(self, name: str, text: str) -> Result:
        """Evaluate `text` on the robot called `name`, with its current readings; its messages are sent in the next
        tick. Raises KeyError for an unknown robot, ReadError and CheckError for an invalid text."""
        mind = self.minds[name]
        self.sense(self.fleet.rows([mind.index]))
        return mind.evaluate(text)

    def sense(self, robots: Rows | None = None, *, sonars: bool | Collection[int] = True) -> None:
        """Give these robots (None: all) their current readings. sonars: whether to include sonars, or the sonar rows
        that are needed."""
        some = None if robots is None or robots.size == len(self.fleet) else robots.robots
        self.simulator.sense(some, sonars)
        cut_off = self.simulator.bodies.cut_off
        if not cut_off.size:
            self.fleet.look(self.now(), robots)
            return
        rows = self.fleet.rows() if robots is None else robots
        self.fleet.look(self.now(), rows.take(~cut_off[rows.index]))
        self.fleet.age(self.now(), rows)

    def values_of(self, text: str) -> Column:
        """What an expression comes to on each robot now; of the sonars only those are measured that it reads. Raises
        what `Fleet.values_of` raises."""
        reads = self.fleet.queries[text].reads
        self.sense(sonars=reads is None or self.rows_of(self.sonars & reads))
        return self.fleet.values_of(text, self.now())

    def rows_of(self, sonars: Collection[int]) -> list[int]:
        """The rows of these slots in the simulator's table."""
        return [slot - self.vocabulary.first_sensor for slot in sonars]

    def send_initial_telemetry(self) -> None:
        """Sample telemetry now: before the first tick, the desk has heard of nobody. Changes nothing that a run depends
        on."""
        if self.desk is not None:
            _sample(self)

    def measures(self) -> dict[str, object]:
        """Counts of the run so far."""
        return {
            "awake": int(self.fleet.awake.sum()),
            "groups": self.fleet.members(),
            "stopped": int(self.fleet.state.stopped.sum()),
            "said": len(self.simulator.sayings),
            "radio": asdict(self.radio.counts),
            **self.simulator.measured(),
        }


def step_swarm(swarm: Swarm) -> None:
    """One tick of the whole swarm: act, advance, deliver, sense, think, report, turn."""
    for send_due in swarm.senders:
        send_due()
    for witness in swarm.witnesses:
        witness.ticking()
    swarm.whole = False
    _act(swarm)
    swarm.simulator.step()
    _deliver(swarm)
    _think(swarm)
    _report(swarm)
    if swarm.simulator.population is not None:
        turn_over(swarm)
    swarm.whole = True
    for witness in swarm.witnesses:
        witness.ticked()


def _act(swarm: Swarm) -> None:
    """Pass assigned actuators to the bodies, and which groups they are in. The last value of an actuator stays in force
    until DRIVE or a similar function replaces it."""
    swarm.simulator.senses.show_groups(slice(None), swarm.fleet.groups)
    for actuator in swarm.actuators:
        robots, values = swarm.fleet.actuators(actuator)
        if values.size:
            swarm.simulator.act(actuator, robots, values)


def _deliver(swarm: Swarm) -> None:
    """Bring the robots the messages that they receive in this tick."""
    _send_posted(swarm)
    _give_orders(swarm)
    _send_posted(swarm)
    for message, robots in swarm.radio.receive_all():
        swarm.fleet.receive(swarm.admitted(message), robots)


def _send_posted(swarm: Swarm) -> None:
    """Send what the desk has posted."""
    sent = list[Message]()
    while swarm.posted:
        message = swarm.posted.pop(0)
        number = swarm.number_of(message.sender)
        swarm.radio.send(number, message)
        sent.append(message)
        for desk in swarm.desks[OPERATOR - number :][:1]:
            desk.on_air(message)
        if swarm.simulator.population is not None:
            swarm.briefing.hear(message)
        for witness in swarm.witnesses:
            witness.posted(message)
    swarm.heed_stops(sent)


def _give_orders(swarm: Swarm) -> None:
    """Let the desk send the orders of the mission that are due."""
    tick, now = swarm.simulator.scenario.tick, swarm.simulator.tick
    while swarm.mission and swarm.desk is not None and tick_at(swarm.mission[0].time, tick) <= now:
        order = swarm.mission.pop(0)
        try:
            sent = give(swarm.desk_for(order), order)
        except MissionError as error:
            if swarm.refused is None:
                raise
            swarm.refused(order, error)
            return
        swarm.given.append((order, "" if sent is None else sent.id))


@contextmanager
def placed(order: Order) -> Iterator[None]:
    """Let errors say where the order stands, as MissionError."""
    try:
        yield
    except SleepcastError as error:
        raise MissionError(in_file(order.place, str(error))) from error


def give(
    desk: Desk, order: Order, *, confirmed: bool = False, undecided: bool = True, ahead: float = 0.0
) -> SentCommand | None:
    """Let the desk send an order; gives what it keeps account of it by, None for one that says nothing.

    confirmed: whatever is doubted.
    undecided: whether a test that is unknown on all robots is no doubt.
    ahead: s by which it is given before its tick, for which it is good as well.

    Raises MissionError.
    """
    wanted = instruction(order)
    with placed(order):
        if not wanted.is_expression:
            return act_on(desk, wanted)
        if wanted.kind == "ask":
            return desk.ask(wanted.text, only=wanted.only, but=wanted.but)
        return desk.send(
            wanted.text,
            standing=wanted.kind == "standing",
            deadline=None if wanted.within is None else wanted.within + ahead,
            everybody=True,
            only=wanted.only,
            but=wanted.but,
            confirmed=confirmed,
            undecided=undecided,
        )


def act_on(desk: Desk, wanted: Instruction) -> SentCommand | None:
    """Let the desk do what is no expression: STOP, RELEASE, something about a lease; and HOLD or AWAY, which say
    nothing. Raises LeaseError."""
    match wanted.kind:
        case "STOP":
            return desk.stop()
        case "RELEASE":
            return desk.release()
        case "RELEASE ALL":
            return desk.release_all()
        case "lease":
            action, group = wanted.text.split()
            seconds = LEASE_SECONDS if wanted.within is None else wanted.within
            return desk.lease(LeaseAction(action), group, seconds, wanted.to)
    desk.hold(wanted.kind == "HOLD")
    return None


def _think(swarm: Swarm) -> None:
    """Run the minds of robots that have anything to evaluate, with their current readings."""
    swarm.thought = swarm.fleet.awake_rows()
    if swarm.thought.size:
        swarm.sense(swarm.thought, sonars=_heard(swarm))
        swarm.fleet.think(swarm.simulator.tick, swarm.now(), swarm.thought)
        swarm.simulator.senses.show_groups(slice(None), swarm.fleet.groups)  # the next ticks may be quiet ones


def _heard(swarm: Swarm) -> bool | Collection[int]:
    """Which sonar readings the robots need: all if all robots are sampled in this tick anyway."""
    if not swarm.sonars:
        return False
    asked = swarm.sonars & swarm.fleet.reads()
    if asked and swarm.desk is not None and _is_sampled(swarm):
        return True
    return swarm.rows_of(asked)


def _is_sampled(swarm: Swarm) -> bool:
    """Whether telemetry of all robots is due."""
    return swarm.simulator.tick % swarm.telemetry_ticks == 0


def _tell_news(swarm: Swarm) -> None:
    """Let robots report what has befallen their bodies, as nodes do of what their bridges say."""
    whose: dict[str, set[int]] = {}
    for news in swarm.simulator.take_news() if swarm.simulator.news else ():
        whose.setdefault(news.text, set()).add(news.robot)
    for sentence, robots in whose.items():
        swarm.fleet.outbox.remark(swarm.fleet.rows(sorted(robots)), sentence, swarm.now())


def _report(swarm: Swarm) -> None:
    """Send the robots' messages, let the desk receive what is due, and sample telemetry when it is due."""
    _tell_news(swarm)
    for batch in swarm.fleet.take_messages():
        swarm.radio.send_all(batch)
        for witness in swarm.witnesses:
            witness.said(batch)
    for robots, castes in swarm.fleet.take_pings():
        swarm.simulator.pings(robots, castes)
    for number, desk in zip(swarm.radio.desks.tolist(), swarm.desks, strict=False):
        for heard in swarm.radio.hear(number):
            if isinstance(heard, Message):
                desk.hear(heard)
            else:
                desk.hear_many(heard)
    if swarm.desks and _is_sampled(swarm):
        _sample(swarm)
    for desk in swarm.desks:
        desk.attend()


def _sample(swarm: Swarm) -> None:
    """All operators hear the same telemetry: they sit at one place."""
    sampled = swarm.radio.samples()
    swarm.sense(None if sampled.size == len(swarm.fleet) else swarm.fleet.rows(sampled))
    for desk in swarm.desks:
        desk.observe_many(swarm.now(), sampled)


class Pace:
    """Computes how many ticks are due so that a run goes `factor` times as fast as real time. A run that cannot keep up
    drops the missed ticks.

    factor: simulated seconds per second of `clock`; infinite for as fast as possible.
    paused: no tick is due; single steps are still possible.
    step: makes a tick, None for one of the swarm alone.
    """

    def __init__(self, clock: Clock, swarm: Swarm, factor: float, step: Callable[[], None] | None = None) -> None:
        self.factor, self.paused = factor, False
        self._clock, self._swarm, self._credit = clock, swarm, 0.0
        self._step = swarm.step if step is None else step
        self._looked = clock.now()
        self._seen: deque[tuple[float, float]] = deque()

    def keep_up(self, budget: float) -> int:
        """Run the ticks that are due, for at most about `budget` s of the clock; returns their number."""
        start = self._clock.now()
        tick = self._swarm.simulator.scenario.tick
        lag, self._looked = start - self._looked, start
        if self.paused:
            self._credit = 0.0
            self._seen.clear()
            return 0
        flat_out = isinf(self.factor)
        if not flat_out:
            self._credit += lag * self.factor / tick
            self._credit = min(self._credit, max(1.0, LONGEST_CATCH_UP * self.factor / tick))
        made = 0
        while self._is_due() and self._clock.now() - start <= budget:
            self._step()
            made += 1
            if not flat_out:
                self._credit -= 1.0
        self._seen.append((start, self._swarm.now()))
        while self._seen[0][0] < start - WINDOW:
            self._seen.popleft()
        return made

    def _is_due(self) -> bool:
        """Whether there is a tick to make; what happens in one may have paused the run."""
        return not self.paused and (isinf(self.factor) or self._credit >= 1.0)

    @property
    def achieved(self) -> float:
        """Simulated seconds per second of the clock, over the last `WINDOW`; 0 until it is known."""
        if len(self._seen) < 2:
            return 0.0
        (wall, simulated), (last_wall, last_simulated) = self._seen[0], self._seen[-1]
        return (last_simulated - simulated) / (last_wall - wall) if last_wall > wall else 0.0


def vocabulary_of(model: RobotModel) -> Vocabulary:
    """The vocabulary of robots of this model. Raises VocabularyError for clashing names."""
    constants = (Constant(c.name, c.value, UNITS[c.unit].dimension if c.unit else NONE, c.doc) for c in model.constants)
    return Vocabulary(
        model.name,
        model.sensors,
        model.actuators,
        constants=tuple(constants),
        functions=model.functions,
        areas=model.areas,
        outlines=model.outlines,
    )
