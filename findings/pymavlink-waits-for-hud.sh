#!/bin/sh
# What pymavlink's location() waits for, besides where a vehicle is.
#
# Installs a pinned pymavlink in a temporary folder; a small vehicle made of it tells its place in every message that
# MAVLink has for that, and nothing of sleepcast runs. Needs python3 with venv, and the network. One would guess that
# GPS_RAW_INT and GLOBAL_POSITION_INT are enough. As of pymavlink 2.4.50:
#
#   without VFR_HUD   location() does not return, and has no limit of its own: neither an error nor a line says why
#   with VFR_HUD      at once; the height and the heading are those of VFR_HUD, the place is that of GPS_RAW_INT
#
# A script that begins by asking where the vehicle is stands still in front of every vehicle, simulator or bridge that sends
# no VFR_HUD. Ends with 1 if that is no longer so.
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


def answered(hud):
    """What location() gives within five seconds of such a vehicle."""
    spare = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    spare.bind(("127.0.0.1", 0))
    port = spare.getsockname()[1]
    spare.close()
    script, places = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}"), []
    asking = threading.Thread(target=lambda: places.append(script.location()), daemon=True)
    asking.start()
    line, vehicle = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), common.MAVLink(None, 1, 1)
    line.connect(("127.0.0.1", port))
    end = time.monotonic() + 5.0
    while asking.is_alive() and time.monotonic() < end:
        messages = [
            vehicle.heartbeat_encode(10, 3, 129, 15, 4),
            vehicle.gps_raw_int_encode(0, 3, 366000000, -1219000000, 5000, 100, 100, 0, 0, 12),
            vehicle.global_position_int_encode(0, 366000000, -1219000000, 5000, 2000, 0, 0, 0, 9000),
        ]
        if hud:
            messages.append(vehicle.vfr_hud_encode(0.0, 0.0, 90, 0, 7.0, 0.0))
        for message in messages:
            line.send(message.pack(vehicle))
        time.sleep(0.1)
    return f"{places[0].lat:.4f} {places[0].lng:.4f} {places[0].alt:g} {places[0].heading}" if places else "nothing"


for hud in (False, True):
    print("with VFR_HUD" if hud else "without", answered(hud), flush=True)
SCRIPT
there/bin/python place.py > found
cat > wanted << 'WANTED'
without nothing
with VFR_HUD 36.6000 -121.9000 7 90
WANTED
echo "pymavlink 2.4.50"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
