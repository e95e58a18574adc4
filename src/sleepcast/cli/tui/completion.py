"""Completion at the terminal desk: the names in the robots' telemetry, each with its value over the fleet."""

from __future__ import annotations

from collections.abc import Iterable

from sleepcast.cli.prompt import WordCompleter, usage_of
from sleepcast.cli.tui.commands import QUESTIONS
from sleepcast.cli.tui.session import TuiSession
from sleepcast.core.units import value_in_words
from sleepcast.language.symbols import Group
from sleepcast.language.vocabulary import Variable, unit_of
from sleepcast.station.remote import RemoteMinds


class SessionNames(WordCompleter):
    """Completes names that the fleet knows now, each with what it is worth, and what the desk can be asked."""

    def __init__(self, session: TuiSession) -> None:
        self._session = session

    def names(self, before: str, word: str) -> Iterable[str]:
        if before == word and word.startswith(":"):
            return [f":{name}" for name in QUESTIONS]
        if before.startswith((":to ", ":why ")):
            return [*self._session.station.roster, *(each.label for each in self._session.addressees() if each.label)]
        return names_of(self._session.telemetry.minds)

    def about(self, name: str) -> str:
        minds = self._session.telemetry.minds
        usage, members, values = usage_of(name), members_of(name, minds), range_of(name, minds)
        if usage:
            return usage
        if members is not None:
            return f"group of {members}"
        unit = unit_of(name, minds.vocabulary)
        return " to ".join(value_in_words(value, unit) for value in values or ())


def names_of(minds: RemoteMinds) -> list[str]:
    """Every name that a text may use."""
    return sorted({*minds.vocabulary.names(), *minds.heard()}, key=str.casefold)


def range_of(name: str, minds: RemoteMinds) -> tuple[float, float] | None:
    """The least and the greatest value of a variable over the fleet; None if no telemetry has one."""
    binding = minds.vocabulary.bindings.get(name.casefold())
    if not isinstance(binding, Variable):
        return None
    values = [value for mind in minds.values() if (value := mind.values[binding.slot]) == value]
    return (min(values), max(values)) if values else None


def members_of(name: str, minds: RemoteMinds) -> int | None:
    """How many robots are in a group; None if it is none."""
    if not isinstance(minds.declared(name.casefold()), Group):
        return None
    return sum(name.casefold() in mind.groups for mind in minds.values())
