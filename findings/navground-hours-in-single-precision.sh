#!/bin/sh
# What time it is in a navground world after an hour of steps of 0.1 s.
#
# Installs a pinned navground in a temporary folder and lets an empty world run 36,000 steps; nothing of sleepcast runs. Needs
# python3 with venv, and the network. One would guess 3600 s, to within the rounding of doubles. As of the wheels of
# navground 0.7.0, which are built for single precision:
#
#   a minute   60.000 s
#   an hour    3601.16 s after 36,000 steps, which are counted right
#   a day      twelve minutes ahead
#
# Whoever compares a long run with another simulator's by the world's time, or ends runs by it, ends them elsewhere: count
# steps. Ends with 1 if that is no longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$python" -m venv here
here/bin/pip install --quiet --disable-pip-version-check navground==0.7.0 numpy==2.4.6 2> pip.log || { cat pip.log >&2; exit 1; }
cat > hours.py << 'SCRIPT'
from navground import sim

world = sim.World()
done = 0
for steps in (600, 36_000, 864_000):
    world.run(steps - done, 0.1)
    done = steps
    print(f"{world.step} steps: {world.time:.2f} s")
SCRIPT
here/bin/python hours.py > found
cat > wanted << 'WANTED'
600 steps: 60.00 s
36000 steps: 3601.16 s
864000 steps: 87145.84 s
WANTED
echo "navground 0.7.0, $(here/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
