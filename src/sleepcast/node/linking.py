"""Linking: which names a robot has, where their values are stored, and how old they may be.

A host program links its own variables and functions by name, so that `velocity` in an expression *is* `velocity` in
the host's memory: it is read when an expression reads it and written when one assigns it, without a copy. Three
kinds of hosts can be linked, also mixed in one table:

    table = VariableTable("scout")
    table.link(robot)                                         # an object whose class says @sensor, @actuator, @command
    table.link_struct(v, {"velocity": actuator(unit="m/s")})  # a ctypes structure or a numpy record
    table.link_mapping(state, {"fuel": sensor(unit="%")})     # a dictionary
    node = Node("scout-1", table.vocabulary, body=table.body, variables=table)

`vocabulary` closes the table: nothing can be linked afterwards. Robots of one type share one vocabulary, and so one
set of compiled programs: `VariableTable(like=table.vocabulary).link(another_robot)`.

Sensors that are not linked are stored in the robot's own list of values, which `sense` fills from readings. A
measurement older than its variable's freshness limit reads as unknown (NaN): `refresh` checks values in the list
once a tick, a linked variable is checked whenever it is read.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import inf, isfinite, nan
from typing import NamedTuple, Self

from sleepcast.core.errors import did_you_mean
from sleepcast.core.model import Constant, HostFunction, Quantity
from sleepcast.core.units import to_si
from sleepcast.language.reader import is_name
from sleepcast.language.vocabulary import Variable, VariableKind, Vocabulary
from sleepcast.node.declarations import (
    Declaration,
    actuator,
    command,
    declared_in,
    first_line,
    from_si,
    function,
    sensor,
    si,
)
from sleepcast.node.host_memory import HostNumber, LinkError, as_number, attribute, entry

__all__ = ["LinkError", "VariableTable", "actuator", "command", "function", "sensor"]


class VariableSlot(NamedTuple):
    """A variable and its location. measured: where the host stores the time of its last measurement, if it does.

    rest: the value to which STOP sets an actuator, in SI; None leaves it unchanged.
    """

    quantity: Quantity
    acts: bool
    location: HostNumber
    measured: HostNumber | None
    rest: float | None


class VariableTable:
    """The variables and functions of one robot; see the module.

    name, sensors, actuators, constants, functions: contents of the vocabulary besides what is linked.
    like: the vocabulary of another robot of this type, to be shared; then everything comes from there, and exactly its
        linked names must be linked.
    body: the linked object, on which its functions are called; None if no object is linked.
    """

    def __init__(
        self,
        name: str = "robot",
        *,
        sensors: Sequence[Quantity] = (),
        actuators: Sequence[Quantity] = (),
        constants: Sequence[Constant] = (),
        functions: Sequence[HostFunction] = (),
        like: Vocabulary | None = None,
    ) -> None:
        self.body: object | None = None
        self.stopped = False
        self._name, self._like = name, like
        self._sensors, self._actuators = tuple(sensors), tuple(actuators)
        self._constants, self._functions = tuple(constants), list(functions)
        self._links: list[VariableSlot] = []
        self._vocabulary: Vocabulary | None = None
        self._readers: dict[int, Callable[[], float]] = {}
        self._writers: dict[int, Callable[[float], None]] = {}
        self._rests: list[tuple[int, float]] = []
        self._now = -inf
        self._measured: dict[int, float] = {}
        """Time of the last measurement, by slot, of variables with a freshness limit."""
        self._first = 0
        self._sensed: list[tuple[int, int]] = []
        """For each sensor in the list of values, its index among the readings and its slot."""
        self._aging: list[tuple[int, float]] = []
        """Slot and freshness limit of each variable in the list that has one."""
        self._plain = False
        """Whether all sensors are in the list and none has a limit, so that readings can be copied as a block."""

    # ---- linking

    def link(self, robot: object) -> Self:
        """Link what the class of `robot` marks with @sensor, @actuator, @function and @command. Raises LinkError."""
        kind = type(robot)
        declared = declared_in(kind)
        if isinstance(robot, type):
            raise LinkError(f"{robot.__name__} is a class; link a robot made from it: {robot.__name__}(...)")
        if not declared:
            raise LinkError(f"{kind.__name__} declares nothing to link: mark its properties with @sensor or @actuator")
        if self.body is not None:
            raise LinkError(
                f"a {type(self.body).__name__} is linked already, so the functions of a {kind.__name__} would have"
                " no body to be called on; let one class hold both"
            )
        self._open()
        for name, declaration in declared.items():
            if isinstance(declaration, Declaration):
                doc = first_line(getattr(kind, name))
                self._add(
                    declaration.name or name, declaration, declaration.field or name, partial(attribute, robot), doc
                )
            else:
                self._functions.append(declaration.host_function(kind, name))
                _check_name(self._functions[-1].name)
        self.body = robot
        return self

    def link_struct(self, struct: object, links: Mapping[str, Declaration]) -> Self:
        """Link fields of a ctypes structure or a numpy record: variable names to declarations by `sensor` or
        `actuator`.

        A path names a field with another name, or a nested one: `sensor(field="pose.x")`. Raises LinkError.
        """
        from sleepcast.node.host_memory import field  # only programs with structures need it

        self._open()
        for name, declaration in links.items():
            self._add(name, declaration, declaration.field or name, partial(field, struct))
        return self

    def link_mapping(self, mapping: Mapping[str, object], links: Mapping[str, Declaration]) -> Self:
        """Link entries of a mapping, as `link_struct` does fields. An entry that is None or missing is unknown."""
        self._open()
        for name, declaration in links.items():
            self._add(name, declaration, declaration.field or name, partial(entry, mapping))
        return self

    def _open(self) -> None:
        if self._vocabulary is not None:
            raise LinkError(f"the vocabulary of {self._name} is in use already; link everything before asking for it")

    def _add(
        self, name: str, declaration: Declaration, where: str, look_up: Callable[[str], HostNumber], doc: str = ""
    ) -> None:
        _check_name(name)
        location = look_up(where)
        if declaration.acts and location.store is None:
            raise LinkError(
                f"{location.label} cannot be the actuator {name}, because it is {location.fixed},"
                " or declare it a sensor"
            )
        measured = look_up(declaration.measured_at) if declaration.measured_at else None
        rest = None if declaration.rest is None else si(declaration.rest, declaration.unit)
        self._links.append(VariableSlot(declaration.quantity(name, doc), declaration.acts, location, measured, rest))

    # ---- used by the robot's mind

    @property
    def vocabulary(self) -> Vocabulary:
        """The vocabulary with everything linked; closes the table.

        Raises VocabularyError for a clash of names, LinkError where the table differs from `like`.
        """
        if self._vocabulary is None:
            vocabulary = self._like or self._new_vocabulary()
            if self._like is not None:
                self._check_like(vocabulary)
            self._bind(vocabulary)
            self._vocabulary = vocabulary
        return self._vocabulary

    @property
    def linked_slots(self) -> frozenset[int]:
        """The slots whose values are in the host's memory; their entries in the list of values are unused."""
        return frozenset(self._readers)

    def read(self, slot: int) -> float:
        """A linked variable in SI, NaN if unknown: None, not finite, or older than its freshness limit.

        Raises LinkError, to be recorded as a fault, if the host gives no number or fails; KeyError if nothing is
        linked.
        """
        return self._readers[slot]()

    def write(self, slot: int, value: float) -> None:
        """Set a linked actuator to a value in SI, clamped to its declared range and converted to its field's type.

        Raises LinkError, to be recorded as a fault, if the value is not finite or does not fit, the host refuses it,
        or the robot is stopped; KeyError if no settable variable is linked.
        """
        if self.stopped:
            raise LinkError("nothing linked is set while the robot is stopped")
        self._writers[slot](value)

    def stop(self) -> None:
        """Set linked actuators to their rest values, where they have one, and refuse changes until `release`.

        LinkError for those that the host refuses is raised after all have been tried.
        """
        self.stopped = True
        refused = []
        for slot, rest in self._rests:
            try:
                self._writers[slot](rest)
            except LinkError as error:
                refused.append(str(error))
        if refused:
            raise LinkError("not everything came to rest: " + "; ".join(refused))

    def release(self) -> None:
        """End `stop`. Linked variables keep their values until they are set again."""
        self.stopped = False

    def measured(self, now: float, *names: str) -> None:
        """Record that these variables (none named: all with a freshness limit) were measured at `now`, in s."""
        bindings = self.vocabulary.bindings
        for name in names:
            binding = bindings.get(name.casefold())
            if not isinstance(binding, Variable):
                known = (each.name for each in bindings.values() if isinstance(each, Variable))
                raise LinkError(f"there is no variable {name}{did_you_mean(name, known)}")
            self._measured[binding.slot] = now
        if not names:
            self._measured.update(dict.fromkeys(self._measured, now))

    def sense(self, values: list[float], readings: Sequence[float], now: float) -> None:
        """Store readings (SI, in the order of `vocabulary.sensors`; empty if all sensors are linked) in the list of
        values.

        Values that are not finite count as not measured, so the last measurement remains; linked sensors are not
        touched.
        """
        if not readings:
            return
        if len(readings) != len(self.vocabulary.sensors):
            raise LinkError(f"{len(readings)} readings for the {len(self.vocabulary.sensors)} sensors of {self._name}")
        if self._plain and isfinite(sum(readings)):  # the usual case; a sum that overflows only takes the longer way
            values[self._first : self._first + len(readings)] = readings
            return
        for index, slot in self._sensed:
            reading = readings[index]
            if -inf < reading < inf:
                values[slot] = reading
                if slot in self._measured:
                    self._measured[slot] = now

    def refresh(self, values: list[float], now: float) -> None:
        """Set the time in s, once a tick: values in the list that are older than their limit become unknown."""
        self._now = now
        for slot, limit in self._aging:
            if not now - self._measured[slot] <= limit:
                values[slot] = nan

    # ---- closing the table

    def _new_vocabulary(self) -> Vocabulary:
        sensors = (*self._sensors, *(link.quantity for link in self._links if not link.acts))
        actuators = (*self._actuators, *(link.quantity for link in self._links if link.acts))
        linked = frozenset(link.quantity.name.casefold() for link in self._links)
        return Vocabulary(self._name, sensors, actuators, linked, self._constants, tuple(self._functions))

    def _check_like(self, vocabulary: Vocabulary) -> None:
        """Refuse a table that differs from the vocabulary it shares, naming what differs."""
        here = {link.quantity.name.casefold(): link for link in self._links}
        missing = sorted(vocabulary.linked - set(here))
        if missing:
            raise LinkError(f"{self._name} shares a vocabulary in which {', '.join(missing)} must be linked too")
        for key, link in here.items():
            shared = vocabulary.bindings.get(key)
            kind = VariableKind.ACTUATOR if link.acts else VariableKind.SENSOR
            if key not in vocabulary.linked or not isinstance(shared, Variable):
                raise LinkError(f"{self._name} links {link.quantity.name}, which the vocabulary it shares does not")
            if shared.quantity != link.quantity or shared.kind is not kind:
                raise LinkError(f"{self._name} links {link.quantity.name} otherwise than the vocabulary it shares")
        for each in self._functions:
            if not isinstance(vocabulary.bindings.get(each.name.casefold()), HostFunction):
                raise LinkError(f"{self._name} has a function {each.name}, which the vocabulary it shares does not")

    def _bind(self, vocabulary: Vocabulary) -> None:
        """Resolve names to slots: afterwards no name is looked up."""
        for link in self._links:
            variable = vocabulary.bindings[link.quantity.name.casefold()]
            if not isinstance(variable, Variable):
                raise TypeError(f"{link.quantity.name} is no variable")
            self._readers[variable.slot] = self._fresh_reader(link, variable.slot)
            if link.acts:
                self._writers[variable.slot] = _writer(link)
            if link.rest is not None:
                self._rests.append((variable.slot, link.rest))
        self._first = vocabulary.first_sensor
        in_list = [
            (index, self._first + index, quantity.freshness)
            for index, quantity in enumerate(vocabulary.sensors)
            if self._first + index not in self._readers
        ]
        self._sensed = [(index, slot) for index, slot, _ in in_list]
        self._aging = [(slot, limit) for _, slot, limit in in_list if limit < inf]
        self._measured.update((slot, -inf) for slot, _ in self._aging)
        self._plain = len(in_list) == len(vocabulary.sensors) and not self._aging

    def _fresh_reader(self, link: VariableSlot, slot: int) -> Callable[[], float]:
        """A reader that returns unknown if the measurement is too old."""
        read, limit = _reader(link.location, link.quantity.unit), link.quantity.freshness
        if limit == inf:
            return read
        if link.measured is not None:
            when = _reader(link.measured, "")
        else:
            self._measured[slot] = -inf
            when = partial(self._measured.__getitem__, slot)
        return lambda: read() if self._now - when() <= limit else nan


