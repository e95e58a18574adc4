"""The loop: it alone owns the time of a simulated swarm, and every tick goes through one function in one order.

    act      what the minds wanted of their bodies' actuators goes to the bodies
    advance  the bodies move on by one tick
    deliver  the operator's messages go out, and whatever the radio has brought is received
    sense    robots that have something to think about get their readings
    think    ... and think
    report   what robots say goes on the air, the operator hears what has come in, telemetry is sampled

A robot without rules and without a message is not touched: it costs nothing but its motion. Chance comes from the
seed, time is the number of the tick, so a run repeats to the last bit however fast it is run.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict
from math import isinf
from typing import Protocol

from sleepcast.channel import Channel, Message
from sleepcast.channel.message_batch import MessageBatch
from sleepcast.channel.simulated_radio import OPERATOR, Radio
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.model import Constant
from sleepcast.core.units import NONE, UNITS
from sleepcast.fleet import Fleet, RobotView
from sleepcast.fleet.state import Index, Rows
from sleepcast.language.reader import read
from sleepcast.language.vocabulary import Vocabulary
from sleepcast.mind.views import Result
from sleepcast.robot import RobotModel
from sleepcast.simulator import MissionError, Order, Simulator

MAX_MINDS = 1_000_000
"""Robots of one run: with their minds and the desk they take a good gigabyte, and a tick some tenths of a second."""
LONGEST_CATCH_UP = 0.25
"""Seconds of real time that a paced run may lag behind before it lets them go: a hiccup, not a rest of work."""
WINDOW = 1.0
"""Seconds of real time over which the speed of a run is measured."""


class Desk(Protocol):
    """The operator's desk, as far as the loop knows it."""

    def send(self, text: str, *, everybody: bool) -> object:
        """Broadcast an expression, to everybody if it says so."""

    def hear(self, message: Message) -> None:
        """Take in what a robot says."""

    def hear_many(self, batch: MessageBatch) -> None:
        """Take in what many robots say at once."""

    def observe_many(self, now: float, robots: Index) -> None:
        """Take in what these robots tell of themselves at `now` (s)."""

    def attend(self) -> None:
        """Do what is to be done at every tick."""

    def state(self) -> bytes:
        """Everything that it knows, to be kept in a snapshot."""

    def restore(self, state: bytes) -> None:
        """Know what a desk knew that gave this state. Raises ValueError if it is none."""


class Witness(Protocol):
    """An observer that changes nothing: a recording."""

    def ticking(self) -> None:
        """A tick begins."""

    def posted(self, message: Message) -> None:
        """The operator's message goes on the air."""

    def said(self, batch: MessageBatch) -> None:
        """What robots say goes on the air."""

    def ticked(self) -> None:
        """A tick is over."""


