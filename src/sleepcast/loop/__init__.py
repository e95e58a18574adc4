"""The loop: the ticks of a simulated swarm, of minds with real bodies, and of a network swarm; snapshots."""

from importlib import import_module
from typing import TYPE_CHECKING

from sleepcast.loop.swarm import LONGEST_CATCH_UP, MAX_MINDS, Desk, Pace, Swarm, Witness, step_swarm, vocabulary_of

if TYPE_CHECKING:
    from sleepcast.loop.real import EmbodiedMind, Member, NetworkSwarm, TickTiming, run_robots
    from sleepcast.loop.snapshots import SnapshotError, load, resume, save, snapshot

_LATER = dict.fromkeys(("EmbodiedMind", "Member", "NetworkSwarm", "TickTiming", "run_robots"), "real") | dict.fromkeys(
    ("SnapshotError", "load", "resume", "save", "snapshot"), "snapshots"
)
"""The modules of what a simulated swarm starts without: nodes with real channels, and what is done with snapshots."""

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
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_LATER[name]}"), name)
