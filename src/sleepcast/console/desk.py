"""The desk behind every page: what can be asked of it, and what it tells unasked.

It puts the station's words and the driver's pictures into the shapes of the wire. All pages share one desk: they see
the same, and each may command.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import isnan

import msgspec

from sleepcast.clock import Clock
from sleepcast.console.driver import Driver
from sleepcast.console.explaining import ShownWhy, show_why, shown_value, unit_of
from sleepcast.console.ledger import Ledger, Row
from sleepcast.console.names import ShownName, names_of
from sleepcast.console.swarm import RobotMind, Rule, Scene, Swarm
from sleepcast.errors import MisuseError
from sleepcast.language import Checked, Finding, ReadError, format_value
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, FROZEN, MARKED, SLEEPING, SUPPORT
from sleepcast.station import Preview, Station

STOP_AGAIN = 0.5
"""Seconds in which one more STOP adds nothing to the one that holds; the station itself repeats it."""
NO, YES, UNKNOWN = range(3)
"""What one byte says of a robot in a preview."""
MOST_REASONS = 5
"""Reasons for unknown robots that a preview names."""

_BUFFER_FLAGS = frozenset(quantity.name for quantity in SUPPORT[ACTIVE0 + 1 : ACTIVE0 + BUFFERS])


class Said(msgspec.Struct, tag_field="type", tag=str.lower):
    """Anything that the desk says to a page."""


class Hello(Said):
    """The first words: what there is to see, and the names that a text may use."""

    scene: Scene
    count: int
    names: list[ShownName]


class Refused(Said):
    """A message that was not obeyed, and why, in words for a person."""

    reason: str
    serial: int | None = None


class ShownFinding(msgspec.Struct, frozen=True):
    """Something wrong or doubtful at start..end of a text; shown: with the line and carets."""

    severity: str
    message: str
    start: int
    end: int
    shown: str


class Previewed(Said):
    """What the station thinks of a text. counted: whether it could be previewed at all; lit: a byte for each robot."""

    serial: int
    findings: list[ShownFinding]
    cost: int = 0
    counted: bool = False
    yes: int = 0
    no: int = 0
    unknown: int = 0
    everybody: bool = False
    oldest: float = 0.0
    reasons: list[tuple[str, int]] = []
    lit: bytes = b""


class Sent(Said):
    """A command went out under this id."""

    serial: int
    command: str


class Named(Said):
    """The names that a text may use now."""

    serial: int
    names: list[ShownName]


class Explained(Said):
    """Why a robot obeyed a command or did not."""

    serial: int
    why: ShownWhy


class Answered(Said):
    """What became of a command on each robot, a byte each (codes of `ledger`)."""

    serial: int
    outcomes: bytes


class Commands(Said):
    """The account of every command; serial: of the question, if it was asked for."""

    rows: list[Row]
    serial: int | None = None


class ShownGroup(msgspec.Struct, frozen=True):
    """A group: how many are in it, and how many of these the map shows in its shape."""

    name: str
    count: int
    shown: int


class Groups(Said):
    """Every group that has been seen, in the order of the codes in a frame."""

    groups: list[ShownGroup]


class Safety(Said):
    """Whether STOP holds, and what it has come to."""

    latched: bool
    sentence: str


class ShownValue(msgspec.Struct, frozen=True):
    """A variable of the watched robot."""

    name: str
    shown: str
    kind: str


class ShownRule(msgspec.Struct, frozen=True):
    """An expression that the watched robot keeps."""

    name: str
    text: str
    active: bool
    value: str
    fault: str


class Robot(Said):
    """News of the watched robot. group: its code in a frame. state: stopped, frozen and the like, in words."""

    robot: int
    group: int
    groups: list[str]
    state: list[str]
    values: list[ShownValue]
    rules: list[ShownRule]


class Desk:
    """See the module. Its questions raise SleepcastError, with a sentence for the person who asked."""

    def __init__(self, swarm: Swarm, station: Station, driver: Driver, clock: Clock) -> None:
        self.driver = driver
        self._swarm, self._station, self._clock = swarm, station, clock
        self._ledger = Ledger(station, swarm.scene.names)
        self._index = {name: index for index, name in enumerate(swarm.scene.names)}
        self._stopped_at = -STOP_AGAIN

    def hello(self) -> Hello:
        """What a page needs first."""
        scene = self._swarm.scene
        return Hello(scene, len(scene.names), names_of(self._swarm))

    # ---- before sending

    def preview(self, serial: int, text: str) -> Previewed:
        """What is wrong in `text`, and who would obey it now."""
        try:
            checked = self._station.check(text)
        except ReadError as error:
            found = ShownFinding("error", error.reason, error.start, error.end, str(error))
            return Previewed(serial, [found])
        findings = [_show_finding(finding, text) for finding in checked.findings]
        if checked.program is None:
            return Previewed(serial, findings, checked.cost)
        return self._previewed(serial, checked, findings, self._station.preview(text))

    def _previewed(self, serial: int, checked: Checked, findings: list[ShownFinding], found: Preview) -> Previewed:
        lit = bytearray(len(self._index))
        for names, code in ((found.yes, YES), (found.unknown, UNKNOWN)):
            for name in names:
                lit[self._index[name]] = code
        return Previewed(
            serial,
            findings,
            checked.cost,
            True,
            len(found.yes),
            len(found.no),
            len(found.unknown),
            found.everybody,
            found.oldest,
            list(found.reasons.items())[:MOST_REASONS],
            bytes(lit),
        )

    def names(self, serial: int) -> Named:
        """The names that a text may use, with the ranges of their values."""
        return Named(serial, names_of(self._swarm))

    # ---- sending

    def send(self, serial: int, text: str, everybody: bool) -> Sent:
        """Broadcast `text`."""
        return Sent(serial, self._station.send(text, everybody=everybody).id)

    def stop(self) -> None:
        """Stop every body. While a STOP holds that was given a moment ago, one more changes nothing."""
        now = self._clock.now()
        if not self.driver.latched or now - self._stopped_at >= STOP_AGAIN:
            self._stopped_at = now
            self._station.stop()
        self._latch(True)

    def release(self) -> None:
        """End STOP."""
        self._station.release()
        self._latch(False)

    def _latch(self, latched: bool) -> None:
        self.driver.latched = latched
        self.driver.draw()

    # ---- afterwards

    def why(self, serial: int, robot: int, command: str) -> Explained:
        """How the robot with this index evaluated a command."""
        explanation = self._station.why(self._name(robot), command)
        return Explained(serial, show_why(explanation, self._swarm.vocabulary))

    def outcomes(self, serial: int, command: str) -> Answered:
        """What became of a command on each robot."""
        return Answered(serial, self._ledger.outcomes(command))

    def commands(self, serial: int | None = None) -> Commands:
        """The account of every command."""
        return Commands(self._ledger.rows(), serial)

    def _name(self, robot: int) -> str:
        names = self._swarm.scene.names
        if not 0 <= robot < len(names):
            raise MisuseError(f"there is no robot number {robot}: they are numbered from 0 to {len(names) - 1}")
        return names[robot]

    # ---- unasked

    def news(self, watched: int) -> Iterator[Said]:
        """Everything that may have changed; `watched`: the index of the robot that the page looks at, or -1."""
        yield self.commands()
        groups = self.driver.groups
        shown = zip(groups.names, groups.counts, groups.shown, strict=True)
        yield Groups([ShownGroup(*group) for group in shown])
        yield self._safety()
        if 0 <= watched < len(self._index):
            yield self._robot(watched)

    def _safety(self) -> Safety:
        stop = self._ledger.stop()
        if stop is None:
            return Safety(False, "")
        return Safety(True, self._ledger.stop_sentence(stop, self.driver.pace.paused))

    def _robot(self, index: int) -> Robot:
        mind = self._swarm.minds[self._name(index)]
        declared = ((mind.declared(key), key) for key in sorted(mind.groups))
        return Robot(
            index,
            self.driver.groups.code(mind),
            [found.name if found is not None else key for found, key in declared],
            _states(mind),
            [self._show_value(name, value) for name, value in mind.variables() if name not in _BUFFER_FLAGS],
            [_show_rule(rule) for rule in mind.rules()],
        )

    def _show_value(self, name: str, value: float) -> ShownValue:
        binding = self._swarm.vocabulary.bindings.get(name.casefold())
        kind = getattr(binding, "kind", None)
        return ShownValue(
            name, shown_value(value, unit_of(name, self._swarm.vocabulary)), kind.value if kind else "user"
        )


def _show_finding(finding: Finding, text: str) -> ShownFinding:
    return ShownFinding(finding.severity, finding.message, finding.start, finding.end, finding.render(text))


def _states(mind: RobotMind) -> list[str]:
    flags = ((FROZEN, "frozen"), (SLEEPING, "sleeping"), (MARKED, "marked"))
    return ["stopped"] * mind.stopped + [word for slot, word in flags if mind.values[slot] > 0.0]


def _show_rule(rule: Rule) -> ShownRule:
    value = "never ran" if isnan(rule.last_value) else format_value(rule.last_value)
    return ShownRule(rule.name, rule.text, rule.active, value, rule.last_fault)
