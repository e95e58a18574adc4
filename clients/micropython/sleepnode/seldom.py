"""How the checker writes the special forms that few texts have. Loaded for one text and let go again.

As in `forms.py`: a function of the checker and the form, whose number of arguments is right, that gives the cost.
"""

from micropython import const

from sleepnode.checker import buffer_number
from sleepnode.functions import is_fixed
from sleepnode.reader import Refused, head_of, show

_MAX_LOOPS = const(4)
_MAX_HOPS = const(8)
_MAX_REPEATS = const(1000)

# Instructions, by their numbers (`forms.py`).
_JUMP = const(11)
_TAKE = const(24)
_REPEAT = const(26)
_NEXT = const(27)
_DICE = const(29)
_UNKNOWN_SIDE = const(30)
_SIDE = const(31)
_NONE = const(32)
_OPERATE = const(55)
_TELL = const(57)

# Refusals, by their places in `sentences.py`.
_HOPS_REFUSED = const(32)
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
_SIDE_REFUSED = const(56)
_LOOPS_REFUSED = const(57)
_REPEATS_REFUSED = const(58)
_DOTIMES_REFUSED = const(59)

_UNREAD = "quote unquote setqq rule defun area activate deactivate forget join leave in".split()
_NAMING = const(("setq", "defvar", "lease"))


# ---- control


def _dotimes(c, form):
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
    c.number(0.0)
    c.emit(_TAKE, place)
    again = len(c.code)
    end = c.jump(_REPEAT)
    c.two(place)
    c.two(int(count[0]))
    cost = c.each(form[2:])
    c.emit(_NEXT, again)
    c.two(place)
    c.arrive(end)
    c.number(0.0)
    c.scopes.pop()
    c.loops -= 1
    return 1 + int(count[0]) * cost


def _dice(c, form):
    c.emit(_DICE)
    ends, cost = [], 1
    for side in form[1:]:
        if not (isinstance(side, list) and len(side) == 2):
            raise Refused(_SIDE_REFUSED)
        cost += c.part(side[0])
        ends.append(c.jump(_UNKNOWN_SIDE))
        other = c.jump(_SIDE)
        cost += c.part(side[1])
        ends.append(c.jump(_JUMP))
        c.arrive(other)
    c.emit(_NONE)
    c.arrive(*ends)
    return cost


# ---- operators and areas


def _defun(c, form):
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
    return _operator(c, target, form[3:], keys)


def _operator(c, target, forms, keys):
    c.free_for(target, "operator")
    program, steps = c.stored(target.lower(), forms, keys)
    c.rules = True
    c.emit(_OPERATE)
    c.thing(target.lower(), program)
    return 1 + steps


def _edge_distance(c, form):
    if len(form) % 2 == 0:
        raise Refused(_EDGE_REFUSED, len(form) - 1)
    return c.pure("edge-dist", form[1:])


def _area(c, form):
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
    return _operator(c, target, [body], [])


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


def _of_area(c, form, name):
    target = form[1]
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
    c.number(0.0)
    c.calculate(">=", 2)
    return cost + 2


# ---- telling


def _tell(c, form):
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
    _refuse_told(c, template)
    holes = []
    if head != "quote":
        _holes(template, holes)
    cost = c.parts(holes)
    _entered(c, template)
    c.emit(_TELL, hops)
    c.thing((show(template) if head == "quote" else show(template, "\0")).split("\0"))
    return 1 + cost


def _refuse_told(c, form):
    """Refuse a told form that has a word in it which only a desk sends, or whose bids nobody would collect here."""
    if isinstance(form, list):
        head = head_of(form)
        if c.meaning(head) is None:
            if head in ("after-issue", "cancel"):
                raise Refused("a TELL carries no AFTER-ISSUE or CANCEL: only a desk sends them")
            if head in ("best", "quorum"):
                raise Refused("a TELL carries no BEST or QUORUM on this computer: it collects no bids")
        for item in form:
            _refuse_told(c, item)


def _holes(form, holes):
    if isinstance(form, list):
        if head_of(form) == "unquote" and len(form) == 2:
            holes.append(form[1])
        else:
            for item in form:
                _holes(item, holes)


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


def write(c, form, key):
    """Write a special form."""
    if key in ("inside", "to-edge"):
        return _of_area(c, form, key)
    how = {
        "dotimes": _dotimes,
        "dice": _dice,
        "defun": _defun,
        "edge-dist": _edge_distance,
        "area": _area,
        "tell": _tell,
    }
    return how[key](c, form)
