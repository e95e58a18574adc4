"""Time series of expressions over a fleet, sampled while it runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sleepcast.api.table import DataTable, Numbers, Texts
from sleepcast.core.errors import MisuseError, did_you_mean

MAX_VALUES = 100_000_000
"""Numbers of one history: 800 MB."""


class History:
    """What expressions came to on every robot, every `every` s of simulated time.

    names: of the robots at first; where they come and go, the history has all that were there when it was sampled.
    expressions: of each column. It grows while the fleet runs. For data frames it is a table in
    long form: a row a robot and sample, with the columns `time` (s), `robot`, and one for each expression (SI, NaN or
    null for unknown). An expression that is called `time` or `robot` is the column `time_value` or `robot_value`.
    """

    def __init__(self, names: Sequence[str], expressions: Sequence[str], every: float) -> None:
        self._names, self.expressions, self.every = names, tuple(expressions), every
        self._whose: list[Sequence[str]] = []
        """The robots of each sample."""
        self._values = 0
        self._times: list[float] = []
        self._samples: list[bytes] = []
        """Of each sample its values, expression by expression."""

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the robots, in the order of the columns; those that came later follow."""
        if not self._changes:
            return tuple(self._names)
        return tuple(dict.fromkeys(name for names in (self._names, *self._whose) for name in names))

    @property
    def _changes(self) -> bool:
        """Whether robots have come or gone between samples."""
        return any(names is not self._names and tuple(names) != tuple(self._names) for names in self._whose)

    @property
    def times(self) -> NDArray[np.float64]:
        """When it was sampled, s, shape (samples,)."""
        return np.array(self._times)

    def __len__(self) -> int:
        """How many samples there are."""
        return len(self._times)

    def __getitem__(self, expression: str) -> NDArray[np.float64]:
        """The values of an expression, shape (samples, robots), NaN while a robot was not there. Raises MisuseError for
        one that is not sampled, and where that would be too many values."""
        if expression not in self.expressions:
            raise MisuseError(
                f'"{expression}" is not sampled{did_you_mean(expression, self.expressions)}: wanted one of '
                f"{', '.join(self.expressions)}"
            )
        values = self._long(expression)
        if not self._changes:
            return values.reshape(len(self), len(self._names))
        names = {name: column for column, name in enumerate(self.names)}
        if len(self) * len(names) > MAX_VALUES:
            raise MisuseError(f"{len(names):,} robots have come and gone, too many for one array: take table()")
        spread = np.full((len(self), len(names)), np.nan)
        sizes = [len(each) for each in self._whose]
        spread[np.repeat(np.arange(len(self)), sizes), [names[name] for each in self._whose for name in each]] = values
        return spread

    def _long(self, expression: str) -> NDArray[np.float64]:
        """The values of an expression, one sample after the other."""
        place = self.expressions.index(expression)
        sizes = [8 * len(names) for names in self._whose]
        samples = zip(self._samples, sizes, strict=True)
        return np.frombuffer(bytearray().join(each[place * size : (place + 1) * size] for each, size in samples))

    def take(self, time: float, sample: NDArray[np.float64], names: Sequence[str] | None = None) -> None:
        """Add a sample. Raises MisuseError when the history is full.

        time: s.
        sample: shape (expressions, robots).
        names: of these robots; None for those that were there at first.
        """
        if self._values + sample.size > MAX_VALUES:
            raise MisuseError(
                f"the history is full: it holds {self._values:,} values, at most {MAX_VALUES:,} fit. "
                "Sample less often, or fewer expressions"
            )
        before = self._whose[-1] if self._whose else self._names
        self._whose.append(before if names is None or names == before else names)
        self._values += sample.size
        self._times.append(time)
        self._samples.append(sample.tobytes())

    def table(self) -> DataTable:
        """In long form, see the class."""
        sizes = [len(names) for names in self._whose]
        keys: dict[str, Texts | Numbers] = {
            "time": np.repeat(self.times, sizes),
            "robot": tuple(name for names in self._whose for name in names),
        }
        return DataTable.keyed(keys, {each: self._long(each) for each in self.expressions})

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        return self.table().__arrow_c_stream__(requested_schema)

    def __repr__(self) -> str:
        sampled = ", ".join(self.expressions)
        return f"{len(self)} samples of {sampled} on {len(self.names):,} robots, every {self.every:g} s"

    def _repr_html_(self) -> str:
        return self.table()._repr_html_()
