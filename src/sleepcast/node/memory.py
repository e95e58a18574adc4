"""The memory of one robot: its address spaces of numbers, expressions and functions, as the language's machine sees it.

While a message is evaluated, everything that the memory answers is written down, so that the evaluation can be
explained later by walking it again. A refusal is a fault: noted, unknown as a value, and nothing is changed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import inf, nan
from weakref import WeakKeyDictionary

from sleepcast.errors import SleepcastError
from sleepcast.language.chance import draw, stream
from sleepcast.language.explain import FLAGS, Answer, Rehearsal
from sleepcast.language.form import UNQUOTE, Form, List, Number, Symbol, format_literal, show
from sleepcast.language.machine import Library, Program
from sleepcast.language.names import SORTS, Declared, Group, Operator, Stored, UserVariable, reaches, uses_in
from sleepcast.language.parts import Defining, Label, Part, Storing, Template, host_of
from sleepcast.language.reader import read, read_all
from sleepcast.language.vocabulary import (
    ACTIVE0,
    BUFFERS,
    ID,
    MAX_GROUPS,
    MAX_OPERATORS,
    MAX_RULES,
    TICK,
    TIME_SLOT,
    Kind,
    Variable,
    Vocabulary,
    buffer_number,
)
from sleepcast.node.buffers import ExpressionBuffer, RuleBase, RuleSet
from sleepcast.node.variables import VariableTable

MAX_FAULTS = 100
"""Faults kept of one evaluation: more would only repeat what the first ones say."""
PROVEN_TICKS = 100
"""Ticks that a rule set must have run without a fault for ROLLBACK to come back to it."""


@dataclass(frozen=True, slots=True)
class Fault:
    """Something that went wrong in an evaluation. where: the text of the part."""

    reason: str
    where: str
    tick: int

    def __str__(self) -> str:
        return f"{self.reason} in {self.where}"


@dataclass(slots=True)
class Voice:
    """How a robot speaks: where REPORT, TELL and PING go."""

    report: Callable[[str, tuple[float, ...]], None]
    tell: Callable[[str], None]
    ping: Callable[[float], None]


class RobotMemory:
    """See the module. values: the numbers by slot, NaN unknown. It is a `Memory`, and the `Names` of its robot."""

    def __init__(self, variables: VariableTable, voice: Voice, *, number: int, seed: int, body: object) -> None:
        self.variables, self.vocabulary = variables, variables.vocabulary
        self.library = library_of(self.vocabulary)
        self.voice, self.body = voice, body
        self.values = [0.0] * (ACTIVE0 + BUFFERS) + [nan] * (self.vocabulary.size - ACTIVE0 - BUFFERS)
        self.values[ID], self.values[TIME_SLOT], self.values[TICK] = float(number), 0.0, 0.0
        self.groups: frozenset[str] = frozenset()
        self.learned: dict[str, Declared] = {}
        self.rules = RuleBase(self.values)
        self.operators: dict[str, Program] = {}
        self.steps = self.depth = 0
        self.matched = False
        self.faults: list[Fault] = []
        self.answers: list[Answer] | None = None
        self.tick, self.time = 0, 0.0
        self.actuated: set[int] = set()
        """Slots of actuators assigned since somebody last cleared it."""
        self.dropped = 0
        """Assignments and calls that an unknown kept from the body."""
        self._key, self._draws = stream(seed, number), 0
        self._proven: RuleSet = {}
        self._unproven_since = 0

    def at(self, tick: int, now: float) -> None:
        """Begin a tick: time (s) and chance move on."""
        self.tick, self.time, self._draws = tick, now, 0
        self.values[TICK], self.values[TIME_SLOT] = float(tick), now

    # ---- names

    def declared(self, key: str) -> Declared | None:
        """What the robot has learned under `key`."""
        if buffer_number(key) is not None and (buffer := self.rules.kept.get(key)) is not None:
            return Stored(buffer.name, buffer.program.uses)
        return self.learned.get(key)

    def heard(self) -> Iterable[str]:
        """Every learned name as written."""
        return [found.name for found in self.learned.values()]

    def _learn(self, key: str, found: Declared) -> None:
        before = self.learned.get(key)
        self.learned[key] = found
        if type(before) is not type(found) or isinstance(found, Operator):
            self._resolve_again(key)

    def _resolve_again(self, key: str) -> None:
        """What depends on a name that has changed its meaning is compiled anew; it has been checked when it came in."""
        for buffer in self.rules.kept.values():
            if key in buffer.program.free:
                buffer.program = self._compiled(buffer.text, buffer.program)
        for name, program in self.operators.items():
            found = self.learned[name]
            if key in program.free and isinstance(found, Operator):
                self.operators[name] = self._compiled(program.text, program, found.parameters)

    def _compiled(self, text: str, before: Program, parameters: tuple[str, ...] = ()) -> Program:
        try:
            return self.library.program(text, lambda: read_all(text), self, parameters)
        except SleepcastError:
            return before  # it runs as it was; what it then meets is a fault of its own

    def _taken(self, part: Part, key: str, sort: type) -> bool:
        """Whether `key` means something else already, which is a fault."""
        found = self.learned.get(key)
        if found is None or isinstance(found, sort):
            return False
        what = SORTS[type(found)]
        self.fault(part, f"{found.name} is already {'an' if what[0] in 'aeiou' else 'a'} {what}")
        return True

    # ---- what the machine asks

    def fault(self, part: Part, reason: str) -> float:
        """Note a fault; gives unknown."""
        if len(self.faults) < MAX_FAULTS:
            self.faults.append(Fault(reason, show(part.form), self.tick))
        return nan

    def _answer(self, value: float) -> float:
        if self.answers is not None:
            self.answers.append(value)
        return value

    def draw(self) -> float:
        """The next random number of this tick."""
        number = self._draws
        self._draws = number + 1
        return self._answer(draw(self._key, self.tick, number))

    def read(self, slot: int) -> float:
        """A linked variable; what the host cannot give is unknown."""
        try:
            value = self.variables.read(slot)
        except SleepcastError:
            value = nan
        return self._answer(value)

    def write(self, part: Part, value: float) -> float:
        """SETQ of an actuator, a support variable, or a user variable that may not be there."""
        return self._answer(self._write(part, value))

    def _write(self, part: Part, value: float) -> float:
        variable = part.data
        if not isinstance(variable, Variable):
            if not isinstance(self.learned.get(part.name), UserVariable):
                return self.fault(part, f"no variable {part.name}: make it first with (DEFVAR {part.name})")
            self.values[part.slot] = value
        elif value != value:
            self.dropped += 1
            return self.fault(part, f"unknown never reaches {_article(variable.kind.value)} ({variable.name})")
        elif variable.linked:
            try:
                self.variables.write(part.slot, value)
            except SleepcastError as error:
                return self.fault(part, str(error))
            self.actuated.add(part.slot)
        else:
            self.values[part.slot] = value
            if variable.kind is Kind.ACTUATOR:
                self.actuated.add(part.slot)
            elif ACTIVE0 < part.slot < ACTIVE0 + BUFFERS:
                self._changing()
                self.rules.flags_assigned()
        return value

    def defined(self, part: Part) -> bool:
        """Whether the user variable is there."""
        there = isinstance(self.learned.get(part.name), UserVariable)
        if self.answers is not None:
            self.answers.append(there)
        return there

    def define(self, part: Part, value: float) -> float:
        """DEFVAR of a new name."""
        if self._taken(part, part.name, UserVariable):
            return self._answer(nan)
        self.values[part.slot] = value
        self._learn(part.name, UserVariable(_written(part), part.slot))
        return self._answer(value)

    def fetch(self, part: Part) -> Program | None:
        """The program in a buffer or rule."""
        buffer = self.rules.kept.get(part.name)
        program = None if buffer is None else buffer.program
        if self.answers is not None:
            self.answers.append(program)
        return program

    def operator(self, part: Part) -> Program | None:
        """The program of an operator."""
        program = self.operators.get(part.name)
        if program is None or program.parameters != len(part.parts):
            self.fault(part, f"no operator {part.name} of {len(part.parts)} arguments")
            program = None
        if self.answers is not None:
            self.answers.append(program)
        return program

    def host(self, part: Part, *arguments: float) -> float:
        """Call a function of the robot's own software. Whatever it raises is a fault, never the end of the mind."""
        function = host_of(part)
        if any(argument != argument for argument in arguments):
            if function.acts:
                self.dropped += 1
                return self._answer(self.fault(part, f"unknown never reaches the body ({function.name})"))
            return self._answer(nan)
        label = (part.data.text,) if isinstance(part.data, Label) else ()
        try:
            result = function.call(self.body, *label, *arguments)
            value = 1.0 if result is None else float(result)
        except Exception as error:
            return self._answer(self.fault(part, f"{function.name} failed: {type(error).__name__}: {error}"))
        return self._answer(value if -inf < value < inf else nan)

    # ---- storing

    def store(self, part: Part, value: float) -> float:
        """SETQQ, RULE, and SETQ of a buffer."""
        storing = part.data
        if not isinstance(storing, Storing):
            raise TypeError(f"a part of op {part.op} stores nothing")
        if not storing.value:
            done = self._store(part, storing.key, storing.form, storing.activate)
            return self._answer((1.0 if storing.activate else 0.0) if done else nan)
        if value != value:
            return self._answer(self.fault(part, "unknown cannot be stored as an expression"))
        return self._answer(value if self._store(part, storing.key, Number(value), False) else nan)

    def _store(self, part: Part, key: str, form: Form, activate: bool) -> bool:
        before = self.rules.kept.get(key)
        if before is not None and before.protected:
            self.fault(part, f"{before.name} is built in: it cannot be changed over the air")
            return False
        named = buffer_number(key) is None
        if named and self._taken(part, key, Stored):
            return False
        if named and before is None and self.rules.rules() >= MAX_RULES:
            self.fault(part, f"no room for another rule: there are {MAX_RULES}")
            return False
        text = show(form)
        program = self._program(part, key, text, ())
        if program is None:
            return False
        self._changing()
        name = _written(part) if named else key.upper()
        buffer = self.rules.put(key, name, text, program)
        if named:
            self._learn(key, Stored(name, program.uses))
        if activate:
            self.rules.activate(buffer, True)
        return True

    def _program(self, part: Part, key: str, text: str, parameters: tuple[str, ...]) -> Program | None:
        """The program of a text that is to be kept under `key`; None, and a fault, if it is refused."""
        try:
            program = self.library.program(text, lambda: read_all(text), self, parameters)
        except SleepcastError as error:
            self.fault(part, f"refused: {str(error).splitlines()[0]}")
            return None
        way = reaches(program.uses, key, lambda k: uses_in(self, k))
        if way is not None:
            through = " through " + ", ".join(k.upper() for k in way[:-1]) if len(way) > 1 else ""
            self.fault(part, f"{key.upper()} would name itself{through}")
            return None
        return program

    def _changing(self) -> None:
        """The rule set is about to change: if it has proved itself, remember it."""
        if self.tick - self._unproven_since >= PROVEN_TICKS:
            self._proven = self.rules.rule_set()
        self._unproven_since = self.tick

    def rule_faulted(self) -> None:
        """A rule has met a fault: its rule set starts to prove itself anew."""
        self._changing()

    # ---- acts

    def act(self, part: Part, *arguments: float) -> float:
        """Everything else that an expression may do."""
        if part.name in FLAGS:
            slot, value = FLAGS[part.name]
            self.values[slot] = value
            return self._answer(1.0)
        result: float = _ACTS[part.name](self, part, *arguments)
        return self._answer(result)

    def _join(self, part: Part) -> float:
        name = _label(part)
        key = name.casefold()
        if self._taken(part, key, Group):
            return nan
        if key not in self.learned and sum(isinstance(d, Group) for d in self.learned.values()) >= MAX_GROUPS:
            return self.fault(part, f"no room for another group: there are {MAX_GROUPS}")
        self._learn(key, Group(name))
        self.groups |= {key}
        return 1.0

    def _leave(self, part: Part) -> float:
        self.groups -= {_label(part).casefold()}
        return 1.0

    def _buffer(self, part: Part) -> ExpressionBuffer | None:
        """The buffer or rule that an act names, unless there is none or it is built in, which are faults."""
        buffer = self.rules.kept.get(_label(part))
        if buffer is None:
            self.fault(part, f"no rule {_label(part)}")
        elif buffer.protected:
            self.fault(part, f"{buffer.name} is built in: it cannot be changed over the air")
            return None
        return buffer

    def _activate(self, part: Part) -> float:
        number = buffer_number(_label(part))
        if number is not None and _label(part) not in self.rules.kept:
            self._changing()
            self.values[ACTIVE0 + number] = 1.0 if part.name == "activate" else 0.0
            return 1.0
        buffer = self._buffer(part)
        if buffer is None:
            return nan
        self._changing()
        self.rules.activate(buffer, part.name == "activate")
        return 1.0

    def _forget(self, part: Part) -> float:
        key = _label(part)
        if key in self.operators:
            del self.operators[key]
        elif self._buffer(part) is None:
            return nan
        else:
            self._changing()
            self.rules.remove(key)
        if self.learned.pop(key, None) is not None:
            self._resolve_again(key)
        return 1.0

    def _lease(self, part: Part, seconds: float) -> float:
        if seconds != seconds:
            return self.fault(part, "a lease of unknown length")
        buffer = self._buffer(part)
        if buffer is None:
            return nan
        self._changing()
        buffer.lease = self.time + seconds
        self.rules.changed()
        return 1.0

    def _defun(self, part: Part) -> float:
        defining = part.data
        if not isinstance(defining, Defining):
            raise TypeError(f"a part of op {part.op} defines nothing")
        name = _written(part)
        key = name.casefold()
        if self._taken(part, key, Operator):
            return nan
        if key not in self.operators and len(self.operators) >= MAX_OPERATORS:
            return self.fault(part, f"no room for another operator: there are {MAX_OPERATORS}")
        program = self._program(part, key, " ".join(map(show, defining.body)), defining.parameters)
        if program is None:
            return nan
        self.operators[key] = program
        self._learn(key, Operator(name, defining.parameters, program.uses))
        return 1.0

    def _rollback(self, part: Part) -> float:
        if self.tick - self._unproven_since < PROVEN_TICKS:
            self.rules.restore(self._proven)
            gone = [k for k, d in self.learned.items() if isinstance(d, Stored) and k not in self.rules.kept]
            for key in gone:
                del self.learned[key]
                self._resolve_again(key)
            for buffer in self.rules.kept.values():
                if buffer_number(buffer.key) is None:
                    self._learn(buffer.key, Stored(buffer.name, buffer.program.uses))
        return 1.0

    def _report(self, part: Part, *arguments: float) -> float:
        self.voice.report(_label(part), arguments)
        return arguments[-1] if arguments else 1.0

    def _tell(self, part: Part, *arguments: float) -> float:
        if any(argument != argument for argument in arguments):
            return self.fault(part, "an unknown cannot be told")
        if not isinstance(part.data, Template):
            raise TypeError(f"a part of op {part.op} tells nothing")
        text = show(_filled(part.data.form, iter(arguments).__next__))
        try:
            read(text)
        except SleepcastError as error:
            return self.fault(part, f"refused: {str(error).splitlines()[0]}")
        self.voice.tell(text)
        return 1.0

    def _ping(self, part: Part, caste: float = 0.0) -> float:
        if caste != caste:
            return self.fault(part, "a ping of unknown caste")
        self.voice.ping(caste)
        return 1.0

    def rehearsal(self) -> Rehearsal:
        """A memory for asking what would happen now: it starts where this one is, and nothing in it happens."""
        drawn = iter(range(self._draws, 1 << 62))
        return Rehearsal(
            self.values,
            self.groups,
            fetch=lambda part: b.program if (b := self.rules.kept.get(part.name)) else None,
            operator=lambda part: self.operators.get(part.name),
            read=self.variables.read,
            draw=lambda: draw(self._key, self.tick, next(drawn)),
        )


