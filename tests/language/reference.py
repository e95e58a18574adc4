"""The reference: what an expression of the standard dialect means, said as plainly as it can be.

One class walks a read form and looks every name up at the moment it is met. It is slow and obvious on purpose, shares
nothing with the checker, the compiler and the machines but the reader, the vocabulary and the source of chance, and
is what they are compared with. It expects an expression that the checker lets through: a wrong number of arguments
is not its business.

Unknown is NaN. `fault` records a reason and gives unknown; nothing is ever raised by an evaluation.
"""

from __future__ import annotations

import math
import operator
import sys
from collections import ChainMap
from collections.abc import Callable, Container, Iterator, Sequence
from functools import reduce
from itertools import combinations, pairwise, takewhile
from typing import NamedTuple

from sleepcast.language.chance import draw, normal, stream
from sleepcast.language.form import QUASIQUOTE, QUOTE, UNQUOTE, Form, List, Number, Symbol, Text, show, walk
from sleepcast.language.functions import FUNCTIONS
from sleepcast.language.reader import read
from sleepcast.language.vocabulary import Constant, HostFunction, Kind, Variable, Vocabulary, buffer_number

UNKNOWN = math.nan
MAX_STEPS = 10_000
MAX_CALLS = 32
DEEPEST = 20_000
"""Python calls inside one another: enough for the deepest text in the deepest chain of buffers."""

Scope = ChainMap[str, float]
Told = tuple[str, tuple[float, ...]]


class Undefined(Exception):
    """A function has no value for these numbers; the text is the reason of the fault."""


class OutOfSteps(Exception):
    """The evaluation has used up its steps; what it has done stands."""


class Operator(NamedTuple):
    parameters: tuple[str, ...]
    body: tuple[Form, ...]


def true(value: float) -> bool:
    return value != 0 and not math.isnan(value)


def truth(condition: bool) -> float:
    return 1.0 if condition else 0.0


# ---- pure functions: known, finite numbers in ----


def divided(x: float, y: float) -> float:
    if y == 0:
        raise Undefined("division by zero")
    return x / y


def remainder(x: float, y: float) -> float:
    if y == 0:
        raise Undefined("division by zero")
    return x % y


def power(x: float, y: float) -> float:
    try:
        return math.pow(x, y)
    except ValueError:
        raise Undefined("to the power") from None


def square_root(x: float) -> float:
    if x < 0:
        raise Undefined("square root of")
    return math.sqrt(x)


def logarithm(x: float) -> float:
    if x <= 0:
        raise Undefined("logarithm of")
    return math.log(x)


def distance(x1: float, y1: float, x2: float, y2: float) -> float:
    return math.sqrt((x1 - x2) * (x1 - x2) + (y1 - y2) * (y1 - y2))


def wrapped(angle: float) -> float:
    turned = angle % (2 * math.pi)
    return turned - 2 * math.pi if turned > math.pi else turned


def clamped(x: float, low: float, high: float) -> float:
    if low > high:
        raise Undefined("CLAMP")
    if x < low:
        return low
    if x > high:
        return high
    return x


def chain(holds: Callable[[float, float], bool]) -> Callable[..., float]:
    return lambda *xs: truth(all(holds(x, y) for x, y in pairwise(xs)))


PURE: dict[str, Callable[..., float]] = {
    "+": lambda *xs: reduce(operator.add, xs) if xs else 0.0,
    "-": lambda *xs: reduce(operator.sub, xs) if len(xs) > 1 else -xs[0],
    "*": lambda *xs: reduce(operator.mul, xs) if xs else 1.0,
    "/": lambda *xs: reduce(divided, xs) if len(xs) > 1 else divided(1.0, xs[0]),
    "^": power,
    "mod": remainder,
    "abs": abs,
    "min": lambda *xs: min(xs),
    "max": lambda *xs: max(xs),
    "sqrt": square_root,
    "exp": math.exp,
    "log": logarithm,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "atan2": math.atan2,
    "floor": lambda x: float(math.floor(x)),
    "ceil": lambda x: float(math.ceil(x)),
    "round": lambda x: float(round(x)),
    "dist": distance,
    "bearing": lambda x1, y1, x2, y2: math.atan2(y2 - y1, x2 - x1),
    "wrap": wrapped,
    "clamp": clamped,
    "=": chain(operator.eq),
    "eq": chain(operator.eq),
    "/=": lambda *xs: truth(all(x != y for x, y in combinations(xs, 2))),
    "<": chain(operator.lt),
    "<=": chain(operator.le),
    ">": chain(operator.gt),
    ">=": chain(operator.ge),
    "not": lambda x: truth(x == 0),
}

FLAGS = {
    "sleep": ("sleeping", 1.0),
    "wake": ("sleeping", 0.0),
    "freeze": ("frozen", 1.0),
    "thaw": ("frozen", 0.0),
    "mark": ("marked", 1.0),
    "unmark": ("marked", 0.0),
}


# ---- what a form is made of ----


def arguments(form: Form) -> tuple[Form, ...]:
    return form.items[1:] if isinstance(form, List) else ()


