"""The house stands: arrows between rooms go down only, each room keeps to its libraries, modules stay small.

The table is the twin of the one in docs/architecture.md. Imports are read from the syntax tree, so that one
inside a function or for type checking counts as well: a room that sometimes knows another room knows it.
"""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SOURCE = ROOT / "src"
PACKAGE = "sleepcast"

LONGEST_MODULE = 700  # lines; a longer file is worth a look
LONGEST_LANGUAGE_IMPORT = 0.050  # seconds beyond the interpreter's start, on a machine that has little else to do
REFERENCE, REFERENCE_SECONDS = "import asyncio, http.client, xml.dom.minidom", 0.055
"""A part of Python's own library, and the seconds that its import takes on such a machine."""


@dataclass(frozen=True)
class Room:
    """What a room may import: other rooms, libraries, and libraries that only its functions ask for."""

    rooms: frozenset[str] = frozenset()
    libraries: frozenset[str] = frozenset()
    late_libraries: frozenset[str] = frozenset()


def room(rooms: str = "", libraries: str = "", late: str = "") -> Room:
    return Room(frozenset(rooms.split()), frozenset(libraries.split()), frozenset(late.split()))


PIPELINES = {  # rooms within a room, and its modules: each imports only what stands before it
    "simulator": (
        *(
            "simd",
            "world",
            "scenario",
            "sonar",
            "laser",
            "motion",
            "neighbours",
            "fast",
            "engine",
            "bodies",
            "simulation",
        ),
        *("quiet", "single_robot", "packing", "snapshot", "recording", "kernel_warm_up"),
    ),
    "bridges": ("address", "body", "crazyflie", "mavlink", "ros2"),
    "nomad": ("wire", "client", "bridge", "server", "world", "panes", "command"),
}
GROUND = frozenset({"core"})  # everybody may import it
HOUSE = {
    "core": room(libraries="msgspec numpy", late="llvmlite platformdirs pyproj"),
    "language": room(),
    "sentences": room("language"),
    "channel": room(libraries="msgspec numpy cbor2 nacl zenoh"),
    "robot": room(),
    "mind": room("language channel robot", "msgspec"),
    "node": room("language channel robot mind", "msgspec", late="numpy"),
    "columns": room("language mind", "numpy msgspec"),
    "fleet": room("language channel robot mind columns", "numpy msgspec", late="llvmlite"),
    "simulator": room("channel robot", "numpy msgspec mcap lz4 zstandard numba llvmlite tinycss2", late="yaml PIL"),
    "bridges": room("robot", "cyclonedds", late="cflib pymavlink"),
    "testing": room("robot bridges"),
    "loop": room("language channel mind columns node fleet simulator robot", "msgspec"),
    "station": room("language channel mind columns", "msgspec numpy"),
    "tak": room("channel station", late="takproto google"),
    "console": room(
        "language sentences channel robot columns node fleet simulator loop station",
        "starlette uvicorn msgspec numpy",
    ),
    "notebook": room("loop station console", "anywidget traitlets msgspec"),
    "api": room("language channel robot mind node fleet simulator loop station notebook", "numpy", "rich nanoarrow"),
    "experiments": room("language simulator api", "msgspec numpy", "distributed matplotlib optuna pyarrow scipy"),
    "experiment_page": room("loop console experiments", "starlette msgspec"),
    "importing": room("channel simulator", "numpy", late="PIL"),
    "exporting": room("channel simulator", "numpy msgspec", late="pyarrow rerun rosbags"),
    "gym": room("language columns simulator loop api experiments", "gymnasium pettingzoo numpy"),
    "cli": room(
        "language sentences channel robot mind node fleet simulator bridges loop station tak api experiments importing "
        "exporting experiment_page console",
        "click rich prompt_toolkit msgspec numpy",
    ),
    "__main__": room("cli"),
    # plug-ins, which nobody imports: they are found by entry points
    "nomad": room("channel robot simulator bridges console cli", "click starlette msgspec numpy"),
}
PLUG_INS = ("nomad",)
FRONT = room("api language")  # of the package itself, which only passes on names
MESSAGES = frozenset({"msgspec", "typing_extensions"})  # msgspec takes the second where there is one
LIGHT = {  # what these rooms may load of the libraries when they are imported: a short job starts with them
    "language": frozenset[str](),
    "robot": frozenset[str](),
    "nomad": frozenset[str](),
    "bridges": frozenset[str](),
    "channel": MESSAGES,
    "mind": MESSAGES,
    "node": MESSAGES,
    "station": MESSAGES | {"numpy"},
}


@dataclass(frozen=True)
class Import:
    """One imported module: its dotted name, the line, and whether it loads as soon as its importer does."""

    target: str
    line: int
    early: bool


