#!/bin/sh
# Which episodes TorchRL's GymWrapper shows of a Gymnasium vector environment that begins the next one by itself.
#
# Installs pinned packages in a temporary folder and wraps two copies of an environment that observes the number of its
# episode, each three steps long; nothing of sleepcast runs. Needs Python 3.11 to 3.13 and the network (PyTorch is large).
# One would guess that a rollout goes through the episodes in turn: of the two modes that it takes, SAME_STEP begins one in
# the step in which another ends, and DISABLED waits to be told. As of TorchRL 0.14.1 with Gymnasium 1.4.0:
#
#   SAME_STEP    where all copies end in one step, the wrapper resets them once more: every second episode is begun and
#                thrown away, and seeds that follow one another are used up twice as fast
#   DISABLED     all episodes are shown, in turn
#
# Whoever repeats a training from the numbers of its episodes finds others. Ends with 1 if that is no longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$python" -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check torchrl==0.14.1 tensordict==0.14.3 torch==2.13.0 numpy==2.4.6 \
    gymnasium==1.4.0 2> pip.log || { cat pip.log >&2; exit 1; }
cat > episodes.py << 'SCRIPT'
import logging

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from torchrl.envs import GymWrapper, set_gym_backend

logging.disable()


class Numbered(gymnasium.Env):
    """Observes the number of its episode, which is cut off after three steps."""

    observation_space = gymnasium.spaces.Box(0.0, 1e9, (1,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)

    def __init__(self):
        self.episode = 0

    def reset(self, *, seed=None, options=None):
        self.episode, self.steps = self.episode + 1, 0
        return np.array([self.episode], np.float32), {}

    def step(self, action):
        self.steps += 1
        return np.array([self.episode], np.float32), 0.0, False, self.steps == 3, {}


with set_gym_backend("gymnasium"):
    for mode in (AutoresetMode.SAME_STEP, AutoresetMode.DISABLED):
        env = GymWrapper(SyncVectorEnv([Numbered] * 2, autoreset_mode=mode))
        seen = env.rollout(12, break_when_any_done=False)["observation"][0].ravel().int().tolist()
        episodes = list(dict.fromkeys(seen))
        print(mode.name, [number - episodes[0] for number in episodes])
SCRIPT
venv/bin/python -W ignore episodes.py > found
cat > wanted << 'WANTED'
SAME_STEP [0, 2, 4, 6]
DISABLED [0, 1, 2, 3]
WANTED
echo "torchrl 0.14.1, gymnasium 1.4.0, $(venv/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
