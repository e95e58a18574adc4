"""The compiler: Python code from the parts of a checked expression, never from anybody's text.

Only numbers (as float literals), slots and names made here get into the source; everything else reaches the code
through constants in its namespace. The code computes the usual case inline and hands everything unusual (an unknown,
a result that is not finite, a division by zero) to the operations of `evaluate`, so it gives the walker's results bit
for bit. An expression whose pieces only read becomes one Python expression; pieces with effects become statements.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from math import inf, nan, sqrt

from sleepcast.core.records import NamedTuple
from sleepcast.language.evaluate import apply, between, enter, gauss, prob, reduced
from sleepcast.language.functions import AMONG_ROBOTS, NO_INSTANT
from sleepcast.language.parts import Part

# ---- the emitter: lines, blocks, temporaries, and operands in their order


class CodePiece(NamedTuple):
    """Code for a value.

    code: a Python expression.
    atom: it can be repeated and has no effect.
    fixed: nothing later changes it.
    slow: what to compute instead if `code` comes out not finite ("" if it cannot).
    """

    code: str
    atom: bool = False
    fixed: bool = False
    slow: str = ""


ZERO, ONE, UNKNOWN = CodePiece("0.0", True, True), CodePiece("1.0", True, True), CodePiece("N", True, True)


class Emitter(ABC):
    """The lines of one function that is being written."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.indent = " "
        self.temporaries = 0
        self.space: dict[str, object] = {
            "A": apply, "B": between, "E": enter, "G": gauss, "P": prob, "N": nan, "I": inf, "sqrt": sqrt,
            "R": reduced,
        }  # fmt: skip

    # ---- writing

    def emit(self, line: str) -> None:
        self.lines.append(f"{self.indent}{line}\n")

    def temporary(self) -> str:
        self.temporaries += 1
        return f"t{self.temporaries}"

    def keep(self, piece: CodePiece) -> CodePiece:
        """The value in a temporary, as a statement, so that nothing later changes it."""
        if piece.fixed:
            return piece
        name = self.temporary()
        self.emit(f"{name}={self.safe(piece).code}")
        return CodePiece(name, True, True)

    def atom(self, piece: CodePiece) -> tuple[str, str]:
        """How to write the piece the first time it is evaluated, and how to repeat it."""
        piece = self.safe(piece)
        if piece.atom:
            return piece.code, piece.code
        name = self.temporary()
        return f"({name}:={piece.code})", name

    def safe(self, piece: CodePiece) -> CodePiece:
        """The piece with its check that the value is finite."""
        if not piece.slow:
            return piece
        name = self.temporary()
        return CodePiece(f"({name} if -I<({name}:={piece.code})<I else {piece.slow})")

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
    def value(self, part: Part) -> CodePiece:
        """The piece for `part`; what must happen first is written down."""

    def values(self, parts: Sequence[Part]) -> list[CodePiece]:
        """Pieces for operands in order: when a later one needs statements, earlier ones are computed before them."""
        pieces: list[CodePiece] = []
        for part in parts:
            mark = len(self.lines)
            piece = self.value(part)
            if len(self.lines) > mark:
                written, self.lines = self.lines[mark:], self.lines[:mark]
                pieces = [self.keep(p) for p in pieces]
                self.lines += written
            pieces.append(piece)
        return pieces

    def repeatable(self, parts: Sequence[Part]) -> list[str]:
        """Operands as codes that can be repeated in any order."""
        pieces = self.values(parts)
        if all(p.atom for p in pieces):
            return [p.code for p in pieces]
        return [self.keep(p).code for p in pieces]

    def arguments(self, parts: Sequence[Part]) -> str:
        """Operands as the inside of a tuple, a comma after each."""
        return "".join(f"{self.safe(p).code}," for p in self.values(parts))

    def last(self, parts: Sequence[Part]) -> CodePiece:
        """One after the other; the last one's piece."""
        piece = ZERO
        for i, part in enumerate(parts):
            piece = self.value(part)
            if i < len(parts) - 1 and not piece.atom:
                self.emit(self.safe(piece).code)
        return piece

    def statement(self, code: str) -> CodePiece:
        """A value that comes with an effect: computed now, once."""
        return self.keep(CodePiece(code))


# ---- which parts become one Python expression


FLIPPED = {"<": ">=", "<=": ">", ">": "<=", ">=": "<"}
"""The comparison that holds just if the other does not, when neither operand is unknown."""
INLINED = frozenset({("-", 1), ("/", 2), ("ABS", 1), ("MIN", 2), ("MAX", 2), ("NOT", 1), ("SQRT", 1), ("DIST", 4)})
"""Pure functions, with their number of arguments, whose usual case is written out where they are called."""

