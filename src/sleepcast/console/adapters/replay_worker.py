"""The process that runs a swarm again, to answer for a moment of its past (see `console/replay_client`).

It keeps three swarms: one where somebody looks, one that has just evaluated a command that was asked about, and one
that runs ahead through a recording to keep states of it, and later through what is plotted. Each goes on from where it
is if that is nearer than the state that came with the question.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from multiprocessing import connection
from time import perf_counter, thread_time

import msgspec
import numpy as np

from sleepcast.channel import Kind, Message
from sleepcast.channel.message import WAITING
from sleepcast.channel.message_batch import AnswerColumns, MessageBatch
from sleepcast.console import outgoing, registry
from sleepcast.console.adapters.swarm import SwarmAdapter
from sleepcast.console.backend import Backend
from sleepcast.console.connection import encode
from sleepcast.console.differences import first_difference
from sleepcast.console.driver import Driver
from sleepcast.console.features.plots import AddPlot
from sleepcast.console.features.why import Explained, Why, show_why
from sleepcast.console.marks import clock_time
from sleepcast.console.page_parts import added_parts
from sleepcast.console.past import Sampled
from sleepcast.console.replay_client import Question, ReplayAnswer, RerunError, RunMoment, digest
from sleepcast.console.series import plain, sample_of
from sleepcast.console.snapshots import SnapshotTimer
from sleepcast.console.swarm_dialogue import SwarmDialogue
from sleepcast.core.errors import SleepcastError
from sleepcast.fleet import Fleet
from sleepcast.loop import Pace, Swarm, resume
from sleepcast.loop.rerun import Rerun
from sleepcast.loop.snapshots import copy_of
from sleepcast.loop.swarm import Desk
from sleepcast.simulator import Simulator
from sleepcast.simulator.snapshot import scenario_of
from sleepcast.station import Station
from sleepcast.station.sent import CAME_LATER, STILL_WAITS
from sleepcast.station.station import DESK

LOOK = 0.02
"""Seconds of work between two looks whether the answer is still wanted."""
NICE = 5
"""How much less urgent it is than the swarm that lives."""
BROKEN = (ValueError, TypeError, LookupError, ArithmeticError, AttributeError, RecursionError, MemoryError)
"""Exceptions that a recording with impossible contents may cause."""
UNEXPLAINED = {
    Kind.STOP: "STOP is obeyed as it is heard: there is no expression that robots could explain.",
    Kind.RELEASE: "RELEASE is obeyed as it is heard: there is no expression that robots could explain.",
    Kind.ASK: "A question is answered with its value and changes nothing: robots keep no explanation of it.",
}


class ReplayAbandonedError(SleepcastError):
    """Nobody waits for the answer any more, or it takes too long."""


class _StillClock:
    """A clock that stands still."""

    def now(self) -> float:
        return 0.0


class RerunSwarm:
    """A swarm that is run again.

    number: of the run
    began: the tick in which it began
    differs: the first tick in which it was not as it was seen
    """

    def __init__(self, moment: RunMoment, swarm: Swarm, groups: tuple[str, ...]) -> None:
        self.number, self.began = moment.run, moment.base
        self.differs: int | None = None
        self.swarm = swarm
        station = _sit_down(swarm)
        self.rerun = Rerun(swarm, moment.inputs)
        self.view = SwarmAdapter(swarm)
        clock = _StillClock()
        pace = Pace(clock, swarm, 1.0)
        pace.paused = True
        driver = Driver(self.view, pace, clock)
        driver.groups.expect(groups)
        self.backend = Backend(self.view, station, driver, clock)
        self.dialogue = SwarmDialogue(self.backend)

    def step(self, moment: RunMoment) -> None:
        """One tick, which must lead where it led."""
        self.rerun.step()
        wanted = moment.checks.get(self.rerun.tick)
        if wanted is None or self.differs is not None:
            return
        if digest(self.view.poses(), len(self.view.scene.names)) != wanted:
            self.differs = self.rerun.tick


def _sit_down(swarm: Swarm) -> Station:
    """Give every operator of a swarm a desk, which hears what robots say; the first one's."""
    names = swarm.operators or [DESK]
    first, *others = (Station(swarm.vocabulary, swarm.minds, swarm.post, swarm, operator=name) for name in names)
    swarm.desk, swarm.others = first, list[Desk](others)
    return first


