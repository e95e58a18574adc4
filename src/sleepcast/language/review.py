"""Checking a text before it is sent: the checker's errors, and advice on what is probably not meant.

The advice is about dimensions (5 s compared with a length), declared ranges (fuel runs from 0 to 1, so `(> fuel 50)`
never holds) and the places where failing closed has an edge (an IF whose test is unknown runs its else).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import inf, isfinite

from sleepcast.core.units import LENGTH, NONE, Dimension, Quantity, shown, to_si
from sleepcast.language.checker import Checker, CheckError, Finding, Findings
from sleepcast.language.doubts import doubts
from sleepcast.language.form import Form, Number
from sleepcast.language.infix import brief
from sleepcast.language.machine import Program, build
from sleepcast.language.names import Names
from sleepcast.language.parts import Part, host_of, walk
from sleepcast.language.reader import read
from sleepcast.language.vocabulary import Constant, HostFunction, Variable


@dataclass(frozen=True, slots=True)
class Checked:
    """A text that was checked. found: what is wrong or doubtful in it. program: None if there is any error. cost: its
    static bound in steps."""

    text: str
    found: Findings
    program: Program | None
    cost: int

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
            raise CheckError(self.errors, self.text, self.counts["error"] - len(self.errors))
        return self.program


def check(text: str, names: Names) -> Checked:
    """Read and check one expression. Raises ReadError for text that cannot be read; everything else is a finding."""
    form = read(text)
    program, checker = build(text, [form], names)
    _Advice(text, names, checker.findings).on(program, checker)
    return Checked(text, checker.findings, None if checker.findings.counts["error"] else program, program.cost)


class _Advice:
    """One pass over the parts, from the inside out, carrying dimensions; None is a dimension that anything fits."""

    def __init__(self, text: str, names: Names, findings: Findings) -> None:
        self.text, self.names, self.findings = text, names, findings
        self.dimensions: dict[Part, Dimension | None] = {}

    def on(self, program: Program, checker: Checker) -> None:
        said = [(found.start, found.end) for found in self.findings.kept if found.confirm]
        wrong = self.findings.counts["error"] > 0  # what is mended first
        for tree in (program.root, *checker.kept):
            self.dimension(tree)
            for form, message in () if wrong else doubts(tree, self.text, self.dimensions.__getitem__):
                if not any(start <= form.start < end for start, end in said):
                    self.findings.note("warning", message, form.start, form.end, confirm=True)

    def brief(self, form: Form) -> str:
        return brief(form, self.text)

    def warn(self, message: str, form: Form) -> None:
        self.findings.note("warning", message, form.start, form.end)

    def dimension(self, part: Part) -> Dimension | None:
        """The dimension of `part`'s value; what is doubtful inside it is noted on the way."""
        found = self.dimensions[part] = self._dimension(part, [self.dimension(p) for p in part.parts])
        return found

    def _dimension(self, part: Part, inside: list[Dimension | None]) -> Dimension | None:
        if part.op == "const":
            return part.form.dimension if isinstance(part.form, Number) else self._constant(part)
        if part.op in ("var", "linked"):
            return part.data.quantity.dimension if isinstance(part.data, Variable) else None
        if part.op == "pure":
            return self._pure(part, inside)
        if part.op == "host":
            return self._host(part, inside)
        if part.op in ("random", "gauss"):
            return self._same(part, inside)
        if part.op == "write" and isinstance(part.data, Variable):
            wanted = part.data.quantity.dimension
            if inside[0] is not None and inside[0] != wanted:
                self.warn(f"{part.data.name} is {wanted}, but {inside[0]} is assigned to it @@", part.form)
            self._assigned_range(part)
            return wanted
        if part.op == "if":
            self._may_be_unknown(part)
        if part.op in ("set_user", "set_local", "progn", "if", "let"):
            return inside[-1] if inside else None
        return None

    def _constant(self, part: Part) -> Dimension | None:
        found = self.names.vocabulary.bindings.get(part.name)
        return found.dimension if isinstance(found, Constant) else None

    def _same(self, part: Part, inside: list[Dimension | None]) -> Dimension | None:
        """All parts of one dimension: it, or a warning at the first that differs."""
        found: Dimension | None = None
        for dimension, operand in zip(inside, part.parts, strict=True):
            if dimension is None:
                continue
            if found is not None and dimension != found:
                where = part.name or part.op.upper()
                self.warn(
                    f"{self.brief(operand.form)} @@ is {dimension}, but the rest of {where} is {found}", operand.form
                )
                return None
            found = dimension
        return found

    def _pure(self, part: Part, inside: list[Dimension | None]) -> Dimension | None:
        rule = part.function.rule
        if rule in ("same", "ratio", "compare"):
            found = self._same(part, inside)
            if rule == "compare":
                self._range(part)
            return found if rule == "same" else NONE
        if rule == "truth":
            if part.name == "NOT" and part.parts[0].op == "in":
                self.warn(f"{self.brief(part.form)} @@ also holds on a robot that never heard of the group", part.form)
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

    def _power(self, part: Part, inside: list[Dimension | None]) -> Dimension | None:
        base, exponent = inside[0], part.parts[1]
        if base in (None, NONE):
            return base
        if exponent.op == "const" and float(exponent.number).is_integer():
            return Dimension(*(n * int(exponent.number) for n in base))
        return None

    def _host(self, part: Part, inside: list[Dimension | None]) -> Dimension | None:
        function: HostFunction = host_of(part)
        for wanted, found, operand in zip(function.dimensions, inside, part.parts, strict=False):
            if wanted is not None and found is not None and found != wanted:
                self.warn(f"{self.brief(operand.form)} @@ is {found}, but {function.name} wants {wanted}", operand.form)
        return function.result

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
    unit = quantity.shown_as or quantity.unit
    if isfinite(quantity.low) and isfinite(quantity.high):
        return f"{quantity.name} runs from {shown(quantity.low, unit)} to {shown(quantity.high, unit)}"
    if isfinite(quantity.low):
        return f"{quantity.name} is never below {shown(quantity.low, unit)}"
    return f"{quantity.name} is never above {shown(quantity.high, unit)}"


def _range_hint(quantity: Quantity, limit: Part) -> str:
    """` (did you mean 50%?)` where the same digits in the variable's own unit would lie in its range."""
    unit = quantity.shown_as or quantity.unit
    if not unit or not isinstance(limit.form, Number) or limit.form.unit:
        return ""
    meant = to_si(limit.number, unit)
    inside = quantity.low <= meant <= quantity.high and meant != limit.number
    return f" (did you mean {limit.form.text}{unit}?)" if inside else ""
