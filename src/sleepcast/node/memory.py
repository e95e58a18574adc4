"""The memory of one robot: its variables, expressions and functions, as the language's machine uses them.

While a message is evaluated, everything that the memory answers is recorded, so that the evaluation can be explained
later by repeating it. A refused act is recorded as a fault, gives unknown, and changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf, nan
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from sleepcast.core.errors import SleepcastError
from sleepcast.core.neighbours import crowded, listed
from sleepcast.core.records import dataclass
from sleepcast.language.acts import FLAGS
from sleepcast.language.functions import MAX_HOPS
from sleepcast.language.numerics import draw, stream
from sleepcast.language.parts import (
    Auction,
    Defining,
    Label,
    Part,
    Storing,
    Template,
    host_of,
    label_of,
    sensor_of,
    written,
)
from sleepcast.language.program import Library, Program
from sleepcast.language.reader import MAX_TEXT, Form, Number, show
from sleepcast.language.rehearsal import Answer, NotedFault, Rehearsal
from sleepcast.language.symbols import UserVariable
from sleepcast.language.vocabulary import (
    ACTIVE0,
    BUFFERS,
    ID,
    MARKING,
    TICK,
    TIME_SLOT,
    Variable,
    VariableKind,
    Vocabulary,
    buffer_number,
)
from sleepcast.mind import rules
from sleepcast.mind.inspection import Self
from sleepcast.mind.limits import MAX_FAULTS, PROVEN_TICKS, TOO_MANY_CALLS
from sleepcast.mind.merging import Merging
from sleepcast.mind.rules import (
    UNKNOWN_CASTE,
    UNKNOWN_LEASE,
    UNKNOWN_STORED,
    UNKNOWN_TOLD,
    RuleBase,
    built_in,
    failed,
    no_operator,
    no_variable,
    stopped,
    too_long,
    unknown_asked,
    unknown_assigned,
)
from sleepcast.mind.views import Fault
from sleepcast.node.linking import VariableTable
from sleepcast.node.scheduler import RuleRecords, RuleSet

if TYPE_CHECKING:
    from sleepcast.mind.calling import Calls


@dataclass(slots=True)
class OutputPort:
    """How a robot speaks: where REPORT, TELL and PING go. cancel: discards what waits of the sender that it obeys, for
    CANCEL."""

    report: Callable[[str, tuple[float, ...]], None]
    may_tell: Callable[[int], bool]
    tell: Callable[[str, int, int | None], None]
    ping: Callable[[float], None]
    calls: Callable[[], Calls | None]
    """Of auctions that it tells; None while it is stopped."""
    cancel: Callable[[], float]


class RobotMemory:
    """See the module. values: the variables by slot, NaN if unknown. Implements `Memory`."""

    def __init__(self, variables: VariableTable, output: OutputPort, *, number: int, seed: int, body: object) -> None:
        self.variables, self.vocabulary = variables, variables.vocabulary
        self.library = _LIBRARIES.setdefault(self.vocabulary, Library())
        self.output, self.body = output, body
        self.values = [0.0] * (ACTIVE0 + BUFFERS) + [nan] * (self.vocabulary.size - ACTIVE0 - BUFFERS)
        self.values[MARKING] = 1.0
        self.values[ID], self.values[TIME_SLOT], self.values[TICK] = float(number), 0.0, 0.0
        self.groups: frozenset[str] = frozenset()
        symbols, operators = rules.learned_at_first(self.vocabulary, self.library)
        self.base = RuleBase(
            self.vocabulary, self.library, Merging(), self.changing, symbols=symbols, operators=operators
        )
        """What it has learned."""
        self.records = RuleRecords(self.base, self.values)
        self.steps = self.depth = self.levels = 0
        self.matched = self.undecided = False
        self.faults: list[Fault] = []
        self.answers: list[Answer] | None = None
        self.tick, self.time = 0, 0.0
        self.actuated: set[int] = set()
        """Slots of actuators assigned since this was last cleared."""
        self.moved = False
        """Whether the body was asked to move since this was last cleared."""
        self.barred = ""
        """Why nothing may act on the body now, "" if it may."""
        self.hops = MAX_HOPS
        """How many hops a TELL may travel: fewer while the robot evaluates what another one has told it."""
        self.held = False
        """Whether functions that act are refused: the robot is stopped and its body has no latch of its own."""
        self.dropped = 0
        """Number of assignments and calls that were not passed to the body because a value was unknown."""
        self.crowded = False
        """Whether it has reported that it had more neighbours than a form goes through."""
        self._key, self._draws = stream(seed, number), 0
        self.proven: RuleSet = {}
        self.unproven_since = 0

    def at(self, tick: int, now: float) -> None:
        """Begin a tick: sets the time (s) and the tick's random stream."""
        self.tick, self.time, self._draws = tick, now, 0
        self.values[TICK], self.values[TIME_SLOT] = float(tick), now

    @property
    def itself(self) -> Self:
        """What it knows, as it tells others."""
        return Self(self.vocabulary, self.base, self.values, self.peek, self.groups)

    # ---- called by the machine

    def fault(self, part: Part, reason: str) -> float:
        """Record a fault; returns unknown."""
        if len(self.faults) < MAX_FAULTS:
            self.faults.append(Fault(reason, show(part.form), self.tick))
        return nan

    def refuse(self, part: Part, reason: str) -> float:
        """Record a fault that this memory itself detects; it is recorded because repeating the evaluation would not
        find it."""
        if self.answers is not None:
            self.answers.append(NotedFault(part, reason))
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
        """A linked variable; a failure of the host is a fault."""
        try:
            return self._answer(self.variables.read(part.slot))
        except SleepcastError as error:
            return self._answer(self.refuse(part, str(error)))

    def peek(self, slot: int) -> float:
        """A value by its slot, wherever it is stored; a failure of the host gives unknown."""
        if slot not in self.variables.linked_slots:
            return self.values[slot]
        try:
            return self.variables.read(slot)
        except SleepcastError:
            return nan

    def write(self, part: Part, value: float) -> float:
        """SETQ of an actuator, a support variable, or a user variable that may not exist."""
        return self._answer(self._write(part, value))

    def _write(self, part: Part, value: float) -> float:
        variable = part.data
        if not isinstance(variable, Variable):
            declared = self.base.symbols.get(part.name)
            if not isinstance(declared, UserVariable):
                return self.refuse(part, no_variable(part.name))
            self.values[declared.slot] = value
        elif value != value:
            self.dropped += 1
            return self.refuse(part, unknown_assigned(variable))
        elif self.barred and variable.kind is VariableKind.ACTUATOR:
            return self.refuse(part, self.barred)
        elif variable.linked:
            try:
                self.variables.write(part.slot, value)
            except SleepcastError as error:
                return self.refuse(part, str(error))
            self.actuated.add(part.slot)
            self.moved |= variable.kind is VariableKind.ACTUATOR
        elif ACTIVE0 < part.slot < ACTIVE0 + BUFFERS:
            return self._write_flag(part, value)
        else:
            self.values[part.slot] = value
            if variable.kind is VariableKind.ACTUATOR:
                self.actuated.add(part.slot)
                self.moved = True
        return value

    def _write_flag(self, part: Part, value: float) -> float:
        """Assign to the variable that says whether a buffer runs."""
        number = part.slot - ACTIVE0
        key, wanted = f"e{number}", value > 0.0
        rule = self.base.rules.get(key)
        if rule is not None and rule.protected:
            return self.refuse(part, built_in(f"E{number}"))
        flag = self.base.merging.flag(key, wanted) is True
        self.values[part.slot] = value if flag is wanted else float(flag)
        self.changing()
        if rule is not None:
            self.base.assign_flag(key, flag)
        self.records.changed()
        return value

    def defined(self, part: Part) -> bool:
        """Whether the user variable exists."""
        exists = isinstance(self.base.symbols.get(part.name), UserVariable)
        if self.answers is not None:
            self.answers.append(exists)
        return exists

    def define(self, part: Part, value: float) -> float:
        """DEFVAR of a new name."""
        if not self.change(part, rules.define(self.base, part.name, written(part), part.slot)):
            return self._answer(nan)
        self.values[part.slot] = value
        return self._answer(value)

    def fetch(self, part: Part) -> Program | None:
        """The program in a buffer or rule."""
        rule = self.base.rules.get(part.name)
        program = None if rule is None else rule.program
        if self.answers is not None:
            self.answers.append(program)
        return program

    def operator(self, part: Part) -> Program | None:
        """The program of an operator."""
        program = self.base.operators.get(part.name)
        if program is None or program.parameters != len(part.parts):
            self.refuse(part, no_operator(part.name, len(part.parts)))
            program = None
        if self.answers is not None:
            self.answers.append(program)
        return program

    def host(self, part: Part, *arguments: float) -> float:
        """Call a function of the robot's own software. Any exception becomes a fault; it never ends the mind."""
        function = host_of(part)
        if any(argument != argument for argument in arguments):
            if function.acts:
                self.dropped += 1
                return self._answer(self.refuse(part, unknown_asked(function)))
            return self._answer(nan)
        if function.acts and (self.barred or self.held):
            return self._answer(self.refuse(part, self.barred or stopped(function)))
        self.moved |= function.acts and function.moves
        label = (part.data.text,) if isinstance(part.data, Label) else ()
        try:
            result = function.call(self.body, *label, *arguments)
            value = 1.0 if result is None else float(result)
        except Exception as error:
            return self._answer(self.refuse(part, failed(function, error)))
        return self._answer(value if -inf < value < inf else nan)

    def near(self, part: Part, *arguments: float) -> tuple[float, ...] | None:
        """See `Memory.near`. Any exception becomes a fault, as of `host`."""
        near, (function, sensor) = None, sensor_of(part)
        if not any(argument != argument for argument in arguments):
            try:
                near = listed(sensor, self.body, int(part.number), arguments)
            except Exception as error:
                self.refuse(part, failed(function, error))
        if near is not None and near.total > len(near) and not self.crowded:
            self.crowded = True
            self.output.report(crowded(int(part.number)), (float(near.total),))
        if self.answers is not None:
            self.answers.append(near)
        return near

    # ---- storing

    def store(self, part: Part, value: float) -> float:
        """SETQQ, RULE, and SETQ of a buffer."""
        storing = part.data
        if not isinstance(storing, Storing):
            raise TypeError(f"a part of op {part.op} stores nothing")
        if not storing.value:
            done = self._store(part, storing, storing.form)
            return self._answer((1.0 if storing.activate else 0.0) if done else nan)
        if value != value:
            return self._answer(self.refuse(part, UNKNOWN_STORED))
        return self._answer(value if self._store(part, storing, Number(value)) else nan)

    def _store(self, part: Part, storing: Storing, form: Form) -> bool:
        key, number = storing.key, buffer_number(storing.key)
        name = written(part) if number is None else key.upper()
        flags = {"activate": storing.activate, "flag": number is not None and self.values[ACTIVE0 + number] > 0.0}
        return self.change(part, rules.store(self.base, key, name, show(form), **flags, rank=storing.rank))

    def change(self, part: Part, refusal: str | None) -> bool:
        """Apply what an act has changed in the rule base, or record its refusal as a fault; returns whether it was
        done."""
        self.records.apply_effects()
        if refusal is not None:
            self.refuse(part, refusal)
        return refusal is None

    def restore(self, rule_set: RuleSet) -> None:
        """Replace all rules by these, except those built in."""
        rules.roll_back(self.base, [rule for rule, _ in rule_set.values()])
        self.records.apply_effects()
        self.records.restore_leases(rule_set)

    def changing(self) -> None:
        """To be called before the rule set changes: a proven one becomes the one to roll back to."""
        if self.tick - self.unproven_since >= PROVEN_TICKS:
            self.proven = self.records.rule_set()
        self.unproven_since = self.tick

    # ---- acts

    def act(self, part: Part, *arguments: float) -> float:
        """Everything else that an expression may do."""
        if part.name in FLAGS:
            slot, value = FLAGS[part.name]
            self.values[slot] = value
            return self._answer(1.0)
        result = self._answer(ACTS[part.name](self, part, *arguments))
        if part.name == "rollback" and self.answers is not None:
            self.answers.extend(self.values[ACTIVE0 + 1 : ACTIVE0 + BUFFERS])
        return result

    def rehearsal(self) -> Rehearsal:
        """A memory that starts from the current state, for asking what would happen now; changes in it affect nothing
        else."""
        drawn = iter(range(self._draws, 1 << 62))
        return Rehearsal(
            self.values,
            self.groups,
            fetch=lambda part: rule.program if (rule := self.base.rules.get(part.name)) else None,
            operator=lambda part: self.base.operators.get(part.name),
            read=lambda part: self.peek(part.slot),
            draw=lambda: draw(self._key, self.tick, next(drawn)),
            has=lambda key: isinstance(self.base.symbols.get(key), UserVariable),
        )


