"""How the checker writes each special form: a function of the checker and the form, whose number of arguments is right,
that gives the cost. The others stand in `seldom.py` and `whole.py`."""

from micropython import const

from sleepnode.checker import GROUP, Function, buffer_number
from sleepnode.functions import gives_way, is_fixed
from sleepnode.reader import Refused, head_of

_STORE_STEPS = const(40)

# Instructions, by the numbers of `number_of`: constants cost no memory.
_ELSE = const(2)
_AND = const(8)
_WRITE = const(10)
_JUMP = const(11)
_MATCH = const(16)
_MATCH_IF = const(17)
_ELSE_TEST = const(18)
_AND_TEST = const(19)
_ANY = const(20)
_OR = const(21)
_OR_TEST = const(22)
_KNOWN = const(23)
_TAKE = const(24)
_KEEP = const(25)
_FLAG = const(35)
_UNKNOWN = const(36)
_PING = const(38)
_DEFINE = const(42)
_STORE_NUMBER = const(43)
_ASSIGN = const(48)
_DEFINED = const(53)
_STORE = const(54)
_REPORT = const(56)

_RULE = const(4)
"""The flag of a rule's program."""

# Refusals, by their places in `sentences.py`.
_REMEMBERS_REFUSED = const(30)
_QUOTED_REFUSED = const(31)
_A_GROUP_REFUSED = const(33)
_NOT_RULE_REFUSED = const(34)
_E0_ACTIVE_REFUSED = const(35)
_RULE_NAME_REFUSED = const(36)
_A_NAME_REFUSED = const(48)
_E0_REFUSED = const(49)
_BUFFER_REFUSED = const(50)
_NOT_VARIABLE_REFUSED = const(51)
_FIXED_REFUSED = const(52)
_SENSOR_REFUSED = const(53)
_COUNTER_REFUSED = const(54)
_SETQ_REFUSED = const(55)
_LET_TWICE_REFUSED = const(60)
_BINDING_REFUSED = const(61)
_LET_REFUSED = const(62)
_CLAUSE_REFUSED = const(63)
_PRIORITY_REFUSED = const(66)

_SELDOM = const(("dotimes", "dice", "defun", "edge-dist", "area", "inside", "to-edge", "tell"))
_ONESHOT = const(("after-issue", "cancel", "best", "quorum"))
_FLAGS = {"sleep": 7, "wake": 6, "freeze": 5, "thaw": 4, "mark": 1, "unmark": 0}
"""Twice the slot of a flag, and its value."""


_NAMES = const(
    "/variable/constant/else/</>/+/-/*/and/pure/write/jump/pop/number/local/return/match/match?/else?/and?/any/or/or?/"
    "known/take/keep/repeat/next/prob/dice/unknown side/side/none/random/gauss/flag/unknown/rollback/ping/in/join/"
    "leave/define/store number/activate/deactivate/forget/lease/assign/enter/call/operator/host/defined/store/operate/"
    "report/tell/"
)


def number_of(name):
    """The number of an instruction; `machine.py` has the same ones."""
    return _NAMES[: _NAMES.find("/%s/" % name)].count("/")


# ---- control


def _and(c, form):
    if len(form) == 1:
        c.number(1.0)
        return 1
    watched = 0
    if form is c.deciding:
        from sleepnode.leading import leading

        watched = leading(c, form)
    c.tested = c.tested or watched > 0
    cost, jumps = 1, []
    for at, part in enumerate(form[1:], 1):
        cost += c.part(part)
        if at < len(form) - 1:
            jumps.append(c.jump(_AND_TEST if at <= watched else _AND))
            if at == watched:
                c.emit(_MATCH)
        elif at <= watched:
            c.emit(_MATCH_IF)
    c.arrive(*jumps)
    return cost


def _or(c, form):
    c.number(0.0)
    cost, jumps = 1, []
    for part in form[1:]:
        cost += c.part(part)
        jumps.append(c.jump(_ANY))
    c.arrive(*jumps)
    return cost


