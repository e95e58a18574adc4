"""Machine code that was kept is linked as LLVM links it, or by LLVM."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from pathlib import Path

import pytest

from sleepcast.core.code_cache import processor, version_of
from sleepcast.core.object_code import HERE, CodeOfLlvm, LinkedCode, UnlinkableError, in_process, linked

binding = pytest.importorskip("llvmlite.binding")
NATIVE = pytest.mark.skipif(not HERE, reason="LLVM links all code of this computer")
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
AGAIN = "define linkonce_odr i64 @there(i64 %x) { ret i64 0 }"


def code(text: str, *, model: str = "jitdefault") -> bytes:
    """The object file of a module's text."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    target = binding.Target.from_triple(binding.get_process_triple())
    machine = target.create_target_machine(opt=0, jit=model == "jitdefault", codemodel=model)
    made: bytes = machine.emit_object(binding.parse_assembly(text))
    return made


@ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)
def tenfold(number: float) -> float:
    return 10.0 * number


OUTSIDE = {"outside": ctypes.cast(tenfold, ctypes.c_void_p).value or 0}


@pytest.mark.parametrize("linker", [pytest.param(LinkedCode, marks=NATIVE), CodeOfLlvm, linked])
def test_code_reaches_its_own_data_other_files_and_the_process(linker: type[LinkedCode]) -> None:
    made = linker((code(CALLING), code(THERE), code(AGAIN)), OUTSIDE)
    entry = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(made.address("entry"))
    assert entry(0) == 41 + 1 + 25 + 0 + 1_000
    assert entry(1) == 42 + 2 + 25 + 410_000 + 1_000


@NATIVE
def test_two_pieces_of_the_same_code_have_data_of_their_own() -> None:
    entries = []
    pieces = [LinkedCode((code(CALLING), code(THERE)), OUTSIDE) for _ in range(2)]
    for made in pieces:
        entries.append(ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(made.address("entry")))
    assert entries[0](0) == entries[1](0)


def test_code_of_another_kind_is_left_to_llvm() -> None:
    objects = code(CALLING, model="small"), code(THERE, model="small")
    with pytest.raises(UnlinkableError):
        LinkedCode(objects, OUTSIDE)


@pytest.mark.parametrize("damage", [b"", b"\x7fELF", b"MZ" + bytes(100)])
def test_what_is_no_object_file_is_refused(damage: bytes) -> None:
    with pytest.raises(UnlinkableError, match="not for this computer"):
        LinkedCode((damage,), {})


@NATIVE
def test_a_function_that_nobody_has_is_named() -> None:
    with pytest.raises(UnlinkableError, match="no outside"):
        LinkedCode((code(CALLING), code(THERE)), {})
    assert in_process("malloc")


READ_ONLY = """
import ctypes, sys
from core.test_object_code import THERE, code
from sleepcast.core.object_code import LinkedCode

made = LinkedCode((code(THERE),), {})
print("writing", flush=True)
ctypes.memset(made.address("there"), 0, 1)
print("written")
"""


@NATIVE
def test_code_cannot_be_written_to() -> None:
    tests = str(Path(__file__).parent.parent)
    program = f"import sys; sys.path.insert(0, {tests!r})\n{READ_ONLY}"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.stdout, done.returncode < 0) == ("writing\n", True)


def test_a_processor_and_a_library_are_told_without_loading_llvm() -> None:
    program = (
        "import sys; from sleepcast.core.code_cache import processor, version_of; "
        "processor(); version_of('llvmlite'); print('llvmlite' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == str(not HERE)
    assert len(processor()) > 20
    assert b"version" in version_of("llvmlite")
    assert version_of("no_such_library") == b""
