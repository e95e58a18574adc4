"""Settings: a TOML file read key by key, so that every mistake is reported with its file, its line and its key.

The standard parser gives values without places, so the text is looked through once more for the line of each
key. A `Table` is asked for its keys one by one; leaving its `with` block refuses every key that nobody asked
for. Physical values are strings with a unit ("5mi", "30 kn") or plain numbers in SI.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import inf
from os.path import isfile
from pathlib import Path
from types import TracebackType
from typing import NoReturn

from sleepcast.core.errors import MisuseError, did_you_mean, nearest
from sleepcast.core.quantities import Measure, QuantityError, as_measure, measure_of, refusal, shown_value
from sleepcast.core.units import NONE, UNITS, Dimension

MAX_BYTES = 1_048_576
"""Of one file: the largest scenario of people is a hundred times smaller."""

MAX_NUMBER = 1e9
"""Of plain numbers in a list: beyond, sums of them lose what matters."""

MAX_SHOWN = 200
"""Characters of a key in an error."""
MAX_DEPTH = 64
"""Tables in tables: scenarios have four. What is read for each key is as long as the way to it, so a text of a
megabyte that is one key would fill any memory, and the standard parser takes hours for it."""

_NAME = r"""(?:[\w-]+|"[^"]*"|'[^']*')"""
_DEEP = re.compile(rf"""(?<![\w\\-])(?:(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{MAX_DEPTH}}}""")
_KEY = re.compile(rf"\s*({_NAME}(?:\s*\.\s*{_NAME})*)\s*=")
_HEADER = re.compile(rf"\s*(\[\[?)\s*({_NAME}(?:\s*\.\s*{_NAME})*)\s*\]")
_PART = re.compile(_NAME)
_SHOWN_PART = re.compile(r"[\w-]+|\[\d{1,6}\]")
_SHOWN_KEY = re.compile(r"[\w-]+(?:\.[\w-]+|\[\d{1,6}\])*")
_CHOSEN = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,31}\Z")

Path_ = tuple[str | int, ...]


class SettingsError(MisuseError):
    """Something wrong in a file; the text begins with the file, the line and the key."""


