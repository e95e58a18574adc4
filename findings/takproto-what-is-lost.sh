#!/bin/sh
# What of a Cursor-on-Target event is left when takproto and node-cot have made protobuf of it.
#
# Installs pinned takproto and @tak-ps/node-cot in a temporary folder and gives them one event; nothing of sleepcast runs. Needs
# python3 with venv, node, npm and the network. TAK's protobuf has fields for a few elements with a few attributes each; an
# element that says more belongs whole into the field xmlDetail, which takes any XML. So one would guess that nothing is lost.
# As of takproto 3.0.1 and node-cot 14.23.2:
#
#   takproto   keeps of contact, status and track the attributes that have fields; a telephone, a readiness and a slope are gone
#   node-cot   drops the same, and precisionlocation; the group is XML, and its own field is empty
#
# Whoever reads the group from its field finds none in what node-cot has written. Ends with 1 if that is no longer so.
set -eu
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"$python" -m venv here
here/bin/pip install --quiet --disable-pip-version-check takproto==3.0.1 2> pip.log || { cat pip.log >&2; exit 1; }
npm init -y > npm.log 2>&1
npm install --ignore-scripts --no-audit --no-fund @tak-ps/node-cot@14.23.2 >> npm.log 2>&1 || { cat npm.log >&2; exit 1; }
cat > event.xml << 'EVENT'
<event version="2.0" uid="one" type="a-f-G" how="h-e" time="2026-01-01T00:00:00Z" start="2026-01-01T00:00:00Z"
 stale="2026-01-02T00:00:00Z"><point lat="36.6" lon="-121.9" hae="0" ce="1" le="1"/><detail><contact callsign="one"
 phone="555"/><__group name="Cyan" role="HQ"/><precisionlocation altsrc="DTED0" geopointsrc="GPS"/><status battery="57"
 readiness="true"/><track course="10" speed="1" slope="2"/><remarks>kept</remarks></detail></event>
EVENT
cat > write.mjs << 'SCRIPT'
import { readFileSync, writeFileSync } from 'node:fs';
import { CoTParser } from '@tak-ps/node-cot';

writeFileSync('node-cot.bin', await CoTParser.to_proto(CoTParser.from_xml(readFileSync('event.xml', 'utf8')), 1));
SCRIPT
node write.mjs
cat > look.py << 'SCRIPT'
from takproto import xml2proto
from takproto.proto import TakMessage

WRITTEN = {
    "takproto": bytes(xml2proto(open("event.xml", "rb").read()))[3:],
    "node-cot": open("node-cot.bin", "rb").read(),
}
for name, data in WRITTEN.items():
    message = TakMessage()
    message.ParseFromString(data)
    text = str(message.cotEvent.detail)
    values = {"callsign": "one", "phone": "555", "group": "Cyan", "altsrc": "DTED0", "battery": "57"}
    values |= {"readiness": "readiness", "slope": "slope", "remarks": "kept"}
    print(f"{name}: lost", *(key for key, value in values.items() if value not in text), end="; ")
    print("the field of the group says", repr(message.cotEvent.detail.group.name))
SCRIPT
here/bin/python look.py > found
cat > wanted << 'WANTED'
takproto: lost phone readiness slope; the field of the group says 'Cyan'
node-cot: lost phone altsrc readiness slope; the field of the group says ''
WANTED
echo "takproto 3.0.1, @tak-ps/node-cot 14.23.2, node $(node --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
