"""`dataclass` and `NamedTuple`, as Python's own, for what every start imports.

Python before 3.13 compiles each method of a data class by itself, and the type of each field of a named tuple, half a
millisecond for a class; a short run spent a tenth of its time on that. Here classes of one form share what is compiled,
and types of fields stay texts. What is unusual goes Python's own way.
"""

from __future__ import annotations

import dataclasses
import sys
from collections import namedtuple
from collections.abc import Callable
from dataclasses import MISSING, Field, FrozenInstanceError
from functools import cache
from reprlib import recursive_repr
from types import CodeType, FunctionType
from typing import TYPE_CHECKING, Any

RESERVED = frozenset({"__new__", "__init__", "__slots__", "__getnewargs__", "_fields", "_make", "_replace", "_asdict"})
"""What a named tuple may not define otherwise."""

if TYPE_CHECKING or sys.version_info >= (3, 13):
    from dataclasses import dataclass as dataclass
    from typing import NamedTuple as NamedTuple
else:

    class _Naming(type):
        """What makes a named tuple of a class that says it is one."""

        def __new__(cls, name: str, bases: tuple[type, ...], own: dict[str, Any]) -> Any:
            if not bases:
                return super().__new__(cls, name, bases, own)
            types = own.get("__annotations__", {})
            defaults = [own[each] for each in types if each in own]
            if any(each in own for each in list(types)[: len(types) - len(defaults)]) or len(bases) > 1:
                raise TypeError(f"{name}: wanted fields without defaults first, and no other base")
            made: Any = namedtuple(name, types, defaults=defaults, module=own["__module__"])
            made.__annotations__ = made.__new__.__annotations__ = types
            for each in own.keys() - types.keys() - {"__module__", "__annotations__"}:
                if each in RESERVED:
                    raise AttributeError(f"{name}: {each} is what makes it a named tuple")
                setattr(made, each, own[each])
            return made

    class NamedTuple(metaclass=_Naming):
        """As `typing.NamedTuple`, as a base."""

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
        setattr(made, name, method and _named(method, name, made))
    return made


def _named(method: Any, name: str, cls: type) -> Any:
    """A method of this name and this class."""
    method.__name__, method.__qualname__, method.__module__ = name, f"{cls.__qualname__}.{name}", cls.__module__
    return method


def _compiled(cls: Any, fields: tuple[Field[Any], ...], frozen: bool, eq: bool) -> dict[str, Any]:
    """What is called so often that it is compiled: `__init__` at once, of which people want to see what it takes; what
    compares when it is called first, which for most classes is never."""
    names = [each.name for each in fields if each.compare]
    mine, its = (f"({' '.join(f'{of}._{number},' for number in range(len(names)))})" for of in ("self", "other"))

    def same(self: Any, other: object) -> Any:
        other_class = "if other.__class__ is not self.__class__: return NotImplemented"
        return replaced("__eq__", f"def __eq__(self, other):\n {other_class}\n return {mine} == {its}")(self, other)

    def hashed(self: Any) -> int:
        number: int = replaced("__hash__", f"def __hash__(self):\n return hash({mine})")(self)
        return number

    def replaced(name: str, text: str) -> FunctionType:
        method = _function(text, names, {})
        setattr(cls, name, _named(method, name, cls))
        return method

    compared = {"__eq__": same, "__hash__": hashed if frozen else None}
    return {"__init__": _beginning(fields, frozen, hasattr(cls, "__post_init__"))} | (compared if eq else {})


def _beginning(fields: tuple[Field[Any], ...], frozen: bool, goes_on: bool) -> FunctionType:
    """The `__init__` of a class. goes_on: whether it has a `__post_init__`."""
    known: dict[str, Any] = {"_set": object.__setattr__, "_absent": MISSING}
    plain, named, lines = ["self"], ["*"], list[str]()
    defaults, of_named = list[Any](), dict[str, Any]()
    for number, each in enumerate(fields):
        value, default = f"_{number}", each.default
        if each.default_factory is not MISSING:
            known[f"_new{number}"] = each.default_factory
            value = f"_new{number}() if _{number} is _absent else _{number}" if each.init else f"_new{number}()"
        elif not each.init and default is MISSING:
            continue
        elif not each.init:
            value = f"_fixed{number}"
            known[value] = default
        has_default = default is not MISSING or each.default_factory is not MISSING
        if each.init and each.kw_only:
            named.append(f"_{number}")
            of_named |= {each.name: default} if has_default else {}
        elif each.init:
            plain.append(f"_{number}")
            if defaults and not has_default:
                raise TypeError(f"non-default argument {each.name!r} follows default argument")
            defaults += [default] if has_default else []
        lines.append(f"_set(self, '_{number}', {value})" if frozen else f"self._{number} = {value}")
    lines += ["self.__post_init__()"] if goes_on else []
    text = f"def __init__({', '.join(plain + (named if len(named) > 1 else []))}):\n {'; '.join(lines or ['pass'])}"
    begin = _function(text, [each.name for each in fields], known)
    begin.__defaults__, begin.__kwdefaults__ = tuple(defaults), of_named
    begin.__annotations__ = {each.name: each.type for each in fields if each.init} | {"return": None}
    return begin


def _function(text: str, names: list[str], known: dict[str, Any]) -> FunctionType:
    """The function that a text defines, with these names for `_0`, `_1` and so on. The text says only how many there
    are and what is done with them, so that classes of one form share what was compiled. known: what else it names."""
    code, named = _code(text), {f"_{number}": name for number, name in enumerate(names)}
    variables, attributes, constants = (
        tuple(named.get(each, each) for each in some) for some in (code.co_varnames, code.co_names, code.co_consts)
    )
    return FunctionType(code.replace(co_varnames=variables, co_names=attributes, co_consts=constants), known)


@cache
def _code(text: str) -> CodeType:
    """The code of the only function in a text."""
    return next(each for each in compile(text, "<string>", "exec").co_consts if isinstance(each, CodeType))


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