_ATOMIC = frozenset({"const", "var", "local", "absent"})
_DEEPEST = 60
"""Parentheses that one Python expression may nest; Python's own limit is 200."""


def flat(part: Part) -> bool:
    """Whether the value of `part` is one Python expression, without statements before it."""
    return _depth(part) <= _DEEPEST


def flat_test(part: Part) -> bool:
    """The same for `part` as a test."""
    return _test_depth(part) <= _DEEPEST


def _depth(part: Part) -> float:
    if part.op in _ATOMIC or part.op == "in":
        return 1
    if part.watch or part.op not in ("pure", "known", "prob", "random", "gauss", "and", "if"):
        return inf
    if part.op == "if":
        return 2 + max(_test_depth(part.parts[0]), *map(_depth, part.parts[1:]))
    if part.op == "pure" and (part.name, len(part.parts)) in INLINED:
        return 4 if all(inside.op in _ATOMIC for inside in part.parts) else inf
    width = len(part.parts) if part.op == "and" else 3
    return width + max(map(_depth, part.parts), default=0)


def _test_depth(part: Part) -> float:
    if part.op in ("and", "or") and not part.watch:
        return 1 + max(map(_test_depth, part.parts), default=inf)
    if part.op == "pure" and part.name == "NOT":
        inside = part.parts[0]
        compared = inside.op == "pure" and inside.name in FLIPPED and len(inside.parts) == 2
        return 1 + (max(map(_depth, inside.parts)) if compared else _depth(inside))
    return 1 + _depth(part)


_COMPARE = {
    "<": ("<", ">="),
    "<=": ("<=", ">"),
    ">": (">", "<="),
    ">=": (">=", "<"),
    "=": ("==", ""),
    "EQ": ("==", ""),
}
_TINY = 1e290
"""Adding less than this to a finite number never overflows: half a unit in the last place of the largest is 1e292."""


Code = Callable[..., float]


def generate(root: Part, parameters: int = 0) -> Code:
    """The expression as a Python function of (values, memory, *arguments)."""
    return _Generator(root, parameters).function()


