"""The standard dialect at the command line: the mind of one robot without a body, to type expressions into."""

from __future__ import annotations

from collections.abc import Iterator
from math import isnan

from sleepcast.channel import Kind
from sleepcast.cli.memories import EVALUATED, REFUSED, UNKNOWN, UNREADABLE, EvalOutcome
from sleepcast.cli.streams import pieces
from sleepcast.core.errors import MisuseError, and_more
from sleepcast.core.neighbours import ALONE
from sleepcast.language import (
    Checked,
    CheckError,
    Constant,
    Finding,
    Number,
    ReadError,
    Symbol,
    Variable,
    VariableKind,
    Vocabulary,
    check,
    format_value,
    read,
    read_all,
)
from sleepcast.language.checker import Findings
from sleepcast.language.functions import FUNCTIONS
from sleepcast.language.parts import Part, walk
from sleepcast.language.reader import is_name
from sleepcast.language.reading_units import report_in_words
from sleepcast.language.vocabulary import buffer_number, describe
from sleepcast.mind.views import Result
from sleepcast.node.node import Node

NAME = "here"
"""What the one robot is called."""


class StandardMemory:
    """One mind whose only variables are the support ones and those that are made. explain: say how values came."""

    def __init__(self, *, seed: int = 0, explain: bool = False) -> None:
        self.node = Node(NAME, Vocabulary(NAME, functions=(ALONE,)), seed=seed)
        self._explain = explain

    def set(self, name: str, value: str) -> None:
        """Give a support variable or a user variable, which is made if need be, a number (perhaps with a unit) or a
        constant. Raises MisuseError."""
        setting = f"--set {name}={value}"
        if not is_name(name):
            raise MisuseError(f'{setting}: "{name}" is no name')
        try:
            form = read(value)
        except ReadError as error:
            raise MisuseError(f"{setting}: {error}") from error
        bindings = self.node.vocabulary.bindings
        known = isinstance(form, Symbol) and isinstance(bindings.get(form.key), Constant)
        if not (known or isinstance(form, Number)):
            raise MisuseError(f"{setting}: the value must be a number, perhaps with a unit, such as 80% or 5mi")
        taken = self._taken(name.casefold())
        if taken:
            raise MisuseError(f"{setting}: {name} is a {taken}, and only variables can be set")
        make = "" if name.casefold() in bindings else f"(DEFVAR {name}) "
        try:
            self.node.evaluate(f"(PROGN {make}(SETQ {name} {value}))")
        except CheckError as error:
            raise MisuseError(f"{setting}: {error.findings[0].message}") from error

    def _taken(self, key: str) -> str:
        """What a name is if it can be no variable to set, else an empty text."""
        if buffer_number(key) is not None:
            return "buffer"
        if key in FUNCTIONS:
            return "function"
        binding = self.node.vocabulary.bindings.get(key)
        settable = binding is None or (isinstance(binding, Variable) and binding.kind is VariableKind.SUPPORT)
        return "" if settable or binding is None else describe(binding)

    def evaluate(self, text: str) -> EvalOutcome:
        """Evaluate one expression."""
        try:
            checked = check(text, self.node)
        except ReadError as error:
            return unreadable(text, str(error))
        if checked.program is None:
            return _refused(checked)
        self._doubt_shares(checked.program.root, checked.found)
        return self._outcome(checked, self.node.run(checked))

    def _doubt_shares(self, root: Part, findings: Findings) -> None:
        """Warn of every variable that is compared with a share and is far above one: here nothing declares that a
        tank holds at most 100 %."""
        for part in walk(root):
            if part.op != "pure" or part.function.rule != "compare":
                continue
            numbers = [p.form for p in part.parts if isinstance(p.form, Number)]
            shares = [number.text for number in numbers if number.unit == "%" and number.value <= 1.0]
            for p in part.parts if shares else ():
                value = self.node.values[p.slot] if p.op == "var" else 0.0
                if value > 1.0:
                    written = format_value(value)
                    meant = f" (did you mean {written}%?)" if value <= 100.0 else ""
                    message = f"{p.name} @@ is {written}, and {shares[0]} is a share: they run from 0 to 1{meant}"
                    findings.note("warning", message, p.form.start, p.form.end)

    def run(self, text: str) -> Iterator[EvalOutcome]:
        """Evaluate all expressions of a text, up to one that cannot be read."""
        for line, piece in pieces(text):
            try:
                forms = read_all(piece)
            except ReadError as error:
                yield unreadable(piece, f"in what begins on line {line} of the input: {error}")
                return
            for form in forms:
                yield self.evaluate(piece[form.start : form.end])

    def take_tells(self) -> list[str]:
        """What the mind wanted to tell other robots since the last call; here there is nobody to hear it."""
        tells = [message.text for message in self.node.outbox if message.kind is Kind.COMMAND]
        self.node.outbox.clear()
        self.node.pings.clear()
        return tells

    def _outcome(self, checked: Checked, result: Result) -> EvalOutcome:
        messages = [_line(finding, checked.text) for finding in checked.warnings]
        messages += [report_in_words(label, values) for label, values in result.printed]
        tells = self.take_tells()
        messages += [f"told to other robots: {text}" for text in tells]
        messages += [f"fault: {fault}" for fault in result.faults]
        status = REFUSED if result.faults else EVALUATED
        details = {
            **_details(checked.text, None if isnan(result.value) else result.value, status),
            "matched": result.matched,
            "warnings": [_finding(finding) for finding in checked.warnings],
            "faults": [str(fault) for fault in result.faults],
            "printed": [
                {"label": label, "values": [None if isnan(v) else v for v in values]}
                for label, values in result.printed
            ],
            "told": tells,
            "cost": result.cost,
            "steps": result.steps,
        }
        if self._explain:
            explanation = result.explanation
            details["explanation"] = explanation.to_dict()
            messages.append(explanation.render())
        return EvalOutcome(format_value(result.value), status, tuple(messages), details)


def unreadable(text: str, error: str) -> EvalOutcome:
    """The outcome of a text that cannot be read."""
    details = {**_details(text, None, UNREADABLE), "error": error}
    return EvalOutcome(UNKNOWN, UNREADABLE, (f"error: {error}",), details)


def _refused(checked: Checked) -> EvalOutcome:
    messages = (*(_line(finding, checked.text) for finding in checked.findings), *and_more(checked.more))
    details = {
        **_details(checked.text, None, REFUSED),
        "errors": [_finding(finding) for finding in checked.errors],
        "warnings": [_finding(finding) for finding in checked.warnings],
    }
    return EvalOutcome(UNKNOWN, REFUSED, messages, details)


def _details(text: str, value: float | None, status: int) -> dict[str, object]:
    return {"text": text, "value": value, "status": status}


def _finding(finding: Finding) -> dict[str, object]:
    return {"message": finding.message, "start": finding.start, "end": finding.end}


def _line(finding: Finding, text: str) -> str:
    return f"{finding.severity}: {finding.render(text)}"
