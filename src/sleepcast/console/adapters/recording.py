"""A recording, as the operator's page shows it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

from sleepcast.channel import Kind
from sleepcast.console.account_table import CommandRow
from sleepcast.console.adapters.fields import still_picture
from sleepcast.console.adapters.sight import RecordedSight
from sleepcast.console.adapters.swarm import existing, kind_of, scene_of, solids_of
from sleepcast.console.failing import Failures, ShownFailing
from sleepcast.console.frames import packed_poses
from sleepcast.console.outgoing import ShownRule
from sleepcast.console.timeline import RobotMarks, Timeline, Track, values_of
from sleepcast.fleet.failing import MAX_FAILING
from sleepcast.loop import vocabulary_of
from sleepcast.loop.rerun import Inputs
from sleepcast.simulator import Simulator
from sleepcast.simulator.packing import unpack
from sleepcast.simulator.recording.foxglove import read_heights, read_log, read_poses
from sleepcast.simulator.recording.json_messages import AccountBody, FailuresBody, MarksBody, RobotsBody, RulesBody
from sleepcast.simulator.recording.recorder import (
    ACCOUNTING,
    FAILING,
    GROUPS,
    LOG,
    MARKS,
    NANO,
    OBSTACLES,
    POINTS,
    POSES,
    POSTED,
    READINGS,
    ROBOTS,
    RULES,
    SCENE,
    WorldChange,
)
from sleepcast.simulator.recording.recording import (
    NoRecordingError,
    RecordedEntry,
    Recording,
    alive,
    decoded,
    entries,
)
from sleepcast.simulator.recording.roster import names_after, names_at_first

MAX_TIMELINE = 2_147_483_648
"""Bytes of poses, readings and the like that are held in memory: ten hours of `bravo` at the usual rates."""


class TimelineBuilder:
    """Makes a timeline of a recording, entry by entry."""

    def __init__(self, recording: Recording) -> None:
        scenario = recording.scenario
        with alive(recording):
            simulator = Simulator(scenario, recording.seed)
        self._count, self._tick, self._bytes = len(simulator.names), scenario.tick, 0
        self._flies = scenario.robots.flight is not None
        self._rows: dict[str, CommandRow] = {}
        picture = scenario.picture
        if picture is not None:  # only its name is recorded: it may lie beside the recording
            picture = existing(replace(picture, file=recording.file.parent / picture.file.name))
        self._names = names_at_first(scenario)
        scene = scene_of(replace(scenario, commands=(), picture=picture), self._names)
        units = {sensor.name: sensor.shown_unit for sensor in simulator.model.sensors}
        part = recording.part if recording.part > 1 or recording.following else 0
        vocabulary = vocabulary_of(simulator.model)
        kinds = tuple(kind_of(scenario, sort) for sort in scenario.each_type)
        self.timeline = Timeline(
            scene, recording.seconds, scenario.speed_up, units, vocabulary, kinds, recording.began, part
        )
        if simulator.population is not None:
            self.timeline.numbers = {name: number for number, name in enumerate(filter(None, self._names), 1)}
        self.timeline.picture = None if picture is None else picture.png
        self.timeline.field = cache(partial(still_picture, scenario))  # the same at any time, for any question
        self._solids = dict(enumerate(scenario.shapes, 1))
        self._shapes = Track([0.0], [scenario.shapes])
        self.timeline.sight = RecordedSight(scenario, simulator.bodies.radii, self.timeline.poses, self._shapes)
        for posted in recording.posted:
            message = posted.message
            if message.id not in self._rows and message.kind is not Kind.REQUEST:  # those are no commands
                about = (message.id, message.kind.value, message.text.strip(), message.issued)
                self._rows[message.id] = CommandRow(*about, 0, 0, 0, self._count, 0, message.standing)
        self._waiting = list(self._rows.values())

    def take(self, entry: RecordedEntry) -> None:
        """Add what an entry says. Raises ValueError for what cannot be shown."""
        if entry.topic in (POINTS, SCENE, GROUPS):  # for other viewers; poses, marks and the scenario say the same
            return
        timeline, time, data = self.timeline, entry.time, entry.data
        self._bytes += len(data)
        if self._bytes > MAX_TIMELINE:
            raise ValueError(f"more than {MAX_TIMELINE} bytes do not fit into memory; record with fewer pictures")
        if entry.topic == POSES:
            z = read_heights(data, self._count) if self._flies else None
            x, y, heading = read_poses(data, self._count).T
            timeline.poses.add(time, (round(time / self._tick), packed_poses(x, y, heading, z)))
            if timeline.names_at(time) is not self._names:
                timeline.names.add(time, self._names)
        elif entry.topic == MARKS:
            marks = decoded(MarksBody, data)
            for each in (marks.groups, marks.flags, marks.second or marks.groups, marks.colours or marks.groups):
                if len(each) != self._count:
                    raise ValueError(f"marks of {len(each)} robots, wanted those of {self._count}")
            timeline.marks.add(
                time, RobotMarks(marks.groups, marks.flags, tuple(marks.names), marks.second, marks.colours)
            )
        elif entry.topic == READINGS:
            values_of(data)
            timeline.values.add(time, data)
        elif entry.topic == POSTED and self._waiting:
            while self._waiting and round(self._waiting[0].at * NANO) <= round(time * NANO):  # as entries tell time
                timeline.rows.add(time, self._waiting.pop(0))
        elif entry.topic == ACCOUNTING:
            self._account(time, decoded(AccountBody, data))
        elif entry.topic == FAILING:
            timeline.failures.add(time, self._failures(decoded(FailuresBody, data)))
        elif entry.topic == RULES:
            self._keep(time, decoded(RulesBody, data))
        elif entry.topic == ROBOTS:
            change = decoded(RobotsBody, data)
            self._names = names_after(self._names, change)
            timeline.numbers.update({each.robot: each.number for each in change.came})
        elif entry.topic == OBSTACLES:
            self._change(time, unpack(WorldChange, data))
        elif entry.topic == LOG:
            who, text, _ = read_log(data)
            timeline.reports.setdefault(who, Track()).add(time, text)

    def _account(self, time: float, account: AccountBody) -> None:
        row = self._rows.get(account.command)
        if row is not None:
            counts = (account.matched, account.not_matched, account.fault, account.silent, account.predicted)
            self.timeline.rows.add(
                time,
                CommandRow(
                    *(row.id, row.kind, row.text, row.at, *counts, row.standing, account.values),
                    unknown=account.unknown,
                    held=account.held,
                ),
            )

    def _failures(self, failures: FailuresBody) -> Failures:
        if len(failures.rules) > MAX_FAILING:
            raise ValueError(f"{len(failures.rules)} rules that fail, at most {MAX_FAILING} are recorded")
        size = -(-self._count // 8)
        for rule in failures.rules:
            if len(rule.robots) != size:
                raise ValueError(f"{len(rule.robots)} bytes of robots, wanted {size} for {self._count} robots")
        shown = (ShownFailing(each.rule, each.count, each.inactive, each.reason) for each in failures.rules)
        return Failures(tuple(shown), tuple(each.robots for each in failures.rules))

    def _change(self, time: float, change: WorldChange) -> None:
        for number in change.gone:
            self._solids.pop(number, None)
        for name, shape in change.put.items():
            self._solids[int(name)] = shape
        self.timeline.obstacles.add(time, solids_of(self._solids.values()))
        self._shapes.add(time, tuple(self._solids.values()))

    def _keep(self, time: float, body: RulesBody) -> None:
        rules = [ShownRule(rule.name, rule.text, rule.active, "", "", rule.priority) for rule in body.rules]
        self.timeline.rules.setdefault(body.robot, Track()).add(time, rules)


def load_timeline(recording: Recording) -> Timeline:
    """The recording as a timeline. Raises NoRecordingError for one without pictures, or with anything that is none."""
    maker = TimelineBuilder(recording)
    for entry in entries(recording.file, recording):
        try:
            maker.take(entry)
        except (ValueError, RecursionError) as error:
            where = f"{recording.file}: {entry.topic} at {entry.time:g} s"
            raise NoRecordingError(f"{where} cannot be shown: {error}") from None
    if not maker.timeline.poses.times:
        raise NoRecordingError(f"{recording.file} holds no pictures")
    return maker.timeline


def inputs_of(recording: Recording) -> Inputs:
    """What the recorded run got from outside."""
    posted = [(each.tick, each.message) for each in recording.posted]
    return Inputs(posted, [change for change in recording.obstacles if not change.own])