def _reader(location: HostNumber, unit: str) -> Callable[[], float]:
    fetch, label = location.fetch, location.label

    def read() -> float:
        try:
            value = fetch()
        except Exception as error:  # no exception of the host's own code may end the robot's mind
            raise LinkError(f"{label} cannot be read: {type(error).__name__}: {error}") from error
        number = value if type(value) is float else as_number(value, label)
        if unit:
            number = to_si(number, unit)
        return number if -inf < number < inf else nan

    return read


def _writer(link: VariableSlot) -> Callable[[float], None]:
    location, unit, low, high = link.location, link.quantity.unit, link.quantity.low, link.quantity.high
    store, label = location.store, location.label
    if store is None:
        raise TypeError(f"{label} cannot be set")

    def write(value: float) -> None:
        if not -inf < value < inf:
            raise LinkError(f"{label} cannot be set to {value:g}: only finite numbers are written to the host")
        fitted = location.field.fit(from_si(min(max(value, low), high), unit), label)
        try:
            store(fitted)
        except Exception as error:  # see above
            raise LinkError(f"{label} cannot be set to {fitted:g}: {type(error).__name__}: {error}") from error

    return write


def _check_name(name: str) -> None:
    if not is_name(name):
        raise LinkError(f"{name!r} cannot be written as a name in an expression; give it another with name=")
