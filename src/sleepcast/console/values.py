"""What expressions come to on every robot, for the table and the plots: of a swarm by its telemetry, and of a recording
by what was recorded (`adapters/recorded_values`)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from sleepcast.console.view import SwarmView
from sleepcast.core.units import UNITS
from sleepcast.language import Checked, Variable
from sleepcast.language.vocabulary import VariableKind, Vocabulary
from sleepcast.station import Station

Column: TypeAlias = NDArray[np.float64]
Index: TypeAlias = NDArray[np.intp]
Mask: TypeAlias = NDArray[np.bool_]

MAX_SUGGESTED = 6
"""Columns of a table that nobody has chosen yet: they fit a small screen."""


class Values(Protocol):
    """Values of expressions on all robots."""

    @property
    def names(self) -> Sequence[str]:
        """Of the robots, in the order of the page."""

    @property
    def source(self) -> str:
        """Where the values come from, in words; "" for the desk's own telemetry."""

    def time(self) -> float:
        """The page's time, s."""

    def of(self, text: str, robots: Index | None = None) -> tuple[Column, int]:
        """The values on these robots (ascending; None stands for all) in SI, NaN for unknown; and on how many of them
        only a question to the robot itself could tell. Raises SleepcastError with what is wrong in the text."""

    def checked(self, text: str) -> Checked:
        """The expression, which says what its values are: in which unit people read them, and whether they are angles.
        Raises ReadError."""

    def groups(self) -> Iterable[tuple[str, Mask]]:
        """The groups, the newest last, with their members."""

    def suggested(self) -> list[str]:
        """What a table shows of these robots at first."""


def places_of(names: Sequence[str]) -> Index:
    """The places with a robot: where robots come and go, some have none, and "" for a name."""
    return np.flatnonzero([bool(name) for name in names]) if "" in names else np.arange(len(names))


class TelemetryValues:
    """The values of a swarm, simulated or on the air, by its latest telemetry (`Values`)."""

    def __init__(self, swarm: SwarmView, station: Station) -> None:
        self._swarm, self._station = swarm, station

    @property
    def names(self) -> Sequence[str]:
        return self._swarm.scene.names

    @property
    def source(self) -> str:
        return ""

    def time(self) -> float:
        return self._swarm.now()

    def of(self, text: str, robots: Index | None = None) -> tuple[Column, int]:
        count = len(self.names)  # others that speak on the channel are not on the page
        indices = np.arange(count) if robots is None else robots
        values, asked = self._station.values(text, indices)
        return values, len(asked)

    def checked(self, text: str) -> Checked:
        return self._station.check(text)

    def groups(self) -> Iterable[tuple[str, Mask]]:
        minds = self._swarm.minds
        for key, members in minds.groups.items():
            declared = minds.declared(key)
            yield (key if declared is None else declared.name), members

    def suggested(self) -> list[str]:
        return suggested_of(self._swarm.vocabulary)


def suggested_of(vocabulary: Vocabulary) -> list[str]:
    """The first sensors of these robots; of many alike, as sonars, none."""
    sensors = [
        binding.name
        for binding in vocabulary.bindings.values()
        if isinstance(binding, Variable)
        and binding.kind is VariableKind.SENSOR
        and binding.slot >= vocabulary.first_sensor
        and not binding.name[-1].isdigit()
    ]
    return sensors[:MAX_SUGGESTED]


def in_unit(values: Column, unit: str) -> Column:
    """Values in SI as numbers of a unit."""
    return values / UNITS[unit].factor if unit in UNITS else values
