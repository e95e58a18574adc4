#!/bin/sh
# What MAVSDK sends for arm_force(), beside arm(), disarm() and kill().
#
# Installs pinned mavsdk and pymavlink in a temporary folder; a small vehicle made of pymavlink notes the commands that
# come, and accepts them all, once as ArduPilot and once as PX4. Nothing of sleepcast runs. Needs python3 with venv, and
# the network. One would guess COMPONENT_ARM_DISARM with 1 (arm) and 21196 (by force). As of mavsdk 4.1.0:
#
#   arm_force   0 and 21196: disarm by force, which is what kill() sends; the program gets a success
#   kill        0 and 21196
#
# A program that arms by force switches the motors off instead, in the air as well. Ends with 1 if that is no longer so.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv there
there/bin/pip install --quiet --disable-pip-version-check mavsdk==4.1.0 pymavlink==2.4.50
cat > commands.py << 'SCRIPT'
"""A copter of this autopilot and a program that commands it, in one process; prints what came for each call."""
import socket
import sys
import threading
import time

from mavsdk.mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action
from pymavlink.dialects.v20 import common

spare = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
spare.bind(("127.0.0.1", 0))
port = spare.getsockname()[1]
spare.close()
came = []


def vehicle():
    line, mav, beat = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), common.MAVLink(None, 1, 1), 0.0
    mav.robust_parsing = True
    line.bind(("127.0.0.1", 0))
    line.settimeout(0.05)
    while True:
        if time.monotonic() - beat > 0.2:
            beat = time.monotonic()
            line.sendto(mav.heartbeat_encode(2, int(sys.argv[1]), 81, 4, 4).pack(mav), ("127.0.0.1", port))
        try:
            data, sender = line.recvfrom(2048)
        except OSError:
            continue
        for message in mav.parse_buffer(bytearray(data)) or ():
            if message.get_type() in ("COMMAND_LONG", "COMMAND_INT"):
                if message.command == 400:
                    came.append(f"{message.param1:g} {message.param2:g}".replace("nan", "0"))
                line.sendto(mav.command_ack_encode(message.command, 0).pack(mav), sender)


threading.Thread(target=vehicle, daemon=True).start()
sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
sdk.add_any_connection(f"udpin://127.0.0.1:{port}")
action = Action(sdk.first_autopilot(30.0))
for call in ("arm", "disarm", "kill", "arm_force"):
    getattr(action, call)()
    print("found", call, *came, flush=True)
    came.clear()
SCRIPT
for autopilot in 3 12; do
    there/bin/python commands.py $autopilot > program.log 2>&1 || { cat program.log >&2; exit 1; }
    sed -n 's/^found //p' program.log >> found
done
cat > wanted << 'WANTED'
arm 1 0
disarm 0 0
kill 0 21196
arm_force 0 21196
arm 1 0
disarm 0 0
kill 0 21196
arm_force 0 21196
WANTED
echo "mavsdk 4.1.0"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
