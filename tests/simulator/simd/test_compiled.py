"""Compiled kernels are kept by what they depend on: not by where, or when, the package was installed."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import sleepcast

pytest.importorskip("numba")

SOURCE = Path(sleepcast.__file__).parent
CALL = """
import os, tempfile
import numpy as np
tempfile.tempdir = os.environ["XDG_CACHE_HOME"]  # the other place
from sleepcast.simulator.sonar import kernels

start = np.zeros(4, np.int32)
kernels.begin(np.array([[2, 0, 1]], np.int32), start)
assert start.tolist() == [0, 2, 2, 3]
print(kernels.__file__, *kernels.begin.stats.cache_misses.values())
"""


LOAD_THEN_COMPILE = (
    CALL
    + """
import sys
print("numba.np.linalg" in sys.modules)  # which only compiling takes
order = np.zeros(3, np.int32)
kernels.place(np.array([0, 2, 0], np.int32), 0, 3, np.array([0, 2, 2], np.int32), order)
print(order.tolist(), *kernels.place.stats.cache_misses.values())
"""
)


def misses(package: Path, caches: Path) -> int:
    """How often a process with this package compiles a small kernel."""
    environment = {
        **os.environ,
        "PYTHONPATH": str(package.parent),
        "XDG_CACHE_HOME": str(caches),
        "TMPDIR": str(caches),
    }
    done = subprocess.run([sys.executable, "-c", CALL], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    file, *counted = done.stdout.split()
    assert Path(file).is_relative_to(package)
    return sum(map(int, counted))


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache in which a process has kept the kernel that it had to compile."""
    caches = tmp_path_factory.mktemp("kept")
    assert misses(SOURCE, caches) == 1
    return caches


def test_kernels_of_one_installation_serve_another_one(kept: Path, tmp_path: Path) -> None:
    """A copy elsewhere, with files of another time, compiles nothing; one with another kernel in it does."""
    caches, copy = shutil.copytree(kept, tmp_path / "caches"), tmp_path / "elsewhere" / "sleepcast"
    shutil.copytree(SOURCE, copy, ignore=shutil.ignore_patterns("__pycache__"), copy_function=shutil.copyfile)
    assert misses(copy, caches) == 0
    with (copy / "simulator" / "simd" / "formulas.py").open("a") as file:
        file.write("\n# changed\n")
    assert misses(copy, caches) == 1
    assert misses(SOURCE, caches) == 0


def test_a_kernel_is_loaded_without_what_compiling_takes_and_another_one_compiled_after_it(
    kept: Path, tmp_path: Path
) -> None:
    environment = {**os.environ, "XDG_CACHE_HOME": str(shutil.copytree(kept, tmp_path / "caches"))}
    done = subprocess.run(
        [sys.executable, "-c", LOAD_THEN_COMPILE], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[1:] == ["False", "[0, 2, 1] 1"]


OTHERS = """
from sleepcast.simulator.simd.cached import compiled_in
from sleepcast.simulator.simd.compiled import compiled

def adding(what):
    def add(number):
        return number + what
    return compiled(add)

print(adding(1)(2), adding(2)(2), compiled_in())
"""


def test_what_is_no_kernel_of_ours_is_not_kept_so_that_nobody_gets_it_for_another(tmp_path: Path) -> None:
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path), "TMPDIR": str(tmp_path)}
    (tmp_path / "others.py").write_text(OTHERS)
    for _ in range(2):
        command = [sys.executable, str(tmp_path / "others.py")]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert (done.stdout, done.stderr) == ("3 4 None\n", "")


@pytest.mark.parametrize("hindrance", ["a file where the folder should be", "damage"])
def test_kernels_that_cannot_be_kept_or_loaded_are_compiled(kept: Path, tmp_path: Path, hindrance: str) -> None:
    caches = tmp_path / "caches"
    if hindrance == "damage":
        shutil.copytree(kept, caches)
        for file in caches.rglob("*-kernels.*"):
            file.write_bytes(file.read_bytes()[:-1])
    else:
        caches.write_text(hindrance)
    assert misses(SOURCE, caches) == 1
    assert misses(SOURCE, caches) == (hindrance != "damage")


def test_a_kernels_name_tells_of_all_modules_that_it_takes_something_from() -> None:
    """But for types, of which compiled code has nothing."""
    from sleepcast.simulator.simd.cached import ROOM, SOURCES

    assert not [pattern for pattern in SOURCES if not any(ROOM.glob(pattern))], "named, but not there"
    counted = {file.resolve() for pattern in SOURCES for file in ROOM.glob(pattern)}
    compiled = [file for file in sorted(counted) if file.name.startswith(("kernels", "lanes", "vectors"))]
    assert len(compiled) > 5
    for file in compiled:
        for found in ast.walk(ast.parse(file.read_text())):
            if not isinstance(found, ast.ImportFrom) or not (found.module or "").startswith("sleepcast."):
                continue
            module = SOURCE.joinpath(*(found.module or "").split(".")[1:])
            for needed in (
                [module] if module.with_suffix(".py").exists() else [module / each.name for each in found.names]
            ):
                assert needed.with_suffix(".py") in counted, f"{file} takes something from {needed}: add it to SOURCES"


def test_compiled_code_says_nothing_that_numba_rounds_otherwise_than_python() -> None:
    """`hypot`, and whole powers above 2: numba 0.68 has another number for one of 200, and for one of four."""
    from sleepcast.simulator.simd.cached import ROOM, SOURCES

    for file in sorted({file for pattern in SOURCES for file in ROOM.glob(pattern) if file.name.startswith("kernels")}):
        for found in ast.walk(ast.parse(file.read_text())):
            if isinstance(found, ast.BinOp) and isinstance(found.op, ast.Pow):
                assert isinstance(found.right, ast.Constant | ast.UnaryOp), f"{file}:{found.lineno}"
                assert isinstance(found.left, ast.Constant) or found.right.value == 2, f"{file}:{found.lineno}"
            name = getattr(found, "id", getattr(found, "attr", ""))
            assert name != "hypot", f"{file}:{getattr(found, 'lineno', 0)}"
