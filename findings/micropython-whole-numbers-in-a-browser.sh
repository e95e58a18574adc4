#!/bin/sh
# Which whole numbers go between JavaScript and MicroPython's WebAssembly port, as PyScript uses it.
#
# Installs pinned @micropython/micropython-webassembly-pyscript in a temporary folder and hands numbers over, both ways; nothing of
# sleepcast runs. Needs node, npm and the network. MicroPython's whole numbers have any size there, and those of JavaScript are
# exact to 2**53, so one would guess that the milliseconds of Date.now() arrive. As of 1.27.0 the lowest 32 bits do, with
# a sign:
#
#   1795959309069 in JavaScript     662979341 in MicroPython
#   1795959309069 in MicroPython    662979341 in JavaScript; random.getrandbits(32) is negative half of the time
#   1795959309069.5                 arrives: numbers that are not whole pass as they are, and so does text
#
# Times and numbers of messages become others without an error. Ends with 1 if that is no longer so.
set -eu
version=1.27.0
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm init -y > npm.log 2>&1
npm install --ignore-scripts --no-audit --no-fund "@micropython/micropython-webassembly-pyscript@$version" >> npm.log 2>&1 ||
    { cat npm.log >&2; exit 1; }
cat > numbers.mjs << 'SCRIPT'
import { loadMicroPython } from '@micropython/micropython-webassembly-pyscript/micropython.mjs';

const python = await loadMicroPython();
const now = 1795959309069;
for (const number of [2 ** 31 - 1, now, now + 0.5]) {
    python.globals.set('given', number);
    python.runPython('seen = str(given)');
    python.runPython(`told = ${number}`);
    console.log(`${number}: there ${python.globals.get('seen')}, back ${python.globals.get('told')}`);
}
SCRIPT
node numbers.mjs > found 2> errors.log || { cat errors.log >&2; exit 1; }
cat > wanted << 'WANTED'
2147483647: there 2147483647, back 2147483647
1795959309069: there 662979341, back 662979341
1795959309069.5: there 1795959309069.5, back 1795959309069.5
WANTED
echo "@micropython/micropython-webassembly-pyscript $version, node $(node --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
