"""Writes entries: functions that check and unpack a kernel's arguments, call it, and pack its result; see `cached`.

An entry takes from Python's objects what numba's own would take, and as fast. It needs nothing of numba when it runs.
What it needs of Python, it takes from a table of addresses, and memory from the C library.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from llvmlite import binding, ir
from numba.core import cgutils, types
from numba.np.numpy_support import as_dtype

from sleepcast.simulator.simd.cached import (
    DATA,
    DIMENSIONS,
    DTYPE,
    FLAGS,
    FUNCTION,
    HELD,
    ITEMS,
    NUMBER,
    ORDER,
    SHAPE,
    STRIDES,
    TYPE,
    EntryPiece,
    all_in_process,
)

WORD, HALF, BYTE = ir.IntType(64), ir.IntType(32), ir.IntType(8)
ADDRESS = BYTE.as_pointer()
NATIVE = b"=|"
"""Marks of the byte orders that numbers of this processor have."""
C_ORDER, FORTRAN, ALIGNED, WRITEABLE = 0x1, 0x2, 0x100, 0x400
"""NumPy's flags of an array."""
LAYOUTS = {"C": (C_ORDER, C_ORDER), "F": (C_ORDER | FORTRAN, FORTRAN), "A": (C_ORDER | FORTRAN, 0)}
"""By numba's letter: flags that count, and which of these are set."""
BUILT_IN = {types.int64: "builtins:int", types.float64: "builtins:float"}
RESULTS = {
    types.int64: "PyLong_FromLongLong",
    types.uint64: "PyLong_FromUnsignedLongLong",
    types.float64: "PyFloat_FromDouble",
}
"""What makes objects of a kernel's results, by their types."""
HEADER = 40
"""Bytes before an array's data that numba's code knows: a count of references, two words, the address of the data, and
its size."""
HELPERS = f"""
declare i8* @malloc(i64)
declare void @free(i8*)
declare void @llvm.trap()

define i8* @NRT_MemInfo_alloc_aligned(i64 %size, i32 %align) {{
  %wide = zext i32 %align to i64
  %header = add i64 %wide, {HEADER}
  %all = add i64 %size, %header
  %block = call i8* @malloc(i64 %all)
  %none = icmp eq i8* %block, null
  br i1 %none, label %done, label %fill
fill:
  %words = bitcast i8* %block to i64*
  store i64 1, i64* %words
  %place = ptrtoint i8* %block to i64
  %after = add i64 %place, %header
  %rest = urem i64 %after, %wide
  %data = sub i64 %after, %rest
  %third = getelementptr i64, i64* %words, i64 3
  store i64 %data, i64* %third
  %fourth = getelementptr i64, i64* %words, i64 4
  store i64 %size, i64* %fourth
  br label %done
done:
  ret i8* %block
}}

define void @NRT_MemInfo_call_dtor(i8* %block) {{
  call void @free(i8* %block)
  ret void
}}

define void @NRT_Free(i8* %block) {{
  call void @free(i8* %block)
  ret void
}}
"""
"""What kernels need for arrays of their own."""
DEFINED = {"NRT_MemInfo_alloc_aligned", "NRT_MemInfo_call_dtor", "NRT_Free"}
NEVER_CALLED = {
    *("NRT_adapt_ndarray_from_python", "numba_do_raise", "numba_unpickle", "numba_runtime_build_excinfo_struct"),
}
"""What only numba's own wrappers call."""


class NoEntryError(Exception):
    """A kernel for which no entry can be written."""


