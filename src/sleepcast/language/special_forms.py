"""How each special form is taken apart: which of its pieces are names, which are kept, which are evaluated.

One function for each form, found by name in `SPECIAL`; the number of arguments has been checked before.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from math import nan

from sleepcast.core.errors import decimal_comma, did_you_mean, with_article
from sleepcast.core.model import Constant, HostFunction
from sleepcast.core.units import TIME
from sleepcast.language import areas
from sleepcast.language.checker import STORE_STEPS, Checker, Special
from sleepcast.language.functions import (
    AUCTIONS,
    CHOOSING,
    EACH,
    FUNCTIONS,
    INSTANTS,
    LEASE,
    MAX_CHOSEN,
    MAX_EACH,
    MAX_HOPS,
    MAX_REDUCED,
    MAX_REPEATS,
    MAX_WAIT,
    NEIGHBOURS,
    OVER,
    PRIORITY,
    TIMED,
    WINDOW,
)
from sleepcast.language.parts import (
    ONLY_PRIORITY,
    Auction,
    Defining,
    Label,
    Part,
    Storing,
    Template,
    Timed,
    is_acting,
    label_of,
    rank_of,
    ranked,
    walk,
)
from sleepcast.language.reader import (
    MAX_NESTING,
    MAX_TEXT,
    QUASIQUOTE,
    QUOTE,
    UNQUOTE,
    Form,
    List,
    Number,
    Symbol,
    Text,
    height,
    show,
)
from sleepcast.language.reader import walk as walk_forms
from sleepcast.language.remembering import FORMS, SHARE
from sleepcast.language.vocabulary import Variable, VariableKind, buffer_number, rule_key

MAX_LOOPS = 4
"""DOTIMES inside DOTIMES at most."""
MAX_AROUND = 2
"""Forms that go through neighbours inside one another at most: each pair of them is what one may ask for."""

SPECIAL: dict[str, Special] = {}


def _special(*names: str) -> Callable[[Special], Special]:
    def register(how: Special) -> Special:
        for name in names:
            SPECIAL[name] = how
        return how

    return register


# ---- control


@_special("and", "or", "known", "if", "progn", "prob", "random", "gauss")
def _plain(checker: Checker, form: List) -> Part:
    return Part(form.head or "", form, checker.parts(form.items[1:]))


@_special("when")
def _when(checker: Checker, form: List) -> Part:
    return Part("cond", form, (_clause(checker, form, form.items[1:]),))


@_special("cond")
def _cond(checker: Checker, form: List) -> Part:
    clauses = []
    for item in form.items[1:]:
        if isinstance(item, List) and item.items:
            clauses.append(_clause(checker, item, item.items))
        else:
            checker.error("a clause of COND @@ is a list: wanted (test expr ...)", item)
    return Part("cond", form, tuple(clauses))


def _clause(checker: Checker, where: List, items: tuple[Form, ...]) -> Part:
    if items is where.items and not checker.prefixed(
        where, 0, is_call=False
    ):  # a WHEN was looked at as the call that it is
        return Part("clause", where, (Part("const", where, number=nan),))
    return Part("clause", where, checker.parts(items))


@_special("dice")
def _dice(checker: Checker, form: List) -> Part:
    clauses = []
    for item in form.items[1:]:
        if isinstance(item, List) and len(item.items) == 2:
            clauses.append(_clause(checker, item, item.items))
        else:
            checker.error("a side of DICE @@ is a list of two: wanted (chance expr)", item)
    return Part("dice", form, tuple(clauses))


@_special("let")
def _let(checker: Checker, form: List) -> Part:
    bindings = form.items[1]
    names: list[str] = []
    values: list[Part] = []
    if not isinstance(bindings, List):
        return checker.error("LET @@ begins with its names: wanted ((name expr) ...)", bindings)
    for item in bindings.items:
        if isinstance(item, List) and len(item.items) == 2 and isinstance(item.items[0], Symbol):
            if item.items[0].key in names:
                checker.error(f"{item.items[0].text} @@ is named twice in one LET", item)
            checker.may_be_local(item.items[0])
            names.append(item.items[0].key)
            values.append(checker.part(item.items[1]))
        else:
            checker.error("a binding of LET @@ is a list of two: wanted (name expr)", item)
    with checker.scope(names) as numbers:
        body = checker.parts(form.items[2:])
    return Part("let", form, (*values, *body), slot=numbers[0] if numbers else 0, number=len(values))


@_special("dotimes")
def _dotimes(checker: Checker, form: List) -> Part:
    head = form.items[1]
    if not (isinstance(head, List) and len(head.items) == 2 and isinstance(head.items[0], Symbol)):
        return checker.error("DOTIMES @@ begins with its counter: wanted (name count)", head)
    name, count = head.items
    if not (
        isinstance(count, Number)
        and count.dimension is None
        and count.value.is_integer()
        and 0 <= count.value <= MAX_REPEATS
    ):
        return checker.error(f"the count of DOTIMES @@ must be a whole number from 0 to {MAX_REPEATS}", count)
    if checker.loops >= MAX_LOOPS:
        return checker.error(f"DOTIMES @@ stands inside {MAX_LOOPS} others: at most {MAX_LOOPS} nest", form)
    checker.may_be_local(name)  # type: ignore[arg-type]
    checker.loops += 1
    with checker.scope([name.key], f"the counter {name.text} @@ of a DOTIMES") as (number,):  # type: ignore[attr-defined]
        body = checker.parts(form.items[2:])
    checker.loops -= 1
    return Part("dotimes", form, body, slot=number, number=count.value)


# ---- neighbours


@_special(*OVER)
def _over(checker: Checker, form: List) -> Part:
    part = _around(checker, form, "over", MAX_REDUCED)
    deed = next(filter(is_acting, walk(part)), None)
    if deed is not None:
        name = (form.head or "").upper()
        return checker.error(
            f"what {name} evaluates @@ must only look: {EACH.upper()} does something for each", deed.form
        )
    return part


@_special(EACH)
def _each(checker: Checker, form: List) -> Part:
    return _around(checker, form, "each", MAX_EACH)


def _around(checker: Checker, form: List, op: str, most: int) -> Part:
    """A form that goes through the neighbours in a radius, perhaps of a colour."""
    head, name = form.items[1], (form.head or "").upper()
    if not (isinstance(head, List) and 2 <= len(head.items) <= 3 and isinstance(head.items[0], Symbol)):
        wanted = "wanted (name radius) or (name radius colour)"
        return checker.error(f"{name} @@ begins with the name of a neighbour and a radius: {wanted}", head)
    if checker.around >= MAX_AROUND:
        return checker.error(f"{name} @@ stands inside {MAX_AROUND} that go through neighbours: no more nest", form)
    target = head.items[0]
    checker.may_be_local(target)
    which = checker.parts(head.items[1:])
    checker.around += 1
    with checker.scope([target.key], f"{target.text} @@ is a neighbour: it") as (number,):
        body = Part("clause", form, checker.parts(form.items[2:]))
    checker.around -= 1
    sensor = _sensor(checker, form)
    if sensor is None:
        return Part("missing", form, name=name)
    return Part(op, form, (*which, body), slot=number, name=name, number=float(most), data=sensor)


@_special("of")
def _of(checker: Checker, form: List) -> Part:
    neighbour, field = checker.part(form.items[1]), form.items[2]
    if not isinstance(field, Symbol):
        checker.part(field)
        return checker.error("OF @@ wants a neighbour and the name of what it shows: (OF n x)", field)
    sensor = _sensor(checker, form)
    if sensor is None or sensor.neighbours is None:
        return Part("missing", form, name="OF")
    fields = {name.casefold(): function for name, function in sensor.neighbours.fields}
    function = fields.get(field.key)
    if function is None:
        shown = [name for name, _ in sensor.neighbours.fields]
        listed = did_you_mean(field.text, shown) or f": they show {', '.join(shown)}"
        checker.warn(f'neighbours show no "{field.text}" @@{listed}', field, field.text)
        return Part("absent", form, name=f"of {field.key}")
    return Part("host", form, (neighbour,), slot=-1, name=f"of {field.key}", data=function)


def _sensor(checker: Checker, form: List) -> HostFunction | None:
    """What tells robots who is near them; None, and a warning, for robots that know nothing of neighbours."""
    vocabulary = checker.names.vocabulary
    sensor = vocabulary.neighbours if NEIGHBOURS in vocabulary.forms else None
    if sensor is None:
        name = (form.head or "").upper()
        checker.warn(f"{name} @@ is a fault on these robots, which tell no neighbours apart", form.items[0], name)
    return sensor


# ---- the best so many, and a quorum


@_special(*AUCTIONS)
def _auction(checker: Checker, form: List) -> Part:
    name, is_whole = (form.head or "").upper(), checker.checked == 1
    rest = form.items[2 if name == "BEST" else 3 :]
    cost, rest = (rest[0], rest[1:]) if name == "BEST" else (_NO_COST, rest)
    looked, test, command = checker.parts(form.items[2:3] if name == "BEST" else ()), *checker.parts(rest[:2])
    if not is_whole:
        return checker.error(f"{name} @@ is a whole command, sent once: it stands in no other expression", form)
    if CHOOSING not in checker.names.vocabulary.forms:
        return checker.error(f"{name} @@ came after what these robots run", form)
    auction = _wanted(checker, form)
    for part in (*looked, test):
        if (deed := next(filter(is_acting, walk(part)), None)) is not None:
            what = "test" if part is test else "cost"
            checker.error(f"the {what} of {name} @@ does something: robots that are not chosen do it too", deed.form)
    bid, obey = (show(List((_WHEN, rest[0], each))) for each in (cost, rest[1]))
    joins = tuple(label_of(part).casefold() for part in walk(command) if part.op == "act" and part.name == "join")
    storing = (part.data for part in walk(command) if isinstance(part.data, Storing) and part.data.activate)
    rules = tuple((each.key, show(each.form)) for each in storing)
    whole = auction._replace(bid=bid, command=obey, joins=joins, rules=rules)
    chosen = Part("auction", form, (*looked, command), name=name, data=whole)
    return Part("cond", form, (Part("clause", form, (test, chosen)),))


def _wanted(checker: Checker, form: List) -> Auction:
    """How many robots are wanted by a BEST or QUORUM, and the times behind its command."""
    name = (form.head or "").upper()
    counts = [_chosen(checker, name, each) for each in form.items[1 : 2 if name == "BEST" else 3]]
    if counts[0] > counts[-1]:
        checker.error(f"at least {counts[0]} and at most {counts[-1]} robots @@: none can be both", form)
    least = counts[0] if name == "QUORUM" else 1
    return Auction(name, least, counts[-1], "", "", *_times(checker, name, form.items[5:]), (), ())


_WHEN, _NO_COST = Symbol("WHEN"), Number(0.0)
_WINDOWS, _LEASES = (0.2, 10.0), (1.0, 3_600.0)
"""Bounds of the times of these forms, s: a round trip on a radio that loses half takes some tenths, and a lease is
renewed several times before it ends."""


def _chosen(checker: Checker, name: str, count: Form) -> int:
    """A number of robots."""
    if isinstance(count, Number) and count.dimension is None and count.value in range(1, MAX_CHOSEN + 1):
        return int(count.value)
    checker.error(f"{name} chooses a number of robots @@: wanted a whole number from 1 to {MAX_CHOSEN}", count)
    return 1


def _times(checker: Checker, name: str, behind: tuple[Form, ...]) -> tuple[float, float]:
    """The seconds of the window and of the lease, as what stands behind the command says."""
    times, bounds = {WINDOW: 1.0, LEASE: 4.0}, {WINDOW: _WINDOWS, LEASE: _LEASES}
    for key, time in zip(behind[::2], (*behind[1::2], None), strict=False):
        match key, time:
            case Symbol(key=(":window" | ":lease") as which), Number(value=value, dimension=dimension) if (
                dimension in (None, TIME) and bounds[which][0] <= value <= bounds[which][1]
            ):
                times[which] = value
            case _:
                wanted = " or ".join(f"{each} and {low:g}s to {high:g}s" for each, (low, high) in bounds.items())
                checker.error(f"what follows the command of {name} @@ can only be {wanted}", key)
    return times[WINDOW], times[LEASE]


# ---- an instant for all


@_special("after-issue")
def _after_issue(checker: Checker, form: List) -> Part:
    time, is_whole = form.items[1], checker.checked == 1
    command = checker.part(form.items[2])
    if not is_whole:
        return checker.error("AFTER-ISSUE @@ is a whole command, sent once: it stands in no other expression", form)
    if TIMED not in checker.names.vocabulary.forms:
        return checker.error("AFTER-ISSUE @@ came after what these robots run", form)
    wait = time.value if isinstance(time, Number) and time.dimension in (None, TIME) else nan
    if not 0.0 < wait <= MAX_WAIT:
        checker.error(f"AFTER-ISSUE waits for a time @@: wanted more than 0s and at most {MAX_WAIT:g}s", time)
    return Part("timed", form, (command,), data=Timed(wait, show(form.items[2])))


@_special("cancel")
def _cancel(checker: Checker, form: List) -> Part:
    if TIMED not in checker.names.vocabulary.forms:
        return checker.error("CANCEL @@ came after what these robots run", form)
    return Part("act", form, name="cancel")


# ---- assignment


@_special("setq")
def _setq(checker: Checker, form: List) -> Part:
    target, value = form.items[1:]
    if not isinstance(target, Symbol):
        checker.part(value)
        return checker.error("SETQ @@ wants the name of a variable or buffer", target)
    number = checker.local(target.key)
    if number is not None:
        if number in checker.fixed_locals:
            return checker.error(f"{checker.fixed_locals[number]} cannot be assigned", target)
        return Part("set_local", form, (checker.part(value),), slot=number, name=target.key)
    if buffer_number(target.key) is not None:
        if isinstance(value, List) and value.head == QUOTE and len(value.items) == 2:
            return _store(checker, form, target, value.items[1], activate=False)
        if buffer_number(target.key) == 0:
            return _store(checker, form, target, value, activate=False)
        storing = Storing(f"e{buffer_number(target.key)}", value, activate=False, value=True)
        return Part("store", form, (checker.part(value),), name=storing.key, number=STORE_STEPS, data=storing)
    part = checker.part(value)
    binding = checker.binding(target.key)
    if isinstance(binding, Variable):
        if binding.kind is VariableKind.SENSOR:
            return checker.error(f"{target.text} @@ is a sensor: it can be read, not assigned", target)
        return Part("write", form, (part,), slot=binding.slot, name=target.key, data=binding)
    if isinstance(binding, Constant):
        return checker.error(f"{target.text} @@ is a constant: it cannot be assigned", target)
    if isinstance(binding, HostFunction) or target.key in FUNCTIONS:
        return checker.error(f"{target.text} @@ is a function: it cannot be assigned", target)
    kind = checker.kind_of(target.key)
    if kind == "variable":
        declared = checker.names.declared(target.key) is not None
        return Part(
            "set_user" if declared else "write",
            form,
            (part,),
            slot=checker.user_slot(target),
            name=target.key,
        )
    if kind is not None:
        return checker.error(f"{target.text} @@ is {with_article(kind)}, not a variable", target)
    checker.warn(
        f'unknown name "{target.text}" @@{checker.suggestion(target.text)}: make it first with (DEFVAR {target.text})',
        target,
    )
    return Part("write", form, (part,), slot=-1, name=target.key)


@_special("setqq")
def _setqq(checker: Checker, form: List) -> Part:
    target, body = form.items[1:]
    if not isinstance(target, Symbol) or buffer_number(target.key) is None:
        return checker.error("SETQQ @@ wants a buffer, E1 to E63", target)
    return _store(checker, form, target, body, activate=False)


@_special("rule")
def _rule(checker: Checker, form: List) -> Part:
    target, body = form.items[1:3]
    if not isinstance(target, Symbol):
        return checker.error("RULE @@ wants a name", target)
    rank = rank_of(form.items[3:])
    if rank is None:
        checker.error(f"RULE stores one expression @@: {ONLY_PRIORITY}", form.items[3])
    elif len(form.items) > 3 and PRIORITY not in checker.names.vocabulary.forms:
        checker.error(f"{PRIORITY} @@ came after what these robots run", form.items[3])
    return _store(checker, form, target, body, activate=True, rank=rank or 0)


@_special(*FORMS)
def _remembering(checker: Checker, form: List) -> Part:
    checker.parts(form.items[1:])
    name = (form.head or "").upper()
    return checker.error(f"{name} @@ remembers from tick to tick: it stands in a rule, (RULE name ...)", form)


@_special(SHARE)
def _share(checker: Checker, form: List) -> Part:
    wanted = "wanted (RULE name (SHARE variable MAX)), or MIN, each perhaps with a step of 0 or more, or NEWEST"
    return checker.error(f"SHARE @@ stands in a rule: {wanted}", form)


def _store(checker: Checker, form: List, target: Symbol, body: Form, *, activate: bool, rank: int = 0) -> Part:
    number = buffer_number(target.key)
    if number == 0:
        return checker.error("E0 @@ holds the message itself: nothing can be stored there", target)
    if number is None and not _is_free_for(checker, target, "rule"):
        return Part("const", form, number=nan)
    key = rule_key(target.key)
    if height(body) > MAX_NESTING or len(show(body)) > MAX_TEXT:
        return checker.error("this rule @@, written out, is too long or too deeply nested: use two rules", form)
    steps = checker.stored(key, (body,), [], target)
    return Part("store", form, name=key, number=steps, data=Storing(key, body, activate=activate, rank=rank))


def _is_free_for(checker: Checker, target: Symbol, kind: str) -> bool:
    meaning = checker.meaning(target.key)
    if meaning is None or meaning == kind:
        return True
    taken = with_article(meaning)
    checker.error(f"{target.text} @@ is already {taken}: choose another name for the {kind}", target)
    return False


@_special("defvar")
def _defvar(checker: Checker, form: List) -> Part:
    target = form.items[1]
    values = checker.parts(form.items[2:])
    if not isinstance(target, Symbol):
        return checker.error("DEFVAR @@ wants a name", target)
    if not _is_free_for(checker, target, "variable"):
        return Part("const", form, number=nan)
    return Part("defvar", form, values, slot=checker.user_slot(target), name=target.key)


@_special("defun")
def _defun(checker: Checker, form: List) -> Part:
    target, parameters = form.items[1], form.items[2]
    if not isinstance(target, Symbol):
        return checker.error("DEFUN @@ wants a name", target)
    if not isinstance(parameters, List) or not all(isinstance(p, Symbol) for p in parameters.items):
        return checker.error("DEFUN @@ wants its parameters in parentheses: (name ...)", parameters)
    keys = [p.key for p in parameters.items if isinstance(p, Symbol)]
    if len(set(keys)) < len(keys):
        return checker.error("a parameter @@ is named twice", parameters)
    for parameter in parameters.items:
        checker.may_be_local(parameter)  # type: ignore[arg-type]
    if not _is_free_for(checker, target, "operator"):
        return Part("const", form, number=nan)
    steps = checker.stored(target.key, form.items[3:], keys, target)
    defining = Defining(tuple(p.text for p in parameters.items if isinstance(p, Symbol)), form.items[3:])
    return Part("act", form, name="defun", number=steps, data=defining)


# ---- places and areas


@_special("dist")
def _distance(checker: Checker, form: List) -> Part:
    if len(form.items) == 6:
        return checker.error("5 numbers @@: wanted x and y of two points, or x, y and z", form)
    return Part("pure", form, checker.parts(form.items[1:]), name="DIST", data=FUNCTIONS["dist"])


@_special("edge-dist")
def _edge_distance(checker: Checker, form: List) -> Part:
    if len(form.items) % 2 == 0:
        return checker.error(f"{len(form.items) - 1} numbers @@: wanted x and y of a point and of each corner", form)
    return Part("pure", form, checker.parts(form.items[1:]), name="EDGE-DIST", data=FUNCTIONS["edge-dist"])


@_special("area")
def _area(checker: Checker, form: List) -> Part:
    target, sizes = form.items[1], form.items[2:]
    if not isinstance(target, Symbol):
        checker.parts(sizes)
        return checker.error("AREA @@ wants a name, then its corners", target)
    if not _is_free_for(checker, target, "operator"):
        return Part("const", form, number=nan)
    if (wrong := areas.wrong(sizes)) is not None:
        checker.parts(sizes)
        return checker.error(*wrong)
    body = areas.written_out(sizes, form)
    steps = checker.stored(target.key, (body,), [], target)
    return Part("act", form, name="defun", number=steps, data=Defining((), (body,)))


@_special("inside", "to-edge")
def _of_area(checker: Checker, form: List) -> Part:
    head, target = form.items
    if not isinstance(target, Symbol):
        checker.part(target)
        return checker.error(f"{(form.head or '').upper()} @@ wants the name of an area", target)
    meaning = checker.meaning(target.key)
    if meaning is None:
        checker.unknown("area", target)
    elif meaning != "operator":
        return checker.error(f"{target.text} @@ is {with_article(meaning)}, not an area", target)
    elif checker.parameters(target.key):
        return checker.error(f"{target.text} @@ takes arguments, so it is not an area", target)
    checker.uses.add(target.key)
    distance = List((Symbol("TO-EDGE", head.start, head.end), target), form.start, form.end)
    to_edge = Part("call", distance, name=target.key)
    if form.head == "to-edge":
        return to_edge
    nothing = Part("const", Number(0.0, "m", "0m", form.start, form.end))
    return Part("pure", form, (to_edge, nothing), name=">=", data=FUNCTIONS[">="])


# ---- names of rules and groups


@_special("activate", "deactivate", "forget")
def _about_rule(checker: Checker, form: List) -> Part:
    return Part("act", form, (), name=form.head or "", data=Label(_named_rule(checker, form.items[1])))


@_special("lease")
def _lease(checker: Checker, form: List) -> Part:
    seconds = checker.part(form.items[2])
    return Part("act", form, (seconds,), name="lease", data=Label(_named_rule(checker, form.items[1])))


def _named_rule(checker: Checker, target: Form) -> str:
    if not isinstance(target, Symbol):
        checker.error("the name of a rule or buffer is wanted @@", target)
        return ""
    number = buffer_number(target.key)
    if number is not None:
        if number == 0:
            checker.error("E0 @@ is the message itself: it is evaluated once and never active", target)
        return f"e{number}"
    meaning = checker.meaning(target.key)
    if meaning is None:
        checker.unknown("rule", target)
    elif meaning not in ("rule", "operator"):
        checker.error(f"{target.text} @@ is a {meaning}, not a rule", target)
    return target.key


@_special("join", "leave", "in")
def _group(checker: Checker, form: List) -> Part:
    target = form.items[1]
    if not isinstance(target, Symbol):
        return checker.error(f"{form.items[0].text} @@ wants the name of a group", target)  # type: ignore[attr-defined]
    if not _is_free_for(checker, target, "group"):
        return Part("const", form, number=nan)
    if form.head != "join" and checker.meaning(target.key) is None:
        checker.doubt_group(target)
    if form.head == "in":
        return Part("in", form, name=target.key)
    return Part("act", form, name=form.head or "", data=Label(target.text))


# ---- speaking


@_special("report", "print")
def _report(checker: Checker, form: List) -> Part:
    first, *rest = form.items[1:]
    label = first.value if isinstance(first, Text) else ""
    forms = tuple(rest) if isinstance(first, Text) else form.items[1:]
    return Part("act", form, checker.parts(forms), name="report", data=Label(label))


@_special("ping")
def _ping(checker: Checker, form: List) -> Part:
    return Part("act", form, checker.parts(form.items[1:]), name="ping")


@_special("tell")
def _tell(checker: Checker, form: List) -> Part:
    template = form.items[1]
    head = template.head if isinstance(template, List) and len(template.items) == 2 else None
    unquoted: list[Form] = []
    if head in (QUOTE, QUASIQUOTE):
        template = template.items[1]  # type: ignore[attr-defined]
    if head != QUOTE:
        _collect_unquoted(checker, template, unquoted)
    hops = _hops(checker, form)
    auction = _told_auction(checker, template)
    if (inside := _told_instant(checker, template)) is not None:
        checker.error("a TELL carries no AFTER-ISSUE or CANCEL @@: only a desk sends them", inside)
    if (rank := ranked(template)) is not None:
        checker.error(f"a TELL @@ cannot give a rule a {PRIORITY}: only a commander can", rank)
    parts = checker.parts(tuple(unquoted))
    # Robots that hear it may keep the same under these names: a rule must not come to tell itself for ever.
    checker.uses |= _entered(template)
    return Part("act", form, parts, name="tell", data=Template(template, tuple(unquoted), hops, auction))


def _told_auction(checker: Checker, told: Form) -> Auction | None:
    """What a told form asks for that is a BEST or QUORUM; an error if it has one inside. Names of people's own are
    none."""
    lists = (each for each in walk_forms(told) if isinstance(each, List) and each.head in AUCTIONS)
    found = [each for each in lists if checker.meaning(each.head or "") is None]
    for each in found:
        name = (each.head or "").upper()
        if each is not told:
            checker.error(f"{name} @@ is a whole command: a TELL can tell it, but nothing around it", each)
        elif len(each.items) < _LEAST_ITEMS:
            checker.error(f"{name} @@ is not complete: see (help {each.head})", each)
        elif CHOOSING not in checker.names.vocabulary.forms:
            checker.error(f"{name} @@ came after what these robots run", each)
        else:
            continue
        return None
    return _wanted(checker, told) if found and isinstance(told, List) else None


_LEAST_ITEMS = 5
"""The word, two numbers or a number and a cost, the test and the command."""


def _told_instant(checker: Checker, told: Form) -> Form | None:
    """Where a told form has an AFTER-ISSUE or CANCEL that is no name of people's own; None if it has none."""
    lists = (each for each in walk_forms(told) if isinstance(each, List) and each.head in INSTANTS)
    return next((each for each in lists if checker.meaning(each.head or "") is None), None)


