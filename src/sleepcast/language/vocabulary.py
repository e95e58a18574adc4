"""Vocabularies: the names that a robot knows before anything is sent to it, and the slots its values lie in.

A robot's numbers are one list of floats, NaN for unknown. A `Vocabulary` says what lies where: first the support
variables that every robot has, then the variables of its type, then, appended as they are first heard of, user
variables. Robots of one type share one vocabulary, so a program compiled for one runs on all of them.
Names are compared case-folded, in one namespace; a clash is refused when it is declared.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from copy import copy
from dataclasses import field
from enum import Enum
from typing import TypeVar

from sleepcast.core.errors import MisuseError
from sleepcast.core.model import Constant, HostFunction, MapOutline, NamedArea, Quantity
from sleepcast.core.records import dataclass
from sleepcast.core.units import NONE
from sleepcast.language.functions import BODY_WORDS, BUILT_IN, CHOOSING, FUNCTIONS, NEIGHBOURS, PRIORITY, TIMED

BUFFERS = 64
"""Buffers E0 (the message) to E63."""
MAX_RULES = 64
"""Rules with a name of their own, on one robot."""
MAX_USER_VARIABLES = 256
"""User variables that the robots of one vocabulary may name between them."""
MAX_OPERATORS = 64
"""Operators made by DEFUN, on one robot."""
MAX_GROUPS = 64
"""Groups that one robot may know."""
NEW_FORMS = frozenset({PRIORITY, NEIGHBOURS, CHOOSING, TIMED})
"""Forms, and parts of forms, that came after 0.2.0: robots that know them say so, and others refuse what has them, or
take it for something else."""


class VariableKind(Enum):
    """The four kinds of variables."""

    SENSOR = "sensor"
    ACTUATOR = "actuator"
    SUPPORT = "support"
    USER = "user"


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of a vocabulary. slot: where its value lies. linked: it lies in the host's own memory instead."""

    quantity: Quantity
    kind: VariableKind
    slot: int
    linked: bool = False

    @property
    def name(self) -> str:
        return self.quantity.name


Binding = Variable | Constant | HostFunction


Thing = TypeVar("Thing")


class VocabularyError(MisuseError):
    """A name that clashes with another, or more names than fit."""


SUPPORT = (
    Quantity("marked", low=0, high=1, doc="the selection flag set by MARK"),
    Quantity("marking", low=0, high=1, doc="whether the light shows the mark (unless told not to)"),
    Quantity("frozen", low=0, high=1, doc="held still by FREEZE"),
    Quantity("sleeping", low=0, high=1, doc="powered down by SLEEP"),
    *(Quantity(f"active{i}", low=0, high=1, doc=f"whether buffer E{i} runs at every tick") for i in range(1, BUFFERS)),
    Quantity("id", doc="the robot's number", low=0),
    Quantity("time", "s", low=0, doc="time since the start"),
    Quantity("tick", low=0, doc="ticks since the start"),
)
MARKED, MARKING, FROZEN, SLEEPING = range(4)
ACTIVE0 = 3
"""Slot of active<i> is ACTIVE0 + i."""
ID, TIME_SLOT, TICK = ACTIVE0 + BUFFERS, ACTIVE0 + BUFFERS + 1, ACTIVE0 + BUFFERS + 2
_READ_ONLY_SUPPORT = frozenset({ID, TIME_SLOT, TICK})

CONSTANTS = (
    Constant("TRUE", 1.0, NONE, "truth"),
    Constant("FALSE", 0.0, NONE, "falsehood"),
    Constant("NIL", 0.0, None, "the same as FALSE"),
    Constant("PI", math.pi, NONE, "half a turn in radians"),
    Constant("UNKNOWN", math.nan, None, "what nobody has measured"),
)


def buffer_number(key: str) -> int | None:
    """5 for the keys `e5` and `expr5`, None for anything that is no buffer's name."""
    digits = key[4:] if key.startswith("expr") else key[1:] if key.startswith("e") else ""
    if digits.isdigit() and (digits == "0" or digits[0] != "0") and len(digits) <= 2 and int(digits) < BUFFERS:
        return int(digits)
    return None


def rule_key(name: str) -> str:
    """The key of the rule or buffer of this name: `e5` for `expr5`."""
    key = name.casefold()
    number = buffer_number(key)
    return key if number is None else f"e{number}"


