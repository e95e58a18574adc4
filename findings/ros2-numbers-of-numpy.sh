#!/bin/sh
# What rclpy sends for numbers and truths that numpy has made.
#
# Installs a pinned rclpy (ROS 2 Jazzy) in a temporary folder, and serializes and reads messages whose fields are given numbers of
# Python and of numpy; nothing of sleepcast runs. Needs Python 3.11 on Linux x86-64, and the network. A float32 of numpy is
# a number, and has just the four bytes of a Float32, so one would guess that it arrives, or is refused. As of rclpy 7.1.6,
# unless ROS_PYTHON_CHECK_FIELDS=1 is set:
#
#   Bool         numpy.bool_(True), as a comparison of numpy's numbers gives it, is False
#   Float32      numpy.float32(0.5) is 0
#   Twist        numpy.float32(0.5) is 5.2e-315, in the place of a velocity
#   Int32        numpy.int64 is right; 2**40 is 0
#   BatteryState numpy.float32(0.8) is 0
#
# A program that says stop = distance < 0.3 with a distance of numpy's says False for ever. Ends with 1 if that is no longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$python" -m venv there
there/bin/pip install --quiet --disable-pip-version-check --pre \
    ros-jazzy-rclpy==7.1.6 ros-jazzy-rmw-fastrtps-cpp==8.4.3 ros-jazzy-geometry-msgs==5.3.6 ros-jazzy-sensor-msgs==5.3.6 \
    ros-jazzy-std-msgs==5.3.6 numpy==2.4.6 2> pip.log || { cat pip.log >&2; exit 1; }
cat > messages.py << 'SCRIPT'
import numpy as np
from geometry_msgs.msg import Vector3
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool, Float32, Int32

CASES = [
    (Bool, "data", np.float64(0.2) < 0.3),
    (Bool, "data", bool(np.float64(0.2) < 0.3)),
    (Float32, "data", np.float32(0.5)),
    (Float32, "data", 0.5),
    (Vector3, "x", np.float32(0.5)),
    (Vector3, "x", 0.5),
    (BatteryState, "percentage", np.float32(0.75)),
    (Int32, "data", np.int64(3)),
    (Int32, "data", 2**40),
]
for kind, field, value in CASES:
    message = kind()
    try:
        setattr(message, field, value)
        read = getattr(deserialize_message(serialize_message(message), kind), field)
    except AssertionError:
        read = "refused"
    print(kind.__name__, "of", "numpy's" if isinstance(value, np.generic) else "Python's", value, "is", read)
SCRIPT
there/bin/python messages.py > found
echo "checked:" >> found
ROS_PYTHON_CHECK_FIELDS=1 there/bin/python messages.py | grep -c refused >> found
cat > wanted << 'WANTED'
Bool of numpy's True is False
Bool of Python's True is True
Float32 of numpy's 0.5 is 0.0
Float32 of Python's 0.5 is 0.5
Vector3 of numpy's 0.5 is 5.222099017e-315
Vector3 of Python's 0.5 is 0.5
BatteryState of numpy's 0.75 is 0.0
Int32 of numpy's 3 is 3
Int32 of Python's 1099511627776 is 0
checked:
6
WANTED
echo "rclpy 7.1.6, numpy 2.4.6, $(there/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
