#!/bin/sh
# What node-cot makes of a Cursor-on-Target event whose height nobody knows.
#
# Installs a pinned @tak-ps/node-cot in a temporary folder and gives it an event; nothing of sleepcast runs. Needs node, npm
# and the network. Cursor-on-Target says "unknown" of a height (hae) and of errors (ce, le) by the number 9999999. One would
# guess a GeoJSON place without a height, and the same back. As of 14.23.2:
#
#   to GeoJSON         a height of 9,999,999 m, by RFC 7946 metres above the ellipsoid, in the place and in "center"
#   from GeoJSON       a place without a height is at 0 m
#
# A robot that does not know its height is ten thousand kilometres up for every map, filter and terrain profile that
# reads the GeoJSON. Ends with 1 if that is no longer so.
set -eu
version=14.23.2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm init -y > npm.log 2>&1
npm install --ignore-scripts --no-audit --no-fund "@tak-ps/node-cot@$version" >> npm.log 2>&1 || { cat npm.log >&2; exit 1; }
cat > read.mjs << 'SCRIPT'
import { CoTParser } from '@tak-ps/node-cot';

const event = `<event version="2.0" uid="robot" type="a-f-G-E-V-U" how="m-g" time="2026-01-01T00:00:00Z"
 start="2026-01-01T00:00:00Z" stale="2026-01-02T00:00:00Z"><point lat="36.6" lon="-121.9" hae="9999999.0" ce="9999999.0"
 le="9999999.0"/><detail><contact callsign="robot"/></detail></event>`;
const { geometry, properties } = await CoTParser.to_geojson(CoTParser.from_xml(event));
console.log('to', JSON.stringify(geometry.coordinates), JSON.stringify(properties.center));
const flat = { type: 'Point', coordinates: [-121.9, 36.6] };
const back = await CoTParser.from_geojson({
    id: 'robot', type: 'Feature', properties: { callsign: 'robot', type: 'a-f-G-E-V-U', how: 'm-g' }, geometry: flat,
});
const { hae, ce, le } = back.raw.event.point._attributes;
console.log('from', Number(hae), Number(ce), Number(le));
SCRIPT
node read.mjs > found
cat > wanted << 'WANTED'
to [-121.9,36.6,9999999] [-121.9,36.6,9999999]
from 0 9999999 9999999
WANTED
echo "@tak-ps/node-cot $version, node $(node --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
