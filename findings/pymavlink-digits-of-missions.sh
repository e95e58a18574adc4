#!/bin/sh
# How exactly pymavlink's mavwp saves the places of a mission as a ".waypoints" file ("QGC WPL 110").
#
# Installs a pinned pymavlink in a temporary folder and saves the same place three ways; nothing of sleepcast runs. Needs
# python3 with venv, and the network. MAVLink has ten-millionths of a degree (a centimetre), and QGroundControl writes
# eight decimals. As of pymavlink 2.4.50:
#
#   read and saved again    six decimals, which is up to 6 cm off to the north and as far to the east
#   MISSION_ITEM_INT        as MAVLink has it, in whole ten-millionths of a degree, where the file has degrees: 366123456.0;
#                           it is read back as such, without a word
#   QGroundControl's .plan  not read: "Unsupported waypoint format"
#
# MISSION_ITEM_INT is what vehicles send today. A program that adds to a loader what it has received must divide first
# (wp_from_mission_item_int does). Ends with 1 if that is no longer so.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv there
there/bin/pip install --quiet --disable-pip-version-check pymavlink==2.4.50
printf 'QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t36.60000000\t-121.90000000\t12.0\t1\n' > ground.waypoints
printf '1\t0\t3\t16\t0\t0\t0\t0\t36.61234564\t-121.91234564\t10.0\t1\n' >> ground.waypoints
printf '{"fileType": "Plan", "version": 1, "groundStation": "QGroundControl", "mission": {"items": [], "version": 2}}' > a.plan
cat > missions.py << 'SCRIPT'
from pymavlink import mavutil, mavwp


def read(file):
    loader = mavwp.MAVWPLoader()
    loader.load(file)
    return loader


again = read("ground.waypoints")
again.save("again.waypoints")
print("saved again", [(each.x, each.y) for each in read("again.waypoints").wpoints][1])
whole = mavwp.MAVWPLoader()
for number in range(2):
    place = (0, 0, 0, 0, 366123456, -1219123456, 10)
    whole.add(mavutil.mavlink.MAVLink_mission_item_int_message(1, 1, number, 3, 16, 0, 1, *place))
whole.save("whole.waypoints")
print("whole numbers", [(each.x, each.y) for each in read("whole.waypoints").wpoints][1])
try:
    read("a.plan")
except mavwp.MAVWPError as error:
    print("plan", str(error)[:27])
SCRIPT
there/bin/python missions.py > found
cat > wanted << 'WANTED'
saved again (36.612346, -121.912346)
whole numbers (366123456.0, -1219123456.0)
plan Unsupported waypoint format
WANTED
echo "pymavlink 2.4.50"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
