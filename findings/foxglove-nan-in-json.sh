#!/bin/sh
# What the Foxglove SDK writes of a reading that is not a number, in a channel whose messages are JSON.
#
# Installs a pinned foxglove-sdk and mcap in a temporary folder and logs a few readings; nothing of sleepcast runs. Needs
# Python with venv, and the network. One would guess that NaN, which JSON has not (RFC 8259, 6), is refused or becomes null.
# As of foxglove-sdk 0.30.3 (Python):
#
#   None             null
#   NaN, infinity    the words NaN and Infinity, without a warning: no JSON, so that a parser that keeps to the standard, as
#                    those of browsers do, refuses the whole message with all its other readings
#
# A sensor without an echo is NaN in many programs of robots. Write None for it. Ends with 1 if that is no longer so.
set -eu
version=0.30.3
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$python" -m venv here
here/bin/pip install --quiet --disable-pip-version-check "foxglove-sdk==$version" mcap==1.6.0 2> pip.log ||
    { cat pip.log >&2; exit 1; }
cat > log.py << 'SCRIPT'
import json

import foxglove
from foxglove import Channel
from mcap.reader import make_reader


def refuse(word):
    raise ValueError(word)


writer = foxglove.open_mcap("readings.mcap")
channel = Channel("/readings", schema={"type": "object", "properties": {"ranges": {"type": "array"}}})
for second, value in enumerate((None, float("nan"), float("inf"))):
    channel.log({"ranges": [1.5, value]}, log_time=second)
writer.close()
with open("readings.mcap", "rb") as stream:
    for _, _, message in make_reader(stream).iter_messages():
        text = message.data.decode()
        try:
            json.loads(text, parse_constant=refuse)
            print(text, "is JSON")
        except ValueError:
            print(text, "is no JSON")
SCRIPT
here/bin/python -W ignore log.py > found
cat > wanted << 'WANTED'
{"ranges": [1.5, null]} is JSON
{"ranges": [1.5, NaN]} is no JSON
{"ranges": [1.5, Infinity]} is no JSON
WANTED
echo "foxglove-sdk $version, $(here/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
