"""Rules that robots have deactivated because of their faults, by what the robots themselves reported."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from sleepcast.channel.message import MAX_NAME, RULE

if TYPE_CHECKING:
    from sleepcast.station.remote import RemoteMind

MAX_RULES = 256
"""Rules that are remembered: as many as a robot has; of further ones nothing is known."""


class RuleFailures:
    """names: of the rules as reported, by their keys. robots: by key, the places of those that reported it, each with
    the time (s of the desk's clock) at which it last did."""

    def __init__(self) -> None:
        self.names: dict[str, str] = {}
        self.robots: dict[str, dict[int, float]] = {}

    def hear(self, place: int, report: Mapping[str, object], now: float) -> None:
        """Take in a report of the robot at a place, which may be about anything."""
        name = report.get(RULE)
        if not isinstance(name, str) or not 0 < len(name) <= MAX_NAME:
            return
        key = name.casefold()
        if key not in self.robots and len(self.robots) >= MAX_RULES:
            return
        self.names[key] = name
        self.robots.setdefault(key, {})[place] = now

    def forget(self, places: Iterable[int]) -> None:
        """What robots at these places have reported does not count any more."""
        for reported in self.robots.values():
            for place in places:
                reported.pop(place, None)

    def left(self, robots: Sequence[str], minds: Mapping[str, RemoteMind]) -> Iterator[tuple[str, list[int]]]:
        """The key of each rule that is still deactivated on any robot, and their places, ascending.

        robots: their names by place
        minds: what their telemetry says, which ends it where it is of later and says so
        """
        for key, reported in self.robots.items():
            there = [place for place, heard in reported.items() if _holds(minds.get(robots[place]), key, heard)]
            if there:
                yield key, sorted(there)


def _holds(mind: RemoteMind | None, key: str, heard: float) -> bool:
    """Whether a robot has still the rule that it reported at a time, and does not run it."""
    if mind is None or mind.learned is None or mind.reported_at <= heard:
        return True
    return any(rule.name.casefold() == key and not rule.active for rule in mind.rules())