class Swarm:
    """A simulator, a mind for each body, and the radio between them and the operator. It is the clock of them all.

    fleet: all minds together; minds: each by its robot's name. desk: where the operator sits, if anybody does; what it
    sends goes through `post`. mission: orders that the desk is to send by itself. Raises MissionError for an order
    that is no expression, MisuseError for too many robots, VocabularyError where the scenario's names clash with the
    language's.
    """

    def __init__(self, simulator: Simulator, mission: Sequence[Order] = ()) -> None:
        if len(simulator.names) > MAX_MINDS:
            raise MisuseError(f"{len(simulator.names)} robots are too many: at most {MAX_MINDS} minds fit into one run")
        self.simulator = simulator
        self.vocabulary = vocabulary_of(simulator.model)
        self.fleet = Fleet(
            simulator.names,
            self.vocabulary,
            seed=simulator.seed,
            pool=simulator.pool,
            bodies=simulator.robots,
            sensed=simulator.sensed,
        )
        self.minds: Mapping[str, RobotView] = self.fleet
        scenario = simulator.scenario
        self.radio = Radio(scenario.radio, simulator.x, simulator.y, seed=simulator.seed, clock=self)
        self.air: Channel = self.radio.endpoint(OPERATOR)
        """The operator's end of the radio."""
        self.actuators = tuple(actuator.name for actuator in simulator.model.actuators)
        self.sonars = frozenset(self.vocabulary.first_sensor + row for row in simulator.sonar_rows)
        """The slots of the variables that are measured only on request."""
        self.desk: Desk | None = None
        self.witness: Witness | None = None
        self.mission = deque(_readable(order) for order in mission)
        self.telemetry_ticks = max(1, round(scenario.telemetry / scenario.tick))
        """Ticks between two samples of a robot."""
        self.posted: deque[Message] = deque()
        self.thought = Rows.run(0, 0)
        """The robots that thought in the last tick."""
        self.whole = True
        """Whether this is between two ticks; not within one, nor after one that was broken off by an error or by an
        impatient Ctrl-C."""

    def now(self) -> float:
        """Simulated seconds since the start."""
        return self.simulator.time

    def post(self, message: Message) -> None:
        """The operator's outbox: `message` is sent in the next tick. May be called from any thread."""
        self.posted.append(message)

    def step(self) -> None:
        """One tick."""
        step_swarm(self)

    def run(self, seconds: float) -> None:
        """Run for so many simulated seconds, as fast as possible."""
        for _ in range(round(seconds / self.simulator.scenario.tick)):
            step_swarm(self)

    def evaluate(self, name: str, text: str) -> Result:
        """Evaluate `text` on the robot called `name`, with its readings of this moment; what it says is sent in the
        next tick. Raises KeyError for no such robot, ReadError and CheckError for a text that it cannot run."""
        mind = self.minds[name]
        self.sense(self.fleet.rows([mind.place]))
        return mind.evaluate(text)

    def sense(self, robots: Rows | None = None, *, sonars: bool | Collection[int] = True) -> None:
        """Give these robots (None: all) their readings of this moment. sonars: those of their sonars as well, or at
        least those in these rows of what they sense."""
        some = None if robots is None or robots.size == len(self.fleet) else robots.robots
        self.simulator.sense(some, sonars)
        self.fleet.look(self.now(), robots)

    def measures(self) -> dict[str, object]:
        """What can be counted of the run so far."""
        return {
            "awake": int(self.fleet.awake.sum()),
            "groups": self.fleet.members(),
            "stopped": int(self.fleet.state.stopped.sum()),
            "said": len(self.simulator.said),
            "radio": asdict(self.radio.counts),
            **self.simulator.measured(),
        }


def step_swarm(swarm: Swarm) -> None:
    """One tick of the whole swarm: act, advance, deliver, sense, think, report."""
    if swarm.witness is not None:
        swarm.witness.ticking()
    swarm.whole = False
    _act(swarm)
    swarm.simulator.step()
    _deliver(swarm)
    _think(swarm)
    _report(swarm)
    swarm.whole = True
    if swarm.witness is not None:
        swarm.witness.ticked()


def _act(swarm: Swarm) -> None:
    """Assigned actuators move the bodies. What was assigned last holds, until DRIVE or the like says otherwise."""
    for actuator in swarm.actuators:
        robots, values = swarm.fleet.actuators(actuator)
        if values.size:
            swarm.simulator.act(actuator, robots, values)


def _deliver(swarm: Swarm) -> None:
    """Bring the robots what they hear in this tick."""
    _give_orders(swarm)
    while swarm.posted:
        message = swarm.posted.popleft()
        swarm.air.send(message)
        if swarm.witness is not None:
            swarm.witness.posted(message)
    for message, robots in swarm.radio.receive_all():
        swarm.fleet.receive(message, robots)


def _give_orders(swarm: Swarm) -> None:
    """Let the desk send the orders of the mission whose time has come."""
    while swarm.mission and swarm.desk is not None and swarm.mission[0].time <= swarm.now():
        order = swarm.mission.popleft()
        try:
            swarm.desk.send(order.text, everybody=True)
        except SleepcastError as error:
            raise MissionError(f"{order.place}: {error}") from error


