#!/bin/sh
# Whether environments of VMAS that were given seeds are independent of each other.
#
# Installs a pinned vmas in a temporary folder and looks where the agents of the scenario "balance" stand after a reset;
# nothing of sleepcast runs. Needs Python 3.11 or newer with venv, and the network (PyTorch is large). One would guess that
# an environment with a seed does the same whatever other environments a program has. As of VMAS 1.5.2 all of them draw from
# one stream of random numbers, which the newest seed sets anew:
#
#   alone               made twice with seed 0, it is reset to the same places
#   beside another      another environment is made between its making and its reset: other places
#   two side by side    of two with seed 0 that are reset in turn, the second one is reset to other places than the first
#
# So an environment for evaluation that is made during a training changes the training. Ends with 1 if that is no longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$python" -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check vmas==1.5.2 torch==2.13.0 numpy==2.4.6 2> pip.log ||
    { cat pip.log >&2; exit 1; }
cat > streams.py << 'SCRIPT'
import torch
import vmas


def made(seed):
    return vmas.make_env("balance", num_envs=1, device="cpu", seed=seed)


def places(env):
    env.reset()
    return torch.stack([agent.state.pos for agent in env.agents]).clone()


def told(name, one, other):
    print(f"{name}:", "the same places" if torch.equal(one, other) else "other places")


alone = places(made(0))
told("alone", alone, places(made(0)))
env = made(0)
made(5)
told("beside another", alone, places(env))
first, second = made(0), made(0)
told("two side by side", places(first), places(second))
SCRIPT
venv/bin/python -W ignore streams.py > found 2> errors.log || { cat errors.log >&2; exit 1; }
cat > wanted << 'WANTED'
alone: the same places
beside another: other places
two side by side: other places
WANTED
echo "vmas 1.5.2, $(venv/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
