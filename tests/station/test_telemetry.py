"""One table of telemetry: what a test comes to on it is what each robot would do, whoever has filled the table."""

from __future__ import annotations

import json
from random import Random

import numpy as np
import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st

from fleet.twins import Twins, vocabulary
from language.authors import Author
from language.cases import SENSORS
from sleepcast.api.assembly import assemble
from sleepcast.channel import Kind, Message
from sleepcast.channel.message import LOOK, Inspection
from sleepcast.columns.telemetry import TelemetryTable
from sleepcast.columns.values import Column, Rows
from sleepcast.console.recorded_values import RecordedNames, RecordedTelemetry
from sleepcast.console.timeline import RobotMarks, Timeline
from sleepcast.console.view import Scene
from sleepcast.core.clock import ManualClock
from sleepcast.fleet import inspection
from sleepcast.language import Checked, ReadError, check
from sleepcast.language.evaluate import is_true
from sleepcast.language.parts import acts
from sleepcast.language.symbols import Group, Names
from sleepcast.simulator import find_scenario
from sleepcast.station import Station
from sleepcast.station.remote import RemoteMinds
from sleepcast.station.telemetry import ToldRows
from sleepcast.station.validation import FleetNames
from station.fleet import Fleet

ROBOTS = 4
GROUPS = ("bravo", "crew")
LEARNED = (
    "(DEFUN rich (share) (> fuel share))",
    "(SETQQ E5 (> x 2))",
    "(RULE keep (WHEN (> fuel 2) (MARK)))",
    "(DEFVAR lim 2)",
    "(DEFUN busy () (MARK))",
)
"""What some of the robots have learned."""
WITH_NAMES = ("(rich {0})", "E5", "keep", "(> lim {0})", "(busy)", "(OR (busy) (> x {0}))", "(KNOWN lim)")
"""Tests with names that they have learned."""


def predicate(chance: Random) -> str:
    """A test, often with groups in it, and seldom with chance or a robot's own function."""
    author = Author(chance, deepest=3)
    some = [
        f"({chance.choice(['>', '<', '>=', '='])} {chance.choice(SENSORS).name} {chance.choice((0, 0.5, 1, 3))})",
        f"(IN {chance.choice(GROUPS)})",
        f"(NOT (KNOWN {chance.choice(SENSORS).name}))",
        f"(> (DIST x y 0 0) {chance.choice((1, 2))})",
        f"(> (/ fuel {chance.choice(('ordnance', '0', 'x'))}) 0.5)",
        chance.choice(("(PROB 0.5)", "(> strange 1)", "MARKED", "(< ID 3)", "(> SONAR1 1)")),
        f"(> {author.text()} 0)",
    ]
    chosen = chance.sample(some, chance.randint(1, 3))
    return chosen[0] if len(chosen) == 1 else f"({chance.choice(('AND', 'OR'))} {' '.join(chosen)})"


def made(chance: Random) -> Twins:
    """Robots with readings and groups."""
    twins = Twins(ROBOTS, seed=chance.randrange(1_000))
    twins.sense([[chance.choice((0.0, 0.5, 1.0, 3.0, float("nan"))) for _ in SENSORS] for _ in range(ROBOTS)])
    for group in GROUPS:
        twins.do(f"(JOIN {group})", chance.sample(range(ROBOTS), chance.randint(1, ROBOTS - 1)))
    twins.do("(MARK)", chance.sample(range(ROBOTS), 2))
    return twins


def on_the_air(twins: Twins) -> tuple[TelemetryTable, Names]:
    """The table of a desk that has asked the nodes, the last time in the tick that is now."""
    minds = RemoteMinds()
    for look in (Inspection.TELEMETRY, Inspection.VOCABULARY, Inspection.MIND, Inspection.TELEMETRY):
        twins.sent += 1
        twins.hear(Message("desk", 1, twins.sent, Kind.ASK, twins.now, body={LOOK: look}))
        twins.think()
        for node in twins.nodes:
            minds.take(next(said for said in reversed(node.outbox) if said.kind is Kind.ANSWER), twins.now)
    station = Station(minds.vocabulary, minds, [].append, ManualClock(twins.now))
    station.observe(twins.now, minds.values())
    assert minds.complete
    return station.telemetry, station.learned


def simulated(twins: Twins) -> tuple[TelemetryTable, Names]:
    """The table of a simulated fleet."""
    twins.fleet.telemetry.take(np.arange(ROBOTS))
    return twins.fleet.telemetry, FleetNames(twins.fleet.vocabulary, twins.fleet)


def recorded(twins: Twins) -> tuple[TelemetryTable, Names]:
    """The table of a recording that holds this moment."""
    timeline = Timeline(
        Scene("", "", "robots", tuple(twins.fleet.names), (0.0, 0.0, 1.0, 1.0), "m", ()),
        twins.now,
        1.0,
        {},
        vocabulary(),
    )
    readings = {
        sensor.name: [None if np.isnan(value) else value for value in twins.fleet.column(slot).tolist()]
        for slot, sensor in enumerate(SENSORS, twins.fleet.vocabulary.first_sensor)
    }
    timeline.values.add(0.0, json.dumps(readings).encode())
    first, second = (
        bytes(number * (group in node.groups) for node in twins.nodes) for number, group in enumerate(GROUPS, 1)
    )
    marked = bytes(8 * (node.values[0] > 0.0) for node in twins.nodes)
    timeline.marks.add(0.0, RobotMarks(first, marked, GROUPS, second))
    names = RecordedNames(timeline.vocabulary, {group: Group(group) for group in GROUPS})
    return RecordedTelemetry(timeline, lambda: twins.now), names


