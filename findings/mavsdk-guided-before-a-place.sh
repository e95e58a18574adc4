#!/bin/sh
# What MAVSDK sends to an ArduPilot rover for kill() and the goto_location() after it.
#
# Installs pinned mavsdk and pymavlink in a temporary folder; a small vehicle made of pymavlink notes the commands that
# come, and accepts them all. Nothing of sleepcast runs. Needs python3 with venv, and the network. One would guess that
# goto_location() is one command, DO_REPOSITION. As of mavsdk 4.1.0:
#
#   kill            COMPONENT_ARM_DISARM with 0 and 21196
#   goto_location   DO_SET_MODE with GUIDED (15) unless the vehicle shows it already, then DO_REPOSITION: a vehicle that
#                   takes the mode for "go on" is free again though its motors were killed
#   hold            DO_SET_MODE with HOLD (4)
#
# Ends with 1 if that is no longer so.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv there
there/bin/pip install --quiet --disable-pip-version-check mavsdk==4.1.0 pymavlink==2.4.50
cat > vehicle.py << 'SCRIPT'
"""A rover that tells where it is, accepts every command, and prints those that matter here."""
import socket
import sys
import time
from contextlib import suppress

from pymavlink.dialects.v20 import ardupilotmega as dialect

NAMES = {400: "arm-disarm", 176: "mode", 192: "place"}
line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
line.connect(("127.0.0.1", int(sys.argv[1])))
line.settimeout(0.05)
mav = dialect.MAVLink(None, 1, 1)
mav.robust_parsing = True
beat, state = 0.0, (129, 15)
while True:
    if time.monotonic() - beat > 0.2:
        beat = time.monotonic()
        with suppress(ConnectionRefusedError):  # the program is not there yet
            line.send(mav.heartbeat_encode(10, 3, *state, 4).pack(mav))
            line.send(mav.global_position_int_encode(0, 366000000, -1219000000, 0, 0, 0, 0, 0, 0).pack(mav))
    try:
        data = line.recv(2048)
    except (TimeoutError, ConnectionRefusedError):
        continue
    for message in mav.parse_buffer(bytearray(data)) or ():
        if message.get_type() not in ("COMMAND_LONG", "COMMAND_INT"):
            continue
        line.send(mav.command_ack_encode(message.command, 0).pack(mav))
        if message.command == 400:  # as a rover shows that stands in HOLD with its motors off
            state, beat = (1, 4), 0.0
        if message.command in NAMES:
            numbers = {400: f" {message.param1:g} {message.param2:g}", 176: f" {message.param2:g}"}.get(message.command, "")
            print(f"{NAMES[message.command]}{numbers}", flush=True)
SCRIPT
cat > program.py << 'SCRIPT'
import sys
import time

from mavsdk.mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action
from mavsdk.plugins.telemetry import Telemetry

sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
sdk.add_any_connection(f"udpin://127.0.0.1:{sys.argv[1]}")
system = sdk.first_autopilot(30.0)
action, telemetry = Action(system), Telemetry(system)
while not telemetry.armed():  # nor does it know before the first heartbeat
    time.sleep(0.05)
action.kill()
while telemetry.armed():
    time.sleep(0.05)
action.goto_location(36.6003, -121.8996, 0.0, 0.0)
action.hold()
SCRIPT
port=$(python3 -c 'import socket; s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
there/bin/python vehicle.py "$port" > found &
vehicle=$!
there/bin/python program.py "$port" > program.log 2>&1 || { cat program.log >&2; kill $vehicle; exit 1; }
kill $vehicle
cat > wanted << 'WANTED'
arm-disarm 0 21196
mode 15
place
mode 4
WANTED
echo "mavsdk 4.1.0"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
