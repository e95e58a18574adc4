"""Write the reference of the Python API: all that `import sleepcast` offers, with its docstrings, as HTML.

.venv/bin/python docs/reference.py FOLDER         # after python3 go.py test has set up the tools
"""

from __future__ import annotations

import sys
from pathlib import Path

import pdoc

import sleepcast


def main() -> None:
    if len(sys.argv) != 2:
        raise SystemExit("say where the reference is to be written: docs/reference.py FOLDER")
    for name in sleepcast.__all__:
        getattr(sleepcast, name)  # names are loaded when they are first used, and pdoc shows what is loaded
    pdoc.pdoc("sleepcast", output_directory=Path(sys.argv[1]))
    print(Path(sys.argv[1], "sleepcast.html"))


if __name__ == "__main__":
    main()
