"""How the checker writes each special form: a function of the checker and the form, whose number of arguments is right,
that gives the cost."""

from sleepnode.checker import GROUP, STORE_STEPS, Function, buffer_number
from sleepnode.deciding import leading
from sleepnode.functions import MAX_HOPS, MAX_LOOPS, MAX_REPEATS, PURE, is_fixed
from sleepnode.reader import Label, Refused, head_of, show

_FLAGS = {"sleep": 7, "wake": 6, "freeze": 5, "thaw": 4, "mark": 1, "unmark": 0}
"""Twice the slot of a flag, and its value."""
_UNREAD = "quote unquote setqq rule defun area activate deactivate forget join leave in".split()
_NAMING = ("setq", "defvar", "lease")


# ---- control


def _and(c, form):
    if len(form) == 1:
        c.emit("constant", 0, 1.0)
        return 1
    watched = leading(c, form) if form is c.deciding else 0
    c.tested = c.tested or watched > 0
    cost, jumps = 1, []
    for at, part in enumerate(form[1:], 1):
        cost += c.part(part)
        if at < len(form) - 1:
            jumps.append(c.emit("and?" if at <= watched else "and"))
            if at == watched:
                c.emit("match")
        elif at <= watched:
            c.emit("match?")
    c.arrive(*jumps)
    return cost


def _or(c, form):
    c.emit("zero")
    cost, jumps = 1, []
    for part in form[1:]:
        cost += c.part(part)
        jumps.append(c.emit("any"))
    c.arrive(*jumps)
    return cost


def _known(c, form):
    cost = c.part(form[1])
    c.emit("known")
    return 1 + cost


def _cond(c, form):
    watched = form is c.deciding
    c.tested = c.tested or watched
    ends, cost = [], 1
    for clause in form[1:]:
        if not isinstance(clause, list) or not clause:
            raise Refused("clause")
        cost += _clause(c, clause, ends, watched)
    c.emit("zero")
    c.arrive(*ends)
    return cost


def _when(c, form):
    watched = form is c.deciding
    c.tested = c.tested or watched
    ends = []
    cost = 1 + _clause(c, form[1:], ends, watched)
    c.emit("zero")
    c.arrive(*ends)
    return cost


def _clause(c, forms, ends, watched):
    cost = c.part(forms[0])
    if len(forms) == 1:
        ends.append(c.emit("or?" if watched else "or"))
        return cost
    other = c.emit("else?" if watched else "else")
    cost += c.row(forms[1:])
    ends.append(c.emit("jump"))
    c.arrive(other)
    return cost


def _if(c, form):
    watched = form is c.deciding
    c.tested = c.tested or watched
    cost = 1 + c.part(form[1])
    other = c.emit("else?" if watched else "else")
    cost += c.part(form[2])
    end = c.emit("jump")
    c.arrive(other)
    cost += c.row(form[3:])
    c.arrive(end)
    return cost


def _progn(c, form):
    return 1 + c.row(form[1:])


def _let(c, form):
    if not isinstance(form[1], list):
        raise Refused("let")
    keys, cost = [], 1
    for pair in form[1]:
        if not (isinstance(pair, list) and len(pair) == 2 and isinstance(pair[0], str)):
            raise Refused("binding")
        if pair[0].lower() in keys:
            raise Refused("let-twice", pair[0])
        c.may_be_local(pair[0])
        keys.append(pair[0].lower())
        cost += c.part(pair[1])
    first = c.scope(keys)
    for place in range(first + len(keys) - 1, first - 1, -1):
        c.emit("take", place)
    cost += c.row(form[2:])
    c.scopes.pop()
    return cost


def _dotimes(c, form):
    head = form[1]
    if not (isinstance(head, list) and len(head) == 2 and isinstance(head[0], str)):
        raise Refused("dotimes")
    count = head[1]
    if not (isinstance(count, tuple) and count[2] and count[0] == int(count[0]) and 0 <= count[0] <= MAX_REPEATS):
        raise Refused("repeats", MAX_REPEATS)
    if c.loops >= MAX_LOOPS:
        raise Refused("loops", MAX_LOOPS, MAX_LOOPS)
    c.may_be_local(head[0])
    c.loops += 1
    place = c.scope([head[0].lower()], True)
    c.emit("zero")
    c.emit("take", place)
    again = len(c.code)
    end = c.emit("repeat", 0, place, int(count[0]))
    cost = c.each(form[2:])
    c.emit("next", again, place)
    c.arrive(end)
    c.emit("zero")
    c.scopes.pop()
    c.loops -= 1
    return 1 + int(count[0]) * cost


