"""Hoskins' behaviours, (event, action, probability), as SLEEP rules.

    4: ((F, 3, *, *) & (F, S, *, *), PING, 0.9)
    (RULE behaviour1 (WHEN (AND (EQ myCaste 4) pFlag (EQ pBearing FRONT) (EQ pCaste 3) sFlag ...) (PING myCaste)))

What is known of his notation is what a chapter of the thesis tells: an event is a side (F, R), a source (a caste, or S
for the light), a range, and whether it is nearer or farther than that (N, F); events are compounded; a behaviour is an
event, an action and a probability. The brackets and commas are written like that there. `&`, `*` for "whatever", the
caste before a colon, the two actions' names and `;` for remarks are ours (the page of the scenario
braitenberg says so, too).
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterator, Sequence
from math import inf
from typing import NamedTuple

from sleepcast.core.records import dataclass
from sleepcast.core.units import LENGTH, UNITS
from sleepcast.language.reader import Number, ReadError, read

ACTIONS = {"TUMBLE": "(TUMBLE)", "PING": "(PING myCaste)"}
SIDES = {"F": "FRONT", "R": "REAR"}
ZONES = {"N": "<", "F": ">"}
LENGTHS = {"", *(name for name, unit in UNITS.items() if unit.dimension == LENGTH)}
ANY = "*"
MAX_BEHAVIOURS = 1_000
"""Behaviours in one text: more than robots keep rules."""

_TOKEN = re.compile(r"\s+|;[^\n]*|(?P<token>[(),&:*]|[^\s(),&:*;]+)")


class _Token(NamedTuple):
    text: str
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Stimulus:
    """One ping, or the light (source S), with what is asked of it.

    side, source, zone: `ANY` where that does not matter.
    range: as it was written, beside a zone that is not `ANY`.
    """

    side: str
    source: str
    range: str
    zone: str

    def tests(self) -> list[str]:
        """What must hold for it, as SLEEP."""
        sensed = "s" if self.source == "S" else "p"
        tests = [f"{sensed}Flag"]
        if self.side != ANY:
            tests.append(f"(EQ {sensed}Bearing {SIDES[self.side]})")
        if self.source not in (ANY, "S"):
            tests.append(f"(EQ pCaste {self.source})")
        if self.zone != ANY:
            tests.append(f"({ZONES[self.zone]} {sensed}Range {self.range})")
        return tests


@dataclass(frozen=True, slots=True)
class Behaviour:
    """Who does what upon which events, and how likely. caste: "" for everybody; events: none for in every tick."""

    caste: str
    events: tuple[Stimulus, ...]
    action: str
    probability: str

    def rule(self, name: str) -> str:
        """The rule that does it, for all robots: the caste is one of its tests."""
        tests = [f"(EQ myCaste {self.caste})"] if self.caste else []
        tests += [test for event in self.events for test in event.tests()]
        tests.append(f"(PROB {self.probability})")
        test = tests[0] if len(tests) == 1 else f"(AND {' '.join(tests)})"
        return f"(RULE {name} (WHEN {test} {ACTIONS[self.action]}))"


def behaviours(text: str) -> list[Behaviour]:
    """All behaviours of `text`. Raises ReadError with the place of what is none."""
    known = list(_BehaviourReader(text).all())
    if not known:
        raise ReadError("no behaviour @@: wanted one such as ((F, 3, *, *), PING, 0.9)", text, 0, 1)
    return known


def rules(behaviours: Sequence[Behaviour]) -> list[str]:
    """A SLEEP rule for each, named behaviour1, behaviour2 and so on."""
    return [each.rule(f"behaviour{number}") for number, each in enumerate(behaviours, 1)]


class _BehaviourReader:
    """Takes one token after the other. Raises ReadError."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.tokens = [
            _Token(match["token"], match.start(), match.end()) for match in _TOKEN.finditer(text) if match["token"]
        ]
        self.at = 0

    def all(self) -> Iterator[Behaviour]:
        count = 0
        while self.at < len(self.tokens):
            if (count := count + 1) > MAX_BEHAVIOURS:
                raise self.error(self.tokens[self.at], f"more than {MAX_BEHAVIOURS:,} behaviours @@")
            yield self.behaviour()

    def behaviour(self) -> Behaviour:
        caste = ""
        if self.peek() != "(":
            caste = self.caste("a caste such as 4: or a behaviour such as ((F, 3, *, *), PING, 0.9)")
            self.need(":")
        self.need("(")
        events = self.events()
        self.need(",")
        action = self.choice(tuple(ACTIONS), "action")
        self.need(",")
        probability = self.amount("a probability such as 0.9 or 90%", ("", "%"), 1.0)
        self.need(")")
        return Behaviour(caste, events, action, probability)

    def events(self) -> tuple[Stimulus, ...]:
        if self.peek() == ANY:
            self.take()
            return ()
        events = [self.event()]
        while self.peek() == "&":
            joint = self.take()
            events.append(self.event())
            if sum((event.source == "S") == (events[-1].source == "S") for event in events) > 1:
                one = "light" if events[-1].source == "S" else "ping"
                raise self.error(joint, f"a second {one} in one event @@: a tick presents one, so this never holds")
        return tuple(events)

    def event(self) -> Stimulus:
        self.need("(")
        side = self.choice((*SIDES, ANY), "side")
        self.need(",")
        source = self.take().text if self.peek() in ("S", "s", ANY) else self.caste("a caste, S for the light, or *")
        self.need(",")
        start = self.at
        reach = self.take().text if self.peek() == ANY else self.amount("a range such as 6m, or *", LENGTHS, inf)
        self.need(",")
        zone = self.choice((*ZONES, ANY), "zone")
        if (reach == ANY) != (zone == ANY):
            wanted = "a range and N or F, or * and *"
            raise self.error(self.tokens[start], f"{reach} beside {zone} @@ says nothing: wanted {wanted}")
        self.need(")")
        return Stimulus(side, source.upper(), reach, zone)

    # ---- tokens

    def peek(self) -> str:
        return self.tokens[self.at].text if self.at < len(self.tokens) else ""

    def take(self) -> _Token:
        if self.at >= len(self.tokens):
            raise ReadError("the text ends @@ in the middle of a behaviour", self.text, len(self.text), len(self.text))
        self.at += 1
        return self.tokens[self.at - 1]

    def need(self, wanted: str) -> None:
        token = self.take()
        if token.text != wanted:
            raise self.error(token, f"{token.text} @@: wanted {wanted}")

    def choice(self, choices: Sequence[str], what: str) -> str:
        token = self.take()
        if token.text.upper() not in choices:
            raise self.error(token, f"{token.text} @@ is no {what}: wanted {', '.join(choices)}")
        return token.text.upper()

    def caste(self, wanted: str) -> str:
        token = self.take()
        if not re.fullmatch("[0-9]{1,6}", token.text):
            raise self.error(token, f"{token.text} @@: wanted {wanted}")
        return token.text

    def amount(self, wanted: str, units: Container[str], most: float) -> str:
        """A number from 0 to `most`, as it was written, bare or with one of the units."""
        token = self.take()
        try:
            form = read(token.text)
        except ReadError:
            form = None
        if not isinstance(form, Number) or form.unit not in units or not 0.0 <= form.value <= most:
            raise self.error(token, f"{token.text} @@: wanted {wanted}")
        return token.text

    def error(self, token: _Token, reason: str) -> ReadError:
        return ReadError(reason, self.text, token.start, token.end)
