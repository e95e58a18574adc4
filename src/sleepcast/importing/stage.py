"""Worlds of Stage (`*.world` and what they include): floor plans from bitmaps, models of blocks, robots with poses.

The language is that of Stage's own reader: `define NAME BASE ( ... )` makes a model of another one, a property is a
word with a value, and lists stand in brackets. As in Stage, blocks and the dark pixels of a bitmap (red up to 127) are
stretched until what is around them all is as large as the model's `size` - not the picture with its white margin.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import isfinite, radians, remainder, sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.errors import MisuseError
from sleepcast.core.settings import SettingsError, read_text
from sleepcast.importing.found import Bitmap, Found, FoundRobots, Frame, Hardware, Outline, Point, bounds, rectangle
from sleepcast.simulator.scenario.areas import MAX_AREAS
from sleepcast.simulator.scenario.robot_settings import LEAST, MAX_WORLD
from sleepcast.simulator.scenario.scanners import LEAST_FIELD, MAX_BEAMS, LaserModel
from sleepcast.simulator.scenario.starts import StartPose
from sleepcast.simulator.simd.formulas import TURN
from sleepcast.simulator.world.ros_map import MAX_PIXELS, contours, picture

NEARLY = 1e-7
"""By how much a field may be less than a whole turn, rad, and count as one: angles are written to a millionth of a
degree."""
MAX_FILE = 4 * 1_048_576
MAX_TOKENS = 500_000
MAX_INCLUDES = 32
MAX_DEPTH = 32
MAX_MODELS = 20_000
DARK = 127
"""The greatest red of a pixel that is solid."""
ROBOT, MODEL = "position", "model"
SENSORS = frozenset(
    (
        *("ranger", "sensor", "laser", "sonar", "transducer", "fiducial", "fiducialfinder", "blobfinder", "camera"),
        *("ptz", "gripper", "bumper", "wifi", "speech", "actuator", "power", "light", "indicator", "lightindicator"),
        "audio",
    )
)
"""Models that are devices of other models."""
SPEEDS = [-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -90.0, 90.0]
"""Stage's bounds of velocity and acceleration where nothing is said: m/s, degrees a second."""
SIDE = 0.1
"""Length, width and height of a model that says none, m."""

_TOKEN = re.compile(r'\s*(?:#[^\n]*|"([^"\n]*)"|([][()])|([^\s#"()\][]+(?:\[\d+\])?))')
Value = str | list[float]


@dataclass(slots=True)
class Model:
    """A model as it is written: base is what it is made from. values: its properties; parts: models in it."""

    base: str
    place: str
    values: dict[str, Value] = field(default_factory=dict)
    parts: list[Model] = field(default_factory=list)


