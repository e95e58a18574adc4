"""Roles: what the owner of a key may do, wherever no key is at hand."""

from __future__ import annotations

from enum import StrEnum


class Role(StrEnum):
    """What the owner of a key may do. Anybody with a role may send STOP."""

    OBSERVER = "observer"
    """Ask, and nothing else."""
    OPERATOR = "operator"
    """Command."""
    COMMANDER = "commander"
    """Command, and say whom to trust."""
    ROBOT = "robot"
    """Answer, report, tell other robots, and hand on what others have missed."""
