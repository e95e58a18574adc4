"""A recording put into the shape that the page shows, and served."""

from __future__ import annotations

from dataclasses import replace

import msgspec

from sleepcast.cli.page import Address, scene_of
from sleepcast.cli.streams import announce
from sleepcast.clock import WallClock
from sleepcast.console import serve_desk
from sleepcast.console.answers import ShownRule
from sleepcast.console.ledger import Row
from sleepcast.console.replay import Film, Marks, ReplayDesk, ReplayDriver, Track
from sleepcast.simulator import Simulator
from sleepcast.simulator.foxglove import read_log, read_poses
from sleepcast.simulator.recorder import ACCOUNTING, LOG, MARKS, POSES, POSTED, READINGS, RULES
from sleepcast.simulator.recording import Entry, NoRecordingError, Recording, entries

MAX_FILM = 2_147_483_648
"""Bytes of poses, readings and the like that are held in memory: ten hours of `bravo` at the usual rates."""


class _Marks(msgspec.Struct):
    groups: bytes
    flags: bytes
    names: list[str]


class _Account(msgspec.Struct):
    command: str
    matched: int
    not_matched: int
    fault: int
    silent: int
    predicted: int


class _Rule(msgspec.Struct):
    name: str
    text: str
    active: bool


class _Rules(msgspec.Struct):
    robot: str
    rules: list[_Rule]


class Maker:
    """Makes a film of a recording, entry by entry."""

    def __init__(self, recording: Recording) -> None:
        scenario = recording.scenario
        simulator = Simulator(scenario, recording.seed)
        self._count, self._tick, self._bytes = len(simulator.names), scenario.tick, 0
        self._rows: dict[str, Row] = {}
        scene = msgspec.structs.replace(scene_of(scenario, simulator.names), commands=())
        units = {sensor.name: sensor.shown_as or sensor.unit for sensor in simulator.model.sensors}
        self.film = Film(scene, recording.seconds, scenario.speed_up, units)
        for posted in recording.posted:
            message = posted.message
            if message.id not in self._rows:
                row = Row(message.id, message.kind.value, message.text.strip(), message.issued, 0, 0, 0, self._count, 0)
                self._rows[message.id] = row
        self._waiting = list(self._rows.values())

    def take(self, entry: Entry) -> None:
        """Add what an entry says. Raises ValueError for what cannot be shown."""
        film, time, data = self.film, entry.time, entry.data
        self._bytes += len(data)
        if self._bytes > MAX_FILM:
            raise ValueError(f"more than {MAX_FILM} bytes do not fit into memory; record with fewer pictures")
        if entry.topic == POSES:
            film.poses.add(time, (round(time / self._tick), read_poses(data, self._count).astype("<f4").tobytes()))
        elif entry.topic == MARKS:
            marks = msgspec.json.decode(data, type=_Marks)
            if not len(marks.groups) == len(marks.flags) == self._count:
                raise ValueError(f"marks of {len(marks.groups)} robots, wanted those of {self._count}")
            film.marks.add(time, Marks(marks.groups, marks.flags, tuple(marks.names)))
        elif entry.topic == READINGS:
            film.values.add(time, data)
        elif entry.topic == POSTED and self._waiting:
            while self._waiting and self._waiting[0].at <= time:
                film.rows.add(time, self._waiting.pop(0))
        elif entry.topic == ACCOUNTING:
            self._account(time, msgspec.json.decode(data, type=_Account))
        elif entry.topic == RULES:
            self._keep(time, msgspec.json.decode(data, type=_Rules))
        elif entry.topic == LOG:
            who, text = read_log(data)
            film.said.setdefault(who, Track()).add(time, text)

    def _account(self, time: float, found: _Account) -> None:
        row = self._rows.get(found.command)
        if row is not None:
            counts = {name: getattr(found, name) for name in found.__struct_fields__ if name != "command"}
            self.film.rows.add(time, msgspec.structs.replace(row, **counts))

    def _keep(self, time: float, found: _Rules) -> None:
        rules = [ShownRule(rule.name, rule.text, rule.active, "", "") for rule in found.rules]
        self.film.rules.setdefault(found.robot, Track()).add(time, rules)


def film_of(recording: Recording) -> Film:
    """The recording as a film. Raises NoRecordingError for one without pictures, or with anything that is none."""
    maker = Maker(recording)
    for entry in entries(recording.file, recording):
        try:
            maker.take(entry)
        except ValueError as error:
            where = f"{recording.file}: {entry.topic} at {entry.time:g} s"
            raise NoRecordingError(f"{where} cannot be shown: {error}") from None
    if not maker.film.poses.times:
        raise NoRecordingError(f"{recording.file} holds no pictures")
    return maker.film


def show(recording: Recording, speed: float | None, address: Address) -> None:
    """Serve the page of a recording until Ctrl-C, which comes out as KeyboardInterrupt."""
    film = film_of(recording)
    if speed is not None:
        film = replace(film, speed=speed)
    clock = WallClock()
    serve_desk(
        ReplayDesk(film, ReplayDriver(film, clock)),
        clock,
        host=address.host,
        port=address.port,
        insecure=address.insecure,
        open_browser=address.browser,
        say=announce,
    )
