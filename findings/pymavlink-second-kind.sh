#!/bin/sh
# What pymavlink finds in an ArduPilot DataFlash log when a program asks for one kind of message after another.
#
# Installs a pinned pymavlink in a temporary folder and lets it read a small log with places (POS), attitudes (ATT) and a
# mode, in turn; nothing of sleepcast runs. Needs python3 with venv, and the network. One would guess that
# recv_match(type=...) gives the next message of that kind. As of pymavlink 2.4.50:
#
#   POS, then ATT        the first POS, and None, as at the end of a log, although attitudes follow
#   POS and ATT at once  both, in turn; then each alone, but no other kind
#   after rewind()       the kinds that are asked for first anew
#
# The kinds of the first call stay those of all later ones. A program that looks for the take-off and then for what followed
# finds nothing, without an error, and may take the flight for over. Ends with 1 if that is no longer so.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv there
there/bin/pip install --quiet --disable-pip-version-check pymavlink==2.4.50
cat > log.py << 'SCRIPT'
import struct

from pymavlink import mavutil

HEAD = b"\xa3\x95"
KINDS = {  # number, format, layout, columns
    "FMT": (128, "BBnNZ", "BB4s16s64s", "Type,Length,Name,Format,Columns"),
    "POS": (130, "QLLf", "Qiif", "TimeUS,Lat,Lng,Alt"),
    "ATT": (131, "Qccc", "Qhhh", "TimeUS,Roll,Pitch,Yaw"),
    "RATE": (132, "Qf", "Qf", "TimeUS,R"),
}


def message(kind, *values):
    return HEAD + struct.pack(f"<B{KINDS[kind][2]}", KINDS[kind][0], *values)


log = b""
for name, (number, format, layout, columns) in KINDS.items():
    length = 3 + struct.calcsize(f"<{layout}")
    log += message("FMT", number, length, name.encode(), format.encode(), columns.encode())
for second in range(1, 4):
    log += message("POS", second * 1_000_000, 366_000_000, -1_219_000_000, 10.0)
    log += message("ATT", second * 1_000_000 + 1, 100, 200, 9_000)
    log += message("RATE", second * 1_000_000 + 2, 0.5)
open("small.bin", "wb").write(log)


def asked(reader, *kinds):
    found = [reader.recv_match(type=kind) for kind in kinds]
    return " ".join(f"{each.get_type()}:{each.TimeUS}" if each else "None" for each in found)


reader = mavutil.mavlink_connection("small.bin")
print(asked(reader, "POS", "ATT", "POS", "RATE"))
reader.rewind()
print("rewound", asked(reader, "ATT", "ATT", "POS"))
reader.rewind()
print("both", asked(reader, ["POS", "ATT"], "ATT", "POS", "RATE"))
SCRIPT
there/bin/python log.py > found
cat > wanted << 'WANTED'
POS:1000000 None None None
rewound ATT:1000001 ATT:2000001 None
both POS:1000000 ATT:1000001 POS:2000000 None
WANTED
echo "pymavlink 2.4.50"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