def cond(c, form):
    watched = form is c.deciding
    c.tested = c.tested or watched
    ends, cost = [], 1
    for clause in form[1:]:
        if not isinstance(clause, list) or not clause:
            raise Refused(_CLAUSE_REFUSED)
        cost += _clause(c, clause, ends, watched)
    c.number(0.0)
    c.arrive(*ends)
    return cost


def when(c, form):
    watched = form is c.deciding
    c.tested = c.tested or watched
    ends = []
    cost = 1 + _clause(c, form[1:], ends, watched)
    c.number(0.0)
    c.arrive(*ends)
    return cost


def _clause(c, forms, ends, watched):
    cost = c.part(forms[0])
    if len(forms) == 1:
        ends.append(c.jump(_OR_TEST if watched else _OR))
        return cost
    other = c.jump(_ELSE_TEST if watched else _ELSE)
    cost += c.row(forms[1:])
    ends.append(c.jump(_JUMP))
    c.arrive(other)
    return cost


def _if(c, form):
    watched = form is c.deciding
    c.tested = c.tested or watched
    cost = 1 + c.part(form[1])
    other = c.jump(_ELSE_TEST if watched else _ELSE)
    cost += c.part(form[2])
    end = c.jump(_JUMP)
    c.arrive(other)
    cost += c.row(form[3:])
    c.arrive(end)
    return cost


def let(c, form):
    if not isinstance(form[1], list):
        raise Refused(_LET_REFUSED)
    keys, cost = [], 1
    for pair in form[1]:
        if not (isinstance(pair, list) and len(pair) == 2 and isinstance(pair[0], str)):
            raise Refused(_BINDING_REFUSED)
        if pair[0].lower() in keys:
            raise Refused(_LET_TWICE_REFUSED, pair[0])
        c.may_be_local(pair[0])
        keys.append(pair[0].lower())
        cost += c.part(pair[1])
    first = c.scope(keys)
    for place in range(first + len(keys) - 1, first - 1, -1):
        c.emit(_TAKE, place)
    cost += c.row(form[2:])
    c.scopes.pop()
    return cost


# ---- assignment


def setq(c, form):
    target, value = form[1:]
    if not isinstance(target, str):
        raise Refused(_SETQ_REFUSED)
    key = target.lower()
    place, number = c.local(key), buffer_number(key)
    if place is not None:
        if place in c.fixed:
            raise Refused(_COUNTER_REFUSED, target)
        cost = c.part(value)
        c.emit(_KEEP, place)
        return 1 + cost
    if number is not None:
        if head_of(value) == "quote" and len(value) == 2:
            return store(c, target, value[1], False)
        _not_the_message(number)
        c.rules = True
        cost = c.part(value)
        c.emit(_STORE_NUMBER)
        c.thing("e%d" % number)
        return 1 + cost + _STORE_STEPS
    binding = c.mind.binding(key)
    if isinstance(binding, int):
        if not c.mind.assignable(binding):
            raise Refused(_SENSOR_REFUSED, target)
        c.rules = c.rules or c.mind.is_active_flag(binding)
        cost = c.part(value)
        c.emit(_WRITE, binding)
        return 1 + cost
    if binding is not None or is_fixed(key):
        constant = binding is not None and not isinstance(binding, Function)
        raise Refused(_FIXED_REFUSED, target, "constant" if constant else "function")
    kind = c.kind_of(key)
    if kind not in (None, "variable"):
        raise Refused(_NOT_VARIABLE_REFUSED, target, "an" if kind == "operator" else "a", kind)
    cost = c.part(value)
    slot = c.mind.learned.get(key)
    if slot:
        c.emit(_WRITE, slot)
    else:
        c.emit(_ASSIGN)
        c.thing(key)
    return 1 + cost


def _not_the_message(number):
    if number == 0:
        raise Refused(_E0_REFUSED)


