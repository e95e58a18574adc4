"""From text to result: reading, checking, compiling, obeying and explaining the Bravo command, and starting up.

A text that was heard before is not read again, so every text here is a new one. They are heard by one robot after
another, each of which hears a hundred.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import count
from math import inf
from pathlib import Path

from benchmarks.language.timing import Timing, calls, command_times, in_turns, one_by_one
from sleepcast.channel.message import Kind, Message
from sleepcast.language import Vocabulary, check, evaluate, read
from sleepcast.language.compiler import generate
from sleepcast.node.node import Node
from sleepcast.units import Quantity

COMMAND = "(WHEN (AND (< (DIST x y vessel_x vessel_y) 5mi) (> fuel 50%) (> ordnance 70%)) (JOIN bravo))"
HEARD = 100
"""New texts that one robot hears: a long day's commands."""

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
    """Each stage by itself, and an evaluation without, with its recollection, and with the tree made of it."""
    node = scout()
    text = new_text()
    form, program, compiled = read(text), check(text, node).required(), check(text, node).required()
    compiled.compile()
    memory = node._memory  # a mind keeps its memory to itself; here it is run with and without its recollections

    def walk(_: object) -> None:
        program.runs = 0  # as a message is, which is heard once: not worth generating code for
        evaluate(program, memory)

    def walk_kept(_: object) -> None:
        program.runs = 0
        node._run(program, "")

    def explained(_: object) -> None:
        program.runs = 0
        node._run(program, "")
        node.why()
