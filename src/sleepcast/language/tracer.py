"""The tracer: a walk that remembers the value of every part it met, and the walks inside it."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan

from sleepcast.language.machine import MAX_STEPS, OutOfSteps
from sleepcast.language.operations import Entered, Memory, too_deep
from sleepcast.language.parts import Part
from sleepcast.language.walker import Walker


class Tracer(Walker):
    """A walk that keeps the value of every part (the last one, inside a loop) and the walks inside it."""

    def __init__(self, memory: Memory, program: Entered, arguments: Sequence[float] = ()) -> None:
        super().__init__(memory, program, arguments)
        self.found: dict[int, float] = {}
        self.inner: dict[int, Tracer] = {}

    def value(self, part: Part) -> float:
        value = super().value(part)
        self.found[part.index] = value
        return value

    def enter(self, part: Part, program: Entered | None, arguments: Sequence[float]) -> float:
        memory = self.memory
        if program is None:
            return nan
        refusal = too_deep(memory, program)
        if refusal:
            return memory.fault(part, refusal)
        tracer = self.inner[part.index] = Tracer(memory, program, arguments)
        memory.steps += program.cost
        if memory.steps > MAX_STEPS:
            raise OutOfSteps
        memory.values.extend([nan] * (program.slots - len(memory.values)))
        matched = memory.matched
        memory.depth += 1
        memory.levels += program.height
        try:
            return tracer.value(program.root)
        finally:
            memory.depth -= 1
            memory.levels -= program.height
            memory.matched = matched
