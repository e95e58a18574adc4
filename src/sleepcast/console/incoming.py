"""Messages from the page, each a bounded, exact shape: what does not fit is refused with a sentence.

`type` is the class's name in lower case, unless the class says otherwise. `serial` numbers a question; the answer
carries it back. Messages without one get no answer.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeVar

import msgspec
from msgspec import Meta

from sleepcast.core.errors import MisuseError

MAX_BYTES = 131_072
"""Of one message: the longest expression, every character escaped, fits."""
MAX_FACTOR = 10_000.0
"""Simulated seconds in a second that may be wanted; no machine reaches it, so it means as fast as possible."""
MIN_FACTOR = 0.01
"""The slowest motion in which anything is still seen to move."""

MOST_VALUES = 24
"""Numbers of a scenario that a page may change at once: as many as it may have sliders."""

MOST_CORNERS = 64
"""Of one obstacle that a person draws; `static/obstacles.js` knows it, too."""
MOST_NUMBERS = 64
"""Of an order to a Nomad: more than any has."""
MOST_SAID = 256
"""Characters of a text that a Nomad says."""
MOST_WORLD = 100_000
"""Characters of a world: a thousand polygons and more; with what JSON adds they stay below `MAX_BYTES`."""
MOST_NAME = 200
"""Characters of a file's name."""
FARTHEST = 1e5
"""m: no world of Nomads is so large, and no number of their wire so long."""
LARGEST = 2**31 - 1
"""A number of the Nomads' wire has 32 bits, signed."""

Serial = Annotated[int, Meta(ge=1, le=2**53 - 1)]
Text = Annotated[str, Meta(max_length=16_384)]
Number = Annotated[int, Meta(ge=1, le=2**53 - 1)]
Id = Annotated[str, Meta(max_length=160)]
Metres = Annotated[float, Meta(ge=-1e7, le=1e7)]
Sort = Literal["once", "standing", "ask", "stages"]
Deed = Literal["take", "give", "request", "grant", "force"]
T = TypeVar("T")
Index = Annotated[int, Meta(ge=-1, le=10_000_000)]
ScenarioName = Annotated[str, Meta(max_length=500)]
SliderName = Annotated[str, Meta(max_length=32)]
NomadNumber = Annotated[int, Meta(ge=-LARGEST, le=LARGEST)]
NomadIndex = Annotated[int, Meta(ge=0, le=10_000_000)]
Seed = Annotated[str, Meta(pattern=r"\A[0-9]{1,19}\Z")]
"""As text: JavaScript's numbers are not exact that far."""

MOST_REPLIES = 64
"""Robots whose answers are asked for at one time: about as many as have their names on a map."""
MAX_COLUMNS = 12
"""Of the table of robots: more of them fit on no screen."""
MAX_ROWS = 200
"""Rows of the table that are asked for at once: those in sight, and some above and below."""
MAX_PICKED = 10_000
"""Robots that are picked from the table by hand."""
Expression = Annotated[str, Meta(max_length=2_000)]
MOST_HELD = 1_000
"""Commands of one test: as many as a mission may have."""
MOST_GOALS = 16
"""Goals of one test, as in an exercise."""
Bound = Literal["exactly", "at least", "at most"]
TestName = Annotated[str, Meta(pattern=r"\A[A-Za-z0-9][A-Za-z0-9_-]{0,59}\Z")]
Place = Annotated[int, Meta(ge=0, le=2**31 - 1)]


class PageMessage(msgspec.Struct, forbid_unknown_fields=True, tag_field="type", tag=str.lower):
    """Anything that the page says."""


class GetPreview(PageMessage, tag="preview"):
    """Check a text and say who would obey it now."""

    serial: Serial
    text: Text


class Send(PageMessage):
    """Broadcast a text. everybody: the sender has said that all robots are meant. sort: to be done once and soon,
    without a deadline, a question, to which each robot answers with the value, or in stages: to one robot, to a tenth,
    to all. count: how many robots may obey.
    confirmed: it is meant as it stands, whatever is doubted."""

    serial: Serial
    text: Text
    everybody: bool = False
    sort: Sort = "once"
    count: Annotated[int, Meta(ge=0, le=10_000_000)] | None = None
    confirmed: bool = False


class Halt(PageMessage):
    """Send no further stage of what goes out in stages."""


