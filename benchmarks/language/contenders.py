"""Who evaluates the Bravo predicate: hand-written Python, sleepcast, and what people use instead.

Everybody gets the best form of the predicate that its documentation offers, prepared as far as it can be, and its
numbers where it reads them fastest: sleepcast and the hand-written code in a list of floats, the others in a mapping
that is ready before the clock starts.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from itertools import repeat
from math import hypot, nan, sqrt
from typing import Any

from benchmarks.language.timing import Batch, calls
from sleepcast.core.model import Quantity
from sleepcast.language import FreshNames, Program, Rehearsal, Vocabulary, check, evaluate

PREDICATE = "(AND (< (DIST x y 3 4) 5) (> fuel 50) (> ordnance 70))"
SENSORS = ("x", "y", "fuel", "ordnance")
PYTHON = "hypot(x - 3.0, y - 4.0) < 5.0 and fuel > 50.0 and ordnance > 70.0"
SQUARED = "(x - 3.0) * (x - 3.0) + (y - 4.0) * (y - 4.0) < 25.0 and fuel > 50.0 and ordnance > 70.0"

LAMBDA, BARE = "hand-written lambda", "call of a function that does nothing"
CODE, BOUNDED = "sleepcast, compiled code", "sleepcast, an evaluation within its bounds"

State = dict[str, float]


def states(count: int = 64) -> list[State]:
    """Robots by fours: one too far, one short of fuel, one short of ordnance, one that matches, in shuffled order."""
    chance = random.Random(1998)
    found: list[State] = []
    while len(found) < count:
        for kind in chance.sample(range(4), 4):
            low, high = (20.0, 90.0) if kind == 0 else (1.0, 5.0)
            found.append(
                {
                    "x": chance.uniform(low, high),
                    "y": chance.uniform(low, high),
                    "fuel": chance.uniform(1.0, 49.0) if kind == 1 else chance.uniform(51.0, 99.0),
                    "ordnance": chance.uniform(1.0, 69.0) if kind == 2 else chance.uniform(71.0, 99.0),
                }
            )
    return found


def holds(state: State) -> bool:
    """The right answer."""
    near = sqrt((state["x"] - 3.0) ** 2 + (state["y"] - 4.0) ** 2) < 5.0
    return near and state["fuel"] > 50.0 and state["ordnance"] > 70.0


def vocabulary() -> Vocabulary:
    """A robot with the four sensors of the predicate, all plain numbers."""
    return Vocabulary("scout", sensors=tuple(Quantity(name) for name in SENSORS))


def values_of(names: Vocabulary, state: State) -> list[float]:
    """The robot's list of values with `state` in its slots."""
    values = [nan] * names.size
    values[names.first_sensor : names.first_sensor + len(SENSORS)] = [state[name] for name in SENSORS]
    return values


@dataclass(frozen=True)
class Contender:
    """name: with its version. ask: the answer for the state of this number. batch: all states, the loop to be timed."""

    name: str
    ask: Callable[[int], bool]
    batch: Batch


def _over(name: str, function: Callable[[Any], object], inputs: Sequence[Any]) -> Contender:
    return Contender(name, lambda i: bool(function(inputs[i])), calls(function, inputs))


# ---- hand-written Python and sleepcast, on the same storage


def hand_written(robots: list[State]) -> list[Contender]:
    """A lambda (the fastest of the forms tried that ask for the distance), a function, and how low Python can go."""
    names = vocabulary()
    x, y, fuel, ordnance = (f"v[{names.first_sensor + i}]" for i in range(len(SENSORS)))
    source = f"""
by_lambda = lambda v: hypot({x} - 3.0, {y} - 4.0) < 5.0 and {fuel} > 50.0 and {ordnance} > 70.0

def by_function(v):
    across = {x} - 3.0
    up = {y} - 4.0
    return sqrt(across * across + up * up) < 5.0 and {fuel} > 50.0 and {ordnance} > 70.0

floor = lambda v: (
    (across := {x} - 3.0) * across + (up := {y} - 4.0) * up < 25.0 and {fuel} > 50.0 and {ordnance} > 70.0
)

def bare(v):
    return 0.0
"""
    space: dict[str, Any] = {"hypot": hypot, "sqrt": sqrt}
    exec(compile(source, "<hand-written>", "exec"), space)
    inputs = [values_of(names, state) for state in robots]
    return [
        _over(LAMBDA, space["by_lambda"], inputs),
        _over("hand-written function", space["by_function"], inputs),
        _over("hand-written, rid of the square root: the floor in Python", space["floor"], inputs),
        Contender(BARE, lambda i: holds(robots[i]), calls(space["bare"], inputs)),
    ]


