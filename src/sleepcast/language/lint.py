"""Checking a text before it is sent: the checker's errors, and advice on what is probably not meant.

The advice is about dimensions (5 s compared with a length), declared ranges (fuel runs from 0 to 1, so `(> fuel 50)`
never holds) and the places where failing closed has an edge (an IF whose test is unknown runs its else).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from math import inf, isfinite
from weakref import WeakKeyDictionary

from sleepcast.core.model import Constant, HostFunction, Quantity
from sleepcast.core.records import dataclass
from sleepcast.core.units import LENGTH, NONE, Dimension, dimension_of, to_si, value_in_words
from sleepcast.language.checker import Checker, CheckError, Finding, Findings
from sleepcast.language.evaluate import Entered
from sleepcast.language.functions import WORDS
from sleepcast.language.parts import ACTING, Part, host_of, walk
from sleepcast.language.program import Program, build
from sleepcast.language.reader import Form, List, Number, brief, format_literal, read
from sleepcast.language.reading_units import COMPARING, compared_units, is_angle, unit_to_read
from sleepcast.language.symbols import Names
from sleepcast.language.vocabulary import Variable, VariableKind, Vocabulary


@dataclass(frozen=True, slots=True)
class Checked:
    """A text that was checked.

    found: what is wrong or doubtful in it.
    program: None if there is any error.
    cost: its static bound in steps.
    vocabulary: what its names mean.
    by: whose names make it wrong, in a sentence; or, where they do not count, who they are; "" where it is the same for
        all.
    """

    text: str
    found: Findings
    program: Program | None
    cost: int
    vocabulary: Vocabulary
    by: str = ""

    @property
    def unit(self) -> str:
        """In which people read its value, "" for a plain number or where there is an error."""
        return "" if self.program is None else unit_of_program(self.program)

    @property
    def is_angle(self) -> bool:
        """Whether its value is an angle, so that means of it are circular ones."""
        return self.program is not None and is_angle(self.program.root)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Those that are shown."""
        return self.found.shown()

    @property
    def counts(self) -> Mapping[str, int]:
        """How many there are, by severity."""
        return self.found.counts

    @property
    def more(self) -> int:
        """How many findings there are besides `findings`."""
        return sum(self.counts.values()) - len(self.findings)

    @property
    def errors(self) -> list[Finding]:
        return [finding for finding in self.findings if finding.severity == "error"]

    @property
    def warnings(self) -> list[Finding]:
        return [finding for finding in self.findings if finding.severity == "warning"]

    @property
    def unknown(self) -> list[str]:
        """The names that nobody has declared, each once."""
        return list(dict.fromkeys(finding.unknown for finding in self.found.kept if finding.unknown))

    @property
    def doubts(self) -> list[Finding]:
        """Warnings that a desk wants confirmed before it sends the text."""
        return [finding for finding in self.found.kept if finding.confirm]

    def required(self) -> Program:
        """The program. Raises CheckError with every error if there is none."""
        if self.program is None:
            raise CheckError(self.errors, self.text, self.counts["error"] - len(self.errors), self.by)
        return self.program


def check(text: str, names: Names) -> Checked:
    """Read and check one expression. Raises ReadError for text that cannot be read; everything else is a finding."""
    form = read(text)
    program, checker = build(text, [form], names)
    advice = _Advice(text, names.vocabulary, checker.findings)
    advice.on(program, checker)
    sound = None if checker.findings.counts["error"] else program
    return Checked(text, checker.findings, sound, program.cost, names.vocabulary)


def units_in(program: Entered) -> Callable[[Part], str]:
    """Gives the unit in which people read the value of a part of this program: beside what it is compared with."""
    advice = _Advice(program.text, program.vocabulary, Findings(program.text))
    advice.dimension(program.root)
    beside: dict[Part, str] = {}
    for part in walk(program.root):
        if part.op == "pure" and part.name in COMPARING:
            units = compared_units(part.parts, [advice.unit(each) for each in part.parts], advice.dimensions.get)
            beside.update(zip(part.parts, units, strict=True))
    return lambda part: beside[part] if part in beside else advice.unit(part)


