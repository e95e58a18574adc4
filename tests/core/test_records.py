"""Our `dataclass` and `NamedTuple` are Python's in all that can be seen: each class here is made by both, and behaves
the same."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
import types
from collections.abc import Callable
from dataclasses import InitVar, field
from typing import Any, ClassVar, NamedTuple, TypeAlias, get_type_hints

import msgspec
import pytest

from sleepcast.core import records

Decorator: TypeAlias = Callable[..., Any]
MADE: dict[str, list[Any]] = {}
"""Each class as Python makes it, and as we do."""


def both(**options: Any) -> Callable[[type], type]:
    """Make a class in both ways; gives ours."""

    def make(cls: type) -> type:
        theirs, own = (type(cls.__name__, cls.__bases__, dict(cls.__dict__)) for _ in range(2))
        MADE[cls.__name__] = [dataclasses.dataclass(theirs, **options), records.dataclass(own, **options)]
        return MADE[cls.__name__][1]

    return make


@both(frozen=True, slots=True)
class Frozen:
    """A usual one."""

    first: int
    second: float = 2.0
    third: tuple[int, ...] = ()
    KIND: ClassVar[str] = "k"


@both(frozen=True)
class Open:
    first: int
    many: list[int] = field(default_factory=list)
    hidden: int = field(default=3, repr=False, compare=False)
    named: int = field(default=4, kw_only=True)


@both(slots=True)
class Changing:
    first: int
    made: list[int] = field(init=False, default_factory=lambda: [7])
    fixed: int = field(init=False, default=5)
    late: int = field(init=False)

    def __post_init__(self) -> None:
        self.late = self.first + 1


@both(eq=False)
class Plain:
    first: int = 1


@both(frozen=True, slots=True)
class Empty:
    pass


@both(frozen=True)
class Own:
    first: int
    second: int = 2

    def __init__(self, first: int) -> None:
        object.__setattr__(self, "first", first)

    def __repr__(self) -> str:
        return "own"

    def __eq__(self, other: object) -> bool:
        return True

    def __hash__(self) -> int:
        return 12


@both(frozen=True)
class Comparing:
    first: int

    def __eq__(self, other: object) -> bool:
        return True


@both(frozen=True, order=True)
class Ordered:
    first: int


@both()
class Beginning:
    first: int
    start: InitVar[int]

    def __post_init__(self, start: int) -> None:
        self.first += start


def said(work: Callable[..., object], *of: object) -> object:
    """What came out, or what was raised."""
    try:
        return work(*of)
    except Exception as error:
        return type(error), str(error)


TRIED: list[Callable[[Any], object]] = [
    lambda cls: repr(cls(1)),
    lambda cls: repr(cls(1, 5)),
    lambda cls: repr(cls(1, 5, 6, 7, 8)),
    lambda cls: repr(cls(first=3)),
    lambda cls: repr(cls(1, named=9)),
    lambda cls: repr(cls()),
    lambda cls: repr(cls(nothing=1)),
    lambda cls: [cls(1) == cls(1), cls(1) == cls(2), cls(1) == 1, cls(1) != cls(1)],
    lambda cls: hash(cls(1)) == hash(cls(1)) or hash(cls(1)) != hash(cls(2)),
    lambda cls: hash((1, 2.0, ())) == hash(cls(1)),
    lambda cls: cls.__hash__ is None,
    lambda cls: setattr(cls(1), "first", 5),
    lambda cls: hasattr(cls, "__slots__") or setattr(cls(1), "nothing", 5),
    lambda cls: delattr(cls(1), "first"),
    lambda cls: repr(dataclasses.replace(cls(1), first=8)),
    lambda cls: dataclasses.asdict(cls(1)),
    lambda cls: [(each.name, each.default, each.type, each.init, each.compare) for each in dataclasses.fields(cls)],
    lambda cls: str(cls.__dataclass_params__),
    lambda cls: cls.__match_args__,
    lambda cls: getattr(cls, "__slots__", None),
    lambda cls: str(inspect.signature(cls)).replace(repr(dataclasses.MISSING), "<factory>"),
    lambda cls: repr(copy.copy(cls(1))) + repr(copy.deepcopy(cls(1))),
    lambda cls: hasattr(cls(1), "__dict__"),
    lambda cls: cls(1) < cls(2),
    lambda cls: sorted(name for name, each in vars(cls).items() if inspect.isfunction(each)),
    lambda cls: cls.__init__.__qualname__ + cls.__init__.__module__,
    lambda cls: cls.KIND,
]


@pytest.mark.parametrize("name", MADE)
def test_both_behave_the_same(name: str) -> None:
    theirs, own = ([said(tried, cls) for tried in TRIED] for cls in MADE[name])
    assert own == theirs


def test_it_holds_itself() -> None:
    theirs, own = (cls(1, []) for cls in MADE["Open"])
    for each in (theirs, own):
        each.many.append(each)
    assert repr(own) == repr(theirs)


def test_it_is_pickled() -> None:
    thing: Any = Frozen(4, 5.0, (6,))
    assert pickle.loads(pickle.dumps(thing)) == thing
    assert thing.__getstate__() == MADE["Frozen"][0](4, 5.0, (6,)).__getstate__()


@pytest.mark.parametrize("dataclass", [dataclasses.dataclass, records.dataclass])
def test_classes_derive_from_it_as_from_python_s(dataclass: Decorator) -> None:
    base = dataclass(frozen=True)(type("Base", (), {"__annotations__": {"first": "int"}}))
    with pytest.raises(TypeError, match="non-frozen"):
        dataclass(type("Derived", (base,), {"__annotations__": {"second": "int"}}))
    derived = dataclass(frozen=True)(type("Derived", (base,), {"__annotations__": {"second": "int"}}))
    assert repr(derived(1, 2)) == "Derived(first=1, second=2)"
    plain = type("Plain", (base,), {})(1)
    plain.other = 5
    with pytest.raises(dataclasses.FrozenInstanceError, match="cannot assign to field 'first'"):
        plain.first = 2
    with pytest.raises(TypeError, match="__setattr__"):
        dataclass(frozen=True)(type("Base", (), {"__annotations__": {"a": "int"}, "__setattr__": setattr}))
    with pytest.raises(TypeError, match="non-default argument 'b' follows default"):
        dataclass(type("Base", (), {"__annotations__": {"a": "int", "b": "int"}, "a": 1}))


def pair(base: Any, **more: object) -> Any:
    """A named tuple that is derived from `base`."""
    body = {
        "__doc__": "Two things.",
        "__module__": __name__,
        "__annotations__": {"first": "int", "second": "tuple[str, ...]"},
        "second": ("a",),
        "many": property(lambda self: self.first + len(self.second)),
        "of": classmethod(lambda cls, first: cls(first)),
        **more,
    }
    return types.new_class("Pair", (base,), {}, lambda own: own.update(body))


TOLD: list[Callable[[Any], object]] = [
    lambda base: pair(base)(1),
    lambda base: pair(base)(),
    lambda base: pair(base)(1, second=()),
    lambda base: pair(base)(2)._replace(first=3).many,
    lambda base: pair(base).of(5)._asdict(),
    lambda base: [getattr(pair(base), each) for each in ("_fields", "_field_defaults", "__doc__", "__bases__")],
    lambda base: [getattr(pair(base), each) for each in ("__name__", "__qualname__", "__module__")],
    lambda base: get_type_hints(pair(base)),
    lambda base: str(inspect.signature(pair(base)).replace(parameters=[])),
    lambda base: list(inspect.signature(pair(base)).parameters),
    lambda base: hasattr(pair(base)(1), "__dict__"),
    lambda base: setattr(pair(base)(1), "first", 2),
    lambda base: pair(base)(1) == (1, ("a",)) and hash(pair(base)(1)) == hash((1, ("a",))),
    lambda base: msgspec.json.decode(msgspec.json.encode(pair(base)(7)), type=pair(base)),
]


@pytest.mark.parametrize("tried", TOLD, ids=range(len(TOLD)))
def test_named_tuples_behave_the_same(tried: Callable[[Any], object]) -> None:
    own = said(lambda: tried(records.NamedTuple))
    assert own == said(lambda: tried(NamedTuple))


@pytest.mark.parametrize("base", [NamedTuple, records.NamedTuple])
def test_named_tuples_are_refused_alike(base: Any) -> None:
    with pytest.raises(TypeError, match="default"):
        pair(base, __annotations__={"second": "int", "first": "int"})
    with pytest.raises(AttributeError, match="_fields"):
        pair(base, _fields=())