_ACTS: dict[str, Callable[..., float]] = {
    "join": RobotMemory._join,
    "leave": RobotMemory._leave,
    "activate": RobotMemory._activate,
    "deactivate": RobotMemory._activate,
    "forget": RobotMemory._forget,
    "lease": RobotMemory._lease,
    "defun": RobotMemory._defun,
    "rollback": RobotMemory._rollback,
    "report": RobotMemory._report,
    "tell": RobotMemory._tell,
    "ping": RobotMemory._ping,
}


def _label(part: Part) -> str:
    return part.data.text if isinstance(part.data, Label) else ""


def _written(part: Part) -> str:
    """The name that a declaring part declares, as written."""
    target = part.form.items[1] if isinstance(part.form, List) else part.form
    return target.text if isinstance(target, Symbol) else part.name


def _article(kind: str) -> str:
    return f"{'an' if kind[0] in 'aeiou' else 'a'} {kind}"


def _filled(form: Form, next_value: Callable[[], float]) -> Form:
    """A template with its unquoted places replaced by values, in their order."""
    if not isinstance(form, List):
        return form
    if form.head == UNQUOTE and len(form.items) == 2:
        value = next_value()
        return Number(value, text=format_literal(value))
    return List(tuple(_filled(item, next_value) for item in form.items), form.start, form.end)


_LIBRARIES: WeakKeyDictionary[Vocabulary, Library] = WeakKeyDictionary()


def library_of(vocabulary: Vocabulary) -> Library:
    """The programs shared by every robot of one vocabulary."""
    return _LIBRARIES.setdefault(vocabulary, Library())
