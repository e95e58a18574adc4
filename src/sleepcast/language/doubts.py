"""Doubts: what runs, but hardly as it is meant, and then often on every robot.

A comparison whose value goes nowhere lets everybody through, and so does a test that is a length or a PROB of 50. These
findings are warnings that a desk wants confirmed before it sends the text.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from sleepcast.core.units import NONE, Dimension, to_si
from sleepcast.language.form import Form, Number, format_literal
from sleepcast.language.infix import brief
from sleepcast.language.parts import ACTING, Part, host_of, walk
from sleepcast.language.vocabulary import Kind, Variable

_LASTING = ACTING | {"set_local", "fetch", "call", "missing"}
"""Parts that may leave something behind besides their value."""
_HARMLESS = {"const", "absent"}
"""Parts whose value may be lost: nobody takes a number for a test, and an unknown name has a finding of its own."""
_NEARLY = 0.01
"""Of a measured value: how near another one may be to count as the same, in what is suggested."""
_ENOUGH = 1.0 + 1e-9
"""What the shares of DICE may add up to: 1, and what rounding makes of it."""


def doubts(root: Part, text: str, dimension: Callable[[Part], Dimension | None]) -> Iterator[tuple[Form, str]]:
    """Every doubt about `root`, read from `text`, as where and what. dimension: of the value of a part in it."""
    for part in walk(root):
        yield from _about(part, text, dimension)


def _about(part: Part, text: str, dimension: Callable[[Part], Dimension | None]) -> Iterator[tuple[Form, str]]:
    match part.op:
        case "cond":
            for clause in part.parts:
                yield from _test(clause.parts[0], text, dimension)
                yield from _lost_in_clause(clause, text)
        case "if":
            yield from _test(part.parts[0], text, dimension)
        case "progn":
            yield from _lost(part.parts[:-1], text)
        case "let":
            yield from _lost(part.parts[int(part.number) : -1], text)
        case "dotimes":
            yield from _lost(part.parts, text)
        case "pure" if part.name in ("=", "EQ", "/="):
            yield from _exactly(part, text)
        case "prob":
            yield from _chance(part, text)
        case "dice":
            yield from _shares(part, text)
        case "gauss" if part.parts[1].op == "const" and part.parts[1].number < 0:
            yield part.form, f"{brief(part.form, text)} @@ has no value: a deviation is not negative"


# ---- values that go nowhere


def _lost_in_clause(clause: Part, text: str) -> Iterator[tuple[Form, str]]:
    """Comparisons right behind the test were meant to be a part of it."""
    more = []
    for part in clause.parts[1:-1]:
        if not _is_truth(part):
            break
        more.append(part)
    if more:
        whole = " ".join(brief(part.form, text) for part in (clause.parts[0], *more[:3]))
        cut = " ..." if len(more) > 3 else ""
        first = more[0].form
        yield (
            first,
            f"{brief(first, text)} @@ decides nothing: its value goes nowhere (did you mean (AND {whole}{cut})?)",
        )
    yield from _lost(clause.parts[1 + len(more) : -1], text)


def _lost(parts: Sequence[Part], text: str) -> Iterator[tuple[Form, str]]:
    for part in parts:
        if part.op not in _HARMLESS and not any(map(_lasts, walk(part))):
            hint = f" (did you mean (WHEN {brief(part.form, text)} ...)?)" if _is_truth(part) else ""
            yield part.form, f"{brief(part.form, text)} @@ does nothing: its value goes nowhere{hint}"


def _lasts(part: Part) -> bool:
    return host_of(part).acts if part.op == "host" else part.op in _LASTING


def _is_truth(part: Part) -> bool:
    """Whether a part says yes or no, and does nothing else."""
    truth = part.op in ("and", "or", "known", "in", "prob")
    truth = truth or (part.op == "pure" and part.function.rule in ("compare", "truth"))
    return truth and not any(map(_lasts, walk(part)))


# ---- tests


def _test(part: Part, text: str, dimension: Callable[[Part], Dimension | None]) -> Iterator[tuple[Form, str]]:
    """A test, or a part of one, that has a dimension is true wherever it is not 0."""
    if part.op in ("and", "or") or (part.op == "pure" and part.name == "NOT"):
        for inside in part.parts:
            yield from _test(inside, text, dimension)
        return
    found = dimension(part)
    if found not in (None, NONE):
        said = brief(part.form, text)
        yield part.form, f"{said} @@ is {found}: as a test it is true unless it is 0 (did you mean (< {said} ...)?)"


def _exactly(part: Part, text: str) -> Iterator[tuple[Form, str]]:
    """What is measured is hardly ever exactly something; but a tank may be empty, and a robot stand."""
    if any(operand.op == "const" and not operand.number for operand in part.parts):
        return
    units = any(isinstance(operand.form, Number) and operand.form.unit for operand in part.parts)
    for operand in part.parts:
        data = operand.data
        if isinstance(data, Variable) and data.kind is Kind.SENSOR and (units or data.quantity.dimension != NONE):
            holds, sign = ("nearly always", ">") if part.name == "/=" else ("hardly ever", "<")
            hint = ""
            if len(part.parts) == 2:
                pair = " ".join(brief(each.form, text) for each in part.parts)
                hint = f" (did you mean ({sign} (ABS (- {pair})) {_tolerance(part, data)})?)"
            yield part.form, f"{brief(part.form, text)} @@ {holds} holds: {data.name} is measured{hint}"
            return


def _tolerance(part: Part, measured: Variable) -> str:
    """A hundredth of the number that a measured value is compared with, in its unit, or of one unit."""
    number = next((p.form for p in part.parts if isinstance(p.form, Number) and p.form.value), None)
    unit = number.unit if number is not None and number.unit else measured.quantity.unit
    value = abs(number.value / to_si(1.0, unit) if unit else number.value) if number is not None else 1.0
    return format_literal(float(f"{_NEARLY * value:.2g}")) + unit


# ---- chance


def _chance(part: Part, text: str) -> Iterator[tuple[Form, str]]:
    chance = part.parts[0]
    if chance.op == "const" and not 0.0 <= chance.number <= 1.0:
        always = "always 1" if chance.number > 1.0 else "always 0"
        percent = _percent(chance)
        hint = f" (did you mean {percent}?)" if percent else ""
        yield part.form, f"{brief(part.form, text)} @@ is {always}: a chance runs from 0 to 1{hint}"


def _shares(part: Part, text: str) -> Iterator[tuple[Form, str]]:
    shares = [clause.parts[0] for clause in part.parts if clause.parts[0].op == "const"]
    negative = next((share for share in shares if share.number < 0), None)
    if negative is not None:
        yield negative.form, f"{brief(negative.form, text)} @@ is never drawn: a share is not negative"
    elif (total := sum(share.number for share in shares)) > _ENOUGH:
        percents = list(map(_percent, shares))
        meant = all(percents) and total <= 100.0 * _ENOUGH
        hint = f" (did you mean {' '.join(percents[:4])}{' ...' if percents[4:] else ''}?)" if meant else ""
        yield part.form, f"the shares of DICE @@ add up to {total:g}, and at most 1 is drawn{hint}"


def _percent(part: Part) -> str:
    """The same digits as a percentage, "" if that is no chance or a unit was written."""
    form = part.form
    fits = isinstance(form, Number) and not form.unit and 1.0 <= form.value <= 100.0
    return f"{form.text}%" if isinstance(form, Number) and fits else ""
