"""Places: where one number lies in a host's own memory, and what fits there.

A `Place` fetches and stores the very number that the host program uses; nothing is copied. Here are the places in an
object (its attributes, properties and getters) and in a mapping; `records` has those in memory laid out by a type.
A place is looked up once, when it is linked, so what cannot hold a number is refused then, and a number that does not
fit is refused when it is stored.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, MutableMapping
from functools import partial
from operator import setitem
from typing import NamedTuple

from sleepcast.core.errors import MisuseError, did_you_mean


class LinkError(MisuseError):
    """A variable or function that cannot be linked, or a number that the host's memory cannot give or take."""


class Field(NamedTuple):
    """The numbers that a field holds. sort: "float", "int" or "bool"; least, most: its bounds, both included."""

    typename: str
    sort: str = "float"
    least: float = -sys.float_info.max
    most: float = sys.float_info.max

    def fit(self, value: float, label: str) -> float | int | bool:
        """A finite `value` as this field holds it: rounded (a half to the even integer) or made a truth.

        Raises LinkError if it lies outside the field's bounds.
        """
        if self.sort == "bool":
            return value != 0.0
        fitted = round(value) if self.sort == "int" else value
        if not self.least <= fitted <= self.most:
            raise LinkError(
                f"{label} cannot be set to {value:.15g}: it is a {self.typename},"
                f" which holds {self.least:.15g} to {self.most:.15g}"
            )
        return fitted


ANY_NUMBER = Field("float")


class Place(NamedTuple):
    """One number of the host. label: as people know it (`Scout.velocity`).

    store: None where it can only be read; `fixed` then says why, and what could be done about it.
    """

    label: str
    fetch: Callable[[], object]
    store: Callable[[float | int | bool], None] | None
    field: Field = ANY_NUMBER
    fixed: str = ""


def as_number(found: object, label: str) -> float:
    """What a host gave as a float: numbers and truths of any kind; None and whatever is not finite are unknown (NaN).

    Raises LinkError for what is no number at all, a text of digits included.
    """
    if found is None:
        return math.nan
    if not hasattr(found, "__float__") and not hasattr(found, "__index__"):
        raise LinkError(f"{label} holds {found!r:.60}, which is not a number")
    try:
        number = float(found)  # type: ignore[arg-type]  # float() asks for one of the two methods above
    except OverflowError:
        return math.nan
    except (TypeError, ValueError) as error:
        raise LinkError(f"{label} holds {found!r:.60}, which is not one number") from error
    return number if math.isfinite(number) else math.nan


def attribute(host: object, name: str) -> Place:
    """An attribute, property or getter of an object; a property without a setter and a getter can only be read."""
    kind = type(host)
    label = f"{kind.__name__}.{name}"
    member = getattr(kind, name, None)
    if callable(member):
        return Place(label, getattr(host, name), None, fixed="a method; make it a property with a setter")
    if member is None and not hasattr(host, name):
        raise LinkError(f"{kind.__name__} has no attribute {name}{did_you_mean(name, dir(host))}")
    fetch = partial(getattr, host, name)
    if isinstance(member, property) and member.fset is None:
        return Place(label, fetch, None, fixed=f"a property without a setter; give it one with @{name}.setter")
    return Place(label, fetch, partial(setattr, host, name))


def entry(host: Mapping[str, object], key: str) -> Place:
    """An entry of a mapping. It must be there (None if it has no value yet); one that goes away later is unknown.

    A mapping has no types of its own: what is stored is a float.
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
        return Place(whole, fetch, None, fixed="in a mapping that cannot be changed; link a dict")
    return Place(whole, fetch, partial(setitem, host, key))