def _think(swarm: Swarm) -> None:
    """Let the robots think that have anything to think about, with their readings of this moment."""
    swarm.thought = swarm.fleet.restless()
    if swarm.thought.size:
        swarm.sense(swarm.thought, sonars=_heard(swarm))
        swarm.fleet.think(swarm.simulator.tick, swarm.now(), swarm.thought)


def _heard(swarm: Swarm) -> bool | Collection[int]:
    """Which sonars' readings robots need to think: all where a sample of every robot follows anyway."""
    if not swarm.sonars:
        return False
    asked = swarm.sonars & swarm.fleet.reads()
    if asked and swarm.desk is not None and _is_sampled(swarm):
        return True
    first = swarm.vocabulary.first_sensor
    return [slot - first for slot in asked]


def _is_sampled(swarm: Swarm) -> bool:
    """Whether it is time to take a sample of every robot."""
    return swarm.simulator.tick % swarm.telemetry_ticks == 0


def _report(swarm: Swarm) -> None:
    """Send what the robots say; let the desk hear what has come in; take a sample of every robot when it is time."""
    for batch in swarm.fleet.said():
        swarm.radio.send_all(batch)
        if swarm.witness is not None:
            swarm.witness.said(batch)
    for robots, castes in swarm.fleet.pings():
        swarm.simulator.pings(robots, castes)
    desk = swarm.desk
    if desk is None:
        return
    for heard in swarm.radio.hear():
        if isinstance(heard, Message):
            desk.hear(heard)
        else:
            desk.hear_many(heard)
    if _is_sampled(swarm):
        sampled = swarm.radio.samples()
        swarm.sense(swarm.fleet.rows(sampled))
        desk.observe_many(swarm.now(), sampled)
    desk.attend()


class Pace:
    """How many ticks a run should have made by now, so that it goes `factor` times as fast as the clock on the wall.

    factor: simulated seconds in a second of `clock`; infinite for as fast as possible. paused: no tick is due; whoever
    pauses may still step. A run that cannot keep up lets the missed ticks go.
    """

    def __init__(self, clock: Clock, swarm: Swarm, factor: float) -> None:
        self.factor, self.paused = factor, False
        self._clock, self._swarm, self._credit = clock, swarm, 0.0
        self._looked = clock.now()
        self._seen: deque[tuple[float, float]] = deque()

    def keep_up(self, budget: float) -> int:
        """Make the ticks that are due, for at most about `budget` s of the clock; gives how many were made."""
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
        while (flat_out or self._credit >= 1.0) and self._clock.now() - start <= budget:
            step_swarm(self._swarm)
            made += 1
            if not flat_out:
                self._credit -= 1.0
        self._seen.append((start, self._swarm.now()))
        while self._seen[0][0] < start - WINDOW:
            self._seen.popleft()
        return made

    @property
    def achieved(self) -> float:
        """Simulated seconds in a second of the clock, over the last `WINDOW`; 0 while that is not known."""
        if len(self._seen) < 2:
            return 0.0
        (wall, simulated), (last_wall, last_simulated) = self._seen[0], self._seen[-1]
        return (last_simulated - simulated) / (last_wall - wall) if last_wall > wall else 0.0


def vocabulary_of(model: RobotModel) -> Vocabulary:
    """The names that robots of this model know. Raises VocabularyError for names that clash."""
    constants = (Constant(c.name, c.value, UNITS[c.unit].dimension if c.unit else NONE, c.doc) for c in model.constants)
    return Vocabulary(model.name, model.sensors, model.actuators, constants=tuple(constants), functions=model.functions)


def _readable(order: Order) -> Order:
    try:
        read(order.text)
    except SleepcastError as error:
        raise MissionError(f"{order.place}: {error}") from error
    return order
