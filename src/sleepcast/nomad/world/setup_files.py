"""Setup files of the Nomads' server of 1998, `robot.setup` and `world.setup`, read as they are.

No such file has come down to us. Known is that they have sections in brackets, and some of what stood in them; how
most keys were spelled is our reading, and docs/scenarios.md says of which. So what is not understood is no error: it is
left out and told, line by line. What is understood must make sense.

A line has a key and its values, with `=`, `:` or only blanks between them; further lines with nothing but numbers go on
with the values. `;`, `#` and a `//` after a blank begin a comment, except within double quotes. Where a key comes
twice, the later line counts. Lengths are in inches, as the sonars report them, angles in tenths of degrees.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from math import isfinite, pi, sqrt
from pathlib import Path
from typing import NamedTuple, TypeVar

from sleepcast.core.errors import and_more, printable
from sleepcast.core.records import dataclass
from sleepcast.core.settings import SettingsError, read_raw
from sleepcast.nomad.world.setups import Setup
from sleepcast.nomad.world.sites import MAX_NOMADS
from sleepcast.simulator.scenario.robot_settings import INCH, MAX_ORDER, TENTH, WIDEST_BEAM, Ring

SUFFIX = ".setup"
MAX_FILE = 65_536
"""Bytes of one file: some thousand lines, and such files are written by hand."""
MOST_TOLD = 20
"""Lines left out that are told one by one."""
MAX_VALUES = 256
"""Values of one key: a firing order has sixteen."""
BRIEF = 60
"""Characters of a line that are told."""
LAST_PORT = 65_535
END_OF_ORDER = 255
"""Stands behind the last sonar of an order, as in `conf_sn`."""
PAUSE_STEP = 0.004
"""A firing rate of 1, s."""
TRIAL = 100 * INCH
"""Travel after which an error of control is measured, m."""

_SECTION = re.compile(r"\[([^\[\]]*)\]")
_LINE = re.compile(r"\r\n|\r|\n")
_ENTRY = re.compile(r"([A-Za-z_][\w.-]*)\s*[=:]?\s*(.*)")
_NUMBER = re.compile(r"[+-]?(?:\d{1,15}(?:\.\d{0,15})?|\.\d{1,15})(?:[eE][+-]?\d{1,3})?")
_COMMENT = re.compile(r'("[^"]*")|(?:;|#|(?<!\S)//).*')
YES, NO = frozenset({"1", "yes", "true", "on"}), frozenset({"0", "no", "false", "off"})


class Entry(NamedTuple):
    """A key with its values.

    section, key: in small letters.
    values: words.
    rest: what stands behind the key in its line.
    where: file and line, for errors.
    """

    section: str
    key: str
    values: list[str]
    rest: str
    where: str
    written: str

    @property
    def name(self) -> str:
        """The key with its section, if it has one."""
        return f"{self.section}.{self.key}" if self.section else self.key

    @property
    def bare(self) -> str:
        """The key for those that may stand in any section, "" if it names one itself."""
        return "" if "." in self.key else self.key

    def wrong(self, wanted: str) -> SettingsError:
        """The error for values that are not what is wanted."""
        got = printable(" ".join(self.values))[:BRIEF] or "nothing"
        section = f"[{self.section}] " if self.section else ""
        return SettingsError(f"{self.where}: {section}{self.key}: wanted {wanted}, got {got}")

    def numbers(self, count: int) -> list[float]:
        """So many numbers. Raises SettingsError."""
        numbers = [float(value) for value in self.values if _NUMBER.fullmatch(value)]
        if len(self.values) != count or len(numbers) != count or not all(map(isfinite, numbers)):
            raise self.wrong("a number" if count == 1 else f"{count} numbers")
        return numbers

    def number(self, low: float, high: float, what: str) -> float:
        """One number from `low` to `high`. Raises SettingsError."""
        (number,) = self.numbers(1)
        if not low <= number <= high:
            raise self.wrong(f"{what} from {low:g} to {high:g}")
        return number

    def whole(self, low: int, high: int, what: str) -> int:
        """One whole number from `low` to `high`. Raises SettingsError."""
        number = self.number(low, high, what)
        if number != int(number):
            raise self.wrong(f"{what}, a whole number")
        return int(number)

    def truth(self) -> bool:
        """Yes or no. Raises SettingsError."""
        word = self.values[0].casefold() if len(self.values) == 1 else ""
        if word not in YES | NO:
            raise self.wrong("yes or no")
        return word in YES

    def text(self) -> str:
        """A text, perhaps in quotes. Raises SettingsError."""
        text = self.rest.strip("\"'")
        if not text or len(self.values) > len(_words(self.rest)):
            raise self.wrong("a text in one line")
        return text


@dataclass(frozen=True, slots=True)
class WorldSetup:
    """What a world.setup says, and None where it says nothing.

    port: for programs.
    may_quit: whether they may end the server.
    robots: their number.
    map: a file with a world.
    ignored: sentences about what was left out.
    """

    port: int | None = None
    may_quit: bool | None = None
    robots: int | None = None
    map: Path | None = None
    ignored: tuple[str, ...] = ()


def read_world_setup(file: Path) -> WorldSetup:
    """The world.setup in a file. Raises SettingsError."""

    def map_of(entry: Entry, made: WorldSetup) -> WorldSetup:
        map_file = file.parent / entry.text()
        if map_file.suffix.casefold() == SUFFIX:
            raise entry.wrong("a world, not another setup")
        return replace(made, map=map_file)

    return _read(file, WorldSetup(), {**_WORLD, "map": map_of})


def read_robot_setup(file: Path, base: Setup) -> Setup:
    """`base` with what a robot.setup in a file says. Raises SettingsError."""
    made = _read(file, base, _ROBOT)
    ring = made.robots.ring
    assert ring  # a setup has sonars
    if ring.least >= ring.most:
        raise SettingsError(f"{file}: [sonar]: the minimum of {ring.least / INCH:g} in is not below the maximum")
    return made


Made = TypeVar("Made", WorldSetup, Setup)


def _read(file: Path, made: Made, known: dict[str, Callable[[Entry, Made], Made]]) -> Made:
    """`made` with what the keys in a file say that are known."""
    takers = [(entry, known.get(entry.name) or known.get(entry.bare)) for entry in _entries(file)]
    latest = {take: entry for entry, take in takers}
    ignored: list[str] = []
    for entry, take in takers:
        again = "" if take is None or latest[take] is entry else f", as {latest[take].where} says it again"
        if take is None or again:
            ignored.append(f"{entry.where}: ignored{again}: {printable(entry.written)[:BRIEF]}")
        else:
            made = take(entry, made)
    told: list[str] = [*ignored[:MOST_TOLD], *and_more(len(ignored[MOST_TOLD:]))]
    return replace(made, ignored=(*made.ignored, *told))


def _entries(file: Path) -> Iterator[Entry]:
    """What stands in a file, in order; a line that is no entry has an empty key. Raises SettingsError."""
    section, entry = "", _NONE
    for number, line in enumerate(_LINE.split(_text(file)), 1):
        written = _COMMENT.sub(r"\1", line).strip()
        values = _words(written)
        if not values:
            continue
        where = f"{file}:{number}"
        if header := _SECTION.fullmatch(written):
            if entry.where:
                yield entry
            section, entry = header[1].strip().casefold(), _NONE
        elif entry.key and all(map(_NUMBER.fullmatch, values)):
            entry.values.extend(values)
            if len(entry.values) > MAX_VALUES:
                raise SettingsError(f"{where}: more than {MAX_VALUES} values of {entry.key}")
        else:
            if entry.where:
                yield entry
            key, rest = _key_of(written)
            entry = Entry(section, key, _words(rest), rest, where, written)
    if entry.where:
        yield entry


_NONE = Entry("", "", [], "", "", "")


def _key_of(written: str) -> tuple[str, str]:
    """The key of a line, "" if there is none, and what stands behind it."""
    pair = _ENTRY.fullmatch(written)
    return (pair[1].casefold(), pair[2].strip()) if pair else ("", "")


def _words(written: str) -> list[str]:
    return written.replace(",", " ").split()


def _text(file: Path) -> str:
    """What stands in a file of those years, when any byte was a character, or one that an editor of today has saved."""
    raw = read_raw(file, MAX_FILE, "a setup file")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


# ---- keys, by section and key, or in any section


def _port(entry: Entry, made: WorldSetup) -> WorldSetup:
    return replace(made, port=entry.whole(1, LAST_PORT, "a TCP port"))


def _quit(entry: Entry, made: WorldSetup) -> WorldSetup:
    return replace(made, may_quit=entry.truth())


def _count(entry: Entry, made: WorldSetup) -> WorldSetup:
    return replace(made, robots=entry.whole(1, MAX_NOMADS, "a number of robots"))


_WORLD: dict[str, Callable[[Entry, WorldSetup], WorldSetup]] = {
    **dict.fromkeys(("port", "tcp_port", "serv_tcp_port"), _port),
    "quit_server": _quit,
    "robots": _count,
}


def _laser(count: int) -> Callable[[Entry, Setup], Setup]:
    def take(entry: Entry, made: Setup) -> Setup:
        entry.numbers(count)
        return replace(made, ignored=(*made.ignored, f"{entry.where}: read, but no robot here has a laser"))

    return take


def _ring(change: Callable[[Entry, Ring], Ring]) -> Callable[[Entry, Setup], Setup]:
    def take(entry: Entry, made: Setup) -> Setup:
        ring = made.robots.ring
        assert ring  # a setup has sonars
        return replace(made, robots=replace(made.robots, ring=change(entry, ring)))

    return take


def _order(entry: Entry, ring: Ring) -> Ring:
    order = entry.numbers(len(entry.values))
    order = order[: order.index(END_OF_ORDER)] if END_OF_ORDER in order else order
    if not 1 <= len(order) <= MAX_ORDER or not set(order) <= set(range(ring.count)):
        raise entry.wrong(f"numbers of sonars from 0 to {ring.count - 1}")
    return replace(ring, order=tuple(map(int, order)))


def _error(entry: Entry, made: Setup) -> Setup:
    wheels = made.robots.wheels
    assert wheels  # a setup has wheels
    slip = entry.number(0.0, 600.0, "tenths of an inch") * TENTH / sqrt(TRIAL)
    return replace(made, robots=replace(made.robots, wheels=replace(wheels, slip_noise=slip)))


_FULL_BEAM = WIDEST_BEAM * 180.0 / pi * 10.0 / 2.0
"""Half of the widest beam in tenths of a degree."""
_ROBOT: dict[str, Callable[[Entry, Setup], Setup]] = {
    "laser.calibration": _laser(8),
    "laser.offset": _laser(2),
    "sonar.rate": _ring(lambda e, ring: replace(ring, pause=PAUSE_STEP * e.whole(0, 255, "a firing rate"))),
    "sonar.order": _ring(_order),
    "sonar.minimum": _ring(lambda e, ring: replace(ring, least=e.number(0.0, 255.0, "inches") * INCH)),
    "sonar.maximum": _ring(lambda e, ring: replace(ring, most=e.number(1.0, 255.0, "inches") * INCH)),
    "sonar.half_cone": _ring(
        lambda e, ring: replace(ring, beam=2.0 * e.number(1.0, _FULL_BEAM, "tenths of a degree") * pi / 1800.0)
    ),
    "sonar.error": _ring(lambda e, ring: replace(ring, noise=e.number(0.0, 1.0, "a share of the range"))),
    "control.error": _error,
}
