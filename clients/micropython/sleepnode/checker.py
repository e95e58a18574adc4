"""The checker: forms in, a program out, or a refusal.

A program is a tuple of instructions for the machine (`instructions.py`). Local names become places in a frame,
variables become slots; names that nobody has declared yet are looked up when they are reached, because they may come
later.
How each special form is written stands in `forms.py`.
"""

from micropython import const

from sleepnode.functions import PURE, WORDS, arguments_of, is_fixed
from sleepnode.instructions import parameters_of, shape
from sleepnode.reader import Label, Refused, head_of, height

_MAX_STEPS = const(10000)
_STORE_STEPS = const(40)
_MANY = const(100)
_USES = const(2)
_FIRST = const(3)

# Instructions, by the numbers of `instructions.number_of`: constants cost no memory.
_VARIABLE = const(0)
_CONSTANT = const(1)
_PURE = const(9)
_JUMP = const(11)
_POP = const(12)
_ZERO = const(13)
_LOCAL = const(15)
_RETURN = const(16)
_ENTER = const(17)
_CALL = const(18)
_OPERATOR = const(19)
_HOST = const(32)
_LESS = const(3)

# Refusals, by their places in `sentences.SENTENCES`.
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


class Checker:
    """One pass over one text. mind: the robot's names. outer: the checker of the text that stores this one."""

    def __init__(self, mind, outer=None):
        self.mind = mind
        self.code = [0] * _FIRST
        self.scopes = []
        self.fixed = []
        self.locals = self.loops = 0
        self.uses = {}
        self.deciding = None
        self.rules, self.moves = False, []
        """Whether the text changes rules, and the keys of groups that it makes robots join or leave."""
        self.tested = False
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
        tall = max([height(form) for form in forms] or [0])
        if self.locals > _MAX_LOCALS:
            raise Refused(_LOCALS_REFUSED, self.locals, _MAX_LOCALS)
        self.code[0] = cost
        self.code[1] = shape(tall, self.locals, len(parameters), self.tested)
        self.code[2] = tuple(self.uses)
        return tuple(self.code)

    def stored(self, key, forms, parameters=()):
        """The program of forms to be stored under a key, and the steps that storing costs."""
        before = self.count[0]
        program = Checker(self.mind, self).program(forms, parameters)
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
        sort = _DECLARES.get(head)
        if sort and len(form) > 1 and isinstance(form[1], str) and not (head in WORDS and self.meaning(head)):
            found = sort
            if head == "defun":
                found = len(form[2]) if len(form) > 2 and isinstance(form[2], list) else 0
            elif head == "area":
                found = 0
            self.pending.setdefault(form[1].lower(), found)
        for item in form:
            self.declare(item)

    # ---- writing instructions

    def emit(self, op, number=0, *more):
        """One more instruction; gives its place."""
        self.code.append(op | number << 6)
        self.code.extend(more)
        return len(self.code) - 1 - len(more)

    def arrive(self, *places):
        """Let the instructions at these places jump here."""
        for place in places:
            self.code[place] |= len(self.code) << 6

    def row(self, forms):
        """One after the other; the value of the last, 0 of none. Gives the cost, like everything that writes."""
        if not forms:
            self.emit(_ZERO)
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

    def sort_of(self, key):
        """What a learned name is or will be: variable, rule, operator, group, or None."""
        found = self.mind.learned.get(key)
        if found is None:
            found = self.pending.get(key)
            return "operator" if isinstance(found, int) else found
        if found is GROUP:
            return GROUP
        return "variable" if isinstance(found, int) else "operator" if isinstance(found, tuple) else "rule"

    def meaning(self, key):
        """What a name is already, in words; None if it is free."""
        if buffer_number(key) is not None:
            return "buffer"
        if is_fixed(key):
            return "function"
        found = self.mind.binding(key)
        if found is None:
            return self.sort_of(key)
        if isinstance(found, Function):
            return "function"
        return "constant" if isinstance(found, tuple) else self.mind.kind(found) + " variable"

    def free_for(self, name, sort):
        """Refuse a name that means something of another sort."""
        meaning = self.meaning(name.lower())
        if meaning not in (None, sort):
            article = "an" if meaning[:1] in "aeiou" else "a"
            raise Refused(_TAKEN_REFUSED, name, article, meaning, sort)

    def may_be_local(self, name):
        """Refuse a local name that hides a constant."""
        if isinstance(self.mind.binding(name.lower()), tuple):
            raise Refused(_CONSTANT_REFUSED, name)

    def use(self, key):
        self.uses[key] = True

    # ---- parts

    def part(self, form):
        """Write what evaluates a form."""
        self.count[0] += 1
        if isinstance(form, tuple):
            self.emit(_CONSTANT, 0, self.mind.shared(form[0]))
            return 1
        if isinstance(form, str):
            self.name(form)
            return 1
        if isinstance(form, Label):
            raise Refused(_TEXT_REFUSED)
        return self.call(form)

    def name(self, name):
        key = name.lower()
        place = self.local(key)
        if place is not None:
            self.emit(_LOCAL, place)
            return
        found = self.mind.binding(key)
        if isinstance(found, int):
            self.emit(_VARIABLE, found)
        elif isinstance(found, tuple):
            self.emit(_CONSTANT, 0, found[0])
        elif found is not None or is_fixed(key):
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
            self.emit(_ENTER, 0, key)
            return
        sort = self.sort_of(key)
        self.use(key)
        if sort == "variable":
            self.emit(_VARIABLE, self.mind.slot(key))
        elif sort in (GROUP, "operator"):
            hint = "IN %s" % name if sort == GROUP else "%s ..." % name
            raise Refused(_SORT_REFUSED, name, "an" if sort != GROUP else "a", sort, hint)
        else:
            self.emit(_ENTER, 0, key)

    def call(self, form):
        if not form:
            raise Refused(_EMPTY_REFUSED)
        head = form[0]
        if not isinstance(head, str):
            raise Refused(_HEAD_REFUSED)
        key = head.lower()
        if is_fixed(key):
            return self.builtin(form, key)
        found = self.mind.binding(key)
        if isinstance(found, Function):
            return self.host(form, found)
        sort = "buffer" if buffer_number(key) is not None else self.sort_of(key)
        if found is not None or sort not in (None, "operator"):
            raise Refused(_NO_FUNCTION_REFUSED, head, self.meaning(key))
        if sort is None and key in WORDS:
            return self.builtin(form, key)
        self.use(key)
        if sort:
            self.arguments(form, self.parameters(key), self.parameters(key))
        return self.operator(key, form[1:], head if sort is None else "")

    def operator(self, key, forms, unknown):
        """Call an operator that is there when this is reached. unknown: the name of one that is not there yet."""
        self.emit(_OPERATOR, len(forms), key, unknown)
        jump = self.emit(_JUMP)
        cost = self.parts(forms)
        self.emit(_CALL, len(forms), key)
        self.arrive(jump)
        return 1 + cost

    def parameters(self, key):
        found = self.mind.learned.get(key)
        return self.pending.get(key, 0) if found is None else parameters_of(found)

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
        if key in PURE and key != "edge-dist":
            return self.pure(key, form[1:])
        return self.mind.write_form(self, form, key)

    def pure(self, key, forms):
        """Call a pure function."""
        cost = 1 + self.parts(forms)
        if key in _BINARY and len(forms) == 2:
            self.emit(_BINARY.index(key) + _LESS)
        else:
            self.emit(_PURE, len(forms), PURE[key])
        return cost

    def host(self, form, function):
        self.arguments(form, function.least, function.most)
        label, rest = None, form[1:]
        if function.labelled:
            if not isinstance(form[1], Label):
                raise Refused(_LABEL_REFUSED, form[0])
            label, rest = form[1].text, form[2:]
        cost = self.parts(rest)
        self.emit(_HOST, len(rest), function, label)
        return 1 + cost


_DECLARES = {"defvar": "variable", "rule": "rule", "defun": "operator", "area": "operator", "join": GROUP}


def through(way):
    """How a stored expression comes back to itself: its way without the last."""
    return " through " + ", ".join([key.upper() for key in way[:-1]]) if len(way) > 1 else ""
