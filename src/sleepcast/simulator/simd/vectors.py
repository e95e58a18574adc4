"""Sixteen numbers as one value in kernels, an LLVM vector: such code becomes vector instructions on every processor,
and the numbers stay in registers.

`Lanes` are of float32, float64, int32, uint64, or of truths. `+ - * / < <= > >= == !=` work element by element, also
with a scalar of the same type, `& | ^` on truths and integers, `<< >>` on integers, and on reals `-`, `np.abs`,
`np.floor`, `np.sqrt` and `formulas.either`, so that formulas for arrays work for lanes too. Everything else is a
function: computations here, memory access in `lanes`.

Operations are never fused, so results equal those of the same formula for scalars.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic, lower_builtin, models, overload, register_model, type_callable

from sleepcast.simulator.simd import formulas
from sleepcast.simulator.simd.formulas import LANES

SINGLE, DOUBLE, SHORT, LONG, TRUTH = types.float32, types.float64, types.int32, types.uint64, types.boolean
KINDS = {
    SINGLE: ir.FloatType(),
    DOUBLE: ir.DoubleType(),
    SHORT: ir.IntType(32),
    LONG: ir.IntType(64),
    TRUTH: ir.IntType(1),
}
REALS, WHOLE = (SINGLE, DOUBLE), (SHORT, LONG)


class Lanes(types.Type):
    """Sixteen numbers of one type."""

    def __init__(self, kind: Any) -> None:
        self.kind = kind
        super().__init__(name=f"Lanes({kind})")


@register_model(Lanes)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, its: Lanes) -> None:
        super().__init__(manager, its, vector_of(its.kind))


def vector_of(kind: Any) -> ir.VectorType:
    """LLVM's type."""
    return ir.VectorType(KINDS[kind], LANES)