def _dice(c, form):
    c.emit("dice")
    ends, cost = [], 1
    for side in form[1:]:
        if not (isinstance(side, list) and len(side) == 2):
            raise Refused("side")
        cost += c.part(side[0])
        ends.append(c.emit("unknown side"))
        other = c.emit("side")
        cost += c.part(side[1])
        ends.append(c.emit("jump"))
        c.arrive(other)
    c.emit("none")
    c.arrive(*ends)
    return cost


# ---- assignment


def _setq(c, form):
    target, value = form[1:]
    if not isinstance(target, str):
        raise Refused("setq")
    key = target.lower()
    place, number = c.local(key), buffer_number(key)
    if place is not None:
        if place in c.fixed:
            raise Refused("counter", target)
        cost = c.part(value)
        c.emit("keep", place)
        return 1 + cost
    if number is not None:
        if head_of(value) == "quote" and len(value) == 2:
            return _store(c, target, value[1], False)
        _not_the_message(number)
        cost = c.part(value)
        c.emit("store number", 0, "e%d" % number)
        return 1 + cost + STORE_STEPS
    found = c.mind.binding(key)
    if isinstance(found, int):
        if not c.mind.assignable(found):
            raise Refused("sensor", target)
        cost = c.part(value)
        c.emit("write", found)
        return 1 + cost
    if found is not None or is_fixed(key):
        constant = found is not None and not isinstance(found, Function)
        raise Refused("fixed", target, "constant" if constant else "function")
    sort = c.sort_of(key)
    if sort not in (None, "variable"):
        raise Refused("not-variable", target, "an" if sort == "operator" else "a", sort)
    cost = c.part(value)
    c.emit("assign", 0, key)
    return 1 + cost


def _setqq(c, form):
    if not isinstance(form[1], str) or buffer_number(form[1].lower()) is None:
        raise Refused("buffer")
    return _store(c, form[1], form[2], False)


def _rule(c, form):
    if not isinstance(form[1], str):
        raise Refused("a-name", "RULE")
    return _store(c, form[1], form[2], True)


def _not_the_message(number):
    if number == 0:
        raise Refused("e0")


def _store(c, target, body, activate):
    key = target.lower()
    number = buffer_number(key)
    _not_the_message(number)
    if number is None:
        c.free_for(target, "rule")
    else:
        key = "e%d" % number
    program, steps = c.stored(key, [body])
    c.emit("store", 1 if activate else 0, key, program)
    return 1 + steps


def _defvar(c, form):
    if not isinstance(form[1], str):
        raise Refused("a-name", "DEFVAR")
    c.free_for(form[1], "variable")
    key = form[1].lower()
    c.mind.slot(key)
    there = c.emit("defined", 0, key)
    cost = 1
    if len(form) > 2:
        cost += c.part(form[2])
    else:
        c.emit("constant", 0, None)
    c.emit("define", 0, key)
    c.arrive(there)
    return cost


def _defun(c, form):
    target, parameters = form[1], form[2]
    if not isinstance(target, str):
        raise Refused("a-name", "DEFUN")
    if not isinstance(parameters, list) or not all([isinstance(name, str) for name in parameters]):
        raise Refused("parameters")
    keys = [name.lower() for name in parameters]
    for at, key in enumerate(keys):
        if key in keys[:at]:
            raise Refused("parameter-twice")
        c.may_be_local(key)
    return _operator(c, target, form[3:], keys)


def _operator(c, target, forms, keys):
    c.free_for(target, "operator")
    program, steps = c.stored(target.lower(), forms, keys)
    c.emit("operate", 0, target.lower(), program)
    return 1 + steps


# ---- areas


def _edge_distance(c, form):
    if len(form) % 2 == 0:
        raise Refused("edge", len(form) - 1)
    return c.pure("edge-dist", form[1:])


def _area(c, form):
    target, sizes = form[1], form[2:]
    if not isinstance(target, str):
        raise Refused("area-name")
    if len(sizes) == 3:
        if isinstance(sizes[2], tuple) and sizes[2][0] <= 0:
            raise Refused("radius", sizes[2][1])
        body = ["-", sizes[2], ["DIST", "x", "y", sizes[0], sizes[1]]]
    else:
        _corners(sizes)
        body = ["EDGE-DIST", "x", "y"] + sizes
    return _operator(c, target, [body], [])


