#!/bin/sh
# What the first line is of the files in which MAVProxy saves missions, fences and rally points.
#
# Installs pinned MAVProxy and pymavlink in a temporary folder; a small vehicle made of pymavlink hands out a mission, a
# fence of four corners and two rally points. Nothing of sleepcast runs. Needs Python 3.9 to 3.12 with venv, and the network.
# All three files begin with "QGC WPL 110", after which the first line is home, which is not flown to: so one would guess
# it of all three. As of MAVProxy 1.8.75:
#
#   mission   home, then the waypoints
#   fence     the first corner: a reader that takes it for home makes a triangle of a square, without a word
#   rally     the first rally point
#
# Degrees have six decimals in all of them, 11 cm. Ends with 1 if that is no longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
export HOME="$folder" MAVLINK20=1
"$python" -m venv there
there/bin/pip install --quiet --disable-pip-version-check MAVProxy==1.8.75 pymavlink==2.4.50 setuptools==80.9.0 2> pip.log ||
    { cat pip.log >&2; exit 1; }
cat > saved.py << 'SCRIPT'
"""A rover that hands out its lists, and MAVProxy, which is told to save them."""
import socket
import subprocess
import sys
import time

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as dialect

CORNERS = [(-35.3630001, 149.164), (-35.363, 149.167), (-35.365, 149.167), (-35.365, 149.164)]
LISTS = {  # by the type of the list: command, first parameter, place
    0: [(16, 0, (-35.364, 149.1655)), (16, 0, (-35.3635, 149.165))],
    1: [(5001, 4, corner) for corner in CORNERS],
    2: [(5100, 0, corner) for corner in CORNERS[:2]],
}
REQUESTS = ["MISSION_REQUEST_LIST", "MISSION_REQUEST_INT", "MISSION_REQUEST"]
SAVE = {0: "wp save way.txt", 1: "fence save fence.txt", 2: "rally save rally.txt"}

with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as spare:
    spare.bind(("127.0.0.1", 0))
    port = spare.getsockname()[1]
options = [f"--master=udpin:127.0.0.1:{port}", "--mav20", "--no-state", "--default-modules=wp,fence,rally"]
with open("desk.log", "w") as log:
    desk = subprocess.Popen(
        [sys.executable, "-m", "MAVProxy.mavproxy", *options], stdin=subprocess.PIPE, stdout=log, stderr=log, text=True
    )
try:
    link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{port}", source_system=1, dialect="ardupilotmega")
    able = dialect.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE | dialect.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
    able |= dialect.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    wanted, told, beat, end = 0, 0.0, 0.0, time.monotonic() + 120.0
    while wanted < 3 and time.monotonic() < end:
        now = time.monotonic()
        if now - beat > 0.5:
            beat = now
            link.mav.heartbeat_send(dialect.MAV_TYPE_GROUND_ROVER, dialect.MAV_AUTOPILOT_ARDUPILOTMEGA, 81, 0, 4)
            link.mav.autopilot_version_send(able, 0x04050000, 0, 0, 0, bytes(8), bytes(8), bytes(8), 0, 0, 0)
            if f"to {SAVE[wanted].split()[-1]}" in open("desk.log").read():
                wanted, told = wanted + 1, 0.0
            elif now - told > 10.0 and "online system 1" in open("desk.log").read():
                told = now
                desk.stdin.write(SAVE[wanted] + "\n")
                desk.stdin.flush()
        message = link.recv_match(type=REQUESTS, blocking=True, timeout=0.1)
        if message is None:
            continue
        kind = message.mission_type
        if message.get_type() == "MISSION_REQUEST_LIST":
            link.mav.mission_count_send(255, 0, len(LISTS[kind]), kind)
        else:
            command, first, (latitude, longitude) = LISTS[kind][message.seq]
            at = round(latitude * 1e7), round(longitude * 1e7)
            link.mav.mission_item_int_send(255, 0, message.seq, 0, command, 0, 1, first, 0, 0, 0, *at, 0, kind)
finally:
    desk.kill()
    desk.wait()
SCRIPT
there/bin/python -W ignore saved.py > told 2>&1 || { cat told desk.log >&2; exit 1; }
for file in way fence rally; do
    printf '%s: %s lines, the first is command %s at %s\n' $file $(($(grep -c . $file.txt) - 1)) \
        "$(sed -n 2p $file.txt | cut -f4)" "$(sed -n 2p $file.txt | cut -f9,10 | tr '\t' ' ')"
done > found
cat > wanted << 'WANTED'
way: 2 lines, the first is command 16 at -35.364000 149.165500
fence: 4 lines, the first is command 5001 at -35.363000 149.164000
rally: 2 lines, the first is command 5100 at -35.363000 149.164000
WANTED
echo "MAVProxy 1.8.75, pymavlink 2.4.50"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
