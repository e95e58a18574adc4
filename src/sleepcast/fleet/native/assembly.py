"""Assembly: writes LLVM code as text, for several robots at once, one in each lane of a vector.

Values are names of results, or constants, as text; the methods append instructions and return the new names. Values
that change lie in cells on the stack, which the optimiser turns into registers, so real branches are possible:
`when` skips code that no lane reaches.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager


class Assembly:
    """The body of one function. lanes: robots at a time, a power of two; with one lane, values are scalars."""

    def __init__(self, lanes: int) -> None:
        self.lanes = lanes
        self.real, self.truth = self.vector("double"), self.vector("i1")
        self.byte, self.short, self.whole, self.long = (self.vector(f"i{bits}") for bits in (8, 16, 32, 64))
        self.yes, self.no = self.constant("i1", "true"), self.constant("i1", "false")
        self.nan, self.zero, self.one = self.number(float("nan")), self.number(0.0), self.number(1.0)
        self.lines: list[str] = []
        self.cells: list[str] = []
        self.outside: dict[str, str] = {}
        """Declarations and further functions of the module, by name."""
        self._names = 0

    # ---- constants and instructions

    def vector(self, kind: str) -> str:
        """The type with one element per lane."""
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
        """An instruction with a result; returns its name."""
        name = self.fresh()
        self.lines.append(f"{name} = {instruction}")
        return name

    def do(self, instruction: str) -> None:
        """An instruction without a result."""
        self.lines.append(instruction)

    def binary(self, operation: str, kind: str, a: str, b: str) -> str:
        return self.emit(f"{operation} {kind} {a}, {b}")

    def compare(self, how: str, a: str, b: str) -> str:
        """Compare numbers; how: LLVM's name of the comparison, such as `olt`."""
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
        """Where `a` is false."""
        return self.no if a == self.yes else self.yes if a == self.no else self.binary("xor", self.truth, a, self.yes)

    def convert(self, how: str, kind: str, a: str, to: str) -> str:
        return self.emit(f"{how} {kind} {a} to {to}")

    def call(self, name: str, kind: str, arguments: Sequence[str], kinds: Sequence[str]) -> str:
        given = ", ".join(f"{k} {a}" for k, a in zip(kinds, arguments, strict=True))
        return self.emit(f"call {kind} @{name}({given})")

    def intrinsic(self, name: str, *arguments: str) -> str:
        """Call an LLVM intrinsic on numbers."""
        full = f"llvm.{name}.{'' if self.lanes == 1 else f'v{self.lanes}'}f64"
        kinds = [self.real] * len(arguments)
        self.outside[full] = f"declare {self.real} @{full}({', '.join(kinds)})"
        return self.call(full, self.real, arguments, kinds)

    def any(self, mask: str) -> str:
        """Whether a mask holds in any lane, as a scalar."""
        if self.lanes == 1:
            return mask
        return self.emit(f"icmp ne i{self.lanes} {self.convert('bitcast', self.truth, mask, f'i{self.lanes}')}, 0")

    def splat(self, kind: str, value: str) -> str:
        """A scalar broadcast to every lane."""
        if self.lanes == 1:
            return value
        vector = self.vector(kind)
        first = self.emit(f"insertelement {vector} poison, {kind} {value}, i32 0")
        return self.emit(f"shufflevector {vector} {first}, {vector} poison, <{self.lanes} x i32> zeroinitializer")

    def call_each(self, function: str, context: str, first: str, numbers: Sequence[str], mask: str) -> str:
        """A C function, called for all lanes of the mask with a context, the index of the first lane and their numbers:
        see `NativeCall`; 0 in the other lanes. function, context: pointers."""
        results, given = self.cell(self.real, self.zero), self.cell(f"[{max(1, len(numbers))} x {self.real}]")
        with self.when(self.any(mask)):
            for place, number in enumerate(numbers):
                self.put(self.at(given, self.real, str(place)), self.real, number)
            bits = self.emit(f"bitcast {self.truth} {mask} to i{self.lanes}")
            lanes = self.emit(f"zext i{self.lanes} {bits} to i64")
            of_each = f"i64 {first}, i64 {lanes}, i64 {self.lanes}, ptr {given}, ptr {results}"
            self.do(f"call void {function}(ptr {context}, {of_each})")
        return self.get(results, self.real)

    # ---- memory

    def cell(self, kind: str, value: str = "") -> str:
        """A variable on the stack. value: its initial value."""
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
        """The address of an element of a column. kind: of one element."""
        return self.emit(f"getelementptr {kind}, ptr {column}, i64 {index}")

    # ---- branches and loops

    def label(self) -> str:
        return self.fresh()[1:]

    def begin(self, label: str) -> None:
        self.lines.append(f"{label}:")

    @contextmanager
    def when(self, truth: str) -> Iterator[None]:
        """The code written inside runs only if the scalar `truth` holds."""
        inside, after = self.label(), self.label()
        self.do(f"br i1 {truth}, label %{inside}, label %{after}")
        self.begin(inside)
        yield
        self.do(f"br label %{after}")
        self.begin(after)

    @contextmanager
    def repeated(self, count: int) -> Iterator[str]:
        """The code written inside runs `count` times; yields the counter, from 0."""
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