class _StageReader:
    """Reads a world and what it includes into models, whose bases are looked up afterwards."""

    def __init__(self, found: Found) -> None:
        self.bases: dict[str, Model] = {}
        self.root = Model("", "")
        self._found, self._tokens, self._opened = found, 0, 0

    def read(self, path: Path) -> None:
        self._opened += 1
        if self._opened > MAX_INCLUDES:
            raise SettingsError(f"{path}: more than {MAX_INCLUDES} files include one another")
        text = read_text(path, MAX_FILE, "a world")
        tokens = self._split(path, text)
        self._contents(path, tokens, self.root, 0)

    def _split(self, path: Path, text: str) -> Iterator[tuple[str, str, str]]:
        """The tokens with their places: kind (quoted, mark or word), text, file and line."""
        at, line = 0, 1
        while at < len(text):
            match = _TOKEN.match(text, at)
            if match is None:
                if not text[at:].strip():
                    return
                raise SettingsError(
                    f"{path}:{line + text.count(chr(10), at, at + 1)}: a quotation mark without its other one"
                )
            line += text.count("\n", at, match.end())
            at = match.end()
            self._tokens += 1
            if self._tokens > MAX_TOKENS:
                raise SettingsError(f"{path}:{line}: more than {MAX_TOKENS} words")
            for kind, found in zip(("quoted", "mark", "word"), match.groups(), strict=True):
                if found is not None:
                    yield kind, found, f"{path}:{line}"

    def _contents(self, path: Path, tokens: Iterator[tuple[str, str, str]], into: Model, depth: int) -> None:
        """Properties and models, up to the parenthesis that closes `into`, or to the end of the file."""
        for kind, text, place in tokens:
            if (kind, text) == ("mark", ")") and depth:
                return
            if kind != "word":
                raise SettingsError(f"{place}: wanted a name here, not {text!r:.40}")
            if depth > MAX_DEPTH:
                raise SettingsError(f"{place}: models more than {MAX_DEPTH} inside one another")
            self._statement(path, tokens, into, depth, text, place)
        if depth:
            raise SettingsError(f"{path}: a parenthesis is not closed")

    def _statement(
        self, path: Path, tokens: Iterator[tuple[str, str, str]], into: Model, depth: int, name: str, place: str
    ) -> None:
        kind, text, _ = self._next(tokens, place)
        if name == "include" and kind == "quoted":
            self._include(path.parent / text, text)
        elif name == "define":
            made = Model(self._next(tokens, place)[1], place)
            self._open(tokens, place)
            self._contents(path, tokens, made, depth + 1)
            self.bases[text] = made
        elif (kind, text) == ("mark", "("):
            model = Model(name, place)
            self._contents(path, tokens, model, depth + 1)
            into.parts.append(model)
        elif (kind, text) == ("mark", "["):
            into.values[name] = self._numbers(tokens, place)
        elif kind == "mark":
            raise SettingsError(f"{place}: {name:.40}: wanted a value, not {text}")
        else:
            into.values[name] = text

    def _include(self, file: Path, said: str) -> None:
        if file.is_file():
            self.read(file)
        else:
            self._found.leave_out(f"include {said!r:.80}", "there is no such file beside the world")

    def _open(self, tokens: Iterator[tuple[str, str, str]], place: str) -> None:
        if self._next(tokens, place)[:2] != ("mark", "("):
            raise SettingsError(f"{place}: wanted define NAME BASE ( ... )")

    def _next(self, tokens: Iterator[tuple[str, str, str]], place: str) -> tuple[str, str, str]:
        following = next(tokens, None)
        if following is None:
            raise SettingsError(f"{place}: the file ends in the middle of this")
        return following

    def _numbers(self, tokens: Iterator[tuple[str, str, str]], place: str) -> list[float]:
        """The numbers of a list; what is none, such as a colour's name, counts as not a number."""
        numbers: list[float] = []
        for kind, text, _ in tokens:
            if (kind, text) == ("mark", "]"):
                return numbers
            try:
                numbers.append(float(text))
            except ValueError:
                numbers.append(float("nan"))
        raise SettingsError(f"{place}: a bracket is not closed")


def read_stage(path: Path) -> Found:
    """A world of Stage. Raises SettingsError with file and line."""
    found = Found(path.stem, f"Imported from {path.name}, a world of Stage.")
    reader = _StageReader(found)
    reader.read(path)
    world = _World(found, reader)
    for each in reader.root.parts:
        world.add(each, Frame(), 0)
    if not (found.points()):
        raise SettingsError(f"{path}: neither walls nor robots: wanted models with a pose")
    if found.laser and world.blind:
        found.leave_out("robots without a ranger", "they have one here: a scenario's scanner is that of all")
    return found


