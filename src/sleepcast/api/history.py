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

    names: of the robots. expressions: of each column. It grows while the fleet runs. For data frames it is a table in
    long form: a row a robot and sample, with the columns `time` (s), `robot`, and one for each expression (SI, NaN or
    null for unknown). An expression that is called `time` or `robot` is the column `time_value` or `robot_value`.
    """

    def __init__(self, names: Sequence[str], expressions: Sequence[str], every: float) -> None:
        self._names, self.expressions, self.every = names, tuple(expressions), every
        self._times: list[float] = []
        self._samples: list[bytes] = []
        """Of each sample its values, expression by expression."""

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the robots, in the order of the columns."""
        return tuple(self._names)

    @property
    def times(self) -> NDArray[np.float64]:
        """When it was sampled, s, shape (samples,)."""
        return np.array(self._times)

    def __len__(self) -> int:
        """How many samples there are."""
        return len(self._times)

    def __getitem__(self, expression: str) -> NDArray[np.float64]:
        """The values of an expression, shape (samples, robots). Raises MisuseError for one that is not sampled."""
        if expression not in self.expressions:
            raise MisuseError(
                f'"{expression}" is not sampled{did_you_mean(expression, self.expressions)}: wanted one of '
                f"{', '.join(self.expressions)}"
            )
        size = 8 * len(self._names)
        begin = size * self.expressions.index(expression)
        values = bytearray().join(sample[begin : begin + size] for sample in self._samples)
        return np.frombuffer(values, np.float64).reshape(len(self), len(self._names))

    def take(self, time: float, sample: NDArray[np.float64]) -> None:
        """Add a sample. Raises MisuseError when the history is full.

        time: s.
        sample: shape (expressions, robots).
        """
        if (len(self) + 1) * sample.size > MAX_VALUES:
            raise MisuseError(
                f"the history is full: it holds {len(self) * sample.size:,} values, at most {MAX_VALUES:,} fit. "
                "Sample less often, or fewer expressions"
            )
        self._times.append(time)
        self._samples.append(sample.tobytes())

    def table(self) -> DataTable:
        """In long form, see the class."""
        keys: dict[str, Texts | Numbers] = {
            "time": np.repeat(self.times, len(self._names)),
            "robot": self.names * len(self),
        }
        return DataTable.keyed(keys, {each: self[each].ravel() for each in self.expressions})

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        return self.table().__arrow_c_stream__(requested_schema)

    def __repr__(self) -> str:
        sampled = ", ".join(self.expressions)
        return f"{len(self)} samples of {sampled} on {len(self._names):,} robots, every {self.every:g} s"

    def _repr_html_(self) -> str:
        return self.table()._repr_html_()
