"""The memory of one robot: its address spaces of numbers, expressions and functions, as the language's machine sees it.

While a message is evaluated, everything that the memory answers is written down, so that the evaluation can be
explained later by walking it again. A refusal is a fault: noted, unknown as a value, and nothing is changed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import inf, nan
from weakref import WeakKeyDictionary

from sleepcast.core.errors import SleepcastError
from sleepcast.language.form import Form, Number, show
from sleepcast.language.functions import MAX_HOPS
from sleepcast.language.numerics import draw, stream
from sleepcast.language.parts import Label, Part, Storing, host_of, written
from sleepcast.language.program import Library, Program
from sleepcast.language.reader import read_all
from sleepcast.language.rehearsal import FLAGS, Answer, Refusal, Rehearsal
from sleepcast.language.symbols import Declared, Operator, Stored, UserVariable, circle, clash, declared_in, uses_in
from sleepcast.language.vocabulary import (
    ACTIVE0,
    BUFFERS,
    ID,
    MARKING,
    MAX_RULES,
    TICK,
    TIME_SLOT,
    Kind,
    Variable,
    Vocabulary,
    buffer_number,
)
from sleepcast.mind.limits import FAILED, MAX_FAULTS, PROVEN_TICKS
from sleepcast.mind.merging import Merging
from sleepcast.mind.views import Fault
from sleepcast.node.buffers import RuleBase, RuleSet
from sleepcast.node.linking import VariableTable


@dataclass(slots=True)
class Voice:
    """How a robot speaks: where REPORT, TELL and PING go."""

    report: Callable[[str, tuple[float, ...]], None]
    may_tell: Callable[[int], bool]
    tell: Callable[[str, int], None]
    ping: Callable[[float], None]


class RobotMemory:
    """See the module. values: the numbers by slot, NaN unknown. It is a `Memory`, and the `Names` of its robot."""

    def __init__(
        self, variables: VariableTable, voice: Voice, acts: Mapping[str, Act], *, number: int, seed: int, body: object
    ) -> None:
        self.variables, self.vocabulary = variables, variables.vocabulary
        self.library = library_of(self.vocabulary)
        self.voice, self.body, self._acts = voice, body, acts
        self.values = [0.0] * (ACTIVE0 + BUFFERS) + [nan] * (self.vocabulary.size - ACTIVE0 - BUFFERS)
        self.values[MARKING] = 1.0
        self.values[ID], self.values[TIME_SLOT], self.values[TICK] = float(number), 0.0, 0.0
        self.groups: frozenset[str] = frozenset()
        self.learned: dict[str, Declared] = {}
        self.rules = RuleBase(self.values)
        self.operators: dict[str, Program] = {}
        self.steps = self.depth = self.levels = 0
        self.matched = False
        self.faults: list[Fault] = []
        self.answers: list[Answer] | None = None
        self.tick, self.time = 0, 0.0
        self.actuated: set[int] = set()
        """Slots of actuators assigned since somebody last cleared it."""
        self.moved = False
        """Whether the body was asked to move since somebody last cleared this."""
        self.driven = False
        """Whether the body was last moved by a person's command that counts once."""
        self.hops = MAX_HOPS
        """How far what it tells may go: less while it evaluates what another robot has told."""
        self.held = False
        """Whether functions that act are refused: the robot is stopped and its body has no latch of its own."""
        self.dropped = 0
        """Assignments and calls that an unknown kept from the body."""
        self._key, self._draws = stream(seed, number), 0
        self.merging = Merging()
        self.proven: RuleSet = {}
        self.unproven_since = 0

    def at(self, tick: int, now: float) -> None:
        """Begin a tick: time (s) and chance move on."""
        self.tick, self.time, self._draws = tick, now, 0
        self.values[TICK], self.values[TIME_SLOT] = float(tick), now

    # ---- names

    def declared(self, key: str) -> Declared | None:
        """What the robot has learned under `key`."""
        return declared_in(self.rules.kept, self.learned, key)

    def heard(self) -> Iterable[str]:
        """Every learned name as written."""
        return [found.name for found in self.learned.values()]

    def learn(self, key: str, found: Declared) -> None:
        before = self.learned.get(key)
        self.learned[key] = found
        if type(before) is not type(found) or isinstance(found, Operator):
            self.resolve_again(key)

    def resolve_again(self, key: str) -> None:
        """What depends on a name that has changed its meaning is compiled anew; it has been checked when it came in."""
        for buffer in self.rules.kept.values():
            if key in buffer.program.free:
                buffer.program = self.library.again(buffer.program, self)
        for name, program in self.operators.items():
            found = self.learned[name]
            if key in program.free and isinstance(found, Operator):
                self.operators[name] = self.library.again(program, self, found.parameters)

    def taken(self, part: Part, key: str, sort: type) -> bool:
        """Whether `key` means something else already, which is a fault."""
        reason = clash(self.learned.get(key), sort)
        if reason is None:
            return False
        self.refuse(part, reason)
        return True

    # ---- what the machine asks

    def fault(self, part: Part, reason: str) -> float:
        """Note a fault; gives unknown."""
        if len(self.faults) < MAX_FAULTS:
            self.faults.append(Fault(reason, show(part.form), self.tick))
        return nan

    def refuse(self, part: Part, reason: str) -> float:
        """A fault that this memory itself has to note; written down, because walking again would not come upon it."""
        if self.answers is not None:
            self.answers.append(Refusal(part, reason))
        return self.fault(part, reason)

    def _answer(self, value: float) -> float:
        if self.answers is not None:
            self.answers.append(value)
        return value

    def draw(self) -> float:
        """The next random number of this tick."""
        number = self._draws
        self._draws = number + 1
        return self._answer(draw(self._key, self.tick, number))

    def read(self, part: Part) -> float:
        """A linked variable; what the host cannot give is a fault."""
        try:
            return self._answer(self.variables.read(part.slot))
        except SleepcastError as error:
            return self._answer(self.refuse(part, str(error)))

    def peek(self, slot: int) -> float:
        """A value by its slot, wherever it lies; what the host cannot give is unknown."""
        if slot not in self.variables.linked_slots:
            return self.values[slot]
        try:
            return self.variables.read(slot)
        except SleepcastError:
            return nan

    def write(self, part: Part, value: float) -> float:
        """SETQ of an actuator, a support variable, or a user variable that may not be there."""
        return self._answer(self._write(part, value))

    def _write(self, part: Part, value: float) -> float:
        variable = part.data
        if not isinstance(variable, Variable):
            found = self.learned.get(part.name)
            if not isinstance(found, UserVariable):
                return self.refuse(part, f"no variable {part.name}: make it first with (DEFVAR {part.name})")
            self.values[found.slot] = value
        elif value != value:
            self.dropped += 1
            never = "never reaches an actuator" if variable.kind is Kind.ACTUATOR else "cannot be assigned to a flag"
            return self.refuse(part, f"unknown {never} ({variable.name})")
        elif variable.linked:
            try:
                self.variables.write(part.slot, value)
            except SleepcastError as error:
                return self.refuse(part, str(error))
            self.actuated.add(part.slot)
            self.moved |= variable.kind is Kind.ACTUATOR
        elif self._is_built_in(part.slot):
            return self.refuse(part, f"E{part.slot - ACTIVE0} is built in: it cannot be changed over the air")
        else:
            self.values[part.slot] = value
            if variable.kind is Kind.ACTUATOR:
                self.actuated.add(part.slot)
                self.moved = True
            elif ACTIVE0 < part.slot < ACTIVE0 + BUFFERS:
                if self.merging.flag(f"e{part.slot - ACTIVE0}", value > 0.0) is not (value > 0.0):
                    self.values[part.slot] = float(value <= 0.0)
                self.changing()
                self.rules.flags_assigned()
        return value

    def _is_built_in(self, slot: int) -> bool:
        """Whether `slot` is the active flag of a protected buffer."""
        buffer = self.rules.kept.get(f"e{slot - ACTIVE0}")
        return buffer is not None and buffer.protected

    def defined(self, part: Part) -> bool:
        """Whether the user variable is there."""
        there = isinstance(self.learned.get(part.name), UserVariable)
        if self.answers is not None:
            self.answers.append(there)
        return there

    def define(self, part: Part, value: float) -> float:
        """DEFVAR of a new name."""
        if self.taken(part, part.name, UserVariable):
            return self._answer(nan)
        self.values[part.slot] = value
        self.learn(part.name, UserVariable(written(part), part.slot))
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
            self.refuse(part, f"no operator {part.name} of {len(part.parts)} arguments")
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
                return self._answer(self.refuse(part, f"unknown never reaches the body ({function.name})"))
            return self._answer(nan)
        if function.acts and self.held:
            return self._answer(self.refuse(part, f"the robot is stopped: {function.name} waits for RELEASE"))
        self.moved |= function.acts and function.moves
        label = (part.data.text,) if isinstance(part.data, Label) else ()
        try:
            result = function.call(self.body, *label, *arguments)
            value = 1.0 if result is None else float(result)
        except Exception as error:
            return self._answer(self.refuse(part, f"{function.name} failed: {type(error).__name__}: {error}"))
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
            return self._answer(self.refuse(part, "unknown cannot be stored as an expression"))
        return self._answer(value if self._store(part, storing.key, Number(value), False) else nan)

    def _store(self, part: Part, key: str, form: Form, activate: bool) -> bool:
        before = self.rules.kept.get(key)
        if before is not None and before.protected:
            self.refuse(part, f"{before.name} is built in: it cannot be changed over the air")
            return False
        named = buffer_number(key) is None
        if named and self.taken(part, key, Stored):
            return False
        if named and before is None and self.rules.rules() >= MAX_RULES:
            self.refuse(part, f"no room for another rule: there are {MAX_RULES}")
            return False
        text = show(form)
        program = self.program_for(part, key, text, ())
        if program is None:
            return False
        self.merging.make(key)
        if not self.may_write(part, key, key):
            return False
        self.changing()
        name = written(part) if named else key.upper()
        buffer = self.rules.put(key, name, text, program)
        if named:
            self.learn(key, Stored(name, program.uses))
        flag = self.merging.flag(key, True if activate else None)
        if flag is not None:
            self.rules.activate(buffer, flag)
        self.rules.arrange(self.merging.first)
        return True

    def may_write(self, part: Part, register: str, name: str) -> bool:
        """Whether the command under way may change this; a fault if a later one has changed it already."""
        if self.merging.write(register):
            return True
        self.rules.arrange(self.merging.first)  # by what it would have made, or forgotten, had it come in time
        self.refuse(part, f"{name} was changed by a command that was sent later")
        return False

    def program_for(self, part: Part, key: str, text: str, parameters: tuple[str, ...]) -> Program | None:
        """The program of a text that is to be kept under `key`; None, and a fault, if it is refused."""
        try:
            program = self.library.program(text, lambda: read_all(text), self, parameters)
        except SleepcastError as error:
            self.refuse(part, f"refused: {str(error).splitlines()[0]}")
            return None
        through = circle(key, program.uses, lambda k: uses_in(self, k))
        if through is not None:
            self.refuse(part, f"{key.upper()} would name itself{through}")
            return None
        return program

    def changing(self) -> None:
        """The rule set is about to change: if it has proved itself, remember it."""
        if self.tick - self.unproven_since >= PROVEN_TICKS:
            self.proven = self.rules.rule_set()
        self.unproven_since = self.tick

    def rule_faulted(self) -> None:
        """A rule has met a fault: its rule set starts to prove itself anew."""
        self.changing()

    def rule_failed(self) -> None:
        """A rule has been deactivated for its faults: the rule set does not prove itself by standing still."""
        self.unproven_since = FAILED

    # ---- acts

    def act(self, part: Part, *arguments: float) -> float:
        """Everything else that an expression may do."""
        if part.name in FLAGS:
            slot, value = FLAGS[part.name]
            self.values[slot] = value
            return self._answer(1.0)
        result = self._answer(self._acts[part.name](self, part, *arguments))
        if part.name == "rollback" and self.answers is not None:
            self.answers.extend(self.values[ACTIVE0 + 1 : ACTIVE0 + BUFFERS])
        return result

    def rehearsal(self) -> Rehearsal:
        """A memory for asking what would happen now: it starts where this one is, and nothing in it happens."""
        drawn = iter(range(self._draws, 1 << 62))
        return Rehearsal(
            self.values,
            self.groups,
            fetch=lambda part: b.program if (b := self.rules.kept.get(part.name)) else None,
            operator=lambda part: self.operators.get(part.name),
            read=lambda part: self.peek(part.slot),
            draw=lambda: draw(self._key, self.tick, next(drawn)),
            has=lambda key: isinstance(self.learned.get(key), UserVariable),
        )


Act = Callable[..., float]
"""How one act is carried out: (memory, part, *arguments) to its value."""

_LIBRARIES: WeakKeyDictionary[Vocabulary, Library] = WeakKeyDictionary()


def library_of(vocabulary: Vocabulary) -> Library:
    """The programs shared by every robot of one vocabulary."""
    return _LIBRARIES.setdefault(vocabulary, Library())
