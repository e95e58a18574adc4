#!/bin/sh
# What pymavlink's location() waits for, besides where a vehicle is.
#
# Installs a pinned pymavlink in a temporary folder; a small vehicle made of it tells its place in GPS_RAW_INT and
# GLOBAL_POSITION_INT, and nothing of sleepcast runs. Needs python3 with venv, and the network. One would guess that these
# are enough. As of pymavlink 2.4.50:
#
#   three seconds without VFR_HUD   no answer
#   the first VFR_HUD               an answer; the height and the heading are those of VFR_HUD, the place is GPS_RAW_INT's
#
# A script that begins by asking where the vehicle is needs a vehicle, simulator or bridge that sends VFR_HUD. Ends with 1
# if that is no longer so.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv there
there/bin/pip install --quiet --disable-pip-version-check pymavlink==2.4.50
cat > place.py << 'SCRIPT'
import socket
import threading
import time

from pymavlink import mavutil
from pymavlink.dialects.v20 import common


spare = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
spare.bind(("127.0.0.1", 0))
port = spare.getsockname()[1]
spare.close()
script, places = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}"), []
asking = threading.Thread(target=lambda: places.append(script.location()))
asking.start()
line, vehicle, begun = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), common.MAVLink(None, 1, 1), time.monotonic()
while asking.is_alive():
    messages = [
        vehicle.heartbeat_encode(10, 3, 129, 15, 4),
        vehicle.gps_raw_int_encode(0, 3, 366000000, -1219000000, 5000, 100, 100, 0, 0, 12),
        vehicle.global_position_int_encode(0, 366000000, -1219000000, 5000, 2000, 0, 0, 0, 9000),
    ]
    if time.monotonic() - begun > 3.0:
        messages.append(vehicle.vfr_hud_encode(0.0, 0.0, 90, 0, 7.0, 0.0))
    for message in messages:
        line.sendto(message.pack(vehicle), ("127.0.0.1", port))
    time.sleep(0.1)
(place,) = places
print("answered with the first VFR_HUD" if time.monotonic() - begun > 3.0 else "answered before")
print(f"{place.lat:.4f} {place.lng:.4f} {place.alt:g} m {place.heading}")
SCRIPT
there/bin/python place.py > found
cat > wanted << 'WANTED'
answered with the first VFR_HUD
36.6000 -121.9000 7 m 90
WANTED
echo "pymavlink 2.4.50"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