class ChangeLease(PageMessage, tag="lease"):
    """Ask robots that a group (by its name) obeys one operator only, for so many s. to: the operator for a grant."""

    serial: Serial
    deed: Deed
    group: Annotated[str, Meta(min_length=1, max_length=64)]
    seconds: Annotated[float, Meta(ge=1.0, le=3_600.0)] = 60.0
    to: Annotated[str, Meta(max_length=64)] = ""


class GetNames(PageMessage, tag="names"):
    """The names that a text may use, with the ranges of their values now."""

    serial: Serial


class GetGlance(PageMessage, tag="glance"):
    """What the fleet is like now: quantities over all robots."""

    serial: Serial


class Phrase(PageMessage):
    """What an expression says, as a sentence."""

    serial: Serial
    text: Text


class Understand(PageMessage):
    """The expression that a sentence means."""

    serial: Serial
    text: Text


class Why(PageMessage):
    """How a robot (by its index) evaluated a command (by its id)."""

    serial: Serial
    robot: Index
    command: Id


class GetSpread(PageMessage, tag="spread"):
    """How what a number is compared with is spread over the robots; at: where the number begins in the text."""

    serial: Serial
    text: Text
    at: Annotated[int, Meta(ge=0, le=16_384)]


class Pick(PageMessage):
    """Find the test that holds for exactly the marked robots. marks: a bit for each robot."""

    serial: Serial
    marks: Annotated[bytes, Meta(max_length=MAX_BYTES)]


class AddAlert(PageMessage):
    """Watch a test, and tell when it becomes true for anybody, or for more than so many robots."""

    serial: Serial
    text: Annotated[str, Meta(max_length=1_000)]
    above: Annotated[int, Meta(ge=0, le=10_000_000)] = 0


class MuteAlert(PageMessage):
    """Let an alert fire without a word, or no longer."""

    serial: Serial
    alert: Number
    muted: bool


class RemoveAlert(PageMessage):
    """Watch a test no longer."""

    serial: Serial
    alert: Number


class Fired(PageMessage):
    """For which robots an alert has fired."""

    serial: Serial
    firing: Number


class Wink(PageMessage):
    """Let a robot blink, so that it is found."""

    serial: Serial
    robot: Index


class Outcomes(PageMessage):
    """What became of a command on each robot."""

    serial: Serial
    command: Id


class Replies(PageMessage):
    """What each of these robots (by their indices) answered to a question."""

    serial: Serial
    command: Id
    robots: Annotated[list[Annotated[int, Meta(ge=0, le=10_000_000)]], Meta(max_length=MOST_REPLIES)]


class Members(PageMessage):
    """Who is in a group, by its code in a frame."""

    serial: Serial
    group: Annotated[int, Meta(ge=1, le=255)]


class Build(PageMessage):
    """Put up an obstacle with these corners, m."""

    serial: Serial
    corners: Annotated[list[tuple[Metres, Metres]], Meta(min_length=3, max_length=MOST_CORNERS)]


class Shift(PageMessage):
    """Move the obstacle at this place among those of this version of the world by so many m."""

    serial: Serial
    version: Annotated[int, Meta(ge=0, le=2**53 - 1)]
    place: Annotated[int, Meta(ge=0, le=1_000_000)]
    across: Metres
    up: Metres


class Clear(PageMessage):
    """Take an obstacle away; see `Shift`."""

    serial: Serial
    version: Annotated[int, Meta(ge=0, le=2**53 - 1)]
    place: Annotated[int, Meta(ge=0, le=1_000_000)]


class Undo(PageMessage):
    """Undo a change of the obstacles by its number, or (again) do once more what was undone."""

    serial: Serial
    change: Number
    again: bool = False


class GetPicture(PageMessage, tag="picture"):
    """The picture of the map that the scene tells the place of."""

    serial: Serial


class Sense(PageMessage):
    """What the body of a robot (by its index) senses now."""

    serial: Serial
    robot: Index


class Field(PageMessage):
    """A map of a field, by its name."""

    serial: Serial
    name: Annotated[str, Meta(max_length=64)]


class Failed(PageMessage):
    """On which robots a rule fails now; "": any rule."""

    serial: Serial
    rule: Id


class GetCommands(PageMessage, tag="commands"):
    """The account of every command, at once."""

    serial: Serial


