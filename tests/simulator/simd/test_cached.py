"""Kernels are called without numba: with the same results, and only with arguments that they were compiled for."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("numba")

from sleepcast.simulator.simd import cached
from sleepcast.simulator.simd.cached import CachedKernel, readable
from sleepcast.simulator.simd.compiled import compiled
from sleepcast.simulator.simd.entry import NoEntryError, entry_of
from sleepcast.simulator.sonar import kernels

Kept = Callable[..., object]

FIRST = """
import sys
import numpy as np
from sleepcast.simulator.simd.cached import CachedKernels

start, order = np.zeros(4, np.int32), np.zeros(3, np.int32)
kernels = CachedKernels("sonar.kernels")
kernels.begin(np.array([[2, 0, 1]], np.int32), start)
print(start.tolist(), "numba" in sys.modules)
"""
THEN = """
kernels.place(np.array([0, 2, 0], np.int32), 0, 3, np.array([0, 2, 2], np.int32), order)
print(order.tolist(), "numba" in sys.modules)
"""
STAYS = """
from sleepcast.simulator.simd.cached import load

arguments = np.array([[2, 0, 1]], np.int32), start
before = kernels.begin.address(*arguments)
print(load("sleepcast.simulator.sonar.kernels:begin"), kernels.begin.address(*arguments) == before)
"""


class Both(NamedTuple):
    """What kernels take together."""

    values: NDArray[np.float64]
    factor: float


def said(program: str, caches: Path) -> list[str]:
    """What a process prints that keeps kernels in this folder."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(caches), "TMPDIR": str(caches)}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of caches in which a process has kept the first kernel, for which it had to load numba."""
    caches = tmp_path_factory.mktemp("first")
    assert said(FIRST, caches) == ["[0, 2, 2, 3] True"]
    return caches


def test_numba_is_loaded_for_what_has_to_be_compiled_alone(first: Path, tmp_path: Path) -> None:
    shutil.copytree(first, tmp_path, dirs_exist_ok=True)
    assert said(FIRST, tmp_path) == ["[0, 2, 2, 3] False"]
    assert said(FIRST + THEN, tmp_path) == ["[0, 2, 2, 3] False", "[0, 2, 1] True"]
    assert said(FIRST + THEN, tmp_path) == ["[0, 2, 2, 3] False", "[0, 2, 1] False"]


def test_a_damaged_entry_is_made_again(first: Path, tmp_path: Path) -> None:
    shutil.copytree(first, tmp_path, dirs_exist_ok=True)
    for file in tmp_path.rglob("kernel-entries/*"):
        file.write_bytes(file.read_bytes()[:-1])
    assert said(FIRST, tmp_path) == ["[0, 2, 2, 3] True"]
    assert said(FIRST, tmp_path) == ["[0, 2, 2, 3] False"]


def test_a_kernel_that_was_compiled_here_stays_where_it_is(tmp_path: Path) -> None:
    assert said(FIRST + STAYS, tmp_path) == ["[0, 2, 2, 3] True", "True True"]


def kept(function: Kept, *arguments: object) -> Kept:
    """A function's machine code for arguments of these types, called as in a process without numba."""
    made: Kept = compiled(function)
    made(*arguments)
    (overload,) = made.overloads.values()  # type: ignore[attr-defined]
    call = cached.linked_entry(entry_of(overload))
    return lambda *arguments: call(arguments)


def scaled(both: Both, by: int, twice: bool, out: NDArray[np.float64]) -> float:
    """A kernel with an array of its own."""
    room = np.empty(both.values.shape[0])
    total = 0.0
    for i in range(both.values.shape[0]):
        room[i] = both.values[i] * both.factor * by
        if twice:
            room[i] *= 2.0
        out[i] = room[i]
        total += room[i]
    return total


@cache
def scaling() -> tuple[Any, Any]:
    """`scaled` as numba calls it, and its entry."""
    made: Any = compiled(scaled)
    made(Both(np.zeros(1), 0.5), 3, False, np.zeros(1))
    return made, cached.linked_entry(entry_of(*made.overloads.values()))


def column(kind: str, form: str) -> NDArray[Any]:
    """Three numbers of this type, which lie in memory in one of these ways."""
    numbers = np.array([1.0, 2.5, -3.0]).astype(kind)
    if form == "unaligned":
        moved = np.zeros(numbers.nbytes + 1, np.uint8)[1:].view(kind)
        moved[:] = numbers
        return moved
    ways = {
        "stepped": np.repeat(numbers, 2)[::2],
        "swapped": numbers.astype(numbers.dtype.newbyteorder()),
        "deep": numbers[None],
        "empty": numbers[:0],
        "later": numbers[1:],
    }
    numbers = ways.get(form, numbers)
    numbers.flags.writeable = form != "locked"
    return numbers


KINDS = "f8", "f4", "i8", "u8", "?", "c16", "M8[s]"
FORMS = "plain", "locked", "swapped", "unaligned", "stepped", "deep", "empty", "later"
NUMBERS = (
    *(True, False, np.True_, np.False_, 0, -3, 2**63 - 1, -(2**63), 2**63, -(2**63) - 1, 2**64, 2**200, np.int64(-3)),
    *(0.0, -0.0, 1.5, np.nan, np.inf, np.float64(2.5), np.float32(1.5), np.float16(1.5), np.longdouble(1.5)),
    *(np.int8(3), np.int32(3), np.uint8(3), np.uint64(2**63), np.datetime64(3, "s"), np.timedelta64(3, "s")),
    *(None, "3", 1j, (1,), np.array(3)),
)
CHANGES: list[dict[str, Any]] = [
    *({"values": column(kind, form)} for kind in KINDS for form in FORMS),
    *({name: number} for name in ("factor", "by", "twice") for number in NUMBERS),
]