def predicate() -> Program:
    """The Bravo predicate, compiled."""
    program = check(PREDICATE, FreshNames(vocabulary())).required()
    program.compile()
    return program


def sleepcast(robots: list[State]) -> list[Contender]:
    """The compiled code alone, and an evaluation from outside: with its budget, its faults and whether it matched."""
    program, names = predicate(), vocabulary()
    memories = [Rehearsal(values_of(names, state)) for state in robots]
    code = program.code
    if code is None:
        raise RuntimeError("a compiled program has no code")

    def run_code(rounds: int) -> int:
        memory = memories[0]
        inputs = [each.values for each in memories]
        for _ in repeat(None, rounds):
            for values in inputs:
                code(values, memory)
        return rounds * len(inputs)

    def run_bounded(rounds: int) -> int:
        for _ in repeat(None, rounds):
            for memory in memories:
                evaluate(program, memory)
        return rounds * len(memories)

    return [
        Contender(CODE, lambda i: code(memories[i].values, memories[i]) > 0.0, run_code),
        Contender(BOUNDED, lambda i: evaluate(program, memories[i]) > 0.0, run_bounded),
    ]


# ---- what people use instead


def evalidate_method(robots: list[State]) -> Contender:
    """As its pages begin: the expression's own `eval`."""
    expression = _evalidate()
    return _over(f"evalidate {version('evalidate')}", expression.eval, [dict(state) for state in robots])


def evalidate_native(robots: list[State]) -> Contender:
    """As its pages advise for speed: Python's own eval of the code that it has let through, errors and all."""
    code = _evalidate().code
    functions = {"hypot": hypot}
    states = [dict(state) for state in robots]

    def batch(rounds: int) -> int:
        for _ in repeat(None, rounds):
            for state in states:
                eval(code, functions, state)
        return rounds * len(states)

    name = f"Python's eval of the code evalidate {version('evalidate')} has checked"
    return Contender(name, lambda i: bool(eval(code, functions, states[i])), batch)


def _evalidate() -> Any:
    library = import_module("evalidate")
    nodes = [*library.base_eval_model.nodes, "Call", "Mult"]
    return library.EvalModel(nodes=nodes, imported_functions={"hypot": hypot}).expr(PYTHON)


def zen(robots: list[State]) -> Contender:
    """Rust; the squared form is six times faster than its power operator."""
    expression = import_module("zen").compile_expression(SQUARED)
    return _over(f"zen-engine {version('zen-engine')}", expression.evaluate, [dict(state) for state in robots])


def simpleeval(robots: list[State]) -> Contender:
    """Parsed once; the names are the robot's mapping."""
    evaluator = import_module("simpleeval").SimpleEval(functions={"hypot": hypot})
    parsed = evaluator.parse(PYTHON)

    def ask(state: State) -> object:
        evaluator.names = state
        return evaluator.eval(PYTHON, previously_parsed=parsed)

    return _over(f"simpleeval {version('simpleeval')}", ask, robots)


def asteval(robots: list[State]) -> Contender:
    """Parsed once; the smallest interpreter it offers."""
    interpreter = import_module("asteval").Interpreter(minimal=True)
    interpreter.symtable["hypot"] = hypot
    parsed = interpreter.parse(PYTHON)

    def ask(state: State) -> object:
        interpreter.symtable.update(state)
        return interpreter.run(parsed)

    return _over(f"asteval {version('asteval')}", ask, robots)


def rule_engine(robots: list[State]) -> Contender:
    """A rule made once."""
    rule = import_module("rule_engine").Rule(SQUARED)
    return _over(f"rule-engine {version('rule-engine')}", rule.matches, [dict(state) for state in robots])


def cel_python(robots: list[State]) -> Contender:
    """A program made once, with the distance as a function of the host's, over values of its own types."""
    library, types = import_module("celpy"), import_module("celpy.celtypes")
    environment = library.Environment()

    def distance(across: float, up: float) -> object:
        return types.DoubleType(hypot(across, up))

    text = PYTHON.replace(" and ", " && ")
    program = environment.program(environment.compile(text), functions={"hypot": distance})
    inputs = [{name: types.DoubleType(value) for name, value in state.items()} for state in robots[:4]]
    return _over(f"cel-python {version('cel-python')}", program.evaluate, inputs)


RIVALS: dict[str, Callable[[list[State]], Contender]] = {
    "evalidate": evalidate_method,
    "evalidate, native": evalidate_native,
    "zen-engine": zen,
    "simpleeval": simpleeval,
    "asteval": asteval,
    "rule-engine": rule_engine,
    "cel-python": cel_python,
}
