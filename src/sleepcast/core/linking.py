"""Machine code in memory, linked from object files.

What LLVM makes for code that a process runs itself is simple on Linux and x86-64: every address in it is a whole word,
wherever it leads. That we link ourselves, for to load LLVM takes longer than twenty robots take for a minute. LLVM
links what is of another kind.
"""

from __future__ import annotations

import ctypes
import mmap
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache
from struct import Struct
from struct import error as TooShortError
from typing import Any

from sleepcast.core.code_cache import target_machine
from sleepcast.core.records import NamedTuple

HEADER = Struct("<4sBBB9xHH20xQ10xHH2x")
"""Of a file: its mark, class, byte order and version, kind and processor, where its sections are described, the size of
a description, and their number."""
RELOCATABLE_X86_64 = b"\x7fELF", 2, 1, 1, 1, 62
SECTION = Struct("<IIQQQQIIQQ")
SYMBOL = Struct("<IBBHQQ")
RELOCATION = Struct("<QQq")
WORD = Struct("<Q")
SYMBOLS, RELOCATIONS, NOTHING, UNWINDING = 2, 4, 8, 0x70000001
"""Kinds of sections: those of no data are zeros, and how to unwind a stack nobody asks, for nothing is thrown."""
WRITABLE, LOADED, EXECUTABLE, OF_THREAD = 0x1, 0x2, 0x4, 0x400
"""Flags of sections."""
UNDEFINED, RESERVED, COMMON = 0, 0xFF00, 0xFFF2
"""Sections of symbols that are in none."""
LOCAL, GLOBAL, WEAK = 0, 1, 2
ABSOLUTE_64 = 1
"""The one kind of place that is filled: with the whole address of a symbol."""


class UnlinkableError(Exception):
    """An object file, or a computer, of another kind."""


class LinkedCode:
    """Machine code in memory, ready to run; it is there as long as this object.

    objects: object files, as LLVM makes them for code that it runs itself
    others: addresses of names that none of them has. What is not among these must be in the process: LLVM ends it over
        a name that nobody has
    """

    def __init__(self, objects: Sequence[bytes], others: Mapping[str, int] | None = None) -> None:
        try:
            self._linked: Linked | ByLLVM = Linked(objects, others)
        except (UnlinkableError, TooShortError, OSError):
            self._linked = ByLLVM(objects, others)

    def address(self, name: str) -> int:
        """Where the function of this name begins."""
        return self._linked.address(name)


class ByLLVM:
    """What LLVM has linked."""

    def __init__(self, objects: Sequence[bytes], others: Mapping[str, int] | None = None) -> None:
        from llvmlite import binding

        for name, address in (others or {}).items():
            binding.add_symbol(name, address)
        self._engine: Any = binding.create_mcjit_compiler(binding.parse_assembly(""), target_machine())
        for code in objects:
            self._engine.add_object_file(binding.ObjectFileRef.from_data(code))
        self._engine.finalize_object()

    def address(self, name: str) -> int:
        return int(self._engine.get_function_address(name))


class Section(NamedTuple):
    """A description of a section, as it stands in a file."""

    name: int
    kind: int
    flags: int
    address: int
    offset: int
    size: int
    link: int
    info: int
    alignment: int
    entry: int


class ObjectFile:
    """What is in one file. Raises UnlinkableError for a file of another kind.

    places: where each of its sections is laid, by number, counted from the beginning of all
    """

    def __init__(self, data: bytes) -> None:
        *kind, start, size, count = HEADER.unpack_from(data)
        if tuple(kind) != RELOCATABLE_X86_64 or size != SECTION.size or len(data) < start + count * size:
            raise UnlinkableError("not an object file for this kind of processor")
        self.data = data
        self.sections = [Section(*each) for each in SECTION.iter_unpack(data[start : start + count * size])]
        self.symbols: list[tuple[int, int, int, int, int, int]] = []
        self.places: dict[int, int] = {}
        for each in self.sections:
            if each.flags & OF_THREAD:
                raise UnlinkableError("it has variables of threads")
            if each.kind == SYMBOLS:
                self.symbols = list(SYMBOL.iter_unpack(self.content(each)))
                self._names = self.sections[each.link].offset

    def content(self, section: Section) -> bytes:
        return self.data[section.offset : section.offset + section.size]

    def name(self, start: int) -> str:
        """The name of a symbol, which begins here in the table of names."""
        start += self._names
        return self.data[start : self.data.index(b"\0", start)].decode()

    def loaded(self, writable: bool) -> Iterator[tuple[int, Section]]:
        """The sections that are laid into memory, with their numbers."""
        for number, each in enumerate(self.sections):
            if each.flags & LOADED and each.size and each.kind != UNWINDING and bool(each.flags & WRITABLE) == writable:
                yield number, each

    def relocations(self) -> Iterator[tuple[int, int, int]]:
        """Each place to be filled, from the beginning of all, with the symbol's number and what is added to it."""
        for each in self.sections:
            if each.kind != RELOCATIONS or each.info not in self.places:
                continue
            start = self.places[each.info]
            for place, info, plus in RELOCATION.iter_unpack(self.content(each)):
                if info & 0xFFFFFFFF != ABSOLUTE_64:
                    raise UnlinkableError(f"it has a place of kind {info & 0xFFFFFFFF}")
                yield start + place, info >> 32, plus


