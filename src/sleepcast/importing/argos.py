"""Experiments of ARGoS 3 (`*.argos`): arena, boxes, cylinders, lights and robots, placed one by one or by chance.

Syntax and meaning are those of ARGoS' own loader: vectors are "x,y,z"; an orientation gives the turn around z first, in
degrees; a body's position is the middle of its foot. Controllers and loop functions are programs, which nobody runs
here. Radii and tracks are the constants of ARGoS' own models of these robots.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import hypot, isfinite, pi, radians
from pathlib import Path
from xml.parsers import expat

import numpy as np

from sleepcast.core.settings import SettingsError, read_text
from sleepcast.importing.found import Disc, Found, FoundRobots, Frame, Hardware, Outline, Point, rectangle
from sleepcast.simulator.scenario.starts import StartPose
from sleepcast.simulator.world.drawing import parse_xml

MAX_FILE = 4 * 1_048_576
"""Bytes of an experiment: those of people have some thousand."""
MAX_ELEMENTS = 50_000
MAX_DEPTH = 64
MAX_MANY = 10_000
"""Boxes, cylinders and poses that one experiment puts somewhere by chance or on a grid."""
TRIES = 100

WHEELED = {  # radius and track in m, speed in m/s
    "foot-bot": (0.085036758, 0.14, 0.3),
    "e-puck": (0.035, 0.053, 0.13),
    "pipuck": (0.0362, 0.0565, 0.13),
    "kheperaiv": (0.0704, 0.1054, 0.8),
    "kilobot": (0.0165, 0.025, 0.01),
}
FLYING = {"eye-bot": 0.25, "spiri": 0.25, "crazyflie": 0.065}
OTHER = 0.1
"""Radius of a robot of another kind, m."""
RAB_RANGE = 3.0
"""m, the range of ARGoS' range-and-bearing system unless `rab_range` says another one."""


@dataclass(slots=True)
class Element:
    """One XML element: where it begins, and what is in it."""

    tag: str
    values: dict[str, str]
    line: int
    inside: list[Element]

    def all(self, tag: str) -> list[Element]:
        return [each for each in self.inside if each.tag == tag]

    def first(self, tag: str) -> Element | None:
        return next(iter(self.all(tag)), None)

    def everything(self) -> Iterator[Element]:
        yield self
        for each in self.inside:
            yield from each.everything()


class _Tree:
    """Builds the elements of a file, which may declare nothing of its own."""

    def __init__(self, path: Path) -> None:
        self._path, self._count = path, 0
        self._open = [Element("", {}, 1, [])]
        self._parser = expat.ParserCreate("utf-8")
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = lambda _: self._open.pop()
        self._parser.EntityDeclHandler = self._entity

    def read(self, text: str) -> Element:
        parse_xml(self._parser, text, self._path)
        return self._open[0].inside[0]

    def _start(self, tag: str, values: dict[str, str]) -> None:
        self._count += 1
        if self._count > MAX_ELEMENTS or len(self._open) > MAX_DEPTH:
            raise self._error(f"more than {MAX_ELEMENTS} elements, or more than {MAX_DEPTH} inside one another")
        element = Element(tag, values, self._parser.CurrentLineNumber, [])
        self._open[-1].inside.append(element)
        self._open.append(element)

    def _entity(self, name: str, *_: object) -> None:
        raise self._error(f'it declares an entity "{name:.20}": wanted an experiment without them')

    def _error(self, sentence: str) -> SettingsError:
        return SettingsError(f"{self._path}:{self._parser.CurrentLineNumber}: {sentence}")


def read_argos(path: Path) -> Found:
    """The world of an experiment. Raises SettingsError with file and line."""
    return _Experiment(path, _Tree(path).read(read_text(path, MAX_FILE, "an experiment"))).found


