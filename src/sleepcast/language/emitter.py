"""The emitter: how generated code is written down: lines, blocks, temporaries, and operands in their order.

Code for a value is a `Piece`, a Python expression that is put where it is wanted. Whatever has an effect is written as
a statement at once, and everything that was to be evaluated before it is put into temporaries first.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from math import inf, nan, sqrt
from typing import NamedTuple

from sleepcast.language.operations import apply, between, enter, gauss, prob
from sleepcast.language.parts import Part


class Piece(NamedTuple):
    """Code for a value. code: a Python expression. atom: it can be repeated and has no effect. fixed: nothing
    later changes it. slow: what to compute instead if `code` comes out not finite ("" if it cannot)."""

    code: str
    atom: bool = False
    fixed: bool = False
    slow: str = ""


ZERO, ONE, UNKNOWN = Piece("0.0", True, True), Piece("1.0", True, True), Piece("N", True, True)


class Emitter(ABC):
    """The lines of one function that is being written."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.indent = " "
        self.temporaries = 0
        self.space: dict[str, object] = {
            "A": apply, "B": between, "E": enter, "G": gauss, "P": prob, "N": nan, "I": inf, "sqrt": sqrt,
        }  # fmt: skip

    # ---- writing

    def emit(self, line: str) -> None:
        self.lines.append(f"{self.indent}{line}\n")

    def temporary(self) -> str:
        self.temporaries += 1
        return f"t{self.temporaries}"

    def keep(self, piece: Piece) -> Piece:
        """The value in a temporary, as a statement, so that nothing later changes it."""
        if piece.fixed:
            return piece
        name = self.temporary()
        self.emit(f"{name}={self.safe(piece).code}")
        return Piece(name, True, True)

    def atom(self, piece: Piece) -> tuple[str, str]:
        """How to write the piece the first time it is evaluated, and how to repeat it."""
        piece = self.safe(piece)
        if piece.atom:
            return piece.code, piece.code
        name = self.temporary()
        return f"({name}:={piece.code})", name

    def safe(self, piece: Piece) -> Piece:
        """The piece with its check that the value is finite."""
        if not piece.slow:
            return piece
        name = self.temporary()
        return Piece(f"({name} if -I<({name}:={piece.code})<I else {piece.slow})")

    def constant(self, part: Part) -> str:
        """The name of `part` in the code's namespace."""
        name = f"p{part.index}"
        self.space[name] = part
        return name

    def block(self, head: str) -> str:
        """Open an indented block; gives the indent to come back to."""
        self.emit(head)
        before = self.indent
        self.indent += " "
        return before

    # ---- values

    @abstractmethod
    def value(self, part: Part) -> Piece:
        """The piece for `part`; what must happen first is written down."""

    def values(self, parts: Sequence[Part]) -> list[Piece]:
        """Pieces for operands in order: when a later one needs statements, earlier ones are computed before them."""
        pieces: list[Piece] = []
        for part in parts:
            mark = len(self.lines)
            piece = self.value(part)
            if len(self.lines) > mark:
                written, self.lines = self.lines[mark:], self.lines[:mark]
                pieces = [self.keep(p) for p in pieces]
                self.lines += written
            pieces.append(piece)
        return pieces

    def kept(self, parts: Sequence[Part]) -> list[str]:
        """Operands as codes that can be repeated in any order."""
        pieces = self.values(parts)
        if all(p.atom for p in pieces):
            return [p.code for p in pieces]
        return [self.keep(p).code for p in pieces]

    def arguments(self, parts: Sequence[Part]) -> str:
        """Operands as the inside of a tuple, a comma after each."""
        return "".join(f"{self.safe(p).code}," for p in self.values(parts))

    def last(self, parts: Sequence[Part]) -> Piece:
        """One after the other; the last one's piece."""
        piece = ZERO
        for i, part in enumerate(parts):
            piece = self.value(part)
            if i < len(parts) - 1 and not piece.atom:
                self.emit(self.safe(piece).code)
        return piece

    def statement(self, code: str) -> Piece:
        """A value that comes with an effect: computed now, once."""
        return self.keep(Piece(code))
