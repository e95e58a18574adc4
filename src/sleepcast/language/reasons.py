"""Reasons: the first operand of a test that was not true, and how far it was from true."""

from __future__ import annotations

from math import nan

from sleepcast.core.units import shown
from sleepcast.language.form import List, Number, format_value, show
from sleepcast.language.machine import Program
from sleepcast.language.parts import Part, deciding
from sleepcast.language.tracer import Tracer
from sleepcast.language.vocabulary import Variable
from sleepcast.language.walker import is_true


def culprit(program: Program, tracer: Tracer) -> Part | None:
    """The first operand of the program's test that was not true: the smallest part that says why."""
    if program.test is None:
        return None
    part = deciding(program.root)
    if part is None or not part.parts:
        return None
    if part.op == "cond":
        return _narrow(part.parts[0].parts[0], tracer)
    return _narrow(part.parts[0] if part.op == "if" else part, tracer)


def _narrow(part: Part, tracer: Tracer) -> Part:
    """Inside an AND, its first operand that was evaluated and not true; and so on inwards."""
    while part.op == "and":
        failed = next((p for p in part.parts if p.index in tracer.found and not is_true(tracer.found[p.index])), None)
        if failed is None:
            break
        part = failed
    return part


def reason(program: Program, tracer: Tracer) -> str:
    """Why the program's test did not hold, in a sentence's half; "" if there is nothing to say."""
    part = culprit(program, tracer)
    if part is None:
        return ""
    if part.op == "call" and (inner := tracer.inner.get(part.index)) is not None:
        inside = shortfall(_narrow(inner.program.root, inner), inner)
        return f"{show(part.form)}: {inside}"
    return shortfall(part, tracer)


def shortfall(part: Part, tracer: Tracer) -> str:
    """How far `part` is from true, in a sentence's half: `fuel = 43.1 %, needed > 50 %`."""
    if part.op == "pure" and part.name in ("<", "<=", ">", ">=", "=", "EQ", "/=") and len(part.parts) == 2:
        left, right = part.parts
        if left.op == "const" and right.op != "const":
            left, right = right, left
            operator = {"<": ">", ">": "<", "<=": ">=", ">=": "<="}.get(part.name, part.name)
        else:
            operator = part.name
        unit = _unit(left, right)
        have, want = (tracer.found.get(p.index, nan) for p in (left, right))
        needed = shown(want, unit) if right.op == "const" else f"{show(right.form)} ({shown(want, unit)})"
        known = f"{show(left.form)} = {shown(have, unit)}" if have == have else f"{show(left.form)} is unknown"
        return f"{known}, needed {'=' if operator == 'EQ' else operator} {needed}"
    value = tracer.found.get(part.index, nan)
    if part.op == "in":
        return f"not a member of {show(part.form.items[1]) if isinstance(part.form, List) else part.name}"
    if part.op == "or":
        return f"none of {len(part.parts)} alternatives holds in {show(part.form)}"
    if value != value:
        return f"{show(part.form)} is unknown"
    return f"{show(part.form)} = {format_value(value)}, needed true"


def _unit(left: Part, right: Part) -> str:
    """The unit to show two compared values in: of the literal as it was written, else of the variable."""
    for part in (right, left):
        if isinstance(part.form, Number) and part.form.unit:
            return part.form.unit
    for part in (left, right):
        if isinstance(part.data, Variable):
            quantity = part.data.quantity
            return quantity.shown_as or quantity.unit
    return ""
