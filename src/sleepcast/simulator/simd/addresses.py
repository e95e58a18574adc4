"""Kernels by their addresses, for native code that calls them; without loading numba, if another process has already
compiled them.

The machine code of all of them lies in one piece in the cache of kernels. Only making it needs numba.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from threading import Lock
from typing import TYPE_CHECKING, Any

from sleepcast.core.code_cache import target_machine
from sleepcast.core.linking import LinkedCode
from sleepcast.simulator.simd.cached import ENTRIES, ROOM_NAME, identity

if TYPE_CHECKING:
    from llvmlite.binding import ModuleRef, TargetMachine

MODULE = f"{ROOM_NAME}.neighbours.kernels_neighbours"
SIGNATURES: Mapping[str, tuple[str, str]] = {
    "begin": ("void", "i64"),
    "prepare": ("void", "i64"),
    "ask_lanes": ("void", "i64 i64 i64 i64 i64 i64"),
}
"""The kernels of that module that native code calls: what each gives and takes."""
IN_BALL = "_in_ball"
"""What the names of some of them end with where something flies."""
FROM_LIBRARY = frozenset({"memset", "memcpy", "memmove"})
"""Functions outside that the code may call: every process has them."""
_ONE_AT_A_TIME = Lock()


def addresses(*, flies: bool = False) -> Mapping[str, int] | None:
    """The address of each kernel; None where they cannot be compiled. flies: for worlds in which something does."""
    with _ONE_AT_A_TIME:
        loaded = _loaded(flies)
    return None if loaded is None else loaded[1]


@cache
def _loaded(flies: bool) -> tuple[LinkedCode, Mapping[str, int]] | None:
    """The code, and where each kernel is in it."""
    if find_spec("numba") is None or find_spec("llvmlite") is None:
        return None
    name = f"{identity()}-by-address{IN_BALL if flies else ''}"
    code = ENTRIES.load(name)
    if code is None:
        code = _made(target_machine(3), flies)
        if code is None:
            return None
        ENTRIES.save(name, code)
    loaded = LinkedCode((code,))
    return loaded, {each: loaded.address(f"sleepcast_{each}") for each in SIGNATURES}


def _made(target: TargetMachine, flies: bool) -> bytes | None:
    """The object file with all kernels, each callable from C as `sleepcast_` and its name; None where it would need
    something that is not in every process."""
    from llvmlite import binding

    kernels = import_module(MODULE)
    texts, modules = [], []
    for name, (gives, takes) in SIGNATURES.items():
        own = f"{name}{IN_BALL}"
        compiled = _compiled(getattr(kernels, own if flies and hasattr(kernels, own) else name), takes.split())
        modules.append(compiled.library._get_module_for_linking().clone())
        texts.append(_caller(name, compiled.fndesc.mangled_name, gives, takes.split()))
    whole = binding.parse_assembly("\n".join(texts))
    for module in modules:
        whole.link_in(module)
    return _object(whole, target)


def _object(module: ModuleRef, target: TargetMachine) -> bytes | None:
    """The object file of a module; None where linking it would end the process, over a function that is missing."""
    outside = {each.name for each in module.functions if each.is_declaration and not each.name.startswith("llvm.")}
    return bytes(target.emit_object(module)) if outside <= FROM_LIBRARY else None


def _compiled(kernel: Any, takes: list[str]) -> Any:
    """numba's result of compiling a kernel for such arguments."""
    from numba.core import types

    kinds = tuple({"i64": types.int64, "double": types.float64}[each] for each in takes)
    kernel.compile(kinds)
    return kernel.overloads[kinds]


def _caller(name: str, mangled: str, gives: str, takes: list[str]) -> str:
    """A function of C that calls one of numba, which gives its result through a pointer, and a status."""
    named = ", ".join(f"{kind} %a{index}" for index, kind in enumerate(takes))
    result = "ptr" if gives == "void" else gives
    end = "ret void" if gives == "void" else f"%value = load {gives}, ptr %result\nret {gives} %value"
    return f"""
declare i32 @"{mangled}"(ptr, ptr, {", ".join(takes)})
define {gives} @sleepcast_{name}({named}) {{
%result = alloca {result}
%fault = alloca ptr
call i32 @"{mangled}"(ptr %result, ptr %fault, {named})
{end}
}}"""
