"""Rules: what a robot has learned, and how the acts of the language change it.

A `RuleBase` holds rules, buffers, operators and symbols (the meaning of each learned name). An act changes it, or
returns the reason for its refusal and changes nothing. Changes that concern single robots - flags, leases, counts of
firings - are left as `Effect`s for the owner of these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial

from sleepcast.core.errors import SleepcastError
from sleepcast.core.model import HostFunction
from sleepcast.core.records import dataclass
from sleepcast.language.areas import text_of
from sleepcast.language.functions import MAX_PRIORITY, PRIORITY
from sleepcast.language.program import Library, Program
from sleepcast.language.reader import MAX_TEXT, read_all
from sleepcast.language.symbols import (
    Declared,
    FreshNames,
    Group,
    Operator,
    Stored,
    UserVariable,
    circle,
    clash,
    declared_in,
    given,
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

    key: e1 to e63, or the case-folded name.
    protected: it cannot be changed by radio.
    priority: of its host; rules with a higher one are evaluated later (so their writes win) and are served first when
        the budget does not suffice for all.
    rank: the `:priority` of its RULE, which decides in the same way among rules of the same `priority`.
    """

    key: str
    name: str
    text: str
    program: Program
    active: bool = False
    protected: bool = False
    priority: int = 0
    rank: int = 0

    @property
    def shown_priority(self) -> int:
        """For people: a rule has a priority from its host, or from a RULE, never both."""
        return self.priority or self.rank


@dataclass(frozen=True, slots=True)
class Effect:
    """The effect of a change on each robot. what: "new", "renewed", "gone", "active", "inactive"; or "same", if only
    its program or the order has changed."""

    what: str
    key: str


def in_order(rules: Mapping[str, Rule]) -> Iterator[Rule]:
    """E1 upwards, then the rules in order of arrival."""
    yield from (rules[key] for key in BUFFER_KEYS if key in rules)
    yield from (rule for key, rule in rules.items() if buffer_number(key) is None)


def running(rules: Mapping[str, Rule]) -> list[Rule]:
    """The active rules in order of evaluation: higher priorities later."""
    return sorted((rule for rule in in_order(rules) if rule.active), key=levels(rules))


_RANKS = 2 * MAX_PRIORITY + 1


def levels(rules: Mapping[str, Rule]) -> Callable[[Rule], int]:
    """What orders these rules: the host's priority, then `:priority`, by which none rises above a protected rule."""
    most = 0 if guard(rules) is not None else MAX_PRIORITY
    return lambda rule: rule.priority * _RANKS + min(rule.rank, most)


def guard(rules: Mapping[str, Rule]) -> Rule | None:
    """A protected rule that a `:priority` above 0 would outrank; a host's priority of another level decides alone."""
    return next((rule for rule in rules.values() if rule.protected and not rule.priority), None)


def learned_at_first(vocabulary: Vocabulary, library: Library) -> tuple[dict[str, Declared], dict[str, Program]]:
    """Symbols and operators of a robot that has heard nothing yet: those of the areas that it knows."""
    names, operators = FreshNames(vocabulary), dict[str, Program]()
    for area in vocabulary.areas:
        text = text_of(area)
        operators[area.name.casefold()] = library.program(text, partial(read_all, text), names)
    return given(vocabulary), operators


