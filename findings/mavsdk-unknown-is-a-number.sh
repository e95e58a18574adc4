#!/bin/sh
# What MAVSDK makes of values that a vehicle says it does not know.
#
# Installs pinned mavsdk and pymavlink in a temporary folder; a small vehicle made of pymavlink sends what MAVLink has for
# "unknown": 65535 for a voltage and for an HDOP, 255 for satellites, -1 for what is left in a battery. Nothing of
# sleepcast runs. Needs python3 with venv, and the network. One would guess NaN, which MAVSDK makes of an unknown current in
# the same messages. As of mavsdk 4.1.0:
#
#   SYS_STATUS       65.535 V, and -1 % left
#   BATTERY_STATUS   0 V, and -1 % left
#   GPS_RAW_INT      255 satellites, and an HDOP of 655.35
#
# A program that lands below a voltage, or waits for satellites, decides by numbers that nobody has measured. Ends with 1
# if that is no longer so.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv there
there/bin/pip install --quiet --disable-pip-version-check mavsdk==4.1.0 pymavlink==2.4.50
cat > vehicle.py << 'SCRIPT'
"""A rover that knows its place and nothing else; it tells of its battery by the message that is named."""
import socket
import sys
import time

from pymavlink.dialects.v20 import common

line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
mav, unknown = common.MAVLink(None, 1, 1), 65535
while True:
    messages = [
        mav.heartbeat_encode(10, 3, 129, 15, 4),
        mav.gps_raw_int_encode(0, 3, 366000000, -1219000000, 0, unknown, unknown, unknown, unknown, 255),
    ]
    if sys.argv[2] == "SYS_STATUS":
        messages.append(mav.sys_status_encode(0, 0, 0, 0, unknown, -1, -1, 0, 0, 0, 0, 0, 0))
    else:
        messages.append(mav.battery_status_encode(0, 0, 0, 32767, [unknown] * 10, -1, -1, -1, -1))
    for message in messages:
        line.sendto(message.pack(mav), ("127.0.0.1", int(sys.argv[1])))
    time.sleep(0.1)
SCRIPT
cat > program.py << 'SCRIPT'
import sys
import time

from mavsdk.mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.telemetry import Telemetry

sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
sdk.add_any_connection(f"udpin://127.0.0.1:{sys.argv[1]}")
telemetry = Telemetry(sdk.first_autopilot(30.0))
end = time.monotonic() + 30.0
while time.monotonic() < end and not (telemetry.gps_info().num_satellites and telemetry.battery().remaining_percent < 0):
    time.sleep(0.1)
battery, raw = telemetry.battery(), telemetry.raw_gps()
battery = f"{battery.voltage_v:.3f} V, {battery.remaining_percent:g} %, {battery.current_battery_a:g} A"
print(f"found {sys.argv[2]}: {battery}; {telemetry.gps_info().num_satellites} satellites, {raw.hdop:.2f}")
SCRIPT
for message in SYS_STATUS BATTERY_STATUS; do
    port=$(python3 -c 'import socket; s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
    there/bin/python vehicle.py "$port" "$message" &
    vehicle=$!
    there/bin/python program.py "$port" "$message" > program.log 2>&1 || { cat program.log >&2; kill $vehicle; exit 1; }
    kill $vehicle
    sed -n 's/^found //p' program.log >> found
done
cat > wanted << 'WANTED'
SYS_STATUS: 65.535 V, -1 %, nan A; 255 satellites, 655.35
BATTERY_STATUS: 0.000 V, -1 %, nan A; 255 satellites, 655.35
WANTED
echo "mavsdk 4.1.0"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