class GetRows(PageMessage, tag="rows"):
    """Rows of the table of robots, `count` from place `first` on. columns: expressions, none for those that the desk
    suggests. sort: the column by which it is sorted, -1 for the robots' own order, -2 for their groups. where: a test
    that the robots pass, "" for all of them. again: sort anew; else the order stays that of the last rows, if nothing
    else is asked for."""

    serial: Serial
    columns: Annotated[list[Expression], Meta(max_length=MAX_COLUMNS)]
    sort: Annotated[int, Meta(ge=-2, lt=MAX_COLUMNS)] = -1
    descending: bool = False
    where: Expression = ""
    first: Place = 0
    count: Annotated[int, Meta(ge=0, le=MAX_ROWS)] = 0
    again: bool = False


class GetRange(PageMessage, tag="range"):
    """Which robots are in these rows of the table, in the order of the last rows."""

    serial: Serial
    first: Place
    count: Place


class GetCsv(PageMessage, tag="csv"):
    """The table as CSV, piece by piece; all are of the moment of the first one. robots: only these (by index), none for
    all rows; they are given with the first piece."""

    serial: Serial
    piece: Place = 0
    robots: Annotated[list[Index], Meta(max_length=MAX_PICKED)] = []


class AddPlot(PageMessage, tag="plot"):
    """Draw something as long as the desk runs: see `plots.PlotSpec`."""

    serial: Serial
    kind: Literal["time", "scatter", "histogram"]
    x: Expression
    y: Expression = ""
    where: Expression = ""
    what: Literal["range", "quantiles", "mean", "median", "min", "max", "sum", "std", "count", "share"] = "range"


class RemovePlot(PageMessage, tag="unplot"):
    """Draw the plot with this number no more."""

    serial: Serial
    number: Place


class GetPlot(PageMessage, tag="plotted"):
    """What is to be drawn of a plot now. after: only what is later (s), if the plot has been thinned this often; -1 for
    everything."""

    serial: Serial
    number: Place
    after: Annotated[float, Meta(ge=-1.0, le=1e12)] = -1.0
    thinned: Place = 0


class Stop(PageMessage):
    """Stop every body."""


class Release(PageMessage):
    """End STOP."""


class SetPace(PageMessage, tag="pace"):
    """How time is to run; what is None stays as it is. factor: simulated seconds in a second."""

    running: bool | None = None
    factor: Annotated[float, Meta(ge=MIN_FACTOR, le=MAX_FACTOR)] | None = None


class Seek(PageMessage):
    """Go to this time (s) of a recording."""

    time: Annotated[float, Meta(ge=0.0, le=1e9)]


class ShowMoment(PageMessage, tag="look"):
    """Show this page how everything was at this time (s) of the run; None: how it is now."""

    time: Annotated[float, Meta(ge=0.0, le=1e9)] | None = None


class Fork(PageMessage):
    """Let the run go on from how it was at this time (s); what came after that becomes another future."""

    serial: Serial
    time: Annotated[float, Meta(ge=0.0, le=1e9)]


class Ghosts(PageMessage):
    """Whether to show this page where the robots were in the other future."""

    on: bool


class SingleStep(PageMessage, tag="step"):
    """One tick, then stand still."""


class Watch(PageMessage):
    """Tell me of this robot (by its index; -1: of none)."""

    robot: Index


class Drawn(PageMessage):
    """The frame with this number is on the screen."""

    number: Annotated[int, Meta(ge=0, le=2**32 - 1)]


class Scenarios(PageMessage):
    """Which scenarios there are, and what the run on the page was made of."""

    serial: Serial


class GetSetup(PageMessage, tag="setup"):
    """What may be changed of a scenario."""

    serial: Serial
    scenario: ScenarioName


class Renew(PageMessage):
    """Start another run. scenario: "" for the run on the page as it was at its start; the rest is left out then. seed,
    robots: None for the scenario's own. values: by the names of sliders, each in the slider's unit."""

    serial: Serial
    scenario: ScenarioName = ""
    seed: Seed | None = None
    robots: Annotated[int, Meta(ge=1, le=10_000_000)] | None = None
    values: Annotated[dict[SliderName, float], Meta(max_length=MOST_VALUES)] = {}


class Perform(PageMessage):
    """An order to a Nomad, as a program would give it; `text` goes with `tk` alone."""

    serial: Serial
    robot: NomadIndex
    order: Annotated[str, Meta(max_length=40)]
    numbers: Annotated[list[NomadNumber], Meta(max_length=MOST_NUMBERS)]
    text: Annotated[str, Meta(max_length=MOST_SAID)] = ""


class Drive(PageMessage):
    """Speeds of a Nomad's axes, from a hand at the keys: to be said again and again, or the robot rests."""

    robot: NomadIndex
    numbers: Annotated[list[NomadNumber], Meta(min_length=3, max_length=3)]