class Document:
    """One file: its values as parsed, and the line of every key."""

    def __init__(self, path: Path, values: dict[str, object], lines: dict[Path_, int]) -> None:
        self.path, self.values, self.lines = path, values, lines
        self._changed: set[Path_] = set()
        self._added: set[Path_] = set()
        self._given: list[Path_] = []

    def root(self) -> Table:
        return Table(self, self.values, ())

    def change(self, key: str, value: object) -> None:
        """Have a key, as `shown_key` writes it, say something else than the file does; errors then name no line.
        Raises SettingsError for a key that is none, in something that is no table, or given before."""
        where = self._new_key(key)
        here: object = self.values
        for depth, part in enumerate(where, 1):
            self._changed |= {where[:depth]} - self.lines.keys() | {where}
            last = depth == len(where)
            if isinstance(part, str) and isinstance(here, dict):
                self._note_added(where[: depth - 1], here, {part: value if last else {}})
                inside = here[part] = value if last else here.get(part, {})
            elif isinstance(part, int) and isinstance(here, list) and part < len(here):
                inside = here[part] = value if last else here[part]
            else:
                raise self.error(where[:depth], "there is no such place to be changed")
            here = inside

    def _note_added(self, around: Path_, old: object, new: object) -> None:
        """Note which keys of a table, and of tables in it, were not there before. around: where it stands."""
        for key, value in new.items() if isinstance(new, dict) else ():
            known = old.get(key) if isinstance(old, dict) else None
            self._added |= set() if known is not None else {(*around, key)}
            self._note_added((*around, key), known, value)

    def _new_key(self, key: str) -> Path_:
        """The place of a key that is to be changed: neither it nor a table around or inside it was changed before."""
        where = key_path(key)
        for other in self._given:
            if other == where:
                raise SettingsError(f"over {shown_key(where)}: it is given twice: give it once")
            if where[: len(other)] == other or other[: len(where)] == where:
                raise SettingsError(f"over {shown_key(where)}: {shown_key(other)} is given as well: give one of them")
        self._given.append(where)
        return where

    def measure(self, key: str) -> Measure:
        """The number at a key, as `shown_key` writes it, in SI with its unit. Raises MisuseError if there is none, and
        SettingsError, which names the key, if `change` has put something else there."""
        here: object = self.values
        for part in _parts(key) if _SHOWN_KEY.fullmatch(key) else ():
            if isinstance(part, str) and isinstance(here, dict):
                here = here.get(part)
            else:
                here = here[part] if isinstance(part, int) and isinstance(here, list) and part < len(here) else None
        measure = as_measure(here)
        if measure is None or (measure.unit and measure.unit not in UNITS):
            if self.is_changed(key):
                self._check_tables(_parts(key))
                raise self.error(
                    _parts(key), "is missing" if here is None else f"wanted a number, not {shown_value(here)}"
                )
            raise MisuseError(f"this file has no number at {key:.80}")
        return measure

    def _check_tables(self, where: Path_) -> None:
        """Raises SettingsError for what stands in place of a table around a key."""
        here: object = self.values
        for depth, part in enumerate(where[:-1], 1):
            here = here.get(part) if isinstance(here, dict) else None
            if here is not None and not isinstance(here, dict | list):
                raise self.error(where[:depth], f"wanted a table [{shown_key(where[:depth])}], not {shown_value(here)}")

    def is_changed(self, key: str) -> bool:
        """Whether `change` has had this key, or a table around it, say something else."""
        where = _parts(key)
        return any(where[: len(given)] == given for given in self._given)

    def is_added(self, where: Path_) -> bool:
        """Whether only `change` has this key, and the file does not."""
        return where in self._added

    def error(self, where: Path_, sentence: str) -> SettingsError:
        """An error at the key `where`, or at the nearest table around it that has a line of its own."""
        if any(where[:n] in self._changed for n in range(1, len(where) + 1)):
            return SettingsError(f"{self.path}: over {shown_key(where)}: {sentence}")
        line = next((self.lines[where[:n]] for n in range(len(where), 0, -1) if where[:n] in self.lines), 1)
        return SettingsError(f"{self.path}:{line}: {shown_key(where):.{MAX_SHOWN}}: {sentence}")


def read_raw(path: Path, most: int, what: str) -> bytes:
    """The bytes of a file, at most `most` of them. what: it is, for errors. Raises SettingsError for another one."""
    try:
        with path.open("rb") as file:
            raw = file.read(most + 1)
    except (OSError, ValueError) as error:  # a null in the path is a ValueError
        raise SettingsError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from error
    if len(raw) > most:
        raise SettingsError(f"{path}: too long for {what}: at most {most} bytes")
    return raw


def read_text(path: Path, most: int = MAX_BYTES, what: str = "such a file") -> str:
    """The text of a file of at most `most` bytes. what: it is, for errors. Raises SettingsError for another one."""
    raw = read_raw(path, most, what)
    try:
        return raw.decode("utf-8-sig")  # some editors put a mark before the text
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise SettingsError(f"{path}:{line}: not UTF-8 text: {error.reason}") from error


def toml_document(path: Path, text: str | None = None) -> Document:
    """The TOML file at `path`. text: what would stand in it, None to read it. Raises SettingsError."""
    if text is None:
        text = read_text(path)
    elif len(text) > MAX_BYTES:
        raise SettingsError(f"{path}: too long for such a file: at most {MAX_BYTES} characters")
    if deep := _DEEP.search(text):
        line = text.count("\n", 0, deep.start()) + 1
        raise SettingsError(f"{path}:{line}: more than {MAX_DEPTH} tables in tables: wanted a key such as radio.loss")
    try:
        return Document(path, tomllib.loads(text), key_lines(text))
    except (ValueError, RecursionError) as error:  # numbers of thousands of digits, and lists in lists in lists
        message = str(error)
        spot = re.search(r"\(at line (\d+), column (\d+)\)", message)
        line = int(spot[1]) if spot else text.count("\n") + 1
        reason = message[: spot.start()].strip() if spot else message
        raise SettingsError(f"{path}:{line}: not TOML: {reason}") from error


