"""Declarations: how a host describes the variables and functions that it links.

`sensor` and `actuator` describe a variable: as decorators of a getter they mark it for linking; in the table given
to `link_struct` and `link_mapping` they describe a field or an entry. `function` and `command` mark a method that
expressions may call. Declarations use the host's own units; numbers are converted to and from SI where they pass
between the host and the robot's mind, and nowhere else.

    class Scout:
        @property
        @actuator(unit="m/s", low=-0.5, high=0.5)
        def velocity(self) -> float: ...
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from types import FunctionType
from typing import Any, TypeVar, overload

from sleepcast.core.errors import did_you_mean
from sleepcast.core.model import HostFunction, Quantity
from sleepcast.core.records import dataclass
from sleepcast.core.units import NONE, UNITS, Dimension, to_si
from sleepcast.language.functions import MANY
from sleepcast.node.host_memory import LinkError, as_number

MARK = "__sleepcast__"
"""The attribute of a getter or method that holds its declaration."""

Member = TypeVar("Member", bound=Callable[..., Any] | property)
Method = TypeVar("Method", bound=Callable[..., Any])


@dataclass(frozen=True, slots=True)
class Declaration:
    """One linked variable, as returned by `sensor` or `actuator`; calling it marks a getter or property."""

    acts: bool
    unit: str
    low: float
    high: float
    freshness: float = math.inf
    measured_at: str = ""
    rest: float | None = None
    field: str = ""
    name: str = ""
    doc: str = ""

    def __call__(self, member: Member) -> Member:
        getter = member.fget if isinstance(member, property) else member
        if not isinstance(getter, FunctionType):
            raise LinkError(f"@sensor and @actuator stand over a property or a method, not over {member!r:.60}")
        setattr(getter, MARK, self)
        return member

    def quantity(self, name: str, doc: str = "") -> Quantity:
        """The variable in the vocabulary's form, its range in SI."""
        low, high = si(self.low, self.unit), si(self.high, self.unit)
        return Quantity(name, self.unit, low, high, self.freshness, self.doc or doc)


def sensor(
    *,
    unit: str = "",
    low: float = -math.inf,
    high: float = math.inf,
    freshness: float = math.inf,
    measured_at: str = "",
    field: str = "",
    name: str = "",
    doc: str = "",
) -> Declaration:
    """A variable that the host measures and expressions read.

    unit: of the host's number, a key of `units.UNITS`, "" for a plain number.
    low, high: its range, in that unit.
    freshness: seconds after which a measurement counts as unknown; the host gives the time of measurement through the
        attribute, field or key `measured_at` (seconds, by the robot's clock) or through `VariableTable.measured`.
    field: the attribute, field path or key, if it differs from the variable's name.
    name: of the variable, if it differs from the getter's.

    Raises LinkError for invalid values.
    """
    return _checked(Declaration(False, unit, low, high, freshness, measured_at, None, field, name, doc))


def actuator(
    *,
    unit: str = "",
    low: float = -math.inf,
    high: float = math.inf,
    rest: float | None = None,
    field: str = "",
    name: str = "",
    doc: str = "",
) -> Declaration:
    """A variable that expressions set, for the host to act on; the parameters are those of `sensor`.

    Values are first clamped to low..high: the last check before the host's own. rest: the value set when the robot
    is stopped; None means 0 for motion (a speed, a rate, an acceleration) and no change for everything else.
    """
    _check_unit(unit)
    if rest is None and unit and UNITS[unit].dimension.time < 0:
        rest = 0.0
    if rest is not None and not low <= rest <= high:
        raise LinkError(f"rest={rest:g}, to which STOP sets it, is outside low={low:g} to high={high:g}; give another")
    return _checked(Declaration(True, unit, low, high, rest=rest, field=field, name=name, doc=doc))


def _checked(declaration: Declaration) -> Declaration:
    _check_unit(declaration.unit)
    if not declaration.low < declaration.high:
        raise LinkError(f"low={declaration.low:g} is not below high={declaration.high:g}")
    if not declaration.freshness > 0:
        raise LinkError(f"freshness={declaration.freshness:g} is not a number of seconds above 0")
    if declaration.measured_at and math.isinf(declaration.freshness):
        raise LinkError(
            f"measured_at={declaration.measured_at!r} has no use without a freshness limit; give freshness= too"
        )
    return declaration


def _check_unit(unit: str) -> None:
    if unit and unit not in UNITS:
        raise LinkError(f"unknown unit {unit!r}{did_you_mean(unit, UNITS)}; the units are {' '.join(UNITS)}")


