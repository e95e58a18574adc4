#!/bin/sh
# What node-cot makes of drawings (Cursor-on-Target events of the type u-d-f) by the number of their points.
#
# Installs a pinned @tak-ps/node-cot in a temporary folder and gives it events; nothing of sleepcast runs. Needs node, npm
# and the network. As of 14.23.2:
#
#   one point              a Polygon with a single position, which is none by RFC 7946 (3.1.6: four or more)
#   points, not closed     a LineString
#   points, closed         a Polygon
#
# Ends with 1 if that is no longer so.
set -eu
version=14.23.2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm init -y > npm.log 2>&1
npm install --ignore-scripts --no-audit --no-fund "@tak-ps/node-cot@$version" >> npm.log 2>&1 || { cat npm.log >&2; exit 1; }
cat > read.mjs << 'SCRIPT'
import { CoTParser } from '@tak-ps/node-cot';

const corners = ['36.6,-121.9', '36.61,-121.9', '36.61,-121.8'];
const drawings = { one: corners.slice(0, 1), open: corners, closed: [...corners, corners[0]] };
for (const [name, points] of Object.entries(drawings)) {
    const links = points.map((point) => `<link point="${point}"/>`).join('');
    const event = `<event version="2.0" uid="drawing" type="u-d-f" how="h-e" time="2026-01-01T00:00:00Z"
 start="2026-01-01T00:00:00Z" stale="2026-01-02T00:00:00Z"><point lat="36.605" lon="-121.85" hae="0" ce="9999999"
 le="9999999"/><detail><contact callsign="drawing"/>${links}</detail></event>`;
    const { geometry } = await CoTParser.to_geojson(CoTParser.from_xml(event));
    console.log(name, geometry.type, JSON.stringify(geometry.coordinates));
}
SCRIPT
node read.mjs > found
cat > wanted << 'WANTED'
one Polygon [[[-121.9,36.6]]]
open LineString [[-121.9,36.6],[-121.9,36.61],[-121.8,36.61]]
closed Polygon [[[-121.9,36.6],[-121.9,36.61],[-121.8,36.61],[-121.9,36.6]]]
WANTED
echo "@tak-ps/node-cot $version, node $(node --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