_UNITS: WeakKeyDictionary[Entered, str] = WeakKeyDictionary()


def unit_of_program(program: Entered) -> str:
    """The unit in which people read the value of a program; it is known for as long as there is the program, since the
    same ones are asked again and again."""
    unit = _UNITS.get(program)
    if unit is None:
        unit = _UNITS[program] = units_in(program)(program.root)
    return unit


class _Advice:
    """One pass over the parts, from the inside out, carrying dimensions; None is a dimension that anything fits."""

    def __init__(self, text: str, vocabulary: Vocabulary, findings: Findings) -> None:
        self.text, self.vocabulary, self.findings = text, vocabulary, findings
        self.dimensions: dict[Part, Dimension | None] = {}

    def on(self, program: Program, checker: Checker) -> None:
        confirmed = [(each.start, each.end) for each in self.findings.kept if each.confirm]
        wrong = self.findings.counts["error"] > 0  # what is mended first
        for tree in (program.root, *checker.stored_parts):
            self.dimension(tree)
            for form, message in () if wrong else doubts(tree, self.text, self.dimensions.__getitem__):
                if not any(start <= form.start < end for start, end in confirmed):
                    self.findings.note("warning", message, form.start, form.end, confirm=True)

    def brief(self, form: Form) -> str:
        return brief(form, self.text)

    def warn(self, message: str, form: Form) -> None:
        self.findings.note("warning", message, form.start, form.end)

    def unit(self, part: Part) -> str:
        """The unit in which people read the value of a part that was looked at."""
        return unit_to_read(part, self.dimensions.get, self.vocabulary)

    def dimension(self, part: Part) -> Dimension | None:
        """The dimension of `part`'s value; what is doubtful inside it is noted on the way."""
        dimension = self.dimensions[part] = self._dimension(part, [self.dimension(p) for p in part.parts])
        return dimension

    def _dimension(self, part: Part, inside: list[Dimension | None]) -> Dimension | None:
        if part.op == "const":
            if isinstance(part.form, Number):
                return part.form.dimension
            constant = self.vocabulary.bindings.get(part.name)
            return constant.dimension if isinstance(constant, Constant) else None
        if part.op in ("var", "linked"):
            return dimension_of(part.data.quantity.unit) if isinstance(part.data, Variable) else None
        if part.op == "pure":
            return self._pure(part, inside)
        if part.op == "host":
            return self._host(part, inside)
        if part.op == "call":
            return LENGTH if isinstance(part.form, List) and part.form.head == "to-edge" else None
        if part.op in ("random", "gauss"):
            return self._same(part, inside)
        if part.op in ("over", "each"):
            return self._around(part, inside)
        if part.op == "write" and isinstance(part.data, Variable):
            wanted = dimension_of(part.data.quantity.unit)
            if inside[0] is not None and inside[0] != wanted:
                self.warn(f"{part.data.name} is {wanted}, but {inside[0]} is assigned to it @@", part.form)
            self._assigned_range(part)
            return wanted
        if part.op == "if":
            self._may_be_unknown(part)
            branches = zip(inside[1:], part.parts[1:], strict=True)
            dimensions = {dimension for dimension, each in branches if dimension is not None or each.op != "const"}
            return dimensions.pop() if len(dimensions) == 1 else None
        if part.op in ("set_user", "set_local", "progn", "let", "clause"):
            return inside[-1] if inside else None
        return None

    def _same(self, part: Part, inside: list[Dimension | None]) -> Dimension | None:
        """All parts of one dimension: it, or a warning at the first that differs."""
        common: Dimension | None = None
        for dimension, operand in zip(inside, part.parts, strict=True):
            if dimension is None:
                continue
            if common is not None and dimension != common:
                where = part.name or part.op.upper()
                self.warn(
                    f"{self.brief(operand.form)} @@ is {dimension}, but the rest of {where} is {common}", operand.form
                )
                return None
            common = dimension
        return common

    def _pure(self, part: Part, inside: list[Dimension | None]) -> Dimension | None:
        rule = part.function.rule
        if part.name in ("/", "MOD"):
            self._divisor(part)
        if rule in ("same", "ratio", "compare"):
            common = self._same(part, inside)
            if rule == "compare":
                self._range(part)
            return common if rule == "same" else NONE
        if rule == "truth":
            if part.name == "NOT" and part.parts[0].op == "in":
                self.warn(f"{self.brief(part.form)} @@ is also true for robots not told about the group", part.form)
            return NONE
        if rule == "product":
            return _combine(inside, 1)
        if rule == "quotient":
            return _combine(inside, -1)
        if rule == "power":
            return self._power(part, inside)
        if rule == "root":
            base = inside[0]
            return Dimension(*(n // 2 for n in base)) if base and not any(n % 2 for n in base) else base and None
        for dimension, operand in zip(inside, part.parts, strict=True):
            if dimension not in (None, NONE):
                self.warn(
                    f"{self.brief(operand.form)} @@ is {dimension}, but {part.name} wants a plain number",
                    operand.form,
                )
        return NONE

    def _divisor(self, part: Part) -> None:
        """Warn of a division that is by zero whatever robots know."""
        divisors = part.parts[1:] if len(part.parts) > 1 else part.parts
        zero = next((divisor for divisor in divisors if _constant(divisor) == 0.0), None)
        if zero is not None:
            self.warn(f"{self.brief(part.form)} @@ divides by zero, which is a fault", zero.form)

    def _power(self, part: Part, inside: list[Dimension | None]) -> Dimension | None:
        base, exponent = inside[0], part.parts[1]
        if base in (None, NONE):
            return base
        if exponent.op == "const" and float(exponent.number).is_integer():
            return Dimension(*(n * int(exponent.number) for n in base))
        return None

    def _host(self, part: Part, inside: list[Dimension | None]) -> Dimension | None:
        function: HostFunction = host_of(part)
        for wanted, given, operand in zip(function.dimensions, inside, part.parts, strict=False):
            if wanted is not None and given is not None and given != wanted:
                self.warn(f"{self.brief(operand.form)} @@ is {given}, but {function.name} wants {wanted}", operand.form)
        return function.result

    def _around(self, part: Part, inside: list[Dimension | None]) -> Dimension | None:
        """Of what goes through neighbours: the dimension of what is made of them, if it is not a number of its own."""
        radius = inside[0]
        if radius not in (None, LENGTH):
            where = self.brief(part.parts[0].form)
            self.warn(f"{where} @@ is {radius}, but the radius of {part.name} is {LENGTH}", part.parts[0].form)
        return inside[-1] if WORDS[part.name.casefold()].rule == "same" else NONE

    # ---- declared ranges

    def _range(self, part: Part) -> None:
        """Warn of a comparison, or a pair in a chain of them, that the declared range of a variable decides."""
        for left, right in pairwise(part.parts):
            name = part.name
            if left.op == "const":
                left, right, name = right, left, _TURNED.get(name, name)
            if right.op != "const" or not isinstance(left.data, Variable):
                continue
            low, high, limit = left.data.quantity.low, left.data.quantity.high, right.number
            always, never = {
                "<": (high < limit, low >= limit),
                "<=": (high <= limit, low > limit),
                ">": (low > limit, high <= limit),
                ">=": (low >= limit, high < limit),
                "/=": (limit < low or limit > high, False),
            }.get(name, (False, limit < low or limit > high))
            if never or (always and len(part.parts) == 2):
                runs = _runs(left.data.quantity) + _range_hint(left.data.quantity, right)
                self.warn(f"{self.brief(part.form)} @@ is {'never' if never else 'always'} true: {runs}", part.form)

    def _assigned_range(self, part: Part) -> None:
        value = part.parts[0]
        if value.op != "const" or not isinstance(part.data, Variable):
            return
        quantity = part.data.quantity
        if value.number < quantity.low or value.number > quantity.high:
            self.warn(f"{self.brief(value.form)} @@ is out of range: {_runs(quantity)}", value.form)

    # ---- unknown

    def _may_be_unknown(self, part: Part) -> None:
        if len(part.parts) < 3:
            return
        for inside in walk(part.parts[0]):
            perishable = isinstance(inside.data, Variable) and inside.data.quantity.freshness < inf
            if inside.op == "absent" or (inside.op in ("var", "linked") and perishable):
                self.warn(f"if {self.brief(inside.form)} @@ is unknown, the else branch runs", inside.form)
                return


def _constant(part: Part) -> float | None:
    """The value of a part that is made of numbers alone; None for any other, and where that is a fault."""
    if part.op == "const":
        return part.number
    if part.op != "pure" or part.function.compute is None:
        return None
    values = [_constant(inside) for inside in part.parts]
    try:
        return part.function.compute([value for value in values if value is not None]) if None not in values else None
    except (ArithmeticError, ValueError):
        return None


def _combine(inside: list[Dimension | None], sign: int) -> Dimension | None:
    """The product of dimensions (sign 1), or the first by the rest (sign -1); a bare number counts as plain."""
    if all(dimension is None for dimension in inside):
        return None
    total = [0] * len(LENGTH)
    for i, dimension in enumerate(inside):
        turn = sign if i or (len(inside) == 1 and sign < 0) else 1
        for k, exponent in enumerate(dimension or NONE):
            total[k] += turn * exponent
    return Dimension(*total)


_TURNED = {"<": ">", ">": "<", "<=": ">=", ">=": "<="}
"""The same comparison with its operands exchanged."""


def _runs(quantity: Quantity) -> str:
    """Where a variable lies, as declared: `fuel runs from 0 % to 100 %`."""
    low, high = (value_in_words(end, quantity.shown_unit) for end in (quantity.low, quantity.high))
    if isfinite(quantity.low) and isfinite(quantity.high):
        return f"{quantity.name} runs from {low} to {high}"
    if isfinite(quantity.low):
        return f"{quantity.name} is never below {low}"
    return f"{quantity.name} is never above {high}"


def _range_hint(quantity: Quantity, limit: Part) -> str:
    """` (did you mean 50%?)` where the same digits in the variable's own unit would lie in its range."""
    unit = quantity.shown_unit
    if not unit or not isinstance(limit.form, Number) or limit.form.unit:
        return ""
    meant = to_si(limit.number, unit)
    inside = quantity.low <= meant <= quantity.high and meant != limit.number
    return f" (did you mean {limit.form.text}{unit}?)" if inside else ""


# ---- what runs, but probably not as it was meant

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
        case "each":
            yield from _lost(part.parts[-1].parts, text)
        case "over" if part.name == "COUNT-OVER":
            yield from _test(part.parts[-1].parts[0], text, dimension)
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
    measured = dimension(part)
    if measured not in (None, NONE):
        test = brief(part.form, text)
        yield part.form, f"{test} @@ is {measured}: as a test it is true unless it is 0 (did you mean (< {test} ...)?)"


def _exactly(part: Part, text: str) -> Iterator[tuple[Form, str]]:
    """What is measured is hardly ever exactly something; but a tank may be empty, and a robot stand."""
    if any(operand.op == "const" and not operand.number for operand in part.parts):
        return
    units = any(isinstance(operand.form, Number) and operand.form.unit for operand in part.parts)
    for operand in part.parts:
        data = operand.data
        if (
            isinstance(data, Variable)
            and data.kind is VariableKind.SENSOR
            and (units or dimension_of(data.quantity.unit) != NONE)
        ):
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