class Linked:
    """What we have linked. Raises UnlinkableError for what LLVM has to link, and OSError where no memory may be run."""

    def __init__(self, objects: Sequence[bytes], others: Mapping[str, int] | None = None) -> None:
        if sys.platform != "linux":
            raise UnlinkableError("another system")
        files = [ObjectFile(data) for data in objects]
        self._end = 0
        for file in files:
            self._lay(file, writable=False)
        read_only = self._end = _up(self._end, mmap.PAGESIZE)
        for file in files:
            self._lay(file, writable=True)
        common = self._lay_common(files)
        self._memory = mmap.mmap(-1, max(self._end, 1), mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        self._held = ctypes.c_char.from_buffer(self._memory)
        base = ctypes.addressof(self._held)
        self._names = {name: base + place for name, place in common.items()}
        weak = set(common)
        for file in files:
            self._name(file, base, weak)
        for file in files:
            self._fill(file, base, others or {})
        if read_only:
            _protect(base, read_only)

    def address(self, name: str) -> int:
        return self._names[name]

    def _room(self, size: int, alignment: int) -> int:
        """Take room for something; gives where."""
        place = _up(self._end, alignment)
        self._end = place + size
        return place

    def _lay(self, file: ObjectFile, *, writable: bool) -> None:
        for number, each in file.loaded(writable):
            file.places[number] = self._room(each.size, each.alignment)

    def _lay_common(self, files: Sequence[ObjectFile]) -> dict[str, int]:
        """Where variables are that are zeros in whatever file they stand, by their names."""
        places: dict[str, int] = {}
        for file in files:
            for start, _, _, section, alignment, size in file.symbols:
                if section == COMMON and (name := file.name(start)) not in places:
                    places[name] = self._room(size, alignment)
        return places

    def _name(self, file: ObjectFile, base: int, weak: set[str]) -> None:
        """Note where the names are that a file has for all: of weak ones the first, unless another file has a strong
        one."""
        for start, info, _, section, value, _ in file.symbols:
            if info >> 4 == LOCAL or section == UNDEFINED or section >= RESERVED:
                continue
            name = file.name(start)
            if name not in self._names or (name in weak and info >> 4 == GLOBAL):
                self._names[name] = base + file.places[section] + value
                weak.discard(name)
                if info >> 4 != GLOBAL:
                    weak.add(name)

    def _fill(self, file: ObjectFile, base: int, others: Mapping[str, int]) -> None:
        """Lay the sections of a file, and fill in addresses."""
        for number, place in file.places.items():
            if file.sections[number].kind != NOTHING:
                self._memory[place : place + file.sections[number].size] = file.content(file.sections[number])
        found: dict[int, int] = {}
        for place, number, plus in file.relocations():
            if number not in found:
                found[number] = self._address_of(file, number, base, others)
            WORD.pack_into(self._memory, place, (found[number] + plus) & 0xFFFFFFFFFFFFFFFF)

    def _address_of(self, file: ObjectFile, number: int, base: int, others: Mapping[str, int]) -> int:
        """The address of a symbol of a file."""
        start, info, _, section, value, _ = file.symbols[number]
        if info >> 4 == LOCAL and UNDEFINED < section < RESERVED:
            return base + file.places[section] + value
        name = file.name(start)
        address = self._names.get(name) or others.get(name) or in_process(name)
        if address is None:
            raise UnlinkableError(f"there is no {name}")
        return address


def _up(number: int, step: int) -> int:
    """The next multiple of a step."""
    return -(-number // max(step, 1)) * max(step, 1)


@cache
def _process() -> ctypes.CDLL:
    return ctypes.CDLL(None)


@cache
def in_process(name: str) -> int | None:
    """The address of what the process has by this name for everybody; None if it has nothing."""
    with suppress(ValueError):
        return ctypes.addressof(ctypes.c_char.in_dll(_process(), name))
    return None


def _protect(base: int, size: int) -> None:
    """Let memory be run, and not be changed any more. Raises OSError."""
    if _process().mprotect(ctypes.c_void_p(base), ctypes.c_size_t(size), mmap.PROT_READ | mmap.PROT_EXEC):
        raise OSError("memory may not be run here")