class ReplayWorker:
    """See the module. given_up: whether nobody waits for the answer any more."""

    def __init__(self, given_up: Callable[[], bool]) -> None:
        self._given_up = given_up
        self._swarms: dict[str, RerunSwarm] = {}
        self._snapshot_timer = SnapshotTimer()

    def answer(self, question: Question) -> ReplayAnswer:
        """What is found at the moment of a question."""
        try:
            return self._answer(question)
        except ReplayAbandonedError:
            return ReplayAnswer(ended=True)
        except SleepcastError as error:
            return ReplayAnswer(error=str(error))
        except BROKEN as error:
            why = str(error).splitlines()[0][:300] or type(error).__name__
            return ReplayAnswer(error=f"The past cannot be shown: {why}.")

    def _answer(self, question: Question) -> ReplayAnswer:
        match question.action:
            case "begin":
                return self._begin(question)
            case "advance":
                return self._advance(question)
            case "why":
                return self._why(question)
            case "compare":
                return self._compare(question)
            case "sample":
                return self._sample(question)
        run = self._at("look", question)
        if question.action == "state":
            return ReplayAnswer(run.rerun.tick, state=copy_of(run.swarm).packed(), differs=run.differs)
        if question.action == "answer":
            message = run.dialogue.answer(registry.decode(question.message))
            if not isinstance(message, msgspec.Struct):
                raise RerunError("This is not available for moments in the past.")
            return ReplayAnswer(run.rerun.tick, message=encode(message), differs=run.differs)
        return self._look(run, question.robot)

    def _look(self, run: RerunSwarm, robot: int) -> ReplayAnswer:
        view, groups = run.view, run.backend.driver.groups
        codes, flags = groups.look(view.minds), run.backend.driver.flags()
        marks = (codes, flags, tuple(groups.names), groups.second, view.colours())
        news = run.backend.news(robot) if robot >= 0 else ()
        watched = next((encode(each) for each in news if isinstance(each, outgoing.WatchedRobot)), b"")
        counts, shown = tuple(groups.counts), tuple(groups.shown)
        names = view.scene.names if run.swarm.simulator.population is not None else ()
        return ReplayAnswer(view.tick, view.poses(), marks, counts, shown, watched, differs=run.differs, names=names)

    def _at(self, name: str, question: Question) -> RerunSwarm:
        """The swarm at the moment of a question."""
        moment = question.moment
        run = self._near(name, moment, question.groups)
        self._run(run, moment, question.patience, lambda: run.rerun.tick >= moment.tick)
        return run

    def _near(self, name: str, moment: RunMoment, groups: tuple[str, ...] = (), *, since: bool = False) -> RerunSwarm:
        """A swarm from which the moment is near. since: it must have seen all that came after the moment's state."""
        run = self._swarms.get(name)
        if (
            run is not None
            and run.number == moment.run
            and moment.base <= run.rerun.tick <= moment.tick
            and (not since or run.began <= moment.base)
        ):
            run.rerun.follow(moment.inputs)
            return run
        self._swarms.pop(name, None)  # a large one goes before the next one comes
        run = self._swarms[name] = RerunSwarm(moment, resume(moment.state), groups)
        return run

    def _run(self, run: RerunSwarm, moment: RunMoment, patience: float, done: Callable[[], bool]) -> None:
        """Run on until it is done. Raises ReplayAbandonedError."""
        began = looked = perf_counter()
        while not done():
            run.step(moment)
            now = perf_counter()
            if now - looked > LOOK:
                looked = now
                if self._given_up() or now - began > patience:
                    raise ReplayAbandonedError("")

    # ---- what is asked

    def _begin(self, question: Question) -> ReplayAnswer:
        """The state with which a run begins."""
        data, seed = question.source
        if question.moment.state:
            swarm = resume(question.moment.state)
        else:
            swarm = Swarm(Simulator(scenario_of(data), seed))
        _sit_down(swarm)
        if not swarm.simulator.tick:
            swarm.send_initial_telemetry()
        return ReplayAnswer(swarm.simulator.tick, state=copy_of(swarm).packed())

    def _advance(self, question: Question) -> ReplayAnswer:
        """Run ahead for a while, or until there is a state to be kept."""
        moment = question.moment
        run = self._near("ahead", moment)
        began = before = perf_counter()
        while run.rerun.tick < moment.tick and not self._given_up():
            run.step(moment)
            now = perf_counter()
            self._snapshot_timer.worked(now - before)
            before = now
            if self._snapshot_timer.due:
                self._snapshot_timer.begun()
                spent = thread_time()
                state = copy_of(run.swarm).packed()
                self._snapshot_timer.kept(thread_time() - spent)
                return ReplayAnswer(run.rerun.tick, state=state, differs=run.differs)
            if now - began > question.patience:
                break
        return ReplayAnswer(run.rerun.tick, differs=run.differs)

    def _compare(self, question: Question) -> ReplayAnswer:
        """Run both side by side up to their first difference."""
        if question.other is None:
            raise RerunError("There is no other future.")
        self._swarms.clear()
        futures = [RerunSwarm(moment, resume(moment.state), ()) for moment in (question.moment, question.other)]
        one, other = futures
        while one.rerun.tick < question.moment.tick:
            one.step(question.moment)
            other.step(question.other)
            difference = first_difference(one.swarm, other.swarm)
            if difference is not None:
                return ReplayAnswer(one.rerun.tick, message=difference.encode())
        return ReplayAnswer(one.rerun.tick)

    def _sample(self, question: Question) -> ReplayAnswer:
        """What a plot over time shows. It does not move the swarm at which somebody looks."""
        asked = registry.decode(question.message)
        if not isinstance(asked, AddPlot):
            raise RerunError("This is no plot.")
        run = self._at("ahead", question)
        try:
            sampled = Sampled(plain(sample_of(run.backend.values, asked.what, asked.x, asked.where, "")))
        except SleepcastError as error:  # robots have not yet learned what it names, say
            sampled = Sampled([], str(error))
        return ReplayAnswer(run.rerun.tick, message=encode(sampled), differs=run.differs)

    def _why(self, question: Question) -> ReplayAnswer:
        """Run on from before a command until the robot has evaluated it."""
        asked, moment = registry.decode(question.message), question.moment
        if not isinstance(asked, Why):
            raise RerunError("This is no question why.")

        def is_logged() -> bool:
            fleet, robot = run.swarm.fleet, asked.robot
            return fleet.names[robot] == name and fleet.evaluation_log.find(robot, asked.command) is not None

        name = self._name_at(question, asked.robot)
        run = self._near("why", moment, since=True)
        if run.rerun.tick > moment.base and not is_logged():  # it may have evaluated it, and forgotten
            self._swarms.pop("why")
            run = self._near("why", moment)
        sent = next(each for _, each in moment.inputs.posted if each.id == asked.command)
        if sent.kind in UNEXPLAINED:
            raise RerunError(UNEXPLAINED[sent.kind])
        answer = _Answer(run.swarm.fleet, asked.robot, name, asked.command)
        run.swarm.witnesses.append(answer)

        def done() -> bool:
            over = run.swarm.now() > sent.deadline and not answer.waits
            return is_logged() or run.rerun.tick >= moment.tick or over

        try:
            self._run(run, moment, question.patience, done)
        finally:
            run.swarm.witnesses.remove(answer)
        if not is_logged():
            if run.differs is None:
                raise RerunError(f"{name} {_why_unexplained(run, sent, answer)}")
            return ReplayAnswer(run.rerun.tick, differs=run.differs)
        why = show_why(run.swarm.fleet.at(asked.robot).why(asked.command))
        return ReplayAnswer(run.rerun.tick, message=encode(Explained(asked.serial, why)), differs=run.differs)

    def _name_at(self, question: Question, robot: int) -> str:
        """Who is asked. Where robots come and go, others may have had its place when the command was sent."""
        fleet = self._near("why", question.moment, since=True).swarm.fleet
        if not fleet.names.lasting:
            fleet = self._at("look", question).swarm.fleet
        if not fleet.names[robot]:
            raise RerunError(f"Robot number {robot} is not there at this moment.")
        return fleet.names[robot]