class _Experiment:
    """Goes through an experiment's arena."""

    def __init__(self, path: Path, root: Element) -> None:
        self._path = path
        arena = root.first("arena")
        if root.tag != "argos-configuration" or arena is None:
            raise self._error(root, "no experiment of ARGoS: wanted <argos-configuration> with an <arena>")
        size = self._vector(arena, "size", 3)
        x, y, _ = self._vector(arena, "center", 3, "0,0,0")
        self._low, self._high = (x - size[0] / 2.0, y - size[1] / 2.0), (x + size[0] / 2.0, y + size[1] / 2.0)
        self.found = Found(path.stem, f"Imported from {path.name}, an experiment of ARGoS.", (self._low, self._high))
        self._time(root)
        self._chance = np.random.default_rng(self.found.seed)
        self._read_arena(arena)
        self._sense(root)
        for tag in ("controllers", "loop_functions"):
            for each in root.all(tag):
                if each.inside or each.values:
                    self.found.leave_out(f"<{tag}>", "programs: write what robots do as rules")

    def _time(self, root: Element) -> None:
        framework = root.first("framework")
        experiment = None if framework is None else framework.first("experiment")
        if experiment is None:
            return
        length, ticks = (
            self._number(experiment, key, text) for key, text in (("length", "0"), ("ticks_per_second", "10"))
        )
        if ticks <= 0.0 or length < 0.0:
            raise self._error(experiment, "wanted a length of at least 0 and more than 0 ticks_per_second")
        self.found.seconds = length or self.found.seconds
        self.found.tick = 1.0 / ticks
        self.found.seed = int(self._number(experiment, "random_seed", "0")) % 2**32
        if not self.found.seed:
            self.found.leave_out("random_seed 0", "ARGoS draws another one for each run; here the runs are alike")
        if not length:
            self.found.leave_out("length 0", "an experiment without an end gets five minutes")

    def _read_arena(self, arena: Element) -> None:
        for each in arena.inside:
            if each.tag == "distribute":
                self._distribute(each)
            else:
                body = each.first("body") or each
                where = self._vector(body, "position", 3, "0,0,0")
                turn = self._vector(body, "orientation", 3, "0,0,0")
                self._place(each, Frame(where[0], where[1], radians(turn[0])), where[2])

    def _place(self, each: Element, frame: Frame, height: float = 0.0, *, turned: bool = True) -> None:
        """Put one thing where it stands. turned: a robot's heading is said, and not left to chance."""
        if each.tag == "light":
            number = len(self.found.lights)
            self.found.lights[each.values.get("id", f"light{number}")] = frame.x, frame.y
        elif each.tag in ("box", "cylinder"):
            self._solid(each, frame, height)
        elif each.first("controller") is not None:
            robots = self._robots_like(each.tag)
            robots.poses.append(StartPose(frame.x, frame.y, frame.turn if turned else None, each.values.get("id", "")))
            if height > OTHER:
                self.found.leave_out(f"<{each.tag}> above the ground", "robots drive in a plane here")
        else:
            why = "its picture of the ground is no field" if each.tag == "floor" else "nothing here is like it"
            self.found.leave_out(f"<{each.tag}>", why)

    def _solid(self, each: Element, frame: Frame, height: float) -> None:
        if each.values.get("movable", "false").lower() in ("true", "1"):
            self.found.leave_out(f"movable <{each.tag}>", "it stands fixed, since robots push nothing here")
        if height > 2.0 * OTHER:
            self.found.leave_out(f"<{each.tag}> above the ground", "it would be over robots' heads")
        elif each.tag == "cylinder":
            self.found.solids.append(Disc((frame.x, frame.y), self._number(each, "radius")))
        else:
            width, depth, _ = self._vector(each, "size", 3)
            self.found.solids.append(Outline(rectangle(frame, width, depth)))

    def _robots_like(self, tag: str) -> FoundRobots:
        """The robots of a kind that are placed one by one."""
        robots = next((each for each in self.found.robots if each.type == tag and each.poses), None)
        if robots is None:
            robots = FoundRobots(tag, self._hardware(tag))
            self.found.robots.append(robots)
        return robots

    def _hardware(self, tag: str) -> Hardware:
        if tag in WHEELED:
            radius, track, speed = WHEELED[tag]
            return Hardware(radius, speed, 2.0 * speed / track, speed / self.found.tick, track)
        if tag in FLYING:
            self.found.leave_out(f"<{tag}>", "it flies; here it moves in a plane and touches nothing")
            return Hardware(FLYING[tag], 1.0, 3.0, 2.0, solid=False)
        self.found.leave_out(f"<{tag}>", f"a robot nobody knows here: it is a disc of {OTHER:g} m that drives 0.3 m/s")
        return Hardware(OTHER, 0.3, 3.0, 3.0)

    def _distribute(self, each: Element) -> None:
        """Things by chance or on a grid: robots where chance puts them in each run, other things once and for all."""
        entity, position = each.first("entity"), each.first("position")
        thing = entity.inside[0] if entity is not None and entity.inside else None
        if entity is None or position is None or thing is None:
            raise self._error(each, "wanted <position> and an <entity> with what is to be placed")
        count = int(self._number(entity, "quantity"))
        if not 0 <= count <= MAX_MANY:
            raise self._error(entity, f"wanted a quantity of 0 to {MAX_MANY}")
        method = position.values.get("method", "uniform")
        if thing.first("controller") is not None and method in ("uniform", "gaussian"):
            if self._turn(each.first("orientation")) is not None:
                self.found.leave_out("headings of robots by chance", "these robots start with headings by chance, too")
            self.found.robots.append(
                FoundRobots(thing.tag, self._hardware(thing.tag), count=count, box=self._box(position, method))
            )
            return
        turn = self._turn(each.first("orientation"))
        first = int(self._number(entity, "base_num", "0"))
        for number, (x, y) in enumerate(self._spots(thing, position, method, count), first):
            drawn = float(self._chance.uniform(-pi, pi)) if turn is None else turn
            self._place(_numbered(thing, number), Frame(x, y, drawn), turned=turn is not None)

    def _box(self, position: Element, method: str) -> tuple[Point, Point]:
        """Where robots are put by chance; two standard deviations on each side stand for a normal distribution."""
        if method == "uniform":
            low, high = self._vector(position, "min", 3), self._vector(position, "max", 3)
        else:
            mean, wide = self._vector(position, "mean", 3), self._vector(position, "std_dev", 3)
            low, high = ([m + sign * 2.0 * s for m, s in zip(mean, wide, strict=True)] for sign in (-1.0, 1.0))
            self.found.leave_out("gaussian positions", "robots start anywhere within two standard deviations")
        (left, bottom), (right, top) = self._low, self._high
        return (
            (min(max(low[0], left), right), min(max(low[1], bottom), top)),
            (min(max(high[0], left), right), min(max(high[1], bottom), top)),
        )

    def _turn(self, orientation: Element | None) -> float | None:
        """The turn of things that are put somewhere, rad; None for any."""
        if orientation is None or orientation.values.get("method") != "constant":
            return None
        return radians(self._vector(orientation, "values", 3)[0])

    def _spots(self, thing: Element, position: Element, method: str, count: int) -> Iterator[Point]:
        """Where things stand that are fixed in every run."""
        if method == "constant":
            x, y, _ = self._vector(position, "values", 3)
            yield from [(x, y)] * count
        elif method == "grid":
            yield from self._grid(position, count)
        elif method in ("uniform", "gaussian"):
            self.found.leave_out(f"<{thing.tag}> by chance", "they stand where chance has put them once")
            yield from self._scattered(thing, self._box(position, method), count)
        else:
            raise self._error(
                position, f"no way to place things: {method!r:.40}; wanted uniform, gaussian, constant or grid"
            )

    def _grid(self, position: Element, count: int) -> Iterator[Point]:
        centre, distance = self._vector(position, "center", 3), self._vector(position, "distances", 3)
        columns, rows, _ = self._vector(position, "layout", 3)
        if not (columns >= 1.0 and rows >= 1.0 and columns * rows >= count):
            raise self._error(position, f"a layout of {columns:g} by {rows:g} has no room for {count}")
        for number in range(count):
            column, row = number % int(columns), number // int(columns)
            yield (
                centre[0] + ((columns - 1.0) / 2.0 - column) * distance[0],  # from the upper right one on
                centre[1] + ((rows - 1.0) / 2.0 - row) * distance[1],
            )

    def _scattered(self, thing: Element, box: tuple[Point, Point], count: int) -> Iterator[Point]:
        """Places by chance, apart from each other and from what stands there already where there is room."""
        radius = self._half(thing)
        taken = [(each.center, each.radius) for each in self.found.solids if isinstance(each, Disc)]
        for _ in range(count):
            for _ in range(TRIES):
                x, y = (float(self._chance.uniform(a, b)) for a, b in zip(*box, strict=True))
                if all(hypot(x - at[0], y - at[1]) > radius + far for at, far in taken):
                    break
            taken.append(((x, y), radius))
            yield x, y

    def _half(self, thing: Element) -> float:
        """Half of the largest extent of a thing, m."""
        if thing.tag == "box":
            width, depth, _ = self._vector(thing, "size", 3)
            return hypot(width, depth) / 2.0
        if thing.tag == "cylinder":
            return self._number(thing, "radius")
        return OTHER

    def _sense(self, root: Element) -> None:
        """Neighbours, if a controller has the range-and-bearing sensor."""
        everything = list(root.everything())
        if any(each.tag == "range_and_bearing" for each in everything):
            ranges = [self._number(each, "rab_range") for each in everything if "rab_range" in each.values]
            self.found.reach = max(ranges, default=RAB_RANGE)

    def _vector(self, each: Element, key: str, count: int, default: str | None = None) -> list[float]:
        text = each.values.get(key, default)
        try:
            numbers = [float(part) for part in (text or "").split(",")]
        except ValueError:
            numbers = []
        if len(numbers) != count or not all(map(isfinite, numbers)):
            came = "nothing" if text is None else repr(text[:60])
            raise self._error(each, f"<{each.tag}> {key}: wanted {count} numbers with commas, not {came}")
        return numbers

    def _number(self, each: Element, key: str, default: str | None = None) -> float:
        return self._vector(each, key, 1, default)[0]

    def _error(self, each: Element, sentence: str) -> SettingsError:
        return SettingsError(f"{self._path}:{each.line}: {sentence}")


def _numbered(thing: Element, number: int) -> Element:
    """A thing of many, with its number behind its name."""
    name = thing.values.get("id", "")
    return replace(thing, values=thing.values | {"id": f"{name}{number}" if name else ""})