def _hops(checker: Checker, form: List) -> int:
    """How far a TELL goes: 1, or what follows `:hops`."""
    match form.items[2:]:
        case ():
            return 1
        case (Symbol(key=":hops"), Number(dimension=None, value=hops)) if hops in range(1, MAX_HOPS + 1):
            return int(hops)
    checker.error(f"TELL tells one expression @@: what follows it can only be :hops and 1 to {MAX_HOPS}", form.items[2])
    return 1


def _entered(form: Form) -> set[str]:
    """The keys of what evaluating a told form may enter: names in it that are not only written to, or kept unread."""
    if isinstance(form, Symbol):
        return {rule_key(form.key)}
    if not isinstance(form, List) or form.head in _UNREAD or not form.items:
        return set()
    rest = form.items[2:] if form.head in _NAMING else form.items[1:]
    head = {form.head} if form.head and form.head not in FUNCTIONS else set()
    return head.union(*map(_entered, rest))


_UNREAD = frozenset(
    {QUOTE, UNQUOTE, "setqq", "rule", "defun", "area", "activate", "deactivate", "forget", "join", "leave", "in"}
)
"""Forms whose names are kept, looked up or filled in, and not evaluated where they are heard."""
_NAMING = frozenset({"setq", "defvar", "lease"})
"""Forms whose first argument is only a name."""


def _collect_unquoted(checker: Checker, form: Form, unquoted: list[Form]) -> None:
    if isinstance(form, List):
        if form.head == UNQUOTE and len(form.items) == 2:
            if comma := _decimal_comma(checker, form):
                checker.error(f"a comma in a number @@{comma}", form)
            unquoted.append(form.items[1])
        else:
            for item in form.items:
                _collect_unquoted(checker, item, unquoted)


def _decimal_comma(checker: Checker, form: List) -> str:
    """What is said of `12,5`, which is read as 12 and an unquoted 5; "" for every other form."""
    before, item = checker.text[: form.start], form.items[-1]
    digits = re.search(r"[+-]?\d+\Z", before)
    if form.head != UNQUOTE or not isinstance(item, Number) or digits is None or before[-1:] == ",":
        return ""
    return decimal_comma(f"{digits[0]}{checker.text[form.start : form.end]}")


@_special(QUOTE, QUASIQUOTE, UNQUOTE)
def _quote(checker: Checker, form: List) -> Part:
    if comma := _decimal_comma(checker, form):
        return checker.error(f"a comma in a number @@{comma}", form)
    return checker.error("a quoted expression @@ stands only as what SETQ stores into a buffer, and inside TELL", form)
