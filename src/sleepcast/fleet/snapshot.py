"""A fleet as a parcel, and a fleet that goes on where that one was.

Numbers are kept as arrays. Minds are kept as what has been learned; each program's text is compiled again with the
meanings that its names had when it was first compiled, so it becomes the program that it was, whatever has happened to
those names since.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from sleepcast.core.errors import SleepcastError
from sleepcast.core.serial import Array, SerialError
from sleepcast.fleet.fleet import Fleet
from sleepcast.fleet.minds import Mind, Minds
from sleepcast.fleet.schema import FleetSnapshot, MindsState, MindState, ProgramState, RuleState, SymbolState
from sleepcast.language.program import Program
from sleepcast.language.reader import read_all
from sleepcast.language.symbols import SORTS, Declared, Group, Operator, Stored, UserVariable
from sleepcast.language.vocabulary import MAX_USER_VARIABLES, Vocabulary
from sleepcast.mind.rules import Rule


def state_of(fleet: Fleet) -> FleetSnapshot:
    """The fleet between two ticks. Nothing of it is changed."""
    return FleetSnapshot(
        minds_parcel(fleet.minds),
        fleet.state.state(),
        fleet.telemetry.state(),
        fleet.memory.statistics.state(),
        fleet.inbox.state(),
        fleet.outbox.state(),
        {robot: tuple(sorted(keys)) for robot, keys in fleet.scheduler.left_over.items()},
        {slot: Array.of(column) for slot, column in fleet.measured.items()},
        fleet.minds_used,
    )


def restore(fleet: Fleet, parcel: FleetSnapshot, when: float) -> None:
    """Make a fleet, just made, what that one was. when: the time at which it was kept, s, for those who ask why.

    Raises ParcelError for a parcel of another fleet, or one that holds what no fleet can hold.
    """
    refill(fleet.minds, parcel.minds)
    fleet.state.restore(parcel.state)
    fleet.telemetry.restore(parcel.told)
    known, _ = fleet.minds.table
    for numbers in (fleet.state.mind, fleet.state.proven):
        if not known.keys() >= set(np.unique(numbers).tolist()):
            raise SerialError("a robot whose mind is not there")
    fleet.memory.statistics.restore(parcel.tallies)
    fleet.inbox.restore(parcel.inbox)
    fleet.outbox.restore(parcel.speech)
    if not all(0 <= robot < len(fleet) for robot in parcel.left_over):
        raise SerialError("rules left over by a robot that is not there")
    fleet.scheduler.left_over = {robot: frozenset(keys) for robot, keys in parcel.left_over.items()}
    if parcel.measured.keys() != fleet.measured.keys():
        raise SerialError("other sensors whose values grow old")
    for slot, column in fleet.measured.items():
        column[:] = parcel.measured[slot].made(np.float64, column.shape, f"when sensor {slot} was measured")
    fleet.minds_used = parcel.minds_used
    fleet.evaluation_log.since = when


# ---- minds


def minds_parcel(minds: Minds) -> MindsState:
    """The table of minds. Programs that robots share are kept once."""
    places: dict[Program, int] = {}
    programs: list[ProgramState] = []

    def place(program: Program, parameters: tuple[str, ...] = ()) -> int:
        if program not in places:
            places[program] = len(programs)
            meanings = {key: _meaning(found) for key, found in program.meanings.items()}
            programs.append(ProgramState(program.text, parameters, meanings))
        return places[program]

    table, following = minds.table
    found = {number: _mind_parcel(mind, place) for number, mind in table.items()}
    return MindsState(list(minds.vocabulary.user_slots), programs, found, following)


def refill(minds: Minds, parcel: MindsState) -> None:
    """Have what that table had. Raises ParcelError."""
    vocabulary = minds.vocabulary
    if len(parcel.user_names) > MAX_USER_VARIABLES:
        raise SerialError(f"{len(parcel.user_names)} names of user variables, at most {MAX_USER_VARIABLES} fit")
    vocabulary.user_slots.clear()
    for key in parcel.user_names:
        vocabulary.user_slot(key)
    programs = [_program(minds, each) for each in parcel.programs]
    found = {number: _mind(each, programs, vocabulary) for number, each in parcel.minds.items()}
    if 0 not in found or min(found) < 0 or max(found) >= parcel.next or parcel.next > np.iinfo(np.int32).max:
        raise SerialError(f"numbers of minds that do not go from 0 to {parcel.next}")
    minds.fill(found, parcel.next)


class _Meanings:
    """The names that a program depended on, for the checker (its `Names`)."""

    def __init__(self, vocabulary: Vocabulary, meanings: Mapping[str, Declared]) -> None:
        self.vocabulary, self._meanings = vocabulary, meanings

    def declared(self, key: str) -> Declared | None:
        return self._meanings.get(key)

    def heard(self) -> Iterable[str]:
        return ()


def _program(minds: Minds, parcel: ProgramState) -> Program:
    meanings = {key: _declared(key, found, minds.vocabulary) for key, found in parcel.meanings.items()}
    names = _Meanings(minds.vocabulary, meanings)
    try:
        return minds.library.program(parcel.text, lambda: read_all(parcel.text), names, parcel.parameters)
    except SleepcastError as error:
        raise SerialError(f"a kept expression cannot be compiled any more: {str(error).splitlines()[0]}") from None


def _mind_parcel(mind: Mind, place: Callable[..., int]) -> MindState:
    rules = [
        RuleState(kept.key, kept.name, place(kept.program), kept.active, kept.protected, kept.priority)
        for kept in mind.rules.values()
    ]
    operators = {}
    for key, program in mind.operators.items():
        found = mind.symbols[key]
        operators[key] = place(program, found.parameters if isinstance(found, Operator) else ())
    return MindState(rules, {key: _meaning(found) for key, found in mind.symbols.items()}, operators)


def _mind(parcel: MindState, programs: list[Program], vocabulary: Vocabulary) -> Mind:
    learned = {key: _declared(key, found, vocabulary) for key, found in parcel.learned.items()}
    rules, operators = {}, {}
    for kept in parcel.rules:
        program = _at(programs, kept.program, 0)
        rules[kept.key] = Rule(kept.key, kept.name, program.text, program, kept.active, kept.protected, kept.priority)
    for key, number in parcel.operators.items():
        found = learned.get(key)
        if not isinstance(found, Operator):
            raise SerialError(f"an operator {key[:80]} without a name")
        operators[key] = _at(programs, number, len(found.parameters))
    return Mind(rules, learned, operators)


def _at(programs: list[Program], number: int, parameters: int) -> Program:
    if not 0 <= number < len(programs) or programs[number].parameters != parameters:
        raise SerialError(f"there is no program {number} of {parameters} parameters")
    return programs[number]


def _meaning(found: Declared) -> SymbolState:
    parameters = found.parameters if isinstance(found, Operator) else ()
    uses = tuple(sorted(found.uses)) if isinstance(found, Stored | Operator) else ()
    return SymbolState(SORTS[type(found)], found.name, parameters, uses)


def _declared(key: str, meaning: SymbolState, vocabulary: Vocabulary) -> Declared:
    if meaning.sort == SORTS[UserVariable]:
        if key not in vocabulary.user_slots:
            raise SerialError(f"a user variable {key[:80]} without a place for its value")
        return UserVariable(meaning.name, vocabulary.user_slots[key])
    if meaning.sort == SORTS[Stored]:
        return Stored(meaning.name, frozenset(meaning.uses))
    if meaning.sort == SORTS[Operator]:
        return Operator(meaning.name, meaning.parameters, frozenset(meaning.uses))
    if meaning.sort == SORTS[Group]:
        return Group(meaning.name)
    raise SerialError(f"{meaning.sort[:80]} is no sort of name")
