"""The payload of simulated bodies: sensors, actuators and functions that a program adds to them."""

from __future__ import annotations

from typing import Protocol

from sleepcast.core.model import HostFunction, Quantity
from sleepcast.simulator.bodies.bodies import Bodies, Floats, Whole


class Payload(Protocol):
    """What a program adds to every body. Bodies are given by their indices, numbers are in SI.

    sensors, actuators, functions: known before there are bodies.
    """

    @property
    def sensors(self) -> tuple[Quantity, ...]: ...

    @property
    def actuators(self) -> tuple[Quantity, ...]: ...

    @property
    def functions(self) -> tuple[HostFunction, ...]: ...

    def mount(self, bodies: Bodies) -> None:
        """Begin on these bodies: once, before everything below."""

    def step(self) -> None:
        """A tick is over: all bodies have moved."""

    def read(self, readings: Floats) -> None:
        """Fill in what the sensors read now, shape (sensors, bodies); NaN for unknown."""

    def act(self, actuator: str, which: Whole, values: Floats) -> None:
        """Set an actuator of these bodies, of which none is stopped; all values are finite."""

    def halt(self, which: Whole) -> None:
        """Set the actuators of these bodies, which have just been stopped, to rest."""
