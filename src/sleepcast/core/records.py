"""`dataclass`, as Python's own, for what every start imports.

Python before 3.13 compiles each method of a data class by itself, half a millisecond for a class; a short run spent a
tenth of its time on that. Here they are compiled together, as newer ones do it. What is unusual goes Python's own way.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable
from dataclasses import MISSING, Field, FrozenInstanceError
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING or sys.version_info >= (3, 13):
    from dataclasses import dataclass as dataclass
else:

    def dataclass(
        cls: type | None = None, /, *, frozen: bool = False, slots: bool = False, eq: bool = True, **unusual: Any
    ) -> Any:
        """As `dataclasses.dataclass`."""

        def make(cls: type) -> type:
            derived = any(hasattr(each, "__dataclass_fields__") for each in cls.__bases__)
            if unusual or derived or "InitVar" in str(vars(cls).get("__annotations__")):
                return dataclasses.dataclass(cls, frozen=frozen, slots=slots, eq=eq, **unusual)
            return _made(cls, frozen, slots, eq)

        return make if cls is None else make(cls)


def _made(cls: type, frozen: bool, slots: bool, eq: bool) -> Any:
    """The data class: what it knows of its fields is Python's work, its methods are ours."""
    own = set(cls.__dict__)
    if frozen and own & {"__setattr__", "__delattr__"}:
        raise TypeError(f"{cls.__name__} is frozen: it cannot have __setattr__ or __delattr__ of its own")
    hashed = own if cls.__dict__.get("__hash__") is not None else own - {"__hash__"}  # an `__eq__` has set it to None
    cls.__doc__ = cls.__doc__ or cls.__name__  # or Python works out a signature, only to say something here
    made: Any = dataclasses.dataclass(cls, init=False, repr=False, eq=False, slots=slots)
    settings: Any = made.__dataclass_params__
    settings.init, settings.repr, settings.eq, settings.frozen = True, True, eq, frozen
    fields = dataclasses.fields(made)
    methods = _compiled(made, fields, frozen, eq) | {"__repr__": _repr([each.name for each in fields if each.repr])}
    if frozen:
        methods |= _frozen(made, frozenset(each.name for each in fields))
        methods |= _state([each.name for each in fields]) if slots else {}
    for name, method in methods.items():
        if name in hashed:
            continue
        if method is not None:
            method.__name__, method.__qualname__ = name, f"{made.__qualname__}.{name}"
            method.__module__ = made.__module__
        setattr(made, name, method)
    return made


def _compiled(cls: type, fields: tuple[Field[Any], ...], frozen: bool, eq: bool) -> dict[str, Any]:
    """What is called so often that it is compiled, all at once."""
    known: dict[str, Any] = {"_set": object.__setattr__, "_absent": MISSING}
    plain, named, lines = ["self"], ["*"], list[str]()
    for number, each in enumerate(fields):
        value, default = each.name, ""
        if each.default_factory is not MISSING:
            known[f"_new{number}"], default = each.default_factory, "=_absent"
            value = f"_new{number}() if {each.name} is _absent else {each.name}" if each.init else f"_new{number}()"
        elif each.default is not MISSING:
            known[f"_default{number}"], default = each.default, f"=_default{number}"
            value = each.name if each.init else f"_default{number}"
        elif not each.init:
            continue
        if each.init and "=" in plain[-1] and not (default or each.kw_only):
            raise TypeError(f"non-default argument {each.name!r} follows default argument")
        if each.init:
            (named if each.kw_only else plain).append(each.name + default)
        lines.append(f"_set(self, {each.name!r}, {value})" if frozen else f"self.{each.name} = {value}")
    if hasattr(cls, "__post_init__"):
        lines.append("self.__post_init__()")
    text = f"def __init__({', '.join(plain + (named if len(named) > 1 else []))}):\n {'; '.join(lines or ['pass'])}\n"
    if eq:
        mine, its = (
            f"({' '.join(f'{of}.{each.name},' for each in fields if each.compare)})" for of in ("self", "other")
        )
        text += "def __eq__(self, other):\n if other.__class__ is not self.__class__: return NotImplemented\n"
        text += f" return {mine} == {its}\n"
        text += f"def __hash__(self):\n return hash({mine})" if frozen else "__hash__ = None"
    exec(text, known)
    known["__init__"].__annotations__ = {each.name: each.type for each in fields if each.init} | {"return": None}
    return {name: known[name] for name in ("__init__", *(("__eq__", "__hash__") if eq else ()))}


def _repr(names: list[str]) -> Callable[[Any], str]:
    @recursive_repr()
    def told(self: Any) -> str:
        return f"{self.__class__.__qualname__}({', '.join(f'{name}={getattr(self, name)!r}' for name in names)})"

    return told


def _frozen(cls: Any, names: frozenset[str]) -> dict[str, Callable[..., None]]:
    def assign(self: Any, name: str, value: object) -> None:
        if type(self) is cls or name in names:
            raise FrozenInstanceError(f"cannot assign to field {name!r}")
        super(cls, self).__setattr__(name, value)

    def delete(self: Any, name: str) -> None:
        if type(self) is cls or name in names:
            raise FrozenInstanceError(f"cannot delete field {name!r}")
        super(cls, self).__delattr__(name)

    return {"__setattr__": assign, "__delattr__": delete}


def _state(names: list[str]) -> dict[str, Callable[..., Any]]:
    """For copies and pickles of what is frozen."""

    def take(self: Any) -> list[Any]:
        return [getattr(self, name) for name in names]

    def put(self: Any, state: list[Any]) -> None:
        for name, value in zip(names, state, strict=True):
            object.__setattr__(self, name, value)

    return {"__getstate__": take, "__setstate__": put}
