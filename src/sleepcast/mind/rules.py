"""Rules: what a robot has learned, and what the acts of the language do to it.

A `RuleBase` holds rules, buffers, operators and symbols (what each learned name means). An act changes it, or gives
the reason for its refusal and changes nothing. What a change does to the single robots - flags, leases, how often a
rule has fired - it leaves as `Effect`s to the owner of these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from sleepcast.core.errors import SleepcastError
from sleepcast.core.model import HostFunction
from sleepcast.language.program import Library, Program
from sleepcast.language.reader import MAX_TEXT, read_all
from sleepcast.language.symbols import (
    Declared,
    Group,
    Operator,
    Stored,
    UserVariable,
    circle,
    clash,
    declared_in,
    uses_in,
)
from sleepcast.language.vocabulary import (
    BUFFERS,
    MAX_GROUPS,
    MAX_OPERATORS,
    MAX_RULES,
    Variable,
    VariableKind,
    Vocabulary,
    buffer_number,
)
from sleepcast.mind.merging import Merging

BUFFER_KEYS = tuple(f"e{number}" for number in range(1, BUFFERS))


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule or buffer: its key, its name as written, text, program, and whether it runs at every tick.

    key: e1 to e63, or the case-folded name. protected: it cannot be changed over the air. priority: the higher, the
    later in the round (its writes win) and the safer from a budget that does not reach for all.
    """

    key: str
    name: str
    text: str
    program: Program
    active: bool = False
    protected: bool = False
    priority: int = 0


@dataclass(frozen=True, slots=True)
class Effect:
    """What a change does to each robot. what: "new", "renewed", "gone", "active", "inactive"; or "same",
    where only its program or the order has changed."""

    what: str
    key: str


def in_order(rules: Mapping[str, Rule]) -> Iterator[Rule]:
    """E1 upwards, then the rules in the order of their arrival."""
    yield from (rules[key] for key in BUFFER_KEYS if key in rules)
    yield from (rule for key, rule in rules.items() if buffer_number(key) is None)


def running(rules: Mapping[str, Rule]) -> list[Rule]:
    """The active ones in the order of the round: a higher priority later."""
    return sorted((rule for rule in in_order(rules) if rule.active), key=lambda rule: rule.priority)


