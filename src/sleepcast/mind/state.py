"""State: what robots have learned, as plain data for stores and snapshots.

Programs are stored as texts and compiled again. A store holds one robot (`MindState`): its texts are compiled with
the names that it has when it is restored. A snapshot holds all robots of a run (`SharedMinds`), which must continue
bit for bit: each program is stored with the meanings that its names had when it was compiled.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated

import msgspec

from sleepcast.core.errors import SleepcastError
from sleepcast.core.serial import SerialError
from sleepcast.language.functions import MAX_PRIORITY
from sleepcast.language.program import Library, Program
from sleepcast.language.reader import read_all
from sleepcast.language.symbols import KIND_NAMES, Declared, Group, Operator, Stored, UserVariable
from sleepcast.language.vocabulary import Vocabulary
from sleepcast.mind.instants import WaitingCommand
from sleepcast.mind.merging import MergingState

RuleRank = Annotated[int, msgspec.Meta(ge=-MAX_PRIORITY, le=MAX_PRIORITY)]
"""See `Rule.rank`. Stores and snapshots of 0.2.0 have none."""


class OperatorState(msgspec.Struct, frozen=True, array_like=True):
    """An operator made by DEFUN."""

    name: str
    parameters: tuple[str, ...]
    text: str


# ---- one robot, in a store


class RuleState(msgspec.Struct, frozen=True, array_like=True):
    """A rule or buffer: its name as written. left: remaining s of its lease, None without one. rank: see `Rule`."""

    name: str
    text: str
    active: bool
    left: float | None
    rank: RuleRank = 0


class MindState(msgspec.Struct, frozen=True):
    """One robot: the names it has learned with their values and texts, the groups it is in, its rules, whether it is
    stopped, who has leases of its groups, and which command has changed what; nothing that is built in.

    flags: values of the support variables from `marked` to `active63`.
    proven: the rules that ROLLBACK restores.
    ticks: for how many the present rules have run without a fault, None if one has failed.
    authority: see `Authority.state`.
    doubt: see `Node`.
    endings: texts that end what it is a member of by BEST or QUORUM, which a restart ends.
    waiting: commands that wait for their instants, their times in s of Unix time.
    """

    stopped: bool
    authority: dict[str, object]
    flags: tuple[float, ...]
    variables: dict[str, float]
    known: tuple[str, ...]
    groups: tuple[str, ...]
    operators: tuple[OperatorState, ...]
    rules: tuple[RuleState, ...]
    proven: tuple[RuleState, ...]
    ticks: int | None
    merging: MergingState = MergingState()
    doubt: str = ""
    endings: tuple[str, ...] = ()
    waiting: tuple[WaitingCommand, ...] = ()


# ---- all robots, in a snapshot


class SymbolState(msgspec.Struct, array_like=True):
    """The meaning of a learned name. kind: one of `KIND_NAMES`."""

    kind: str
    name: str
    parameters: tuple[str, ...] = ()
    uses: tuple[str, ...] = ()

    @classmethod
    def of(cls, declared: Declared) -> SymbolState:
        parameters = declared.parameters if isinstance(declared, Operator) else ()
        uses = tuple(sorted(declared.uses)) if isinstance(declared, Stored | Operator) else ()
        return cls(KIND_NAMES[type(declared)], declared.name, parameters, uses)

    def made(self, key: str, vocabulary: Vocabulary) -> Declared:
        """The declaration of the name `key`. Raises SerialError."""
        if self.kind == KIND_NAMES[UserVariable]:
            if key not in vocabulary.user_slots:
                raise SerialError(f"a user variable {key[:80]} without a place for its value")
            return UserVariable(self.name, vocabulary.user_slots[key])
        if self.kind == KIND_NAMES[Stored]:
            return Stored(self.name, frozenset(self.uses))
        if self.kind == KIND_NAMES[Operator]:
            return Operator(self.name, self.parameters, frozenset(self.uses))
        if self.kind == KIND_NAMES[Group]:
            return Group(self.name)
        raise SerialError(f"{self.kind[:80]} is no kind of name")


class ProgramState(msgspec.Struct, array_like=True):
    """A program: its text and parameters, and the meanings of its free names when it was compiled."""

    text: str
    parameters: tuple[str, ...]
    meanings: dict[str, SymbolState]

    @classmethod
    def of(cls, program: Program, parameters: tuple[str, ...]) -> ProgramState:
        return cls(
            program.text, parameters, {key: SymbolState.of(meaning) for key, meaning in program.meanings.items()}
        )

    def made(self, vocabulary: Vocabulary, library: Library) -> Program:
        """The program compiled again. Raises SerialError."""
        names = _Meanings(vocabulary, {key: each.made(key, vocabulary) for key, each in self.meanings.items()})
        try:
            return library.program(self.text, lambda: read_all(self.text), names, self.parameters)
        except SleepcastError as error:
            raise SerialError(
                f"a stored expression cannot be compiled any more: {str(error).splitlines()[0]}"
            ) from None


class SharedRule(msgspec.Struct, array_like=True):
    """A rule or buffer. program: its index among the programs."""

    key: str
    name: str
    program: int
    active: bool
    protected: bool
    priority: int
    rank: RuleRank = 0


class SharedMind(msgspec.Struct, array_like=True):
    """What some robots have learned alike. operators: by key, the indices of their programs."""

    rules: list[SharedRule]
    symbols: dict[str, SymbolState]
    operators: dict[str, int]


class SharedMinds(msgspec.Struct):
    """The table of minds by number. user_names: the keys of user variables in the order of their slots."""

    user_names: list[str]
    programs: list[ProgramState]
    minds: dict[int, SharedMind]
    next: int


class _Meanings:
    """The names that a program depended on, for the checker (its `Names`)."""

    def __init__(self, vocabulary: Vocabulary, meanings: Mapping[str, Declared]) -> None:
        self.vocabulary, self._meanings = vocabulary, meanings

    def declared(self, key: str) -> Declared | None:
        return self._meanings.get(key)

    def heard(self) -> Iterable[str]:
        return ()
