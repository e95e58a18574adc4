"""Events: timed additions, removals and moves of the named things of a world, and links that are cut.

    [[events]]
    at = "20s"
    remove = "gate"

    [[events]]
    at = "30s"
    move = "box"
    by = ["2m", "0m"]

    [[events]]
    at = "40s"
    add = "gate"

    [[events]]
    at = "50s"
    cut_off = "crazyflie3"
    lasts = "5s"

Several things may share a name. `add` puts back the things defined under that name in the file; those marked
`absent` are not in the world at the start. An event takes effect in the first tick that ends at its time or later,
before anything moves. What a robot does that is cut off from its mind, `bodies.links` says.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

from sleepcast.core.errors import did_you_mean
from sleepcast.core.records import dataclass
from sleepcast.core.settings import Table
from sleepcast.core.ticks import tick_at
from sleepcast.core.units import TIME
from sleepcast.simulator.world.world import Point, Shape, World

MAX_EVENTS = 1_000
"""Events of one scenario: one per second for a quarter of an hour."""
ACTIONS = ("add", "remove", "move")
CUT_OFF = "cut_off"


@dataclass(frozen=True, slots=True)
class Event:
    """At `time` (s) the things called `name` are added, removed or moved `by` this vector (m)."""

    time: float
    sort: str
    name: str
    by: Point = (0.0, 0.0)


@dataclass(frozen=True, slots=True)
class LinkCut:
    """From `time` on (s), for so many s, nothing of its mind reaches the body of the robot with this index; `lasts` is
    inf for the rest of the run."""

    time: float
    robot: int
    lasts: float = inf


def read_events(
    root: Table,
    present: Sequence[Shape],
    absent: Sequence[Shape],
    size: Point,
    most: float,
    names: Sequence[str],
    *,
    solid: bool = True,
) -> tuple[tuple[Event, ...], tuple[LinkCut, ...]]:
    """The tables `[[events]]`, sorted by time: changes of the world, and links that are cut.

    present, absent: the things in the world at the start, and those that are not
    size: of the world, m
    most: latest time, s
    names: of the robots; none where they come and go
    solid: False for a run without solid things, which has no changes of them
    """
    events: list[tuple[Event, Table]] = []
    cuts: list[tuple[LinkCut, Table]] = []
    for table in root.array("events", most=MAX_EVENTS):
        with table:
            named = [action for action in (*ACTIONS, CUT_OFF) if table.has(action)]
            if len(named) != 1:
                raise table.error((named or ["add"])[-1], "wanted one of add, remove, move and cut_off in each event")
            time = table.number("at", TIME, low=0.0, high=most)
            if named == [CUT_OFF]:
                cuts.append((LinkCut(time, _robot(table, names), table.number("lasts", TIME, inf, low=0.0)), table))
                continue
            by = table.point("by", (-size[0], -size[1]), size) if named == ["move"] else (0.0, 0.0)
            events.append((Event(time, named[0], table.text(named[0], most=64), by), table))
    events.sort(key=lambda each: each[0].time)
    cuts.sort(key=lambda each: each[0].time)
    if not solid:
        events = []
    _check(events, {shape.name for shape in present if shape.name}, {shape.name for shape in absent})
    _check_apart(cuts)
    return tuple(event for event, _ in events), tuple(cut for cut, _ in cuts)


def _robot(table: Table, names: Sequence[str]) -> int:
    """The index of the robot that is to be cut off."""
    name = table.text(CUT_OFF, most=64)
    if not names:
        raise table.error(CUT_OFF, "robots that come and go are not cut off: leave this out, or hatch, most and at")
    if name not in names:
        raise table.error(CUT_OFF, f'there is no robot called "{name}"{did_you_mean(name, names[:MAX_EVENTS])}')
    return names.index(name)


def _check_apart(cuts: Sequence[tuple[LinkCut, Table]]) -> None:
    """Raise SettingsError for a robot that is to be cut off while it is."""
    until: dict[int, float] = {}
    for cut, table in cuts:
        if cut.time <= until.get(cut.robot, -inf):
            raise table.error(CUT_OFF, "it is cut off already at that time: say lasts in the event before")
        until[cut.robot] = cut.time + cut.lasts


def _check(events: Sequence[tuple[Event, Table]], present_at_start: set[str], absent: set[str]) -> None:
    """Raise SettingsError for an event about a thing that is not in the world at that time."""
    known = present_at_start | absent
    present = set(present_at_start)
    for event, table in events:
        if event.name not in known:
            raise table.error(event.sort, f'there is no thing called "{event.name}"{did_you_mean(event.name, known)}')
        if (event.name in present) == (event.sort == "add"):
            how = "there already" if event.sort == "add" else "not there"
            raise table.error(event.sort, f'"{event.name}" is {how} at that time')
        if event.sort == "add":
            present.add(event.name)
        elif event.sort == "remove":
            present.discard(event.name)


def event_ticks(events: Sequence[Event], tick: float) -> list[int]:
    """The tick on which each of these falls; the first is 1, on which those of the start fall, too. tick: s in each."""
    return [max(1, tick_at(event.time, tick)) for event in events]


def apply_events(world: World, events: Sequence[Event], things: Sequence[Shape], on: int, tick: float) -> None:
    """Apply the events that fall on the tick `on`. things: all that may be added. tick: s in each."""
    for event, due in zip(events, event_ticks(events, tick), strict=True):
        if due == on:
            numbers = [number for number, shape in world.shapes.items() if shape.name == event.name]
            if event.sort == "add":
                for shape in things:
                    if shape.name == event.name and not numbers:
                        world.add(shape)
            for number in numbers:
                if event.sort == "remove":
                    world.remove(number)
                elif event.sort == "move":
                    world.move(number, *event.by)
