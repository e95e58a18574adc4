#!/bin/sh
# To which nodes of ROS 2 a file of parameters applies, by what stands above them.
#
# Installs a pinned rclpy (ROS 2 Jazzy) in a temporary folder and starts a node called twist_mux in three namespaces, with
# a file that gives it the lock of an emergency stop; nothing of sleepcast runs. Needs Python 3.11 on Linux x86-64, and the
# network. One would guess that a name alone stands for the node of that name wherever it is. As of rclpy 7.1.6:
#
#   twist_mux:              the node without a namespace alone; in a robot's namespace it has no lock, without a word
#   /**: twist_mux:         all three
#   /**/twist_mux:          all three
#   timeout: 3              a whole number, which a node that declares a number with a point refuses; 3.0 is one
#
# Whoever puts a robot that was tried alone into the namespace of a fleet loses its parameters so, safety locks among them.
# Ends with 1 if that is no longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$python" -m venv there
there/bin/pip install --quiet --disable-pip-version-check --pre \
    ros-jazzy-rclpy==7.1.6 ros-jazzy-rmw-fastrtps-cpp==8.4.3 2> pip.log ||
    { cat pip.log >&2; exit 1; }
lock='locks: {emergency: {topic: stop, timeout: 3, priority: 255}}'
printf 'twist_mux:\n  ros__parameters:\n    %s\n' "$lock" > name.yaml
printf '/**:\n  twist_mux:\n    ros__parameters:\n      %s\n' "$lock" > below.yaml
printf '/**/twist_mux:\n  ros__parameters:\n    %s\n' "$lock" > anywhere.yaml
cat > node.py << 'SCRIPT'
import sys

import rclpy
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.node import Node

kind = sys.argv[1]
rclpy.init(args=["--ros-args", "--params-file", f"{kind}.yaml"])
for namespace in ("/", "/scout1", "/fleet/scout1"):
    node = Node("twist_mux", namespace=namespace, automatically_declare_parameters_from_overrides=True)
    print(kind, namespace, "lock" if node.has_parameter("locks.emergency.topic") else "nothing")
if kind == "anywhere":
    node = Node("twist_mux")
    try:
        node.declare_parameter("locks.emergency.timeout", 0.0)
    except InvalidParameterTypeException:
        print("timeout refused")
SCRIPT
for kind in name below anywhere; do
    there/bin/python node.py $kind >> found 2> node.log || { cat node.log >&2; exit 1; }
done
cat > wanted << 'WANTED'
name / lock
name /scout1 nothing
name /fleet/scout1 nothing
below / lock
below /scout1 lock
below /fleet/scout1 lock
anywhere / lock
anywhere /scout1 lock
anywhere /fleet/scout1 lock
timeout refused
WANTED
echo "rclpy 7.1.6, $(there/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
