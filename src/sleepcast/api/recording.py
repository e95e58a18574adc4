"""What of a swarm is recorded, and how often: the part of recording that sees minds, desk and bodies."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from math import isfinite
from pathlib import Path
from typing import Self
from weakref import finalize

import numpy as np

from sleepcast.api.events import in_words
from sleepcast.api.painting import Painter
from sleepcast.api.session_test import sent_commands
from sleepcast.channel import Kind, Message
from sleepcast.channel.message_batch import MessageBatch
from sleepcast.core.errors import MisuseError
from sleepcast.core.records import dataclass
from sleepcast.core.ticks import Every
from sleepcast.core.version import VERSION
from sleepcast.fleet.failing import MAX_FAILING, RECENT, failing_rules
from sleepcast.fleet.marks import GroupCodes, flags_of
from sleepcast.loop import Swarm, snapshot
from sleepcast.loop.rerun import WorldLog
from sleepcast.simulator import Scenario
from sleepcast.simulator.bodies.arrivals import Arrival
from sleepcast.simulator.recording.json_messages import (
    AccountBody,
    ArrivalBody,
    FailureBody,
    FailuresBody,
    MarksBody,
    RobotsBody,
    RuleBody,
    RulesBody,
    StateBody,
)
from sleepcast.simulator.recording.recorder import (
    ACCOUNTING,
    FAILING,
    MARKS,
    ONE_FILE,
    READINGS,
    ROBOTS,
    RULES,
    STATE,
    Recorder,
    Rotation,
    WorldChange,
)
from sleepcast.simulator.recording.roster import departures, everybody
from sleepcast.station import Command, Station
from sleepcast.station.account import values_in_words

TICKS_PER_PICTURE = 10
"""Ticks between two pictures at least, unless others are asked for: more would cost more than the run itself."""
PICTURES_PER_READING = 10
"""People look at numbers more seldom than at motion, and they are many."""


@dataclass(frozen=True, slots=True)
class RecordingPlan:
    """What is to be recorded.

    file: into which.
    pictures, readings: simulated s between two of them; None: as the scenario's speed suggests.
    rotation: when another file begins.
    """

    file: Path
    pictures: float | None = None
    readings: float | None = None
    rotation: Rotation = ONE_FILE


class RecordingWitness:
    """Sees what happens in a swarm (the loop's `RecordingWitness`) and records it."""

    def __init__(self, recorder: Recorder, swarm: Swarm, station: Station, wanted: RecordingPlan) -> None:
        self._recorder, self._swarm, self._station = recorder, swarm, station
        self._pictures, self._readings = periods(swarm.simulator.scenario, wanted)
        self._sensors = [sensor.name for sensor in swarm.simulator.model.sensors]
        self._groups = GroupCodes()
        self._minds = np.full(len(swarm.minds), -1, np.int32)
        """Which mind each robot had when its rules were last looked at."""
        self._rules: dict[int, list[tuple[str, str, bool, int]]] = {}
        """The rules of robots that have any, as they were recorded last."""
        self._answers: dict[str, int] = {}
        self._failing = FailuresBody([])
        """The rules that fail, as they were recorded last."""
        self._unmarked = True
        """Whether groups or flags may have changed since they were recorded."""
        self._bodily: list[bytes] = []
        """Which robots had used up what they drive with, and had crashed, when flags were looked at last."""
        self._seen = -1
        self._added = False
        """Whether somebody has added a robot since the last tick."""
        self._posted: list[tuple[int, Message]] = []
        self._world = WorldLog(swarm.simulator.world, dict(enumerate(swarm.simulator.scenario.shapes, 1)))
        self._changes: list[WorldChange] = []
        self._names: Sequence[str] = swarm.simulator.names
        """Of the robots by row, as they were recorded last."""
        if swarm.simulator.tick or is_changed(swarm):
            self._note_everybody(swarm.now())
        self._painter = Painter(recorder, swarm)
        self.ticking()
        self.picture()
        self.look()

    def ticking(self) -> None:
        """A tick begins. Changes in the world since the last one were made by a person or a program."""
        self._look_at_world(self._swarm.simulator.tick + 1, own=False)

    def came(self, arrival: Arrival) -> None:
        """Somebody has added a robot between two ticks, after all changes in the world so far."""
        self.ticking()
        simulator = self._swarm.simulator
        change = WorldChange(simulator.tick + 1, {}, (), came=(arrival,))
        self._changes.append(change)
        self._recorder.obstacles(self._swarm.now(), change)
        self._added = True
        self._look_at_robots(self._swarm.now())

    def posted(self, message: Message) -> None:
        """The operator's message goes on the air in this tick."""
        now, tick = self._swarm.now(), self._swarm.simulator.tick
        self._posted.append((tick, message))
        self._recorder.posted(now, tick, message)
        if message.kind is not Kind.REQUEST:
            self._recorder.log(now, message.sender, message.text or message.kind.name)

    def said(self, batch: MessageBatch) -> None:
        """What robots say goes on the air in this tick. Answers and bids come to be seen in the account."""
        self._unmarked = True
        if batch.kind in (Kind.ANSWER, Kind.REQUEST):
            return
        for message in batch.messages():
            self._recorder.log(self._swarm.now(), message.sender, in_words(message))

    def ticked(self) -> None:
        """A tick is over."""
        swarm = self._swarm
        simulator = swarm.simulator
        self._added = False
        if swarm.thought.size:
            self._unmarked = True
        now = swarm.now()
        for saying in reversed(simulator.sayings):
            if saying.time < now:
                break
            self._recorder.log(now, self._names[saying.robot], saying.text)  # who may have gone since
        self._look_at_robots(now)
        self._look_at_world(simulator.tick, own=True)
        if self._pictures.due(simulator.tick):
            if self._recorder.full(now) and self._recorder.turn(now):
                self._repeat(now)
            self.picture()
        if self._readings.due(simulator.tick) and self._seen != simulator.tick:
            self.look()

    def picture(self) -> None:
        """Record where the robots are and, unless nobody thought or answered, in which groups, and their flags; the
        accounts that have changed."""
        simulator = self._swarm.simulator
        now, minds = self._swarm.now(), self._swarm.fleet
        bodily = simulator.exhausted(), simulator.crashed()
        before, self._bodily = self._bodily, [b"" if each is None else each.tobytes() for each in bodily]
        if self._unmarked or self._bodily != before:
            self._unmarked = False
            codes, flags, groups = self._groups.look(minds), flags_of(minds, *bodily), self._groups
            body = MarksBody(simulator.tick, codes, flags, groups.names, groups.second, simulator.colours())
            self._recorder.note(MARKS, now, body)
            self._painter.paint(groups.names, codes, body.colours)
        self._painter.picture(now)

        self._recorder.poses(now, *simulator.poses, simulator.heights)
        for desk, command in sent_commands(self._swarm, self._station):
            if self._answers.get(command.id) != len(command.answers):
                self._answers[command.id] = len(command.answers)
                self._account(desk, command, now)

        self._look_at_failures(now)

    def _look_at_failures(self, now: float) -> None:
        """Record which rules fail, if that has changed."""
        simulator = self._swarm.simulator
        rules = failing_rules(self._swarm.fleet.memory, now - RECENT * simulator.scenario.speed_up)[:MAX_FAILING]
        count = len(simulator.names)
        body = FailuresBody([FailureBody(r.name, len(r.robots), r.inactive, r.reason, r.bits(count)) for r in rules])
        if body != self._failing:
            self._failing = body
            self._recorder.note(FAILING, now, body)

    def _account(self, desk: Station, command: Command, now: float) -> None:
        account = desk.accounting(command.id)
        counts = (account.n_matched, account.n_not_matched, account.n_fault, account.n_silent)
        values = values_in_words(command, account)
        also = (account.n_unknown, account.n_held)
        body = AccountBody(command.id, account.text, *counts, len(command.expected), values, *also)
        self._recorder.note(ACCOUNTING, now, body)
        self._recorder.log(now, command.id, account.sentence())

    def _repeat(self, now: float) -> None:
        """Begin a part of the recording with all that went before as far as it still counts."""
        for tick, message in self._posted:
            self._recorder.posted(now, tick, message)
        for change in self._changes:
            self._recorder.obstacles(now, change)
        self._note_everybody(now)
        for index, rules in self._rules.items():
            if rules:
                self._note_rules(index, now)
        self._painter.begin()
        self._answers.clear()  # accounts, failing rules and marks come with the next picture
        self._failing = FailuresBody([])
        self._unmarked = True
        self.look()

    def _look_at_robots(self, now: float) -> None:
        """Record who has come and gone in this tick."""
        simulator, turnover, before = self._swarm.simulator, self._swarm.simulator.turnover, self._names
        if turnover is None:
            return
        self._names = names = simulator.names
        born = zip(turnover.children.tolist(), turnover.numbers.tolist(), turnover.parents.tolist(), strict=True)
        came = [
            ArrivalBody(names[row], number + 1, row, "" if parent == row else before[parent])
            for row, number, parent in born
        ]
        gone = departures(before, turnover.dead.tolist())
        self._recorder.note(ROBOTS, now, RobotsBody(simulator.tick, came, gone))
        for row in turnover.changed.tolist():  # what was recorded of this row was said of another robot
            self._rules.pop(row, None)
            self._minds[row] = -1

    def _note_everybody(self, now: float) -> None:
        """Record who is there, where robots come and go."""
        simulator = self._swarm.simulator
        if simulator.population is not None:
            numbers = simulator.population.numbers.tolist()
            self._recorder.note(ROBOTS, now, everybody(simulator.tick, self._names, numbers))

    def _look_at_world(self, tick: int, *, own: bool) -> None:
        """Record which solid things have come, moved or gone, as a `WorldChange`."""
        change = self._world.look(tick, own=own)
        if change is not None:
            self._changes.append(change)
            self._recorder.obstacles(self._swarm.now(), change)

    def look(self) -> None:
        """Record readings, rules and the hash of the state."""
        simulator, now = self._swarm.simulator, self._swarm.now()
        self._seen = simulator.tick
        columns = zip(*simulator.readings(), strict=True)
        self._recorder.note(READINGS, now, dict(zip(self._sensors, columns, strict=True)))
        self._recorder.note(STATE, now, StateBody(simulator.tick, simulator.state_hash()))
        minds = self._swarm.fleet.state.mind
        for index in np.flatnonzero((minds != self._minds) & simulator.there).tolist():
            self._look_at_rules(index, now)
        self._minds[...] = minds

    def finish(self) -> None:
        """Record how it ended, unless that was within a tick, which cannot be repeated."""
        simulator = self._swarm.simulator
        if not self._swarm.whole:
            return
        if self._seen != simulator.tick:
            self.picture()
            if not self._world.changed and not self._added:  # else the state is already that of the tick to come
                self.look()

    def _look_at_rules(self, index: int, now: float) -> None:
        mind = self._swarm.fleet.at(index)
        rules = [(rule.name, rule.text, rule.active, rule.priority) for rule in mind.rules()]
        if rules != self._rules.get(index, []):
            self._rules[index] = rules
            self._note_rules(index, now)
            active = ", ".join(name for name, _, active, _ in rules if active)
            self._recorder.log(now, mind.name, f"active rules: {active or 'none'}")

    def _note_rules(self, index: int, now: float) -> None:
        body = RulesBody(self._swarm.simulator.names[index], [RuleBody(*rule) for rule in self._rules[index]])
        self._recorder.note(RULES, now, body)


def is_changed(swarm: Swarm) -> bool:
    """Whether somebody has added robots, so that at the start there were others than the scenario says."""
    population = swarm.simulator.population
    return population is not None and population.added > 0


def periods(scenario: Scenario, wanted: RecordingPlan) -> tuple[Every, Every]:
    """When pictures are due, and when readings."""
    tick = scenario.tick
    usual = scenario.ticks_of_picture(TICKS_PER_PICTURE) * tick
    pictures = usual if wanted.pictures is None else wanted.pictures
    readings = PICTURES_PER_READING * pictures if wanted.readings is None else wanted.readings
    return Every(pictures, tick), Every(readings, tick)


@contextmanager
def recorded(
    swarm: Swarm, station: Station, wanted: RecordingPlan, complain: Callable[[str], None]
) -> Iterator[Recorder]:
    """Record what happens to `swarm` inside. A recording that breaks off says so, and leaves `failed` in the recorder.

    complain: called with a sentence then, see `Recorder`. Raises what Recorder raises.
    """
    simulator = swarm.simulator
    first = (simulator.tick, snapshot(swarm)) if simulator.tick or is_changed(swarm) else (0, b"")
    with Recorder(
        wanted.file,
        simulator.scenario,
        simulator.seed,
        version=VERSION,
        complain=complain,
        rotation=wanted.rotation,
        first=first,
        sensors=simulator.model.sensors,
    ) as recorder:
        witness = RecordingWitness(recorder, swarm, station, wanted)
        swarm.witnesses.append(witness)
        try:
            yield recorder
        finally:
            swarm.witnesses.remove(witness)
            witness.finish()


class RunRecording:
    """The recording of a run that goes on until `close`, or until it is garbage collected."""

    def __init__(self, swarm: Swarm, station: Station, wanted: RecordingPlan) -> None:
        for seconds in (wanted.pictures, wanted.readings):
            if seconds is not None and not (isfinite(seconds) and seconds > 0.0):
                raise MisuseError(f"cannot record every {seconds} s: wanted a number of simulated seconds above 0")
        if any(isinstance(witness, RecordingWitness) for witness in swarm.witnesses):
            raise MisuseError("this run is recorded already: close that recording first")
        with ExitStack() as ends:
            say = logging.getLogger("sleepcast").warning
            self._recorder = ends.enter_context(recorded(swarm, station, wanted, say))
            self._end = finalize(self, ends.pop_all().close)

    @property
    def file(self) -> Path:
        """The file that is written now: the last one where there are several."""
        return self._recorder.file

    @property
    def failed(self) -> bool:
        """Whether it broke off, because nothing more could be written."""
        return self._recorder.failed

    def close(self) -> None:
        """Finish the file."""
        self._end()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *ended: object) -> None:
        self.close()
