"""What can go wrong, said so that a person can act on it.

Every error that a user can cause is a `SleepcastError`: its text is one or more plain sentences that say where, what
came, what was wanted and what to do. The roof prints the text and exits with `exit_status` (2 for misuse, 1 for a
failure at work). The rooms keep their own subclasses beside the code that raises them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import lru_cache

MAX_LINE = 100
"""Characters of a line that are shown around a caret: a line of a message may have 16,384."""


_WITHIN = re.compile(r" at (\d{1,6}):\d{1,6}\b")


class SleepcastError(Exception):
    """Anything that a person using sleepcast can cause or must know about."""

    exit_status = 1


class MisuseError(SleepcastError):
    """The call itself is wrong: an unknown name, a malformed file, an impossible option."""

    exit_status = 2


def nearest(name: str, candidates: Iterable[str]) -> str | None:
    """The candidate most like `name` (case ignored), in capitals if `name` is, or None if none is near. Where only the
    case differs, it counts, and the candidate is given as it is written.

    Of those equally near, one with the same letters in another order comes first, then one with the same first letter.
    """
    return _nearest(name, tuple(candidates))


@lru_cache(maxsize=64)  # robots of one type are asked the same, one after the other
def _nearest(name: str, candidates: tuple[str, ...]) -> str | None:
    import difflib  # only needed when something is wrong already

    key, written = name.casefold(), {candidate.casefold(): candidate for candidate in candidates}
    matcher = difflib.SequenceMatcher(b=key)

    def likeness(other: str) -> tuple[float, bool, bool]:
        matcher.set_seq1(other)
        return matcher.ratio(), sorted(other) == sorted(key), other[:1] == key[:1]

    best = max(difflib.get_close_matches(key, written, n=5, cutoff=0.7), key=likeness, default=None)
    if best is None:
        return None
    return written[best].upper() if name.isupper() and best != key else written[best]


MIN_SLIPPED = 4
"""Characters of a name at least of which another one may be a slip: shorter ones are alike by chance."""


def slip_of(name: str, candidates: Iterable[str]) -> str | None:
    """The candidate of which `name`, which may well be a new name, is probably a slip: a letter more, less, or another
    one, or two exchanged. None for none, and for one of the candidates (case ignored). Names with other digits, as
    team1 and team2, are other names."""
    key, known = name.casefold(), {candidate.casefold(): candidate for candidate in candidates}
    if key in known:
        return None
    slips = (other for other in known if len(other) >= MIN_SLIPPED and _is_slip(key, other))
    return next((known[other] for other in slips), None)


def _is_slip(name: str, other: str) -> bool:
    if [c for c in name if c.isdigit()] != [c for c in other if c.isdigit()] or abs(len(name) - len(other)) > 1:
        return False
    first = next((at for at, (a, b) in enumerate(zip(name, other, strict=False)) if a != b), min(len(name), len(other)))
    rest, wanted = name[first:], other[first:]
    exchanged = rest[1::-1] + rest[2:]
    return wanted in (rest[1:], exchanged) or wanted[1:] in (rest, rest[1:])


def did_you_mean(name: str, candidates: Iterable[str]) -> str:
    """` (did you mean X?)` for the candidate nearest to `name`, or an empty string."""
    meant = nearest(name, candidates)
    return f" (did you mean {meant}?)" if meant else ""


_COMMA = re.compile(r"\s*([+-]?\d{1,15}),(\d{1,15})(\s*[A-Za-z%][A-Za-z/0-9]*|)\s*")
THOUSANDS = 3
"""Digits behind a comma that may stand between thousands."""


def decimal_comma(text: object) -> str:
    """`. Decimals have a point, not a comma: 12.5` for a number with a comma, or an empty text. A comma that may stand
    between thousands is named as both."""
    match = _COMMA.fullmatch(text) if isinstance(text, str) else None
    if match is None:
        return ""
    whole, rest, unit = match.groups()
    also = f", or {whole}{rest}{unit} if thousands are meant" if len(rest) == THOUSANDS else ""
    return f". Decimals have a point, not a comma: {whole}.{rest}{unit}{also}"


def line_and_column(text: str, offset: int) -> tuple[int, int]:
    """Line and column, both from 1, of a character offset in `text`."""
    before = text[:offset]
    line_start = before.rfind("\n") + 1
    return before.count("\n") + 1, offset - line_start + 1


def placed(message: str, text: str, offset: int) -> str:
    """`message` with its last `@@`, which stands for the place, as `at LINE:COLUMN` of `offset` in `text`."""
    line, column = line_and_column(text, offset)
    return f"at {line}:{column}".join(message.rsplit("@@", 1))


def in_file(place: str, sentence: str) -> str:
    """`sentence`, about a text that begins at `place` in a file (FILE:LINE), with one place: the line in the file. The
    `at LINE:COLUMN` of the text, which a caret shows as well, is left out."""
    first, newline, rest = sentence.partition("\n")
    file, _, line = place.rpartition(":")
    within = list(_WITHIN.finditer(first))
    if not within or not file or not line.isdigit():
        return f"{place}: {sentence}"
    spot = within[-1]
    shown = f"{file}:{int(line) + int(spot[1]) - 1}"
    return f"{shown}: {first[: spot.start()]}{first[spot.end() :]}{newline}{rest}"


def printable(text: str) -> str:
    """`text` with every character that a terminal might obey replaced, one for one."""
    return "".join(c if c.isprintable() or c == "\n" else "\N{REPLACEMENT CHARACTER}" for c in text)


def with_article(noun: str) -> str:
    """`a rule`, `an operator`."""
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"


def counted(count: int, noun: str) -> str:
    """`1 robot`, `3 robots`: a number with its noun, which takes an s."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def and_more(count: int) -> list[str]:
    """What ends a list from which so many are left out; nothing if none are."""
    return [f"and {count:,} more"] if count > 0 else []


def listed(names: Sequence[object], most: int, total: int | None = None) -> str:
    """`r1, r2 and 3 more`: the first ones by name, and how many there are besides.

    most: of these names at most.
    total: how many there are, None for as many as names.
    """
    some = names[:most]
    left = (len(names) if total is None else total) - len(some)
    return " ".join((", ".join(map(str, some)), *and_more(left)))


def with_caret(message: str, text: str, start: int, end: int) -> str:
    """`message`, then the line of `text` at `start`, then carets under the characters from `start` to `end`. Of a line
    longer than `MAX_LINE` characters only what stands around `start` is shown, with an ellipsis where it is cut."""
    line_start = text.rfind("\n", 0, start) + 1
    line_end = text.find("\n", start)
    if line_end < 0:
        line_end = len(text)
    left = min(start, max(line_start, min(start - MAX_LINE // 2, line_end - MAX_LINE)))
    right = min(line_end, left + MAX_LINE)
    before, after = ("…" if left > line_start else "", "…" if right < line_end else "")
    width = max(1, min(end, right) - start)
    carets = " " * (len(before) + start - left) + "^" * width
    return f"{message}\n  {before}{printable(text[left:right])}{after}\n  {carets}"


def reason_of(error: BaseException) -> str:
    """What went wrong, in a sentence: what an error of ours says; of any other one, which may say nothing, its kind as
    well."""
    said = str(error) if isinstance(error, SleepcastError) else f"{type(error).__name__}: {error}"
    return said or type(error).__name__