def key_lines(text: str) -> dict[Path_, int]:
    """The line, from 1, of every key and table. Tables in an array have their index in the path."""
    lines: dict[Path_, int] = {}
    table: Path_ = ()
    counts: dict[Path_, int] = {}
    quoted = ""  # the mark that ends a text of several lines
    for number, line in enumerate(text.split("\n"), 1):
        if quoted:
            quoted = "" if quoted in line else quoted
            continue
        quoted = next((mark for mark in ('"""', "'''") if line.count(mark) == 1), "")
        if header := _HEADER.match(line):
            table = _path(header[2])
            for end in range(1, len(table) + 1):
                lines.setdefault(table[:end], number)
            if header[1] == "[[":
                counts[table] = counts.get(table, -1) + 1
                table = (*table, counts[table])
            lines.setdefault(table, number)
        elif key := _KEY.match(line):
            lines.setdefault((*table, *_path(key[1])), number)
    return lines


def key_path(key: str) -> Path_:
    """Where a key stands that people write, as `radio.loss`; equal for all ways to write it. Raises SettingsError for a
    text that is no key."""
    if not _SHOWN_KEY.fullmatch(key):
        raise SettingsError(f'over "{key:.80}": wanted a key such as radio.loss or commands[0].title')
    return _parts(key)


def _parts(key: str) -> Path_:
    """What a key consists of, as `shown_key` writes it."""
    return tuple(int(part[1:-1]) if part[0] == "[" else part for part in _SHOWN_PART.findall(key))


def _path(written: str) -> Path_:
    return tuple(part.strip("\"'") for part in _PART.findall(written))


def shown_key(where: Path_) -> str:
    """`robots.limits.speed`, `commands[0].title`: a key as people write it."""
    shown = ""
    for part in where:
        shown += f"[{part}]" if isinstance(part, int) else f".{part}" if shown else part
    return shown or "the file"


