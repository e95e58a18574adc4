"""A robot's mind: its variables, rules, operators and groups, and what a tick does with them.

Variables lie in one list: the flags that every robot has, then sensors, actuators, and the variables that DEFVAR makes.
What the robot has learned lies in one table by name: a slot for a variable, a list for a rule or buffer, a program for
an operator, GROUP for a group. (Lists and tuples take less memory than objects.)
"""

import gc
import math

from sleepnode import chance
from sleepnode.checker import GROUP, Checker, buffer_number, through
from sleepnode.deciding import deciding
from sleepnode.forms import SPECIAL
from sleepnode.instructions import USES, parameters_of
from sleepnode.machine import run
from sleepnode.reader import MAX_TEXT, Refused, head_of, read, unload

MARKED, MARKING, FROZEN, SLEEPING = range(4)
ACTIVE = 3
ID, TIME, TICK = 67, 68, 69
_SUPPORT = 70
MAX_RULES = MAX_OPERATORS = MAX_GROUPS = 64
MAX_VARIABLES = 256
MAX_FAULTS = 100
MAX_FAULTS_IN_ROW = 10
TICK_STEPS = 50000
PROVEN_TICKS = 100
MAX_OUTBOX = 64
COMPILING = 4096
"""Bytes of memory after which garbage is collected while a text is checked, so that what stays lies close together."""
MAX_HOPS = 8
TELL_BURST = 8
TELLS_A_SECOND = 2.0
TELLS_TOO_OFTEN = "tells too often: more than 2 a second are dropped"
_CONSTANTS = {"true": 1.0, "false": 0.0, "nil": 0.0, "pi": math.pi, "unknown": None}


KEY, PROGRAM, RUNS, FAULTS = range(4)
"""Places in a rule: its key, its program, whether it runs (a buffer's flag says that), its evaluations in a row with a
fault (-1: it is built in, and no message can change it)."""


