"""Saving a fleet as plain data, and restoring it.

Numbers are stored as arrays. Minds are stored as what has been learned; each program's text is compiled again with
the meanings that its names had when it was first compiled, so the program is the same, whatever has happened to
those names since.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from sleepcast.columns.values import Shared
from sleepcast.core.serial import Array, SerialError
from sleepcast.fleet.fleet import Fleet
from sleepcast.fleet.schema import AuthorityState, FleetSnapshot, SharedState
from sleepcast.fleet.state import Mind, Minds
from sleepcast.language.program import Program
from sleepcast.language.symbols import Operator
from sleepcast.language.vocabulary import MAX_USER_VARIABLES, Vocabulary
from sleepcast.mind.authority import Leases
from sleepcast.mind.merging import Merging
from sleepcast.mind.rules import Rule
from sleepcast.mind.state import ProgramState, SharedMind, SharedMinds, SharedRule, SymbolState

Value = TypeVar("Value")
Plain = TypeVar("Plain")


def state_of(fleet: Fleet) -> FleetSnapshot:
    """The state of a fleet between two ticks; the fleet is not changed."""
    return FleetSnapshot(
        shared_minds(fleet.minds),
        fleet.state.state(),
        fleet.telemetry.state(),
        fleet.memory.statistics.state(),
        fleet.inbox.state(),
        fleet.outbox.state(),
        {robot: tuple(sorted(keys)) for robot, keys in fleet.scheduler.left_over.items()},
        {slot: Array.of(column) for slot, column in fleet.measured.items()},
        fleet.minds_used,
        _authority_of(fleet),
        fleet.bids.state(),
        fleet.timing.state(),
    )


def _authority_of(fleet: Fleet) -> AuthorityState:
    authority = fleet.authority
    return AuthorityState(
        _shared_state(authority.driving, lambda driving: driving),
        _shared_state(authority.leases, lambda leases: dict(leases.held)),
        _shared_state(authority.doubts, str),
        _shared_state(authority.catching_up, bool),
        _shared_state(fleet.state.merging, lambda merging: merging.state()),
        [(*life, Array.of(when)) for life, when in fleet.arrived.items()],
    )


def _shared_state(shared: Shared[Value], plain: Callable[[Value], Plain]) -> SharedState[Plain]:
    column = None if len(shared.values) == 1 else Array.of(shared.column)
    return SharedState([plain(value) for value in shared.values], column)


def _restore_authority(fleet: Fleet, state: AuthorityState) -> None:
    authority = fleet.authority
    _refill_shared(authority.driving, state.driving, lambda driving: driving)
    _refill_shared(authority.leases, state.leases, Leases)
    _refill_shared(authority.doubts, state.doubts, str)
    _refill_shared(authority.catching_up, state.catching_up, bool)
    _refill_shared(fleet.state.merging, state.merging, Merging.of)
    for sender, epoch, when in state.arrived:
        fleet.arrived[sender, epoch] = when.made(np.float64, (len(fleet),), "when a STOP has arrived")


def _refill_shared(shared: Shared[Value], state: SharedState[Plain], made: Callable[[Plain], Value]) -> None:
    column = shared.column if state.column is None else state.column.made(np.int32, shared.column.shape, "whose values")
    shared.restore([made(value) for value in state.values], column)


def restore(fleet: Fleet, state: FleetSnapshot, when: float) -> None:
    """Restore a new fleet to a saved state. when: time of the snapshot, s, for explanations. Raises SerialError for the
    state of another fleet, or one with impossible values."""
    refill(fleet.minds, state.minds)
    fleet.state.restore(state.state)
    fleet.telemetry.restore(state.told)
    known, _ = fleet.minds.table
    for numbers in (fleet.state.mind, fleet.state.proven):
        if not known.keys() >= set(np.unique(numbers).tolist()):
            raise SerialError("a robot whose mind is not there")
    fleet.memory.statistics.restore(state.tallies)
    fleet.inbox.restore(state.inbox)
    fleet.outbox.restore(state.speech)
    if not all(0 <= robot < len(fleet) for robot in state.left_over):
        raise SerialError("rules left over by a robot that is not there")
    fleet.scheduler.left_over = {robot: frozenset(keys) for robot, keys in state.left_over.items()}
    if state.measured.keys() != fleet.measured.keys():
        raise SerialError("other sensors whose values grow old")
    for slot, column in fleet.measured.items():
        column[:] = state.measured[slot].made(np.float64, column.shape, f"when sensor {slot} was measured")
    fleet.minds_used = state.minds_used
    if state.authority is not None:
        _restore_authority(fleet, state.authority)
    if state.auctions is not None:
        fleet.bids.restore(state.auctions)
    if state.timing is not None:
        fleet.timing.restore(state.timing)
    fleet.evaluation_log.since = when


# ---- minds


def shared_minds(minds: Minds) -> SharedMinds:
    """The table of minds. Programs that robots share are stored once."""
    indices: dict[Program, int] = {}
    programs: list[ProgramState] = []

    def index_of(program: Program, parameters: tuple[str, ...] = ()) -> int:
        if program not in indices:
            indices[program] = len(programs)
            programs.append(ProgramState.of(program, parameters))
        return indices[program]

    table, following = minds.table
    shared = {number: _shared(mind, index_of) for number, mind in table.items()}
    return SharedMinds(list(minds.vocabulary.user_slots), programs, shared, following)


def refill(minds: Minds, state: SharedMinds) -> None:
    """Restore the table of minds. Raises SerialError."""
    vocabulary = minds.vocabulary
    if len(state.user_names) > MAX_USER_VARIABLES:
        raise SerialError(f"{len(state.user_names)} names of user variables, at most {MAX_USER_VARIABLES} fit")
    vocabulary.user_slots.clear()
    for key in state.user_names:
        vocabulary.user_slot(key)
    programs = [each.made(vocabulary, minds.library) for each in state.programs]
    restored = {number: _mind(each, programs, vocabulary) for number, each in state.minds.items()}
    if 0 not in restored or min(restored) < 0 or max(restored) >= state.next or state.next > np.iinfo(np.int32).max:
        raise SerialError(f"numbers of minds that do not go from 0 to {state.next}")
    minds.fill(restored, state.next)


def _shared(mind: Mind, index_of: Callable[..., int]) -> SharedMind:
    rules = [
        SharedRule(rule.key, rule.name, index_of(rule.program), rule.active, rule.protected, rule.priority, rule.rank)
        for rule in mind.rules.values()
    ]
    operators = {}
    for key, program in mind.operators.items():
        symbol = mind.symbols[key]
        operators[key] = index_of(program, symbol.parameters if isinstance(symbol, Operator) else ())
    return SharedMind(rules, {key: SymbolState.of(symbol) for key, symbol in mind.symbols.items()}, operators)


def _mind(saved: SharedMind, programs: list[Program], vocabulary: Vocabulary) -> Mind:
    symbols = {key: symbol.made(key, vocabulary) for key, symbol in saved.symbols.items()}
    rules, operators = {}, {}
    for rule in saved.rules:
        program = _at(programs, rule.program, 0)
        flags = (rule.active, rule.protected, rule.priority, rule.rank)
        rules[rule.key] = Rule(rule.key, rule.name, program.text, program, *flags)
    for key, number in saved.operators.items():
        symbol = symbols.get(key)
        if not isinstance(symbol, Operator):
            raise SerialError(f"an operator {key[:80]} without a name")
        operators[key] = _at(programs, number, len(symbol.parameters))
    return Mind(rules, symbols, operators)


def _at(programs: list[Program], number: int, parameters: int) -> Program:
    if not 0 <= number < len(programs) or programs[number].parameters != parameters:
        raise SerialError(f"there is no program {number} of {parameters} parameters")
    return programs[number]