def filled(build: Any, value: Any, vector: Any = None) -> Any:
    """A vector with this value in all elements, of type `vector` (None: LANES of the value's type)."""
    vector = vector or ir.VectorType(value.type, LANES)
    one = build.insert_element(ir.Constant(vector, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    whole = ir.Constant(ir.VectorType(ir.IntType(32), vector.count), [0] * vector.count)
    return build.shuffle_vector(one, ir.Constant(vector, ir.Undefined), whole)


def called(build: Any, name: str, result: Any, arguments: list[Any], flags: tuple[str, ...] = ()) -> Any:
    """The result of the LLVM intrinsic of this name."""
    shape = ir.FunctionType(result, [argument.type for argument in arguments])
    function = build.module.globals.get(name) or ir.Function(build.module, shape, name)
    return build.call(function, arguments, fastmath=flags)


def bits_of(build: Any, truths: Any) -> Any:
    """Truths as the bits of one integer."""
    return build.bitcast(truths, ir.IntType(LANES))


def _plain(its: Any) -> Any:
    """The type of an operand, without the constant that it may be known to have."""
    return its if isinstance(its, Lanes) else types.unliteral(its)


def _whole(build: Any, its: Any, value: Any) -> Any:
    """An operand as a vector."""
    return value if isinstance(its, Lanes) else filled(build, value)


def _pair(left: Any, right: Any) -> Any:
    """The common type of two operands; None if they do not match."""
    kinds = [each.kind if isinstance(each, Lanes) else _plain(each) for each in (left, right)]
    return kinds[0] if kinds[0] == kinds[1] and isinstance(left, Lanes) | isinstance(right, Lanes) else None


def _define(symbol: Any, kinds: tuple[Any, ...], result: Any, make: Callable[[Any, Any, Any, Any], Any]) -> None:
    """Define an operator on lanes of these types, with results of the type `result` (None: the same)."""

    @type_callable(symbol)
    def typer(context: Any) -> Any:
        def its(left: Any, right: Any) -> Any:
            kind = _pair(left, right)
            return Lanes(result or kind) if kind in kinds else None

        return its

    def lower(context: Any, build: Any, signature: Any, arguments: Any) -> Any:
        operands = (_whole(build, *each) for each in zip(signature.args, arguments, strict=True))
        return make(build, _pair(*signature.args), *operands)

    lower_builtin(symbol, Lanes, Lanes)(lower)
    lower_builtin(symbol, Lanes, types.Number)(lower)
    lower_builtin(symbol, types.Number, Lanes)(lower)


def _by_kind(real: str, short: str) -> Callable[[Any, Any, Any, Any], Any]:
    """LLVM's instructions of these names for reals and for integers."""
    return lambda build, kind, left, right: getattr(build, real if kind in REALS else short)(left, right)


def _comparison(sign: str) -> Callable[[Any, Any, Any, Any], Any]:
    def compare(build: Any, kind: Any, left: Any, right: Any) -> Any:
        if kind in REALS:  # NaN is unequal to everything
            return (build.fcmp_unordered if sign == "!=" else build.fcmp_ordered)(sign, left, right)
        return (build.icmp_signed if kind == SHORT else build.icmp_unsigned)(sign, left, right)

    return compare


for _symbol, _real, _short in (
    *((operator.add, "fadd", "add"), (operator.sub, "fsub", "sub"), (operator.mul, "fmul", "mul")),
):
    _define(_symbol, (*REALS, *WHOLE), None, _by_kind(_real, _short))
_define(operator.truediv, REALS, None, _by_kind("fdiv", ""))
for _symbol, _sign in (
    *((operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">=")),
    *((operator.eq, "=="), (operator.ne, "!=")),
):
    _define(_symbol, (*REALS, *WHOLE), TRUTH, _comparison(_sign))
for _symbol, _short in ((operator.and_, "and_"), (operator.or_, "or_"), (operator.xor, "xor")):
    _define(_symbol, (*WHOLE, TRUTH), None, _by_kind("", _short))
_define(operator.lshift, WHOLE, None, _by_kind("", "shl"))
_define(
    operator.rshift, WHOLE, None, lambda build, kind, *both: getattr(build, "ashr" if kind == SHORT else "lshr")(*both)
)


def _of_each(make: Callable[..., Any], kinds: tuple[Any, ...], result: Any = None) -> Any:
    """A function of lanes of these types that returns lanes; `make` gets LLVM's builder and the vector."""

    def typed(typing: Any, values: Any) -> Any:
        if not isinstance(values, Lanes) or values.kind not in kinds:
            return None
        return Lanes(result or values.kind)(values), lambda context, build, signature, given: make(build, *given)

    return intrinsic(typed)


def _turned(name: str, kinds: tuple[Any, ...], result: Any) -> Any:
    """A function that converts lanes of these types, or one number, to another type with an LLVM instruction."""

    def typed(typing: Any, values: Any) -> Any:
        kind = values.kind if isinstance(values, Lanes) else values
        wanted = Lanes(result) if isinstance(values, Lanes) else result
        into = vector_of(result) if isinstance(values, Lanes) else KINDS[result]
        if kind not in kinds:
            return None
        return wanted(values), lambda context, build, signature, given: getattr(build, name)(*given, into)

    return intrinsic(typed)


def _library(name: str) -> Callable[[Any, Any], Any]:
    """The LLVM intrinsic of this name."""

    def make(build: Any, value: Any) -> Any:
        suffix = "f32" if value.type.element == KINDS[SINGLE] else "f64"
        return called(build, f"llvm.{name}.v{LANES}{suffix}", value.type, [value])

    return make


size_of = _of_each(_library("fabs"), REALS)
root_of = _of_each(_library("sqrt"), REALS)
minus = _of_each(lambda build, value: build.fsub(ir.Constant(value.type, [-0.0] * LANES), value), REALS)
reals = _turned("sitofp", (SHORT,), SINGLE)
singles = _turned("fptrunc", (DOUBLE,), SINGLE)
doubles = _turned("fpext", (SINGLE,), DOUBLE)
counted = _turned("uitofp", (LONG,), DOUBLE)
shorts = _turned("fptosi", (DOUBLE,), SHORT)


@intrinsic
def every(typing, value):
    """Lanes that all hold this number."""
    return Lanes(types.unliteral(value))(types.unliteral(value)), lambda context, build, its, given: filled(
        build, given[0]
    )


@intrinsic
def places(typing):
    """The lanes' own indices, int32."""
    return Lanes(SHORT)(), lambda context, build, its, given: ir.Constant(vector_of(SHORT), list(range(LANES)))


@intrinsic
def either(typing, truths, yes, no):
    """`yes` where it is true, else `no`; either may be a scalar."""
    kind = _pair(yes, no)
    if kind is None:
        return None

    def generate(context, build, signature, given):
        _, *kinds = signature.args
        truths, *values = given
        return build.select(truths, *(_whole(build, *each) for each in zip(kinds, values, strict=True)))

    return Lanes(kind)(truths, *(_plain(each) for each in (yes, no))), generate


@intrinsic
def like(typing, number, values):
    """`values`, float64, as reals of the type of `number`."""
    kind = _plain(number)

    def generate(context, build, signature, given):
        return given[1] if kind == DOUBLE else build.fptrunc(given[1], vector_of(kind))

    return Lanes(kind)(kind, values), generate


def _extreme(name: str) -> Any:
    """An LLVM intrinsic for the lesser or greater of two non-NaN numbers. As a comparison and a selection, a running
    minimum would become a masked store, which the next load has to wait for."""

    def typed(typing: Any, left: Any, right: Any) -> Any:
        kind = _pair(left, right)
        if kind not in REALS:
            return None

        def generate(context: Any, build: Any, signature: Any, given: Any) -> Any:
            both = [_whole(build, *each) for each in zip(signature.args, given, strict=True)]
            return called(build, f"llvm.{name}.v{LANES}f{kind.bitwidth}", vector_of(kind), both, ("nnan", "nsz"))

        return Lanes(kind)(_plain(left), _plain(right)), generate

    return intrinsic(typed)


least_of, most_of = _extreme("minnum"), _extreme("maxnum")


@intrinsic
def any_of(typing, truths):
    """Whether any of them is true."""

    def generate(context, build, signature, given):
        return build.icmp_unsigned("!=", bits_of(build, given[0]), ir.IntType(LANES)(0))

    return types.boolean(truths), generate


@intrinsic
def how_many(typing, truths):
    """Number of true lanes, uint64."""

    def generate(context, build, signature, given):
        return build.zext(build.ctpop(bits_of(build, given[0])), ir.IntType(64))

    return types.uint64(truths), generate


@intrinsic
def truths_of(typing, bits):
    """The lower bits of an integer as truths, the lowest for lane 0."""

    def generate(context, build, signature, given):
        return build.bitcast(build.trunc(given[0], ir.IntType(LANES)), vector_of(TRUTH))

    return Lanes(TRUTH)(types.unliteral(bits)), generate


def _of_lanes(function: Any, form: Any) -> None:
    """Extend a function of real numbers, or an operator, to lanes; `form` is its implementation for them."""

    @overload(function)
    def chosen(values):
        return (lambda values: form(values)) if isinstance(values, Lanes) else None


_rounded = _of_each(_library("floor"), REALS)
for _function, _form in ((np.abs, size_of), (np.floor, _rounded), (np.sqrt, root_of), (operator.neg, minus)):
    _of_lanes(_function, _form)


@overload(formulas.either)
def _either_of_lanes(condition, yes, no):
    return (lambda condition, yes, no: either(condition, yes, no)) if isinstance(condition, Lanes) else None
