"""What robots with one name answer: an answer counts when each of them has given it.

`channel.name_conflicts` decides which robots have one name. This says what follows for the account of a command:

silent    while one of the robots with a name has not answered, the name has not, whatever the others said. That stays
          so when the conflict is over because that robot is not heard any more: it may still drive
one name  if all have answered the same, the name has answered that; if they differ, the name has a fault that says so
restart   while it is undecided whether a new epoch is a restart, both are waited for; then the answer counts as it came
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator

import msgspec
import numpy as np

from sleepcast.channel import Kind
from sleepcast.channel.message import Message
from sleepcast.channel.name_conflicts import Holder, NameConflicts, sentences
from sleepcast.columns.values import Mask
from sleepcast.core.units import value_in_words
from sleepcast.station.roster import Index, Roster
from sleepcast.station.sent import Answer, Command, Outcome, SentCommands
from sleepcast.station.validation import DoubtError

RECENT = 60.0
"""Seconds after which a command's account is not looked at again for robots that turn out to have one name; the last
STOP or RELEASE always is."""
MAX_SHARED = 65_536
"""Names with several robots, for all commands together, whose answers are kept apart; beyond, the oldest."""


SHARED = "several robots have this name"
"""Why nobody can say whether a name would obey."""


class HolderAnswers(msgspec.Struct):
    """What the robots of one name answered to one command, by epoch. needed: those that must answer."""

    answers: dict[int, Answer] = msgspec.field(default_factory=dict)
    needed: dict[int, Holder] = msgspec.field(default_factory=dict)


class ContestedNames:
    """The answers of names with several robots, at one desk. Times are s of the desk's clock.

    conflicts: who has which name
    sent, roster: the desk's own
    """

    def __init__(self, conflicts: NameConflicts, sent: SentCommands, roster: Roster) -> None:
        self._conflicts, self._sent, self._roster = conflicts, sent, roster
        self._shared: OrderedDict[tuple[str, str], HolderAnswers] = OrderedDict()
        """By the id of the command, and the name."""
        self._told: dict[str, str] = {}
        """The latest sentence about each name that had several robots."""

    def places(self, now: float) -> Index:
        """The places of the names that several robots have, ascending."""
        places = (self._roster.names.index_of(name) for name in self._conflicts.contested(now))
        return np.array(sorted(place for place in places if place is not None), np.intp)

    def is_several(self, name: str, now: float) -> bool:
        """Whether several robots have a name, or may have it."""
        holders = self._conflicts.holders(name, now)
        return any(each.contested for each in holders) or self._conflicts.is_undecided(name, now)

    def is_plain(self, robots: Index, now: float) -> Mask:
        """Which of the robots at these places speak for their names by their telemetry: a name has one robot, and had
        one since the last STOP or RELEASE."""
        latch = "" if self._sent.latch is None else self._sent.latch.id
        names = [self._roster.names[place] for place in robots.tolist()]
        several = [(latch, name) in self._shared or self.is_several(name, now) for name in names]
        return ~np.array(several, np.bool_)

    def begin(self, command: Command, now: float) -> None:
        """A command has been sent: those that have one name must all answer."""
        for name in self._conflicts.contested(now):
            self._review(command, name, now)

    def take(self, command: Command, place: int, message: Message, answer: Answer) -> None:
        """What a robot answers."""
        name, now = message.sender, answer.heard
        if command.is_look or not ((command.id, name) in self._shared or self._conflicts.holders(name, now)):
            command.answers.add(place, answer)
            return
        by_holder = self._open(command, place, name, now)
        by_holder.answers.setdefault(message.epoch, answer)
        self._settle(command, place, name, by_holder, now)

    def review(self, now: float) -> dict[str, str]:
        """Count again where robots of one name turned up, or one of them turned out to have restarted; gives the names
        of which it has come out that several robots have them, each with a sentence."""
        names = self._conflicts.changed(now)
        for command in self._recent(now) if names else ():
            for name in names:
                self._review(command, name, now)
        contested = self._conflicts.contested(now) if names else {}
        told = {name: sentences({name: contested[name]})[0] for name in names if name in contested}
        news = {name: text for name, text in told.items() if self._known(name) and self._told.get(name) != text}
        self._told.update(news)
        return news

    def sentences(self, now: float, places: Index | None = None) -> list[str]:
        """Which names several robots have, of those at these places (None: all), for a person."""
        contested, shared = self._conflicts.contested(now), self.places(now)
        meant = shared if places is None else np.intersect1d(shared, places)
        names = [self._roster.names[place] for place in meant.tolist()]
        return sentences({name: contested[name] for name in names if name in contested})

    def validate(self, places: Index | None, now: float) -> None:
        """A command to robots of which several have one name is hardly meant. places: those for whom it is, None for
        all. Raises DoubtError."""
        if sentences := self.sentences(now, places):
            why = f"{'; '.join(sentences)}: each of them decides by itself, and none answers for the others"
            raise DoubtError(why, f"warning: {why}")

    def _known(self, name: str) -> bool:
        return self._roster.names.index_of(name) is not None

    def is_over(self, command: Command, now: float) -> bool:
        """Whether only robots of shared names are missing whose conflict is over: they are not heard any more."""
        silent = [self._roster.names[place] for place in np.flatnonzero(command.silent).tolist()]
        ended = command.conflicts.keys() - self._conflicts.contested(now).keys()
        return bool(silent) and not command.n_nameless and set(silent) <= ended

    def _recent(self, now: float) -> Iterator[Command]:
        latch = self._sent.latch
        if latch is not None:
            yield latch
        for command in reversed(self._sent.all()):
            if command.message.issued < now - RECENT:
                return
            if command is not latch:
                yield command

    def _review(self, command: Command, name: str, now: float) -> None:
        place = self._roster.names.index_of(name)
        if place is None or command.is_look or not _is_for(command, place):
            return
        if (command.id, name) in self._shared or self._conflicts.holders(name, now):
            self._settle(command, place, name, self._open(command, place, name, now), now)

    def _open(self, command: Command, place: int, name: str, now: float) -> HolderAnswers:
        by_holder = self._shared.get((command.id, name))
        if by_holder is None:
            by_holder = self._shared[command.id, name] = HolderAnswers()
            if len(self._shared) > MAX_SHARED:
                self._shared.popitem(last=False)
            before = command.answers.get(name)  # of the robot that was heard before there was another one
            holders = self._conflicts.holders(name, now)
            if before is not None and holders:
                by_holder.answers[holders[0].epoch] = before
        return by_holder

    def _settle(self, command: Command, place: int, name: str, by_holder: HolderAnswers, now: float) -> None:
        """Count the answer of a name, or count it as silent."""
        holders = self._conflicts.holders(name, now)
        by_holder.needed.update((each.epoch, each) for each in holders if each.contested)
        undecided = self._conflicts.is_undecided(name, now)
        waited = {*by_holder.needed} | {each.epoch for each in holders if undecided}
        command.answers.forget(place)
        if by_holder.answers and waited <= by_holder.answers.keys():
            answers = {epoch: by_holder.answers[epoch] for epoch in (waited or by_holder.answers)}
            command.answers.add(place, _merged(command, answers, by_holder.needed))
        if by_holder.needed:
            command.conflicts[name] = _told(name, by_holder)


def _is_for(command: Command, place: int) -> bool:
    """Whether a command is for the robots at a place."""
    return command.only is None or place in command.only


def _merged(command: Command, answers: dict[int, Answer], needed: dict[int, Holder]) -> Answer:
    """The answer of a name whose robots have all answered."""
    epochs, listed = sorted(answers), [answers[epoch] for epoch in sorted(answers)]
    last = max(listed, key=lambda each: each.heard)
    if len(needed) < 2:  # a robot that has restarted: what it said first
        return min(listed, key=lambda each: each.heard)
    alike = {each.outcome for each in listed}
    if command.kind is Kind.ASK and len({each.value for each in listed}) > 1:
        said = [f"{needed[epoch]} answers {_value(answers[epoch])}" for epoch in epochs]
    elif len(alike) > 1:
        said = [f"{needed[epoch]}: {answers[epoch].outcome}" for epoch in epochs]
    else:
        return Answer(last.outcome, last.heard, last.value, last.fault)
    return Answer(Outcome.FAULT, last.heard, None, f"{len(listed)} robots have this name: {', '.join(said)}")


def _value(answer: Answer) -> str:
    return "unknown" if answer.value is None else value_in_words(answer.value, "")


def _told(name: str, by_holder: HolderAnswers) -> str:
    """Who has a name, and who of them has not answered."""
    said = [
        f"{each} has {'' if epoch in by_holder.answers else 'not '}answered"
        for epoch, each in sorted(by_holder.needed.items())
    ]
    return f"{len(said)} robots have the name {name}: {', '.join(said)}"
