"""A robot's mind: its variables, rules, operators and groups, and what a tick does with them.

Variables lie in one list: the flags that every robot has, then sensors, actuators, and the variables that DEFVAR makes.
What the robot has learned lies in one table by name: a slot for a variable, a program for a rule, buffer or operator,
GROUP for a group. What is to be known of a rule besides stands in its program's first bytes.
"""

import gc

from micropython import const

from sleepnode import chance
from sleepnode.checker import GROUP, Checker, buffer_number, deciding, through
from sleepnode.machine import run
from sleepnode.reader import Refused, head_of, read, unload

_WHOLE = const(("after-issue", "best", "quorum"))
"""Forms that are a whole command (`oneshot.py`)."""
_MAX_TEXT = const(16384)
_MAX_RULES = const(64)
_MAX_OPERATORS = const(64)
_MAX_GROUPS = const(64)
_ID = const(67)
_TIME = const(68)
_TICK = const(69)
_USES = const(1)

# Refusals, by their places in `sentences.py`.
_DEEP_REFUSED = const(64)
_VARIABLES_REFUSED = const(65)

_MARKED = const(0)
_FROZEN = const(2)
_SLEEPING = const(3)
_ACTIVE = const(3)
_SUPPORT = const(70)
_MAX_VARIABLES = const(256)
_MAX_FAULTS = const(100)
_MAX_FAULTS_IN_ROW = const(10)
_TICK_STEPS = const(50000)
_PROVEN_TICKS = const(100)
_MAX_OUTBOX = const(64)
_TELL_BURST = const(8)
_TELLS_A_SECOND = const(2.0)
_TELLS_TOO_OFTEN = const("tells too often: more than 2 a second are dropped")


# The first bytes of a program, and its flags (`machine.py`).
_FAULTS = const(0)
_BUILT_IN = const(255)
_FLAGS = const(1)
_PARAMETERS = const(7)
_RUNS = const(1)
_RULE = const(4)