@dataclass(eq=False)
class Vocabulary:
    """The names of one type of robot; see the module. Sensors and actuators keep the order they are given in. areas:
    what its robots have learned from the start. forms: see `NEW_FORMS`. outlines: what maps show of these robots."""

    name: str = "robot"
    sensors: tuple[Quantity, ...] = ()
    actuators: tuple[Quantity, ...] = ()
    linked: frozenset[str] = frozenset()
    constants: tuple[Constant, ...] = ()
    functions: tuple[HostFunction, ...] = ()
    areas: tuple[NamedArea, ...] = ()
    forms: frozenset[str] = NEW_FORMS
    outlines: tuple[MapOutline, ...] = ()
    bindings: dict[str, Binding] = field(default_factory=dict, init=False)
    user_slots: dict[str, int] = field(default_factory=dict, init=False)
    _first: Vocabulary | None = field(default=None, init=False)
    _shelf: dict[type, object] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        kinds = (
            (SUPPORT, VariableKind.SUPPORT),
            (self.sensors, VariableKind.SENSOR),
            (self.actuators, VariableKind.ACTUATOR),
        )
        slot = 0
        for quantities, kind in kinds:
            for quantity in quantities:
                own_kind = VariableKind.SENSOR if slot in _READ_ONLY_SUPPORT else kind
                self._declare(Variable(quantity, own_kind, slot, quantity.name.casefold() in self.linked))
                slot += 1
        self.size = slot
        """Slots of the variables that every robot of this type has."""
        others: tuple[Binding, ...] = (*CONSTANTS, *self.constants, *self.functions)
        for binding in others:
            if not (gives_way(binding) and binding.name.casefold() in self.bindings):
                self._declare(binding)
        for area in self.areas:
            self._refuse_clash(area.name, "area")
        self._names = (*(each.name for each in self.bindings.values()), *(each.name for each in BUILT_IN.values()))

    @property
    def neighbours(self) -> HostFunction | None:
        """The function of robots that tell their neighbours; None for others."""
        functions = (each for each in self.bindings.values() if isinstance(each, HostFunction))
        return next((each for each in functions if each.neighbours is not None), None)

    @property
    def first_sensor(self) -> int:
        """Slot of the first sensor; the others follow in order, then the actuators."""
        return len(SUPPORT)

    @property
    def first_actuator(self) -> int:
        return len(SUPPORT) + len(self.sensors)

    @property
    def first(self) -> Vocabulary:
        """The one that this was made `anew` from; itself otherwise."""
        return self._first or self

    def anew(self) -> Vocabulary:
        """The same names for other robots of this type, which have learned nothing yet; see `common`."""
        other = copy(self)
        other.user_slots, other._first = {}, self.first
        return other

    def common(self, kind: type[Thing]) -> Thing | None:
        """The one thing of this kind that all have in common that were made `anew` from one, as the programs that were
        compiled for any of them. None where this was not made so."""
        if self._first is None:
            return None
        thing = self._first._shelf.setdefault(kind, kind())
        assert isinstance(thing, kind)
        return thing

    def user_slot(self, key: str) -> int:
        """The slot of the user variable `key`, a new one if it was never heard of. Raises VocabularyError if full."""
        slot = self.user_slots.get(key)
        if slot is None:
            if len(self.user_slots) >= MAX_USER_VARIABLES:
                raise VocabularyError(f"no room for a user variable {key}: there are {MAX_USER_VARIABLES} already")
            slot = self.user_slots[key] = self.size + len(self.user_slots)
        return slot

    def names(self) -> tuple[str, ...]:
        """Every name, as declared: variables, constants, the robot's functions and the built-in ones."""
        return self._names

    def _declare(self, binding: Binding) -> None:
        self._refuse_clash(binding.name, describe(binding))
        self.bindings[binding.name.casefold()] = binding

    def _refuse_clash(self, name: str, what: str) -> None:
        """Raise VocabularyError if something has this name already."""
        key = name.casefold()
        if key in self.bindings and gives_way(self.bindings[key]):
            return
        if key in self.bindings or key in FUNCTIONS or buffer_number(key) is not None:
            other = (
                f"the {describe(self.bindings[key])} {self.bindings[key].name}"
                if key in self.bindings
                else f"the function {FUNCTIONS[key].name}"
                if key in FUNCTIONS
                else f"the buffer {key.upper()}"
            )
            raise VocabularyError(f"{self.name}: the {what} {name} has the same name as {other}; rename one")


def gives_way(binding: Binding | None) -> bool:
    """Whether names of people's own come before this one."""
    return isinstance(binding, HostFunction) and binding.name.casefold() in BODY_WORDS


def describe(binding: Binding) -> str:
    """What a binding is, in a word or two: `sensor variable`, `constant`, `function`."""
    if isinstance(binding, Variable):
        return f"{binding.kind.value} variable"
    return "constant" if isinstance(binding, Constant) else "function"


def constants(named: Mapping[str, float]) -> tuple[Constant, ...]:
    """Constants from a mapping of names to SI values, each of no stated dimension."""
    return tuple(Constant(name, value) for name, value in named.items())


def unit_of(name: str, vocabulary: Vocabulary) -> str:
    """The unit in which people read the variable `name`; "" for a plain number or no variable."""
    binding = vocabulary.bindings.get(name.casefold())
    return binding.quantity.shown_unit if isinstance(binding, Variable) else ""
