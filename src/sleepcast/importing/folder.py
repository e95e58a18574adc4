"""Writes what was found as a scenario folder, all of it or nothing: it becomes `scenario.toml`, perhaps a mission and a
map, and is opened before it gets its name.

The lower left corner of the world becomes 0, 0. Names become those that rules can use.
"""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from io import BytesIO
from math import degrees
from pathlib import Path
from tempfile import mkdtemp

from sleepcast.channel.message import is_robot_name
from sleepcast.core.errors import MisuseError
from sleepcast.core.extras import installing
from sleepcast.core.settings import MAX_BYTES
from sleepcast.importing.found import Bitmap, Disc, Found, FoundRobots, Hardware, Point, bounds
from sleepcast.simulator.scenario.robot_types import MAX_TYPES
from sleepcast.simulator.scenario.scanners import LaserModel
from sleepcast.simulator.scenario.scenario import FORMAT
from sleepcast.simulator.scenario.starts import StartPose

NEAR = 2.0
"""Radii of a body from a place at which it has reached it, or a metre if that is more."""


def write_folder(found: Found, folder: Path, check: Callable[[Path], object]) -> None:
    """Make a scenario of what was found. check: opens the scenario in a folder, and raises MisuseError if it cannot be
    opened. Raises MisuseError, then there is no folder; OSError if it cannot be written."""
    if folder.exists():
        raise MisuseError(f"{folder} is there already: name another folder with --into")
    _settle_robots(found)
    files = _files(found)
    folder.parent.mkdir(parents=True, exist_ok=True)
    new = Path(mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    try:
        for name, data in files.items():
            (new / name).write_bytes(data)
        new.chmod(0o755)
        _open(found, new, check)
        new.rename(folder)
    except BaseException:
        shutil.rmtree(new, ignore_errors=True)
        raise


def _settle_robots(found: Found) -> None:
    """See that there are as many types as a scenario can have: equal bodies are of one type where there are more."""
    found.robots = [each for each in found.robots if each.poses or each.count]
    if not found.robots:
        found.leave_out("robots", "the file has none; one Scout stands for them")
    if len(found.robots) <= MAX_TYPES:
        return
    joined: dict[object, FoundRobots] = {}
    for each in found.robots:
        key = each.hardware if each.poses else id(each)
        joined.setdefault(key, FoundRobots(each.type, each.hardware, [], each.count, each.box)).poses.extend(each.poses)
    by_number = sorted(joined.values(), key=lambda each: -(len(each.poses) or each.count))
    found.leave_out(
        f"{len(found.robots)} types of robots", f"those with equal bodies are one; a scenario has {MAX_TYPES}"
    )
    for each in by_number[MAX_TYPES:]:
        found.leave_out(f"robots {each.type}", f"there are more than {MAX_TYPES} types")
    found.robots = by_number[:MAX_TYPES]


def _open(found: Found, folder: Path, check: Callable[[Path], object]) -> None:
    """Open a scenario; once more without contact, where bodies overlap each other or a wall at the start."""
    for solid in (True, False):
        try:
            check(folder)
            return
        except MisuseError as error:
            said = str(error).replace(f"{folder}{os.sep}", "")
            if not (solid and "cannot start" in said):
                raise MisuseError(f"{found.title}: it makes no scenario that can be opened: {said}") from None
        found.leave_out("contact", f"bodies touch nothing here: {said.rpartition('starts: ')[2]}")
        for each in found.robots:
            each.hardware = replace(each.hardware, solid=False)
        (folder / "scenario.toml").write_bytes(_files(found)["scenario.toml"])


def _files(found: Found) -> dict[str, bytes]:
    text = "\n".join(_Text(found).lines()) + "\n"
    if len(text) > MAX_BYTES:
        raise MisuseError(f"it would be a scenario of {len(text)} characters; at most {MAX_BYTES} fit")
    files = {"scenario.toml": text.encode()}
    if found.cells is not None:
        files |= {"map.png": _picture(found.cells), "map.yaml": _map_yaml(found.cells).encode()}
    if found.route:
        files["route.sleep"] = _route(found).encode()
    return files


def _picture(cells: Bitmap) -> bytes:
    try:
        from PIL import Image
    except ImportError:
        raise MisuseError(
            f"maps are written with Pillow, which is not here; to install it: {installing('maps')}"
        ) from None
    with BytesIO() as written:
        Image.fromarray((~cells.solid[::-1]).astype("uint8") * 255, "L").save(written, "PNG")
        return written.getvalue()


def _map_yaml(cells: Bitmap) -> str:
    # The map's own 0, 0 is the corner of its picture; the scenario says where that lies.
    return (
        f"image: map.png\nresolution: {cells.cell!r}\norigin: [0, 0, {cells.corner.turn!r}]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


def _route(found: Found) -> str:
    """A mission of one rule for each stop: who is at it goes on to the next."""
    near = max(1.0, NEAR * max(each.hardware.radius for each in found.robots))
    lines = ["; From place to place, in the order of the file.", "@0s (DEFVAR leg 1)"]
    for number, name in enumerate(found.route, 1):
        there = f"(< (DIST x y {name}_x {name}_y) {_number(near)}m)"
        text = (
            f"(RULE leg{number} (WHEN (= leg {number}) (IF {there} (SETQ leg {number + 1}) (GOTO {name}_x {name}_y))))"
        )
        lines.append(f"@{_number(1.0 + 0.5 * number)}s {text}")
    return "\n".join(lines) + "\n"


class _Text:
    """Writes a scenario's file."""

    def __init__(self, found: Found) -> None:
        self._found = found
        low, high = bounds([*found.points(), *(found.box or ())])  # walls may reach beyond the file's own box
        room = 0.0 if found.box else found.margin
        self._low = low[0] - room, low[1] - room
        self._size = high[0] - low[0] + 2.0 * room, high[1] - low[1] + 2.0 * room
        self._taken: set[str] = set()

    def lines(self) -> Iterator[str]:
        found = self._found
        yield f"format = {FORMAT}"
        yield f"title = {_quoted(found.title[:60] or 'imported')}"
        moved = f"Its 0, 0 is at {_number(-self._low[0])} m, {_number(-self._low[1])} m here."
        yield f"about = {_quoted(f'{found.about} {moved}')}"
        yield f"seed = {found.seed}"
        yield f'seconds = "{_number(found.seconds)}s"'
        yield f'tick = "{_number(found.tick)}s"'
        if found.route:
            yield 'mission = "route.sleep"'
        yield from self._world()
        yield from self._named()
        yield from self._robots()
        if found.reach > 0.0:
            yield from ("", "[neighbours]", f'reach = "{_number(found.reach)}m"')
        if found.laser:
            yield from _laser(found.laser)

    def _world(self) -> Iterator[str]:
        yield from ("", "[world]", f'width = "{_number(self._size[0])}m"', f'height = "{_number(self._size[1])}m"')
        if cells := self._found.cells:
            corner = self._point((cells.corner.x, cells.corner.y))
            yield from ("", "[world.map]", 'file = "map.yaml"', f"zero = {corner}")
        for each in self._found.solids:
            if isinstance(each, Disc):
                yield from (
                    "",
                    "[[world.circles]]",
                    f"center = {self._point(each.center)}",
                    f'radius = "{_number(each.radius)}m"',
                )
            elif each.closed:
                yield from ("", "[[world.polygons]]", f"corners = [{', '.join(map(self._point, each.corners))}]")
            else:
                yield from ("", "[[world.walls]]", f"points = [{', '.join(map(self._point, each.corners))}]")

    def _named(self) -> Iterator[str]:
        for name, (point, title) in self._found.places.items():
            yield from ("", f"[places.{self._name(name)}]", f"title = {_quoted(title[:60])}", *self._xy(point))
        for name, point in self._found.lights.items():
            yield from ("", f"[lights.{self._name(name)}]", *self._xy(point))
        for name, area in self._found.areas.items():
            yield from ("", f"[areas.{self._name(name)}]")
            if isinstance(area, Disc):
                yield from (f"center = {self._point(area.center)}", f'radius = "{_number(area.radius)}m"')
            else:
                yield f"corners = [{', '.join(map(self._point, area))}]"

    def _robots(self) -> Iterator[str]:
        kinds = self._found.robots
        if not kinds:
            yield from ("", "[robots]", 'like = "scout"', "count = 1", 'motion = "still"')
            return
        head = "[[robots]]" if len(kinds) > 1 else "[robots]"
        names = self._robot_names(kinds)
        for robots in kinds:
            yield from ("", head, *self._robot_type(robots, names), *_hardware(robots.hardware))

    def _robot_names(self, kinds: list[FoundRobots]) -> set[str]:
        """The names that poses may have: each robot's own, and none that a robot without a name would get."""
        named = [pose.name for robots in kinds for pose in robots.poses]
        return {name for name in named if named.count(name) == 1 and is_robot_name(name)}

    def _robot_type(self, robots: FoundRobots, names: set[str]) -> Iterator[str]:
        yield f'type = "{self._name(robots.type)}"'
        if robots.hardware.like:
            yield f'like = "{robots.hardware.like}"'
        yield 'motion = "still"'
        if robots.poses:
            yield "starts = ["
            yield from (f"    {self._pose(pose, names)}," for pose in robots.poses)
            yield "]"
            return
        yield f"count = {robots.count}"
        if robots.box:
            (left, bottom), (right, top) = robots.box
            for axis, least, most, low in (("x", left, right, self._low[0]), ("y", bottom, top, self._low[1])):
                yield f'{axis} = ["{_number(least - low)}m", "{_number(most - low)}m"]'

    def _pose(self, pose: StartPose, names: set[str]) -> str:
        x, y = pose.x - self._low[0], pose.y - self._low[1]
        parts = [f'x = "{_number(x)}m"', f'y = "{_number(y)}m"']
        if pose.heading is not None:
            parts.append(f'heading = "{_number(degrees(pose.heading))}deg"')
        if pose.name in names:
            parts.append(f"name = {_quoted(pose.name)}")
        return "{ " + ", ".join(parts) + " }"

    def _name(self, wanted: str) -> str:
        """A name that rules can use, which nothing else in the file has."""
        plain = re.sub(r"[^A-Za-z0-9_]", "_", wanted)[:24]
        plain = plain if plain[:1].isalpha() else f"x{plain}"
        name, number = plain, 2
        while name.lower() in self._taken:
            name, number = f"{plain}{number}", number + 1
        self._taken.add(name.lower())
        return name

    def _point(self, point: Point) -> str:
        return f'["{_number(point[0] - self._low[0])}m", "{_number(point[1] - self._low[1])}m"]'

    def _xy(self, point: Point) -> Iterator[str]:
        yield f'x = "{_number(point[0] - self._low[0])}m"'
        yield f'y = "{_number(point[1] - self._low[1])}m"'


def _hardware(hardware: Hardware) -> Iterator[str]:
    """What the bodies of a type can do, unless they are like an included one."""
    if hardware.like:
        return
    yield from ("", "[robots.limits]", f'speed = "{_number(hardware.speed)}m/s"')
    yield f'turn_rate = "{_number(degrees(hardware.turn_rate))}deg/s"'
    yield f'acceleration = "{_number(hardware.acceleration)}m/s2"'
    yield from ("", "[robots.body]", f'radius = "{_number(hardware.radius)}m"')
    if hardware.solid:
        yield from ("bumpers = 8", 'contact = "slide"')
    if hardware.track:
        yield from ("", "[robots.wheels]", f'track = "{_number(hardware.track)}m"')


def _laser(model: LaserModel) -> Iterator[str]:
    yield from ("", "[laser]", f"beams = {model.beams}")
    if (first := _number(degrees(model.first))) != "-180":
        yield f'from = "{first}deg"'
    if not model.closed:
        yield f'to = "{_number(degrees(model.last))}deg"'
    yield f'range = "{_number(model.reach)}m"'
    if model.noise:
        yield f'noise = "{_number(model.noise)}m"'


def _number(value: float) -> str:
    """To a micrometre, without what says nothing."""
    text = f"{value:.6f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def _quoted(text: str) -> str:
    """As TOML writes a text; its escapes are those of JSON."""
    return json.dumps("".join(each for each in text if each.isprintable()))