class Mind:
    """See the module. number: its `id`. seed: of its chance. After `evaluate` and `rule`: matched, undecided (whether
    its test was unknown), faults and moved (whether the body was asked to move).

    write_form: how special forms are written (`forms.py`).

    ruling, moving, whole: of the text compiled last: whether it changes rules, which groups it makes robots join or
    leave, and what it asks for as a whole command (`oneshot.py`).
    reports, told, pings: what it says, until somebody takes it. dirty: slots of actuators that were assigned. held:
    whether functions that act are refused.
    """

    def __init__(self, *given, **named):
        try:
            from sleepnode.mind_start import begin

            begin(self, *given, **named)
        finally:
            unload("mind_start")

    # ---- names

    def binding(self, key):
        """What the robot was made with: a slot, a constant in a tuple, a Function; or None."""
        binding = self.names.get(key)
        if binding is None and key.startswith("active") and key[6:].isdigit() and key[6:7] != "0":
            number = int(key[6:])
            if number < 64:
                return _ACTIVE + number
        return binding

    def kind(self, slot):
        """sensor, actuator or support."""
        if slot < _SUPPORT:
            return "sensor" if slot >= _ID else "support"
        return "sensor" if slot < self.first_actuator else "actuator"

    def is_active_flag(self, slot):
        return _ACTIVE < slot < _ID

    def assignable(self, slot):
        return self.kind(slot) != "sensor"

    def slot(self, key):
        """The slot of a user variable, a new one if nobody has named it."""
        known = self.learned.get(key)
        if isinstance(known, int):
            return known
        if key not in self._slots:
            if len(self.values) - self.first_user >= _MAX_VARIABLES:
                raise Refused(_VARIABLES_REFUSED, key, _MAX_VARIABLES)
            self.values += (None,)  # `append` would double it
            self._slots[key] = len(self.values) - 1
        return self._slots[key]

    def kind_of(self, key):
        """What a learned name is: variable, rule, operator or group; None for a name that is not learned."""
        known = self.learned.get(key)
        if isinstance(known, tuple):
            return "rule" if known[0][_FLAGS] & _RULE else "operator"
        return "variable" if isinstance(known, int) else known

    def kept(self, text):
        """A text that programs have: that of the learned name, if it is one, which saves memory."""
        for key in self.learned:
            if key == text:
                return key
        return text

    def reaches(self, uses, goal, pending=None):
        """A way from `uses` to `goal` along what each rule, buffer and operator enters; None if there is none."""
        waiting, seen = [(key,) for key in uses], {}
        while waiting:
            way = waiting.pop()
            last = way[-1]
            if last == goal:
                return way
            if last in seen:
                continue
            seen[last] = True
            if pending and last in pending:
                more = pending[last]
            else:
                known = self.learned.get(last)
                more = known[_USES] if isinstance(known, tuple) else ()
            for key in more:
                waiting.append(way + (key,))
        return None

    def groups(self):
        """The keys of the groups that this robot is in."""
        return [key for key in self._members if self._members[key]]

    # ---- evaluating

    def compile(self, text, inside=None):
        """The program of a message. inside: gives the form that is meant instead of the whole one. Raises Refused."""
        gc.collect()
        gc.threshold(1024)
        try:
            form = read(text)
            if inside:
                form = inside(form)
            plan = self._plan(form, head_of(form))
            if _remembers(form):
                form = self._written_out(form, Checker(self))
            checker = Checker(self)
            checker.declare(form)
            checker.deciding, checker.plan = deciding(checker, form), plan
            program = checker.program([form])
            self.ruling, self.moving, self.whole = checker.rules, checker.moves, plan and plan[0]
            return program
        except RuntimeError:  # the interpreter's own stack is full
            raise Refused(_DEEP_REFUSED)
        except MemoryError:
            raise Refused("too long for the memory of this computer")
        finally:
            gc.threshold(-1)
            unload("leading", "seldom", "whole")

    def _plan(self, form, head):
        """What a whole command asks for; None for others."""
        if head not in _WHOLE or self.binding(head) or self.kind_of(head):
            return None
        try:
            from sleepnode.oneshot import plan

            return plan(form, head)
        finally:
            unload("oneshot")

    def _written_out(self, form, checker):
        """A form without forms that remember. What writes them out is loaded for one text, to save memory."""
        try:
            from sleepnode.remembering import written_out

            checker.declare(form)
            return written_out(form, checker)
        finally:
            unload("sharing", "remembering")

    def evaluate(self, text):
        """The value of a text, None if unknown. Raises Refused."""
        program = self.compile(text)
        gc.collect()
        return self.run(program)

    def run(self, program):
        """The value of a program."""
        self.moved = False
        try:
            self.faults = []
            return run(self, program)
        except MemoryError:
            return self.fault("out of memory")

    def ask(self, program):
        """The value of a program that changes nothing: what it would do is left out, and variables are set back."""
        drawn, self._before = self._draws, {}
        self.asked = True
        try:
            return self.run(program)
        finally:
            for slot in self._before:
                self.values[slot] = self._before[slot]
            self._draws, self.asked = drawn, False

    def put(self, slot, value):
        """Give a variable a value."""
        if self.asked and slot not in self._before:
            self._before[slot] = self.values[slot]
        self.values[slot] = value

    def rule(self, key):
        """Evaluate a rule."""
        value = self.run(self.learned[key])
        if self.kind_of(key) != "rule":
            return value
        state = self.learned[key][0]
        own = state[_FAULTS] == _BUILT_IN
        if self.faults:
            self._changing()
        if own:
            return value
        state[_FAULTS] = state[_FAULTS] + 1 if self.faults else 0
        if state[_FAULTS] >= _MAX_FAULTS_IN_ROW:
            self.activate(key, False)
            self.since = None
            self.reports.append(("rule %s deactivated" % key, (), key))
        return value

    def begin(self, tick, now):
        """Begin a tick: what its time and its chance are."""
        gc.collect()
        values = self.values
        for at, value in enumerate(values):
            if value:  # made again, where memory is free
                values[at] = value + 0.0
        self.tick, self.now, self._draws = tick, now, 0
        self.values[_TICK], self.values[_TIME] = float(tick), now
        for key in [key for key, until in self.leases.items() if until <= now]:
            if self.runs(key):
                self.activate(key, False)
                self.report("lease of %s ended" % key, ())
            self.leases.pop(key, None)

    def round(self, own=False):
        """Evaluate the active rules, as far as the budget of a tick goes; the rest comes first in the next one. own:
        only those that no message can change. Gives whether a rule has moved the body."""
        if self.values[_SLEEPING] or self.values[_FROZEN]:
            return False
        due, used, moved = self._due, 0, False
        due[:] = self.order
        for at, key in enumerate(due):
            if not self.runs(key):
                due[at] = None
        first = due.index(self._left) if self._left and self._left in due else 0
        self._left = None
        count = len(due)
        for at in range(first, first + count):
            key = due[at % count]
            if key is None or not self.runs(key) or (own and self.learned[key][0][_FAULTS] != _BUILT_IN):
                continue
            if used > _TICK_STEPS:
                self._left = key
                break
            self.rule(key)
            used += self.steps
            moved = moved or self.moved
        return moved

    def install(self, key, text):
        """Give the robot a rule of its own that no message can change. Raises Refused."""
        self.evaluate("(RULE %s %s)" % (key, text))
        if self.faults:
            raise Refused(self.faults[0])
        self.learned[key.lower()][0][_FAULTS] = _BUILT_IN

    # ---- called by the machine

    def fault(self, reason):
        """Note what went wrong; gives unknown."""
        if len(self.faults) < _MAX_FAULTS:
            self.faults.append(reason)
        return None

    def note_test(self, value):
        """The top-level test, or one clause of it, has this value."""
        if value:
            self.matched = True
        elif value is None:
            self.undecided = True

    def draw(self):
        self._draws += 1
        return chance.draw(self.key, self.tick, self._draws - 1)

    def value_of(self, key):
        known = self.learned[key]
        return self.values[known] if isinstance(known, int) else self.fault("%s is already a name" % key)

    def expression(self, key):
        """The program of a rule or buffer; the value of a variable that was made later; None for neither."""
        known = self.learned.get(key)
        if isinstance(known, int):
            return self.values[known]
        return known if self.kind_of(key) == "rule" else None

    def operator(self, key, count, unknown=""):
        """The program of an operator with so many parameters, None and a fault if there is none."""
        known = self.learned.get(key)
        if self.kind_of(key) == "operator" and known[0][_PARAMETERS] == count:
            return known
        return self.fault(
            "this robot has no function %s" % unknown if unknown else "no operator %s of %d arguments" % (key, count)
        )

    def write(self, slot, value):
        """SETQ of an actuator, a flag or a user variable."""
        if slot < self.first_user:
            actuator = slot >= self.first_actuator
            if value is None:
                self.dropped += 1
                return self.fault("unknown never reaches an actuator" if actuator else "unknown cannot be a flag")
            if actuator and not self.asked:
                self.moved = True
                if slot not in self.dirty:
                    self.dirty.append(slot)
        self.put(slot, value)
        return value

    def assign(self, key, value):
        """SETQ of a user variable that was not there when the text was checked."""
        slot = self.learned.get(key)
        if not isinstance(slot, int):
            return self.fault("no variable %s: make it first with (DEFVAR %s)" % (key, key))
        self.put(slot, value)
        return value

    def host(self, function, label, arguments):
        """Call one of the robot's own functions; whatever it raises is a fault."""
        if None in arguments:
            if function.acts:
                self.dropped += 1
                return self.fault("unknown never reaches the body (%s)" % function.name)
            return None
        if function.acts:
            if self.asked:
                return 1.0
            if self.held:
                return self.fault("the robot is stopped: %s waits for RELEASE" % function.name)
            self.moved = True
        try:
            value = function.call(*([label] if function.labelled else []) + arguments)
            value = (1.0 if function.acts else None) if value is None else float(value)
        except Exception as error:
            return self.fault("%s failed: %r" % (function.name, error))
        return value if value is not None and value - value == 0 else None

    def cancel(self):
        """CANCEL: how many commands of its sender were discarded; a mind alone lets none wait."""
        return 0.0

    def report(self, label, values):
        if self.asked:
            return
        if len(self.reports) < _MAX_OUTBOX:
            self.reports.append((label, values, ""))
        else:
            self.lost += 1

    def tell(self, text, hops):
        """Tell other robots, within the bounds of TELL."""
        if self.asked:
            return
        hops = min(hops, self.hops)
        begin = max(self._paid, self.now)
        often = begin - self.now > (_TELL_BURST - 1) / _TELLS_A_SECOND
        if often or hops < 1:
            self.lost += 1
            if not self._refused:
                self._refused = True
                self.report(_TELLS_TOO_OFTEN if often else "did not tell on what came by its last hop", ())
            return
        if len(text) > _MAX_TEXT:
            self.fault("a text of %d characters cannot be sent by TELL: at most %d fit" % (len(text), _MAX_TEXT))
            return
        self._refused = self._refused and begin > self.now
        self._paid = begin + 1.0 / _TELLS_A_SECOND
        self.told.append((text, hops))

    def act(self, which, key, stack):
        """Acts on groups, rules and variables. which: of the instructions from "rollback" on."""
        if self.asked and which not in (2, 5):
            if which in (1, 6, 10):
                stack.pop()
            value = 1.0
        elif which == 0:
            if self.since is None or self.tick - self.since < _PROVEN_TICKS:
                self._rolling("roll_back")
            value = 1.0
        elif which == 1:
            value = self._ping(stack.pop())
        elif which == 2:
            value = 1.0 if self._members.get(key) else 0.0
        elif which <= 4:
            value = self._join(key, which == 3)
        elif which == 5:
            value = self._define(key, stack.pop())
        elif which == 6:
            value = self._store_number(key, stack.pop())
        elif which <= 8:
            value = self._switch(key, which == 7)
        elif which == 9:
            value = self._forget(key)
        else:
            value = self._lease(key, stack.pop())
        stack.append(value)

    def _ping(self, caste):
        if caste is None:
            return self.fault("an unknown caste cannot be sent")
        if len(self.pings) < _MAX_OUTBOX:
            self.pings.append(caste)
        return 1.0

    # ---- learning

    def _clash(self, key, kind):
        """Whether a name means something of another kind; that is a fault."""
        if self.kind_of(key) in (None, kind):
            return False
        self.fault("%s is already the name of something else" % key)
        return True

    def _full(self, kind, most):
        """Whether there is no room for one more of a kind; that is a fault."""
        count = sum([self.kind_of(key) == kind and buffer_number(key) is None for key in self.learned])
        if count < most:
            return False
        self.fault("no room for another %s: there are %d" % (kind, most))
        return True

    def _define(self, key, value):
        if self.asked:
            return value
        if self._clash(key, "variable"):
            return None
        slot = self.slot(key)
        self._slots.pop(key, None)
        self.learned[key] = slot
        self.values[slot] = value
        return value

    def store(self, key, program, activate):
        """SETQQ, RULE, and SETQ of a buffer."""
        if self.asked:
            return 1.0 if activate else 0.0
        way = self.reaches(program[_USES], key)
        if way:
            return self.fault("%s would name itself%s" % (key.upper(), through(way)))
        if self._clash(key, "rule"):
            return None
        before = self.learned.get(key)
        if before is None:
            if buffer_number(key) is None and self._full("rule", _MAX_RULES):
                return None
            self._changing()
        elif before[0][_FAULTS] == _BUILT_IN:
            return self._built_in(key)
        else:
            self._changing()
        program[0][_FAULTS] = 0
        program = (bytearray(program[0]),) + program[1:]  # made again, where memory is free
        if before is None:
            key = str(key.encode(), "utf-8")
            self.place(key)
        try:
            self.learned[key] = program
        except MemoryError:
            self.order.remove(key)
            raise
        if activate:
            self.activate(key, True)
        return 1.0 if activate else 0.0

    def _store_number(self, key, value):
        """SETQ of a buffer."""
        if value is None:
            return self.fault("an unknown cannot be stored")
        program = Checker(self).stored(key, [(value, "", True)], flags=_RULE)[0]
        return None if self.store(key, program, False) is None else value

    def place(self, key):
        """Put a new rule where it runs: buffers by their number, then the others as they come."""
        number, at = buffer_number(key), len(self.order)
        if number is not None:
            while at:
                other = buffer_number(self.order[at - 1])
                if other is not None and other < number:
                    break
                at -= 1
        if len(self._due) <= len(self.order):
            self._due.append(None)
        self.order.insert(at, key)

    def operate(self, key, program):
        """DEFUN."""
        if self.asked:
            return 1.0
        if self._clash(key, "operator"):
            return None
        if key not in self.learned and self._full("operator", _MAX_OPERATORS):
            return None
        way = self.reaches(program[_USES], key)
        if way:
            return self.fault("%s would name itself%s" % (key.upper(), through(way)))
        self.learned[key] = program
        return 1.0

    def _join(self, key, member):
        if not member:
            if key in self._members:
                self._members[key] = False
            return 1.0
        if self._clash(key, GROUP) or (key not in self.learned and self._full(GROUP, _MAX_GROUPS)):
            return None
        self.learned[key] = GROUP
        self._members[key] = True
        return 1.0

    def _built_in(self, key):
        return self.fault("%s is built into the robot: it cannot be changed" % key)

    def _is_changeable(self, key):
        """Whether messages may change a rule; if not, that is a fault."""
        if self.kind_of(key) != "rule":
            self.fault("no rule %s" % key)
            return False
        if self.learned[key][0][_FAULTS] == _BUILT_IN:
            self._built_in(key)
            return False
        return True

    def runs(self, key):
        number = buffer_number(key)
        if number is not None:
            return bool(self.values[_ACTIVE + number])
        return self.kind_of(key) == "rule" and bool(self.learned[key][0][_FLAGS] & _RUNS)

    def activate(self, key, on):
        number, state = buffer_number(key), self.learned[key][0]
        state[_FLAGS] = state[_FLAGS] | _RUNS if on else state[_FLAGS] & ~_RUNS
        if number is not None:
            self.values[_ACTIVE + number] = 1.0 if on else 0.0
        if not on:
            self.leases.pop(key, None)

    def _switch(self, key, on):
        number = buffer_number(key)
        if number is not None and key not in self.learned:
            self.values[_ACTIVE + number] = 1.0 if on else 0.0
            return 1.0
        if not self._is_changeable(key):
            return None
        self._changing()
        self.activate(key, on)
        return 1.0

    def _forget(self, key):
        if self.kind_of(key) == "operator":
            del self.learned[key]
            return 1.0
        if not self._is_changeable(key):
            return None
        self._changing()
        self.remove(key)
        return 1.0

    def remove(self, key):
        self.activate(key, False)
        del self.learned[key]
        self.order.remove(key)
        if key in self._due:
            self._due[self._due.index(key)] = None

    def _lease(self, key, seconds):
        if seconds is None:
            return self.fault("a lease of unknown length")
        if not self._is_changeable(key):
            return None
        self._changing()
        self.leases[key] = self.now + seconds
        return 1.0

    # ---- rolling back

    def _changing(self):
        """The rules change, or one has met a fault: a proven set becomes the one to roll back to."""
        proven = self.since is not None and self.tick - self.since >= _PROVEN_TICKS
        self.since = self.tick
        if proven:
            try:
                self._rolling("remember")
            except MemoryError:  # the one before stays
                self.report("no memory to remember the rules for ROLLBACK", ())

    def _rolling(self, what):
        """Call a function of `rolling.py`."""
        try:
            from sleepnode import rolling

            getattr(rolling, what)(self)
        finally:
            unload("rolling")


_REMEMBERING = const(" once held hysteresis every after within age share ")


def _remembers(form):
    """Whether a text has a form that remembers from tick to tick."""
    if not isinstance(form, list):
        return False
    for item in form:
        if _remembers(item):
            return True
    return " %s " % head_of(form) in _REMEMBERING


def command_of(form):
    """What a whole command asks for when its time has come."""
    return form[2] if len(form) == 3 else ["when", form[3], form[4]]


def bid_of(form):
    """What a robot bids: the cost, if the test is true."""
    return ["when", form[3], form[2] if form[0].lower() == "best" else (0.0, "0", True)]
