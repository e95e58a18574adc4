#!/bin/sh
# In which directions the beams of an ir-sim lidar look that goes all around.
#
# Installs a pinned ir-sim in a temporary folder and puts a robot with four beams on 360 degrees into a room; nothing of
# sleepcast runs. Needs Python with venv, and the network. One would guess that four beams look ahead, to the left, back
# and to the right, 90 degrees apart. As of ir-sim 2.12.0:
#
#   four beams     at -180, -60, 60 and 180 degrees, 120 degrees apart: the first and the last look the same way, none looks
#                  ahead, and the walls in front and at the sides are missed
#   eight beams    seven directions, 51 degrees apart
#
# Whoever divides the circle by the number of beams gives every reading but the first a wrong bearing, the more the fewer
# beams there are. Ends with 1 if that is no longer so.
set -eu
version=2.12.0
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
export HOME="$folder" MPLBACKEND=Agg
"$python" -m venv here
here/bin/pip install --quiet --disable-pip-version-check "ir-sim==$version" 2> pip.log || { cat pip.log >&2; exit 1; }
cat > room.yaml << 'ROOM'
world: {height: 10, width: 10, step_time: 0.1}
robot:
  - kinematics: {name: diff}
    shape: {name: circle, radius: 0.2}
    state: [5, 5, 0]
    goal: [8, 5, 0]
    sensors: [{type: lidar2d, range_min: 0, range_max: 20, angle_range: 6.283185307179586, number: BEAMS, noise: false}]
obstacle:
  - {shape: {name: rectangle, length: 0.2, width: 10}, state: [9, 5, 0]}
  - {shape: {name: rectangle, length: 0.2, width: 10}, state: [2, 5, 0]}
  - {shape: {name: rectangle, length: 10, width: 0.2}, state: [5, 8, 0]}
  - {shape: {name: rectangle, length: 10, width: 0.2}, state: [5, 4, 0]}
ROOM
cat > look.py << 'SCRIPT'
import sys
from math import degrees

import irsim

world = irsim.make("room.yaml", display=False)
scan = world.get_lidar_scan()
print(
    "ahead 3.9, left 2.9, back 2.9, right 0.9 m:",
    *(f"{distance:.2f}" for distance in scan["ranges"]),
    f"({degrees(scan['angle_increment']):.0f} degrees apart)",
)
SCRIPT
cp room.yaml room.in
for beams in 4 8; do
    sed "s/BEAMS/$beams/" room.in > room.yaml
    here/bin/python -W ignore look.py 2> errors.log | grep '^ahead' || { cat errors.log >&2; exit 1; }
done > found
cat > wanted << 'WANTED'
ahead 3.9, left 2.9, back 2.9, right 0.9 m: 2.90 1.04 3.35 2.90 (120 degrees apart)
ahead 3.9, left 2.9, back 2.9, right 0.9 m: 2.90 1.15 0.92 2.07 4.33 2.97 3.71 2.90 (51 degrees apart)
WANTED
echo "ir-sim $version, $(here/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
