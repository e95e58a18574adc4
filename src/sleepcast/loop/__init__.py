"""The loop owns the time of a simulated swarm; between two ticks a swarm can be put away, to go on later."""

from sleepcast.loop.snapshots import SnapshotError, load, resume, save, snapshot
from sleepcast.loop.swarm import LONGEST_CATCH_UP, MAX_MINDS, Desk, Pace, Swarm, Witness, step_swarm, vocabulary_of

__all__ = [
    "LONGEST_CATCH_UP",
    "MAX_MINDS",
    "Desk",
    "Pace",
    "SnapshotError",
    "Swarm",
    "Witness",
    "load",
    "resume",
    "save",
    "snapshot",
    "step_swarm",
    "vocabulary_of",
]
