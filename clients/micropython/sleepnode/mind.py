"""A robot's mind: its variables, rules, operators and groups, and what a tick does with them.

Variables lie in one list: the flags that every robot has, then sensors, actuators, and the variables that DEFVAR makes.
What the robot has learned lies in one table by name: a slot for a variable, a list for a rule or buffer, a program for
an operator, GROUP for a group. (Lists and tuples take less memory than objects.)
"""

import gc
import math

from micropython import const

from sleepnode import chance
from sleepnode.checker import GROUP, Checker, buffer_number, through
from sleepnode.deciding import deciding
from sleepnode.forms import write as write_form
from sleepnode.instructions import parameters_of
from sleepnode.machine import run
from sleepnode.reader import Refused, head_of, read, unload

_MAX_TEXT = const(16384)
_MAX_RULES = const(64)
_MAX_OPERATORS = const(64)
_MAX_GROUPS = const(64)
_ID = const(67)
_TIME = const(68)
_TICK = const(69)
_USES = const(2)
_MAX_HOPS = const(8)

# Refusals, by their places in `sentences.SENTENCES`.
_MEMORY_REFUSED = const(64)
_DEEP_REFUSED = const(65)
_VARIABLES_REFUSED = const(66)

_MARKED = const(0)
_MARKING = const(1)
_FROZEN = const(2)
_SLEEPING = const(3)
_ACTIVE = const(3)
_SUPPORT = const(70)
_MAX_VARIABLES = const(256)
_MAX_NUMBERS = const(32)
_MAX_FAULTS = const(100)
_MAX_FAULTS_IN_ROW = const(10)
_TICK_STEPS = const(50000)
_PROVEN_TICKS = const(100)
_MAX_OUTBOX = const(64)
_TELL_BURST = const(8)
_TELLS_A_SECOND = const(2.0)
_TELLS_TOO_OFTEN = const("tells too often: more than 2 a second are dropped")
_CONSTANTS = {"true": 1.0, "false": 0.0, "nil": 0.0, "pi": math.pi, "unknown": None}


_KEY = const(0)
_PROGRAM = const(1)
_RUNS = const(2)
_FAULTS = const(3)
"""Places in a rule: its key, its program, whether it runs (a buffer's flag says that), its evaluations in a row with a
fault (-1: it is built in, and no message can change it)."""


