"""Object files become code that runs: ours and LLVM's in the same way, and LLVM links whatever we do not know."""

from __future__ import annotations

import ctypes
import platform
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import pytest

from sleepcast.core import linking
from sleepcast.core.code_cache import target_machine
from sleepcast.core.linking import ByLLVM, Linked, LinkedCode, UnlinkableError, in_process

Linker: TypeAlias = Callable[..., LinkedCode | Linked | ByLLVM]
binding = pytest.importorskip("llvmlite.binding")
OURS = sys.platform == "linux" and platform.machine() == "x86_64"
LINKERS = [LinkedCode, ByLLVM, *([Linked] if OURS else [])]
ours = pytest.mark.skipif(not OURS, reason="here LLVM links everything")

CALLING = """
@count = global i64 40
@zeros = common global [64 x i64] zeroinitializer, align 64
@table = constant [2 x ptr] [ptr @one, ptr @two]
declare i64 @there(i64)
declare double @outside(double)
declare i64 @labs(i64)
define internal i64 @one() { ret i64 1 }
define internal i64 @two() { ret i64 2 }
define i64 @entry(i64 %which) {
  %before = load i64, ptr @count
  %after = add i64 %before, 1
  store i64 %after, ptr @count
  %slot = getelementptr [64 x i64], ptr @zeros, i64 0, i64 63
  %zero = load i64, ptr %slot
  store i64 %after, ptr %slot
  %place = getelementptr [2 x ptr], ptr @table, i64 0, i64 %which
  %function = load ptr, ptr %place
  %small = call i64 %function()
  %real = call double @outside(double 2.5)
  %whole = fptosi double %real to i64
  %other = call i64 @there(i64 %zero)
  %positive = call i64 @labs(i64 -1000)
  %a = add i64 %after, %small
  %b = add i64 %a, %whole
  %c = add i64 %b, %other
  %d = add i64 %c, %positive
  ret i64 %d
}
"""
THERE = "define i64 @there(i64 %x) { %y = mul i64 %x, 10000 ret i64 %y }"


def compiled(text: str) -> bytes:
    """The object file of a module's text."""
    made: bytes = target_machine().emit_object(binding.parse_assembly(text))
    return made


@ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)
def tenfold(number: float) -> float:
    return 10.0 * number


@pytest.mark.parametrize("link", LINKERS)
def test_code_reaches_its_own_data_other_files_and_the_process(link: Linker) -> None:
    """And each piece has data of its own, though they were made of the same files."""
    outside = {"outside": ctypes.cast(tenfold, ctypes.c_void_p).value or 0}
    objects = compiled(CALLING), compiled(THERE)
    pieces = [link(objects, outside) for _ in range(2)]
    for piece in pieces:
        entry = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(piece.address("entry"))
        assert entry(0) == 41 + 1 + 25 + 0 + 1_000
        assert entry(1) == 42 + 2 + 25 + 410_000 + 1_000


@pytest.mark.parametrize("link", LINKERS)
def test_of_what_several_files_have_one_counts_for_all(link: Linker) -> None:
    """A strong one, where there is one."""
    weak = "define weak i64 @shared() {{ ret i64 {} }}"
    strong = "define i64 @shared() { ret i64 7 }"
    calls = "declare i64 @shared()\ndefine i64 @asked() { %a = call i64 @shared() ret i64 %a }"
    for others, wanted in (([weak.format(1), weak.format(2)], 1), ([weak.format(1), strong], 7)):
        piece = link([compiled(text) for text in (*others, calls)])
        assert ctypes.CFUNCTYPE(ctypes.c_int64)(piece.address("asked"))() == wanted


@ours
def test_what_we_link_needs_no_llvm() -> None:
    ask = """
import ctypes, sys
from sleepcast.core.linking import LinkedCode
piece = LinkedCode([sys.stdin.buffer.read()])
print(ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(piece.address("there"))(2), "llvmlite" in sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", ask], input=compiled(THERE), capture_output=True, check=True)
    assert done.stdout.split() == [b"20000", b"False"]


@ours
def test_what_is_of_another_kind_is_left_to_llvm() -> None:
    there = compiled(THERE)
    near = binding.Target.from_triple(binding.get_process_triple()).create_target_machine(codemodel="small")
    text = "@data = global i64 3\ndefine i64 @there(i64 %x) { %y = load i64, ptr @data ret i64 %y }"
    small = near.emit_object(binding.parse_assembly(text))
    of_thread = compiled("@own = thread_local global i64 3\ndefine ptr @there() { ret ptr @own }")
    other = bytearray(there)
    other[18:20] = (183).to_bytes(2, "little")
    lost = compiled("declare void @nobody_has_this()\ndefine void @a() { call void @nobody_has_this() ret void }")
    for objects in ([small], [of_thread], [bytes(other)], [there, bytes(other)], [b""], [there[:200]], [lost]):
        with pytest.raises((UnlinkableError, linking.TooShortError)):
            Linked(objects, {})
    piece = LinkedCode([small])
    assert ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(piece.address("there"))(5) == 3


@ours
def test_where_memory_may_not_be_run_llvm_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(base: int, size: int) -> None:
        raise PermissionError

    monkeypatch.setattr(linking, "_protect", refuse)
    assert isinstance(LinkedCode([compiled(THERE)])._linked, ByLLVM)


@ours
def test_code_cannot_be_changed_where_it_lies() -> None:
    """Only its variables can."""
    objects = compiled(CALLING), compiled(THERE)
    piece = Linked(objects, {"outside": ctypes.cast(tenfold, ctypes.c_void_p).value or 0})
    ways = {}
    for line in Path("/proc/self/maps").read_text().splitlines():
        place, way, *_ = line.split()
        start, end = (int(each, 16) for each in place.split("-"))
        for name in ("entry", "there", "table", "count", "zeros"):
            if start <= piece.address(name) < end:
                ways[name] = way[:3]
    assert ways == {"entry": "r-x", "there": "r-x", "table": "r-x", "count": "rw-", "zeros": "rw-"}


@ours
def test_memory_is_given_back() -> None:
    def mapped() -> int:
        return int(Path("/proc/self/statm").read_text().split()[0])

    code = compiled(THERE)
    LinkedCode([code])
    before = mapped()
    for _ in range(2_000):
        LinkedCode([code])
    assert mapped() - before < 1_000


def test_names_of_the_process() -> None:
    assert in_process("labs") is not None
    assert in_process("Py_IncRef") is not None
    assert in_process("nobody_has_this") is None
