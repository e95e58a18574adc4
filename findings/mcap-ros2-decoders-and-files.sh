#!/bin/sh
# What a decoder factory of mcap-ros2-support makes of a second file.
#
# Installs pinned mcap and mcap-ros2-support in a temporary folder and reads two files, in which the fields of a message stand in
# another order; nothing of sleepcast runs. Needs python3 with venv, and the network. A factory is handed the schema with every
# message, so one would guess that it decodes each by its own. As of mcap-ros2-support 0.6.0 it keeps decoders by the number of
# the schema, which is 1 in nearly every file:
#
#   the second file, with the factory of the first   x and y are exchanged, without an error
#   with a factory of its own                        x = 1, y = 2
#
# A program that reads the bags of a campaign, some older, gets wrong values. Ends with 1 if that is no longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$python" -m venv here
here/bin/pip install --quiet --disable-pip-version-check mcap==1.6.0 mcap-ros2-support==0.6.0 2> pip.log || { cat pip.log >&2; exit 1; }
cat > files.py << 'SCRIPT'
import io
import struct

from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory


def written(definition, *numbers):
    stream = io.BytesIO()
    writer = Writer(stream)
    writer.start("ros2")
    schema = writer.register_schema("demo/msg/Place", "ros2msg", definition.encode())
    channel = writer.register_channel("/place", "cdr", schema)
    writer.add_message(channel, 1, b"\0\1\0\0" + struct.pack("<dd", *numbers), 1)
    writer.finish()
    return stream


def read(stream, factory):
    stream.seek(0)
    for _, _, _, place in make_reader(stream, decoder_factories=[factory]).iter_decoded_messages():
        return f"x = {place.x:g}, y = {place.y:g}"


older, newer = written("float64 x\nfloat64 y\n", 1.0, 2.0), written("float64 y\nfloat64 x\n", 2.0, 1.0)
factory = DecoderFactory()
print("first:", read(older, factory))
print("second, the same factory:", read(newer, factory))
print("second, its own factory:", read(newer, DecoderFactory()))
SCRIPT
here/bin/python files.py > found
cat > wanted << 'WANTED'
first: x = 1, y = 2
second, the same factory: x = 2, y = 1
second, its own factory: x = 1, y = 2
WANTED
echo "mcap 1.6.0, mcap-ros2-support 0.6.0, $(here/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
