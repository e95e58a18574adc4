"""The loop: the ticks of a simulated swarm, of minds with real bodies, and of a network swarm; snapshots."""

from importlib import import_module
from typing import TYPE_CHECKING

from sleepcast.loop.snapshots import SnapshotError, load, resume, save, snapshot
from sleepcast.loop.swarm import LONGEST_CATCH_UP, MAX_MINDS, Desk, Pace, Swarm, Witness, step_swarm, vocabulary_of

if TYPE_CHECKING:
    from sleepcast.loop.real import EmbodiedMind, Member, NetworkSwarm, TickTiming, run_robots

_IN_REAL_TIME = frozenset({"EmbodiedMind", "Member", "NetworkSwarm", "TickTiming", "run_robots"})
"""These need nodes and real channels: a simulated swarm starts without importing them."""

__all__ = [
    "LONGEST_CATCH_UP",
    "MAX_MINDS",
    "Desk",
    "EmbodiedMind",
    "Member",
    "NetworkSwarm",
    "Pace",
    "SnapshotError",
    "Swarm",
    "TickTiming",
    "Witness",
    "load",
    "resume",
    "run_robots",
    "save",
    "snapshot",
    "step_swarm",
    "vocabulary_of",
]


def __getattr__(name: str) -> object:
    if name not in _IN_REAL_TIME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.real"), name)