class _Generator(Emitter):
    def __init__(self, root: Part, parameters: int) -> None:
        super().__init__()
        self.root, self.parameters = root, parameters

    def function(self) -> Code:
        result = self.safe(self.value(self.root)).code
        names = ",".join(f"n{i}" for i in range(self.parameters))
        source = f"def f(v,m{',' + names if names else ''}):\n" + "".join(self.lines) + f" return {result}\n"
        exec(compile(source, "<expression>", "exec"), self.space)
        code: Code = self.space["f"]  # type: ignore[assignment]
        return code

    def value(self, part: Part) -> CodePiece:
        how = getattr(self, f"_{part.op}", None)
        if how is None:
            raise TypeError(f"no code for op {part.op}")
        piece: CodePiece = how(part)
        return piece

    def _const(self, part: Part) -> CodePiece:
        if part.number != part.number:
            return UNKNOWN
        return CodePiece(repr(float(part.number)), True, True)

    def _var(self, part: Part) -> CodePiece:
        return CodePiece(f"v[{part.slot}]", True)

    def _local(self, part: Part) -> CodePiece:
        return CodePiece(f"n{part.slot}", True)

    def _absent(self, part: Part) -> CodePiece:
        return UNKNOWN

    def _linked(self, part: Part) -> CodePiece:
        return self.statement(f"m.read({self.constant(part)})")

    def _in(self, part: Part) -> CodePiece:
        return CodePiece(f"(1.0 if {self._in_test(part)} else 0.0)")

    def _known(self, part: Part) -> CodePiece:
        first, again = self.atom(self.value(part.parts[0]))
        return CodePiece(f"(1.0 if {first}=={again} else 0.0)")

    # ---- pure functions

    def _pure(self, part: Part) -> CodePiece:
        name, count = part.name, len(part.parts)
        if name in ("+", "-", "*") and count > 1:
            return self._fold(part)
        if name in _COMPARE and count == 2:
            return self._comparison(part)
        how = _INLINE.get((name, count))
        if how is not None:
            return how(self, part, *self.repeatable(part.parts))
        return CodePiece(f"A(m,{self.constant(part)},({self.arguments(part.parts)}))")

    def _fold(self, part: Part) -> CodePiece:
        pieces = self.values(part.parts)
        fast, slow = [], []
        for piece in pieces:
            if piece.slow or piece.atom:
                fast.append(piece.code)
                slow.append(piece.slow or piece.code)
            else:
                first, again = self.atom(piece)
                fast.append(first)
                slow.append(again)
        code = f"({part.name.join(fast)})"
        if self._cannot_overflow(part, pieces):
            return CodePiece(code)
        return CodePiece(code, slow=f"A(m,{self.constant(part)},({','.join(slow)},))")

    def _cannot_overflow(self, part: Part, pieces: list[CodePiece]) -> bool:
        if len(pieces) != 2 or any(piece.slow for piece in pieces):
            return False
        limit = 1.0 if part.name == "*" else _TINY
        return any(p.op == "const" and abs(p.number) <= limit for p in part.parts)

    def _comparison(self, part: Part) -> CodePiece:
        holds, fails = self._compared(part)
        return CodePiece(f"(1.0 if {holds} else 0.0 if {fails} else N)")

    def _compared(self, part: Part) -> tuple[str, str]:
        """A comparison of two operands as two tests: that it holds, and, to be evaluated after it, that it does not.
        Neither is true if an operand is unknown."""
        left, right = self.values(part.parts)
        (a, again), (b, b_again) = self.atom(left), self.atom(right)
        yes, no = _COMPARE[part.name]
        return f"{a}{yes}{b}", f"{again}{no}{b_again}" if no else f"{again}<{b_again} or {again}>{b_again}"

    # ---- tests: Python expressions that are true just if the value is

    def test(self, part: Part) -> str:
        how = getattr(self, f"_{part.op}_test", None)
        if how is not None:
            code: str | None = how(part)
            if code is not None:
                return code
        first, again = self.atom(self.value(part))
        return f"({first}<0.0 or {again}>0.0)"

    def _pure_test(self, part: Part) -> str | None:
        if part.name in _COMPARE and len(part.parts) == 2:
            left, right = self.values(part.parts)
            return f"{self.safe(left).code}{_COMPARE[part.name][0]}{self.safe(right).code}"
        if part.name == "NOT":
            inside = part.parts[0]
            if inside.op == "pure" and inside.name in FLIPPED and len(inside.parts) == 2:
                left, right = self.values(inside.parts)
                return f"{self.safe(left).code}{FLIPPED[inside.name]}{self.safe(right).code}"
            return f"{self.safe(self.value(inside)).code}==0.0"
        return None

    def _and_test(self, part: Part) -> str | None:
        return self._joined(part, " and ") if not part.watch else None

    def _or_test(self, part: Part) -> str | None:
        return self._joined(part, " or ")

    def _joined(self, part: Part, word: str) -> str | None:
        if not part.parts or not flat_test(part):
            return None
        return f"({word.join(self.test(inside) for inside in part.parts)})"

    def _in_test(self, part: Part) -> str:
        return f"{part.name!r} in m.groups"

    def _prob_test(self, part: Part) -> str | None:
        chance = part.parts[0]
        return f"m.draw()<{float(chance.number)!r}" if chance.op == "const" and chance.number == chance.number else None

    # ---- special forms

    def _and(self, part: Part) -> CodePiece:
        if not part.parts:
            return ONE
        if flat(part):
            return CodePiece(self._nested(part.parts))
        result = self.temporary()
        for i, inside in enumerate(part.parts):
            before = self.block(f"if {result}<0.0 or {result}>0.0:") if i else self.indent
            if part.watch == i and i:
                self.emit("m.matched=True")
            self.emit(f"{result}={self.safe(self.value(inside)).code}")
            self.indent = before
        if part.watch == len(part.parts):
            self.emit(f"if {result}<0.0 or {result}>0.0: m.matched=True")
        return CodePiece(result, True, True)

    def _nested(self, parts: Sequence[Part]) -> str:
        part, rest = parts[0], parts[1:]
        if not rest:
            return self.safe(self.value(part)).code
        if part.op == "pure" and part.name in _COMPARE and len(part.parts) == 2:
            holds, fails = self._compared(part)
            return f"({self._nested(rest)} if {holds} else 0.0 if {fails} else N)"
        first, again = self.atom(self.value(part))
        return f"({self._nested(rest)} if {first}<0.0 or {again}>0.0 else {again})"

    def _or(self, part: Part) -> CodePiece:
        if not part.parts:
            return ZERO
        result, unknown = self.temporary(), self.temporary()
        self.emit(f"{result}={unknown}=0.0")
        for inside in part.parts:
            before = self.block(f"if not({result}<0.0 or {result}>0.0):")
            self.emit(f"{result}={self.safe(self.value(inside)).code}")
            self.emit(f"if {result}!={result}: {unknown}=N")
            self.indent = before
        return CodePiece(f"({result} if {result}<0.0 or {result}>0.0 else {unknown})", True, True)

    def _cond(self, part: Part) -> CodePiece:
        result, begun = self.temporary(), self.indent
        self.emit(f"{result}=0.0")
        # Clauses chain as if and elif, unless a later test needs statements of its own: then a flag says to go on.
        chained = all((flat_test if len(c.parts) > 1 else flat)(c.parts[0]) for c in part.parts[1:])
        going = "" if chained else self.temporary()
        if going:
            self.emit(f"{going}=True")
        for i, clause in enumerate(part.parts):
            if going:
                self.block(f"if {going}:")
            test, *body = clause.parts
            if body:
                code = self.test(test)
            else:
                first, value = self.atom(self.value(test))
                code = f"{first}<0.0 or {value}>0.0"
            self.block(f"{'elif' if i and not going else 'if'} {code}:")
            if going:
                self.emit(f"{going}=False")
            if clause.watch:
                self.emit("m.matched=True")
            self.emit(f"{result}={self.safe(self.last(body)).code if body else value}")
            self.indent = begun
        return CodePiece(result, True, True)

    def _if(self, part: Part) -> CodePiece:
        test, yes, *no = part.parts
        code = self.test(test)
        if flat(part):
            return CodePiece(f"({self.safe(self.value(yes)).code} if {code} else {self.safe(self.last(no)).code})")
        result = self.temporary()
        before = self.block(f"if {code}:")
        if part.watch:
            self.emit("m.matched=True")
        self.emit(f"{result}={self.safe(self.value(yes)).code}")
        self.indent = before
        self.block("else:")
        self.emit(f"{result}={self.safe(self.last(no)).code}")
        self.indent = before
        return CodePiece(result, True, True)

    def _progn(self, part: Part) -> CodePiece:
        return self.last(part.parts)

    def _let(self, part: Part) -> CodePiece:
        count = int(part.number)
        for i, piece in enumerate(self.values(part.parts[:count])):
            self.emit(f"n{part.slot + i}={self.safe(piece).code}")
        return self.last(part.parts[count:])

    def _dotimes(self, part: Part) -> CodePiece:
        repeats = f"r{part.index}"
        self.space[repeats] = tuple(map(float, range(int(part.number))))
        before = self.block(f"for n{part.slot} in {repeats}:")
        piece = self.last(part.parts)
        self.emit(self.safe(piece).code)
        self.indent = before
        return ZERO

    def _over(self, part: Part) -> CodePiece:
        near, values = self._near(part), self.temporary()
        self.emit(f"{values}=[]")
        before = self.block(f"for n{part.slot} in {near} or ():")
        self.emit(f"{values}.append({self.safe(self.last(part.parts[-1].parts)).code})")
        self.indent = before
        return self.statement(f"R(m,{self.constant(part)},{near},{values})")

    def _each(self, part: Part) -> CodePiece:
        near = self._near(part)
        before = self.block(f"for n{part.slot} in {near} or ():")
        self.emit(self.safe(self.last(part.parts[-1].parts)).code)
        self.indent = before
        return CodePiece(f"(N if {near} is None else 0.0)", True, True)

    def _near(self, part: Part) -> str:
        """The name of the neighbours that a part goes through."""
        near = self.temporary()
        self.emit(f"{near}=m.near({self.constant(part)},{self.arguments(part.parts[:-1])})")
        return near

    def _dice(self, part: Part) -> CodePiece:
        result, drawn, total, going = (self.temporary() for _ in range(4))
        self.emit(f"{result}={total}=0.0; {going}=True; {drawn}=m.draw()")
        for side in part.parts:
            chance, expression = side.parts
            before = self.block(f"if {going}:")
            self.emit(f"{total}+={self.safe(self.value(chance)).code}")
            self.emit(f"if {total}!={total}: {result}=N; {going}=False")
            self.block(f"elif {drawn}<{total}:")
            self.emit(f"{going}=False")
            self.emit(f"{result}={self.safe(self.value(expression)).code}")
            self.indent = before
        return CodePiece(result, True, True)

    # ---- assignment, storing, calling

    def _set_user(self, part: Part) -> CodePiece:
        self.emit(f"v[{part.slot}]={self.safe(self.value(part.parts[0])).code}")
        return CodePiece(f"v[{part.slot}]", True)

    def _set_local(self, part: Part) -> CodePiece:
        self.emit(f"n{part.slot}={self.safe(self.value(part.parts[0])).code}")
        return CodePiece(f"n{part.slot}", True)

    def _write(self, part: Part) -> CodePiece:
        value = self.safe(self.value(part.parts[0])).code
        return self.statement(f"m.write({self.constant(part)},{value})")

    def _defvar(self, part: Part) -> CodePiece:
        name = self.constant(part)
        before = self.block(f"if not m.defined({name}):")
        value = self.safe(self.value(part.parts[0])).code if part.parts else "N"
        self.emit(f"m.define({name},{value})")
        self.indent = before
        return CodePiece(f"v[{part.slot}]", True)

    def _store(self, part: Part) -> CodePiece:
        value = self.safe(self.value(part.parts[0])).code if part.parts else "0.0"
        return self.statement(f"m.store({self.constant(part)},{value})")

    def _fetch(self, part: Part) -> CodePiece:
        name = self.constant(part)
        return self.statement(f"E(m,{name},m.fetch({name}))")

    def _call(self, part: Part) -> CodePiece:
        name, program, result = self.constant(part), self.temporary(), self.temporary()
        self.emit(f"{program}=m.operator({name}); {result}=N")
        before = self.block(f"if {program} is not None:")
        self.emit(f"{result}=E(m,{name},{program},({self.arguments(part.parts)}))")
        self.indent = before
        return CodePiece(result, True, True)

    def _host(self, part: Part) -> CodePiece:
        return self.statement(f"m.host({self.constant(part)},{self.arguments(part.parts)})")

    def _act(self, part: Part) -> CodePiece:
        return self.statement(f"m.act({self.constant(part)},{self.arguments(part.parts)})")

    def _missing(self, part: Part) -> CodePiece:
        name = self.constant(part)
        return self.statement(f"m.fault({name},'this robot has no function '+{name}.name)")

    def _auction(self, part: Part) -> CodePiece:
        return self.statement(f"m.fault({self.constant(part)},{f'{part.name} chooses {AMONG_ROBOTS}'!r})")

    def _timed(self, part: Part) -> CodePiece:
        return self.statement(f"m.fault({self.constant(part)},{NO_INSTANT!r})")

    def _prob(self, part: Part) -> CodePiece:
        return CodePiece(f"P(m,{self.safe(self.value(part.parts[0])).code})")

    def _random(self, part: Part) -> CodePiece:
        return CodePiece(f"B(m,{self.constant(part)},{self.arguments(part.parts)})")

    def _gauss(self, part: Part) -> CodePiece:
        return CodePiece(f"G(m,{self.constant(part)},{self.arguments(part.parts)})")


