"""Host memory: where a number is stored in a host program's own memory, and which numbers fit there.

A `HostNumber` reads and writes the host program's own number; nothing is copied. It may be in an object (an
attribute, property or getter), in a mapping, in a ctypes structure or in a numpy record. Its location is looked up
once, when it is linked, so anything that cannot hold a number is refused then; a number that does not fit is refused
when it is written. In structures and records a path names the field: `velocity`, `pose.x`, `sonar[3]`. Neither
ctypes nor numpy is imported here: a host that has a structure or a record has imported them already.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Iterable, Mapping, MutableMapping
from functools import partial
from operator import getitem, setitem
from typing import TYPE_CHECKING, Any, NamedTuple

from sleepcast.core.errors import MisuseError, did_you_mean

if TYPE_CHECKING:
    import ctypes

    import numpy

    Structure = ctypes.Structure | ctypes.Union
    Record = numpy.void | numpy.ndarray[Any, Any]


class LinkError(MisuseError):
    """A variable or function that cannot be linked, or a number that the host's memory cannot provide or accept."""


class NumberType(NamedTuple):
    """The numbers that a field holds.

    kind: "float", "int" or "bool".
    least, most: its bounds, inclusive.
    """

    typename: str
    kind: str = "float"
    least: float = -sys.float_info.max
    most: float = sys.float_info.max

    def fit(self, value: float, label: str) -> float | int | bool:
        """A finite `value` as this field stores it: rounded (half to even) or converted to a boolean.

        Raises LinkError if it lies outside the field's bounds.
        """
        if self.kind == "bool":
            return value != 0.0
        fitted = round(value) if self.kind == "int" else value
        if not self.least <= fitted <= self.most:
            raise LinkError(
                f"{label} cannot be set to {value:.15g}: it is a {self.typename},"
                f" which holds {self.least:.15g} to {self.most:.15g}"
            )
        return fitted


ANY_NUMBER = NumberType("float")


class HostNumber(NamedTuple):
    """One number of the host. label: its name for people (`Scout.velocity`).

    store: None if it is read-only; `fixed` then says why, and what to do about it.
    """

    label: str
    fetch: Callable[[], object]
    store: Callable[[float | int | bool], None] | None
    field: NumberType = ANY_NUMBER
    fixed: str = ""


def as_number(value: object, label: str) -> float:
    """Convert a host's value to float: numbers and booleans of any kind; None and anything not finite are unknown
    (NaN).

    Raises LinkError for anything that is not a number, including a text of digits.
    """
    if value is None:
        return math.nan
    if not hasattr(value, "__float__") and not hasattr(value, "__index__"):
        raise LinkError(f"{label} holds {value!r:.60}, which is not a number")
    try:
        number = float(value)  # type: ignore[arg-type]  # float() asks for one of the two methods above
    except OverflowError:
        return math.nan
    except (TypeError, ValueError) as error:
        raise LinkError(f"{label} holds {value!r:.60}, which is not one number") from error
    return number if math.isfinite(number) else math.nan


def attribute(host: object, name: str) -> HostNumber:
    """An attribute, property or getter of an object; a getter, or a property without a setter, is read-only."""
    kind = type(host)
    label = f"{kind.__name__}.{name}"
    member = getattr(kind, name, None)
    if callable(member):
        return HostNumber(label, getattr(host, name), None, fixed="a method; make it a property with a setter")
    if member is None and not hasattr(host, name):
        raise LinkError(f"{kind.__name__} has no attribute {name}{did_you_mean(name, dir(host))}")
    fetch = partial(getattr, host, name)
    if isinstance(member, property) and member.fset is None:
        return HostNumber(label, fetch, None, fixed=f"a property without a setter; give it one with @{name}.setter")
    return HostNumber(label, fetch, partial(setattr, host, name))


def entry(host: Mapping[str, object], key: str) -> HostNumber:
    """An entry of a mapping. It must exist (None if it has no value yet); if it is removed later, it is unknown.

    A mapping has no declared types: values are stored as floats.
    """
    kind = type(host).__name__
    if key not in host:
        raise LinkError(
            f"the {kind} has no key {key!r}{did_you_mean(key, map(str, host))};"
            " put it in before linking, with None if it has no value yet"
        )
    whole, fetch = f"{kind}[{key!r}]", partial(host.get, key)
    as_number(host[key], whole)
    if not isinstance(host, MutableMapping):
        return HostNumber(whole, fetch, None, fixed="in a mapping that cannot be changed; link a dict")
    return HostNumber(whole, fetch, partial(setitem, host, key))


# Records: memory laid out by a type, in a ctypes structure or a numpy record.

PATH_STEP = re.compile(r"\.?([^\W\d]\w*)|\[(\d+)\]")

# Simple ctypes types by their codes, which are those of the module `struct`.
SIGNED, UNSIGNED = frozenset("bhilq"), frozenset("BHILQ")
MAX_FLOAT = {"f": float.fromhex("0x1.fffffep127"), "d": ANY_NUMBER.most, "g": ANY_NUMBER.most}


def field(host: object, path: str) -> HostNumber:
    """A field in a ctypes structure or union, or in a numpy record (one row of a structured array)."""
    steps = _steps(path, type(host).__name__)
    if "ctypes" in sys.modules:
        import ctypes

        if isinstance(host, ctypes.Structure | ctypes.Union):
            return _in_structure(host, steps)
    if "numpy" in sys.modules:
        import numpy

        if isinstance(host, numpy.void | numpy.ndarray):
            return _in_record(host, steps)
    raise LinkError(
        f"a {type(host).__name__} is neither a ctypes structure nor a numpy record;"
        " link a dictionary with link_mapping, a robot's class with @sensor and @actuator"
    )