class Click(PageMessage):
    """A place in a Nomad's own window, m: the answer to a program that asks for one."""

    serial: Serial
    robot: NomadIndex
    x: Annotated[float, Meta(ge=-FARTHEST, le=FARTHEST)]
    y: Annotated[float, Meta(ge=-FARTHEST, le=FARTHEST)]


class Load(PageMessage):
    """The obstacles of a file, in place of those that there are. name: of the file."""

    serial: Serial
    name: Annotated[str, Meta(max_length=MOST_NAME)]
    text: Annotated[str, Meta(max_length=MOST_WORLD)]


class Save(PageMessage):
    """All obstacles as the text of a file."""

    serial: Serial


class DraftTest(PageMessage):
    """Let time stand still, and tell what a test of the session up to now would hold."""

    serial: Serial


class CountTrue(PageMessage):
    """For how many robots an expression is true now, by what they themselves know."""

    serial: Serial
    text: Expression


class HeldCount(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """What shall become of a command when a test ends. how: what the count is to the number."""

    count: Literal["matched", "held", "not matched", "unknown", "fault", "silent"]
    how: Bound
    number: Annotated[int, Meta(ge=0, le=10_000_000)]


class HeldGoal(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """For how many robots an expression shall be true when a test ends."""

    text: Expression
    how: Bound
    number: Annotated[int, Meta(ge=0, le=10_000_000)]


class SaveTest(PageMessage):
    """Make the files of a test. tick: at which it was drafted. held: by the ids of commands. exact: the whole state
    shall be the same at the end."""

    serial: Serial
    tick: Annotated[int, Meta(ge=0, le=2**53 - 1)]
    name: TestName
    held: Annotated[dict[Id, Annotated[list[HeldCount], Meta(max_length=6)]], Meta(max_length=MOST_HELD)] = {}
    goals: Annotated[list[HeldGoal], Meta(max_length=MOST_GOALS)] = []
    exact: bool = False


class Play(PageMessage):
    """Send the commands of the run's mission at their times, or (not on) do so no longer."""

    serial: Serial
    on: bool = True


class SendLine(PageMessage):
    """Send a command of the mission now, by its place in it. again: although it was sent; confirmed: it is meant as it
    stands, whatever is doubted."""

    serial: Serial
    line: Place
    again: bool = False
    confirmed: bool = False


class SkipLine(PageMessage):
    """Play the mission without this command."""

    serial: Serial
    line: Place


AlertMessage = AddAlert | MuteAlert | RemoveAlert | Fired
Incoming = (
    GetPreview
    | GetSpread
    | Pick
    | AlertMessage
    | Wink
    | Send
    | Play
    | SendLine
    | SkipLine
    | Halt
    | ChangeLease
    | GetNames
    | GetGlance
    | Why
    | Outcomes
    | Failed
    | Members
    | Phrase
    | Understand
    | Sense
    | Build
    | Shift
    | Clear
    | Undo
    | GetPicture
    | GetCommands
    | Field
    | Replies
    | GetRows
    | GetRange
    | GetCsv
    | AddPlot
    | RemovePlot
    | GetPlot
    | Stop
    | Release
    | SetPace
    | Seek
    | ShowMoment
    | Fork
    | Ghosts
    | SingleStep
    | Watch
    | Drawn
    | Scenarios
    | GetSetup
    | Renew
    | DraftTest
    | CountTrue
    | SaveTest
    | Perform
    | Drive
    | Click
    | Load
    | Save
)

_DECODER: msgspec.json.Decoder[Incoming] = msgspec.json.Decoder(Incoming)


class PageMessageError(MisuseError):
    """Something from the page that is no message."""


def decode(data: str | bytes) -> Incoming:
    """The message in `data`. Raises PageMessageError."""
    return read(_DECODER, data)


def read(decoder: msgspec.json.Decoder[T], data: str | bytes) -> T:
    """The message in `data` as `decoder` knows it. Raises PageMessageError."""
    try:
        return decoder.decode(data)
    except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
        raise PageMessageError(f"not a message of this page: {error}") from None


def serial_in(data: str | bytes) -> int | None:
    """The serial number of something that is otherwise no message, so that its sender hears of it."""
    try:
        return msgspec.json.decode(data, type=_Numbered).serial
    except (msgspec.DecodeError, UnicodeError, RecursionError):
        return None


class _Numbered(msgspec.Struct):
    serial: Serial
