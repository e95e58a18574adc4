"""How the checker writes each special form: a function of the checker and the form, whose number of arguments is right,
that gives the cost."""

from micropython import const

from sleepnode.checker import GROUP, Function, buffer_number
from sleepnode.deciding import leading
from sleepnode.functions import PURE, WORDS, is_fixed
from sleepnode.instructions import number_of
from sleepnode.reader import Label, Refused, head_of, show

_STORE_STEPS = const(40)
_MAX_LOOPS = const(4)
_MAX_REPEATS = const(1000)
_MAX_HOPS = const(8)

# Instructions, by the numbers of `instructions.number_of`: constants cost no memory.
_CONSTANT = const(1)
_ELSE = const(2)
_PURE = const(9)
_WRITE = const(10)
_JUMP = const(11)
_ZERO = const(13)
_ASSIGN = const(14)
_MATCH = const(20)
_MATCH_IF = const(21)
_ELSE_TEST = const(22)
_AND = const(8)
_AND_TEST = const(23)
_ANY = const(24)
_OR = const(25)
_OR_TEST = const(26)
_KNOWN = const(27)
_TAKE = const(28)
_KEEP = const(29)
_REPEAT = const(30)
_NEXT = const(31)
_DEFINED = const(33)
_STORE = const(34)
_OPERATE = const(35)
_REPORT = const(36)
_TELL = const(37)
_DICE = const(39)
_UNKNOWN_SIDE = const(40)
_SIDE = const(41)
_NONE = const(42)
_FLAG = const(45)
_DEFINE = const(49)
_STORE_NUMBER = const(50)
_LEASE = const(54)
_ROLLBACK = const(55)
_PING = const(56)

# Refusals, by their places in `sentences.SENTENCES`.
_REMEMBERS_REFUSED = const(30)
_QUOTED_REFUSED = const(31)
_HOPS_REFUSED = const(32)
_A_GROUP_REFUSED = const(33)
_NOT_RULE_REFUSED = const(34)
_E0_ACTIVE_REFUSED = const(35)
_RULE_NAME_REFUSED = const(36)
_AREA_ARGUMENTS_REFUSED = const(37)
_NOT_AREA_REFUSED = const(38)
_AN_AREA_REFUSED = const(39)
_CORNERS_SAME_REFUSED = const(40)
_CORNERS_FEW_REFUSED = const(41)
_CORNERS_ODD_REFUSED = const(42)
_RADIUS_REFUSED = const(43)
_AREA_NAME_REFUSED = const(44)
_EDGE_REFUSED = const(45)
_PARAMETER_TWICE_REFUSED = const(46)
_PARAMETERS_REFUSED = const(47)
_A_NAME_REFUSED = const(48)
_E0_REFUSED = const(49)
_BUFFER_REFUSED = const(50)
_NOT_VARIABLE_REFUSED = const(51)
_FIXED_REFUSED = const(52)
_SENSOR_REFUSED = const(53)
_COUNTER_REFUSED = const(54)
_SETQ_REFUSED = const(55)
_SIDE_REFUSED = const(56)
_LOOPS_REFUSED = const(57)
_REPEATS_REFUSED = const(58)
_DOTIMES_REFUSED = const(59)
_LET_TWICE_REFUSED = const(60)
_BINDING_REFUSED = const(61)
_LET_REFUSED = const(62)
_CLAUSE_REFUSED = const(63)

_FLAGS = {"sleep": 7, "wake": 6, "freeze": 5, "thaw": 4, "mark": 1, "unmark": 0}
"""Twice the slot of a flag, and its value."""
_UNREAD = "quote unquote setqq rule defun area activate deactivate forget join leave in".split()
_NAMING = const(("setq", "defvar", "lease"))


# ---- control


def _and(c, form):
    if len(form) == 1:
        c.emit(_CONSTANT, 0, 1.0)
        return 1
    watched = leading(c, form) if form is c.deciding else 0
    c.tested = c.tested or watched > 0
    cost, jumps = 1, []
    for at, part in enumerate(form[1:], 1):
        cost += c.part(part)
        if at < len(form) - 1:
            jumps.append(c.emit(_AND_TEST if at <= watched else _AND))
            if at == watched:
                c.emit(_MATCH)
        elif at <= watched:
            c.emit(_MATCH_IF)
    c.arrive(*jumps)
    return cost


def _or(c, form):
    c.emit(_ZERO)
    cost, jumps = 1, []
    for part in form[1:]:
        cost += c.part(part)
        jumps.append(c.emit(_ANY))
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
    c.emit(_ZERO)
    c.arrive(*ends)
    return cost


def when(c, form):
    watched = form is c.deciding
    c.tested = c.tested or watched
    ends = []
    cost = 1 + _clause(c, form[1:], ends, watched)
    c.emit(_ZERO)
    c.arrive(*ends)
    return cost


def _clause(c, forms, ends, watched):
    cost = c.part(forms[0])
    if len(forms) == 1:
        ends.append(c.emit(_OR_TEST if watched else _OR))
        return cost
    other = c.emit(_ELSE_TEST if watched else _ELSE)
    cost += c.row(forms[1:])
    ends.append(c.emit(_JUMP))
    c.arrive(other)
    return cost