def _quotient(g: _Generator, part: Part, a: str, b: str) -> CodePiece:
    name = g.temporary()
    return CodePiece(f"({name} if {b} and -I<({name}:={a}/{b})<I else A(m,{g.constant(part)},({a},{b})))")


def _distance(g: _Generator, part: Part, x1: str, y1: str, x2: str, y2: str) -> CodePiece:
    dx, dy, name = g.temporary(), g.temporary(), g.temporary()
    code = f"sqrt(({dx}:={x1}-{x2})*{dx}+({dy}:={y1}-{y2})*{dy})"
    return CodePiece(f"({name} if ({name}:={code})<I else A(m,{g.constant(part)},({x1},{y1},{x2},{y2})))")


_INLINE: dict[tuple[str, int], Callable[..., CodePiece]] = {
    ("-", 1): lambda g, part, a: CodePiece(f"(-{a})"),
    ("/", 2): _quotient,
    ("ABS", 1): lambda g, part, a: CodePiece(f"abs({a})"),
    ("MIN", 2): lambda g, part, a, b: CodePiece(f"({a} if {a}<={b} else {b} if {b}<{a} else N)"),
    ("MAX", 2): lambda g, part, a, b: CodePiece(f"({a} if {a}>={b} else {b} if {b}>{a} else N)"),
    ("NOT", 1): lambda g, part, a: CodePiece(f"(1.0 if {a}==0.0 else 0.0 if {a}=={a} else N)"),
    ("SQRT", 1): lambda g, part, a: CodePiece(f"(sqrt({a}) if {a}>=0.0 else A(m,{g.constant(part)},({a},)))"),
    ("DIST", 4): _distance,
}