def decided(table: TelemetryTable, checked: Checked, now: float = 0.0) -> list[object]:
    """Of each robot whether a test holds, None where it is unknown, or why that cannot be said. All have told now."""
    values, reason, reasons = table.values(checked.required(), np.arange(ROBOTS), now, np.full(ROBOTS, now))
    return [
        reasons[why - 1] if why else truth(value) for value, why in zip(values.tolist(), reason.tolist(), strict=True)
    ]


def truth(value: float) -> bool | None:
    """What a test with this value comes to."""
    return None if value != value else bool(is_true(value))


def program(text: str, names: Names) -> Checked | None:
    """The test, None for one that no robot could run, or that would do something itself."""
    try:
        checked = check(text, names)
    except ReadError:
        return None
    return None if checked.errors or checked.program is None or acts(checked.program.root) else checked


@settings(max_examples=60)
@given(start=st.integers(0, 2**63))
def test_a_certain_answer_is_what_the_robot_itself_would_say(start: int) -> None:
    chance = Random(start)
    twins, text = made(chance), predicate(chance)
    note(text)
    fed = [on_the_air(twins), simulated(twins), recorded(twins)]
    answers = [
        decided(table, checked, twins.now) for table, names in fed if (checked := program(text, names)) is not None
    ]
    for place, node in enumerate(twins.nodes):
        if not answers:
            return
        itself = truth(node.evaluate(text).value)
        for answer in answers:
            assert isinstance(answer[place], str) or answer[place] is itself, (place, answer, itself)
    assert len(answers) < 2 or answers[0] == answers[1]


@settings(max_examples=40)
@given(start=st.integers(0, 2**63))
def test_what_robots_have_learned_counts_robot_by_robot(start: int) -> None:
    chance = Random(start)
    twins = made(chance)
    for text in LEARNED:
        twins.do(text, chance.sample(range(ROBOTS), chance.randint(1, ROBOTS - 1)))
    text = chance.choice(WITH_NAMES).format(chance.choice((0, 1, 2)))
    text = text if chance.random() < 0.5 else f"(AND {predicate(chance)} {text})"
    note(text)
    answers = [
        decided(table, checked)
        for table, names in (on_the_air(twins), simulated(twins))
        if (checked := program(text, names)) is not None
    ]
    for place, node in enumerate(twins.nodes if answers else ()):
        own = truth(node.evaluate(text).value)
        assert all(isinstance(answer[place], str) or answer[place] is own for answer in answers), (place, answers, own)
    assert len(answers) < 2 or answers[0] == answers[1]


def test_only_columns_that_are_asked_for_are_filled(monkeypatch: pytest.MonkeyPatch) -> None:
    twins = made(Random(1))
    asked: list[int] = []
    filled = ToldRows.column

    def watched(self: ToldRows, slot: int) -> Column:
        asked.append(slot)
        return filled(self, slot)

    monkeypatch.setattr(ToldRows, "column", watched)
    table, names = on_the_air(twins)
    first = names.vocabulary.first_sensor
    for text in ("(> x 1)", "(AND (> x 2) (< y 3))", "(IN bravo)", "(< y x)"):
        decided(table, check(text, names))
    assert asked == [first + 2, first + 3]


def test_a_table_stays_as_it_is_while_robots_tell_more() -> None:
    fleet = Fleet(3)
    fleet.report(["s0", "s2"])
    before = fleet.station.told.latest()
    slot = fleet.minds["s0"].vocabulary.first_sensor
    fleet.minds["s0"].sense((5.0, 0.5, 0.5), 1.0)
    fleet.report(["s0"])
    everybody = Rows.run(0, before.count)
    assert before.column(slot, everybody).tolist()[::2] == [0.0, 200.0]
    assert fleet.station.told.latest().column(slot, everybody).tolist()[::2] == [5.0, 200.0]


def test_clocks_of_robots_go_on_while_they_tell_nothing() -> None:
    """A desk and a robot need not have the same clock."""
    fleet = Fleet(2)
    for name, began in (("s0", 10.0), ("s1", 100.0)):
        fleet.minds[name].think(1, began)
    fleet.report()
    fleet.clock.advance(4.0)
    assert fleet.station.preview("(WHEN (>= time 14s) (ST))").yes == ("s0", "s1")
    assert fleet.station.preview("(WHEN (> time 14s) (ST))").yes == ("s1",)
    assert fleet.station.values("time")[0].tolist() == [14.0, 104.0]


@pytest.mark.parametrize("large", [False, True])
def test_the_clock_of_a_run_is_that_of_its_robots_though_they_sleep(
    large: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Robots with nothing to do do not look at it, and a large fleet tells only what is asked for."""
    monkeypatch.setattr(inspection, "MANY", 1 if large else 1_000_000)
    swarm, station = assemble(find_scenario("two-desks"), None, mission=False)
    swarm.run(7.3)
    for test, wanted in (("(> time 7.25s)", 12), ("(> time 7.35s)", 0), ("(= tick 73)", 12), ("(> tick 73)", 0)):
        preview = station.preview(f"(WHEN {test} (ST))")
        assert (len(preview.yes), len(preview.unknown)) == (wanted, 0), test


def test_what_a_robot_made_itself_and_its_flags_are_in_the_table() -> None:
    twins = made(Random(2))
    twins.do("(PROGN (DEFVAR lim 7) (SETQQ E3 (> x 1)))", [1, 2])
    table, names = on_the_air(twins)
    assert decided(table, check("(= lim 7)", names)) == [None, True, True, None]
    assert decided(table, check("(= ACTIVE3 1)", names)) == decided(*_of_fleet(twins, "(= ACTIVE3 1)"))


def _of_fleet(twins: Twins, text: str) -> tuple[TelemetryTable, Checked]:
    table, names = simulated(twins)
    return table, check(text, names)
