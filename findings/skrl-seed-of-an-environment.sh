#!/bin/sh
# With which seed skrl begins an environment that it wraps.
#
# Installs pinned packages in a temporary folder and wraps an environment that notes its seeds; nothing of sleepcast runs. Needs
# Python 3.11 to 3.13 and the network (PyTorch is large). An environment that was reset with a seed goes on in that seed when it is
# reset without one, and one that never had a seed draws one: so says Gymnasium. One would guess that a wrapper resets it
# without one, unless it was told a seed. As of skrl 2.1.1 the first reset has skrl's own key:
#
#   no set_seed     0, whatever the environment was reset with: every training of everybody sees the same episodes
#   set_seed(42)    42
#
# Repeating a training "without a seed" to see how much chance matters shows less of it than there is. Ends with 1 if that is no
# longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$python" -m venv here
here/bin/pip install --quiet --disable-pip-version-check skrl==2.1.1 torch==2.13.0 numpy==2.4.6 gymnasium==1.4.0 2> pip.log ||
    { cat pip.log >&2; exit 1; }
cat > seeds.py << 'SCRIPT'
import logging

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from skrl.envs.wrappers.torch import wrap_env
from skrl.utils import set_seed

logging.disable()


class Noted(gymnasium.Env):
    """Notes the seeds of its resets."""

    observation_space = gymnasium.spaces.Box(0.0, 1.0, (1,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)

    def __init__(self):
        self.seeds = []

    def reset(self, *, seed=None, options=None):
        self.seeds.append(seed)
        return np.zeros(1, np.float32), {}

    def step(self, action):
        return np.zeros(1, np.float32), 0.0, False, False, {}


def told(name, **first):
    copies = SyncVectorEnv([Noted] * 2, autoreset_mode=AutoresetMode.SAME_STEP)
    if first:
        copies.reset(**first)
    wrap_env(copies).reset()
    print(name, [env.unwrapped.seeds for env in copies.envs])


told("no seed")
told("reset(seed=7)", seed=7)
set_seed(42)
told("reset(seed=7), set_seed(42)", seed=7)
SCRIPT
here/bin/python -W ignore seeds.py 2> errors.log | grep seed > found || { cat errors.log >&2; exit 1; }
cat > wanted << 'WANTED'
no seed [[0], [1]]
reset(seed=7) [[7, 0], [8, 1]]
reset(seed=7), set_seed(42) [[7, 42], [8, 43]]
WANTED
echo "skrl 2.1.1, gymnasium 1.4.0, $(here/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
