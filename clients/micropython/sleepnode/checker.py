"""The checker: forms in, a program out, or a refusal.

A program is a tuple of instructions for the machine (`machine.py`). Local names become places in a frame,
variables become slots; names that nobody has declared yet are looked up when they are reached, because they may come
later.
How each special form is written stands in `forms.py`.
"""

import math
import struct

from micropython import const

from sleepnode.functions import arguments_of, gives_way, is_fixed, pure_number
from sleepnode.reader import Refused, head_of, height

_MAX_STEPS = const(10000)
_STORE_STEPS = const(40)
_MAX_BYTES = const(65535)
_MANY = const(100)
_USES = const(1)

# Where the bytes of a program say what (`machine.py`).
_FLAGS = const(1)
_TESTED = const(2)
_RULE = const(4)
_COST = const(2)
_HEIGHT = const(4)
_PLACES = const(5)
_PARAMETERS = const(7)
_FIRST = const(8)

# Instructions, by the numbers of `forms.number_of`: constants cost no memory.
_VARIABLE = const(0)
_CONSTANT = const(1)
_LESS = const(3)
_PURE = const(9)
_WRITE = const(10)
_JUMP = const(11)
_POP = const(12)
_NUMBER = const(13)
_LOCAL = const(14)
_RETURN = const(15)
_FLAG = const(35)
_UNKNOWN = const(36)
_IN = const(39)
_ENTER = const(49)
_CALL = const(50)
_OPERATOR = const(51)
_HOST = const(52)
_DEFINED = const(53)

# Refusals, by their places in `sentences.py`.
_LABEL_REFUSED = const(16)
_COUNT_REFUSED = const(17)
_NO_FUNCTION_REFUSED = const(18)
_HEAD_REFUSED = const(19)
_EMPTY_REFUSED = const(20)
_SORT_REFUSED = const(21)
_E0_NAMED_REFUSED = const(22)
_FUNCTION_REFUSED = const(23)
_TEXT_REFUSED = const(24)
_CONSTANT_REFUSED = const(25)
_TAKEN_REFUSED = const(26)
_CIRCLE_REFUSED = const(27)
_LOCALS_REFUSED = const(28)
_COST_REFUSED = const(29)

_BUFFERS = const(64)
_MAX_LOCALS = const(1000)
_BINARY = const(("<", ">", "+", "-", "*"))
"""Functions of two numbers that the machine knows without calling them."""


GROUP = "group"
"""What is learned of a group."""


class Function:
    """One of the robot's own functions. least, most: how many arguments. acts: whether it does anything to the robot.
    labelled: whether a text in quotes comes first."""

    def __init__(self, name, call, least, most, acts, labelled):
        self.name, self.call, self.least, self.most = name, call, least, most
        self.acts, self.labelled = acts, labelled


def buffer_number(key):
    """5 for the keys e5 and expr5, None for anything that is no buffer's name."""
    digits = key[4:] if key.startswith("expr") else key[1:] if key.startswith("e") else ""
    if digits.isdigit() and (digits == "0" or digits[:1] != "0") and int(digits) < _BUFFERS:
        return int(digits)
    return None


def through(way):
    """How a stored expression comes back to itself: its way without the last."""
    return " through " + ", ".join([key.upper() for key in way[:-1]]) if len(way) > 1 else ""


