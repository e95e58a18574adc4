#!/bin/sh
# What the pieces are that Rerun's binary stream gives, one after the other.
#
# Installs a pinned rerun-sdk in a temporary folder and logs three numbers; nothing of sleepcast runs. Needs Python with
# venv, and the network. As of rerun-sdk 0.41.0:
#
#   one read at the end      a file that `rerun rrd verify` takes
#   a read after each log    pieces that begin and end like files: written one after the other, as a program would that
#                            wants to keep little in memory, they are refused ("More than one RRD manifest")
#
# Ends with 1 if that is no longer so.
set -eu
version=0.41.0
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
export HOME="$folder"
python3 -m venv here
here/bin/pip install --quiet "rerun-sdk==$version" > pip.log 2>&1 || { cat pip.log >&2; exit 1; }
here/bin/python - << 'SCRIPT' > python.log 2>&1
import rerun

for name, each in (("once", False), ("parts", True)):
    stream = rerun.RecordingStream("parts")
    binary = stream.binary_stream()
    with open(f"{name}.rrd", "wb") as file:
        for second in range(3):
            stream.set_time("time", duration=second)
            stream.log("number", rerun.Scalars(second))
            if each:
                file.write(binary.read() or b"")
        file.write(binary.read() or b"")
SCRIPT
verdict() { here/bin/rerun rrd verify "$1.rrd" > told 2>&1 && echo "$1: taken" || echo "$1: refused"; }
{ verdict once; verdict parts; grep -o 'More than one RRD manifest' told || true; } > found
cat > wanted << 'WANTED'
once: taken
parts: refused
More than one RRD manifest
WANTED
echo "rerun-sdk $version"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
