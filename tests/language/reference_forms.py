"""What the reference sees in a form before it evaluates it: its parts, its cost, what it names, what its test is."""

from __future__ import annotations

from collections.abc import Container, Iterator
from itertools import takewhile

from sleepcast.core.model import HostFunction
from sleepcast.language.functions import FUNCTIONS
from sleepcast.language.reader import QUOTE, UNQUOTE, Form, List, Number, Symbol, Text
from sleepcast.language.vocabulary import Vocabulary, buffer_number

NAMING = {
    "setqq", "rule", "defun", "area", "inside", "to-edge", "activate", "deactivate", "forget", "join", "leave", "in",
    QUOTE,
}  # fmt: skip
"""Calls whose arguments are names and stored text: nothing of them is evaluated."""
AROUND = {
    "sum-over": 256, "mean-over": 256, "min-over": 256, "max-over": 256, "count-over": 256, "best-over": 256,
    "for-neighbours": 64,
}  # fmt: skip
"""Calls that evaluate their rest for each neighbour, and for how many at most."""
CHOOSING = {"best": 1, "quorum": 2}
"""Whole commands that choose among robots, and how many numbers of robots each begins with."""
FLAGS = {
    "sleep": ("sleeping", 1.0),
    "wake": ("sleeping", 0.0),
    "freeze": ("frozen", 1.0),
    "thaw": ("frozen", 0.0),
    "mark": ("marked", 1.0),
    "unmark": ("marked", 0.0),
}
"""Acts that set a support flag, and to what."""
ACTING = (NAMING | {"setq", "defvar", "lease", "report", "print", "tell", "ping", "rollback", "cancel", *FLAGS}) - {
    "in", "inside", "to-edge", QUOTE,
}  # fmt: skip
"""Calls that change the robot or speak."""


def head_of(form: Form) -> str:
    """The key of the function that a list calls, "" for what is no call."""
    return form.head or "" if isinstance(form, List) else ""


def arguments(form: Form) -> tuple[Form, ...]:
    return form.items[1:] if isinstance(form, List) else ()


def is_call(form: Form, key: str) -> bool:
    return isinstance(form, List) and form.head == key


def chooses(form: Form) -> bool:
    """Whether a list is a command that chooses among robots, and no call of an operator of that name."""
    return head_of(form) in CHOOSING and len(arguments(form)) >= 4


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
    head = head_of(form)
    if head in ("cond", "dice"):
        return [part for clause in rest for part in items(clause)]
    if head == "let":
        return [arguments(pair)[0] for pair in items(rest[0])] + rest[1:]
    if head in AROUND:
        return [*items(rest[0])[1:], *rest[1:]]
    if head == "of":
        return rest[:1]
    if chooses(form):
        return rest[CHOOSING[head] : 4]
    if head == "after-issue":
        return rest[1:]
    if head == "tell":
        return [] if is_call(rest[0], QUOTE) else list(unquoted(rest[0]))
    if head in ("setq", "lease", "defvar", "dotimes"):
        rest = rest[1:]
    elif head in NAMING:
        rest = []
    return [part for part in rest if not isinstance(part, Text) and not is_call(part, QUOTE)]


def items(form: Form) -> tuple[Form, ...]:
    return form.items if isinstance(form, List) else ()


def key_of(form: Form) -> str:
    """The key of a name; that of a buffer is always `e5`, also where it is written `expr5`."""
    assert isinstance(form, Symbol), form
    number = buffer_number(form.key)
    return form.key if number is None else f"e{number}"


def cost(form: Form) -> int:
    """Steps charged on entering `form`: one for each number, name and call in it, as often as DOTIMES repeats it; a
    call that stores an expression costs 40 more, and one for each number, name and call in that."""
    if (most := AROUND.get(head_of(form))) is not None:
        which = items(arguments(form)[0])[1:]
        return 1 + sum(map(cost, which)) + most * sum(map(cost, arguments(form)[1:]))
    inside = sum(map(cost, evaluated(form)))
    storing = 40 + sum(map(size, kept)) if (kept := stored(form)) is not None else 0
    edge = 2 if is_call(form, "inside") else 0  # it compares the distance to the edge with a number
    edge += chooses(form)  # the choosing itself, behind the test
    return 1 + edge + storing + (inside * repeats(arguments(form)[0]) if is_call(form, "dotimes") else inside)