class RuleBase:
    """What one mind has learned, by key in the order of arrival; a `Names` as well, so that texts are compiled as it
    takes them. merging: which commands count; changing: called before the rules change."""

    def __init__(
        self,
        vocabulary: Vocabulary,
        library: Library,
        merging: Merging,
        changing: Callable[[], None],
        *,
        rules: Mapping[str, Rule] | None = None,
        symbols: Mapping[str, Declared] | None = None,
        operators: Mapping[str, Program] | None = None,
    ) -> None:
        self.vocabulary, self.library, self.merging, self.changing = vocabulary, library, merging, changing
        self.rules: dict[str, Rule] = dict(rules or {})
        self.symbols: dict[str, Declared] = dict(symbols or {})
        self.operators: dict[str, Program] = dict(operators or {})
        self.effects: list[Effect] = []

    def declared(self, key: str) -> Declared | None:
        """What is learned under `key`."""
        return declared_in(self.rules, self.symbols, key)

    def heard(self) -> Iterable[str]:
        """Every learned name as written."""
        return [found.name for found in self.symbols.values()]

    def learn(self, key: str, found: Declared) -> None:
        """Let a name mean this from now on."""
        before = self.symbols.get(key)
        self.symbols[key] = found
        if type(before) is not type(found) or isinstance(found, Operator):
            self.resolve_again(key)

    def unlearn(self, key: str) -> None:
        """Let a name mean nothing any more."""
        if self.symbols.pop(key, None) is not None:
            self.resolve_again(key)

    def resolve_again(self, key: str) -> None:
        """What depends on a name that has changed its meaning is compiled anew; it has been checked when it came in."""
        for name, rule in self.rules.items():
            if key in rule.program.free:
                program = self.library.again(rule.program, self)
                if program is not rule.program:
                    self.rules[name] = replace(rule, program=program)
                    self.effects.append(Effect("same", name))
        for name, program in self.operators.items():
            found = self.symbols[name]
            if key in program.free and isinstance(found, Operator):
                self.operators[name] = self.library.again(program, self, found.parameters)

    def program_for(self, key: str, text: str, parameters: tuple[str, ...]) -> Program | str:
        """The program of a text that is to be kept under `key`, or why it is refused."""
        try:
            program = self.library.program(text, lambda: read_all(text), self, parameters)
        except SleepcastError as error:
            return f"refused: {str(error).splitlines()[0]}"
        through = circle(key, program.uses, lambda k: uses_in(self, k))
        if through is not None:
            return f"{key.upper()} would name itself{through}"
        return program

    # ---- rules

    def put(self, key: str, name: str, text: str, program: Program, *, flag: bool) -> None:
        """Keep an expression; one that is there keeps its place and its flag. flag: of the buffer, if it is new."""
        found = self.rules.get(key)
        if found is None:
            self.rules[key] = Rule(key, name, text, program, flag)
            self.effects.append(Effect("new", key))
        else:
            self.rules[key] = replace(found, text=text, program=program)
            self.effects.append(Effect("renewed", key))

    def remove(self, key: str) -> None:
        """Forget an expression and clear its flag."""
        self.activate(key, False)
        del self.rules[key]
        self.effects.append(Effect("gone", key))

    def activate(self, key: str, active: bool) -> None:
        """Set the flag of a rule, or of a buffer that may hold nothing yet."""
        if key in self.rules:
            self.assign_flag(key, active)
        self.effects.append(Effect("active" if active else "inactive", key))

    def assign_flag(self, key: str, active: bool) -> None:
        """Let a rule be as active as its flag, which somebody else has set; its lease stays as it is."""
        self.rules[key] = replace(self.rules[key], active=active)

    def rank(self, key: str, priority: int, protected: bool) -> None:
        """Say how important a rule is, and whether it is built in."""
        self.rules[key] = replace(self.rules[key], priority=priority, protected=protected)

    def arrange(self) -> None:
        """Put rules into the order of the commands that made them first; those of the same one stay as they are."""
        ordered = sorted(self.rules, key=self.merging.first)
        if ordered != list(self.rules):
            self.rules = {key: self.rules[key] for key in ordered}
            self.effects.append(Effect("same", ""))

    def too_late(self, name: str) -> str:
        """Why an earlier command changes nothing, which may still say when a rule was made first."""
        self.arrange()
        return too_late(name)

    def changeable(self, key: str) -> Rule | str:
        """The rule or buffer that an act names, or why it cannot be changed."""
        rule = self.rules.get(key)
        if rule is None:
            return no_rule(key)
        return built_in(rule.name) if rule.protected else rule


# ---- acts: each changes a rule base, or gives the reason why not


def store(base: RuleBase, key: str, name: str, text: str, *, activate: bool, flag: bool) -> str | None:
    """SETQQ, RULE, and SETQ of a buffer. flag: of the buffer now."""
    before, named = base.rules.get(key), buffer_number(key) is None
    if before is not None and before.protected:
        return built_in(before.name)
    if named:
        taken = clash(base.symbols.get(key), Stored)
        if taken is not None:
            return taken
        if before is None and sum(buffer_number(each) is None for each in base.rules) >= MAX_RULES:
            return no_room("rule", MAX_RULES)
    program = base.program_for(key, text, ())
    if isinstance(program, str):
        return program
    base.merging.make(key)
    if not base.merging.write(key):
        return base.too_late(key)
    base.changing()
    base.put(key, name, text, program, flag=flag)
    if named:
        base.learn(key, Stored(name, program.uses))
    wanted = base.merging.flag(key, True if activate else None)
    if wanted is not None:
        base.activate(key, wanted)
    base.arrange()
    return None


def activate(base: RuleBase, key: str, wanted: bool) -> str | None:
    """ACTIVATE and DEACTIVATE."""
    flag = base.merging.flag(key, wanted)  # noted for a rule that is not there yet, too
    if buffer_number(key) is not None and key not in base.rules:
        base.changing()
        base.activate(key, flag is True)
        return None
    rule = base.changeable(key)
    if isinstance(rule, str):
        return rule
    if flag is not wanted:
        return too_late(rule.name)
    base.changing()
    base.activate(key, wanted)
    return None


def forget(base: RuleBase, key: str) -> str | None:
    """FORGET of a rule, a buffer or an operator."""
    rule = base.rules.get(key)
    if key not in base.operators and rule is not None and rule.protected:
        return built_in(rule.name)
    base.merging.forget(key)
    flag = base.merging.flag(key, False)
    there = key in base.operators or rule is not None
    if not base.merging.write(key):
        if key not in base.operators and rule is not None and flag is False:
            base.activate(key, False)
        refusal = base.too_late(key)
        return refusal if there else no_rule(key)
    if not there:
        return no_rule(key)
    if key in base.operators:
        del base.operators[key]
    else:
        base.changing()
        base.remove(key)
    base.unlearn(key)
    return None


