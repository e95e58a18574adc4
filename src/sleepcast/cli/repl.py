"""`sleepcast repl`: a conversation with one robot's mind.

A line that begins with `:` asks about the mind, everything else is evaluated in it. At a terminal the editor of
`prompt` reads the lines; from a pipe they are read as they come. Values go to standard output, the rest to standard
error, as with `eval`.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import click

from sleepcast.cli.options import SEED
from sleepcast.cli.streams import announce, complain, incoming_lines, still_open
from sleepcast.core.errors import MisuseError, SleepcastError, did_you_mean
from sleepcast.core.version import VERSION

if TYPE_CHECKING:
    from sleepcast.cli.standard_memory import StandardMemory

TICK_SECONDS = 0.1
"""Seconds that `:tick` lets pass for each tick."""
MAX_TICKS = 10_000
"""Ticks of one `:tick`, about a second of work with a few rules."""

_COMMENT = re.compile(r";[^\n]*")
WELCOME = f"sleepcast {VERSION}: type an expression, :help for help, :quit or Ctrl-D to leave"


@click.command("repl")
@click.option("--seed", type=SEED, default=0, show_default=True, help="Random seed (for PROB, DICE, ...).")
def repl(seed: int) -> int:
    """Type expressions and see their values, all in one memory; :help says what else can be asked.

    History and completion work at a terminal, Enter continues while a parenthesis is open. Lines from a pipe are
    answered as they come.

    \b
    Examples:
      sleepcast repl
      echo '(+ 1 2)' | sleepcast repl
    """
    from sleepcast.cli.standard_memory import StandardMemory

    memory = StandardMemory(seed=seed)
    conversation = Conversation(memory)
    if all(stream is not None and stream.isatty() for stream in (sys.stdin, sys.stdout)):
        from sleepcast.cli.prompt import typed_texts

        announce(WELCOME)
        texts = typed_texts(memory.node, [f":{name}" for name in ASKED])
    else:
        texts = _piped()
    for text in texts:
        if not conversation.answer(text):
            break
    return 0


def _piped() -> Iterator[str]:
    """Texts from standard input, each as soon as its parentheses are closed, or it is too long for any text."""
    from sleepcast.language.reader import MAX_TEXT

    waiting, depth = "", 0
    for line in incoming_lines():
        waiting += line
        depth += still_open(line)
        if depth <= 0 or waiting.startswith(":") or len(waiting) > MAX_TEXT:
            yield waiting
            waiting, depth = "", 0
    yield waiting


class Conversation:
    """What is answered to each text."""

    def __init__(self, memory: StandardMemory) -> None:
        self.memory, self.node = memory, memory.node
        self._tick = 0

    def answer(self, text: str) -> bool:
        """Answer one text; False if the person wants to leave."""
        text = text.strip()
        if text.startswith(":"):
            try:
                return self._asked(text)
            except SleepcastError as error:
                complain(str(error))
        elif _COMMENT.sub("", text).strip():
            outcome = self.memory.evaluate(text)
            announce(outcome.value)
            for line in outcome.messages:
                complain(line)
        return True

    def _asked(self, text: str) -> bool:
        name, _, rest = text[1:].partition(" ")
        if name in ("quit", "q", "exit"):
            return False
        if name not in ASKED:
            raise MisuseError(
                f"unknown question :{name}{did_you_mean(name, ASKED)}: there are {', '.join(f':{n}' for n in ASKED)}"
            )
        for line in ASKED[name](self, rest.strip()):
            announce(line)
        return True

    def why(self, about: str) -> Iterator[str]:
        yield self.node.why(about or None).render()

    def vars(self, _: str) -> Iterator[str]:
        from sleepcast.core.units import value_in_words
        from sleepcast.language.vocabulary import unit_of

        shown = [(name, value) for name, value in self.node.variables() if value or not name.startswith("active")]
        width = max(len(name) for name, _ in shown)
        vocabulary = self.node.vocabulary
        yield from (f"{name:<{width}}  {value_in_words(value, unit_of(name, vocabulary))}" for name, value in shown)
        if self.node.groups:
            yield f"in {', '.join(sorted(self.node.groups))}"

    def rules(self, _: str) -> Iterator[str]:
        from sleepcast.core.units import value_in_words

        rules = self.node.rules()
        if not rules:
            yield "no rules yet: store one with (RULE name expression)"
        for rule in rules:
            state = "active" if rule.active else "idle"
            state += f"  priority {rule.priority}" if rule.priority else ""
            last = value_in_words(rule.last_value, rule.unit)
            yield f"{rule.name}  {state}  last {last}  fired {rule.firings}  {rule.text}"
            if rule.last_fault:
                yield f"  fault: {rule.last_fault}"

    def tick(self, count: str) -> Iterator[str]:
        from sleepcast.channel import Kind
        from sleepcast.language.reading_units import report_in_words

        if count and not (count.isascii() and count.isdecimal() and 1 <= int(count[:9]) <= MAX_TICKS):
            raise MisuseError(f":tick takes a number from 1 to {MAX_TICKS}, not {count[:40]}")
        for _ in range(int(count or 1)):
            self._tick += 1
            self.node.think(self._tick, self._tick * TICK_SECONDS)
            reports = [message.body for message in self.node.outbox if message.kind is Kind.REPORT]
            yield from (report_in_words(body.get("label"), body.get("values")) for body in reports)
            yield from (f"told to other robots: {text}" for text in self.memory.take_tells())
        yield f"tick {self._tick}, {self._tick * TICK_SECONDS:g} s"

    def help(self, name: str) -> Iterator[str]:
        yield from _help_on(self.memory, name) if name else _OVERVIEW

    def quit(self, _: str) -> Iterator[str]:
        return iter(())


ASKED: dict[str, Callable[[Conversation, str], Iterator[str]]] = {
    "why": Conversation.why,
    "vars": Conversation.vars,
    "rules": Conversation.rules,
    "tick": Conversation.tick,
    "help": Conversation.help,
    "quit": Conversation.quit,
}
"""What can be asked, by the word behind the colon."""

_OVERVIEW = (
    "An expression is a number, a name or (function argument ...): try (+ 1 2), then (DEFVAR fuel 80%), then fuel",
    "  :why [RULE]    how the last value came about, or what a rule would do now",
    "  :vars          every variable with its value, and the groups",
    "  :rules         every stored expression",
    "  :tick [N]      let N ticks pass: active rules run in each",
    "  :help [NAME]   this, or what a function or variable is",
    "  :quit          leave (Ctrl-D as well)",
)


def _help_on(memory: StandardMemory, name: str) -> Iterator[str]:
    from sleepcast.language import HostFunction, Variable
    from sleepcast.language.functions import BUILT_IN, EXAMPLES
    from sleepcast.language.symbols import KIND_NAMES
    from sleepcast.language.vocabulary import describe

    name = name.strip("()")
    function = BUILT_IN.get(name.casefold())
    binding = memory.node.vocabulary.bindings.get(name.casefold())
    if function is not None:
        yield f"{function.usage}  {function.doc}"
        text, value = EXAMPLES[function.name]
        yield f"  {text} gives {value}"
    elif isinstance(binding, Variable):
        yield f"{binding.name}: {describe(binding)}, {binding.quantity.doc}"
    elif binding is not None:
        usage = binding.usage if isinstance(binding, HostFunction) else binding.name
        yield f"{usage}: {describe(binding)}, {binding.doc}"
    elif (learned := memory.node.declared(name.casefold())) is not None:
        yield f"{learned.name}: {KIND_NAMES[type(learned)]}"
    else:
        known = (*memory.node.vocabulary.names(), *memory.node.heard())
        raise MisuseError(f'nothing is known of "{name}"{did_you_mean(name, known)}')
