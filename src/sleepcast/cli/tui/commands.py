"""Values of a session of the terminal desk: addressee, command type, findings about the text; and the help page."""

from __future__ import annotations

from dataclasses import field
from enum import StrEnum

from sleepcast.core.records import dataclass
from sleepcast.language import Checked
from sleepcast.station.prepared import Prepared, Terms
from sleepcast.station.validation import Audience


class CommandType(StrEnum):
    """What Enter makes of a text."""

    ONCE = "once"
    STAGED = "staged"
    STANDING = "standing"
    ASK = "ask"


@dataclass(frozen=True, slots=True)
class Addressee:
    """The addressees of a text.

    label: as the prompt shows it.
    test: put before the text.
    robot: the only addressee.
    everybody: whether all robots are meant, as the operator has confirmed.
    """

    label: str
    test: str = ""
    robot: str = ""
    everybody: bool = False

    def wrapped(self, text: str, type: CommandType) -> str:
        """The text as it is sent. Robots that are not asked answer UNKNOWN, which no statistics count."""
        if not self.test:
            return text
        return f"(IF {self.test} {text} UNKNOWN)" if type is CommandType.ASK else f"(WHEN {self.test} {text})"


AS_WRITTEN = Addressee("")
"""The addressees are given by the text itself."""
EVERYBODY = Addressee("all", everybody=True)


@dataclass(frozen=True, slots=True)
class Spot:
    """Something wrong or doubtful at start..end of a text."""

    message: str
    text: str
    start: int
    end: int
    wrong: bool


@dataclass(frozen=True, slots=True)
class ForecastText:
    """The forecast of a text before it is sent.

    sentence: who would obey, or why that is unknown.
    spot: what is wrong with it.
    """

    sentence: str = ""
    spot: Spot | None = None


@dataclass(frozen=True, slots=True)
class PendingText:
    """A text that is to be sent.

    count: how many robots are meant, once its sender has typed that.
    may: how many may obey, where that has to be typed first.
    confirmed: whether it was entered twice, since the first time it was doubted.
    at: the instant at which all obey, s of Unix time, None for as soon as they hear it.
    prepared: the same as the desk has it, once it was checked.
    """

    text: str
    type: CommandType
    to: Addressee
    count: int | None = None
    may: int | None = None
    confirmed: bool = False
    at: float | None = None
    prepared: Prepared | None = field(default=None, compare=False)

    @property
    def wrapped(self) -> str:
        """The text as it is sent."""
        return self.to.wrapped(self.text, self.type)

    @property
    def terms(self) -> Terms:
        """How it is meant, as a command."""
        audience = Audience([self.to.robot] if self.to.robot else None)
        standing = self.type is CommandType.STANDING
        return Terms(standing, everybody=self.to.everybody, audience=audience, anyway=self.confirmed, at=self.at)


def marked_finding(checked: Checked) -> Spot | None:
    """The first error, else the first warning."""
    first = (checked.errors or checked.warnings)[:1]
    if not first:
        return None
    return Spot(first[0].message, checked.text, first[0].start, first[0].end, bool(checked.errors))


QUESTIONS = ("to", "show", "why", "look", "at", "hold", "help", "quit")
"""What can be asked of the desk itself, after a colon."""

HELP = """
F9 or Ctrl-X  STOP every robot: at once, and again until each is accounted for
F7 twice      RELEASE: end STOP; no earlier command resumes by itself
Enter         send the text once its parentheses are closed; twice if doubtful
Tab           complete a name; with no text, change the addressee: as written,
              all, each group, what :to has named (Shift-Tab at any time)
F3            once: expires after 5 s; staged: one robot, a tenth, all, until
              something fails; standing: reaches every robot, even later;
              ask: for a value
F4            sort robots by name, or by when they were last heard
PageUp/Down   scroll the robots, or this page
Ctrl-C        clear the text; without text quit, like Ctrl-Q and Ctrl-D

:to r7        address r7 only; :to (> battery 50%) all robots for which
              that is true; :to bravo a group; :to all
:show x y     show variables in the list of robots
:why r7 [ID]  how r7 evaluated the last command, or the one with that id
:at 12:30:05  the next command is obeyed at that time, by all at once; :at now
:hold off     no heartbeats: driven robots stop after their lease
:look         ask all robots for telemetry now
:quit         quit

Robots: S stopped, s stopped but not at rest yet, o not stopped,
? no telemetry yet; L lost: not heard lately; 2 several robots have this name.
Answer to the last command: M matched, H matched but held by STOP,
N did not match, U its test was unknown, W waits for its instant,
F fault, - silent
"""
