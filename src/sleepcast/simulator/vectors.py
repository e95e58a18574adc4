"""Sixteen numbers as one value that kernels calculate with, a vector of LLVM's: what is written so becomes vector
instructions on every processor, and the numbers stay in registers.

`Lanes` are of float32, float64, int32, or of truths. `+ - * / < <= > >= == !=` work number by number, also with a
single number of the same type for all, `& | ^` on truths and int32, `<< >>` on int32. What else there is are functions,
here for what is calculated and in `lanes` for what goes to memory and comes from there.

No operation joins others, so that results are those of the same formula for single numbers.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

LANES = 16

SINGLE, DOUBLE, SHORT, TRUTH = types.float32, types.float64, types.int32, types.boolean
KINDS = {SINGLE: ir.FloatType(), DOUBLE: ir.DoubleType(), SHORT: ir.IntType(32), TRUTH: ir.IntType(1)}
REALS = (SINGLE, DOUBLE)


class Lanes(types.Type):
    """Sixteen numbers of one kind."""

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
    """A vector of this value, and of this type if it has others than LANES."""
    vector = vector or ir.VectorType(value.type, LANES)
    one = build.insert_element(ir.Constant(vector, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    whole = ir.Constant(ir.VectorType(ir.IntType(32), vector.count), [0] * vector.count)
    return build.shuffle_vector(one, ir.Constant(vector, ir.Undefined), whole)


def called(build: Any, name: str, result: Any, arguments: list[Any], flags: tuple[str, ...] = ()) -> Any:
    """What LLVM's own function of this name gives."""
    shape = ir.FunctionType(result, [argument.type for argument in arguments])
    function = build.module.globals.get(name) or ir.Function(build.module, shape, name)
    return build.call(function, arguments, fastmath=flags)


def bits_of(build: Any, truths: Any) -> Any:
    """Truths as bits of one whole number."""
    return build.bitcast(truths, ir.IntType(LANES))


def _plain(its: Any) -> Any:
    """The type of an operand, without the value that it may be known to have."""
    return its if isinstance(its, Lanes) else types.unliteral(its)


def _whole(build: Any, its: Any, value: Any) -> Any:
    """An operand as a vector."""
    return value if isinstance(its, Lanes) else filled(build, value)


def _pair(left: Any, right: Any) -> Any:
    """The kind of two operands that go together; None if they do not."""
    kinds = [each.kind if isinstance(each, Lanes) else _plain(each) for each in (left, right)]
    return kinds[0] if kinds[0] == kinds[1] and isinstance(left, Lanes) | isinstance(right, Lanes) else None


def _define(symbol: Any, kinds: tuple[Any, ...], result: Any, make: Callable[[Any, Any, Any, Any], Any]) -> None:
    """Let an operator work on lanes of these kinds, and give lanes of the kind `result` (None: the same)."""

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
    """LLVM's instructions of these names for reals and for whole numbers."""
    return lambda build, kind, left, right: getattr(build, real if kind in REALS else short)(left, right)


def _comparison(sign: str) -> Callable[[Any, Any, Any, Any], Any]:
    return lambda build, kind, left, right: (
        build.fcmp_ordered(sign, left, right) if kind in REALS else build.icmp_signed(sign, left, right)
    )


for _symbol, _real, _short in (
    *((operator.add, "fadd", "add"), (operator.sub, "fsub", "sub"), (operator.mul, "fmul", "mul")),
):
    _define(_symbol, (*REALS, SHORT), None, _by_kind(_real, _short))
_define(operator.truediv, REALS, None, _by_kind("fdiv", ""))
for _symbol, _sign in (
    *((operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">=")),
    *((operator.eq, "=="), (operator.ne, "!=")),
):
    _define(_symbol, (*REALS, SHORT), TRUTH, _comparison(_sign))
for _symbol, _short in ((operator.and_, "and_"), (operator.or_, "or_"), (operator.xor, "xor")):
    _define(_symbol, (SHORT, TRUTH), None, _by_kind("", _short))
for _symbol, _short in ((operator.lshift, "shl"), (operator.rshift, "ashr")):
    _define(_symbol, (SHORT,), None, _by_kind("", _short))


def _of_each(make: Callable[..., Any], kinds: tuple[Any, ...], result: Any = None) -> Any:
    """A function of lanes of these kinds that gives lanes; `make` gets LLVM's builder and the vector."""

    def typed(typing: Any, values: Any) -> Any:
        if not isinstance(values, Lanes) or values.kind not in kinds:
            return None
        return Lanes(result or values.kind)(values), lambda context, build, signature, given: make(build, *given)

    return intrinsic(typed)


def _library(name: str) -> Callable[[Any, Any], Any]:
    """LLVM's own function of this name."""

    def make(build: Any, value: Any) -> Any:
        sort = "f32" if value.type.element == KINDS[SINGLE] else "f64"
        return called(build, f"llvm.{name}.v{LANES}{sort}", value.type, [value])

    return make


size_of = _of_each(_library("fabs"), REALS)
root_of = _of_each(_library("sqrt"), REALS)
minus = _of_each(lambda build, value: build.fsub(ir.Constant(value.type, [-0.0] * LANES), value), REALS)
reals = _of_each(lambda build, value: build.sitofp(value, vector_of(SINGLE)), (SHORT,), SINGLE)
singles = _of_each(lambda build, value: build.fptrunc(value, vector_of(SINGLE)), (DOUBLE,), SINGLE)


@intrinsic
def every(typing, value):
    """Lanes of this number."""
    return Lanes(types.unliteral(value))(types.unliteral(value)), lambda context, build, its, given: filled(
        build, given[0]
    )


@intrinsic
def places(typing):
    """The lanes' own numbers, int32."""
    return Lanes(SHORT)(), lambda context, build, its, given: ir.Constant(vector_of(SHORT), list(range(LANES)))


@intrinsic
def either(typing, truths, yes, no):
    """`yes` where it is true, else `no`; one of them may be a single number."""
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
    """`values`, float64, as reals of the kind of `number`."""
    kind = _plain(number)

    def generate(context, build, signature, given):
        return given[1] if kind == DOUBLE else build.fptrunc(given[1], vector_of(kind))

    return Lanes(kind)(kind, values), generate


def _extreme(name: str) -> Any:
    """LLVM's own function of this name, of numbers that are known. Said with a comparison and a choice, the lesser of
    what is kept and something new becomes a store of some lanes only, for which the next load has to wait."""

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
    """Whether one of them is true."""

    def generate(context, build, signature, given):
        return build.icmp_unsigned("!=", bits_of(build, given[0]), ir.IntType(LANES)(0))

    return types.boolean(truths), generate


@intrinsic
def how_many(typing, truths):
    """How many are true, uint64."""

    def generate(context, build, signature, given):
        return build.zext(build.ctpop(bits_of(build, given[0])), ir.IntType(64))

    return types.uint64(truths), generate


@intrinsic
def truths_of(typing, bits):
    """The lower bits of a whole number, the lowest for lane 0."""

    def generate(context, build, signature, given):
        return build.bitcast(build.trunc(given[0], ir.IntType(LANES)), vector_of(TRUTH))

    return Lanes(TRUTH)(types.unliteral(bits)), generate
