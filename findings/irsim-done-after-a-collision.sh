#!/bin/sh
# When an ir-sim world says that it is done.
#
# Installs a pinned ir-sim in a temporary folder and sends two robots to their goals, one of them through a wall; nothing of
# sleepcast runs. Needs Python with venv, and the network. One would guess that done() is true once all robots have arrived, as its
# name for all of them ("all") says. As of ir-sim 2.12.0:
#
#   done()    true as soon as each robot has arrived or collided: with one at its goal, and one at the wall, which never gets there
#
# Who counts done() as success counts crashes as arrivals; each robot's arrive tells them apart. Ends with 1 if that is no
# longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
export HOME="$folder" MPLBACKEND=Agg
"$python" -m venv here
here/bin/pip install --quiet --disable-pip-version-check ir-sim==2.12.0 2> pip.log || { cat pip.log >&2; exit 1; }
cat > wall.yaml << 'WORLD'
world: {height: 10, width: 10, step_time: 0.1, collision_mode: stop}
robot:
  - {kinematics: {name: diff}, shape: {name: circle, radius: 0.2}, state: [1, 5, 0], goal: [9, 5, 0], behavior: {name: dash}}
  - {kinematics: {name: diff}, shape: {name: circle, radius: 0.2}, state: [1, 8, 0], goal: [3, 8, 0], behavior: {name: dash}}
obstacle:
  - {shape: {name: rectangle, length: 0.2, width: 1}, state: [5, 5, 0]}
WORLD
cat > wall.py << 'SCRIPT'
import irsim

world = irsim.make("wall.yaml", display=False)
for _ in range(400):
    world.step()
    if world.done():
        break
for robot in world.robot_list:
    print("arrived" if robot.arrive else "not arrived,", "" if robot.arrive else f"{9 - robot.state[0, 0]:.1f} m to go")
print("done:", world.done())
SCRIPT
here/bin/python -W ignore wall.py 2> errors.log | grep -E '^(arrived|not arrived|done)' | sed 's/ *$//' > found || { cat errors.log >&2; exit 1; }
cat > wanted << 'WANTED'
not arrived, 4.3 m to go
arrived
done: True
WANTED
echo "ir-sim 2.12.0, $(here/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
