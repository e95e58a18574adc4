"""Assembly: writes the text of LLVM code that works on several robots at once, one in each lane of a vector.

Values are the names of results, or constants, as text; the methods append instructions and give the new names. What
changes on the way lies in cells on the stack, which the optimiser turns into registers; so there may be real branches:
`when` leaves out what no lane comes to.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager


class Assembly:
    """The body of one function. lanes: robots at a time, a power of two; of one lane nothing is a vector."""

    def __init__(self, lanes: int) -> None:
        self.lanes = lanes
        self.real, self.truth = self.vector("double"), self.vector("i1")
        self.byte, self.short, self.whole, self.long = (self.vector(f"i{bits}") for bits in (8, 16, 32, 64))
        self.yes, self.no = self.constant("i1", "true"), self.constant("i1", "false")
        self.nan, self.zero, self.one = self.number(float("nan")), self.number(0.0), self.number(1.0)
        self.lines: list[str] = []
        self.cells: list[str] = []
        self.outside: dict[str, str] = {}
        """Declarations and functions that go beside this one, by name."""
        self._names = 0

    # ---- constants and instructions

    def vector(self, kind: str) -> str:
        """The type of something in every lane."""
        return kind if self.lanes == 1 else f"<{self.lanes} x {kind}>"

    def each_lane(self, kind: str, values: Sequence[str]) -> str:
        """Constants, one for each lane."""
        return values[0] if self.lanes == 1 else f"<{', '.join(f'{kind} {value}' for value in values)}>"

    def constant(self, kind: str, value: str) -> str:
        """The same value in every lane."""
        return self.each_lane(kind, [value] * self.lanes)

    def number(self, value: float) -> str:
        return self.constant("double", bits(value))

    def integer(self, kind: str, value: int) -> str:
        return self.constant(kind, str(value))

    def fresh(self) -> str:
        self._names += 1
        return f"%n{self._names}"

    def emit(self, instruction: str) -> str:
        """An instruction with a result; gives its name."""
        name = self.fresh()
        self.lines.append(f"{name} = {instruction}")
        return name

    def do(self, instruction: str) -> None:
        """An instruction without a result."""
        self.lines.append(instruction)

    def binary(self, operation: str, kind: str, a: str, b: str) -> str:
        return self.emit(f"{operation} {kind} {a}, {b}")

    def compare(self, how: str, a: str, b: str) -> str:
        """A comparison of numbers; how: as LLVM names it, `olt` and so on."""
        return self.emit(f"fcmp {how} {self.real} {a}, {b}")

    def select(self, mask: str, a: str, b: str, kind: str = "") -> str:
        kind = kind or self.real
        return a if mask == self.yes or a == b else self.emit(f"select {self.truth} {mask}, {kind} {a}, {kind} {b}")

    def both(self, a: str, b: str) -> str:
        if self.no in (a, b):
            return self.no
        return b if a == self.yes else a if b == self.yes else self.binary("and", self.truth, a, b)

    def either(self, a: str, b: str) -> str:
        if self.yes in (a, b):
            return self.yes
        return b if a == self.no else a if b == self.no else self.binary("or", self.truth, a, b)

    def neither(self, a: str) -> str:
        """Where `a` does not hold."""
        return self.no if a == self.yes else self.yes if a == self.no else self.binary("xor", self.truth, a, self.yes)

    def convert(self, how: str, kind: str, a: str, to: str) -> str:
        return self.emit(f"{how} {kind} {a} to {to}")

    def call(self, name: str, kind: str, arguments: Sequence[str], kinds: Sequence[str]) -> str:
        given = ", ".join(f"{k} {a}" for k, a in zip(kinds, arguments, strict=True))
        return self.emit(f"call {kind} @{name}({given})")

    def intrinsic(self, name: str, *arguments: str) -> str:
        """One of LLVM's own functions of numbers."""
        full = f"llvm.{name}.{'' if self.lanes == 1 else f'v{self.lanes}'}f64"
        kinds = [self.real] * len(arguments)
        self.outside[full] = f"declare {self.real} @{full}({', '.join(kinds)})"
        return self.call(full, self.real, arguments, kinds)

    def any(self, mask: str) -> str:
        """Whether a mask holds in any lane, as one truth."""
        if self.lanes == 1:
            return mask
        return self.emit(f"icmp ne i{self.lanes} {self.convert('bitcast', self.truth, mask, f'i{self.lanes}')}, 0")

    def splat(self, kind: str, value: str) -> str:
        """One value in every lane."""
        if self.lanes == 1:
            return value
        vector = self.vector(kind)
        first = self.emit(f"insertelement {vector} poison, {kind} {value}, i32 0")
        return self.emit(f"shufflevector {vector} {first}, {vector} poison, <{self.lanes} x i32> zeroinitializer")

    # ---- memory

    def cell(self, kind: str, value: str = "") -> str:
        """A place on the stack. value: what it holds from here on."""
        name = self.fresh()
        self.cells.append(f"{name} = alloca {kind}")
        if value:
            self.put(name, kind, value)
        return name

    def get(self, place: str, kind: str) -> str:
        return self.emit(f"load {kind}, ptr {place}, align 1")

    def put(self, place: str, kind: str, value: str) -> None:
        self.do(f"store {kind} {value}, ptr {place}, align 1")

    def at(self, column: str, kind: str, index: str) -> str:
        """Where an element of a column lies. kind: of one element."""
        return self.emit(f"getelementptr {kind}, ptr {column}, i64 {index}")

    # ---- ways

    def label(self) -> str:
        return self.fresh()[1:]

    def begin(self, label: str) -> None:
        self.lines.append(f"{label}:")

    @contextmanager
    def when(self, truth: str) -> Iterator[None]:
        """What is written inside is done only if one truth holds."""
        inside, after = self.label(), self.label()
        self.do(f"br i1 {truth}, label %{inside}, label %{after}")
        self.begin(inside)
        yield
        self.do(f"br label %{after}")
        self.begin(after)

    @contextmanager
    def repeated(self, count: int) -> Iterator[str]:
        """What is written inside is done so many times; gives the number of the time, from 0, as a number."""
        counter = self.cell("i32", "0")
        inside, after = self.label(), self.label()
        self.do(f"br label %{inside}")
        self.begin(inside)
        now = self.get(counter, "i32")
        yield self.splat("double", self.emit(f"uitofp i32 {now} to double"))
        following = self.emit(f"add i32 {now}, 1")
        self.put(counter, "i32", following)
        self.do(f"br i1 {self.emit(f'icmp ult i32 {following}, {count}')}, label %{inside}, label %{after}")
        self.begin(after)


def bits(value: float) -> str:
    """A number as LLVM reads it, to the last bit."""
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"