def _steps(path: str, host: str) -> list[str | int]:
    """`pose.sonar[3]` as ["pose", "sonar", 3]."""
    steps = list(PATH_STEP.finditer(path))
    if not steps or path.startswith(".") or "".join(step.group() for step in steps) != path:
        raise LinkError(f"{path!r} is no path to a field of {host}; write for example velocity, pose.x or sonar[3]")
    return [step[1] or int(step[2]) for step in steps]


def _in_structure(host: Structure, steps: list[str | int]) -> HostNumber:
    """Follow the declared types along with the memory: ctypes returns plain Python numbers, which do not say what
    fits."""
    label, bits = type(host).__name__, None
    owner: Any = host
    kind: Any = type(host)
    for at, step in enumerate(steps):
        if at:
            before = steps[at - 1]
            owner = owner[before] if isinstance(before, int) else getattr(owner, before)
        if isinstance(step, int):
            _check_index(step, getattr(kind, "_length_", None), label)
            kind, bits, label = kind._type_, None, f"{label}[{step}]"
        else:
            fields = _fields_of(kind)
            if step not in fields:
                raise _no_field(label, step, fields)
            (kind, bits), label = fields[step], f"{label}.{step}"
    holds, last = _simple(kind, bits, label), steps[-1]
    if isinstance(last, int):
        return HostNumber(label, partial(getitem, owner, last), partial(setitem, owner, last), holds)
    return HostNumber(label, partial(getattr, owner, last), partial(setattr, owner, last), holds)


def _fields_of(kind: type) -> dict[str, tuple[Any, int | None]]:
    """Type and width in bits (None: the type's own) of each field, including those of base classes and anonymous
    parts."""
    fields: dict[str, tuple[Any, int | None]] = {}
    for base in reversed(kind.__mro__):
        anonymous = vars(base).get("_anonymous_", ())
        for name, of, *width in vars(base).get("_fields_", ()):
            if name in anonymous:
                fields.update(_fields_of(of))
            fields[name] = (of, width[0] if width else None)
    return fields


def _simple(kind: Any, bits: int | None, label: str) -> NumberType:
    letter = getattr(kind, "_type_", None)
    if letter == "?":
        return NumberType(kind.__name__, "bool")
    if letter in tuple(MAX_FLOAT):
        return NumberType(kind.__name__, "float", -MAX_FLOAT[letter], MAX_FLOAT[letter])
    if not isinstance(letter, str) or letter not in SIGNED | UNSIGNED:
        raise _no_number(label, kind.__name__)
    import ctypes

    typename = kind.__name__ if bits is None else f"{kind.__name__} of {bits} bits"
    return _integer(typename, 8 * ctypes.sizeof(kind) if bits is None else bits, signed=letter in SIGNED)


def _in_record(host: Record, steps: list[str | int]) -> HostNumber:
    """Each step of the path, except for the last, returns a view of the host's memory."""
    if host.dtype.names is None or host.ndim:
        raise LinkError(
            f"an array of type {host.dtype} and shape {host.shape} is no record: link one row of a structured array"
        )
    label = type(host).__name__
    owner: Any = host
    for at, step in enumerate(steps):
        if at:
            owner = owner[steps[at - 1]]
        if isinstance(step, int):
            _check_index(step, owner.shape[0] if owner.ndim else None, label)
            label = f"{label}[{step}]"
        else:
            names = owner.dtype.names if owner.dtype.names and not owner.ndim else ()
            if step not in names:
                raise _no_field(label, step, names)
            label = f"{label}.{step}"
    last: Any = steps[-1]
    fetch, holds = partial(getitem, owner, last), _scalar(owner[last], label)
    if not owner.flags.writeable:
        return HostNumber(
            label, fetch, None, holds, fixed="in an array that is read-only; set its flags.writeable first"
        )
    return HostNumber(label, fetch, partial(setitem, owner, last), holds)


def _scalar(record: Record, label: str) -> NumberType:
    kind, typename = record.dtype.kind, record.dtype.type.__name__
    if record.ndim or kind not in "biuf":
        raise _no_number(label, f"{typename} of shape {record.shape}" if record.ndim else typename)
    if kind == "b":
        return NumberType(typename, "bool")
    if kind in "iu":
        return _integer(typename, 8 * record.dtype.itemsize, signed=kind == "i")
    import numpy

    most = min(float(numpy.finfo(record.dtype).max), ANY_NUMBER.most)
    return NumberType(typename, "float", -most, most)


def _integer(typename: str, width: int, *, signed: bool) -> NumberType:
    if signed:
        return NumberType(typename, "int", -(1 << width - 1), (1 << width - 1) - 1)
    return NumberType(typename, "int", 0, (1 << width) - 1)


def _check_index(index: int, length: int | None, label: str) -> None:
    if length is None:
        raise LinkError(f"{label} is no array, so it has no element [{index}]")
    if index >= length:
        raise LinkError(f"{label} has the elements [0] to [{length - 1}], so there is no [{index}]")


def _no_field(label: str, name: str, fields: Iterable[str]) -> LinkError:
    names = list(fields)
    has = f"its fields are {', '.join(names)}" if names else "it has no fields"
    return LinkError(f"{label} has no field {name}{did_you_mean(name, names)}; {has}")


def _no_number(label: str, typename: str) -> LinkError:
    return LinkError(f"{label} is a {typename}, which is not one number; link a number, such as one part of it")
