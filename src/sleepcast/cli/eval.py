"""`sleepcast eval`: expressions in, one value a line out, all in one memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

import click

from sleepcast.cli.memories import UNREADABLE, EvalOutcome, TypedMemory
from sleepcast.cli.options import SEED, NegativeNumbersAllowed
from sleepcast.cli.streams import complain, put, read_standard_input
from sleepcast.core.errors import MisuseError

Dialect = Literal["standard", "classic", "faithful", "appendix-a"]


@click.command("eval", cls=NegativeNumbersAllowed)
@click.argument("expressions", metavar="EXPR...", nargs=-1, required=True)
@click.option(
    "--dialect",
    type=click.Choice(["standard", "classic", "faithful", "appendix-a"]),
    default="standard",
    show_default=True,
    help="Classic is the original program with its bugs fixed, faithful is the original as it was, "
    "appendix-a the thesis's other listing, where SETQ does not set.",
)
@click.option("--set", "settings", metavar="NAME=VALUE", multiple=True, help="Set a variable first.")
@click.option("--seed", type=SEED, default=0, show_default=True, help="Random seed (for PROB, DICE, ...).")
@click.option("--explain", is_flag=True, help="Explain on standard error how each value was computed.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object for each expression instead.")
def evaluate(
    expressions: tuple[str, ...], dialect: Dialect, settings: tuple[str, ...], seed: int, explain: bool, as_json: bool
) -> int:
    """Evaluate each EXPR, all in one memory, and print one value a line.

    `-` reads expressions from standard input; in the classic dialects they may end with @ and the whole with $.
    Warnings, faults and what PRINT and REPORT say go to standard error, and nothing is printed for what is no
    expression. The exit status is 0 if everything was evaluated (to UNKNOWN, too), 1 if something was refused or
    faulted, 2 if something could not be read.

    \b
    Examples:
      sleepcast eval '(+ 1 2)'
      sleepcast eval --set fuel=80% --explain '(AND (> fuel 50%) (> ordnance 70%))'
      sleepcast eval --dialect classic '(SETQQ E2 (+ V0 V1))' E2
    """
    memory = _memory(dialect, seed, explain)
    for setting in settings:
        name, equals, value = setting.strip().partition("=")
        if not equals:
            raise MisuseError(f"--set {setting}: wanted NAME=VALUE, for example --set fuel=80%")
        memory.set(name.strip(), value.strip())
    worst = 0
    for outcome in _outcomes(memory, expressions):
        if as_json or outcome.status != UNREADABLE:  # which has no value
            put(outcome.to_json() if as_json else outcome.value)
        for line in outcome.messages:
            complain(line)
        worst = max(worst, outcome.status)
    return worst


def _outcomes(memory: TypedMemory, expressions: Sequence[str]) -> Iterator[EvalOutcome]:
    for text in expressions:
        if text == "-":
            yield from memory.run(read_standard_input())
        else:
            yield memory.evaluate(text.strip())


def _memory(dialect: Dialect, seed: int, explain: bool) -> TypedMemory:
    """The memory of a dialect; only its own modules are loaded."""
    if dialect == "standard":
        from sleepcast.cli.standard_memory import StandardMemory

        return StandardMemory(seed=seed, explain=explain)
    if explain:
        raise MisuseError(f"--explain needs the standard dialect; --dialect {dialect} says what the original said")
    from sleepcast.cli.classic_memory import ClassicMemory

    return ClassicMemory(dialect)
