"""From text to result: reading, checking, compiling, obeying and explaining the Bravo command, and starting up.

A text that was heard before is not read again, so every text here is a new one. They are heard by one robot after
another, each of which hears a hundred.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from itertools import count
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.language.timing import Timing, calls, command_times, in_turns, one_by_one
from sleepcast.channel.message import Kind, Message
from sleepcast.core.model import Quantity
from sleepcast.language import Vocabulary, check, evaluate, read
from sleepcast.language.codegen import generate
from sleepcast.language.program import build
from sleepcast.node.node import Node

COMMAND = "(WHEN (AND (< (DIST x y vessel_x vessel_y) 5mi) (> fuel 50%) (> ordnance 70%)) (JOIN bravo))"
HEARD = 100
"""New texts that one robot hears: a long day's commands."""

READ = "read: from text to form"
WALKED = "evaluation, walked (a message, which is heard once)"
KEPT = "walked, and kept so that it can be explained"
EXPLAINED = "walked, kept, and explained at once, as a tree"
RUN = "evaluation, compiled (a rule, which runs every tick)"
RUN_KEPT = "compiled, and kept so that it can be explained"
EVALUATIONS = frozenset({WALKED, KEPT, EXPLAINED, RUN, RUN_KEPT})
START, IMPORT = "sleepcast eval '(+ 1 2)', from start to end", "import sleepcast.language"

_numbers = count(1)


def new_text() -> str:
    """The command with a limit for fuel that no text had before."""
    return COMMAND.replace("50%", f"{50 + next(_numbers) * 1e-6:.6f}%")


def scout() -> Node:
    """A robot that the command is meant for."""
    places = (Quantity(name, "m") for name in ("x", "y", "vessel_x", "vessel_y"))
    fuel, ordnance = Quantity("fuel", "%", 0.0, 1.0), Quantity("ordnance", "%", 0.0, 1.0)
    node = Node("scout-1", Vocabulary("scout", sensors=(*places, fuel, ordnance)))
    node.sense((100.0, 200.0, 3000.0, 4000.0, 0.9, 0.9), 0.0)
    return node


def first_results(robots: int) -> Timing:
    """Heard, read, checked, run and answered: from a new text in a message to the answer in the robot's outbox."""
    return one_by_one([event for _ in range(robots) for event in _hearing(scout())])


def _hearing(node: Node) -> Iterator[Callable[[], None]]:
    for number in range(HEARD):
        message = Message("operator", 0, number, Kind.COMMAND, 0.0, inf, new_text())

        def hear(message: Message = message) -> None:
            node.receive(message)
            node.think(1, 0.0)
            if node.outbox.pop().body["outcome"] != "matched":
                raise RuntimeError(f"{message.text} did not match")

        yield hear


def stages(turns: int, seconds: float) -> dict[str, Timing]:
    """Each stage by itself; and an evaluation plain, kept so that it can be explained, and explained at once."""
    node, text = scout(), new_text()
    form = read(text)
    program, compiled = check(text, node).required(), check(text, node).required()
    compiled.compile()
    memory = node._memory  # a mind keeps its memory to itself; here the same one runs with and without recollection

    def walk() -> None:
        program.runs = 0  # a message is heard once, so no code is generated for it
        evaluate(program, memory)

    def keep() -> None:
        program.runs = 0
        node._run(program, "")

    def explain() -> None:
        keep()
        node.why()

    stage: dict[str, Callable[[], object]] = {
        READ: lambda: read(text),
        "check: from its form to a program": lambda: build(text, [form], node),
        "review: read, check and advise, as before sending": lambda: check(text, node),
        "compile: generate code from a program": lambda: generate(program.root, 0),
        WALKED: walk,
        KEPT: keep,
        EXPLAINED: explain,
        RUN: lambda: evaluate(compiled, memory),
        RUN_KEPT: lambda: node._run(compiled, ""),
    }
    return in_turns({name: calls(_ignoring(do), range(10)) for name, do in stage.items()}, turns, seconds)


def _ignoring(do: Callable[[], object]) -> Callable[[int], object]:
    return lambda _: do()


# ---- starting


def start_times(turns: int) -> dict[str, Timing]:
    """Whole processes on the wall clock; and what importing the language takes within one.

    The processes keep their byte code in a folder of their own, so that a setting of this shell against byte code
    does not make every start compile everything anew.
    """
    script = Path(sys.executable).with_name("sleepcast")
    command = [str(script)] if script.exists() else [sys.executable, "-m", "sleepcast"]
    with TemporaryDirectory() as byte_code:
        kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
        environment = kept | {"PYTHONPYCACHEPREFIX": byte_code}
        return {
            "start of Python itself, doing nothing": command_times([sys.executable, "-c", "pass"], turns, environment),
            START: command_times([*command, "eval", "(+ 1 2)"], turns, environment),
            IMPORT: Timing(tuple(_import_seconds(environment) for _ in range(turns + 1))[1:]),
        }


def _import_seconds(environment: dict[str, str]) -> float:
    program = "import time; t = time.perf_counter(); import sleepcast.language; print(time.perf_counter() - t)"
    done = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True, env=environment)
    return float(done.stdout)
