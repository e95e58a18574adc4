#!/bin/sh
# What an agent's position is in Mesa's continuous space: after a step that was refused, and when it is kept for later.
#
# Installs a pinned mesa in a temporary folder; nothing of sleepcast runs. Needs Python 3.12 or newer with venv (PYTHON=...),
# and the network. One would guess that an agent whose step out of the space is refused with a ValueError stays where it was, and
# that `before = agent.position` still says afterwards where it was. As of Mesa 3.5.1 (mesa.experimental.continuous_space)
# the position is a view of the space's own table, which += writes before anything is checked:
#
#   position += step          the error comes, and the agent stands outside; neighbours and queries find it there
#   position = position + s   the error comes, and the agent stays
#   before = position         follows the agent when += moves it: the way it has gone is 0
#
# Whoever takes the error for a wall has agents beyond it. Ends with 1 if that is no longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$python" -m venv here
here/bin/pip install --quiet --disable-pip-version-check mesa==3.5.1 networkx==3.6.1 numpy==2.4.6 pandas==3.1.1 scipy==1.17.1 2> pip.log ||
    { cat pip.log >&2; exit 1; }
cat > moves.py << 'SCRIPT'
import mesa
import numpy as np
from mesa.experimental.continuous_space import ContinuousSpace, ContinuousSpaceAgent

model = mesa.Model(rng=1)
space = ContinuousSpace([[0, 10], [0, 10]], torus=False, random=model.random)
step = np.array([20.0, 0.0])


def made(x):
    agent = ContinuousSpaceAgent(space, model)
    agent.position = [x, 5.0]
    return agent


first, second = made(1.0), made(2.0)
try:
    first.position += step
    print("+=: allowed")
except ValueError:
    near = space.get_agents_in_radius(np.array([21.0, 5.0]), 1.0)[0]
    print("+=: refused, and it stands at", first.position, "and is found there" if first in near else "")
try:
    second.position = second.position + step
    print("= +: allowed")
except ValueError:
    print("= +: refused, and it stands at", second.position)
before = second.position
second.position += step / 10.0
print("moved by 2, before:", before, "after:", second.position)
SCRIPT
here/bin/python -W ignore moves.py > found
cat > wanted << 'WANTED'
+=: refused, and it stands at [21.  5.] and is found there
= +: refused, and it stands at [2. 5.]
moved by 2, before: [4. 5.] after: [4. 5.]
WANTED
echo "mesa 3.5.1, $(here/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