def _if(c, form):
    watched = form is c.deciding
    c.tested = c.tested or watched
    cost = 1 + c.part(form[1])
    other = c.emit(_ELSE_TEST if watched else _ELSE)
    cost += c.part(form[2])
    end = c.emit(_JUMP)
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


def dotimes(c, form):
    head = form[1]
    if not (isinstance(head, list) and len(head) == 2 and isinstance(head[0], str)):
        raise Refused(_DOTIMES_REFUSED)
    count = head[1]
    if not (isinstance(count, tuple) and count[2] and count[0] == int(count[0]) and 0 <= count[0] <= _MAX_REPEATS):
        raise Refused(_REPEATS_REFUSED, _MAX_REPEATS)
    if c.loops >= _MAX_LOOPS:
        raise Refused(_LOOPS_REFUSED, _MAX_LOOPS, _MAX_LOOPS)
    c.may_be_local(head[0])
    c.loops += 1
    place = c.scope([head[0].lower()], True)
    c.emit(_ZERO)
    c.emit(_TAKE, place)
    again = len(c.code)
    end = c.emit(_REPEAT, 0, place, int(count[0]))
    cost = c.each(form[2:])
    c.emit(_NEXT, again, place)
    c.arrive(end)
    c.emit(_ZERO)
    c.scopes.pop()
    c.loops -= 1
    return 1 + int(count[0]) * cost


def dice(c, form):
    c.emit(_DICE)
    ends, cost = [], 1
    for side in form[1:]:
        if not (isinstance(side, list) and len(side) == 2):
            raise Refused(_SIDE_REFUSED)
        cost += c.part(side[0])
        ends.append(c.emit(_UNKNOWN_SIDE))
        other = c.emit(_SIDE)
        cost += c.part(side[1])
        ends.append(c.emit(_JUMP))
        c.arrive(other)
    c.emit(_NONE)
    c.arrive(*ends)
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
        c.emit(_STORE_NUMBER, 0, "e%d" % number)
        return 1 + cost + _STORE_STEPS
    found = c.mind.binding(key)
    if isinstance(found, int):
        if not c.mind.assignable(found):
            raise Refused(_SENSOR_REFUSED, target)
        c.rules = c.rules or c.mind.is_active_flag(found)
        cost = c.part(value)
        c.emit(_WRITE, found)
        return 1 + cost
    if found is not None or is_fixed(key):
        constant = found is not None and not isinstance(found, Function)
        raise Refused(_FIXED_REFUSED, target, "constant" if constant else "function")
    sort = c.sort_of(key)
    if sort not in (None, "variable"):
        raise Refused(_NOT_VARIABLE_REFUSED, target, "an" if sort == "operator" else "a", sort)
    cost = c.part(value)
    c.emit(_ASSIGN, 0, key)
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
    program, steps = c.stored(key, [body])
    c.rules = True
    c.emit(_STORE, 1 if activate else 0, key, program)
    return 1 + steps


def defvar(c, form):
    if not isinstance(form[1], str):
        raise Refused(_A_NAME_REFUSED, form[0].upper())
    c.free_for(form[1], "variable")
    key = form[1].lower()
    c.mind.slot(key)
    there = c.emit(_DEFINED, 0, key)
    cost = 1
    if len(form) > 2:
        cost += c.part(form[2])
    else:
        c.emit(_CONSTANT, 0, None)
    c.emit(_DEFINE, 0, key)
    c.arrive(there)
    return cost


def defun(c, form):
    target, parameters = form[1], form[2]
    if not isinstance(target, str):
        raise Refused(_A_NAME_REFUSED, form[0].upper())
    if not isinstance(parameters, list) or not all([isinstance(name, str) for name in parameters]):
        raise Refused(_PARAMETERS_REFUSED)
    keys = [name.lower() for name in parameters]
    for at, key in enumerate(keys):
        if key in keys[:at]:
            raise Refused(_PARAMETER_TWICE_REFUSED)
        c.may_be_local(key)
    return operator(c, target, form[3:], keys)


def operator(c, target, forms, keys):
    c.free_for(target, "operator")
    program, steps = c.stored(target.lower(), forms, keys)
    c.rules = True
    c.emit(_OPERATE, 0, target.lower(), program)
    return 1 + steps


# ---- areas


def _edge_distance(c, form):
    if len(form) % 2 == 0:
        raise Refused(_EDGE_REFUSED, len(form) - 1)
    return c.pure("edge-dist", form[1:])


def area(c, form):
    target, sizes = form[1], form[2:]
    if not isinstance(target, str):
        raise Refused(_AREA_NAME_REFUSED)
    if len(sizes) == 3:
        if isinstance(sizes[2], tuple) and sizes[2][0] <= 0:
            raise Refused(_RADIUS_REFUSED, sizes[2][1])
        body = ["-", sizes[2], ["dist", "x", "y", sizes[0], sizes[1]]]
    else:
        _corners(sizes)
        body = ["edge-dist", "x", "y"] + sizes
    return operator(c, target, [body], [])