def is_call(form: Form, key: str) -> bool:
    return isinstance(form, List) and form.head == key


def unquoted(form: Form) -> Iterator[Form]:
    """The expressions after the commas of a template, left to right."""
    if is_call(form, UNQUOTE):
        yield arguments(form)[0]
    elif isinstance(form, List):
        for item in form.items:
            yield from unquoted(item)


def evaluated(form: Form) -> list[Form]:
    """The parts of a call that an evaluation may evaluate, left to right: not what is quoted, named or declared."""
    rest = list(arguments(form))
    head = form.head if isinstance(form, List) else None
    if head in ("cond", "dice"):
        return [part for clause in rest if isinstance(clause, List) for part in clause.items]
    if head == "let":
        return [arguments(pair)[0] for pair in items(rest[0])] + rest[1:]
    if head == "tell":
        return [] if is_call(rest[0], QUOTE) else list(unquoted(rest[0]))
    if head in ("setq", "lease", "defvar", "dotimes"):
        rest = rest[1:]
    elif head in NAMING:
        rest = []
    return [part for part in rest if not isinstance(part, Text) and not is_call(part, QUOTE)]


NAMING = ("setqq", "rule", "defun", "activate", "deactivate", "forget", "join", "leave", "in", QUOTE)
"""Calls whose arguments are names and stored text: nothing of them is evaluated."""


def items(form: Form) -> tuple[Form, ...]:
    return form.items if isinstance(form, List) else ()


def key_of(form: Form) -> str:
    """The key of a name; that of a buffer is always `e5`, also where it is written `expr5`."""
    assert isinstance(form, Symbol), form
    number = buffer_number(form.key)
    return form.key if number is None else f"e{number}"


def cost(form: Form) -> int:
    """Steps charged on entering `form`: one for each number, name and call in it, as often as DOTIMES repeats it."""
    inside = sum(map(cost, evaluated(form)))
    if is_call(form, "dotimes"):
        count = items(arguments(form)[0])[1]
        assert isinstance(count, Number)
        inside *= int(count.value)
    return 1 + inside


def named(form: Form, local: frozenset[str] = frozenset()) -> set[str]:
    """The keys of everything that evaluating `form` may evaluate by name or call."""
    if isinstance(form, Symbol):
        return {key_of(form)} - local
    head = form.head if isinstance(form, List) else None
    found = set() if head is None else {head}
    if head in ("let", "dotimes"):
        binding = items(arguments(form)[0])
        names = {key_of(items(pair)[0]) for pair in binding} if head == "let" else {key_of(binding[0])}
        outside = [arguments(pair)[0] for pair in binding] if head == "let" else []
        for part in outside:
            found |= named(part, local)
        for part in arguments(form)[1:]:
            found |= named(part, local | names)
        return found
    for part in evaluated(form):
        found |= named(part, local)
    return found


def deciding_tests(form: Form, known: Container[str], vocabulary: Vocabulary) -> list[Form] | None:
    """The parts of a message one of which must be true for it to match; None if it has no test and all match.

    They stand in its first COND, IF, WHEN or AND, also inside PROGN and LET. Of an AND it is the last of the leading
    operands that only look and do nothing. known: the operators that there are.
    """
    head = form.head if isinstance(form, List) else None
    rest = arguments(form)
    if head == "cond":
        return [items(clause)[0] for clause in rest] or None
    if head in ("if", "when"):
        return [rest[0]]
    if head == "and":
        looking = list(takewhile(lambda operand: not acts(operand, known, vocabulary), rest))
        return looking[-1:] or None
    for part in rest[1:] if head == "let" else rest if head == "progn" else ():
        if is_tested(part):
            return deciding_tests(part, known, vocabulary)
    return None


def is_tested(form: Form) -> bool:
    head = form.head if isinstance(form, List) else None
    if head in ("progn", "let"):
        return any(map(is_tested, arguments(form)[head == "let" :]))
    return head in ("cond", "if", "when", "and")


def acts(
    form: Form, known: Container[str], vocabulary: Vocabulary, local: frozenset[str] = frozenset()
) -> bool:
    """Whether `form` itself changes the robot or speaks (not what the buffers and operators do that it names)."""
    head = form.head if isinstance(form, List) else None
    if head is None:
        return False
    if head in ("let", "dotimes"):
        binding = items(arguments(form)[0])
        local |= {key_of(items(pair)[0]) for pair in binding} if head == "let" else {key_of(binding[0])}
    function = vocabulary.bindings.get(head)
    if isinstance(function, HostFunction):
        acting = function.acts
    elif head not in FUNCTIONS and head not in known:
        return False  # a function that the robot does not have does nothing, nor do its arguments
    else:
        acting = head in ACTING and not (head == "setq" and key_of(arguments(form)[0]) in local)
    return acting or any(acts(part, known, vocabulary, local) for part in evaluated(form))


ACTING = {"setq", "setqq", "defvar", "rule", "activate", "deactivate", "forget", "lease", "defun", "join", "leave"}
ACTING |= {"report", "print", "tell", "ping", "rollback", *FLAGS}


