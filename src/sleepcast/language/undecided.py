"""Undecided: why somebody who only knows a robot's numbers cannot say what a test would come to on it."""

from __future__ import annotations

CHANCE = "its test depends on chance"
DEED = "its test does something itself"


def asks(name: str) -> str:
    """The test calls one of the robot's own functions."""
    return f"its test asks the robot itself: {name.upper()}"


def does(name: str) -> str:
    """The test enters a buffer, rule or operator that acts."""
    return f"its test evaluates {name}, which does something"


def holds(name: str) -> str:
    """The test enters a buffer, rule or operator of a robot that cannot be asked."""
    return f"its test depends on what the robot holds as {name}"
