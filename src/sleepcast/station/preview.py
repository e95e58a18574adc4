"""The preview: who would obey a command if it were sent now, from what the robots last told of themselves.

Only the command's top-level test is evaluated, on a copy of each robot's last numbers, and nothing it could do is
done. What the desk cannot know (chance, what a robot's own function would say, news too old) makes a robot `unknown`
with the reason, unless the rest of the test decides without it: in `(AND (> fuel 50%) (PROB 0.5))` an empty tank is a
certain no.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import nan

from sleepcast.language.machine import Program, evaluate
from sleepcast.language.names import Operator
from sleepcast.language.operations import Entered
from sleepcast.language.parts import Part, acts, walk
from sleepcast.language.vocabulary import Variable
from sleepcast.station.minds import Mind, Minds
from sleepcast.station.roster import Row

NEVER_HEARD = "it has told nothing of itself yet"
STALE = "its last news is too old"


@dataclass(frozen=True, slots=True)
class Preview:
    """Names of the robots that would obey (`yes`), would not (`no`), and of which the desk cannot say (`unknown`, each
    with the reason). everybody: the command has no test, or one that is true whatever the robot. oldest: the age in s
    of the oldest news that a yes or no rests on (0 if none does)."""

    yes: tuple[str, ...]
    no: tuple[str, ...]
    unknown: Mapping[str, str]
    everybody: bool
    oldest: float

    @property
    def reasons(self) -> dict[str, int]:
        """Why robots are unknown, and how many for each reason, the most frequent first."""
        return dict(Counter(self.unknown.values()).most_common())


class Undecided(Exception):
    """The test needs what the desk does not know; the text says what."""


class DeskMemory:
    """A robot's memory as the desk knows it: its last numbers to read and nothing to change (a `Memory`)."""

    def __init__(self) -> None:
        self.values: list[float] = []
        self.groups: frozenset[str] = frozenset()
        self.steps = self.depth = self.levels = 0
        self.matched = False
        self.mind: Mind | None = None

    def fault(self, part: Part, reason: str) -> float:
        """On the robot this would be a fault, and a fault never matches."""
        return nan

    def draw(self) -> float:
        raise Undecided("its test depends on chance")

    def read(self, part: Part) -> float:
        """A linked variable: known only if the robot told it with the others."""
        value = self.values[part.slot] if part.slot < len(self.values) else nan
        if value != value:
            raise Undecided("its test reads a variable that lies in the robot's own memory")
        return value

    def fetch(self, part: Part) -> Entered | None:
        """What the robot's buffer or rule holds, if its value can be asked for without changing anything."""
        return self._quiet(self._asked(part).fetch(part), part)

    def operator(self, part: Part) -> Entered | None:
        """The robot's own operator, if it can be called without changing anything."""
        mind = self._asked(part)
        found = mind.declared(part.name)
        if not isinstance(found, Operator) or len(found.parameters) != len(part.parts):
            return None
        return self._quiet(mind.operator(part), part)

    def _asked(self, part: Part) -> Mind:
        if self.mind is None:
            raise Undecided(f"its test depends on what the robot holds as {part.name}")
        return self.mind

    def _quiet(self, program: Entered | None, part: Part) -> Entered | None:
        if program is not None and acts(program.root):
            raise Undecided(f"its test evaluates {part.name}, which does something")
        return program

    def host(self, part: Part, *arguments: float) -> float:
        raise Undecided(f"its test asks the robot itself: {part.name.upper()}")

    def write(self, part: Part, value: float) -> float:
        raise self._deed(part)

    def define(self, part: Part, value: float) -> float:
        raise self._deed(part)

    def store(self, part: Part, value: float) -> float:
        raise self._deed(part)

    def act(self, part: Part, *arguments: float) -> float:
        raise self._deed(part)

    def defined(self, part: Part) -> bool:
        raise self._deed(part)

    def _deed(self, part: Part) -> Undecided:
        return Undecided("its test does something itself")


def preview(program: Program, rows: Iterable[Row], minds: Minds, now: float, stale_after: float) -> Preview:
    """Who would obey `program`. rows: the roster; news older than `stale_after` s at `now` decide nothing."""
    everybody = is_for_everybody(program)
    obstacle = _obstacle(program)
    test = program.test
    memory = DeskMemory()
    yes: list[str] = []
    no: list[str] = []
    unknown: dict[str, str] = {}
    oldest = now
    for row in rows:
        if row.values is None:
            unknown[row.robot] = NEVER_HEARD
        elif now - row.told > stale_after:
            unknown[row.robot] = STALE
        elif test is None:
            yes.append(row.robot)
        elif obstacle:
            unknown[row.robot] = obstacle
        else:
            memory.values, memory.groups, memory.mind = row.values, row.groups, minds.get(row.robot)
            try:
                value = evaluate(test, memory)
            except Undecided as reason:
                unknown[row.robot] = str(reason)
                continue
            (yes if value < 0.0 or value > 0.0 else no).append(row.robot)
            oldest = min(oldest, row.told)
    return Preview(tuple(yes), tuple(no), unknown, everybody, now - oldest)


_DEEDS = frozenset({"set_user", "write", "defvar", "store", "act"})
_PERHAPS_DEEDS = _DEEDS | {"host", "call", "fetch"}


def _obstacle(program: Program) -> str:
    """Why nothing can be said about any robot, or an empty text."""
    test = program.test
    if test is None:
        return ""
    if any(part.op in _DEEDS for part in walk(test.root)):
        return "its test does something itself"
    for part in walk(program.root):
        if part.form is test.form:
            break
        if part.op in _PERHAPS_DEEDS:
            return "it does something before its test"
    return ""


_STRICT = frozenset({"const", "var", "linked", "absent", "pure", "and", "or", "local", "let", "progn"})
"""Parts whose value can only become unknown, never another, when what they read becomes unknown."""


def is_for_everybody(program: Program) -> bool:
    """Whether every robot that hears the command would obey: it has no test, or one that is true of nothing known,
    or one that the declared ranges of its variables make always true."""
    test = program.test
    return test is None or _always(test.root) or _true_of_nothing_known(test)


def _true_of_nothing_known(test: Program) -> bool:
    if any(part.op not in _STRICT for part in walk(test.root)):
        return False
    blank = DeskMemory()
    blank.values = [nan] * test.slots
    try:
        value = evaluate(test, blank)
    except Undecided:
        return False
    return value < 0.0 or value > 0.0


_MIRRORED = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}


def _always(part: Part) -> bool:
    """Whether declared ranges alone make `part` true on every robot that knows its variables."""
    if part.op in ("and", "or"):
        holds = map(_always, part.parts)
        return all(holds) if part.op == "and" else any(holds)
    if part.op == "const":
        return part.number < 0.0 or part.number > 0.0
    if part.op != "pure" or part.name not in _MIRRORED or len(part.parts) != 2:
        return False
    (left, right), name = part.parts, part.name
    if left.op == "const":
        left, right, name = right, left, _MIRRORED[name]
    if right.op != "const" or not isinstance(left.data, Variable):
        return False
    low, high, limit = left.data.quantity.low, left.data.quantity.high, right.number
    return {"<": high < limit, "<=": high <= limit, ">": low > limit, ">=": low >= limit}[name]