def store(c, target, body, activate):
    key = target.lower()
    number = buffer_number(key)
    _not_the_message(number)
    if number is None:
        c.free_for(target, "rule")
    else:
        key = "e%d" % number
    program, steps = c.stored(key, [body], flags=_RULE)
    c.rules = True
    c.emit(_STORE, 1 if activate else 0)
    c.thing(key, program)
    return 1 + steps


def defvar(c, form):
    if not isinstance(form[1], str):
        raise Refused(_A_NAME_REFUSED, form[0].upper())
    c.free_for(form[1], "variable")
    key = form[1].lower()
    c.mind.slot(key)
    there = c.jump(_DEFINED)
    c.thing(key)
    cost = 1
    if len(form) > 2:
        cost += c.part(form[2])
    else:
        c.emit(_UNKNOWN)
    c.emit(_DEFINE)
    c.thing(key)
    c.arrive(there)
    return cost


# ---- rules and groups


def _rule_key(c, target):
    if not isinstance(target, str):
        raise Refused(_RULE_NAME_REFUSED)
    key = target.lower()
    number = buffer_number(key)
    if number is not None:
        if number == 0:
            raise Refused(_E0_ACTIVE_REFUSED)
        return "e%d" % number
    meaning = c.meaning(key)
    if meaning not in (None, "rule", "operator"):
        raise Refused(_NOT_RULE_REFUSED, target, meaning)
    return key


# ---- chance and speaking


def report(c, form):
    labelled = isinstance(form[1], bytes)
    rest = form[2:] if labelled else form[1:]
    cost = c.parts(rest)
    c.emit(_REPORT, len(rest))
    c.thing(str(form[1], "utf-8") if labelled else "")
    return 1 + cost


_HOW = {
    "and": _and,
    "or": _or,
    "cond": cond,
    "when": when,
    "if": _if,
    "let": let,
    "setq": setq,
    "defvar": defvar,
    "report": report,
    "print": report,
}


def write(c, form, key):
    """Write a special form."""
    if key in _HOW:
        return _HOW[key](c, form)
    if key in _SELDOM:
        from sleepnode.seldom import write as seldom

        return seldom(c, form, key)
    if key in _ONESHOT:
        from sleepnode.whole import write as whole

        return whole(c, form, key)
    if key == "progn":
        return 1 + c.row(form[1:])
    if key == "known":
        cost = c.part(form[1])
        c.emit(_KNOWN)
    elif key in ("prob", "random", "gauss"):
        cost = c.parts(form[1:])
        c.emit(number_of(key))
    elif key in _FLAGS:
        cost = 0
        c.emit(_FLAG, _FLAGS[key])
    elif key == "ping":
        cost = c.row(form[1:]) if len(form) > 1 else 0
        if not cost:
            c.number(0.0)
        c.emit(_PING)
    elif key in ("join", "leave", "in"):
        cost = 0
        group(c, form, key)
    elif key in ("setqq", "rule"):
        if not isinstance(form[1], str):
            raise Refused(*((_BUFFER_REFUSED,) if key == "setqq" else (_A_NAME_REFUSED, key.upper())))
        if key == "setqq" and buffer_number(form[1].lower()) is None:
            raise Refused(_BUFFER_REFUSED)
        if len(form) > 3:
            raise Refused(_PRIORITY_REFUSED)
        return store(c, form[1], form[2], key == "rule")
    elif key in ("quote", "quasiquote", "unquote"):
        raise Refused(_QUOTED_REFUSED)
    elif gives_way(key):
        raise Refused(_REMEMBERS_REFUSED, key.upper())
    else:  # on rules
        c.rules = True
        cost = c.part(form[2]) if key == "lease" else 0
        c.emit(number_of(key))
        if key != "rollback":
            c.thing(_rule_key(c, form[1]))
    return 1 + cost


def group(c, form, key):
    if not isinstance(form[1], str):
        raise Refused(_A_GROUP_REFUSED, form[0])
    c.free_for(form[1], GROUP)
    if key != "in":
        c.moves.append(form[1].lower())
    c.emit(number_of(key))
    c.thing(form[1].lower())