@dataclass(frozen=True, slots=True)
class Operation:
    """One linked method, as returned by `function` or `command`; units None: not declared."""

    acts: bool
    units: tuple[str | None, ...] | None
    result: str | None
    labelled: bool
    name: str
    doc: str

    def __call__(self, method: Method) -> Method:
        if not isinstance(method, FunctionType):
            raise LinkError(f"@function and @command stand over a method, not over {method!r:.60}")
        setattr(method, MARK, self)
        return method

    def host_function(self, kind: type, attribute: str) -> HostFunction:
        """The function in the vocabulary's form; it calls the method `attribute` of any body it is given."""
        label, method = f"{kind.__name__}.{attribute}", getattr(kind, attribute)
        names, least = _parameters(method, label)
        numbers = len(names) - self.labelled
        if numbers < 0:
            raise LinkError(f"{label} is labelled, so its first argument is the text, but it takes no argument")
        if self.units is not None and len(self.units) != numbers:
            raise LinkError(f"{label} takes {numbers} numbers, but units= names {len(self.units)} units")
        units = self.units if self.units is not None else (None,) * numbers
        return HostFunction(
            self.name or attribute,
            _caller(attribute, label, (None, *units) if self.labelled else units, self.result),
            tuple(map(_dimension, units)),
            max(0, least - self.labelled),
            " ".join(names),
            _dimension(self.result),
            self.acts,
            self.labelled,
            self.doc or first_line(method),
        )


def declared_in(kind: type) -> dict[str, Declaration | Operation]:
    """The declarations of a class, by attribute, base classes first; an overridden attribute keeps its declaration."""
    declared: dict[str, Declaration | Operation] = {}
    for base in reversed(kind.__mro__):
        for name, member in vars(base).items():
            mark = getattr(member.fget if isinstance(member, property) else member, MARK, None)
            if isinstance(mark, Declaration | Operation):
                declared[name] = mark
    return declared


@overload
def function(method: Method, /) -> Method: ...
@overload
def function(
    *, units: Sequence[str | None] | None = None, result: str | None = None, name: str = "", doc: str = ""
) -> Operation: ...
def function(
    method: Method | None = None,
    /,
    *,
    units: Sequence[str | None] | None = None,
    result: str | None = None,
    name: str = "",
    doc: str = "",
) -> Method | Operation:
    """A method that computes a number and changes nothing.

    units: one for each argument, as for `sensor`, None where any number is accepted.
    result: the unit of the returned number; a method may also return None, which counts as 1.
    name: the name in expressions, if it differs from the method's.
    """
    made = _operation(Operation(False, None if units is None else tuple(units), result, False, name, doc))
    return made if method is None else made(method)


@overload
def command(method: Method, /) -> Method: ...
@overload
def command(
    *,
    units: Sequence[str | None] | None = None,
    result: str | None = None,
    labelled: bool = False,
    name: str = "",
    doc: str = "",
) -> Operation: ...
def command(
    method: Method | None = None,
    /,
    *,
    units: Sequence[str | None] | None = None,
    result: str | None = None,
    labelled: bool = False,
    name: str = "",
    doc: str = "",
) -> Method | Operation:
    """A method that acts on the world: like `function`, but it is never called with an unknown argument.

    labelled: its first argument is a text in quotes instead of a number; `units` does not include it.
    """
    made = _operation(Operation(True, None if units is None else tuple(units), result, labelled, name, doc))
    return made if method is None else made(method)


def _operation(made: Operation) -> Operation:
    for unit in (*(made.units or ()), made.result):
        _check_unit(unit or "")
    return made


def _dimension(unit: str | None) -> Dimension | None:
    return None if unit is None else UNITS[unit].dimension if unit else NONE


def _parameters(method: Callable[..., object], label: str) -> tuple[list[str], int]:
    """Names of a method's parameters, and how many of them are required."""
    from inspect import Parameter, signature  # slow to load, and only linking needs it

    _, *parameters = signature(method).parameters.values()
    for each in parameters:
        if each.kind not in (Parameter.POSITIONAL_ONLY, Parameter.POSITIONAL_OR_KEYWORD):
            raise LinkError(f"{label} cannot be called from expressions: {each} is no plain positional argument")
    if len(parameters) > MANY:
        raise LinkError(f"{label} takes {len(parameters)} arguments; an expression gives {MANY} at most")
    return [each.name for each in parameters], sum(each.default is Parameter.empty for each in parameters)


def _caller(
    attribute: str, label: str, units: tuple[str | None, ...], result: str | None
) -> Callable[..., float | None]:
    if not any(units):

        def call(body: object, *arguments: float) -> object:
            return getattr(body, attribute)(*arguments)

    else:

        def call(body: object, *arguments: float) -> object:
            given = zip(arguments, units, strict=False)  # arguments with a default may be left out
            return getattr(body, attribute)(*(from_si(x, unit) if unit else x for x, unit in given))

    def call_number(body: object, *arguments: float) -> float | None:
        returned = call(body, *arguments)
        return None if returned is None else si(as_number(returned, f"what {label} returned"), result or "")

    return call_number


def si(number: float, unit: str) -> float:
    """Convert a number in the host's `unit` to SI."""
    return to_si(number, unit) if unit else number


def from_si(number: float, unit: str) -> float:
    """Convert a number in SI to the host's `unit`."""
    return number / UNITS[unit].factor if unit else number


def first_line(documented: object) -> str:
    """The first line of a docstring, "" if there is none."""
    text = getattr(documented, "__doc__", None) or ""
    return text.strip().partition("\n")[0]