class Table:
    """One table of a document. Every method raises SettingsError for a value that is missing or not as
    wanted. below: another table, perhaps of another file, which has what this one does not say."""

    def __init__(self, document: Document, values: dict[str, object], where: Path_, below: Table | None = None) -> None:
        self.document, self.values, self.where, self.below = document, values, where, below
        self._asked: set[str] = set()

    def __enter__(self) -> Table:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if kind is None:
            for key in self.names():
                if key not in self._asked:
                    known = f"known here: {', '.join(sorted(self._asked))}" if self._asked else "nothing is wanted here"
                    raise self.error(key, f"unknown key{did_you_mean(key, self._asked)}; {known}")

    def names(self) -> list[str]:
        """The keys that it has, those below after its own."""
        return list(dict.fromkeys((*self.values, *(self.below.names() if self.below else ()))))

    def error(self, key: str, sentence: str) -> SettingsError:
        if self.below and key not in self.values and self.below.has(key):
            return self.below.error(key, sentence)
        return self.document.error((*self.where, key), sentence)

    @contextmanager
    def answering(self, key: str) -> Iterator[None]:
        """What stands under `key` answers for what is misused inside: the error that is raised names it."""
        try:
            yield
        except MisuseError as error:
            raise self.error(key, str(error)) from None

    def has(self, key: str) -> bool:
        self._asked.add(key)
        return key in self.values or (self.below is not None and self.below.has(key))

    def has_written(self, key: str) -> bool:
        """Whether the file has this key, or the one below; not if only a change of this run does."""
        if self.below is not None and self.below.has_written(key):
            return True
        return key in self.values and not self.document.is_added((*self.where, key))

    def text(self, key: str, default: str | None = None, *, choices: Sequence[str] = (), most: int = 500) -> str:
        """A text of at most `most` characters, one of `choices` if there are any."""
        value = self._value(key, default)
        if not isinstance(value, str):
            self._refuse(key, "a text in quotes", value)
        if choices and value not in choices:
            raise self.error(key, f'wanted one of {", ".join(choices)}, not "{value}"{did_you_mean(value, choices)}')
        if len(value) > most:
            raise self.error(key, f"a text of {len(value)} characters; at most {most} fit")
        return value

    def file(self, key: str) -> Path:
        """A file that there is, named from the folder of this one."""
        path = self.document.path.parent / self.text(key)
        if not isfile(path):
            raise self.error(key, f"there is no file {path}")
        return path

    def whole(self, key: str, default: int | None = None, *, low: int, high: int) -> int:
        """A whole number from `low` to `high`."""
        value = self._value(key, default)
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
            self._refuse(key, f"a whole number from {low} to {high}", value)
        return value

    def flag(self, key: str, default: bool) -> bool:
        """Yes or no."""
        value = self._value(key, default)
        if not isinstance(value, bool):
            self._refuse(key, "true or false", value)
        return value

    def measure(
        self,
        key: str,
        dimension: Dimension | None = NONE,
        default: Measure | None = None,
        *,
        low: float = -inf,
        high: float = inf,
    ) -> Measure:
        """A physical value of `dimension` (None: of any) within low..high, all in SI."""
        return self._measured(key, self._value(key, default), dimension, low, high)

    def number(
        self,
        key: str,
        dimension: Dimension = NONE,
        default: float | None = None,
        *,
        low: float = -inf,
        high: float = inf,
    ) -> float:
        """The same as `measure`, without its unit."""
        return self.measure(key, dimension, None if default is None else Measure(default), low=low, high=high).value

    def span(
        self,
        key: str,
        dimension: Dimension | None = NONE,
        default: tuple[Measure, Measure] | None = None,
        *,
        low: float = -inf,
        high: float = inf,
    ) -> tuple[Measure, Measure]:
        """Two physical values, the least and the greatest: `["0%", "100%"]`."""
        value = self._value(key, default)
        if default is not None and value is default:
            return default
        if not isinstance(value, list) or len(value) != 2:
            self._refuse(key, 'a list of the least and the greatest, such as ["1km", "5km"],', value)
        first, last = (self._measured(key, end, dimension, low, high) for end in value)
        if dimension is None and first.unit != last.unit:
            self._refuse(key, "the same unit for both", value)
        if first.value > last.value:
            self._refuse(key, "the least before the greatest", value)
        return first, last

    def point(self, key: str, low: tuple[float, float], high: tuple[float, float]) -> tuple[float, float]:
        """Two lengths, x and y, in m, within the rectangle from `low` to `high`."""
        value = self._value(key, None)
        if not isinstance(value, list) or len(value) != 2:
            self._refuse(key, 'a list of x and y, such as ["3km", "4km"],', value)
        dimension = UNITS["m"].dimension
        x, y = (self._measured(key, value[i], dimension, low[i], high[i]).value for i in (0, 1))
        return x, y

    def points(
        self, key: str, low: tuple[float, float], high: tuple[float, float], *, least: int, most: int
    ) -> tuple[tuple[float, float], ...]:
        """From `least` to `most` points, each as `point` has them."""
        value = self._value(key, None)
        if not isinstance(value, list) or not least <= len(value) <= most:
            self._refuse(key, f'a list of {least} to {most} points, such as ["3m", "24in"],', value)
        table = Table(self.document, {f"point {i + 1}": point for i, point in enumerate(value)}, (*self.where, key))
        return tuple(table.point(name, low, high) for name in table.values)

    def wholes(self, key: str, default: tuple[int, ...], *, low: int, high: int, most: int) -> tuple[int, ...]:
        """From one to `most` whole numbers from `low` to `high`."""
        value = self._value(key, default)
        if not isinstance(value, list | tuple) or not 1 <= len(value) <= most:
            self._refuse(key, f"a list of 1 to {most} whole numbers,", value)
        table = Table(self.document, {f"number {i + 1}": each for i, each in enumerate(value)}, (*self.where, key))
        return tuple(table.whole(name, low=low, high=high) for name in table.values)

    def texts(self, key: str, *, most: int) -> tuple[str, ...]:
        """Up to `most` texts, none unless they are given."""
        value = self._value(key, [])
        if not isinstance(value, list) or len(value) > most:
            self._refuse(key, f'a list of up to {most} names, such as ["bravo"],', value)
        table = Table(self.document, {f"name {i + 1}": each for i, each in enumerate(value)}, (*self.where, key))
        return tuple(table.text(name) for name in table.values)

    def numbers(self, key: str, shape: Sequence[str]) -> tuple[float, ...]:
        """As many plain finite numbers as `shape` has names for."""
        value = self._value(key, None)
        if not isinstance(value, list) or len(value) != len(shape):
            self._refuse(key, f"a list of {', '.join(shape)}, such as [{', '.join('0' for _ in shape)}],", value)
        table = Table(self.document, dict(zip(shape, value, strict=True)), (*self.where, key))
        return tuple(table.number(name, low=-MAX_NUMBER, high=MAX_NUMBER) for name in shape)

    def table(self, key: str) -> Table:
        """The table under `key`, empty if there is none."""
        value = self.values.get(key, {})
        self._asked.add(key)
        if not isinstance(value, dict):
            self._refuse(key, f"a table [{shown_key((*self.where, key))}]", value)
        return Table(self.document, value, (*self.where, key), self.below.table(key) if self.below else None)

    def table_or_text(self, key: str, name: str) -> Table:
        """The table under `key`; a text there stands for a table with that text under `name` alone."""
        if isinstance(self.values.get(key), str):
            self._asked.add(key)
            return Table(self.document, {name: self.values[key]}, (*self.where, key))
        return self.table(key)

    def tables(self, key: str, *, most: int) -> dict[str, Table]:
        """The tables under the table `key`, by their names, at most so many: `[places.vessel]`."""
        around = self.table(key)
        if len(around.names()) > most:
            raise self.error(key, f"{len(around.names())} of them; at most {most} fit")
        return {name: around.table(name) for name in around.names()}

    def array(self, key: str, *, most: int) -> list[Table]:
        """The tables of the array `key`, at most so many: `[[commands]]`."""
        value = self._value(key, ())
        if not isinstance(value, list | tuple) or not all(isinstance(item, dict) for item in value):
            self._refuse(key, f"tables [[{shown_key((*self.where, key))}]]", value)
        if len(value) > most:
            raise self.error(key, f"{len(value)} of them; at most {most} fit")
        return [Table(self.document, item, (*self.where, key, i)) for i, item in enumerate(value)]

    def _value(self, key: str, default: object) -> object:
        self._asked.add(key)
        if key in self.values:
            return self.values[key]
        if self.below and self.below.has(key):
            return self.below._value(key, default)
        if default is None:
            written = nearest(key, set(self.names()) - self._asked)
            if written:
                raise self.error(written, f"unknown key (did you mean {key}?)")
            raise self.error(key, "is missing")
        return default

    def _measured(self, key: str, value: object, dimension: Dimension | None, low: float, high: float) -> Measure:
        if isinstance(value, Measure):
            return value
        try:
            return measure_of(value, dimension, low, high)
        except QuantityError as error:
            raise self.error(key, str(error)) from None

    def _refuse(self, key: str, wanted: str, value: object) -> NoReturn:
        raise self.error(key, refusal(wanted, value))


def checked_name(around: Table, name: str, key: str | None = None) -> str:
    """`name`, a key of the table `around` that people choose, or what stands there under `key`. Raises SettingsError if
    it cannot be a name, and for a key that no file has: a change of a file names what there is."""
    if key is None and not around.has_written(name):
        known = [each for each in around.names() if around.has_written(each)]
        wanted = f": wanted one of {', '.join(known)}" if known else ""
        raise around.error(name, f"the file has no such name{did_you_mean(name, known)}{wanted}")
    if not _CHOSEN.match(name):
        raise around.error(key or name, f'"{name}" is no name: wanted a letter, then up to 31 letters, digits and _')
    return name
