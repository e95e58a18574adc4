"""What every benchmark tells in the same way: the machine, bars with whether they are met, and tables in Markdown."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median

Json = dict[str, object]


@dataclass(frozen=True)
class Bar:
    """What was promised. value: what came out, or None where this run cannot tell, and then `note` says why."""

    name: str
    value: float | None
    wanted: float
    unit: str
    at_least: bool = True
    note: str = ""

    @property
    def met(self) -> bool | None:
        if self.value is None:
            return None
        return self.value >= self.wanted if self.at_least else self.value <= self.wanted

    @property
    def text(self) -> str:
        wanted = f"wanted at {'least' if self.at_least else 'most'} {self.wanted:,g} {self.unit}"
        if self.value is None:
            return f"?       {self.name}: {self.note}; {wanted}"
        return f"{'met   ' if self.met else 'MISSED'}  {self.name}: {number(self.value)} {self.unit}, {wanted}"

    def to_dict(self) -> Json:
        return {**asdict(self), "met": self.met}


def machine() -> Json:
    """What was measured on."""
    return {
        "processor": processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "numpy": installed("numpy"),
        "numba": installed("numba"),
    }


def described(found: Json) -> str:
    """A machine in one line."""
    return (
        f"{found['processor']}, {found['cores']} cores, {found['system']}, Python {found['python']}, "
        f"NumPy {found['numpy']}, numba {found['numba'] or 'not installed'}"
    )


def processor() -> str:
    """The processor by its own name, where the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def installed(library: str) -> str | None:
    """The version of a library, None if it is not installed."""
    try:
        return version(library)
    except PackageNotFoundError:
        return None


def number(value: float) -> str:
    """Three significant digits, and thousands apart."""
    if abs(value) >= 100:
        return f"{value:,.0f}"
    return f"{value:.3g}"


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table whose first column is text and whose others are numbers, lined up for a terminal too."""
    widths = [max(len(row[column]) for row in (heads, *rows)) for column in range(len(heads))]

    def line(cells: Sequence[str]) -> str:
        first, *others = zip(cells, widths, strict=True)
        return f"| {first[0]:<{first[1]}} | " + " | ".join(f"{cell:>{width}}" for cell, width in others) + " |"

    rule = "|" + "-" * (widths[0] + 2) + "|" + "|".join("-" * (width + 1) + ":" for width in widths[1:]) + "|"
    return "\n".join([line(heads), rule, *(line(row) for row in rows)])


def middle(values: Sequence[float]) -> float:
    """The median; what a noisy machine disturbs least."""
    return median(values)