class _Reader:
    """Writes the code that reads arguments: where one is of another type than numba's, it goes to `other`."""

    def __init__(self, context: Any, build: Any, table: Any, other: Any, needs: list[str]) -> None:
        self._context, self.build, self._table, self._other = context, build, table, other
        self.needs = needs

    def needed(self, name: str) -> Any:
        """The address of this object or function."""
        if name not in self.needs:
            self.needs.append(name)
        place = self.build.gep(self._table, [WORD(8 * self.needs.index(name))])
        return self.build.load(self.build.bitcast(place, ADDRESS.as_pointer()))

    def call(self, name: str, result: Any, *arguments: Any) -> Any:
        """Call a function of Python's own interface."""
        shape = ir.FunctionType(result, [argument.type for argument in arguments])
        return self.build.call(self.build.bitcast(self.needed(FUNCTION + name), shape.as_pointer()), arguments)

    def at(self, address: Any, place: int, kind: Any) -> Any:
        """What lies so many bytes after an address."""
        found = self.build.gep(address, [WORD(place)])
        return self.build.load(self.build.bitcast(found, kind.as_pointer()))

    def wanted(self, truth: Any) -> None:
        """What follows is only for when this is true."""
        follows = self.build.append_basic_block()
        self.build.cbranch(truth, follows, self._other)
        self.build.position_at_end(follows)

    def same(self, value: Any, number: int) -> Any:
        return self.build.icmp_unsigned("==", value, value.type(number))

    def is_a(self, thing: Any, name: str) -> Any:
        """Whether an object is of this type, and of none that derives from it."""
        return self.build.icmp_unsigned("==", self.at(thing, TYPE, ADDRESS), self.needed(name))

    def value(self, its: Any, thing: Any) -> Any:
        """An object as numba's value of this type."""
        if isinstance(its, types.Array):
            return self._array(its, thing)
        if isinstance(its, types.BaseTuple):
            return self._tuple(its, thing)
        if its == types.none:
            self.wanted(self.build.icmp_unsigned("==", thing, self.needed("builtins:None")))
            return self._context.get_dummy_value()
        if its == types.boolean:
            return self._truth(thing)
        if isinstance(its, types.Integer | types.Float):
            return self._number(its, thing)
        raise NoEntryError(f"no argument can be {its}")

    def _array(self, its: Any, thing: Any) -> Any:
        build, dtype = self.build, as_dtype(its.dtype)
        self.wanted(self.is_a(thing, "numpy:ndarray"))
        kind = self.at(thing, DTYPE, ADDRESS)
        order = self.at(kind, ORDER, BYTE)
        counts, mask = LAYOUTS[its.layout]
        flags = self.at(thing, FLAGS, HALF)
        expected = mask | (ALIGNED if its.aligned else 0) | (WRITEABLE if its.mutable else 0)
        checks = [
            self.same(self.at(thing, DIMENSIONS, HALF), its.ndim),
            self.same(self.at(kind, NUMBER, HALF), dtype.num),
            build.or_(*(self.same(order, mark) for mark in NATIVE)),
            self.same(build.and_(flags, HALF(counts | ALIGNED | WRITEABLE)), expected),
        ]
        for check in checks:
            self.wanted(check)
        shape, strides = (self.at(thing, place, ADDRESS) for place in (SHAPE, STRIDES))
        lengths = [self.at(shape, 8 * axis, WORD) for axis in range(its.ndim)]
        steps = [self.at(strides, 8 * axis, WORD) for axis in range(its.ndim)]
        items = WORD(1)
        for length in lengths:
            items = build.mul(items, length)
        array = self._context.make_array(its)(self._context, build)
        array.data = build.bitcast(self.at(thing, DATA, ADDRESS), array.data.type)
        array.nitems, array.itemsize = items, WORD(dtype.itemsize)
        array.shape, array.strides = (cgutils.pack_array(build, each, ty=WORD) for each in (lengths, steps))
        array.parent, array.meminfo = (cgutils.get_null_value(each.type) for each in (array.parent, array.meminfo))
        return array._getvalue()

    def _tuple(self, its: Any, thing: Any) -> Any:
        name = "builtins:tuple"
        if isinstance(its, types.BaseNamedTuple):
            named: Any = its
            name = f"{named.instance_class.__module__}:{named.instance_class.__qualname__}"
        if "<locals>" in name:
            raise NoEntryError(f"{name} cannot be found by its name")
        self.wanted(self.is_a(thing, name))
        return self._context.make_tuple(self.build, its, self.items(thing, list(its)))

    def items(self, thing: Any, kinds: Sequence[Any]) -> list[Any]:
        """The items of a tuple, of these types."""
        self.wanted(self.same(self.at(thing, HELD, WORD), len(kinds)))
        return [self.value(kind, self.at(thing, ITEMS + 8 * place, ADDRESS)) for place, kind in enumerate(kinds)]

    def _truth(self, thing: Any) -> Any:
        build = self.build
        plain = self.is_a(thing, "builtins:bool")
        self.wanted(build.or_(plain, self.is_a(thing, "numpy:bool_")))
        true = build.icmp_unsigned("==", thing, self.needed("builtins:True"))
        return build.select(plain, true, build.icmp_unsigned("!=", self.at(thing, HELD, BYTE), BYTE(0)))

    def _number(self, its: Any, thing: Any) -> Any:
        """Numbers of Python and of NumPy hold what they are at the same place, but for Python's integers."""
        build, kind = self.build, self._context.get_value_type(its)
        own, plain = self.is_a(thing, f"numpy:{as_dtype(its).name}"), BUILT_IN.get(its)
        if plain is None:
            self.wanted(own)
            return self.at(thing, HELD, kind)
        self.wanted(build.or_(own, self.is_a(thing, plain)))
        if isinstance(its, types.Float):
            return self.at(thing, HELD, kind)
        result, too_large = cgutils.alloca_once(build, kind), cgutils.alloca_once_value(build, HALF(0))
        with build.if_else(own) as (of_numpy, of_python):
            with of_numpy:
                build.store(self.at(thing, HELD, kind), result)
            with of_python:
                build.store(self.call("PyLong_AsLongLongAndOverflow", kind, thing, too_large), result)
        self.wanted(self.same(build.load(too_large), 0))
        return build.load(result)


