#!/bin/sh
# Which seeds SuperSuit's concat_vec_envs_v1 gives to the copies of an environment, by the number of processes.
#
# Installs pinned packages in a temporary folder and wraps an environment that observes the seed it was reset with;
# nothing of sleepcast runs. Needs Python 3.11 or 3.12 and the network. As of SuperSuit 3.11.0, for eight copies and
# reset(seed=100):
#
#   one process       100 to 107, one for each copy
#   two processes     100 to 103 and 101 to 104: the copies of each process are numbered on from the process's number, so
#                     three pairs of copies have one seed, and run the same episodes if these depend on it alone
#   four processes    four seeds fewer than copies
#
# Ends with 1 if that is no longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$python" -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check supersuit==3.11.0 pettingzoo==1.27.0 gymnasium==1.4.0 2> pip.log ||
    { cat pip.log >&2; exit 1; }
cat > seeds.py << 'SCRIPT'
import numpy as np
import supersuit
from gymnasium.spaces import Box
from pettingzoo import ParallelEnv


class Seed(ParallelEnv):
    """Its one agent observes the seed of the last reset."""

    metadata = {"name": "seed"}
    render_mode = None
    possible_agents = ["agent"]

    def observation_space(self, agent):
        return Box(0.0, 1e9, (1,), np.float64)

    action_space = observation_space

    def reset(self, seed=None, options=None):
        self.agents = ["agent"]
        return {"agent": np.array([seed], np.float64)}, {"agent": {}}

    def step(self, actions):
        return {"agent": np.zeros(1)}, {"agent": 0.0}, {"agent": False}, {"agent": False}, {"agent": {}}


if __name__ == "__main__":
    for processes in (1, 2, 4):
        copies = supersuit.concat_vec_envs_v1(
            supersuit.pettingzoo_env_to_vec_env_v1(Seed()), 8, num_cpus=processes
        )
        seeds, _ = copies.reset(seed=100)
        print(processes, *seeds[:, 0].astype(int))
        copies.close()
SCRIPT
venv/bin/python seeds.py > found
cat > wanted << 'WANTED'
1 100 101 102 103 104 105 106 107
2 100 101 102 103 101 102 103 104
4 100 101 101 102 102 103 103 104
WANTED
echo "supersuit 3.11.0, $(venv/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