@cache
def modules() -> dict[str, Path]:
    """Every module of the package by its dotted name."""
    found = {}
    for path in sorted((SOURCE / PACKAGE).rglob("*.py")):
        parts = path.relative_to(SOURCE).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def place(module: str, line: int) -> str:
    return f"{modules()[module].relative_to(ROOT)}:{line}"


def room_of(module: str) -> str:
    """`sleepcast.language.reader` is in the room `language`; the package itself is in no room."""
    return module.split(".")[1] if "." in module else ""


@cache
def imports_of(module: str) -> tuple[Import, ...]:
    tree = ast.parse(modules()[module].read_text(encoding="utf-8"))
    return tuple(walk_imports(tree, module, early=True))


def walk_imports(tree: ast.AST, module: str, early: bool) -> Iterator[Import]:
    for child in ast.iter_child_nodes(tree):
        if isinstance(child, ast.Import):
            yield from (Import(alias.name, child.lineno, early) for alias in child.names)
        elif isinstance(child, ast.ImportFrom):
            origin = imported_from(child, module)
            targets = dict.fromkeys(member(origin, alias.name) for alias in child.names)
            yield from (Import(target, child.lineno, early) for target in targets)
        else:
            yield from walk_imports(child, module, early and not runs_later(child))


def runs_later(node: ast.AST) -> bool:
    """True for what importing the module does not run: bodies of functions, imports for type checking."""
    if isinstance(node, ast.If):
        return ast.unparse(node.test).endswith("TYPE_CHECKING")
    return isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)


def imported_from(node: ast.ImportFrom, module: str) -> str:
    """The module after `from`, with leading dots resolved against the importing module."""
    if not node.level:
        return node.module or ""
    package = module if modules()[module].name == "__init__.py" else module.rpartition(".")[0]
    for _ in range(node.level - 1):
        package = package.rpartition(".")[0]
    return f"{package}.{node.module}" if node.module else package


def member(origin: str, name: str) -> str:
    """`from origin import name` means the module `origin.name` if there is one, else `origin`."""
    return f"{origin}.{name}" if f"{origin}.{name}" in modules() else origin


def test_imports_are_found_wherever_they_stand() -> None:
    source = """
from typing import TYPE_CHECKING
import os.path
from .core import errors
if TYPE_CHECKING:
    from .core.units import Unit
def late():
    from sleepcast.core import clock
    import numpy as np
"""
    found = [(each.target, each.early) for each in walk_imports(ast.parse(source), PACKAGE, early=True)]
    assert found == [
        ("typing", True),
        ("os.path", True),
        ("sleepcast.core.errors", True),
        ("sleepcast.core.units", False),
        ("sleepcast.core.clock", False),
        ("numpy", False),
    ]


def test_every_room_is_in_the_table_and_every_row_has_a_room() -> None:
    standing = {room_of(module) for module in modules()} - {""}
    assert not standing - set(HOUSE), "rooms that the table does not know"
    assert not set(HOUSE) - standing, "rows of the table without a room"


def test_nobody_imports_a_plug_in() -> None:
    for plug_in in PLUG_INS:
        assert [name for name, entry in HOUSE.items() if plug_in in entry.rooms] == []


def test_the_table_itself_has_no_circle() -> None:
    list(TopologicalSorter({name: entry.rooms for name, entry in HOUSE.items()}).static_order())