def size(form: Form) -> int:
    """How many numbers, names and calls there are to evaluate in `form` and in what it stores."""
    edge = 2 if is_call(form, "inside") else 0
    return 1 + edge + sum(map(size, (*evaluated(form), *(stored(form) or ()))))


def stored(form: Form) -> tuple[Form, ...] | None:
    """The expressions that a call stores, () if it stores a value as an expression, None if it stores nothing."""
    head, rest = head_of(form), arguments(form)
    if head == "setq":
        buffer = isinstance(rest[0], Symbol) and buffer_number(rest[0].key) is not None
        return (arguments(rest[1]) if is_call(rest[1], QUOTE) else ()) if buffer else None
    if head == "area":
        there = (Symbol("x"), Symbol("y"))
        disc = List((Symbol("-"), *rest[3:4], List((Symbol("DIST"), *there, *rest[1:3]))))
        return (disc if len(rest) == 4 else List((Symbol("EDGE-DIST"), *there, *rest[1:])),)
    return rest[1:2] if head in ("setqq", "rule") else rest[2:] if head == "defun" else None


def height(form: Form) -> int:
    """Lists inside one another, those that are quoted and those that only declare included."""
    return 1 + max(map(height, items(form)), default=0) if isinstance(form, List) else 0


def repeats(counted: Form) -> int:
    """The count in the `(i 5)` of a DOTIMES."""
    count = items(counted)[1]
    assert isinstance(count, Number), counted
    return int(count.value)


def named(form: Form, local: frozenset[str] = frozenset()) -> set[str]:
    """The keys of everything that evaluating `form` may evaluate by name or call."""
    if isinstance(form, Symbol):
        return {key_of(form)} - local
    head = head_of(form)
    if head in ("inside", "to-edge") and isinstance(arguments(form)[0], Symbol):
        return {key_of(arguments(form)[0])}
    inside = local | bound(form)
    body = arguments(form)[1:] if head in ("let", "dotimes") or head in AROUND else ()
    found = {head} if head else set()
    for part in evaluated(form):
        found |= named(part, inside if any(part is other for other in body) else local)
    return found


def bound(form: Form) -> frozenset[str]:
    """The keys of the names that a LET, a DOTIMES or a form about neighbours makes for its body, none for anything
    else."""
    if is_call(form, "let"):
        return frozenset(key_of(items(pair)[0]) for pair in items(arguments(form)[0]))
    counted = is_call(form, "dotimes") or head_of(form) in AROUND
    return frozenset({key_of(items(arguments(form)[0])[0])}) if counted else frozenset()


def deciding_tests(
    form: Form, known: Container[str], vocabulary: Vocabulary, local: frozenset[str] = frozenset()
) -> list[Form] | None:
    """The parts of a message one of which must be true for it to match; None if it has no test and all match.

    They stand in its first COND, IF, WHEN or AND, also inside PROGN and LET. Of an AND it is the last of the leading
    operands that only look and do nothing. known: the operators that there are.
    """
    head = head_of(form)
    rest = arguments(form)
    if head == "cond":
        return [items(clause)[0] for clause in rest] or None
    if chooses(form):
        return [rest[2]]
    if head in ("if", "when"):
        return [rest[0]]
    if head == "and":
        looking = list(takewhile(lambda operand: not acts(operand, known, vocabulary, local), rest))
        return looking[-1:] or None
    for part in rest[head == "let" :] if head in ("let", "progn") else ():
        if is_tested(part):
            return deciding_tests(part, known, vocabulary, local | bound(form))
    return None


def is_tested(form: Form) -> bool:
    head = head_of(form)
    if head in ("progn", "let"):
        return any(map(is_tested, arguments(form)[head == "let" :]))
    return head in ("cond", "if", "when", "and")


def acts(form: Form, known: Container[str], vocabulary: Vocabulary, local: frozenset[str] = frozenset()) -> bool:
    """Whether `form` itself changes the robot or speaks (not what the buffers and operators do that it names)."""
    head = head_of(form)
    function = vocabulary.bindings.get(head)
    if isinstance(function, HostFunction):
        acting = function.acts
    elif head not in FUNCTIONS and head not in known and head != "area" and head != "of" and head not in AROUND:
        return False  # a function that the robot does not have does nothing, nor do its arguments
    else:
        acting = head in ACTING and not (head == "setq" and key_of(arguments(form)[0]) in local)
    return acting or any(acts(part, known, vocabulary, local | bound(form)) for part in evaluated(form))
