"""Links machine code that was compiled before: object files as LLVM makes them for code that it runs itself.

On x86-64 this takes no LLVM, whose loading would take longer than all else: such code has the large code model, where
all addresses are whole words, so there is nothing to do but to lay out the sections and to fill in the addresses. Code
of another kind, and on other computers, LLVM links.
"""

from __future__ import annotations

import ctypes
import mmap
import platform
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from itertools import chain
from struct import Struct
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

HERE = sys.platform == "linux" and platform.machine() == "x86_64" and sys.maxsize > 2**32
"""Whether this computer runs such code."""
MARK, X86_64 = b"\x7fELF\x02\x01\x01", 62
HEADER, SECTION = Struct("<16sHHIQQQIHHHHHH"), Struct("<IIQQQQIIQQ")
SYMBOL = np.dtype("<u4, u1, u1, <u2, <u8, <u8")
"""The place of its name, how it is bound, (not used,) its section, its value and its size."""
RELOCATION = np.dtype([("place", "<u8"), ("kind", "<u4"), ("symbol", "<u4"), ("addend", "<i8")])
SYMBOLS, RELOCATIONS, ZEROS, UNWINDING = 2, 4, 8, 0x70000001
"""Kinds of sections. Nothing unwinds this code, which raises nothing."""
WRITEABLE, LOADED = 1, 2
"""Flags of sections."""
ELSEWHERE, COMMON = 0, 0xFFF2
"""What stands for a symbol's section: it is in another file; room for it, that is zero, has to be found."""
LOCAL, WHOLE_ADDRESS = 0, 1
"""How a symbol is bound that others do not see; the kind of relocation that is a word with an address."""


class UnlinkableError(Exception):
    """Object files that cannot be linked here; LLVM can."""


class CodeSection(NamedTuple):
    """A part of an object file. data: nothing where it is all zeros; link, target: other sections that belong to it."""

    kind: int
    flags: int
    data: bytes
    size: int
    link: int
    target: int
    align: int


class CodeSymbol(NamedTuple):
    """A name of an object file. value: where it is in its section, or how its room is aligned."""

    name: str
    local: bool
    section: int
    value: int
    size: int


class ObjectFile:
    """An object file. Raises UnlinkableError for one that is not for this computer.

    places: where its sections, by number, and its common symbols, by name, are laid out
    """

    def __init__(self, code: bytes) -> None:
        if not HERE or len(code) < HEADER.size:
            raise UnlinkableError("not for this computer")
        mark, _, machine, _, _, _, table, _, _, _, _, each, count, _ = HEADER.unpack_from(code)
        if not mark.startswith(MARK) or machine != X86_64 or each != SECTION.size:
            raise UnlinkableError("not for this computer")
        self.sections = [_section(code, table + number * each) for number in range(count)]
        self.symbols = list(chain.from_iterable(self._symbols(each) for each in self.sections if each.kind == SYMBOLS))
        self.places: dict[int | str, int] = {}

    def _symbols(self, section: CodeSection) -> Iterator[CodeSymbol]:
        texts = self.sections[section.link].data
        for start, info, _, inside, value, size in np.frombuffer(section.data, SYMBOL).tolist():
            yield CodeSymbol(texts[start : texts.index(0, start)].decode(), info >> 4 == LOCAL, inside, value, size)

    def lay_out(self, end: int, *, writeable: bool) -> int:
        """Find places from `end` on for what can be written, or for all else; gives where that ends."""
        for number, section in enumerate(self.sections):
            if section.flags & LOADED and section.kind != UNWINDING and bool(section.flags & WRITEABLE) == writeable:
                end += -end % section.align
                self.places[number] = end
                end += section.size
        for symbol in self.symbols if writeable else ():
            if symbol.section == COMMON:
                end += -end % max(symbol.value, 1)
                self.places[symbol.name] = end
                end += symbol.size
        return end

    def place(self, symbol: CodeSymbol) -> int | None:
        """Where this file has a symbol."""
        if symbol.section == COMMON:
            return self.places[symbol.name]
        begin = self.places.get(symbol.section)
        return None if begin is None or symbol.section == ELSEWHERE else begin + symbol.value


class Linked(Protocol):
    """Machine code in memory; it is there as long as this object."""

    def address(self, name: str) -> int:
        """Where the function of this name begins."""


def linked(objects: Sequence[bytes], others: Mapping[str, int]) -> Linked:
    """Machine code, ready to run.

    objects: object files, of which the first one that has a name counts
    others: addresses of names that none of them has; what is not among these must be in the process
    """
    try:
        return LinkedCode(objects, others)
    except UnlinkableError:
        return CodeOfLlvm(objects, others)