class _Answer:
    """A witness of a swarm that hears whether a robot answers a command, or has come after it was sent."""

    def __init__(self, fleet: Fleet, robot: int, name: str, command: str) -> None:
        self._fleet, self._robot, self._name, self._command = fleet, robot, name, command
        self.came_later, self.outcome = False, ""

    @property
    def waits(self) -> bool:
        """Whether it has answered last that it waits for the command's instant."""
        return self.outcome == WAITING

    @property
    def _there(self) -> bool:
        """Whether the robot has its place by now."""
        return self._fleet.names[self._robot] == self._name

    def ticking(self) -> None:
        """Nothing."""

    def posted(self, message: Message) -> None:
        """The operator's message goes on the air in this tick."""
        if message.id == self._command:
            self.came_later = not self._there

    def said(self, batch: MessageBatch) -> None:
        """Robots say something."""
        words = batch.words
        if isinstance(words, AnswerColumns) and words.command == self._command and self._there:
            for index in np.flatnonzero(batch.robots == self._robot):
                self.outcome = words.outcomes[words.outcome[index]]

    def ticked(self) -> None:
        """Nothing."""

    def came(self, arrival: object) -> None:
        """Nothing."""


def _why_unexplained(run: RerunSwarm, sent: Message, answer: _Answer) -> str:
    """Why a robot cannot explain a command, after its name: never more than what is known up to this moment."""
    now = run.swarm.now()
    if answer.came_later:
        return f"{CAME_LATER}."
    if answer.waits:
        return f"{STILL_WAITS}."
    if answer.outcome:
        return f"evaluated this command, but {run.swarm.fleet.evaluation_log.limits()}."
    if now > sent.deadline:
        return (
            f"did not evaluate this command before its deadline, {clock_time(sent.deadline)}: it did not receive it in "
            "time."
        )
    return f"had not evaluated this command yet at {clock_time(now)}."


def serve_past(pipe: connection.Connection) -> None:
    """What the process does until its owner is gone. Ctrl-C is its owner's business."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "nice"):
        os.nice(NICE)
    given_up = current = 0

    def ended() -> bool:
        """Read what has come meanwhile: nothing but numbers of questions that are given up."""
        nonlocal given_up
        while pipe.poll():
            given_up = max(given_up, pipe.recv())
        return given_up >= current

    added_parts(lambda sentence: None)  # for what packages ask; what is wrong with them, the page's own process says
    past = ReplayWorker(ended)
    try:
        while True:
            message = pipe.recv()
            if isinstance(message, int):
                given_up = max(given_up, message)
                continue
            current, question = message
            pipe.send(ReplayAnswer(ended=True) if ended() else past.answer(question))
    except (EOFError, OSError):
        return
