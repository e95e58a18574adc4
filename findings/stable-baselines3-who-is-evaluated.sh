#!/bin/sh
# Whose episodes Stable-Baselines3's evaluate_policy takes, if a vector environment has more rows than episodes are asked for.
#
# Installs pinned packages in a temporary folder and evaluates on sixteen environments, each of which pays its own number; nothing of
# sleepcast runs. Needs Python 3.11 to 3.13 and the network (PyTorch is large). Where robots are rows, and the rows of a world stand
# together, one would guess that five episodes are taken from here and there, or are those that end first. As of
# Stable-Baselines3 2.9.2:
#
#   5 episodes    of the last five rows alone: of eight worlds of twenty robots, five robots of the last world
#   16 episodes   one of each row
#
# EvalCallback asks for five unless told otherwise, and picks the best model by them. Ends with 1 if that is no longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$python" -m venv here
here/bin/pip install --quiet --disable-pip-version-check stable-baselines3==2.9.2 torch==2.13.0 numpy==2.4.6 gymnasium==1.4.0 \
    2> pip.log || { cat pip.log >&2; exit 1; }
cat > rows.py << 'SCRIPT'
import inspect

import gymnasium
import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import EvalCallback
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import DummyVecEnv


class Pays(gymnasium.Env):
    """An episode of one step, which pays the environment's number."""

    observation_space = gymnasium.spaces.Box(0.0, 1.0, (1,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)

    def __init__(self, number):
        self.number = number

    def reset(self, *, seed=None, options=None):
        return np.zeros(1, np.float32), {}

    def step(self, action):
        return np.zeros(1, np.float32), float(self.number), True, False, {}


rows = DummyVecEnv([lambda number=number: Pays(number) for number in range(16)])
policy = PPO("MlpPolicy", rows, n_steps=8, batch_size=8)
for episodes in (5, 16):
    paid, _ = evaluate_policy(policy, rows, n_eval_episodes=episodes, return_episode_rewards=True, warn=False)
    print(episodes, "episodes: rows", *(int(each) for each in paid))
print("EvalCallback:", inspect.signature(EvalCallback).parameters["n_eval_episodes"].default)
SCRIPT
here/bin/python -W ignore rows.py > found
cat > wanted << 'WANTED'
5 episodes: rows 11 12 13 14 15
16 episodes: rows 0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15
EvalCallback: 5
WANTED
echo "stable-baselines3 2.9.2, $(here/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
