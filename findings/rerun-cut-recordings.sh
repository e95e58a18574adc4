#!/bin/sh
# What Rerun makes of an MCAP file without its end, and of messages that are JSON.
#
# Installs a pinned rerun-sdk and mcap in a temporary folder and gives them a file of one topic; nothing of sleepcast
# runs. Needs Python with venv, and the network. As of rerun-sdk 0.41.0:
#
#   convert                 a file that was cut off is refused: "MCAP summary is missing or corrupt"
#   convert --recover       it is read, up to where it ends; the viewer itself has no such option
#   JSON with a jsonschema  the messages are bytes (McapMessage:data), no numbers that could be plotted
#
# Ends with 1 if that is no longer so.
set -eu
version=0.41.0
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
export HOME="$folder"
python3 -m venv here
here/bin/pip install --quiet "rerun-sdk==$version" mcap==1.6.0 > pip.log 2>&1 || { cat pip.log >&2; exit 1; }
here/bin/python - << 'SCRIPT'
import json
from mcap.writer import Writer

with open("whole.mcap", "wb") as stream:
    writer = Writer(stream)
    writer.start()
    schema = writer.register_schema("Readings", "jsonschema", json.dumps({"type": "object"}).encode())
    channel = writer.register_channel("/readings", "json", schema)
    for second in range(3):
        writer.add_message(channel, second * 10**9, json.dumps({"fuel": [second]}).encode(), second * 10**9)
    writer.finish()
whole = open("whole.mcap", "rb").read()
open("cut.mcap", "wb").write(whole[:-20])
SCRIPT
rerun() { here/bin/rerun "$@" > told 2>&1 || true; }
rerun mcap convert cut.mcap -o cut.rrd
grep -q 'MCAP summary is missing or corrupt' told && echo 'cut: refused' > found || echo 'cut: taken' > found
rerun mcap convert --recover cut.mcap -o cut.rrd
grep -q '^ *//*readings,' told && echo 'recovered: /readings' >> found || echo 'recovered: nothing' >> found
rerun mcap convert whole.mcap -o whole.rrd
rerun rrd print whole.rrd
grep -q '/readings - data columns: \[McapMessage:data\]' told && echo 'JSON: bytes' >> found || echo 'JSON: values' >> found
here/bin/rerun --help | grep -q -e --recover && echo 'viewer: --recover' >> found || echo 'viewer: nothing' >> found
cat > wanted << 'WANTED'
cut: refused
recovered: /readings
JSON: bytes
viewer: nothing
WANTED
echo "rerun-sdk $version"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
