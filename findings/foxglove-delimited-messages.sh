#!/bin/sh
# What @foxglove/rosmsg2-serialization reads of a message in the delimited form of CDR.
#
# Installs pinned packages in a temporary folder and reads one message of two float64 in three encapsulations; nothing of sleepcast
# runs. Needs node, npm and the network. Types that may grow (appendable, XTypes 1.3) are sent in delimited form: four bytes
# with the length stand before the numbers. Plain CDR2 (7) is read; one would guess that the delimited form (9) is read as well,
# or refused. As of @foxglove/rosmsg2-serialization 3.1.0 the length is read as the beginning of the first number:
#
#   CDR, plain CDR2                 1.5 and 2.5
#   delimited CDR2                  8e-323 and 5.3e-315, without an error
#
# A recording of a DDS program with appendable types shows values that nobody has sent. Ends with 1 if that is no longer so.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm init -y > npm.log 2>&1
npm install --ignore-scripts --no-audit --no-fund @foxglove/rosmsg2-serialization@3.1.0 @foxglove/rosmsg@5.0.5 >> npm.log 2>&1 ||
    { cat npm.log >&2; exit 1; }
cat > read.mjs << 'SCRIPT'
import { parse } from '@foxglove/rosmsg';
import serialization from '@foxglove/rosmsg2-serialization';

const reader = new serialization.MessageReader(parse('float64 x\nfloat64 y\n', { ros2: true }));
const kinds = { 'CDR (1)': [1, false], 'plain CDR2 (7)': [7, false], 'delimited CDR2 (9)': [9, true] };
for (const [name, [kind, delimited]] of Object.entries(kinds)) {
    const numbers = delimited ? 8 : 4;
    const data = new DataView(new ArrayBuffer(numbers + 16));
    data.setUint8(1, kind);
    if (delimited) data.setUint32(4, 16, true);
    data.setFloat64(numbers, 1.5, true);
    data.setFloat64(numbers + 8, 2.5, true);
    try {
        const { x, y } = reader.readMessage(new Uint8Array(data.buffer));
        console.log(`${name}: ${x} ${y}`);
    } catch (error) {
        console.log(`${name}: refused`);
    }
}
SCRIPT
node read.mjs > found
cat > wanted << 'WANTED'
CDR (1): 1.5 2.5
plain CDR2 (7): 1.5 2.5
delimited CDR2 (9): 8e-323 5.30239915e-315
WANTED
echo "@foxglove/rosmsg2-serialization 3.1.0, node $(node --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
