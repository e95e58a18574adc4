"""The reference: what an expression of the standard dialect means, said as plainly as it can be.

One class walks a read form and looks every name up at the moment it is met. It is slow and obvious on purpose, shares
nothing with the checker, the compiler and the machines but the reader, the vocabulary and the source of chance, and
is what they are compared with. It expects an expression that the checker lets through: a wrong number of arguments
is not its business.

Unknown is NaN. `fault` records a reason and gives unknown; nothing is ever raised by an evaluation.
"""

from __future__ import annotations

import math
import sys
from collections import ChainMap
from collections.abc import Callable, Container, Iterator, Sequence
from typing import NamedTuple

from language.reference_forms import (
    AROUND,
    CHOOSING,
    FLAGS,
    arguments,
    cost,
    deciding_tests,
    head_of,
    height,
    is_call,
    items,
    key_of,
    named,
    repeats,
    stored,
    unquoted,
)
from language.reference_numbers import PURE, Undefined, truth
from sleepcast.core.model import Constant, HostFunction
from sleepcast.language.numerics import draw, normal, stream
from sleepcast.language.reader import QUASIQUOTE, QUOTE, UNQUOTE, Form, List, Number, Symbol, Text, read, show, walk
from sleepcast.language.remembering import written_out
from sleepcast.language.vocabulary import Variable, VariableKind, Vocabulary, buffer_number

UNKNOWN = math.nan
MAX_STEPS = 10_000
MAX_CALLS = 32
MAX_LEVELS = 100
TELL_BURST = 8
TELLS_TOO_OFTEN = "tells too often: more than 2 a second are dropped"
DEEPEST = 20_000
"""Python calls inside one another: enough for the deepest text in the deepest chain of buffers."""

Scope = ChainMap[str, float]
Told = tuple[str, tuple[float, ...]]


class OutOfSteps(Exception):
    """The evaluation has used up its steps; what it has done stands."""


class Operator(NamedTuple):
    parameters: tuple[str, ...]
    body: tuple[Form, ...]


def true(value: float) -> bool:
    return value != 0 and not math.isnan(value)


