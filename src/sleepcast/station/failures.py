"""Rules that robots have deactivated because of their faults, by what the robots themselves reported."""

from __future__ import annotations

from collections.abc import Mapping

from sleepcast.channel.message import MAX_NAME, RULE

MOST_RULES = 256
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
        if key not in self.robots and len(self.robots) >= MOST_RULES:
            return
        self.names[key] = name
        self.robots.setdefault(key, {})[place] = now