def test_an_entry_takes_what_numba_says_is_of_its_types_and_does_the_same() -> None:
    made, entry = scaling()
    taken = 0
    for change in CHANGES:
        given = {"values": column("f8", "plain"), "factor": 0.5, "by": 3, "twice": True} | change
        arguments = Both(given["values"], given["factor"]), given["by"], given["twice"]
        out, again = np.zeros(4), np.zeros(4)
        try:
            kinds = tuple(map(made.typeof_pyval, (*arguments, out)))
        except (ValueError, OverflowError):  # a number that numba has no type for
            kinds = ()
        aligned = given["values"].flags.aligned  # numba says nothing of it
        result = entry((*arguments, out))
        assert (result is not NotImplemented) == (aligned and kinds == made.signatures[0]), change
        if result is not NotImplemented:
            taken += 1
            assert np.array_equal(result, made(*arguments, again), equal_nan=True), change
            assert out.tobytes() == again.tobytes(), change
    assert 15 <= taken <= len(CHANGES) - 15


def test_kernels_raise_nothing() -> None:
    """Entries take each fault of a kernel for memory that is not there."""
    sources = list(cached.ROOM.glob("*/kernels*.py"))
    assert sources
    for source in sources:
        parts = ast.walk(ast.parse(source.read_text(encoding="utf-8")))
        assert not [part.lineno for part in parts if isinstance(part, ast.Raise | ast.Assert)], source


def test_arguments_of_all_kinds_arrive_and_the_result_comes_back() -> None:
    values, out = np.array([1.0, 2.5, -3.0]), np.zeros(3)
    call = kept(scaled, Both(values, 0.5), 3, False, out)
    held = [sys.getrefcount(each) for each in (values, out, Both, None, NotImplemented)]
    assert call(Both(values, 0.5), 3, True, out) == 1.5
    assert out.tolist() == [3.0, 7.5, -9.0]
    assert call(Both(values, np.float64(0.5)), np.int64(-3), np.False_, out) == -0.75
    assert out.tolist() == [-1.5, -3.75, 4.5]
    for _ in range(1_000):
        call(Both(values, 0.5), 3, True, out)
        call(Both(values, 0.5), 3.0, True, out)
    grown = [
        sys.getrefcount(each) - before
        for each, before in zip((values, out, Both, None, NotImplemented), held, strict=True)
    ]
    assert max(grown) < 100


def test_arguments_of_other_types_are_left_to_numba() -> None:
    values, out = np.array([1.0, 2.5, -3.0]), np.zeros(3)
    call = kept(scaled, Both(values, 0.5), 3, False, out)
    locked = np.zeros(3)
    locked.flags.writeable = False
    swapped = values.astype(values.dtype.newbyteorder())
    unaligned = np.zeros(25, np.uint8)[1:].view(np.float64)

    class Other(NamedTuple):
        values: NDArray[np.float64]
        factor: float

    for arguments in (
        (Both(values.astype(np.float32), 0.5), 3, True, out),
        (Both(values[None], 0.5), 3, True, out),
        (Both(np.zeros(6)[::2], 0.5), 3, True, out),
        (Both(swapped, 0.5), 3, True, out),
        (Both(unaligned, 0.5), 3, True, out),
        (Both(values, 1), 3, True, out),
        (Both(values, np.float32(0.5)), 3, True, out),
        (Both([1.0], 0.5), 3, True, out),
        ((values, 0.5), 3, True, out),
        (Other(values, 0.5), 3, True, out),
        (Both(values, 0.5), 2**63, True, out),
        (Both(values, 0.5), 3.0, True, out),
        (Both(values, 0.5), True, True, out),
        (Both(values, 0.5), 3, 1, out),
        (Both(values, 0.5), 3, None, out),
        (Both(values, 0.5), 3, True, locked),
        (Both(values, 0.5), 3, True),
        (Both(values, 0.5), 3, True, out, out),
    ):
        assert call(*arguments) is NotImplemented
    assert out.tolist() == [1.5, 3.75, -4.5]  # of the call that compiled it


def taking(room: int) -> float:
    """A kernel with much memory of its own."""
    taken = np.empty(room)
    taken[room // 2] = 1.0
    return taken[room // 2]


def test_memory_that_is_not_there_is_an_error_of_python() -> None:
    call = kept(taking, 10)
    assert call(10) == 1.0
    with pytest.raises(MemoryError):
        call(2**57)


def pair(x: float) -> tuple[float, float]:
    return x, -x


def test_what_no_entry_can_give_back_is_refused() -> None:
    with pytest.raises(NoEntryError, match="no result can be"):
        kept(pair, 1.0)


def test_code_that_calls_what_this_process_does_not_have_is_not_linked(monkeypatch: pytest.MonkeyPatch) -> None:
    counts, start = np.array([[2, 0, 1]], np.int32), np.zeros(4, np.int32)
    kernel = CachedKernel(kernels.__name__, "begin")
    kernel(counts.copy(), start)  # there is an entry now
    monkeypatch.setattr(cached, "all_in_process", lambda functions: False)
    other = CachedKernel(kernels.__name__, "begin")
    again = np.zeros(4, np.int32)
    other(counts.copy(), again)
    assert again.tolist() == start.tolist() == [0, 2, 2, 3]
    assert other.entries == ()


def test_objects_lie_in_memory_as_entries_expect(monkeypatch: pytest.MonkeyPatch) -> None:
    assert readable()
    monkeypatch.setattr(cached, "FLAGS", cached.FLAGS + 4)
    readable.cache_clear()
    assert not readable()
    monkeypatch.undo()
    readable.cache_clear()
    assert readable()