class _World:
    """Puts models where they stand."""

    def __init__(self, found: Found, reader: _StageReader) -> None:
        self._found, self._bases, self._count = found, reader.bases, 0
        self.blind = False
        """Whether there are robots without a scanner."""
        units = reader.root.values
        self._metre = {"cm": 0.01, "mm": 0.001}.get(str(units.get("unit_length", "m")), 1.0)
        self._turn = (lambda angle: angle) if units.get("unit_angle") == "radians" else radians

    def add(self, written: Model, around: Frame, depth: int) -> None:
        """Add a model and what stands on it. around: where the one stands that it is in."""
        self._count += 1
        if self._count > MAX_MODELS:
            raise SettingsError(f"{written.place}: more than {MAX_MODELS} models")
        model, kind = self._whole(written)
        if kind == "window":
            return
        if kind in SENSORS:
            self._found.leave_out(
                f"{kind} {written.base}" if kind != written.base else kind, "give robots a [robots.sonar]"
            )
        elif kind == ROBOT:
            self._robot(written, model, self._frame(model).inside(around))
        elif kind == MODEL:
            frame = self._frame(model).inside(around)
            self._thing(written, model, frame)
            for part in model.parts:
                if part.base != "block":
                    self.add(part, frame, depth + 1)
        else:
            self._found.leave_out(f"{kind:.40}", "no model of this name is defined")

    def _whole(self, written: Model) -> tuple[Model, str]:
        """A model with all that its bases say, and the name of the last base."""
        chain, kind = [written], written.base
        while kind in self._bases and len(chain) <= MAX_DEPTH:
            chain.append(self._bases[kind])
            kind = chain[-1].base
        whole = Model(kind, written.place)
        for each in reversed(chain):
            whole.values |= each.values
            whole.parts += each.parts
        return whole, kind

    def _frame(self, model: Model) -> Frame:
        """Where a model stands: x, y, z and heading; three numbers are x, y and heading, as Stage 2 had them."""
        pose = self._list(model, "pose", [0.0, 0.0, 0.0, 0.0])
        if len(pose) == 3:
            self._found.leave_out(
                "poses of three numbers", "read as x, y and heading, as in Stage 2; later ones take a z"
            )
        return Frame(
            pose[0] * self._metre, pose[1] * self._metre, self._turn(pose[3] if len(pose) > 3 else (*pose, 0.0)[2])
        )

    def _list(self, model: Model, key: str, default: list[float]) -> list[float]:
        numbers = model.values.get(key, default)
        if not isinstance(numbers, list) or len(numbers) < 2 or not all(map(isfinite, numbers)):
            raise SettingsError(f"{model.place}: {key}: wanted numbers in brackets, not {numbers!r:.60}")
        return numbers

    def _size(self, model: Model) -> Point:
        size = self._list(model, "size", [SIDE / self._metre] * 3)
        return size[0] * self._metre, size[1] * self._metre

    def _robot(self, written: Model, model: Model, frame: Frame) -> None:
        speed, acceleration = (self._list(model, f"{key}_bounds", SPEEDS) for key in ("velocity", "acceleration"))
        hardware = Hardware(
            radius=max(self._size(model)) / 2.0,
            speed=max(map(abs, speed[:2])) * self._metre or 1.0,
            turn_rate=max(map(abs, map(self._turn, speed[6:8])), default=0.0) or self._turn(90.0),
            acceleration=max(map(abs, acceleration[:2])) * self._metre or 1.0,
        )
        same = next(
            (each for each in self._found.robots if (each.type, each.hardware) == (written.base, hardware)), None
        )
        if same is None:
            same = FoundRobots(written.base, hardware)
            self._found.robots.append(same)
        same.poses.append(StartPose(frame.x, frame.y, frame.turn, str(model.values.get("name", ""))))
        if "ctrl" in model.values:
            self._found.leave_out(f"ctrl {model.values['ctrl']!s:.40}", "a program: write what robots do as rules")
        self._devices(written.base, model.parts)

    def _devices(self, robot: str, parts: list[Model]) -> None:
        """Let robots have the first scanner of the file, and tell of all else that this one has."""
        blind = True
        for part in parts:
            kind, laser = self._whole(part)[1], self._laser(part)
            if laser is None:
                if kind not in ("block", MODEL):
                    self._found.leave_out(f"{kind} of {robot}", "give robots a [robots.sonar], or a `like`")
                continue
            blind = False
            self._found.laser = self._found.laser or laser
            if laser != self._found.laser:
                self._found.leave_out(f"another ranger of {robot}", "a scenario has one kind of scanner")
        self.blind |= blind

    def _laser(self, part: Model) -> LaserModel | None:
        """A ranger with one sensor of several beams; None for anything else, such as a ring of sonars. Its `noise`
        begins with a variance in Stage's program, whatever its page says, and its least range is only drawn."""
        ranger, kind = self._whole(part)
        sensors = [sensor for sensor, kind in map(self._whole, ranger.parts) if kind == "sensor"]
        if kind != "ranger" or len(sensors) != 1:
            return None
        sensor, places = sensors[0], [self._frame(each) for each in (sensors[0], ranger)]
        beams, field = int(self._number(sensor, "samples", 1)), self._turn(self._number(sensor, "fov", 0.0))
        reach = self._list(sensor, "range", [0.0, 5.0])[1] * self._metre
        if beams < 2 or field < LEAST_FIELD or reach < LEAST:
            return None
        if any(each.x or each.y for each in places):
            self._found.leave_out("a ranger that is not in the middle of its robot", "it is here")
        whole = field >= TURN - NEARLY  # the last beam of such a one is the first one again
        if beams - whole > MAX_BEAMS:
            self._found.leave_out(f"ranger of {beams} beams", f"it has {MAX_BEAMS}, as many as there may be")
            beams = MAX_BEAMS + whole
        first = remainder(sum(each.turn for each in places), TURN) - min(field, TURN) / 2.0
        noise = sqrt(max(0.0, self._list(sensor, "noise", [0.0, 0.0])[0] * self._metre))
        reach = min(reach, MAX_WORLD)
        return LaserModel(beams - whole, first, min(field, TURN) / (beams - 1), 0.0, reach, min(noise, reach))

    def _number(self, model: Model, key: str, default: float) -> float:
        try:
            number = float(str(model.values.get(key, default)))
        except ValueError:
            number = float("nan")
        if not isfinite(number):
            raise SettingsError(f"{model.place}: {key}: wanted a number, not {model.values[key]!r:.60}")
        return number

    def _thing(self, written: Model, model: Model, frame: Frame) -> None:
        """Add what is solid of a model; what sensors and bodies ignore is an area."""
        width, height = self._size(model)
        touched, seen = (model.values.get(key, "1") != "0" for key in ("obstacle_return", "ranger_return"))
        if not touched and (not seen or model.values.get("ranger_return") == "-1"):
            if len(self._found.areas) < MAX_AREAS:
                self._found.areas[str(model.values.get("name", written.base))] = rectangle(frame, width, height)
            return
        if not touched:
            self._found.leave_out(
                f"{written.base} with obstacle_return 0", "solid here; Stage's robots drive through it"
            )
        blocks = [self._block(each) for each in model.parts if each.base == "block"]
        bitmap = model.values.get("bitmap")
        if isinstance(bitmap, str):
            self._bitmap(Path(model.place.rpartition(":")[0]), bitmap, frame, (width, height), written)
        elif blocks:
            self._found.solids += _stretched(blocks, frame, width, height)
        elif model.values.get("blocks") != "0":
            self._found.solids.append(Outline(rectangle(frame, width, height)))
        if model.values.get("boundary", "0") != "0":
            corners = rectangle(frame, width, height)
            self._found.solids.append(Outline((*corners, corners[0]), closed=False))  # a wall around, open inside

    def _block(self, block: Model) -> list[Point]:
        """The corners of a block, in the order of their numbers."""
        points = [
            self._list(block, key, []) for key in sorted(block.values, key=_number_in) if key.startswith("point[")
        ]
        if len(points) < 3:
            raise SettingsError(f"{block.place}: a block of {len(points)} points: wanted three or more")
        return [(x, y) for x, y, *_ in points]

    def _bitmap(self, world: Path, name: str, frame: Frame, size: Point, written: Model) -> None:
        """Add the dark pixels of a picture beside the file that names it."""
        named = [each for each in self._files(world, name, written) if each.is_file()]
        if not named:
            self._found.leave_out(f"bitmap {name!r:.80}", "there is no such file")
            return
        try:
            channels, white, _ = picture(named[0])
        except SettingsError as error:
            self._found.leave_out(f"bitmap {name!r:.80}", str(error).removeprefix(f"{named[0]}: "))
            return
        dark = channels[:, :, 0] * 255 <= DARK * white
        if not dark.any():
            self._found.leave_out(f"bitmap {name!r:.80}", "it has no dark pixel")
            return
        cells = _cells(dark, frame, size)
        if self._found.cells is None:
            self._found.cells = cells
        else:
            self._found.solids += [
                Outline(tuple(cells.corner.at((x * cells.cell, y * cells.cell)) for x, y in line))
                for line in contours(cells.solid)
            ]

    def _files(self, world: Path, name: str, written: Model) -> Iterator[Path]:
        """Where a bitmap may be: beside the file that says its name, or beside the one that uses the model."""
        yield world.parent / name
        yield Path(written.place.rpartition(":")[0]).parent / name