class CodeOfLlvm:
    """What LLVM has linked."""

    def __init__(self, objects: Sequence[bytes], others: Mapping[str, int]) -> None:
        from llvmlite import binding

        binding.initialize_native_target()
        binding.initialize_native_asmprinter()
        target = binding.Target.from_triple(binding.get_process_triple()).create_target_machine(jit=True)
        for name, address in others.items():
            binding.add_symbol(name, address)
        self._engine: Any = binding.create_mcjit_compiler(binding.parse_assembly(""), target)
        for code in objects:
            self._engine.add_object_file(binding.ObjectFileRef.from_data(code))
        self._engine.finalize_object()

    def address(self, name: str) -> int:
        return int(self._engine.get_function_address(name))


def _section(code: bytes, place: int) -> CodeSection:
    _, kind, flags, _, start, size, link, target, align, _ = SECTION.unpack_from(code, place)
    return CodeSection(
        kind, flags, b"" if kind == ZEROS else code[start : start + size], size, link, target, max(align, 1)
    )


class LinkedCode:
    """What is linked here; see `linked`. Raises UnlinkableError where only LLVM can."""

    def __init__(self, objects: Sequence[bytes], others: Mapping[str, int]) -> None:
        files, end = [ObjectFile(code) for code in objects], 0
        for file in files:
            end = file.lay_out(end, writeable=False)
        fixed = end = end + -end % mmap.PAGESIZE
        for file in files:
            end = file.lay_out(end, writeable=True)
        self._bytes = np.frombuffer(mmap.mmap(-1, end, prot=mmap.PROT_READ | mmap.PROT_WRITE), np.uint8)
        self._start = int(self._bytes.ctypes.data)
        self._names: dict[str, int] = {}
        for file in files:
            for symbol in file.symbols:
                if not symbol.local and (place := file.place(symbol)) is not None:
                    self._names.setdefault(symbol.name, self._start + place)
        for file in files:
            self._fill(file, others)
        _execute(self._start, fixed)

    def address(self, name: str) -> int:
        return self._names[name]

    def _fill(self, file: ObjectFile, others: Mapping[str, int]) -> None:
        """Write a file's sections, and the addresses in them."""
        for number, section in enumerate(file.sections):
            if number in file.places:
                place = file.places[number]
                self._bytes[place : place + len(section.data)] = np.frombuffer(section.data, np.uint8)
        addresses = np.array([self._address(file, symbol, others) for symbol in file.symbols], np.uint64)
        for section in file.sections:
            if section.kind == RELOCATIONS and section.target in file.places:
                rows = np.frombuffer(section.data, RELOCATION)
                if (rows["kind"] != WHOLE_ADDRESS).any():
                    raise UnlinkableError("an address that is not a whole word")
                words = addresses[rows["symbol"]] + rows["addend"].astype(np.uint64)
                self._write(file.places[section.target] + rows["place"].astype(np.int64), words)

    def _write(self, places: NDArray[np.int64], words: NDArray[np.uint64]) -> None:
        """Write words at places that need not be those of words."""
        self._bytes[places[:, None] + np.arange(8)] = words.view(np.uint8).reshape(-1, 8)

    def _address(self, file: ObjectFile, symbol: CodeSymbol, others: Mapping[str, int]) -> int:
        """Where a symbol of a file is; 0 for one of what is not loaded."""
        if symbol.local:
            place = file.place(symbol)
            return 0 if place is None else self._start + place
        if symbol.name in self._names:
            return self._names[symbol.name]
        return others[symbol.name] if symbol.name in others else in_process(symbol.name)


@cache
def in_process(name: str) -> int:
    """Where the process has a function that everybody may call. Raises UnlinkableError if it has none."""
    try:
        return ctypes.cast(getattr(ctypes.CDLL(None), name), ctypes.c_void_p).value or 0
    except AttributeError:
        raise UnlinkableError(f"this process has no {name}") from None


def _execute(start: int, size: int) -> None:
    """Let a piece of memory be code, which cannot be written to any more."""
    protect: Callable[[int, int, int], int] = ctypes.CDLL(None, use_errno=True).mprotect
    protect.argtypes = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int  # type: ignore[attr-defined]
    if protect(start, size, mmap.PROT_READ | mmap.PROT_EXEC):
        raise UnlinkableError("the system lets no memory become code")