class Reference:
    """One robot's mind: the state, and `evaluate`.

    values: support variables, sensors and actuators by key. Of the last evaluation: whether its top-level test was
    true (matched), the reasons of its faults, and what it printed, told and pinged.
    """

    def __init__(self, vocabulary: Vocabulary, *, number: int = 0, seed: int = 0, body: object | None = None) -> None:
        self.vocabulary, self.body = vocabulary, body
        self.chance, self.tick, self.draws = stream(seed, number), 0, 0
        variables = [b for b in vocabulary.bindings.values() if isinstance(b, Variable)]
        self.values = {v.name.casefold(): 0.0 if v.kind is VariableKind.SUPPORT else UNKNOWN for v in variables}
        self.values |= {"marking": 1.0, "id": float(number), "tick": 0.0, "time": 0.0}
        self.user: dict[str, float] = {}
        self.absent: set[str] = set()
        self.stored: dict[str, Form] = {}
        self.active: set[str] = set()
        self.operators: dict[str, Operator] = {}
        self.groups: dict[str, bool] = {}
        self.faults: list[str] = []
        self.printed: list[Told] = []
        self.told: list[str] = []
        self.pings: list[float] = []
        self.tells = 0
        """In all evaluations together: no time passes between them."""
        self.steps = self.calls = self.levels = 0
        self.tests: list[Form] = []
        self.matched = False

    def evaluate(self, text: str) -> float:
        """The value of the one expression in `text`. Raises ReadError if it is none."""
        form = read(text)
        made = {key_of(arguments(call)[0]) for call in walk(form) if is_call(call, "defun") or is_call(call, "rule")}
        known = made | self.user.keys() | self.stored.keys() | self.operators.keys() | self.groups.keys()
        form = written_out(form, lambda key: key in known or key in self.vocabulary.bindings)
        self.faults, self.printed, self.told, self.pings = [], [], [], []
        self.steps = self.calls = self.levels = 0
        self.absent = set()
        made_here = {key_of(arguments(call)[0]) for call in walk(form) if is_call(call, "defun")}
        tests = deciding_tests(form, made_here | self.operators.keys(), self.vocabulary)
        self.tests, self.matched = tests or [], tests is None
        usual = sys.getrecursionlimit()
        sys.setrecursionlimit(DEEPEST)
        try:
            return self.enter((form,), ChainMap())
        except OutOfSteps:
            return self.fault("out of steps")
        finally:
            sys.setrecursionlimit(usual)

    def state(self) -> dict[str, object]:
        """All that an evaluation can change, in numbers and texts that can be compared."""
        flagged = {key for key in self.stored if buffer_number(key) and self.values[f"active{key[1:]}"] > 0}
        return {
            "variables": {key: value.hex() for key, value in {**self.values, **self.user}.items()},
            "stored": {key: show(form) for key, form in self.stored.items()},
            "active": sorted(self.active | flagged),
            "operators": sorted(self.operators),
            "groups": sorted(key for key, member in self.groups.items() if member),
        }

    def fault(self, reason: str) -> float:
        self.faults.append(reason)
        return UNKNOWN

    def enter(self, program: Sequence[Form], scope: Scope) -> float:
        """Run a message, a rule or the body of an operator, if the budget and the depth of calls allow."""
        levels = max(map(height, program))
        if self.calls > MAX_CALLS or self.levels + levels > MAX_LEVELS:
            return self.fault("calls nested too deeply")
        self.steps += sum(map(cost, program)) + (len(program) > 1)
        if self.steps > MAX_STEPS:
            raise OutOfSteps
        self.calls += 1
        self.levels += levels
        outside, self.absent = self.absent, self.nowhere(program)
        value = self.in_turn(program, scope)
        self.absent = outside
        self.calls -= 1
        self.levels -= levels
        return value

    def nowhere(self, program: Sequence[Form]) -> set[str]:
        """The names that mean nothing in this program: nobody has made them before it is entered, and it does not do so
        itself. What it enters may make them meanwhile; it sees them the next time."""
        made = {
            key_of(arguments(call)[0])
            for form in program
            for call in walk(form)
            if is_call(call, "defvar") or is_call(call, "rule")
        }
        here = {name for form in program for name in named(form)} - made
        return {name for name in here if not (name in self.user or name in self.stored or buffer_number(name))}

    # ---- any form ----

    def value(self, form: Form, scope: Scope) -> float:
        value = self.met(form, scope)
        if true(value) and any(form is test for test in self.tests):
            self.matched = True
        return value

    def met(self, form: Form, scope: Scope) -> float:
        if isinstance(form, Number):
            return form.value
        if isinstance(form, Symbol):
            return self.name(form, scope)
        head = head_of(form)
        gives_way = head in ("area", "inside", "to-edge", "of", "after-issue", "cancel", *CHOOSING) or head in AROUND
        if head in SPECIAL and not (gives_way and head in self.operators):
            return float(SPECIAL[head](self, arguments(form), scope))
        if head in PURE:
            return self.pure(head, arguments(form), scope)
        if head in FLAGS:
            flag, value = FLAGS[head]
            self.values[flag] = value
            return 1.0
        return self.called(head, arguments(form), scope)

    def in_turn(self, forms: Sequence[Form], scope: Scope) -> float:
        """Evaluate one after the other; the value of the last, 0 of none."""
        value = 0.0
        for form in forms:
            value = self.value(form, scope)
        return value

    def name(self, symbol: Symbol, scope: Scope) -> float:
        key = key_of(symbol)
        if key in scope:
            return scope[key]
        if key in self.stored and key not in self.absent:
            return self.enter((self.stored[key],), ChainMap())
        if key in self.values:
            return self.values[key]
        binding = self.vocabulary.bindings.get(key)
        if isinstance(binding, HostFunction) and binding.value is not None:
            return float(binding.value)
        if isinstance(binding, Constant):
            return binding.value
        return UNKNOWN if key in self.absent else self.user.get(key, UNKNOWN)

    def pure(self, head: str, forms: Sequence[Form], scope: Scope) -> float:
        numbers = [self.value(form, scope) for form in forms]
        if any(map(math.isnan, numbers)):
            return UNKNOWN
        try:
            result = float(PURE[head](*numbers))
        except Undefined as undefined:
            return self.fault(str(undefined))
        except OverflowError:
            return self.fault("overflow")
        return result if math.isfinite(result) else self.fault("overflow")

    def called(self, head: str, forms: Sequence[Form], scope: Scope) -> float:
        """An operator made by DEFUN, or a function of the robot's own."""
        operator_ = self.operators.get(head)
        if operator_ is not None:
            if len(forms) != len(operator_.parameters):
                return self.fault(head)
            numbers = [self.value(form, scope) for form in forms]
            own = dict(zip(operator_.parameters, numbers, strict=True))
            return self.enter(operator_.body, ChainMap(own))
        function = self.vocabulary.bindings.get(head)
        if not isinstance(function, HostFunction):
            return self.fault(head)
        return self.host(function, forms, scope)

    def host(self, function: HostFunction, forms: Sequence[Form], scope: Scope) -> float:
        given: list[float | str] = []
        for form in forms:
            given.append(form.value if isinstance(form, Text) else self.value(form, scope))
        if any(isinstance(x, float) and math.isnan(x) for x in given):
            return self.fault("unknown") if function.acts else UNKNOWN
        try:
            result = function.call(self.body, *given)
        except Exception:
            return self.fault(function.name)
        return 1.0 if result is None else float(result)

    # ---- boolean and control ----

    def do_and(self, forms: Sequence[Form], scope: Scope) -> float:
        value = 1.0
        for form in forms:
            value = self.value(form, scope)
            if not true(value):
                break
        return value

    def do_or(self, forms: Sequence[Form], scope: Scope) -> float:
        missing = False
        for form in forms:
            value = self.value(form, scope)
            if true(value):
                return value
            missing = missing or math.isnan(value)
        return UNKNOWN if missing else 0.0

    def do_known(self, forms: Sequence[Form], scope: Scope) -> float:
        return truth(not math.isnan(self.value(forms[0], scope)))

    def do_cond(self, clauses: Sequence[Form], scope: Scope) -> float:
        for clause in clauses:
            test, *rest = items(clause)
            value = self.value(test, scope)
            if true(value):
                return self.in_turn(rest, scope) if rest else value
        return 0.0

    def do_if(self, forms: Sequence[Form], scope: Scope) -> float:
        test, then, *otherwise = forms
        return self.value(then, scope) if true(self.value(test, scope)) else self.in_turn(otherwise, scope)

    def do_when(self, forms: Sequence[Form], scope: Scope) -> float:
        value = self.value(forms[0], scope)
        if not true(value):
            return 0.0
        return self.in_turn(forms[1:], scope) if forms[1:] else value

    def do_progn(self, forms: Sequence[Form], scope: Scope) -> float:
        return self.in_turn(forms, scope)

    def do_let(self, forms: Sequence[Form], scope: Scope) -> float:
        pairs = [items(pair) for pair in items(forms[0])]
        own = {key_of(name): self.value(form, scope) for name, form in pairs}
        return self.in_turn(forms[1:], scope.new_child(own))

    def do_dotimes(self, forms: Sequence[Form], scope: Scope) -> float:
        counter = key_of(items(forms[0])[0])
        for i in range(repeats(forms[0])):
            self.in_turn(forms[1:], scope.new_child({counter: float(i)}))
        return 0.0

    # ---- neighbours ----

    def neighbours(self, forms: Sequence[Form], scope: Scope, most: int) -> list[tuple[float, float]] | None:
        """For each neighbour in the order of their ids, the id and the value of the rest; None if unknown."""
        name, *which = items(forms[0])
        sensor = self.vocabulary.bindings["nearest_id"].neighbours
        given = [self.value(form, scope) for form in which]
        if any(map(math.isnan, given)):
            return None
        try:
            near = sorted(sensor.call(self.body, most, *given))
        except Exception:
            self.fault("NEAREST_ID failed")
            return None
        return [(n, self.in_turn(forms[1:], scope.new_child({key_of(name): n}))) for n in near]

    def do_for_neighbours(self, forms: Sequence[Form], scope: Scope) -> float:
        return UNKNOWN if self.neighbours(forms, scope, 64) is None else 0.0

    def over(self, forms: Sequence[Form], scope: Scope, of: Callable[[list[tuple[float, float]]], float]) -> float:
        """A number from the neighbours whose value is known."""
        near = self.neighbours(forms, scope, 256)
        if near is None:
            return UNKNOWN
        result = of([(n, value) for n, value in near if not math.isnan(value)])
        return self.fault("overflow") if math.isinf(result) else result

    def do_sum_over(self, forms: Sequence[Form], scope: Scope) -> float:
        return self.over(forms, scope, in_turn_added)

    def do_mean_over(self, forms: Sequence[Form], scope: Scope) -> float:
        return self.over(forms, scope, lambda known: in_turn_added(known) / len(known) if known else UNKNOWN)

    def do_min_over(self, forms: Sequence[Form], scope: Scope) -> float:
        return self.over(forms, scope, lambda known: min((value for _, value in known), default=UNKNOWN))

    def do_max_over(self, forms: Sequence[Form], scope: Scope) -> float:
        return self.over(forms, scope, lambda known: max((value for _, value in known), default=UNKNOWN))

    def do_count_over(self, forms: Sequence[Form], scope: Scope) -> float:
        return self.over(forms, scope, lambda known: float(sum(true(value) for _, value in known)))

    def do_best_over(self, forms: Sequence[Form], scope: Scope) -> float:
        return self.over(forms, scope, lambda known: min(known, key=lambda each: each[1], default=(UNKNOWN, 0.0))[0])

    def do_of(self, forms: Sequence[Form], scope: Scope) -> float:
        neighbour = self.value(forms[0], scope)
        fields = dict(self.vocabulary.bindings["nearest_id"].neighbours.fields)
        field = fields.get(key_of(forms[1]))
        if field is None or math.isnan(neighbour):
            return UNKNOWN
        return float(field.call(self.body, neighbour))

    # ---- the best so many, and a quorum ----

    def choosing(self, name: str, test: Form, scope: Scope) -> float:
        return self.fault(f"{name} chooses among robots that are sent this") if true(self.value(test, scope)) else 0.0

    def do_best(self, forms: Sequence[Form], scope: Scope) -> float:
        return self.choosing("BEST", forms[2], scope)

    def do_quorum(self, forms: Sequence[Form], scope: Scope) -> float:
        return self.choosing("QUORUM", forms[2], scope)

    # ---- an instant for all ----

    def do_after_issue(self, forms: Sequence[Form], scope: Scope) -> float:
        return self.fault("AFTER-ISSUE counts from the issue of a command that is sent")

    def do_cancel(self, forms: Sequence[Form], scope: Scope) -> float:
        return 0.0  # nothing waits

    # ---- assignment ----

    def do_setq(self, forms: Sequence[Form], scope: Scope) -> float:
        key, form = key_of(forms[0]), forms[1]
        if buffer_number(key) is not None and key not in scope:
            return self.set_buffer(key, form, scope)
        value = self.value(form, scope)
        binding = self.vocabulary.bindings.get(key)
        own = next((names for names in scope.maps if key in names), None)
        if own is not None:
            own[key] = value
        elif key in self.user:
            self.user[key] = value
        elif not isinstance(binding, Variable) or binding.kind is VariableKind.SENSOR:
            return self.fault(key)
        elif math.isnan(value):
            return self.fault("unknown never reaches" if binding.kind is VariableKind.ACTUATOR else "unknown")
        else:
            self.values[key] = value
        return value

    def set_buffer(self, key: str, form: Form, scope: Scope) -> float:
        if is_call(form, QUOTE):
            return self.store(key, arguments(form)[0], 0.0)
        value = self.value(form, scope)
        return self.fault("unknown") if math.isnan(value) else self.store(key, Number(value), value)

    def do_setqq(self, forms: Sequence[Form], scope: Scope) -> float:
        return self.store(key_of(forms[0]), forms[1], 0.0)

    def do_defvar(self, forms: Sequence[Form], scope: Scope) -> float:
        key = key_of(forms[0])
        if key not in self.user:
            if self.taken(key, "variable"):
                return UNKNOWN
            self.user[key] = self.value(forms[1], scope) if forms[1:] else UNKNOWN
        return self.user[key]

    # ---- rules and operators ----

    def store(self, key: str, form: Form, result: float) -> float:
        if self.reaches(key, named(form)):
            return self.fault("name itself")
        self.stored[key] = form
        return result

    def reaches(self, key: str, names: set[str]) -> bool:
        """Whether evaluating `names` would come to `key`, directly or through rules, buffers and operators."""
        seen: set[str] = set()
        waiting = set(names)
        while waiting:
            name = waiting.pop()
            if name == key:
                return True
            if name in seen:
                continue
            seen.add(name)
            if name in self.stored:
                waiting |= named(self.stored[name])
            elif name in self.operators:
                waiting |= self.named_by(self.operators[name])
        return False

    def named_by(self, operator_: Operator) -> set[str]:
        return {name for form in operator_.body for name in named(form, frozenset(operator_.parameters))}

    def taken(self, key: str, sort: str) -> bool:
        """Record a fault if `key` is already the name of something of another sort."""
        sorts: dict[str, Container[str]] = {
            "variable": self.user,
            "rule": self.stored,
            "operator": self.operators,
            "group": self.groups,
        }
        other = next((kind for kind, names in sorts.items() if kind != sort and key in names), None)
        if other is not None:
            self.fault("is already a")
        return other is not None

    def do_rule(self, forms: Sequence[Form], scope: Scope) -> float:
        key = key_of(forms[0])
        if self.taken(key, "rule"):
            return UNKNOWN
        value = self.store(key, forms[1], 1.0)
        if true(value):
            self.activate(key, True)
        return value

    def activate(self, key: str, on: bool) -> None:
        number = buffer_number(key)
        if number is not None:
            self.values[f"active{number}"] = truth(on)
        elif on:
            self.active.add(key)
        else:
            self.active.discard(key)

    def do_activate(self, forms: Sequence[Form], scope: Scope) -> float:
        return self.switch(key_of(forms[0]), True)

    def do_deactivate(self, forms: Sequence[Form], scope: Scope) -> float:
        return self.switch(key_of(forms[0]), False)

    def switch(self, key: str, on: bool) -> float:
        if key not in self.stored and buffer_number(key) is None:
            return self.fault(key)
        self.activate(key, on)
        return 1.0

    def do_forget(self, forms: Sequence[Form], scope: Scope) -> float:
        key = key_of(forms[0])
        if key in self.operators:
            del self.operators[key]
            return 1.0
        if key not in self.stored:
            return self.fault(key)
        del self.stored[key]
        self.activate(key, False)
        return 1.0

    def do_lease(self, forms: Sequence[Form], scope: Scope) -> float:
        key, seconds = key_of(forms[0]), self.value(forms[1], scope)
        if math.isnan(seconds):
            return self.fault("unknown length")
        return 1.0 if key in self.stored else self.fault(key)

    def do_defun(self, forms: Sequence[Form], scope: Scope) -> float:
        key = key_of(forms[0])
        new = Operator(tuple(map(key_of, items(forms[1]))), tuple(forms[2:]))
        if self.taken(key, "operator"):
            return UNKNOWN
        if self.reaches(key, self.named_by(new)):
            return self.fault("name itself")
        self.operators[key] = new
        return 1.0

    def do_area(self, forms: Sequence[Form], scope: Scope) -> float:
        body = stored(List((Symbol("AREA"), *forms)))
        return self.do_defun((forms[0], List(()), *(body or ())), scope)

    def do_to_edge(self, forms: Sequence[Form], scope: Scope) -> float:
        key = key_of(forms[0])
        return self.called(key, (), scope) if key in self.operators else self.fault(f"no operator {key}")

    def do_inside(self, forms: Sequence[Form], scope: Scope) -> float:
        away = self.do_to_edge(forms, scope)
        return UNKNOWN if math.isnan(away) else truth(away >= 0)

    # ---- groups, chance, speaking ----

    def do_join(self, forms: Sequence[Form], scope: Scope) -> float:
        if self.taken(key_of(forms[0]), "group"):
            return UNKNOWN
        self.groups[key_of(forms[0])] = True
        return 1.0

    def do_leave(self, forms: Sequence[Form], scope: Scope) -> float:
        if key_of(forms[0]) in self.groups:
            self.groups[key_of(forms[0])] = False
        return 1.0

    def do_in(self, forms: Sequence[Form], scope: Scope) -> float:
        return truth(self.groups.get(key_of(forms[0]), False))

    def draw(self) -> float:
        self.draws += 1
        return draw(self.chance, self.tick, self.draws - 1)

    def do_prob(self, forms: Sequence[Form], scope: Scope) -> float:
        chance = self.value(forms[0], scope)
        return UNKNOWN if math.isnan(chance) else truth(self.draw() < chance)

    def do_dice(self, clauses: Sequence[Form], scope: Scope) -> float:
        drawn, total = self.draw(), 0.0
        for clause in clauses:
            chance, form = items(clause)
            total += self.value(chance, scope)
            if math.isnan(total):
                return UNKNOWN
            if drawn < total:
                return self.value(form, scope)
        return 0.0

    def do_random(self, forms: Sequence[Form], scope: Scope) -> float:
        low, high = (self.value(form, scope) for form in forms)
        if math.isnan(low) or math.isnan(high):
            return UNKNOWN
        return self.finite(low + self.draw() * (high - low))

    def do_gauss(self, forms: Sequence[Form], scope: Scope) -> float:
        mean, deviation = (self.value(form, scope) for form in forms)
        if math.isnan(mean) or math.isnan(deviation):
            return UNKNOWN
        if deviation < 0:
            return self.fault("deviation")
        return self.finite(mean + deviation * normal(self.draw()))

    def finite(self, result: float) -> float:
        return result if math.isfinite(result) else self.fault("overflow")

    def do_report(self, forms: Sequence[Form], scope: Scope) -> float:
        label = forms[0].value if isinstance(forms[0], Text) else ""
        numbers = [self.value(form, scope) for form in forms if not isinstance(form, Text)]
        self.printed.append((label, tuple(numbers)))
        return numbers[-1] if numbers else 1.0

    def do_tell(self, forms: Sequence[Form], scope: Scope) -> float:
        template, numbers = forms[0], []
        quoted = is_call(template, QUOTE)
        if quoted or is_call(template, QUASIQUOTE):
            template = arguments(template)[0]
        if not quoted:
            numbers = [self.value(form, scope) for form in unquoted(template)]
        if any(map(math.isnan, numbers)):
            return self.fault("unknown")
        self.tells += 1
        if self.tells <= TELL_BURST:
            self.told.append(show(template if quoted else filled(template, iter(numbers))))
        elif self.tells == TELL_BURST + 1:
            self.printed.append((TELLS_TOO_OFTEN, ()))
        return 1.0

    def do_ping(self, forms: Sequence[Form], scope: Scope) -> float:
        caste = self.value(forms[0], scope) if forms else 0.0
        if math.isnan(caste):
            return self.fault("unknown")
        self.pings.append(caste)
        return 1.0


def in_turn_added(known: list[tuple[float, float]]) -> float:
    """The sum of the values, one after the other; infinite if it ever was."""
    total = 0.0
    for _, value in known:
        total += value
    return math.inf if math.isnan(total) else total


def filled(template: Form, numbers: Iterator[float]) -> Form:
    """`template` with the place of every comma taken by the next of `numbers`."""
    if is_call(template, UNQUOTE):
        return Number(next(numbers))
    if isinstance(template, List):
        return List(tuple(filled(item, numbers) for item in template.items))
    return template


SPECIAL = {name[3:].replace("_", "-"): getattr(Reference, name) for name in dir(Reference) if name.startswith("do_")}
"""The special forms, and the acts that are not just a flag, by key: what evaluates them."""
SPECIAL["print"] = SPECIAL["report"]