class Mind:
    """See the module. number: its `id`. seed: of its chance. After `evaluate` and `rule`: matched, undecided (whether
    its test was unknown), faults and moved (whether the body was asked to move).

    reports, told, pings: what it says, until somebody takes it. dirty: slots of actuators that were assigned. held:
    whether functions that act are refused.
    """

    def __init__(self, sensors=(), actuators=(), constants=None, functions=(), number=0, seed=0):
        self.values = [0.0] * (ID) + [float(number), 0.0, 0.0] + [None] * (len(sensors) + len(actuators))
        self.values[MARKING] = 1.0
        self.first_actuator = _SUPPORT + len(sensors)
        self.first_user = self.first_actuator + len(actuators)
        self._names = {"marked": 0, "marking": 1, "frozen": 2, "sleeping": 3, "id": ID, "time": TIME, "tick": TICK}
        for at, name in enumerate(tuple(sensors) + tuple(actuators)):
            self._names[name.lower()] = _SUPPORT + at
        for table in (_CONSTANTS, constants or {}):
            for name, value in table.items():
                self._names[name.lower()] = (value,)
        for function in functions:
            self._names[function.name.lower()] = function
        self.special = SPECIAL
        self.learned = {}
        self._slots = {}
        """Of user variables that texts name and nobody has made yet."""
        self._members = {}
        self._leases = {}
        """When rules are deactivated, by key."""
        self._order = []
        """Rules and buffers in the order in which they run."""
        self.reports, self.told, self.pings, self.dirty = [], [], [], []
        self.faults = []
        self.matched, self.undecided, self.moved, self.held = False, False, False, False
        self.steps = self.dropped = self.lost = 0
        self.hops = MAX_HOPS
        self.tick, self.now, self._draws = 0, 0.0, 0
        self._key = chance.stream(seed, number)
        self._paid, self._refused = 0.0, False
        self._proven, self._since = (), 0
        self._left = None

    # ---- names

    def binding(self, key):
        """What the robot was made with: a slot, a constant in a tuple, a Function; or None."""
        found = self._names.get(key)
        if found is None and key.startswith("active") and key[6:].isdigit() and key[6] != "0":
            number = int(key[6:])
            if number < 64:
                return ACTIVE + number
        return found

    def kind(self, slot):
        """sensor, actuator or support."""
        if slot < _SUPPORT:
            return "sensor" if slot >= ID else "support"
        return "sensor" if slot < self.first_actuator else "actuator"

    def assignable(self, slot):
        return self.kind(slot) != "sensor"

    def slot(self, key):
        """The slot of a user variable, a new one if nobody has named it."""
        found = self.learned.get(key)
        if isinstance(found, int):
            return found
        if key not in self._slots:
            if len(self.values) - self.first_user >= MAX_VARIABLES:
                raise Refused("variables", key, MAX_VARIABLES)
            self.values.append(None)
            self._slots[key] = len(self.values) - 1
        return self._slots[key]

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
                found = found[PROGRAM] if isinstance(found, list) else found
                more = found[USES] if isinstance(found, tuple) else ()
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
        gc.threshold(COMPILING)
        try:
            form = read(text)
            if _remembers(form):
                form = self._written_out(form)
            checker = Checker(self)
            checker.declare(form)
            checker.deciding = deciding(checker, form)
            return checker.program([form])
        except RuntimeError:  # the interpreter's own stack is full
            raise Refused("deep")
        except MemoryError:
            raise Refused("memory")
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

    def rule(self, rule):
        """Evaluate a rule."""
        value = self.run(rule[PROGRAM])
        own = rule[FAULTS] < 0
        if not self.faults:
            rule[FAULTS] = min(rule[FAULTS], 0)
            return value
        self._changing()
        if own:
            return value
        rule[FAULTS] += 1
        if rule[FAULTS] >= MAX_FAULTS_IN_ROW:
            self._activate(rule, False)
            self._since = None
            self.reports.append(("rule %s deactivated" % rule[KEY], (), rule[KEY]))
        return value

    def begin(self, tick, now):
        """Begin a tick: what its time and its chance are."""
        self.tick, self.now, self._draws = tick, now, 0
        self.values[TICK], self.values[TIME] = float(tick), now
        for key in [key for key, until in self._leases.items() if until <= now]:
            rule = self.learned[key]
            if self._runs(rule):
                self._activate(rule, False)
                self.report("lease of %s ended" % key, ())
            self._leases.pop(key, None)

    def round(self):
        """Evaluate the active rules, as far as the budget of a tick goes; the rest comes first in the next one. Gives
        whether a rule has moved the body."""
        if self.values[SLEEPING] or self.values[FROZEN]:
            return False
        used, moved, running = 0, False, [rule for rule in self._order if self._runs(rule)]
        if self._left in running:
            at = running.index(self._left)
            running = running[at:] + running[:at]
        self._left = None
        for rule in running:
            if used > TICK_STEPS:
                self._left = rule
                break
            if self._runs(rule) and self.learned.get(rule[KEY]) is rule:
                self.rule(rule)
                used += self.steps
                moved = moved or self.moved
        return moved

    def install(self, key, text):
        """Give the robot a rule of its own that no message can change. Raises Refused."""
        self.evaluate("(RULE %s %s)" % (key, text))
        if self.faults:
            raise Refused(self.faults[0])
        self.learned[key.lower()][FAULTS] = -1

    # ---- called by the machine

    def fault(self, reason):
        """Note what went wrong; gives unknown."""
        if len(self.faults) < MAX_FAULTS:
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
        return chance.draw(self._key, self.tick, self._draws - 1)

    def value_of(self, key):
        found = self.learned[key]
        return self.values[found] if isinstance(found, int) else self.fault("%s is already a name" % key)

    def expression(self, key):
        """The program of a rule or buffer; the value of a variable that was made later; None for neither."""
        found = self.learned.get(key)
        if isinstance(found, list):
            return found[PROGRAM]
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
        if slot >= self.first_actuator:
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
        if len(self.reports) < MAX_OUTBOX:
            self.reports.append((label, values, ""))
        else:
            self.lost += 1

    def tell(self, text, hops):
        """Tell other robots, within the bounds of TELL."""
        hops = min(hops, self.hops)
        begin = max(self._paid, self.now)
        often = begin - self.now > (TELL_BURST - 1) / TELLS_A_SECOND
        if often or hops < 1:
            self.lost += 1
            if not self._refused:
                self._refused = True
                self.report(TELLS_TOO_OFTEN if often else "did not tell on what came by its last hop", ())
            return
        if len(text) > MAX_TEXT:
            self.fault("a text of %d characters cannot be sent by TELL: at most %d fit" % (len(text), MAX_TEXT))
            return
        self._refused = self._refused and begin > self.now
        self._paid = begin + 1.0 / TELLS_A_SECOND
        self.told.append((text, hops))

    def act(self, which, code, pc, stack):
        """Acts on groups, rules and variables. which: of the instructions from "flag" on; gives where to go on."""
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
        if len(self.pings) < MAX_OUTBOX:
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
        count = sum([each is GROUP if sort is GROUP else isinstance(each, sort) for each in self.learned.values()])
        if count < most:
            return False
        self.fault("no room for another %s: there are %d" % (what, most))
        return True

    def _define(self, key, value):
        if self._clash(key, int):
            return None
        slot = self.slot(key)
        self._slots.pop(key, None)
        self.learned[key] = slot
        self.values[slot] = value
        return value

    def store(self, key, program, activate):
        """SETQQ, RULE, and SETQ of a buffer."""
        way = self.reaches(program[USES], key)
        if way:
            return self.fault("%s would name itself%s" % (key.upper(), through(way)))
        if self._clash(key, list):
            return None
        rule = self.learned.get(key)
        if rule is None:
            if buffer_number(key) is None and self._full(list, MAX_RULES + 63, "rule"):
                return None
            self._changing()
            rule = self.learned[key] = [key, program, False, 0]
            self._place(rule)
        elif rule[FAULTS] < 0:
            return self._built_in(key)
        else:
            self._changing()
            rule[PROGRAM], rule[FAULTS] = program, 0
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
        number, at = buffer_number(rule[KEY]), len(self._order)
        if number is not None:
            while at:
                other = buffer_number(self._order[at - 1][KEY])
                if other is not None and other < number:
                    break
                at -= 1
        self._order.insert(at, rule)

    def operate(self, key, program):
        """DEFUN."""
        if self._clash(key, tuple):
            return None
        if key not in self.learned and self._full(tuple, MAX_OPERATORS, "operator"):
            return None
        way = self.reaches(program[USES], key)
        if way:
            return self.fault("%s would name itself%s" % (key.upper(), through(way)))
        self.learned[key] = program
        return 1.0

    def _join(self, key, member):
        if not member:
            if key in self._members:
                self._members[key] = False
            return 1.0
        if self._clash(key, GROUP) or (key not in self.learned and self._full(GROUP, MAX_GROUPS, "group")):
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
        return self._built_in(key) if found[FAULTS] < 0 else found

    def _runs(self, rule):
        number = buffer_number(rule[KEY])
        return rule[RUNS] if number is None else bool(self.values[ACTIVE + number])

    def _activate(self, rule, on):
        number = buffer_number(rule[KEY])
        rule[RUNS] = on
        if number is not None:
            self.values[ACTIVE + number] = 1.0 if on else 0.0
        if not on:
            self._leases.pop(rule[KEY], None)

    def _switch(self, key, on):
        number = buffer_number(key)
        if number is not None and key not in self.learned:
            self.values[ACTIVE + number] = 1.0 if on else 0.0
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
        del self.learned[rule[KEY]]
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
        if self._since is not None and self.tick - self._since >= PROVEN_TICKS:
            self._proven = self._rule_set()
        self._since = self.tick

    def _rule_set(self):
        return [
            (rule[KEY], rule[PROGRAM], self._runs(rule), self._leases.get(rule[KEY]))
            for rule in self._order
            if rule[FAULTS] >= 0
        ]

    def _roll_back(self):
        if self._since is not None and self.tick - self._since >= PROVEN_TICKS:
            return
        for rule in [rule for rule in self._order if rule[FAULTS] >= 0]:
            self._remove(rule)
        for key, program, active, until in self._proven:
            rule = self.learned[key] = [key, program, False, 0]
            self._place(rule)
            self._activate(rule, active)
            if until is not None:
                self._leases[key] = until


_REMEMBERING = ("once", "held", "hysteresis", "every", "after", "within", "age", "share")


def _remembers(form):
    """Whether a text has a form that remembers from tick to tick."""
    return isinstance(form, list) and (head_of(form) in _REMEMBERING or any([_remembers(item) for item in form]))
