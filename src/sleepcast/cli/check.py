"""`sleepcast check`: errors and warnings in expressions, before they are sent."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from sleepcast.cli.options import NegativeNumbersAllowed
from sleepcast.cli.streams import InputError, pieces, put, read_file, read_standard_input
from sleepcast.core.errors import MisuseError, and_more, counted, in_file
from sleepcast.core.records import dataclass

if TYPE_CHECKING:
    from sleepcast.language import Finding, ReadError
    from sleepcast.language.learned_names import LearnedNames

FAILED = 2
"""The exit status if something must not be sent."""
ENDINGS = frozenset({".sleep", ".cases", ".txt", ".lisp"})
"""Endings by which an argument is taken for the name of a file, even if there is no such file."""


@dataclass(frozen=True, slots=True)
class Expression:
    """One text to check. place: its file and line, "" for one that was typed."""

    place: str
    text: str


@dataclass(frozen=True, slots=True)
class Review:
    """One checked expression.

    findings: the first of them.
    cost: its static bound in steps, None if it cannot be read.
    counts: of all findings, by severity.
    """

    expression: Expression
    findings: tuple[Finding, ...]
    cost: int | None
    counts: Mapping[str, int]


@click.command("check", cls=NegativeNumbersAllowed)
@click.argument("sources", metavar="TEXT|FILE|-...", nargs=-1, required=True)
@click.option("--scenario", metavar="NAME", help="Check against the names that the robots of this scenario know.")
@click.option("--strict", is_flag=True, help="Treat warnings as errors.")
@click.option("--sentence", is_flag=True, help="Translate English sentences into expressions, and expressions back.")
@click.option(
    "--from", "notation", type=click.Choice(["hoskins"]), help="Translate behaviours in Hoskins' notation into rules."
)
@click.option("--json", "as_json", is_flag=True, help="Print the findings as one JSON object.")
def check(
    sources: tuple[str, ...], scenario: str | None, strict: bool, sentence: bool, notation: str | None, as_json: bool
) -> int:
    """Check expressions without evaluating them: print every finding with its place, and the cost in steps.

    A source is an expression, a file of expressions, a mission script (.sleep), a file of cases (.cases), or - for
    standard input. What one expression declares, the next ones may use. The exit status is 2 if there is an error.

    \b
    Examples:
      sleepcast check '(COND ((< SONR3 10in) (ST)))'
      sleepcast check --scenario bravo '(WHEN (> fule 50%) (JOIN bravo))'
      sleepcast check --strict mission.sleep
      sleepcast check --scenario bravo --sentence 'scouts within 5 miles of X join bravo'
      sleepcast check --from hoskins '4: ((F, S, *, *), PING, 0.9)'
    """
    if notation:
        if scenario or strict or sentence:
            raise MisuseError("--from only translates: check the rules that it prints, with --scenario or --strict")
        return FAILED if _translate_behaviours(map(_whole, sources), as_json) else 0
    if sentence:
        from sleepcast.cli.sentences import translate

        return FAILED if translate(sources, scenario, as_json) else 0
    names = _names(scenario)
    reviews = [_review(each, names) for source in sources for each in _expressions(source)]
    errors, warnings = (sum(review.counts.get(severity, 0) for review in reviews) for severity in ("error", "warning"))
    if as_json:
        put(json.dumps({"expressions": list(map(_as_dict, reviews)), "errors": errors, "warnings": warnings}))
    else:
        for review in reviews:
            _print(review)
        put(_summary(reviews, errors, warnings))
    return FAILED if errors or (strict and warnings) else 0


def _names(scenario: str | None) -> LearnedNames:
    from sleepcast.language import Vocabulary
    from sleepcast.language.learned_names import LearnedNames

    if scenario is None:
        return LearnedNames(Vocabulary())
    from sleepcast.loop import vocabulary_of
    from sleepcast.simulator import Simulator, find_scenario

    return LearnedNames(vocabulary_of(Simulator(find_scenario(scenario)).model))


# ---- sources


def _expressions(source: str) -> Iterator[Expression]:
    if source == "-":
        yield from _plain(read_standard_input(), "standard input")
    elif not _is_file(source):
        yield Expression("", source.strip())
    elif source.endswith(".sleep"):
        yield from _mission(source)
    elif source.endswith(".cases"):
        yield from _cases(read_file(Path(source)), source)
    else:
        yield from _plain(read_file(Path(source)), source)


def _whole(source: str) -> tuple[str, str]:
    """The name of a source, "" for one that was typed, and all its text."""
    if source == "-":
        return "standard input", read_standard_input()
    return (source, read_file(Path(source))) if _is_file(source) else ("", source.strip())


def _is_file(source: str) -> bool:
    """Whether an argument names a file: there is one, or it looks like a file's name and like no expression."""
    if source.lstrip()[:1] in ("(", "'", "`", ";", ""):
        return False
    try:
        return Path(source).exists() or Path(source).suffix in ENDINGS
    except (OSError, ValueError):
        return False