def test_arrows_between_rooms_go_down_only() -> None:
    wrong = []
    for module in modules():
        here = room_of(module)
        allowed = GROUND | HOUSE.get(here, FRONT).rooms | {here}
        for found in imports_of(module):
            if found.target.split(".")[0] == PACKAGE and room_of(found.target) not in allowed:
                wrong.append(f"{place(module, found.line)}: {module} must not import {found.target}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("room", PIPELINES)
def test_arrows_within_a_room_go_one_way(room: str) -> None:
    order, wrong, found = PIPELINES[room], [], set()
    for module in modules():
        path = module.split(".")[1:]
        if path[:1] != [room] or len(path) < 2:
            continue
        found.add(path[1])
        for each in imports_of(module):
            target = each.target.split(".")[1:]
            inside = target[:1] == [room] and len(target) > 1 and each.target.startswith(PACKAGE)
            if inside and order.index(target[1]) > order.index(path[1]):
                wrong.append(f"{place(module, each.line)}: {path[1]} stands before {target[1]}")
    assert not wrong, "\n".join(wrong)
    assert found == set(order)


def test_a_room_keeps_to_its_libraries() -> None:
    wrong = []
    for module in modules():
        entry = HOUSE.get(room_of(module), Room())
        for found in imports_of(module):
            allowed = entry.libraries if found.early else entry.libraries | entry.late_libraries
            library = found.target.split(".")[0]
            if library not in sys.stdlib_module_names | allowed | {PACKAGE}:
                wrong.append(f"{place(module, found.line)}: {module} must not import {library} here")
    assert not wrong, "\n".join(wrong)


def test_no_circle_among_modules() -> None:
    graph = {
        module: {found.target for found in imports_of(module) if found.target in modules()} - {module}
        for module in modules()
    }
    try:
        list(TopologicalSorter(graph).static_order())
    except CycleError as circle:
        pytest.fail("modules import each other in a circle: " + " <- ".join(circle.args[1]))


def test_modules_stay_small_and_open_with_their_plan() -> None:
    wrong = []
    for module, path in modules().items():
        source = path.read_text(encoding="utf-8")
        lines = len(source.splitlines())
        if lines > LONGEST_MODULE:
            wrong.append(f"{place(module, lines)}: longer than {LONGEST_MODULE} lines; split it by purpose")
        if not ast.get_docstring(ast.parse(source)):
            wrong.append(f"{place(module, 1)}: say in a docstring what this module does and how")
    assert not wrong, "\n".join(wrong)


LOAD = """
import json, sys, time
before = set(sys.modules)
start = time.process_time()
{statement}
print(json.dumps([time.process_time() - start, sorted(set(sys.modules) - before)]))
"""


def load(statement: str, bytecode: Path) -> tuple[float, list[str]]:
    """Processor seconds and modules of an import in a fresh interpreter, beyond its start and with bytecode kept."""
    env = {**os.environ, "PYTHONPYCACHEPREFIX": str(bytecode)}
    env.pop("PYTHONDONTWRITEBYTECODE", None)
    command = [sys.executable, "-c", LOAD.format(statement=statement)]
    done = subprocess.run(command, env=env, capture_output=True, text=True, check=True)
    seconds, loaded = json.loads(done.stdout)
    return seconds, loaded


@pytest.mark.parametrize("room", LIGHT)
def test_a_small_job_does_not_load_what_only_big_jobs_need(room: str, tmp_path: Path) -> None:
    _, loaded = load(f"import sleepcast.{room}", tmp_path)
    foreign = {name.split(".")[0] for name in loaded} - sys.stdlib_module_names - {PACKAGE}
    assert foreign <= LIGHT[room], f"import sleepcast.{room} also loads {sorted(foreign - LIGHT[room])}"
    rooms = {room_of(name) for name in loaded if name.split(".")[0] == PACKAGE} - {"", room}
    assert rooms <= GROUND | HOUSE[room].rooms, f"import sleepcast.{room} also loads the rooms {sorted(rooms)}"


def test_the_language_imports_fast(tmp_path: Path) -> None:
    """Against an import of Python's own: where other work keeps the memory and the cores busy, both take longer."""
    # The best of several: the first one compiles, and other work on the machine can only make an import slower.
    times = [(load("import sleepcast.language", tmp_path)[0], load(REFERENCE, tmp_path)[0]) for _ in range(7)]
    fastest, reference = (min(column) for column in zip(*times, strict=True))
    limit = LONGEST_LANGUAGE_IMPORT * max(1.0, reference / REFERENCE_SECONDS)
    wanted = f"wanted at most {limit * 1000:.0f}"
    assert fastest < limit, f"import sleepcast.language takes {fastest * 1000:.0f} ms, {wanted}"


# Where packages come from and where a checkout lies are the reader's own affair: a file that names one
# machine's registry, mirror or folders is wrong on every other machine.
REGISTRIES = re.compile(
    rb"pypi\.org|pythonhosted\.org|npmjs\.(?:com|org)|unpkg\.com|jsdelivr\.net|cdnjs\.|esm\.sh|crates\.io|conda\.anaconda"
)
MACHINE_PATHS = re.compile(rb"(?<![\w.~})/-])/(?:home|root|Users|work|tmp/\w)[\w.-]*/")


def tracked_files() -> list[Path]:
    """What git holds, and what it would take in: new files are checked before they are committed."""
    listing = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    done = subprocess.run(listing, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip("not a git checkout, so there are no tracked files to check")
    return [ROOT / name for name in done.stdout.split("\0") if name and (ROOT / name).is_file()]


@pytest.mark.parametrize("pattern", [REGISTRIES, MACHINE_PATHS], ids=["registries", "machine_paths"])
def test_tracked_files_name_no_registry_and_no_machine_path(pattern: re.Pattern[bytes]) -> None:
    wrong = []
    for path in tracked_files():
        content = path.read_bytes()
        for match in pattern.finditer(content):
            line = content.count(b"\n", 0, match.start()) + 1
            wrong.append(f"{path.relative_to(ROOT)}:{line}: {match.group().decode()}")
    assert not wrong, "\n".join(wrong)