Act = Callable[..., float]
"""Implementation of one act: (memory, part, *arguments) to its value."""

_LIBRARIES: WeakKeyDictionary[Vocabulary, Library] = WeakKeyDictionary()
"""The programs shared by every robot of one vocabulary."""


# ---- acts: what an expression may do besides assigning and storing; `mind.rules` defines what each means


def _join(memory: RobotMemory, part: Part) -> float:
    if not memory.change(part, rules.join(memory.base, label_of(part))):
        return nan
    memory.groups |= {label_of(part).casefold()}
    return 1.0


def _leave(memory: RobotMemory, part: Part) -> float:
    if not memory.change(part, rules.leave(memory.base, label_of(part))):
        return nan
    memory.groups -= {label_of(part).casefold()}
    return 1.0


def _activate(memory: RobotMemory, part: Part) -> float:
    wanted = part.name == "activate"
    return 1.0 if memory.change(part, rules.activate(memory.base, label_of(part), wanted)) else nan


def _forget(memory: RobotMemory, part: Part) -> float:
    return 1.0 if memory.change(part, rules.forget(memory.base, label_of(part))) else nan


def _lease(memory: RobotMemory, part: Part, seconds: float) -> float:
    if seconds != seconds:
        return memory.refuse(part, UNKNOWN_LEASE)
    if not memory.change(part, rules.lease(memory.base, label_of(part))):
        return nan
    memory.records[label_of(part)].lease = memory.time + seconds
    memory.records.changed()
    return 1.0


