#!/bin/sh
# What Gymnasium's vector environments leave of options={"reset_mask": ...}, by which only some copies are reset.
#
# Installs pinned packages in a temporary folder and resets three copies of CartPole-v1 twice with the same options, which
# name the first copy; nothing of sleepcast runs. Needs Python 3.11 to 3.13 and the network. As of Gymnasium 1.4.0, for
# SyncVectorEnv and AsyncVectorEnv alike:
#
#   first reset     the first copy begins an episode; the mask has been taken out of the caller's dictionary
#   second reset    all three copies begin one, silently, since nothing is left in the dictionary
#
# A training loop that keeps its options in a variable so throws away the episodes of all copies but one. It must make the
# dictionary anew for each reset. Ends with 1 if that is no longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$python" -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check gymnasium==1.4.0 numpy==2.4.6 2> pip.log ||
    { cat pip.log >&2; exit 1; }
cat > masks.py << 'SCRIPT'
import gymnasium
import numpy as np
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv


def make():
    return gymnasium.make("CartPole-v1")


if __name__ == "__main__":
    for kind in (SyncVectorEnv, AsyncVectorEnv):
        copies = kind([make] * 3, autoreset_mode=AutoresetMode.DISABLED)
        before, _ = copies.reset(seed=1)
        before = before.copy()
        options = {"reset_mask": np.array([True, False, False])}
        for _ in range(2):
            after, _ = copies.reset(options=options)
            print(kind.__name__, *(before != after).any(axis=1), sorted(options))
            before = after.copy()
        copies.close()
SCRIPT
venv/bin/python masks.py > found
cat > wanted << 'WANTED'
SyncVectorEnv True False False []
SyncVectorEnv True True True []
AsyncVectorEnv True False False []
AsyncVectorEnv True True True []
WANTED
echo "gymnasium 1.4.0, $(venv/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
