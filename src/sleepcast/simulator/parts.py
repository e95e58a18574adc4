"""How functions are compiled that only ever become parts of kernels: up to what LLVM calls a module, and no further.

numba makes machine code of every function that it meets, and keeps it, though nobody runs it where those that call it
have a copy of their own. What comes of such a kernel is the same without.
"""

from __future__ import annotations

from typing import Any

from llvmlite import binding
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

ENVIRONMENT = "_ZN08NumbaEnv"
"""How the names of the places begin where numba notes what a function needs of Python."""


class _Part(JITCodeLibrary):
    """A function that others can take in, of which no machine code is made."""

    def _finalize_final_module(self) -> None:
        """Give room to what numba notes of any function, and to nothing else."""
        rooms = (str(each) for each in self._final_module.global_variables if each.name.startswith(ENVIRONMENT))
        self._codegen._add_module(binding.parse_assembly("\n".join(rooms)))
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()
        return 0


class _PartCompiler(Compiler):
    """Compiles a function to a `_Part`."""

    def __init__(self, typing: Any, target: Any, library: Any, *more: Any) -> None:
        super().__init__(typing, target, library or _Part(target.codegen(), "part"), *more)


PART: Any = {"pipeline_class": _PartCompiler, "no_cpython_wrapper": True, "_nrt": False, "cache": False}
"""What tells numba that a function is only part of others, and makes no arrays."""