def _plain(text: str, name: str) -> Iterator[Expression]:
    """Every expression of a text; a piece that cannot be read is yielded whole, and its finding will say why."""
    from sleepcast.language import ReadError, read_all

    for line, piece in pieces(text):
        try:
            forms = read_all(piece)
        except ReadError:
            yield Expression(f"{name}:{line}", piece)
            continue
        for form in forms:
            yield Expression(f"{name}:{line + piece.count(chr(10), 0, form.start)}", piece[form.start : form.end])


def _mission(source: str) -> Iterator[Expression]:
    from sleepcast.simulator.scenario.mission import instruction, parse_mission

    for order in parse_mission(read_file(Path(source)), source):
        if text := instruction(order).text:
            yield Expression(order.place, text)


_NO_CASE = re.compile(r"\s*(#|---|:|$)")


def _cases(text: str, name: str) -> Iterator[Expression]:
    """The expressions of a file of cases: what stands before ` => `, over lines that go on with a blank."""
    waiting: list[str] = []
    first = 1
    for number, line in enumerate([*text.split("\n"), ""], start=1):
        if waiting and line[:1].isspace() and line.strip():
            waiting.append(line)
            continue
        if waiting:
            case, arrow, _ = "\n".join(waiting).partition(" => ")
            if not arrow:
                raise InputError(f"{name}:{first}: wanted EXPRESSION => VALUE, not {waiting[0].strip()[:40]}")
            yield Expression(f"{name}:{first}", case.strip())
        waiting, first = [] if _NO_CASE.match(line) else [line], number


# ---- Hoskins' behaviours


def _translate_behaviours(texts: Iterable[tuple[str, str]], as_json: bool) -> int:
    """Print the rules of all texts, each with its place ("" where it was typed); gives how many are not understood."""
    from sleepcast.language import ReadError
    from sleepcast.language.behaviours import Behaviour, behaviours, rules

    parsed: list[Behaviour] = []
    unclear: list[tuple[str, ReadError]] = []
    for place, text in texts:
        try:
            parsed += behaviours(text)
        except ReadError as refused:
            unclear.append((place, refused))
    made = rules(parsed)
    if as_json:
        put(
            json.dumps(
                {
                    "rules": made,
                    "unclear": [
                        {"place": place, "start": error.start, "end": error.end, "message": error.reason}
                        for place, error in unclear
                    ],
                }
            )
        )
        return len(unclear)
    for rule in made:
        put(rule)
    for place, error in unclear:
        put(in_file(f"{place}:1", str(error)) if place else f"not understood: {error}")
    return len(unclear)


# ---- reviewing


def _review(expression: Expression, names: LearnedNames) -> Review:
    from sleepcast.language import Finding, ReadError
    from sleepcast.language import check as check_text

    try:
        checked = check_text(expression.text, names)
    except ReadError as error:
        return Review(expression, (Finding("error", error.reason, error.start, error.end),), None, {"error": 1})
    if checked.program is not None:
        names.learn(checked.program.form)
    return Review(expression, checked.findings, checked.cost, checked.counts)


def _print(review: Review) -> None:
    place = review.expression.place
    for finding in review.findings:
        sentence = f"{finding.severity}: {finding.render(review.expression.text)}"
        put(in_file(place, sentence) if place else sentence)
    for line in and_more(sum(review.counts.values()) - len(review.findings)):
        put(f"{place}: {line}" if place else line)


def _summary(reviews: list[Review], errors: int, warnings: int) -> str:
    costs = [review.cost for review in reviews if review.cost is not None]
    problems = f"{counted(errors, 'error')}, {counted(warnings, 'warning')}"
    if not costs:
        return f"{counted(len(reviews), 'expression')}; {problems}"
    each = " each" if len(reviews) > 1 else ""
    return f"{counted(len(reviews), 'expression')}, at most {counted(max(costs), 'step')}{each}; {problems}"


def _as_dict(review: Review) -> dict[str, object]:
    from sleepcast.core.errors import line_and_column

    findings = []
    for finding in review.findings:
        line, column = line_and_column(review.expression.text, finding.start)
        findings.append(
            {
                "severity": finding.severity,
                "message": finding.message,
                "line": line,
                "column": column,
                "start": finding.start,
                "end": finding.end,
            }
        )
    expression = review.expression
    return {"place": expression.place, "text": expression.text, "cost": review.cost, "findings": findings}
