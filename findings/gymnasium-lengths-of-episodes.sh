#!/bin/sh
# Which lengths and returns Gymnasium's RecordEpisodeStatistics records of copies that are reset one by one.
#
# Installs a pinned gymnasium in a temporary folder and wraps two copies of an environment, one with episodes of three steps and
# one with episodes of five, a reward of 1 a step; nothing of sleepcast runs. Needs Python 3.10 or newer with venv, and the
# network. One would guess lengths of 3 and 5 whichever way copies are reset. As of Gymnasium 1.4.0:
#
#   NEXT_STEP, SAME_STEP   3 and 5
#   DISABLED               as soon as one copy is reset by a reset_mask, the numbers of all begin anew: also 1 and 2, and the
#                          returns with them
#
# (The vector environment takes the mask out of the options, so that the wrapper, which looks for it afterwards, takes the
# reset for one of everybody.) Whoever compares policies by these numbers compares pieces of episodes. Ends with 1 if that is no
# longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$python" -m venv here
here/bin/pip install --quiet --disable-pip-version-check gymnasium==1.4.0 numpy==2.4.6 2> pip.log || { cat pip.log >&2; exit 1; }
cat > lengths.py << 'SCRIPT'
import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics


class Steps(gymnasium.Env):
    """Ends after so many steps."""

    observation_space = gymnasium.spaces.Box(0.0, 1e9, (1,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)

    def __init__(self, most):
        self.most = most

    def reset(self, *, seed=None, options=None):
        self.steps = 0
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.steps += 1
        return np.zeros(1, np.float32), 1.0, self.steps == self.most, False, {}


for mode in (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP, AutoresetMode.DISABLED):
    copies = SyncVectorEnv([lambda: Steps(3), lambda: Steps(5)], autoreset_mode=mode)
    env = RecordEpisodeStatistics(copies)
    env.reset(seed=1)
    for _ in range(30):
        _, _, ended, cut, _ = env.step(np.zeros((2, 1), np.float32))
        if mode == AutoresetMode.DISABLED and (ended | cut).any():
            env.reset(options={"reset_mask": ended | cut})
    print(mode.name, "lengths", sorted({int(each) for each in env.length_queue}))
SCRIPT
here/bin/python -W ignore lengths.py > found
cat > wanted << 'WANTED'
NEXT_STEP lengths [3, 5]
SAME_STEP lengths [3, 5]
DISABLED lengths [1, 2, 3]
WANTED
echo "gymnasium 1.4.0, $(here/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
