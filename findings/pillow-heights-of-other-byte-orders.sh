#!/bin/sh
# What Pillow reads out of a TIFF of heights whose numbers begin with their greatest byte, by how it is compressed.
#
# Installs a pinned Pillow in a temporary folder and lets it open files of two rows by four pixels that are written here;
# nothing of sleepcast runs. Needs Python with venv, and the network. TIFF allows both orders of bytes (MM and II), and one
# would guess that the same heights come out of both, or an error. As of Pillow 13.0.0:
#
#   II, and MM without compression   the heights
#   MM, compressed by Deflate        without a word other ones, each with its bytes turned round: 300 m is 11265 m; so it
#                                    is with 16 bits that have a sign, with 32, and with floating point
#   MM, 16 bits without a sign       the heights, compressed or not
#
# Whoever flies over such a map flies into hills that are elsewhere. Ends with 1 if that is no longer so.
set -eu
version=13.0.0
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
export HOME="$folder"
"$python" -m venv here
here/bin/pip install --quiet --disable-pip-version-check "pillow==$version" 2> pip.log || { cat pip.log >&2; exit 1; }
cat > read.py << 'SCRIPT'
import struct
import zlib

from PIL import Image

HEIGHTS = [1, 2, 300, 7, 1000, 8, 9, 12]
KINDS = {"16 bits, signed": ("h", 2), "16 bits": ("H", 1), "32 bits, signed": ("i", 2), "32 bits, floating": ("f", 3)}


def write(order, letter, kind, compressed):
    e = "<" if order == "II" else ">"
    data = struct.pack(f"{e}8{letter}", *HEIGHTS)
    data = zlib.compress(data) if compressed else data
    bits = 8 * struct.calcsize(letter)
    tags = [(256, 4), (257, 2), (258, bits), (259, 8 if compressed else 1), (262, 1), (273, 0), (277, 1), (278, 2)]
    tags += [(279, len(data)), (339, kind)]
    tags[5] = (273, 8 + 2 + 12 * len(tags) + 4)
    entries = b"".join(struct.pack(f"{e}HHII", tag, 4, 1, value) for tag, value in tags)
    head = order.encode() + struct.pack(f"{e}HIH", 42, 8, len(tags))
    with open("heights.tif", "wb") as file:
        file.write(head + entries + struct.pack(f"{e}I", 0) + data)


for name, (letter, kind) in KINDS.items():
    for order in ("II", "MM"):
        for compressed in (False, True):
            write(order, letter, kind, compressed)
            found = [*Image.open("heights.tif").getdata()]
            same = "the heights" if found == HEIGHTS else f"others, {found[2]:.3g} for 300"
            print(f"{name}, {order}, {'Deflate' if compressed else 'as they are'}: {same}")
SCRIPT
here/bin/python -W ignore read.py > found
cat > wanted << 'WANTED'
16 bits, signed, II, as they are: the heights
16 bits, signed, II, Deflate: the heights
16 bits, signed, MM, as they are: the heights
16 bits, signed, MM, Deflate: others, 1.13e+04 for 300
16 bits, II, as they are: the heights
16 bits, II, Deflate: the heights
16 bits, MM, as they are: the heights
16 bits, MM, Deflate: the heights
32 bits, signed, II, as they are: the heights
32 bits, signed, II, Deflate: the heights
32 bits, signed, MM, as they are: the heights
32 bits, signed, MM, Deflate: others, 7.38e+08 for 300
32 bits, floating, II, as they are: the heights
32 bits, floating, II, Deflate: the heights
32 bits, floating, MM, as they are: the heights
32 bits, floating, MM, Deflate: others, 5.39e-41 for 300
WANTED
echo "Pillow $version, $(here/bin/python --version)"
cat found
cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }
