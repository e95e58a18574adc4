"""The state of a node: what it has learned as plain data, and restoring it into a node.

Nothing about a body is stored: after a restart it stands still until something moves it again. Built-in rules are
not stored either: the robot gets them at every start.
"""

from __future__ import annotations

from math import inf, isfinite

from sleepcast.core.errors import SleepcastError
from sleepcast.core.serial import SerialError
from sleepcast.language.program import Program
from sleepcast.language.reader import read_all
from sleepcast.language.symbols import Group, Operator, Stored, UserVariable
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, buffer_number
from sleepcast.mind.limits import FAILED, PROVEN_TICKS
from sleepcast.mind.rules import Rule
from sleepcast.mind.state import MindState, OperatorState, RuleState
from sleepcast.node.memory import RobotMemory
from sleepcast.node.node import Node
from sleepcast.node.scheduler import RuleSet
from sleepcast.robot import Settling

UNFIT = (*(ValueError, TypeError, LookupError, ArithmeticError), *(AttributeError, RecursionError, SleepcastError))
"""Exceptions that unchecked plain data may cause while a mind is restored."""


def mind_of(node: Node) -> MindState:
    """What this robot has learned."""
    memory = node.memory
    values, learned = memory.values, memory.base.symbols.values()
    failed = memory.unproven_since == FAILED
    return MindState(
        node.stopped,
        node.authority.state(memory.time),
        tuple(values[: ACTIVE0 + BUFFERS]),
        {each.name: values[each.slot] for each in learned if isinstance(each, UserVariable)},
        tuple(each.name for each in learned if isinstance(each, Group)),
        tuple(sorted(memory.groups)),
        tuple(
            OperatorState(each.name, each.parameters, memory.base.operators[key].text)
            for key, each in memory.base.symbols.items()
            if isinstance(each, Operator)
        ),
        _packed(memory.records.rule_set(), memory.time),
        _packed(memory.proven, memory.time),
        None if failed else min(memory.tick - memory.unproven_since, PROVEN_TICKS),
        memory.base.merging.state(),
        node.doubt,
        _endings(node),
        tuple(each.shifted(node.zero) for each in node.timing.waiting),
    )


def fingerprint(node: Node) -> tuple[object, ...]:
    """A value that is equal while `mind_of` stays the same, except for times that advance on their own."""
    memory = node.memory
    proven = memory.tick - memory.unproven_since >= PROVEN_TICKS
    own = [memory.values[each.slot] for each in memory.base.symbols.values() if isinstance(each, UserVariable)]
    values = (*memory.values[: ACTIVE0 + BUFFERS], *own)
    # NaN is not equal to itself, so numbers are compared as text.
    return (
        *(
            node.stopped,
            node.doubt,
            _endings(node),
            tuple(each.message.id for each in node.timing.waiting),
            repr(node.authority.state(0.0)),
            proven,
            memory.records.version,
            memory.groups,
            repr(values),
        ),
        memory.base.merging.version,
        *(tuple(memory.base.symbols), tuple(memory.base.operators.values())),
    )


def _endings(node: Node) -> tuple[str, ...]:
    """The texts that end what it is a member by."""
    return () if node.auctions is None else node.auctions.bidding.endings(node.memory.base.rules)


def restore(state: MindState, node: Node, away: float) -> list[str]:
    """Restore a state into a robot that has learned nothing yet; a STOP stays in force. away: seconds that have passed
    meanwhile, for leases. Returns sentences that say what could not be restored and why. Raises SerialError for an
    impossible state; the robot is then unusable."""
    try:
        lost = _put_back(state, node.memory, away)
        node.authority.restore(state.authority, node.memory.time - away)
        if state.endings:
            node.auctioning().bidding.restore(state.endings)
        node.timing.restore((each.shifted(-node.zero) for each in state.waiting), node.memory.time)
    except UNFIT as error:
        raise SerialError(f"no mind can be made of this: {type(error).__name__}: {error}") from None
    return lost + stand(node, state.doubt) if state.stopped else lost