class Checker:
    """One pass over one text. mind: the robot's names. outer: the checker of the text that stores this one."""

    def __init__(self, mind, outer=None):
        self.mind = mind
        self.code = bytearray(_FIRST)
        self.things = []
        self.scopes = []
        self.fixed = []
        self.locals = self.loops = 0
        self.uses = []
        self.deciding = None
        self.rules, self.moves = False, []
        """Whether the text changes rules, and the keys of groups that it makes robots join or leave."""
        self.tested = self.acts = False
        """acts: whether what was written does more than look."""
        self.plan = False if outer else None
        """Of a whole command what `oneshot.py` says of it; False for what is stored. One attribute more, an eighteenth,
        would need a larger piece of memory."""
        self.count = outer.count if outer else [0]
        """Forms checked so far, stored ones included."""
        self.pending = outer.pending if outer else {}
        """Names that this text declares: key to "variable", "rule", "group", or the operator's number of parameters."""
        self.pending_uses = outer.pending_uses if outer else {}

    # ---- whole programs

    def program(self, forms, parameters=()):
        """The program that evaluates these forms in order."""
        self.scope(parameters)
        cost = self.row(forms) + (len(forms) > 1)
        if cost > _MAX_STEPS:
            raise Refused(_COST_REFUSED, cost, _MAX_STEPS)
        self.emit(_RETURN)
        if self.locals > _MAX_LOCALS:
            raise Refused(_LOCALS_REFUSED, self.locals, _MAX_LOCALS)
        code = self.code
        code[_FLAGS] = _TESTED if self.tested else 0
        struct.pack_into("<H", code, _COST, cost)
        code[_HEIGHT] = max([height(form) for form in forms] or [0])
        struct.pack_into("<H", code, _PLACES, self.locals)
        code[_PARAMETERS] = len(parameters)
        return tuple([bytearray(code), tuple(self.uses)] + self.things)

    def stored(self, key, forms, parameters=(), flags=0):
        """The program of forms to be stored under a key, and the steps that storing costs."""
        before = self.count[0]
        program = Checker(self.mind, self).program(forms, parameters)
        program[0][_FLAGS] = flags
        way = self.mind.reaches(program[_USES], key, self.pending_uses)
        if way:
            raise Refused(_CIRCLE_REFUSED, key.upper(), through(way))
        self.pending_uses[key] = program[_USES]
        return program, _STORE_STEPS + self.count[0] - before

    def declare(self, form):
        """Note the names that a text declares, so that the rest of it may use them."""
        if not isinstance(form, list):
            return
        head = head_of(form)
        kind = _DECLARES.get(head)
        if kind and len(form) > 1 and isinstance(form[1], str) and not (gives_way(head) and self.meaning(head)):
            meaning = kind
            if head == "defun":
                meaning = len(form[2]) if len(form) > 2 and isinstance(form[2], list) else 0
            elif head == "area":
                meaning = 0
            self.pending.setdefault(form[1].lower(), meaning)
        for item in form:
            self.declare(item)

    # ---- writing instructions

    def emit(self, op, number=0):
        """One more instruction."""
        if op > _PURE and (op == _WRITE or op == _FLAG or (_IN != op < _ENTER and op > _UNKNOWN) or op > _DEFINED):
            self.acts = True
        if len(self.code) > _MAX_BYTES:
            raise MemoryError
        size = 0 if not number else 1 if number < 256 else 2
        self.code.append(op | size << 6)
        self.code.extend(number.to_bytes(size, "little"))

    def jump(self, op):
        """An instruction that jumps; gives its place."""
        place = len(self.code)
        self.code.extend(bytes((op | 128, 0, 0)))
        return place

    def arrive(self, *places):
        """Let the instructions at these places jump here."""
        for place in places:
            struct.pack_into("<H", self.code, place + 1, len(self.code))

    def two(self, number):
        """A number behind the latest instruction."""
        self.code.extend(number.to_bytes(2, "little"))

    def thing(self, one, *more):
        """What the latest instruction names. more: what comes behind it."""
        if not more and one in self.things:
            self.two(2 + self.things.index(one))
        else:
            self.two(2 + len(self.things))
            self.things.append(self.mind.kept(one) if isinstance(one, str) else one)
            self.things.extend(more)

    def number(self, value):
        """A constant."""
        if value is None:
            self.emit(_UNKNOWN)
            return
        hundredths = int(100 * value + 0.5) if 0 <= value < 655 else 0
        if hundredths / 100 == value and math.copysign(1, value) > 0:
            self.emit(_CONSTANT, hundredths)
        else:
            self.emit(_NUMBER)
            self.code.extend(struct.pack("<d", value))

    def row(self, forms):
        """One after the other; the value of the last, 0 of none. Gives the cost, like everything that writes."""
        if not forms:
            self.number(0.0)
        cost = 0
        for at, form in enumerate(forms):
            if at:
                self.emit(_POP)
            cost += self.part(form)
        return cost

    def each(self, forms):
        """One after the other; no value is kept."""
        cost = 0
        for form in forms:
            cost += self.part(form)
            self.emit(_POP)
        return cost

    def parts(self, forms):
        """All of them, their values left on the stack."""
        cost = 0
        for form in forms:
            cost += self.part(form)
        return cost

    # ---- names

    def scope(self, keys, fixed=False):
        """Local names from here on; gives the place of the first."""
        first = self.locals
        self.scopes.append({key: first + at for at, key in enumerate(keys)})
        self.locals += len(keys)
        if fixed:
            self.fixed.append(first)
        return first

    def local(self, key):
        """The place of a local name, innermost first."""
        for at in range(len(self.scopes) - 1, -1, -1):
            if key in self.scopes[at]:
                return self.scopes[at][key]
        return None

    def kind_of(self, key):
        """What a learned name is or will be: variable, rule, operator, group, or None."""
        pending = self.pending.get(key)
        return self.mind.kind_of(key) or ("operator" if isinstance(pending, int) else pending)

    def meaning(self, key):
        """What a name is already, in words; None if it is free."""
        if buffer_number(key) is not None:
            return "buffer"
        if is_fixed(key):
            return "function"
        binding = self.mind.binding(key)
        if binding is None:
            return self.kind_of(key)
        if isinstance(binding, Function):
            return "function"
        return "constant" if isinstance(binding, tuple) else self.mind.kind(binding) + " variable"

    def free_for(self, name, kind):
        """Refuse a name that means something of another kind."""
        meaning = self.meaning(name.lower())
        if meaning not in (None, kind):
            article = "an" if meaning[:1] in "aeiou" else "a"
            raise Refused(_TAKEN_REFUSED, name, article, meaning, kind)

    def may_be_local(self, name):
        """Refuse a local name that hides a constant."""
        if isinstance(self.mind.binding(name.lower()), tuple):
            raise Refused(_CONSTANT_REFUSED, name)

    def use(self, key):
        if key not in self.uses:
            self.uses.append(self.mind.kept(key))

    # ---- parts

    def part(self, form):
        """Write what evaluates a form."""
        self.count[0] += 1
        if isinstance(form, tuple):
            self.number(form[0])
            return 1
        if isinstance(form, str):
            self.name(form)
            return 1
        if isinstance(form, bytes):
            raise Refused(_TEXT_REFUSED)
        return self.call(form)

    def name(self, name):
        key = name.lower()
        place = self.local(key)
        if place is not None:
            self.emit(_LOCAL, place)
            return
        binding = self.mind.binding(key)
        if isinstance(binding, int):
            self.emit(_VARIABLE, binding)
        elif isinstance(binding, tuple):
            self.number(binding[0])
        elif binding is not None or is_fixed(key):
            raise Refused(_FUNCTION_REFUSED, name, name)
        else:
            self.learned(name, key)

    def learned(self, name, key):
        number = buffer_number(key)
        if number == 0:
            raise Refused(_E0_NAMED_REFUSED)
        if number is not None:
            key = "e%d" % number
            self.use(key)
            self.emit(_ENTER)
            self.thing(key)
            return
        kind = self.kind_of(key)
        self.use(key)
        if kind == "variable":
            self.emit(_VARIABLE, self.mind.slot(key))
        elif kind in (GROUP, "operator"):
            hint = "IN %s" % name if kind == GROUP else "%s ..." % name
            raise Refused(_SORT_REFUSED, name, "an" if kind != GROUP else "a", kind, hint)
        else:
            self.emit(_ENTER)
            self.thing(key)

    def call(self, form):
        if not form:
            raise Refused(_EMPTY_REFUSED)
        head = form[0]
        if not isinstance(head, str):
            raise Refused(_HEAD_REFUSED)
        key = head.lower()
        if is_fixed(key):
            return self.builtin(form, key)
        binding = self.mind.binding(key)
        if isinstance(binding, Function):
            return self.host(form, binding)
        kind = "buffer" if buffer_number(key) is not None else self.kind_of(key)
        if binding is not None or kind not in (None, "operator"):
            raise Refused(_NO_FUNCTION_REFUSED, head, self.meaning(key))
        if kind is None and gives_way(key):
            return self.builtin(form, key)
        self.use(key)
        if kind:
            self.arguments(form, self.parameters(key), self.parameters(key))
        return self.operator(key, form[1:], head if kind is None else "")

    def operator(self, key, forms, unknown):
        """Call an operator that is there when this is reached. unknown: the name of one that is not there yet."""
        self.emit(_OPERATOR, len(forms))
        self.thing(key, unknown)
        jump = self.jump(_JUMP)
        cost = self.parts(forms)
        self.emit(_CALL, len(forms))
        self.thing(key)
        self.arrive(jump)
        return 1 + cost

    def parameters(self, key):
        learned = self.mind.learned.get(key)
        return self.pending.get(key, 0) if learned is None else learned[0][_PARAMETERS]

    def arguments(self, form, least, most):
        """Refuse a wrong number of arguments."""
        given = len(form) - 1
        if least <= given <= most:
            return
        wanted = "%d" % least if least == most else "at least %d" % least
        if least != most and most < _MANY:
            wanted = "%d to %d" % (least, most)
        if given > _MANY:
            wanted = "at most %d" % most
        plural = "" if wanted[-2:] in ("1", " 1") else "s"
        raise Refused(_COUNT_REFUSED, form[0], wanted, plural, given)

    def builtin(self, form, key):
        self.arguments(form, *arguments_of(key))
        key = "=" if key == "eq" else key
        if key == "edge-dist" or pure_number(key) is None:
            return self.mind.write_form(self, form, key)
        return self.pure(key, form[1:])

    def pure(self, key, forms):
        """Call a pure function."""
        cost = 1 + self.parts(forms)
        if key in _BINARY and len(forms) == 2:
            self.emit(_BINARY.index(key) + _LESS)
        else:
            self.calculate(key, len(forms))
        return cost

    def calculate(self, key, count):
        """Call a pure function with the upper values of the stack."""
        self.emit(_PURE, count)
        self.code.append(pure_number(key))

    def host(self, form, function):
        self.arguments(form, function.least, function.most)
        label, rest = None, form[1:]
        if function.labelled:
            if not isinstance(form[1], bytes):
                raise Refused(_LABEL_REFUSED, form[0])
            label, rest = str(form[1], "utf-8"), form[2:]
        cost = self.parts(rest)
        self.acts = self.acts or function.acts
        self.emit(_HOST, len(rest))
        self.thing(function, label)
        return 1 + cost


_DECLARES = {"defvar": "variable", "rule": "rule", "defun": "operator", "area": "operator", "join": GROUP}


def deciding(c, form):
    """The form that decides whether a message is for this robot: its first COND, IF, WHEN or AND; None if it has
    none."""
    head = head_of(form)
    if head == "and":
        from sleepnode.leading import leading

        return form if leading(c, form) else None
    if head in ("if", "when") or (head == "cond" and len(form) > 1):
        return form
    if head in ("progn", "let"):
        for part in form[2 if head == "let" else 1 :]:
            if _tested(part):
                return deciding(c, part)
    return None


def _tested(form):
    head = head_of(form)
    if head in ("progn", "let"):
        return any([_tested(part) for part in form[2 if head == "let" else 1 :]])
    return head in ("cond", "if", "when", "and")