def _corners(sizes):
    if len(sizes) % 2:
        raise Refused("corners-odd", len(sizes))
    if len(sizes) < 6:
        raise Refused("corners-few", len(sizes) // 2)
    for at in range(0, len(sizes), 2):
        after = (at + 2) % len(sizes)
        four = sizes[at], sizes[after], sizes[at + 1], sizes[after + 1]
        if all([isinstance(each, tuple) for each in four]) and (four[0][0] == four[1][0] and four[2][0] == four[3][0]):
            raise Refused("corners-same", at // 2 + 1, after // 2 + 1)


def _of_area(c, form):
    target = form[1]
    name = form[0].upper()
    if not isinstance(target, str):
        raise Refused("an-area", name)
    key = target.lower()
    meaning = c.meaning(key)
    if meaning not in (None, "operator"):
        raise Refused("not-area", target, "an" if meaning[0] in "aeiou" else "a", meaning)
    if meaning and c.parameters(key):
        raise Refused("area-arguments", target)
    c.use(key)
    cost = c.operator(key, [], "")
    if name == "TO-EDGE":
        return cost
    c.emit("zero")
    c.emit("pure", 2, PURE[">="])
    return cost + 2


# ---- rules and groups


def _about_rule(c, form):
    c.emit(form[0].lower(), 0, _rule_key(c, form[1]))
    return 1


def _lease(c, form):
    cost = c.part(form[2])
    c.emit("lease", 0, _rule_key(c, form[1]))
    return 1 + cost


def _rule_key(c, target):
    if not isinstance(target, str):
        raise Refused("rule-name")
    key = target.lower()
    number = buffer_number(key)
    if number is not None:
        if number == 0:
            raise Refused("e0-active")
        return "e%d" % number
    meaning = c.meaning(key)
    if meaning not in (None, "rule", "operator"):
        raise Refused("not-rule", target, meaning)
    return key


def _group(c, form):
    if not isinstance(form[1], str):
        raise Refused("a-group", form[0])
    c.free_for(form[1], GROUP)
    c.emit(form[0].lower(), 0, form[1].lower())
    return 1


# ---- chance and speaking


def _chance(c, form):
    cost = c.parts(form[1:])
    c.emit(form[0].lower())
    return 1 + cost


def _report(c, form):
    labelled = isinstance(form[1], Label)
    rest = form[2:] if labelled else form[1:]
    cost = c.parts(rest)
    c.emit("report", len(rest), form[1].text if labelled else "")
    return 1 + cost


def _ping(c, form):
    cost = c.row(form[1:])
    c.emit("ping")
    return 1 + (cost if len(form) > 1 else 0)


def _tell(c, form):
    template, hops = form[1], 1
    if len(form) > 2:
        last = form[-1]
        fine = len(form) == 4 and isinstance(form[2], str) and form[2].lower() == ":hops" and isinstance(last, tuple)
        if not (fine and last[2] and last[0] == int(last[0]) and 1 <= last[0] <= MAX_HOPS):
            raise Refused("hops", MAX_HOPS)
        hops = int(last[0])
    head = head_of(template) if isinstance(template, list) and len(template) == 2 else ""
    if head in ("quote", "quasiquote"):
        template = template[1]
    holes = []
    if head != "quote":
        _holes(template, holes)
    cost = c.parts(holes)
    _entered(c, template)
    c.emit("tell", hops, (show(template) if head == "quote" else show(template, "\0")).split("\0"))
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


def _quote(c, form):
    raise Refused("quoted")


def _remembering(c, form):
    raise Refused("remembers", form[0].upper())


def _rollback(c, form):
    c.emit("rollback")
    return 1


def _flag(c, form):
    c.emit("flag", _FLAGS[form[0].lower()])
    return 1


SPECIAL = {
    "and": _and,
    "or": _or,
    "known": _known,
    "cond": _cond,
    "when": _when,
    "if": _if,
    "progn": _progn,
    "let": _let,
    "dotimes": _dotimes,
    "dice": _dice,
    "setq": _setq,
    "setqq": _setqq,
    "rule": _rule,
    "defvar": _defvar,
    "defun": _defun,
    "edge-dist": _edge_distance,
    "area": _area,
    "inside": _of_area,
    "to-edge": _of_area,
    "lease": _lease,
    "report": _report,
    "print": _report,
    "ping": _ping,
    "tell": _tell,
    "rollback": _rollback,
}
"""By key: a function of the checker and the form."""
for _names, _how in (
    ("activate deactivate forget", _about_rule),
    ("join leave in", _group),
    ("prob random gauss", _chance),
    ("sleep wake freeze thaw mark unmark", _flag),
    ("quote quasiquote unquote", _quote),
    ("once held hysteresis every after within age share", _remembering),
):
    for _name in _names.split():
        SPECIAL[_name] = _how