class Mind:
    """See the module. number: its `id`. seed: of its chance. After `evaluate` and `rule`: matched, undecided (whether
    its test was unknown), faults and moved (whether the body was asked to move).

    ruling, moving: whether the text compiled last changes rules, and which groups it makes robots join or leave.
    reports, told, pings: what it says, until somebody takes it. dirty: slots of actuators that were assigned. held:
    whether functions that act are refused.
    """

    def __init__(self, sensors=(), actuators=(), constants=None, functions=(), number=0, seed=0):
        self.values = [0.0] * (_ID) + [float(number), 0.0, 0.0] + [None] * (len(sensors) + len(actuators))
        self.values[_MARKING] = 1.0
        self.first_actuator = _SUPPORT + len(sensors)
        self.first_user = self.first_actuator + len(actuators)
        self.names = {"marked": 0, "marking": 1, "frozen": 2, "sleeping": 3, "id": _ID, "time": _TIME, "tick": _TICK}
        for at, name in enumerate(tuple(sensors) + tuple(actuators)):
            self.names[name.lower()] = _SUPPORT + at
        for table in (_CONSTANTS, constants or {}):
            for name, value in table.items():
                self.names[name.lower()] = (value,)
        for function in functions:
            self.names[function.name.lower()] = function
        self.write_form = write_form
        self.learned = {}
        self._slots = {}
        """Of user variables that texts name and nobody has made yet."""
        self._members = {}
        self.numbers = {}
        self._leases = {}
        """When rules are deactivated, by key."""
        self._order = []
        """Rules and buffers in the order in which they run."""
        self.reports, self.told, self.pings, self.dirty = [], [], [], []
        self.faults = []
        self.matched, self.undecided, self.moved, self.held = False, False, False, False
        self.ruling, self.moving, self.asked = False, (), False
        self.steps = self.dropped = self.lost = 0
        self.hops = _MAX_HOPS
        self.tick, self.now, self._draws = 0, 0.0, 0
        self.key = chance.stream(seed, number)
        self._paid, self._refused = 0.0, False
        self._proven, self.since = (), 0
        self._left = None

    # ---- names

    def binding(self, key):
        """What the robot was made with: a slot, a constant in a tuple, a Function; or None."""
        found = self.names.get(key)
        if found is None and key.startswith("active") and key[6:].isdigit() and key[6:7] != "0":
            number = int(key[6:])
            if number < 64:
                return _ACTIVE + number
        return found

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
        found = self.learned.get(key)
        if isinstance(found, int):
            return found
        if key not in self._slots:
            if len(self.values) - self.first_user >= _MAX_VARIABLES:
                raise Refused(_VARIABLES_REFUSED, key, _MAX_VARIABLES)
            self.values.append(None)
            self._slots[key] = len(self.values) - 1
        return self._slots[key]

    def shared(self, number):
        """A number that programs have: the same one for equal ones, which saves memory."""
        if number not in self.numbers and number and len(self.numbers) < _MAX_NUMBERS:
            self.numbers[number] = number
        return self.numbers.get(number, number)

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
                found = self.learned.get(last)
                found = found[_PROGRAM] if isinstance(found, list) else found
                more = found[_USES] if isinstance(found, tuple) else ()
            for key in more:
                waiting.append(way + (key,))
        return None

    def groups(self):
        """The keys of the groups that this robot is in."""
        return [key for key in self._members if self._members[key]]

    # ---- evaluating

    def compile(self, text):
        """The program of a message. Raises Refused."""
        gc.collect()
        gc.threshold(1024)
        try:
            form = read(text)
            if _remembers(form):
                form = self._written_out(form)
            checker = Checker(self)
            checker.declare(form)
            checker.deciding = deciding(checker, form)
            program = checker.program([form])
            self.ruling, self.moving = checker.rules, checker.moves
            return program
        except RuntimeError:  # the interpreter's own stack is full
            raise Refused(_DEEP_REFUSED)
        except MemoryError:
            raise Refused(_MEMORY_REFUSED)
        finally:
            gc.threshold(-1)

    def _written_out(self, form):
        """A form without forms that remember. What writes them out is loaded for one text, to save memory."""
        from sleepnode.remembering import written_out

        checker = Checker(self)
        checker.declare(form)
        form = written_out(form, checker)
        unload("sharing")
        unload("remembering")
        return form

    def evaluate(self, text):
        """The value of a text, None if unknown. Raises Refused."""
        return self.run(self.compile(text))

    def run(self, program):
        """The value of a program."""
        self.faults = []
        self.moved = False
        try:
            return run(self, program)
        except MemoryError:
            return self.fault("out of memory")

    def ask(self, program):
        """The value of a program that changes nothing: what it would do is left out, and variables are set back."""
        kept, drawn, self.asked = self.values, self._draws, True
        self.values = list(kept)
        value = self.run(program)
        self.values, self._draws, self.asked = kept, drawn, False
        return value

    def rule(self, rule):
        """Evaluate a rule."""
        value = self.run(rule[_PROGRAM])
        own = rule[_FAULTS] < 0
        if not self.faults:
            rule[_FAULTS] = min(rule[_FAULTS], 0)
            return value
        self._changing()
        if own:
            return value
        rule[_FAULTS] += 1
        if rule[_FAULTS] >= _MAX_FAULTS_IN_ROW:
            self._activate(rule, False)
            self.since = None
            self.reports.append(("rule %s deactivated" % rule[_KEY], (), rule[_KEY]))
        return value

    def begin(self, tick, now):
        """Begin a tick: what its time and its chance are."""
        self.tick, self.now, self._draws = tick, now, 0
        self.values[_TICK], self.values[_TIME] = float(tick), now
        for key in [key for key, until in self._leases.items() if until <= now]:
            rule = self.learned[key]
            if self._runs(rule):
                self._activate(rule, False)
                self.report("lease of %s ended" % key, ())
            self._leases.pop(key, None)

    def round(self):
        """Evaluate the active rules, as far as the budget of a tick goes; the rest comes first in the next one. Gives
        whether a rule has moved the body."""
        if self.values[_SLEEPING] or self.values[_FROZEN]:
            return False
        used, moved, running = 0, False, [rule for rule in self._order if self._runs(rule)]
        if self._left in running:
            at = running.index(self._left)
            running = running[at:] + running[:at]
        self._left = None
        for rule in running:
            if used > _TICK_STEPS:
                self._left = rule
                break
            if self._runs(rule) and self.learned.get(rule[_KEY]) is rule:
                self.rule(rule)
                used += self.steps
                moved = moved or self.moved
        return moved

    def install(self, key, text):
        """Give the robot a rule of its own that no message can change. Raises Refused."""
        self.evaluate("(RULE %s %s)" % (key, text))
        if self.faults:
            raise Refused(self.faults[0])
        self.learned[key.lower()][_FAULTS] = -1

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
        found = self.learned[key]
        return self.values[found] if isinstance(found, int) else self.fault("%s is already a name" % key)

    def expression(self, key):
        """The program of a rule or buffer; the value of a variable that was made later; None for neither."""
        found = self.learned.get(key)
        if isinstance(found, list):
            return found[_PROGRAM]
        return self.values[found] if isinstance(found, int) else None

    def operator(self, key, count, unknown=""):
        """The program of an operator with so many parameters, None and a fault if there is none."""
        found = self.learned.get(key)
        if isinstance(found, tuple) and parameters_of(found) == count:
            return found
        return self.fault(
            "this robot has no function %s" % unknown if unknown else "no operator %s of %d arguments" % (key, count)
        )

    def write(self, slot, value):
        """SETQ of an actuator or a flag."""
        if value is None:
            self.dropped += 1
            actuator = slot >= self.first_actuator
            return self.fault("unknown never reaches an actuator" if actuator else "unknown cannot be a flag")
        if slot >= self.first_actuator and not self.asked:
            self.moved = True
            if slot not in self.dirty:
                self.dirty.append(slot)
        self.values[slot] = value
        return value

    def assign(self, key, value):
        """SETQ of a user variable."""
        found = self.learned.get(key)
        if not isinstance(found, int):
            return self.fault("no variable %s: make it first with (DEFVAR %s)" % (key, key))
        self.values[found] = value
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

    def act(self, which, code, pc, stack):
        """Acts on groups, rules and variables. which: of the instructions from "flag" on; gives where to go on."""
        if self.asked and which not in (1, 4):
            if which in (5, 9, 11):
                stack.pop()
            stack.append(1.0)
            return pc + (which < 10)
        if which == 10:
            self._roll_back()
            stack.append(1.0)
            return pc
        if which == 11:
            stack[-1] = self._ping(stack[-1])
            return pc
        key = code[pc]
        if which == 1:
            value = 1.0 if self._members.get(key) else 0.0
        elif which <= 3:
            value = self._join(key, which == 2)
        elif which == 4:
            value = self._define(key, stack.pop())
        elif which == 5:
            value = self._store_number(key, stack.pop())
        elif which <= 7:
            value = self._switch(key, which == 6)
        elif which == 8:
            value = self._forget(key)
        else:
            value = self._lease(key, stack.pop())
        stack.append(value)
        return pc + 1

    def _ping(self, caste):
        if caste is None:
            return self.fault("an unknown caste cannot be sent")
        if len(self.pings) < _MAX_OUTBOX:
            self.pings.append(caste)
        return 1.0

    # ---- learning

    def _clash(self, key, sort):
        """Whether a name means something of another sort; that is a fault."""
        found = self.learned.get(key)
        if found is None or (found is sort if sort is GROUP else isinstance(found, sort)):
            return False
        self.fault("%s is already the name of something else" % key)
        return True

    def _full(self, sort, most, what):
        """Whether there is no room for one more of a sort; that is a fault."""
        count = 0
        for name, each in self.learned.items():
            if (each is GROUP) if sort is GROUP else (isinstance(each, sort) and buffer_number(name) is None):
                count += 1
        if count < most:
            return False
        self.fault("no room for another %s: there are %d" % (what, most))
        return True

    def _define(self, key, value):
        if self.asked:
            return value
        if self._clash(key, int):
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
        if self._clash(key, list):
            return None
        rule = self.learned.get(key)
        if rule is None:
            if buffer_number(key) is None and self._full(list, _MAX_RULES, "rule"):
                return None
            self._changing()
            rule = self.learned[key] = [key, program, False, 0]
            self._place(rule)
        elif rule[_FAULTS] < 0:
            return self._built_in(key)
        else:
            self._changing()
            rule[_PROGRAM], rule[_FAULTS] = program, 0
        if activate:
            self._activate(rule, True)
        return 1.0 if activate else 0.0

    def _store_number(self, key, value):
        """SETQ of a buffer."""
        if value is None:
            return self.fault("an unknown cannot be stored")
        program = Checker(self).program([(value, "", True)])
        return None if self.store(key, program, False) is None else value

    def _place(self, rule):
        """Put a new rule where it runs: buffers by their number, then the others as they come."""
        number, at = buffer_number(rule[_KEY]), len(self._order)
        if number is not None:
            while at:
                other = buffer_number(self._order[at - 1][_KEY])
                if other is not None and other < number:
                    break
                at -= 1
        self._order.insert(at, rule)

    def operate(self, key, program):
        """DEFUN."""
        if self.asked:
            return 1.0
        if self._clash(key, tuple):
            return None
        if key not in self.learned and self._full(tuple, _MAX_OPERATORS, "operator"):
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
        if self._clash(key, GROUP) or (key not in self.learned and self._full(GROUP, _MAX_GROUPS, "group")):
            return None
        self.learned[key] = GROUP
        self._members[key] = True
        return 1.0

    def _built_in(self, key):
        return self.fault("%s is built into the robot: it cannot be changed" % key)

    def _changeable(self, key):
        found = self.learned.get(key)
        if not isinstance(found, list):
            return self.fault("no rule %s" % key)
        return self._built_in(key) if found[_FAULTS] < 0 else found

    def _runs(self, rule):
        number = buffer_number(rule[_KEY])
        return rule[_RUNS] if number is None else bool(self.values[_ACTIVE + number])

    def _activate(self, rule, on):
        number = buffer_number(rule[_KEY])
        rule[_RUNS] = on
        if number is not None:
            self.values[_ACTIVE + number] = 1.0 if on else 0.0
        if not on:
            self._leases.pop(rule[_KEY], None)

    def _switch(self, key, on):
        number = buffer_number(key)
        if number is not None and key not in self.learned:
            self.values[_ACTIVE + number] = 1.0 if on else 0.0
            return 1.0
        rule = self._changeable(key)
        if rule is None:
            return None
        self._changing()
        self._activate(rule, on)
        return 1.0

    def _forget(self, key):
        if isinstance(self.learned.get(key), tuple):
            del self.learned[key]
            return 1.0
        rule = self._changeable(key)
        if rule is None:
            return None
        self._changing()
        self._remove(rule)
        return 1.0

    def _remove(self, rule):
        self._activate(rule, False)
        del self.learned[rule[_KEY]]
        self._order.remove(rule)

    def _lease(self, key, seconds):
        if seconds is None:
            return self.fault("a lease of unknown length")
        rule = self._changeable(key)
        if rule is None:
            return None
        self._changing()
        self._leases[key] = self.now + seconds
        return 1.0

    # ---- rolling back

    def _changing(self):
        """The rules change, or one has met a fault: a proven set becomes the one to roll back to."""
        if self.since is not None and self.tick - self.since >= _PROVEN_TICKS:
            self._proven = self._rule_set()
        self.since = self.tick

    def _rule_set(self):
        return [
            (rule[_KEY], rule[_PROGRAM], self._runs(rule), self._leases.get(rule[_KEY]))
            for rule in self._order
            if rule[_FAULTS] >= 0
        ]

    def _roll_back(self):
        if self.since is not None and self.tick - self.since >= _PROVEN_TICKS:
            return
        for rule in [rule for rule in self._order if rule[_FAULTS] >= 0]:
            self._remove(rule)
        for key, program, active, until in self._proven:
            rule = self.learned[key] = [key, program, False, 0]
            self._place(rule)
            self._activate(rule, active)
            if until is not None:
                self._leases[key] = until


_REMEMBERING = const(("once", "held", "hysteresis", "every", "after", "within", "age", "share"))


def _remembers(form):
    """Whether a text has a form that remembers from tick to tick."""
    return isinstance(form, list) and (head_of(form) in _REMEMBERING or any([_remembers(item) for item in form]))
