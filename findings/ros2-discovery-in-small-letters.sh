#!/bin/sh
# Where ROS 2 looks for other programs, by what the environment says and how it spells it.
#
# Installs a pinned rclpy (ROS 2 Jazzy) in a temporary folder and starts a node in several environments; nothing of
# sleepcast runs. Needs Python 3.11 on Linux x86-64, and the network. One would guess that a value in small letters is
# taken, or that one which is none leaves the usual range, SUBNET; and that a variable of earlier releases gives way. As of
# rclpy 7.1.6 with rcl 9.2.8:
#
#   ROS_AUTOMATIC_DISCOVERY_RANGE=subnet    this computer alone, with one warning
#   ROS_LOCALHOST_ONLY=1                    this computer alone, whatever the newer variable says, with a warning
#
# Robots on other computers are then not found, by programs whose warnings nobody reads, such as those that a launch file
# starts. Ends with 1 if that is no longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$python" -m venv there
there/bin/pip install --quiet --disable-pip-version-check --pre \
    ros-jazzy-rclpy==7.1.6 ros-rcl==9.2.8 ros-jazzy-rmw-fastrtps-cpp==8.4.3 2> pip.log || { cat pip.log >&2; exit 1; }
unset ROS_LOCALHOST_ONLY ROS_AUTOMATIC_DISCOVERY_RANGE
said() { # what a node in this environment warns of
    env "$@" there/bin/python -c 'import rclpy; rclpy.init(); rclpy.create_node("alone")' > node.log 2>&1 ||
        { cat node.log >&2; exit 1; }
    echo "$*: $(grep -o -e 'assuming localhost only' -e "'localhost_only' is enabled" node.log || echo nothing)"
}
{
    said ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET
    said ROS_AUTOMATIC_DISCOVERY_RANGE=subnet
    said ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
    said ROS_LOCALHOST_ONLY=1 ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET
} > found
cat > wanted << 'WANTED'
ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET: nothing
ROS_AUTOMATIC_DISCOVERY_RANGE=subnet: assuming localhost only
ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST: nothing
ROS_LOCALHOST_ONLY=1 ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET: 'localhost_only' is enabled
WANTED
echo "rclpy 7.1.6, rcl 9.2.8, $(there/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
