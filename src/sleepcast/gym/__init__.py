"""Reinforcement learning: a fleet as an environment of PettingZoo or Gymnasium, on arrays of all robots.

    import sleepcast.gym

    env = sleepcast.gym.parallel_env("bravo", observations=["x", "y", "(DIST x y vessel_x vessel_y)"],
                                     reward="(- (DIST x y vessel_x vessel_y))")

Needs the libraries of the extra `gym`.

task        what robots observe, do and are paid for          parallel    PettingZoo: an agent for each robot
episode     one run of a task, step by step, on arrays;       vector      Gymnasium: one policy for all robots at once
            one after the other, by seed and number
"""

from __future__ import annotations

from sleepcast.core.errors import MisuseError
from sleepcast.core.extras import installing

try:
    from sleepcast.gym.parallel import RobotAgents, parallel_env
    from sleepcast.gym.vector import RobotVector, vector_env
except ModuleNotFoundError as error:
    library = (error.name or "").partition(".")[0]
    if library not in ("gymnasium", "pettingzoo"):
        raise
    raise MisuseError(f"sleepcast.gym needs {library}; to install it: {installing('gym')}") from error

__all__ = ["RobotAgents", "RobotVector", "parallel_env", "vector_env"]
