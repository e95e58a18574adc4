#!/bin/sh
# What SuperSuit's concat_vec_envs_v1 tells a trainer of an episode that was cut off by its time limit.
#
# Installs pinned packages in a temporary folder and steps two agents whose episode ends after three steps, truncated and
# not terminated; nothing of sleepcast runs. Needs Python 3.11 or 3.12 and the network. As of SuperSuit 3.11.0:
#
#   the environment gives no information    the last observation is told ("terminal_observation"), but not that the
#                                           episode was cut off ("TimeLimit.truncated")
#   it gives that key itself                both are told
#
# With base_class="stable_baselines3" there is one flag for both kinds of end, so this key is all that a trainer hears.
# Stable-Baselines3 2.9.2 adds the worth of the last state only where it is set: in PPO's buffer (gamma 0.9, a value of
# about 10) the last reward of 1 became 9.5 with that library's own DummyVecEnv, and stayed 1 with SuperSuit's. Ends with 1
# if that is no longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$python" -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check supersuit==3.11.0 pettingzoo==1.27.0 gymnasium==1.4.0 2> pip.log ||
    { cat pip.log >&2; exit 1; }
cat > cut.py << 'SCRIPT'
import numpy as np
import supersuit
from gymnasium.spaces import Box
from pettingzoo import ParallelEnv

PAIR = ("one", "two")


class Steps(ParallelEnv):
    """Two agents observe how many steps the episode has had; the third one cuts it off."""

    metadata = {"name": "steps"}
    render_mode = None
    possible_agents = list(PAIR)

    def __init__(self, tells):
        self.tells = tells

    def observation_space(self, agent):
        return Box(0.0, 9.0, (1,), np.float64)

    action_space = observation_space

    def reset(self, seed=None, options=None):
        self.agents, self.steps = list(PAIR), 0
        return self.seen(), {agent: {} for agent in PAIR}

    def seen(self):
        return {agent: np.array([self.steps], np.float64) for agent in PAIR}

    def step(self, actions):
        self.steps += 1
        cut = self.steps == 3
        if cut:
            self.agents = []
        told = {"TimeLimit.truncated": True} if cut and self.tells else {}
        return self.seen(), dict.fromkeys(PAIR, 1.0), dict.fromkeys(PAIR, False), dict.fromkeys(PAIR, cut), {
            agent: dict(told) for agent in PAIR
        }


for tells in (False, True):
    copies = supersuit.concat_vec_envs_v1(supersuit.pettingzoo_env_to_vec_env_v1(Steps(tells)), 1, num_cpus=1)
    copies.reset()
    for _ in range(3):
        _, _, terminated, truncated, told = copies.step(np.zeros((2, 1)))
    print(terminated.astype(int), truncated.astype(int), sorted(told[0]))
SCRIPT
venv/bin/python cut.py > found
cat > wanted << 'WANTED'
[0 0] [1 1] ['terminal_observation']
[0 0] [1 1] ['TimeLimit.truncated', 'terminal_observation']
WANTED
echo "supersuit 3.11.0, $(venv/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