def lease(base: RuleBase, key: str) -> str | None:
    """LEASE: whether a rule may be given one. When it ends, each robot keeps for itself."""
    rule = base.changeable(key)
    if isinstance(rule, str):
        return rule
    base.changing()
    return None


def define(base: RuleBase, key: str, name: str, slot: int) -> str | None:
    """DEFVAR of a new name."""
    taken = clash(base.symbols.get(key), UserVariable)
    if taken is None:
        base.learn(key, UserVariable(name, slot))
    return taken


def define_operator(base: RuleBase, name: str, parameters: tuple[str, ...], text: str) -> str | None:
    """DEFUN."""
    key = name.casefold()
    taken = clash(base.symbols.get(key), Operator)
    if taken is not None:
        return taken
    if key not in base.operators and len(base.operators) >= MAX_OPERATORS:
        return no_room("operator", MAX_OPERATORS)
    program = base.program_for(key, text, parameters)
    if isinstance(program, str):
        return program
    if not base.merging.write(key):
        return base.too_late(name)
    base.operators[key] = program
    base.learn(key, Operator(name, parameters, program.uses))
    return None


def join(base: RuleBase, name: str) -> str | None:
    """JOIN: the name of a group is learned; who is in it, each robot keeps for itself."""
    key = name.casefold()
    taken = clash(base.symbols.get(key), Group)
    if taken is not None:
        return taken
    if key not in base.symbols and sum(isinstance(each, Group) for each in base.symbols.values()) >= MAX_GROUPS:
        return no_room("group", MAX_GROUPS)
    if not base.merging.write(f"group {key}"):
        return base.too_late(name)
    base.learn(key, Group(name))
    return None


def leave(base: RuleBase, name: str) -> str | None:
    """LEAVE."""
    return None if base.merging.write(f"group {name.casefold()}") else base.too_late(name)


def roll_back(base: RuleBase, wanted: Iterable[Rule]) -> None:
    """ROLLBACK: have just these rules, besides what is protected, which stays."""
    for key in [rule.key for rule in base.rules.values() if not rule.protected]:
        base.remove(key)
    for rule in wanted:
        base.put(rule.key, rule.name, rule.text, rule.program, flag=False)
        base.activate(rule.key, rule.active)
    for key in [key for key, each in base.symbols.items() if isinstance(each, Stored) and key not in base.rules]:
        base.unlearn(key)
    for key in list(base.rules):
        if buffer_number(key) is None:
            base.learn(key, Stored(base.rules[key].name, base.rules[key].program.uses))


# ---- refusals: the sentences that say why a mind does not do what an expression asks for

UNKNOWN_STORED = "unknown cannot be stored as an expression"
UNKNOWN_LEASE = "a lease of unknown length"
UNKNOWN_TOLD = "an unknown cannot be told"
UNKNOWN_CASTE = "a ping of unknown caste"


def built_in(name: str) -> str:
    """A rule or buffer, or the flag of one, that belongs to the robot itself."""
    return f"{name} is built in: it cannot be changed over the air"


def too_late(name: str) -> str:
    """What an earlier command wants to change."""
    return f"{name} was changed by a command that was sent later"


def no_room(what: str, most: int) -> str:
    return f"no room for another {what}: there are {most}"


def no_rule(key: str) -> str:
    return f"no rule {key}"


def no_variable(name: str) -> str:
    return f"no variable {name}: make it first with (DEFVAR {name})"


def no_operator(name: str, arguments: int) -> str:
    return f"no operator {name} of {arguments} arguments"


def unknown_assigned(variable: Variable) -> str:
    never = "never reaches an actuator" if variable.kind is VariableKind.ACTUATOR else "cannot be assigned to a flag"
    return f"unknown {never} ({variable.name})"


def unknown_asked(function: HostFunction) -> str:
    return f"unknown never reaches the body ({function.name})"


def stopped(function: HostFunction) -> str:
    return f"the robot is stopped: {function.name} waits for RELEASE"


def failed(function: HostFunction, error: Exception) -> str:
    return f"{function.name} failed: {type(error).__name__}: {error}"


def too_long(text: str) -> str:
    return f"a text of {len(text)} characters cannot be sent by TELL: at most {MAX_TEXT} fit"