def stand(node: Node, doubt: str) -> list[str]:
    """Start a robot as stopped, and a simulated body at rest; returns sentences that say what did not come to rest."""
    if isinstance(node.body, Settling):
        node.body.settle()
    try:
        node.halt(doubt)
    except SleepcastError as error:
        return [str(error)]
    return []


def _put_back(state: MindState, memory: RobotMemory, away: float) -> list[str]:
    if len(state.flags) != ACTIVE0 + BUFFERS or not all(map(isfinite, state.flags)):
        raise SerialError(f"wanted {ACTIVE0 + BUFFERS} flags")
    protected = {f"e{number}" for number in range(BUFFERS) if _is_protected(memory, f"e{number}")}
    for slot, value in enumerate(state.flags):
        if f"e{slot - ACTIVE0}" not in protected:
            memory.values[slot] = value
    for key in list(memory.base.operators):  # what it knew from the start, it may have forgotten
        del memory.base.operators[key]
        memory.base.unlearn(key)
    _learn_names(state, memory)
    lost: list[str] = []
    for operator in state.operators:
        key = operator.name.casefold()
        program = _program(memory, f"operator {operator.name}", operator.text, operator.parameters, lost)
        if program is None:
            del memory.base.symbols[key]
        else:
            memory.base.operators[key] = program
            memory.base.learn(key, Operator(operator.name, operator.parameters, program.uses))
    memory.restore(_unpacked(state.rules, memory, away, lost))
    memory.proven = _unpacked(state.proven, memory, away, [])
    memory.base.merging.restore(state.merging)
    memory.unproven_since = FAILED if state.ticks is None else memory.tick - state.ticks
    return lost


def _learn_names(state: MindState, memory: RobotMemory) -> None:
    """All names before any text, because texts use names."""
    for name, value in state.variables.items():
        slot = memory.vocabulary.user_slot(name.casefold())
        memory.values.extend([float("nan")] * (slot + 1 - len(memory.values)))
        memory.values[slot] = value
        memory.base.symbols[name.casefold()] = UserVariable(name, slot)
    for name in state.known:
        memory.base.symbols[name.casefold()] = Group(name)
    memory.groups = frozenset(state.groups)
    for operator in state.operators:
        memory.base.symbols[operator.name.casefold()] = Operator(operator.name, operator.parameters, frozenset())
    for rule in (*state.rules, *state.proven):
        if buffer_number(rule.name.casefold()) is None and not _is_protected(memory, rule.name.casefold()):
            memory.base.symbols[rule.name.casefold()] = Stored(rule.name, frozenset())


def _is_protected(memory: RobotMemory, key: str) -> bool:
    rule = memory.base.rules.get(key)
    return rule is not None and rule.protected


def _packed(rules: RuleSet, now: float) -> tuple[RuleState, ...]:
    return tuple(
        RuleState(rule.name, rule.text, rule.active, None if lease == inf else lease - now, rule.rank)
        for rule, lease in rules.values()
    )


def _unpacked(rules: tuple[RuleState, ...], memory: RobotMemory, away: float, lost: list[str]) -> RuleSet:
    rule_set = {}
    for rule in rules:
        key = rule.name.casefold()
        if _is_protected(memory, key):
            lost.append(f"{rule.name} is built in now, so what it was over the air is forgotten")
            continue
        program = _program(memory, f"rule {rule.name}", rule.text, (), lost)
        if program is not None:
            lease = inf if rule.left is None else memory.time + rule.left - away
            rule_set[key] = (Rule(key, rule.name, rule.text, program, rule.active, rank=rule.rank), lease)
    return rule_set


def _program(memory: RobotMemory, what: str, text: str, parameters: tuple[str, ...], lost: list[str]) -> Program | None:
    """The program of a stored text; None, with a sentence added to `lost`, if this robot can no longer have it."""
    try:
        return memory.library.program(text, lambda: read_all(text), memory.base, parameters)
    except SleepcastError as error:
        lost.append(f"the {what} cannot be kept: {str(error).splitlines()[0]}")
        return None
