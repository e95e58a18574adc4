#!/bin/sh
# What rosbags writes for an array whose numbers are of another type than the message's.
#
# Installs pinned rosbags in a temporary folder and serializes a LaserScan; nothing of sleepcast runs. Needs python3 with venv, and
# the network. ranges is float32[]; one would guess that other numbers are converted, or refused, as float64 is ("lvalue and
# rvalue have different structures"). As of rosbags 0.11.9, what has four bytes a number is written bit by bit:
#
#   float64           refused
#   int32             1, 2, 3 become 1e-45, 3e-45, 4e-45
#   big-endian        1, 2, 3 become 4.6e-41, 9e-44, 2.3e-41
#
# A bag of whole millimetres, or of what came from a network, reads as a scan of walls in front of the lens. Ends with 1 if
# that is no longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$python" -m venv here
here/bin/pip install --quiet --disable-pip-version-check rosbags==0.11.9 numpy==2.4.6 2> pip.log || { cat pip.log >&2; exit 1; }
cat > scan.py << 'SCRIPT'
import numpy as np
from rosbags.typesys import Stores, get_typestore

KIND = "sensor_msgs/msg/LaserScan"
store = get_typestore(Stores.ROS2_JAZZY)
Scan, Header, Time = (store.types[each] for each in (KIND, "std_msgs/msg/Header", "builtin_interfaces/msg/Time"))


def read_back(ranges):
    scan = Scan(
        header=Header(stamp=Time(sec=0, nanosec=0), frame_id="laser"),
        angle_min=0.0,
        angle_max=1.0,
        angle_increment=0.5,
        time_increment=0.0,
        scan_time=0.0,
        range_min=0.0,
        range_max=9.0,
        ranges=ranges,
        intensities=np.zeros(0, np.float32),
    )
    return store.deserialize_cdr(store.serialize_cdr(scan, KIND), KIND).ranges


for dtype in ("<f4", "<f8", "<i4", ">f4"):
    try:
        print(dtype, *(f"{each:.1g}" for each in read_back(np.array([1, 2, 3], dtype))))
    except ValueError:
        print(dtype, "refused")
SCRIPT
here/bin/python scan.py > found
cat > wanted << 'WANTED'
<f4 1 2 3
<f8 refused
<i4 1e-45 3e-45 4e-45
>f4 5e-41 9e-44 2e-41
WANTED
echo "rosbags 0.11.9, $(here/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