def _defun(memory: RobotMemory, part: Part) -> float:
    defining = part.data
    if not isinstance(defining, Defining):
        raise TypeError(f"a part of op {part.op} defines nothing")
    text = " ".join(map(show, defining.body))
    done = memory.change(part, rules.define_operator(memory.base, written(part), defining.parameters, text))
    return 1.0 if done else nan


def _rollback(memory: RobotMemory, part: Part) -> float:
    memory.base.merging.roll_back()
    if memory.tick - memory.unproven_since < PROVEN_TICKS:
        memory.restore(memory.proven)
    return 1.0


def _report(memory: RobotMemory, part: Part, *arguments: float) -> float:
    memory.output.report(label_of(part), arguments)
    return arguments[-1] if arguments else 1.0


def _tell(memory: RobotMemory, part: Part, *arguments: float) -> float:
    if any(argument != argument for argument in arguments):
        return memory.refuse(part, UNKNOWN_TOLD)
    if not isinstance(part.data, Template):
        raise TypeError(f"a part of op {part.op} tells nothing")
    if part.data.auction is not None:
        return _call(memory, part, part.data, part.data.auction, arguments)
    hops = min(part.data.hops, memory.hops)
    if memory.output.may_tell(hops):  # first: only what is sent needs a text
        text = part.data.text(arguments)
        if len(text) > MAX_TEXT:
            return memory.refuse(part, too_long(text))
        memory.output.tell(text, hops, None)
    return 1.0


