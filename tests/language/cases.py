"""Cases: what the standard dialect means, in the dialect itself, and the machines that every case is run on.

`tests/cases/*.cases` hold the cases; the head of each file says how they are written. `blocks` reads them, `MACHINES`
names every machine there is, and `mismatch` says how the outcome of one evaluation differs from what a case expects.
A machine that joins the house later joins the table.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple, Protocol
from unittest.mock import patch

import numpy as np

from language.reference import Reference
from sleepcast.channel import message
from sleepcast.core.model import Quantity
from sleepcast.core.neighbours import nearest_id
from sleepcast.core.units import LENGTH, NONE, SPEED
from sleepcast.fleet import Fleet, RobotView
from sleepcast.fleet.native.kernels import Kernels, available
from sleepcast.language import (
    CheckError,
    Constant,
    Finding,
    HostFunction,
    ReadError,
    Vocabulary,
    check,
    format_value,
    program,
)
from sleepcast.language.numerics import angle
from sleepcast.language.symbols import Operator
from sleepcast.mind.views import Result
from sleepcast.node.node import Node

FOLDER = Path(__file__).parent.parent / "cases"
OTHER_DIALECTS = {"classic", "faithful", "appendix-a"}
NOT_BOARDS = ":not boards"
"""Stands before the first block of a file, or in a block, whose forms small computers do not have."""
NEARLY = 1e-9
"""How far a value written `~2.5` may be off, as a part of it."""


# ---- the robot that the cases are about


class Body:
    """The body of that robot: it notes what it was asked to do."""

    def __init__(self, around: Mapping[float, Mapping[str, float]] | None = None) -> None:
        self.done: list[str] = []
        self.around = around or {}

    def do(self, name: str, *arguments: float | str) -> None:
        written = [format_value(x) if isinstance(x, float) else f'"{x}"' for x in arguments]
        self.done.append(f"({' '.join([name, *written])})")

    def fail(self) -> float:
        raise RuntimeError("a wire is loose")

    def neighbours(self, most: int, radius: float, *colour: float) -> list[float]:
        """The ids of those within the radius, the nearest ones first."""
        if radius < 0:
            raise RuntimeError("a radius below 0")
        near = [(self.shown("distance", n), n) for n in self.around if self.shown("distance", n) <= radius]
        return [n for _, n in sorted(near) if not colour or self.shown("colour", n) == colour[0]][:most]

    def nearest(self, radius: float, *colour: float) -> float:
        return next(iter(self.neighbours(1, radius, *colour)), math.nan)

    def shown(self, name: str, neighbour: float) -> float:
        """What a neighbour shows to this body, which stands at the origin."""
        shows = self.around.get(neighbour)
        if shows is None or name in shows:
            return math.nan if shows is None else shows[name]
        x, y = shows["x"], shows["y"]
        seen = {"distance": math.sqrt(x * x + y * y), "bearing": angle(y, x), "colour": 0.0}
        return seen.get(name, math.nan)


FUNCTIONS = (
    HostFunction("VM", lambda body, right, left: body.do("VM", right, left), (SPEED, SPEED), arguments="right left"),
    HostFunction("ST", lambda body: body.do("ST")),
    HostFunction("DOCK", lambda body: body.do("DOCK"), value=9),
    HostFunction("TK", lambda body, text: body.do("TK", text), labelled=True, arguments='"text"'),
    HostFunction("SONAR", lambda body, i: i / 2, (None,), arguments="i", acts=False),
    HostFunction("GIVE", lambda body, x: x, (None,), arguments="x", acts=False),
    HostFunction("MUTE", lambda body: math.nan, acts=False),
    nearest_id(
        Body.nearest,
        Body.neighbours,
        lambda name, body, n: body.shown(name, n),
        more={"opinion": "", "fuel": "%", "bravo": ""},
    ),
    HostFunction("LOOSE", lambda body: body.fail(), acts=False),
    HostFunction("SCAN-MIN", lambda body, a, b: 10.0 - a, (NONE, NONE), arguments="a b", result=LENGTH, acts=False),
    HostFunction(
        "SCAN-GAP", lambda body, a, b, *free: a, (NONE, NONE, LENGTH), 2, arguments="a b [free]", unit="deg", acts=False
    ),
    HostFunction("SEES", lambda body, colour, a, b: colour, (NONE,) * 3, arguments="colour a b", acts=False),
)
SENSORS = (
    Quantity("fuel", low=0, high=1, shown_as="%"),
    Quantity("ordnance", low=0, high=1, shown_as="%"),
    Quantity("x", "m"),
    Quantity("y", "m"),
    Quantity("speed", "m/s"),
    Quantity("sonar1", "m", low=0),
    Quantity("sonar2", "m", low=0),
    Quantity("sonar3", "m", low=0),
)
ACTUATORS = (Quantity("throttle", low=0, high=1), Quantity("lamp"))
CONSTANTS = (Constant("FRONT", 1.0), Constant("REAR", 2.0))


@dataclass
class Setting:
    """The robot before its first case. values: measured, by the sensor's or actuator's key. around: its neighbours by
    their ids, what each shows by its name."""

    extra: list[Quantity] = field(default_factory=list)
    values: dict[str, float] = field(default_factory=dict)
    number: int = 0
    seed: int = 0
    around: dict[float, dict[str, float]] = field(default_factory=dict)

    def vocabulary(self) -> Vocabulary:
        sensors = (*SENSORS, *self.extra)
        return Vocabulary("robot", sensors, ACTUATORS, constants=CONSTANTS, functions=FUNCTIONS)


# ---- machines


class Outcome(NamedTuple):
    """What one evaluation came to. refused: what the reader or the checker says against the text, else ""."""

    value: float = math.nan
    faults: tuple[str, ...] = ()
    prints: tuple[str, ...] = ()
    tells: tuple[str, ...] = ()
    pings: tuple[float, ...] = ()
    does: tuple[str, ...] = ()
    matched: bool = False
    refused: str = ""
    warnings: tuple[str, ...] = ()


class Machine(Protocol):
    """One robot that evaluates text after text in one memory.

    checks: whether it looks over a text before it evaluates it; one that does not is spared texts that are refused.
    """

    checks: bool

    def evaluate(self, text: str) -> Outcome: ...

    def state(self) -> dict[str, object]:
        """All that an evaluation can change, as numbers and texts that can be compared."""


def printed(label: str, values: tuple[float, ...]) -> str:
    words = [f'"{label}"'] if label else []
    return " ".join([*words, *map(format_value, values)])


class ReferenceMachine:
    """The slow, obvious evaluator."""

    checks = False

    def __init__(self, setting: Setting) -> None:
        self.body = Body(setting.around)
        self.mind = Reference(setting.vocabulary(), number=setting.number, seed=setting.seed, body=self.body)
        self.mind.values.update(setting.values)

    def evaluate(self, text: str) -> Outcome:
        self.body.done.clear()
        try:
            value = self.mind.evaluate(text)
        except ReadError as error:
            return Outcome(refused=str(error))
        return Outcome(
            value,
            tuple(self.mind.faults),
            tuple(printed(*each) for each in self.mind.printed),
            tuple(self.mind.told),
            tuple(self.mind.pings),
            tuple(self.body.done),
            self.mind.matched,
        )

    def state(self) -> dict[str, object]:
        return self.mind.state()


class NodeMachine:
    """One robot's mind as it is. result: of the last evaluation.

    compiled: every text runs as generated code from its first evaluation on.
    """

    checks = True

    def __init__(self, setting: Setting, *, compiled: bool = False) -> None:
        self.body, self.compiled = Body(setting.around), compiled
        self.result: Result
        vocabulary = setting.vocabulary()
        self.mind = Node("robot", vocabulary, number=setting.number, seed=setting.seed, body=self.body)
        self.sense(setting)
        for i, actuator in enumerate(vocabulary.actuators):
            if actuator.name.casefold() in setting.values:
                self.mind.values[vocabulary.first_actuator + i] = setting.values[actuator.name.casefold()]

    def sense(self, setting: Setting, now: float = 0.0) -> None:
        """Give the sensors the values of the setting."""
        sensors = self.mind.vocabulary.sensors
        self.mind.sense([setting.values.get(sensor.name.casefold(), math.nan) for sensor in sensors], now)

    def evaluate(self, text: str) -> Outcome:
        self.body.done.clear()
        self.mind.outbox.clear()
        self.mind.pings.clear()
        try:
            checked = check(text, self.mind)
            if self.compiled and checked.program is not None:
                checked.program.compile()
            with patch.object(program, "HOT", 0) if self.compiled else nullcontext():
                result = self.result = self.mind.run(checked)
        except (ReadError, CheckError) as error:
            return Outcome(refused=str(error))
        return Outcome(
            result.value,
            tuple(fault.reason for fault in result.faults),
            tuple(printed(*each) for each in result.printed),
            tuple(said.text for said in self.mind.outbox if said.kind is message.Kind.COMMAND),
            tuple(self.mind.pings),
            tuple(self.body.done),
            result.matched,
            warnings=tuple(finding.message for finding in checked.warnings),
        )

    def state(self) -> dict[str, object]:
        return state_of(self.mind)


def state_of(mind: Node | RobotView) -> dict[str, object]:
    learned = {name.casefold(): mind.declared(name.casefold()) for name in mind.heard()}
    views = mind.rules()
    return {
        "variables": {name.casefold(): value.hex() for name, value in mind.variables()},
        "stored": {view.name.casefold(): view.text for view in views},
        "active": sorted(view.name.casefold() for view in views if view.active),
        "operators": sorted(key for key, found in learned.items() if isinstance(found, Operator)),
        "groups": sorted(mind.groups),
    }


class Herd:
    """A fleet of robots in these settings, all of one type.

    native: whatever can be native code is, from its first evaluation on."""

    def __init__(self, settings: Sequence[Setting], *, native: bool) -> None:
        self.bodies = [Body(each.around) for each in settings]
        names = [f"robot{i}" for i in range(len(settings))]
        vocabulary = settings[0].vocabulary()
        self.fleet = Fleet(
            names, vocabulary, numbers=[each.number for each in settings], seed=settings[0].seed, bodies=self.bodies
        )
        self.fleet.kernels = self.fleet.memory.kernels = Kernels(hot=0) if native else None
        self.robots = list(self.fleet.values())
        for view, setting in zip(self.robots, settings, strict=True):
            measured = [setting.values.get(sensor.name.casefold(), math.nan) for sensor in vocabulary.sensors]
            view.sense(measured, 0.0)
            for slot, actuator in enumerate(vocabulary.actuators, vocabulary.first_actuator):
                if actuator.name.casefold() in setting.values:
                    rows = self.fleet.rows([view.index])
                    self.fleet.state.assign(slot, rows, np.array([setting.values[actuator.name.casefold()]]))

    def evaluate(self, text: str) -> list[Outcome]:
        """What comes of it for each robot. A text that only some of them can run is evaluated by those."""
        for body, view in zip(self.bodies, self.robots, strict=True):
            body.done.clear()
            view.outbox.clear()
            view.pings.clear()
        outcomes: list[Outcome] = []
        checks = {}
        for view in self.robots:
            try:
                checks[view.index] = check(text, view)
                checks[view.index].required()
            except (ReadError, CheckError) as error:
                checks.pop(view.index, None)
                outcomes.append(Outcome(refused=str(error)))
            else:
                outcomes.append(Outcome())
        for found in self.fleet.evaluate(text, list(checks)) if checks else ():
            for place in found.rows.robots.tolist():
                result = self.robots[place].result(found, checks[place].cost)
                outcomes[place] = self._outcome(place, result, checks[place].warnings)
        return outcomes

    def _outcome(self, place: int, result: Result, warnings: list[Finding]) -> Outcome:
        said = self.robots[place].outbox
        return Outcome(
            result.value,
            tuple(fault.reason for fault in result.faults),
            tuple(printed(*each) for each in result.printed),
            tuple(each.text for each in said if each.kind is message.Kind.COMMAND),
            tuple(self.robots[place].pings),
            tuple(self.bodies[place].done),
            result.matched,
            warnings=tuple(finding.message for finding in warnings),
        )


class FleetMachine:
    """Fleets whose first robot is the one of the cases, one without and one with native code; the others are in other
    states, and each has a node as its twin, from which it must never differ."""

    checks = True

    def __init__(self, setting: Setting) -> None:
        settings = [setting, *(other_setting(setting, which) for which in (1, 2))]
        self.twins = [NodeMachine(each) for each in settings]
        self.herds = {"walked": Herd(settings, native=False)}
        if available():
            self.herds["native"] = Herd(settings, native=True)

    def evaluate(self, text: str) -> Outcome:
        wanted = [(twin.evaluate(text), twin.state()) for twin in self.twins]
        for name, herd in self.herds.items():
            for outcome, view, (other, state) in zip(herd.evaluate(text), herd.robots, wanted, strict=True):
                assert bits(outcome) == bits(other), f"{name}, {view.name}: {text}"
                assert state_of(view) == state, f"{name}, {view.name}: {text}"
        return wanted[0][0]

    def state(self) -> dict[str, object]:
        return state_of(self.herds["walked"].robots[0])


def bits(outcome: Outcome) -> tuple[object, ...]:
    """An outcome such that unknown equals unknown and 0 is not -0."""
    return (outcome.value.hex(), *outcome[1:])


def other_setting(setting: Setting, which: int) -> Setting:
    """The same kind of robot in another state: its values are those of other variables, or negative, or unknown."""
    names, given = list(setting.values), list(setting.values.values())
    turned = given[which:] + given[:which]
    values = [math.nan if (i + which) % 3 == 0 else -value if i % 2 else value for i, value in enumerate(turned)]
    around = dict(list(setting.around.items())[which:])
    values = dict(zip(names, values, strict=True))
    return replace(setting, values=values, number=setting.number + which, around=around)


MACHINES: dict[str, Callable[[Setting], Machine]] = {
    "reference": ReferenceMachine,
    "node": NodeMachine,
    "node-compiled": partial(NodeMachine, compiled=True),
    "fleet": FleetMachine,
}


# ---- reading the files


@dataclass(frozen=True)
class Case:
    """One line. expected: as written after the arrow. notes: (key, words) in order, words "" where there are none."""

    where: str
    text: str
    expected: str
    notes: tuple[tuple[str, str], ...]

    def words(self, key: str) -> list[str]:
        return [words for found, words in self.notes if found == key]

    @property
    def refusal(self) -> str | None:
        return self.expected.removeprefix("error:").strip() if self.expected.startswith("error:") else None


@dataclass
class Block:
    """Cases that share one robot. boards: whether small computers do the same."""

    title: str
    boards: bool = True
    setting: Setting = field(default_factory=Setting)
    cases: list[Case] = field(default_factory=list)


KEYS = {"fault", "prints", "tells", "does", "matched", "not matched", "warning", "no warning"}


def logical_lines(path: Path) -> Iterator[tuple[str, str]]:
    """Each line with those that continue it, and where it begins."""
    where, line = "", ""
    for number, written in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if written.startswith(" "):
            line += " " + written.strip()
            continue
        if line:
            yield where, line
        where, line = f"{path.name}:{number}", "" if written.startswith("#") else written.rstrip()
    if line:
        yield where, line


def read_case(where: str, line: str) -> Case:
    text, arrow, rest = line.partition(" => ")
    if not arrow:
        raise ValueError(f"{where} has no ' => ': {line}")
    expected, *written = rest.split(" ; ")
    notes = []
    for note in written:
        key, _, words = note.partition(":")
        if key.strip() not in KEYS:
            raise ValueError(f"{where}: {key.strip()!r} is none of the notes {sorted(KEYS)}")
        notes.append((key.strip(), words.strip()))
    return Case(where, text.strip(), expected.strip(), tuple(notes))


def apply_setting(setting: Setting, where: str, line: str) -> None:
    command, _, rest = line.partition(" ")
    name, _, value = rest.partition("=")
    if command == ":robot":
        setting.number = int(rest)
    elif command == ":seed":
        setting.seed = int(rest)
    elif command == ":set":
        setting.values[name.strip().casefold()] = number(value)
    elif command == ":neighbour":
        name, *shows = rest.split()
        pairs = (show.partition("=") for show in shows)
        setting.around[float(name)] = {key: number(value) for key, _, value in pairs}
    elif command == ":sensor":
        value, _, unit = value.partition(" ")
        setting.extra.append(Quantity(name.strip(), unit.strip()))
        setting.values[name.strip().casefold()] = number(value)
    else:
        raise ValueError(f"{where}: {command} is none of :set :sensor :neighbour :robot :seed")


def number(written: str) -> float:
    return math.nan if written.strip() == "UNKNOWN" else float(written)


def read_blocks(path: Path) -> list[Block]:
    found: list[Block] = []
    boards = True
    for where, line in logical_lines(path):
        if line == NOT_BOARDS and found:
            found[-1].boards = False
        elif line == NOT_BOARDS:
            boards = False
        elif line.startswith("--- "):
            found.append(Block(f"{path.stem}: {line[4:]}", boards))
        elif line.startswith(":"):
            apply_setting(found[-1].setting, where, line)
        else:
            found[-1].cases.append(read_case(where, line))
    return found


def blocks() -> list[Block]:
    """Every block of every case file of the standard dialect."""
    files = sorted(path for path in FOLDER.glob("*.cases") if path.stem not in OTHER_DIALECTS)
    return [block for path in files for block in read_blocks(path)]


# ---- comparing


def same(value: float, expected: str) -> bool:
    """Whether `value` is what was written: bit for bit, or nearly if it was written with a ~."""
    if expected.startswith("~"):
        return math.isclose(value, float(expected[1:]), rel_tol=NEARLY)
    if expected == "UNKNOWN":
        return math.isnan(value)
    return value.hex() == float(expected).hex()


def mismatch(case: Case, outcome: Outcome, checks: bool) -> str:
    """How `outcome` differs from what `case` expects, "" if it does not. checks: see `Machine`."""
    if case.refusal is not None:
        wrong = case.refusal not in outcome.refused or not outcome.refused
        return f"wanted a refusal with {case.refusal!r}, got {outcome}" if wrong else ""
    if outcome.refused:
        return f"was refused: {outcome.refused}"
    if not same(outcome.value, case.expected):
        return f"gave {format_value(outcome.value)} ({outcome.value!r}); faults: {outcome.faults}"
    found = {"prints": outcome.prints, "tells": outcome.tells, "does": outcome.does}
    for key, got in found.items():
        if list(got) != case.words(key):
            return f"{key} {got}, wanted {case.words(key)}"
    wanted = case.words("fault")
    if len(wanted) != len(outcome.faults) or not all(map(within, wanted, outcome.faults)):
        return f"had the faults {outcome.faults}, wanted {wanted}"
    for key, expected in (("matched", True), ("not matched", False)):
        if case.words(key) and outcome.matched is not expected:
            return f"wanted it {key}"
    return warning_mismatch(case, outcome) if checks else ""


def within(words: str, text: str) -> bool:
    return words.casefold() in text.casefold()


def warning_mismatch(case: Case, outcome: Outcome) -> str:
    missing = [words for words in case.words("warning") if not any(words in w for w in outcome.warnings)]
    if missing:
        return f"wanted warnings with {missing}, got {outcome.warnings}"
    return f"wanted no warning, got {outcome.warnings}" if case.words("no warning") and outcome.warnings else ""