def _corners(sizes):
    if len(sizes) % 2:
        raise Refused(_CORNERS_ODD_REFUSED, len(sizes))
    if len(sizes) < 6:
        raise Refused(_CORNERS_FEW_REFUSED, len(sizes) // 2)
    for at in range(0, len(sizes), 2):
        after = (at + 2) % len(sizes)
        four = sizes[at], sizes[after], sizes[at + 1], sizes[after + 1]
        if all([isinstance(each, tuple) for each in four]) and (four[0][0] == four[1][0] and four[2][0] == four[3][0]):
            raise Refused(_CORNERS_SAME_REFUSED, at // 2 + 1, after // 2 + 1)


def _of_area(c, form):
    target = form[1]
    name = form[0].lower()
    if not isinstance(target, str):
        raise Refused(_AN_AREA_REFUSED, name.upper())
    key = target.lower()
    meaning = c.meaning(key)
    if meaning not in (None, "operator"):
        raise Refused(_NOT_AREA_REFUSED, target, "an" if meaning[:1] in "aeiou" else "a", meaning)
    if meaning and c.parameters(key):
        raise Refused(_AREA_ARGUMENTS_REFUSED, target)
    c.use(key)
    cost = c.operator(key, [], "")
    if name == "to-edge":
        return cost
    c.emit(_ZERO)
    c.emit(_PURE, 2, PURE[">="])
    return cost + 2


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
    labelled = isinstance(form[1], Label)
    rest = form[2:] if labelled else form[1:]
    cost = c.parts(rest)
    c.emit(_REPORT, len(rest), form[1].text if labelled else "")
    return 1 + cost


def tell(c, form):
    template, hops = form[1], 1
    if len(form) > 2:
        last = form[-1]
        fine = len(form) == 4 and isinstance(form[2], str) and form[2].lower() == ":hops" and isinstance(last, tuple)
        if not (fine and last[2] and last[0] == int(last[0]) and 1 <= last[0] <= _MAX_HOPS):
            raise Refused(_HOPS_REFUSED, _MAX_HOPS)
        hops = int(last[0])
    head = head_of(template) if isinstance(template, list) and len(template) == 2 else ""
    if head in ("quote", "quasiquote"):
        template = template[1]
    holes = []
    if head != "quote":
        _holes(template, holes)
    cost = c.parts(holes)
    _entered(c, template)
    c.emit(_TELL, hops, (show(template) if head == "quote" else show(template, "\0")).split("\0"))
    return 1 + cost


def _holes(form, found):
    if isinstance(form, list):
        if head_of(form) == "unquote" and len(form) == 2:
            found.append(form[1])
        else:
            for item in form:
                _holes(item, found)


def _entered(c, form):
    """Note what a told form may enter where it is heard: a rule must not come to tell itself for ever."""
    if isinstance(form, str):
        number = buffer_number(form.lower())
        c.use(form.lower() if number is None else "e%d" % number)
        return
    head = head_of(form)
    if not isinstance(form, list) or not form or head in _UNREAD:
        return
    if head and not is_fixed(head):
        c.use(head)
    for item in form[2:] if head in _NAMING else form[1:]:
        _entered(c, item)


_HOW = {
    "and": _and,
    "or": _or,
    "cond": cond,
    "when": when,
    "if": _if,
    "let": let,
    "dotimes": dotimes,
    "dice": dice,
    "setq": setq,
    "defvar": defvar,
    "defun": defun,
    "edge-dist": _edge_distance,
    "area": area,
    "inside": _of_area,
    "to-edge": _of_area,
    "report": report,
    "print": report,
    "tell": tell,
}


def write(c, form, key):
    """Write a special form."""
    if key in _HOW:
        return _HOW[key](c, form)
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
            c.emit(_ZERO)
        c.emit(_PING)
    elif key in ("join", "leave", "in"):
        cost = 0
        group(c, form, key)
    elif key in ("setqq", "rule"):
        if not isinstance(form[1], str):
            raise Refused(*((_BUFFER_REFUSED,) if key == "setqq" else (_A_NAME_REFUSED, key.upper())))
        if key == "setqq" and buffer_number(form[1].lower()) is None:
            raise Refused(_BUFFER_REFUSED)
        return store(c, form[1], form[2], key == "rule")
    elif key in ("quote", "quasiquote", "unquote"):
        raise Refused(_QUOTED_REFUSED)
    elif key in WORDS:
        raise Refused(_REMEMBERS_REFUSED, key.upper())
    else:  # on rules
        c.rules = True
        cost = c.part(form[2]) if key == "lease" else 0
        c.emit(number_of(key), 0, *([] if key == "rollback" else [_rule_key(c, form[1])]))
    return 1 + cost


def group(c, form, key):
    if not isinstance(form[1], str):
        raise Refused(_A_GROUP_REFUSED, form[0])
    c.free_for(form[1], GROUP)
    if key != "in":
        c.moves.append(form[1].lower())
    c.emit(number_of(key), 0, form[1].lower())
