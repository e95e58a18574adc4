"""Sites: the worlds that Nomads are placed in, read from files.

A world is a scenario (of which robots and all but [laser] are ignored), a TOML file with only a scenario's tables
[world] and [laser], a ROS map, or a text file with one polygon per line, `n x1 y1 ... xn yn` in tenths of an inch.
One point of it is the origin, the robots' 0, 0: for polygons and maps their own 0, 0, otherwise the centre, or what
the table [nomad] of the file says. That table may also set where robots start:

    [nomad]
    origin = ["3m", "3m"]

    [[nomad.starts]]
    x = "4m"
    y = "5m"
    heading = "90deg"

All lengths in a file are in the file's own frame.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import ceil, isfinite, pi
from pathlib import Path

from sleepcast.core.errors import decimal_comma
from sleepcast.core.given_numbers import MAX_SEED
from sleepcast.core.records import dataclass
from sleepcast.core.settings import SettingsError, Table, read_text, toml_document
from sleepcast.core.units import LENGTH
from sleepcast.robot import Corners
from sleepcast.simulator.scenario.robot_settings import INCH, MAX_WORLD, TENTH
from sleepcast.simulator.scenario.scanners import LaserModel, read_laser
from sleepcast.simulator.scenario.scenario import FILE, FORMAT
from sleepcast.simulator.scenario.world_settings import MAX_POINTS, MAX_SHAPES, Changes, read_world
from sleepcast.simulator.world.ros_map import read_map
from sleepcast.simulator.world.world import Point, Polygon, Shape, shifted

MAX_NOMADS = 1_000
"""Robots behind one server: each is queried, and answers, separately."""
CELL = 24 * INCH
"""Grid size of drawings of a Nomad's world, m."""
ROOM = 30 * CELL
"""Side of an empty room, m: at its centre, no wall is within a sonar's range."""
BEYOND = 2 * CELL
"""Least open space around the outermost corners of a world of polygons, m."""
FULL_TURN = 2.0 * pi
LIDAR = LaserModel(beams=360, first=0.0, increment=FULL_TURN / 360, least=0.0, reach=8.0, noise=0.0)
"""That of robots whose world does not say which they have: a beam a degree, without errors. Real Scouts had none."""


@dataclass(frozen=True, slots=True)
class Start:
    """Where a robot starts, m and rad in the world's frame. no_room: the error to raise if it does not fit there."""

    x: float
    y: float
    heading: float
    no_room: SettingsError


@dataclass(frozen=True, slots=True)
class Site:
    """A world for Nomads, of `width` by `height` m, without its edge.

    origin: the point of their 0, 0.
    starts: where they start, empty if the world does not say.
    seed: random seed.
    laser: their lidar, `LIDAR` if the world does not say.
    """

    path: Path
    width: float
    height: float
    shapes: tuple[Shape, ...]
    origin: Point
    starts: tuple[Start, ...] = ()
    seed: int = 0
    laser: LaserModel = LIDAR


def read_site(world: Path | None, robots: int | None = None, seed: int | None = None) -> Site:
    """The world in a file, or an empty room. robots: their number, for a world that grows with it; seed: replaces the
    file's own. Raises SettingsError for errors in the file."""
    if world is None:
        return Site(Path("an empty room"), ROOM, ROOM, (), (ROOM / 2, ROOM / 2), seed=seed or 0)
    file = world / FILE if world.is_dir() else world
    if file.suffix == ".toml":
        return _of_toml(file, robots, seed)
    if file.suffix in (".yaml", ".yml"):
        return _of_map(file, seed or 0)
    return _of_polygons(file, seed or 0)


def _of_toml(file: Path, robots: int | None, seed: int | None) -> Site:
    with toml_document(file).root() as root:
        version = root.whole("format", low=1, high=MAX_SEED)
        if version > FORMAT:
            raise root.error("format", f"format {version} is newer than this sleepcast, which reads format {FORMAT}")
        written = root.whole("seed", 0, low=0, high=MAX_SEED)
        chosen = written if seed is None else seed
        count = robots or max(1, len(root.table("nomad").array("starts", most=MAX_NOMADS)))
        world = read_world(root, lambda: count, Changes(robots=robots), chosen)
        size = world.width, world.height
        origin, starts = _nomad(root, size)
        laser = read_laser(root, version) or LIDAR
        known = root.names() if root.has("robots") else ("title", "about")
        for key in known:  # the other keys of a scenario are ignored
            root.has(key)
    # The edge, which comes last if it is a wall, is added to every world later.
    shapes = world.shapes if world.fenced or world.torus else world.shapes[:-1]
    return Site(file, *size, shapes, origin, starts, chosen, laser)


def _nomad(root: Table, size: Point) -> tuple[Point, tuple[Start, ...]]:
    """The origin and the starts from the table [nomad]."""
    with root.table("nomad") as table:
        far = (-MAX_WORLD, -MAX_WORLD), (MAX_WORLD, MAX_WORLD)
        origin = table.point("origin", *far) if table.has("origin") else (size[0] / 2.0, size[1] / 2.0)
        starts = []
        for each in table.array("starts", most=MAX_NOMADS):
            with each:
                x = each.number("x", LENGTH, low=0.0, high=size[0])
                y = each.number("y", LENGTH, low=0.0, high=size[1])
                heading = each.number("heading", default=0.0, low=-FULL_TURN, high=FULL_TURN)
                no_room = each.document.error(each.where, "no robot fits here: something else is in the way")
                starts.append(Start(x, y, heading, no_room))
    return origin, tuple(starts)


def _of_map(file: Path, seed: int) -> Site:
    """A ROS map, whose own 0, 0 is the origin."""
    area, low, high = read_map(file).area((0.0, 0.0), unknown_is_solid=False)
    origin = -low[0], -low[1]
    shapes = (shifted(area, *origin),) if area.outlines else ()
    return Site(file, high[0] - low[0], high[1] - low[1], shapes, origin, seed=seed)


def _of_polygons(file: Path, seed: int) -> Site:
    """Polygons from a text file, with the origin in the centre of a square of whole cells around them."""
    polygons = tuple(Polygon(tuple(corners)) for corners in read_polygons(str(file), read_text(file)))
    farthest = max((abs(value) for each in polygons for corner in each.corners for value in corner), default=0.0)
    half = max(ROOM / 2.0, CELL * ceil((farthest + BEYOND) / CELL))
    return Site(
        file, 2.0 * half, 2.0 * half, tuple(shifted(each, half, half) for each in polygons), (half, half), seed=seed
    )


# Worlds as text, one polygon per line, `n x1 y1 ... xn yn` in tenths of an inch: reading and writing.


def read_polygons(file: str, text: str) -> Iterator[Corners]:
    """The corners of each polygon, m from the origin. file: its name in errors. Raises SettingsError."""
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
    """The text for these polygons, to a hundredth of its unit. title: a comment that names the world."""
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
        comma = decimal_comma(word)
        raise SettingsError(f'{file}:{line}: wanted numbers, n x1 y1 ... xn yn, not "{word[:40]}"{comma}') from None
    if not (isfinite(value) and abs(value) * TENTH <= MAX_WORLD):
        raise SettingsError(f'{file}:{line}: "{word[:40]}" lies beyond the world: at most {MAX_WORLD / TENTH:g}')
    return value
