"""Robots' classes of one's own: what a program or an installed package adds to simulated bodies.

    class Sampler:                        # one object for each robot
        def __init__(self, body: sc.SimulatedBody) -> None: ...

        @property
        @sensor(unit="%")
        def moisture(self) -> float: ...

A class with `vectorised = True` has one object for the whole fleet, whose properties and arguments are arrays.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from sleepcast.api.commands import read_only
from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.core.extensions import extensions, load_extension
from sleepcast.core.model import HostFunction, Quantity
from sleepcast.language.vocabulary import Variable, Vocabulary
from sleepcast.node.declarations import Declaration, Operation, declared_in, first_line, from_si, si
from sleepcast.node.linking import LinkError, VariableTable
from sleepcast.simulator import Bodies, Payload
from sleepcast.simulator.bodies.bodies import Floats, Whole

ADDED = "sleepcast.robots"
"""The entry point group for packages that add classes of robots."""


class SimulatedBody:
    """Where a robot is, for an object of one's own: numbers for one robot, read-only arrays for all.

    numbers: the `id` of each robot, from 1.
    """

    def __init__(self, bodies: Bodies, which: int | slice) -> None:
        self._bodies, self._which = bodies, which
        self.numbers = read_only(np.arange(1, bodies.count + 1))[which]

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self._bodies.time

    @property
    def tick(self) -> float:
        """Simulated seconds of one tick."""
        return self._bodies.scenario.tick

    @property
    def x(self) -> Any:
        """Where it really is, m."""
        return self._now(self._bodies.x)

    @property
    def y(self) -> Any:
        """m"""
        return self._now(self._bodies.y)

    @property
    def heading(self) -> Any:
        """rad, counter-clockwise from the x axis."""
        return self._now(self._bodies.heading)

    @property
    def speed(self) -> Any:
        """m/s"""
        return self._now(self._bodies.speed)

    def _now(self, values: Floats) -> Any:
        """The numbers of these robots, which stay as they are when time goes on."""
        which = self._which
        return values[which] if isinstance(which, int) else read_only(values[which].copy())

    def random(self, purpose: str) -> Any:
        """From [0, 1), for this purpose in this tick: equal seeds give equal numbers."""
        which = self._which
        numbers = self._bodies.numbers[which : which + 1] if isinstance(which, int) else None
        drawn = self._bodies.drawn(f"payload {purpose} {self._bodies.tick}", numbers)
        return drawn if numbers is None else drawn[0]


class _Declared:
    """What a class marks: the quantities and functions that its robots get."""

    def __init__(self, kind: type) -> None:
        self._kind = kind
        declared = declared_in(kind)
        if not declared:
            raise LinkError(f"{kind.__name__} declares nothing: mark its properties with @sensor or @actuator")
        self._variables = {key: each for key, each in declared.items() if isinstance(each, Declaration)}
        self._operations = {key: each for key, each in declared.items() if isinstance(each, Operation)}

    @cached_property
    def sensors(self) -> tuple[Quantity, ...]:
        return self._quantities(acts=False)

    @cached_property
    def actuators(self) -> tuple[Quantity, ...]:
        return self._quantities(acts=True)

    def _quantities(self, *, acts: bool) -> tuple[Quantity, ...]:
        quantities = (
            each.quantity(each.name or key, first_line(getattr(self._kind, key)))
            for key, each in self._variables.items()
            if each.acts is acts
        )
        return tuple(replace(each, freshness=np.inf) for each in quantities)  # what is too old is read as NaN

    def _made(self, bodies: Bodies, which: int | slice) -> object:
        from inspect import signature

        return self._kind(SimulatedBody(bodies, which)) if signature(self._kind).parameters else self._kind()


class Objects(_Declared):
    """A payload with one object of a class for each body."""

    _hosts: list[object]
    _tables: list[VariableTable]
    _bodies: Bodies

    @cached_property
    def functions(self) -> tuple[HostFunction, ...]:
        made = (each.host_function(self._kind, key) for key, each in self._operations.items())
        return tuple(replace(each, call=partial(self._call, each.call)) for each in made)

    def _call(self, method: Callable[..., float | None], body: Any, *arguments: float) -> float | None:
        return method(self._hosts[body.number], *arguments)

    def mount(self, bodies: Bodies) -> None:
        """See `Payload`."""
        self._bodies, self._hosts, self._tables = bodies, [], []
        shared: Vocabulary | None = None
        for number in range(bodies.count):
            host = self._made(bodies, number)
            table = VariableTable(self._kind.__name__, like=shared).link(host)
            shared = table.vocabulary
            self._hosts.append(host)
            self._tables.append(table)
        self._slots = {
            variable.quantity.name: variable.slot
            for variable in (shared.bindings.values() if shared else ())
            if isinstance(variable, Variable)
        }

    def step(self) -> None:
        """See `Payload`."""
        step = getattr(self._kind, "step", None)
        if step is not None:
            for host in self._hosts:
                step(host)

    def read(self, readings: Floats) -> None:
        """See `Payload`. Raises LinkError for what is no number."""
        slots = [self._slots[each.name] for each in self.sensors]
        for number, table in enumerate(self._tables):
            table.refresh([], self._bodies.time)
            readings[:, number] = [table.read(slot) for slot in slots]

    def act(self, actuator: str, which: Whole, values: Floats) -> None:
        """See `Payload`. Raises LinkError for what the class refuses."""
        slot = self._slots[actuator]
        for number, value in zip(which.tolist(), values.tolist(), strict=True):
            self._tables[number].write(slot, value)

    def halt(self, which: Whole) -> None:
        """See `Payload`."""
        for number in which.tolist():
            self._tables[number].stop()
            self._tables[number].release()


class Arrays(_Declared):
    """A payload with one object of a vectorised class for all bodies."""

    _host: object
    _count: int

    @cached_property
    def functions(self) -> tuple[HostFunction, ...]:
        return tuple(self._function(key, each) for key, each in self._operations.items())

    def _function(self, key: str, operation: Operation) -> HostFunction:
        """A method `key(self, robots, ...)` as a function of expressions, which do not give `robots`."""
        label, units = f"{self._kind.__name__}.{key}", operation.units
        if operation.labelled:
            raise LinkError(f"{label} is labelled, which only methods of a class for one robot can be")
        made = replace(operation, units=None if units is None else (None, *units)).host_function(self._kind, key)
        if not made.dimensions:
            raise LinkError(f"{label} takes no robots: a vectorised class has methods ({key}(self, robots, ...))")
        result = operation.result or ""

        def many(_: object, robots: Whole, *arguments: Floats) -> Floats | None:
            given = [from_arrays(x, unit or "") for x, unit in zip(arguments, units or [""] * 8, strict=False)]
            returned = getattr(self._host, key)(robots, *given)
            return None if returned is None else self._numbers(returned, result, label, robots.size)

        def one(body: Any, *arguments: float) -> float | None:
            returned = many(None, np.array([body.number]), *(np.array([each]) for each in arguments))
            return None if returned is None else float(returned[0])

        arguments = " ".join(made.arguments.split()[1:])
        return replace(
            made,
            call=one,
            many=many,
            dimensions=made.dimensions[1:],
            least=max(0, (made.least or 0) - 1),
            arguments=arguments,
        )

    def _numbers(self, returned: object, unit: str, label: str, count: int) -> Floats:
        """An array of the class in SI, NaN for all that is not finite. Raises LinkError for anything else."""
        try:
            numbers = np.broadcast_to(np.asarray(returned, np.float64), count)
        except (TypeError, ValueError) as error:
            raise LinkError(f"{label} gives no array of {count} numbers: {error}") from error
        converted: NDArray[np.float64] = cast(Any, si)(numbers, unit)
        return np.where(np.isfinite(converted), converted, np.nan)

    def mount(self, bodies: Bodies) -> None:
        """See `Payload`."""
        self._count, self._host = bodies.count, self._made(bodies, slice(None))

    def step(self) -> None:
        """See `Payload`."""
        step = getattr(self._host, "step", None)
        if step is not None:
            step()

    def _value(self, key: str) -> object:
        value = getattr(self._host, key)
        return value() if callable(value) else value

    def read(self, readings: Floats) -> None:
        """See `Payload`. Raises LinkError for what is no array of numbers."""
        sensed = ((key, each) for key, each in self._variables.items() if not each.acts)
        for row, (key, each) in zip(readings, sensed, strict=True):
            row[:] = self._numbers(self._value(key), each.unit, f"{self._kind.__name__}.{key}", self._count)

    def act(self, actuator: str, which: Whole, values: Floats) -> None:
        """See `Payload`."""
        key = next(key for key, each in self._variables.items() if each.acts and (each.name or key) == actuator)
        declared = self._variables[key]
        self._set(key, which, np.clip(from_arrays(values, declared.unit), declared.low, declared.high))

    def halt(self, which: Whole) -> None:
        """See `Payload`."""
        for key, each in self._variables.items():
            if each.rest is not None and which.size:
                self._set(key, which, each.rest)

    def _set(self, key: str, which: Whole, values: Floats | float) -> None:
        """Give the class a new array, in which these robots have new values."""
        changed = np.array(np.broadcast_to(np.asarray(self._value(key), np.float64), self._count))
        changed[which] = values
        setattr(self._host, key, changed)


def from_arrays(values: Floats, unit: str) -> Floats:
    """SI numbers in a unit of the class."""
    return cast(Floats, cast(Any, from_si)(values, unit))


def payload_of(robots: type | str) -> Payload:
    """The payload that a class makes, or the class that an installed package adds under this name. Raises MisuseError
    if there is none, LinkError for a class that marks nothing."""
    if isinstance(robots, str):
        added = extensions(ADDED)
        if robots not in added:
            known = f"wanted one of {', '.join(added)}" if added else f"no installed package adds any in {ADDED}"
            raise MisuseError(
                f'no robots "{robots:.80}"{did_you_mean(robots, added)}: {known}, or a class, or a number'
            )
        loaded = load_extension(added[robots], "robots")
        if not isinstance(loaded, type):
            raise MisuseError(f'robots "{robots}" is no class but {loaded!r:.80}')
        robots = loaded
    return Arrays(robots) if getattr(robots, "vectorised", False) else Objects(robots)