class Reference:
    """One robot's mind: the state, and `evaluate`.

    values: support variables, sensors and actuators by key. Of the last evaluation: whether its top-level test was
    true (matched), the reasons of its faults, and what it printed, told and pinged.
    """

    def __init__(
        self, vocabulary: Vocabulary, *, number: int = 0, seed: int = 0, body: object | None = None
    ) -> None:
        self.vocabulary, self.body = vocabulary, body
        self.chance, self.tick, self.draws = stream(seed, number), 0, 0
        variables = [b for b in vocabulary.bindings.values() if isinstance(b, Variable)]
        self.values = {v.name.casefold(): 0.0 if v.kind is Kind.SUPPORT else UNKNOWN for v in variables}
        self.values |= {"id": float(number), "tick": 0.0, "time": 0.0}
        self.user: dict[str, float] = {}
        self.stored: dict[str, Form] = {}
        self.active: set[str] = set()
        self.operators: dict[str, Operator] = {}
        self.groups: dict[str, bool] = {}
        self.faults: list[str] = []
        self.printed: list[Told] = []
        self.told: list[str] = []
        self.pings: list[float] = []
        self.steps = self.calls = 0
        self.tests: list[Form] = []
        self.matched = False

    def evaluate(self, text: str) -> float:
        """The value of the one expression in `text`. Raises ReadError if it is none."""
        form = read(text)
        self.faults, self.printed, self.told, self.pings = [], [], [], []
        self.steps = self.calls = 0
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
        if self.calls > MAX_CALLS:
            return self.fault("calls nested too deeply")
        self.steps += sum(map(cost, program)) + (len(program) > 1)
        if self.steps > MAX_STEPS:
            raise OutOfSteps
        self.calls += 1
        value = self.in_turn(program, scope)
        self.calls -= 1
        return value

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
        head = form.head if isinstance(form, List) else None
        assert head is not None, form
        special = getattr(self, "do_" + SPECIAL[head], None) if head in SPECIAL else None
        if special is not None:
            return float(special(arguments(form), scope))
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
        if key in self.stored:
            return self.enter((self.stored[key],), ChainMap())
        if key in self.values:
            return self.values[key]
        binding = self.vocabulary.bindings.get(key)
        if isinstance(binding, Constant):
            return binding.value
        return self.user.get(key, UNKNOWN)

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
        counter, count = items(forms[0])
        assert isinstance(count, Number)
        for i in range(int(count.value)):
            self.in_turn(forms[1:], scope.new_child({key_of(counter): float(i)}))
        return 0.0

    # ---- assignment ----

    def do_setq(self, forms: Sequence[Form], scope: Scope) -> float:
        key, form = key_of(forms[0]), forms[1]
        if buffer_number(key) is not None:
            return self.set_buffer(key, form, scope)
        value = self.value(form, scope)
        binding = self.vocabulary.bindings.get(key)
        for own in scope.maps:
            if key in own:
                own[key] = value
                return value
        if key in self.user:
            self.user[key] = value
        elif not isinstance(binding, Variable) or binding.kind is Kind.SENSOR:
            return self.fault(key)
        elif math.isnan(value):
            return self.fault("unknown")
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
            if self.taken(key, "user variable"):
                return UNKNOWN
            self.user[key] = self.value(forms[1], scope) if forms[1:] else UNKNOWN
        return self.user[key]

    # ---- rules and operators ----

    def store(self, key: str, form: Form, result: float) -> float:
        if self.reaches(key, named(form)):
            return self.fault("names itself")
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
        sorts = {
            "user variable": self.user,
            "rule": self.stored,
            "operator": self.operators,
            "group": self.groups,
        }
        other = next((kind for kind, names in sorts.items() if kind != sort and key in names), None)
        if other is not None:
            self.fault(f"is already a {other}".replace("a user", "a").replace("a operator", "an operator"))
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
            return self.fault("names itself")
        self.operators[key] = new
        return 1.0

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
        template = forms[0]
        if is_call(template, QUOTE):
            self.told.append(show(arguments(template)[0]))
            return 1.0
        if is_call(template, QUASIQUOTE):
            template = arguments(template)[0]
        numbers = [self.value(form, scope) for form in unquoted(template)]
        if any(map(math.isnan, numbers)):
            return self.fault("unknown")
        self.told.append(show(filled(template, iter(numbers))))
        return 1.0

    def do_ping(self, forms: Sequence[Form], scope: Scope) -> float:
        self.pings.append(self.value(forms[0], scope) if forms else 0.0)
        return 1.0


def filled(template: Form, numbers: Iterator[float]) -> Form:
    """`template` with the place of every comma taken by the next of `numbers`."""
    if is_call(template, UNQUOTE):
        return Number(next(numbers))
    if isinstance(template, List):
        return List(tuple(filled(item, numbers) for item in template.items))
    return template


SPECIAL = {method[3:]: method[3:] for method in dir(Reference) if method.startswith("do_")} | {"print": "report"}
"""The special forms and what evaluates them."""