def _call(memory: RobotMemory, part: Part, told: Template, auction: Auction, arguments: tuple[float, ...]) -> float:
    """Tell the poll of an auction, if it was not told a moment ago; the auction goes on in any case."""
    calls, number, hops = memory.output.calls(), told.number, min(told.hops, memory.hops)
    if calls is None or calls.renew(auction, number, memory.time):
        return 1.0
    if not calls.has_room(number):
        return memory.refuse(part, TOO_MANY_CALLS)
    if memory.output.may_tell(hops):
        text = told.text(arguments)
        if len(text) > MAX_TEXT:
            return memory.refuse(part, too_long(text))
        memory.output.tell(text, hops, number)
        calls.begin(auction, number, memory.time)
    return 1.0


def _ping(memory: RobotMemory, part: Part, caste: float = 0.0) -> float:
    if caste != caste:
        return memory.refuse(part, UNKNOWN_CASTE)
    memory.output.ping(caste)
    return 1.0


def _cancel(memory: RobotMemory, part: Part) -> float:
    return memory.output.cancel()


ACTS: Mapping[str, Act] = {
    "cancel": _cancel,
    "join": _join,
    "leave": _leave,
    "activate": _activate,
    "deactivate": _activate,
    "forget": _forget,
    "lease": _lease,
    "defun": _defun,
    "rollback": _rollback,
    "report": _report,
    "tell": _tell,
    "ping": _ping,
}
