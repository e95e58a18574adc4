"""A world as a text with one polygon a line, `n x1 y1 ... xn yn` in tenths of an inch: read, and written.

The words of a line are those with which programs put an obstacle up. What follows a # is for people.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isfinite

from sleepcast.robot import Corners
from sleepcast.simulator.scenario.robot_settings import MAX_WORLD, TENTH
from sleepcast.simulator.scenario.settings import SettingsError
from sleepcast.simulator.scenario.world_settings import MAX_POINTS, MAX_SHAPES


def read_polygons(file: str, text: str) -> Iterator[Corners]:
    """The corners of each polygon, m from the origin. file: what errors call it. Raises SettingsError."""
    count = 0
    for line, written in enumerate(text.splitlines(), 1):
        words = written.partition("#")[0].split()
        if not words:
            continue
        count += 1
        if count > MAX_SHAPES:
            raise SettingsError(f"{file}:{line}: more than {MAX_SHAPES} polygons; so many fit into one file")
        numbers = [_number(file, line, word) for word in words]
        corners, values = numbers[0], numbers[1:]
        if not (corners.is_integer() and 3 <= corners <= MAX_POINTS):
            raise SettingsError(
                f"{file}:{line}: wanted the number of corners first, from 3 to {MAX_POINTS}, not {words[0]}"
            )
        if len(values) != 2 * corners:
            raise SettingsError(
                f"{file}:{line}: wanted x and y of {corners:.0f} corners, {2 * corners:.0f} numbers, not {len(values)}"
            )
        points = tuple(zip(values[::2], values[1::2], strict=True))
        if any(here == before for here, before in zip(points, (*points[-1:], *points[:-1]), strict=True)):
            raise SettingsError(f"{file}:{line}: the same corner twice in a row; leave one of them out")
        yield tuple((x * TENTH, y * TENTH) for x, y in points)


def write_polygons(title: str, polygons: Sequence[Corners]) -> str:
    """The text that has these polygons, to a hundredth of its unit. title: of what world, for people."""
    lines = [f"# {' '.join(title.split())}: n x1 y1 ... xn yn, in tenths of an inch"]
    lines += map(_line, polygons)
    return "\n".join((*lines, ""))


def _line(corners: Corners) -> str:
    points = [
        " ".join(f"{round(value / TENTH, 2) + 0.0:.2f}".rstrip("0").rstrip(".") for value in corner)
        for corner in corners
    ]
    apart = [here for here, before in zip(points, (*points[-1:], *points[:-1]), strict=True) if here != before]
    written = " ".join((str(len(apart)), *apart))
    return written if len(apart) >= 3 else f"# a wall without width: {written}"


def _number(file: str, line: int, word: str) -> float:
    """A number in tenths of an inch, or a count. Raises SettingsError."""
    try:
        value = float(word)
    except ValueError:
        raise SettingsError(f'{file}:{line}: wanted numbers, n x1 y1 ... xn yn, not "{word[:40]}"') from None
    if not (isfinite(value) and abs(value) * TENTH <= MAX_WORLD):
        raise SettingsError(f'{file}:{line}: "{word[:40]}" lies beyond the world: at most {MAX_WORLD / TENTH:g}')
    return value