class RuleBase:
    """What one mind has learned, by key in order of arrival; implements `Names`, so that texts are compiled in it.
    merging: which commands count; changing: called before the rules change."""

    def __init__(
        self,
        vocabulary: Vocabulary,
        library: Library,
        merging: Merging,
        changing: Callable[[], None],
        *,
        rules: Mapping[str, Rule] | None = None,
        symbols: Mapping[str, Declared],
        operators: Mapping[str, Program],
    ) -> None:
        self.vocabulary, self.library, self.merging, self.changing = vocabulary, library, merging, changing
        self.rules: dict[str, Rule] = dict(rules or {})
        self.symbols: dict[str, Declared] = dict(symbols)
        self.operators: dict[str, Program] = dict(operators)
        self.effects: list[Effect] = []

    def declared(self, key: str) -> Declared | None:
        """The declaration learned under `key`."""
        return declared_in(self.rules, self.symbols, key)

    def heard(self) -> Iterable[str]:
        """Every learned name as written."""
        return [each.name for each in self.symbols.values()]

    @property
    def merges(self) -> bool:
        """Whether the changes are those of a command that is merged with others."""
        return self.merging.place is not None

    def learn(self, key: str, meaning: Declared) -> None:
        """Set the meaning of a name."""
        before = self.symbols.get(key)
        self.symbols[key] = meaning
        if type(before) is not type(meaning) or isinstance(meaning, Operator):
            self.resolve_again(key)

    def unlearn(self, key: str) -> None:
        """Remove the meaning of a name."""
        if self.symbols.pop(key, None) is not None:
            self.resolve_again(key)

    def resolve_again(self, key: str) -> None:
        """Compile again what depends on a name with a new meaning; it was checked when it came in."""
        for name, rule in self.rules.items():
            if key in rule.program.free:
                program = self.library.again(rule.program, self)
                if program is not rule.program:
                    self.rules[name] = replace(rule, program=program)
                    self.effects.append(Effect("same", name))
        for name, program in self.operators.items():
            meaning = self.symbols[name]
            if key in program.free and isinstance(meaning, Operator):
                self.operators[name] = self.library.again(program, self, meaning.parameters)

    def program_for(self, key: str, text: str, parameters: tuple[str, ...]) -> Program | str:
        """The program of a text to be stored under `key`, or the reason for a refusal."""
        try:
            program = self.library.program(text, lambda: read_all(text), self, parameters)
        except SleepcastError as error:
            return f"refused: {str(error).splitlines()[0]}"
        through = circle(key, program.uses, lambda k: uses_in(self, k))
        if through is not None:
            return f"{key.upper()} would name itself{through}"
        return program

    # ---- rules

    def put(self, key: str, name: str, text: str, program: Program, *, flag: bool, rank: int = 0) -> None:
        """Store an expression; an existing one keeps its place and its flag. flag: of the buffer, if it is new."""
        before = self.rules.get(key)
        if before is None:
            self.rules[key] = Rule(key, name, text, program, flag, rank=rank)
            self.effects.append(Effect("new", key))
        else:
            self.rules[key] = replace(before, text=text, program=program, rank=rank)
            self.effects.append(Effect("renewed", key))

    def remove(self, key: str) -> None:
        """Remove an expression and clear its flag."""
        self.activate(key, False)
        del self.rules[key]
        self.effects.append(Effect("gone", key))

    def activate(self, key: str, active: bool) -> None:
        """Set the flag of a rule, or of a buffer, which may be empty."""
        if key in self.rules:
            self.assign_flag(key, active)
        self.effects.append(Effect("active" if active else "inactive", key))

    def assign_flag(self, key: str, active: bool) -> None:
        """Make a rule as active as its flag, which was set elsewhere; its lease does not change."""
        self.rules[key] = replace(self.rules[key], active=active)

    def rank(self, key: str, priority: int, protected: bool) -> None:
        """Set a rule's priority of its host, and whether it is protected."""
        self.rules[key] = replace(self.rules[key], priority=priority, protected=protected, rank=0)

    def arrange(self) -> None:
        """Sort the rules by the commands that made them first; those of the same command keep their order."""
        ordered = sorted(self.rules, key=self.merging.first)
        if ordered != list(self.rules):
            self.rules = {key: self.rules[key] for key in ordered}
            self.effects.append(Effect("same", ""))

    def too_late(self, name: str) -> str:
        """Why an earlier command changes nothing; it may still determine when a rule was first made."""
        self.arrange()
        return too_late(name)

    def changeable(self, key: str) -> Rule | str:
        """The rule or buffer that an act names, or why it cannot be changed."""
        rule = self.rules.get(key)
        if rule is None:
            return no_rule(key)
        return built_in(rule.name) if rule.protected else rule


