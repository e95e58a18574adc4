"""The words of a scenario's robots."""

from __future__ import annotations

from functools import cache

from sleepcast.loop import vocabulary_of
from sleepcast.sentences import Lexicon
from sleepcast.simulator import Simulator, find_scenario


@cache
def lexicon_of(scenario: str) -> Lexicon:
    found = find_scenario(scenario)
    simulator = Simulator(found)
    numbers = {name: number for number, name in enumerate(simulator.names, 1)}
    titles = {place.name: place.title for place in found.named_points}
    return Lexicon(vocabulary_of(simulator.model), f"{found.robots.type}s", titles, numbers.get)