def _number_in(key: str) -> int:
    digits = re.sub(r"\D", "", key)
    return int(digits[:9] or 0)


def _stretched(blocks: list[list[Point]], frame: Frame, width: float, height: float) -> list[Outline]:
    """Blocks, moved and stretched so that what is around them all is as large as their model."""
    (left, bottom), (right, top) = bounds(point for block in blocks for point in block)
    across, up = width / (right - left or 1.0), height / (top - bottom or 1.0)

    def moved(point: Point) -> Point:
        return frame.at(((point[0] - (left + right) / 2.0) * across, (point[1] - (bottom + top) / 2.0) * up))

    return [Outline(tuple(map(moved, block))) for block in blocks]


def _cells(dark: NDArray[np.bool_], frame: Frame, size: Point) -> Bitmap:
    """The dark part of a picture as square cells. dark: top row first; size: width and height of that part, m."""
    rows, columns = np.flatnonzero(dark.any(axis=1)), np.flatnonzero(dark.any(axis=0))
    solid = dark[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1][::-1]
    cell = min(size[0] / solid.shape[1], size[1] / solid.shape[0])
    wide, high = round(size[0] / cell), round(size[1] / cell)
    if wide * high > MAX_PIXELS:
        raise MisuseError(
            f"a bitmap of {wide} by {high} square cells; at most {MAX_PIXELS} fit: its size is far from its shape"
        )
    across, up = (np.arange(wide) * solid.shape[1] // wide), (np.arange(high) * solid.shape[0] // high)
    corner = Frame(*frame.at((-size[0] / 2.0, -size[1] / 2.0)), frame.turn)
    return Bitmap(solid[np.ix_(up, across)], cell, corner)
