"""The loop owns time: of a simulated swarm, which can be put away between two ticks, to go on later; and of a mind with
a real body."""

from sleepcast.loop.crew import Crew, Member
from sleepcast.loop.real import Watch, run_robot, step_robot
from sleepcast.loop.snapshots import SnapshotError, load, resume, save, snapshot
from sleepcast.loop.swarm import LONGEST_CATCH_UP, MAX_MINDS, Desk, Pace, Swarm, Witness, step_swarm, vocabulary_of

__all__ = [
    "LONGEST_CATCH_UP",
    "MAX_MINDS",
    "Crew",
    "Desk",
    "Member",
    "Pace",
    "SnapshotError",
    "Swarm",
    "Watch",
    "Witness",
    "load",
    "resume",
    "run_robot",
    "save",
    "snapshot",
    "step_robot",
    "step_swarm",
    "vocabulary_of",
]
