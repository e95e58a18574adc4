"""What the desk says to a page, each as the JSON object that the page reads; `type` is the class's name in lower
case, unless the class says otherwise.

Here are the news, and answers of several features; the others are in `features/`. An answer carries the `serial` of its
question back. Every text is for people as it stands.
"""

from __future__ import annotations

import msgspec

from sleepcast.console.account_table import CommandRow
from sleepcast.console.failing import ShownFailing
from sleepcast.console.marks import Mark
from sleepcast.console.view import Outline, Scene


class DeskMessage(msgspec.Struct, tag_field="type", tag=str.lower):
    """Anything that the desk says to a page."""


class ShownName(msgspec.Struct, frozen=True):
    """A name. usage: how a function is called, "" for everything else. range: least to greatest over the fleet."""

    name: str
    kind: str
    doc: str = ""
    range: str = ""
    usage: str = ""


class Hello(DeskMessage):
    """The first words: what there is to see, and the names that a text may use.

    began, recorded: the time at which a recording begins and ends, s; 0 where the swarm lives.
    part: of a recording in several files, from 1; 0 if there is one.
    air: whether the robots are on the air, where time is real.
    unheard: how many others are expected there.
    run: the number of this run on the page, from 1; 0 where no other can follow.
    note: what the map cannot show, in a sentence.
    nomads: what the panes of Nomads need besides, where the robots are Nomads.
    operators: as whom one may send, each with the role, the first one's desk being the page's own; left out where
        nobody is named.
    """

    scene: Scene
    count: int
    names: list[ShownName]
    recorded: float = 0.0
    began: float = 0.0
    part: int = 0
    air: bool = False
    unheard: int = 0
    run: int = 0
    note: str = ""
    nomads: msgspec.Struct | None = None
    operators: list[tuple[str, str]] | msgspec.UnsetType = msgspec.UNSET


class Refused(DeskMessage):
    """A message that was not obeyed.

    reason: why, in words for a person
    count: whether it would be obeyed if it came with the number of robots that are meant
    doubt: whether it would be if it came once more, confirmed
    """

    reason: str
    serial: int | None = None
    count: bool = False
    doubt: bool = False


class Alive(DeskMessage):
    """Nothing new, but the line is whole and the station at work."""


class Obstacles(DeskMessage):
    """What is solid now, where it is not as the scene says; all as there."""

    obstacles: tuple[tuple[Outline, ...], ...]
    version: int | None = None
    tall: tuple[float | None, ...] = ()


class Roll(DeskMessage):
    """The names of the robots now, where they come and go: by their places, "" where there is none."""

    names: tuple[str, ...]


class ShownFinding(msgspec.Struct, frozen=True):
    """Something wrong or doubtful at start..end of a text; shown: with the line and carets."""

    severity: str
    message: str
    start: int
    end: int
    shown: str


class Sent(DeskMessage):
    """A command went out under this id. doubt: what is probably a slip in it, as a sentence."""

    serial: int
    command: str
    doubt: str = ""


class Answered(DeskMessage):
    """What became of a command on each robot, a byte each (`station.SILENT` and the others); or for which it is true
    that was asked about, 1 each."""

    serial: int
    outcomes: bytes


class Done(DeskMessage):
    """What was asked for was done. note: what there is to say of it, in words for a person."""

    serial: int
    note: str = ""


class Commands(DeskMessage):
    """The account of every command; serial: of the question, if it was asked for."""

    rows: list[CommandRow]
    serial: int | None = None


class Failing(DeskMessage):
    """The rules that fail on any robot, those on most robots first. recent: simulated seconds after a fault for which
    its rule counts as failing."""

    rules: tuple[ShownFailing, ...]
    recent: float = 0.0


class ShownGroup(msgspec.Struct, frozen=True):
    """A group: how many are in it, and how many of these the map shows in its shape."""

    name: str
    count: int
    shown: int


class Groups(DeskMessage):
    """Every group that has been seen, in the order of the codes in a frame."""

    groups: list[ShownGroup]


class Safety(DeskMessage):
    """Whether STOP holds, and what it has come to. noticed: what else a person should know of, STOP or no STOP."""

    latched: bool
    sentence: str
    noticed: str = ""


class Compiling(DeskMessage):
    """How many kernels of the simulator have been compiled so far, of how many at most."""

    done: int
    most: int


class Span(DeskMessage):
    """The part of the run that can be looked at.

    began, ended: s
    at: what this page looks at, s, None for now
    number: of the page's request by which it looks there, 0 if it made none
    exact: whether what is shown is that of the very tick
    note: why not, for a person
    kept: what is kept, in a sentence
    forked: when this run left another one, s, None if it did not
    differs: the time of the first difference between the two, s
    difference: what it is, in words
    may_fork: whether it can go on from any moment
    """

    began: float
    ended: float
    at: float | None = None
    number: int = 0
    exact: bool = True
    note: str = ""
    kept: str = ""
    forked: float | None = None
    differs: float | None = None
    difference: str = ""
    may_fork: bool = False


class Marked(DeskMessage):
    """What happened, for the timeline."""

    marks: list[Mark]


class ShownValue(msgspec.Struct, frozen=True):
    """A variable of the watched robot."""

    name: str
    shown: str
    kind: str


class ShownRule(msgspec.Struct, frozen=True):
    """An expression that the watched robot keeps. priority: rules with a higher one run later."""

    name: str
    text: str
    active: bool
    value: str
    fault: str
    priority: int = 0


class ShownReport(msgspec.Struct, frozen=True):
    """Something that the watched robot reported, or was told; at: simulated s."""

    at: float
    text: str


class WatchedRobot(DeskMessage, tag="robot"):
    """News of the watched robot.

    groups: the names of all of them
    state: stopped, frozen and the like, in words
    reports: its latest, the youngest first
    told: what programs told it lately, where it is a Nomad
    """

    robot: int
    groups: list[str]
    state: list[str]
    values: list[ShownValue]
    rules: list[ShownRule]
    reports: list[ShownReport] = msgspec.field(name="said")
    told: list[ShownReport] = []