def entry_of(made: Any) -> EntryPiece:
    """The piece of a kernel that numba has just compiled, with an entry to it. Raises NoEntryError if it needs more
    than an entry can give."""
    library, context, description = made.library, made.target_context, made.fndesc
    declared = {each.name for each in library._final_module.functions if each.is_declaration}
    outside = sorted(name for name in declared - DEFINED - NEVER_CALLED if not name.startswith("llvm."))
    if not all_in_process(outside):
        raise NoEntryError(f"it calls one of {', '.join(outside)}")
    module = context.create_module("entry")
    needs = _write(context, module, context.declare_function(module, description), description)
    stubs = [f"define void @{name}() {{ call void @llvm.trap() ret void }}" for name in sorted(NEVER_CALLED)]
    target = context.codegen()._tm
    parsed = binding.parse_assembly("\n".join([str(module), HELPERS, *stubs]))
    parsed.verify()
    code = target.emit_object(parsed)
    return EntryPiece(tuple(outside), tuple(needs), code, library._get_compiled_object())


def _write(context: Any, module: Any, kernel: Any, description: Any) -> list[str]:
    """Write the functions `entry` and `address`; gives the names of what they need in their table."""
    needs: list[str] = []
    reader, values, other = _begin(context, module, "entry", description, needs)
    build = reader.build
    thread = reader.call("PyEval_SaveThread", ADDRESS)
    status, result = context.call_conv.call_function(build, kernel, description.restype, description.argtypes, values)
    reader.call("PyEval_RestoreThread", ir.VoidType(), thread)
    done, failed = build.append_basic_block(), build.append_basic_block()
    build.cbranch(status.is_error, failed, done)
    build.position_at_end(done)
    if description.restype == types.none:
        _give(reader, build, "builtins:None")
    elif description.restype in RESULTS:
        build.ret(reader.call(RESULTS[description.restype], ADDRESS, result))
    else:
        raise NoEntryError(f"no result can be {description.restype}")
    build.position_at_end(other)
    _give(reader, build, "builtins:NotImplemented")
    build.position_at_end(failed)  # nothing else can fail in a kernel than taking memory for its arrays
    build.ret(reader.call("PyErr_NoMemory", ADDRESS))
    reader, _, other = _begin(context, module, "address", description, needs)
    reader.build.ret(reader.call("PyLong_FromLongLong", ADDRESS, reader.build.ptrtoint(kernel, WORD)))
    reader.build.position_at_end(other)
    _give(reader, reader.build, "builtins:NotImplemented")
    return needs


def _begin(context: Any, module: Any, name: str, description: Any, needs: list[str]) -> tuple[_Reader, list[Any], Any]:
    """Begin a function that reads the arguments; gives what writes it, their values, and where it goes on if one is of
    another type."""
    function = ir.Function(module, ir.FunctionType(ADDRESS, [ADDRESS, ADDRESS]), name)
    build = ir.IRBuilder(function.append_basic_block())
    other = function.append_basic_block()
    arguments, table = function.args
    reader = _Reader(context, build, table, other, needs)
    return reader, reader.items(arguments, description.argtypes), other


def _give(reader: _Reader, build: Any, name: str) -> None:
    """Return an object that there is always."""
    thing = reader.needed(name)
    reader.call("Py_IncRef", ir.VoidType(), thing)
    build.ret(thing)