# ---- acts: each changes a rule base, or returns the reason for its refusal


def store(base: RuleBase, key: str, name: str, text: str, *, activate: bool, flag: bool, rank: int = 0) -> str | None:
    """SETQQ, RULE, and SETQ of a buffer. flag: of the buffer now; rank: what RULE gives as `:priority`."""
    before, named = base.rules.get(key), buffer_number(key) is None
    if before is not None and before.protected:
        return built_in(before.name)
    if rank and before is not None and before.priority:
        return ranked_by_host(before.name)
    if rank > 0 and (built := guard(base.rules)) is not None:
        return outranks(name, built.name)
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
    base.put(key, name, text, program, flag=flag, rank=rank)
    if named:
        base.learn(key, Stored(name, program.uses))
    wanted = base.merging.flag(key, True if activate else None)
    if wanted is not None:
        base.activate(key, wanted)
    base.arrange()
    return None


def activate(base: RuleBase, key: str, wanted: bool) -> str | None:
    """ACTIVATE and DEACTIVATE."""
    flag = base.merging.flag(key, wanted)  # also recorded for a rule that does not exist yet
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
    known = key in base.operators or rule is not None
    if not base.merging.write(key):
        if key not in base.operators and rule is not None and flag is False:
            base.activate(key, False)
        refusal = base.too_late(key)
        return refusal if known else no_rule(key)
    if not known:
        return no_rule(key)
    if key in base.operators:
        del base.operators[key]
    else:
        base.changing()
        base.remove(key)
    base.unlearn(key)
    return None


def lease(base: RuleBase, key: str) -> str | None:
    """LEASE: whether a rule may get one. Each robot stores the end of its own."""
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
    """JOIN: learns the name of the group; each robot stores its own membership."""
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
    """ROLLBACK: replace all rules by these, except protected ones; what the host gives as priority stays."""
    hosts = {key: rule.priority for key, rule in base.rules.items() if not rule.protected}
    for key in hosts:
        base.remove(key)
    for rule in (each for each in wanted if each.key not in base.rules):  # the host may have protected it since
        base.put(rule.key, rule.name, rule.text, rule.program, flag=False, rank=rule.rank)
        priority = hosts.get(rule.key, rule.priority)
        if priority:
            base.rank(rule.key, priority, False)
        base.activate(rule.key, rule.active)
    for key in [key for key, each in base.symbols.items() if isinstance(each, Stored) and key not in base.rules]:
        base.unlearn(key)
    for key in list(base.rules):
        if buffer_number(key) is None:
            base.learn(key, Stored(base.rules[key].name, base.rules[key].program.uses))


# ---- refusals: sentences that say why a mind does not do what an expression asks for

UNKNOWN_STORED = "unknown cannot be stored as an expression"
UNKNOWN_LEASE = "a lease of unknown length"
UNKNOWN_TOLD = "an unknown cannot be told"
UNKNOWN_CASTE = "a ping of unknown caste"


def built_in(name: str) -> str:
    """Refuses to change a built-in rule or buffer, or the flag of one."""
    return f"{name} is built in: it cannot be changed over the air"


def ranked_by_host(name: str) -> str:
    """Refuses a `:priority` for a rule that has one from its host."""
    return f"{name} has its priority from the robot's own program: leave out {PRIORITY}"


def outranks(name: str, built: str) -> str:
    """Refuses a priority by which a rule would have the last word over a protected one."""
    return f"{name} would outrank {built}, which is built in: here {PRIORITY} is at most 0"


def too_late(name: str) -> str:
    """Refuses a change by an earlier command."""
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
