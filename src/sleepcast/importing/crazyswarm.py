"""Crazyswarm2's `crazyflies.yaml`: its Crazyflies, of whom each enabled one starts where the file says, and flies.

Addresses, firmware parameters and logging belong to the real ones: `sleepcast node --body crazyflie:...` takes them.
"""

from __future__ import annotations

from math import isfinite
from pathlib import Path

from sleepcast.core.settings import SettingsError
from sleepcast.importing.found import Found, FoundRobots, Hardware
from sleepcast.simulator.scenario.starts import StartPose
from sleepcast.simulator.world.ros_map import yaml_document

MAX_FILE = 1_048_576
MAX_ROBOTS = 1_000
CRAZYFLIE = Hardware(0.07, 0.5, 1.5, 1.0, solid=False, like="crazyflie")
VERSION = 3
"""Of the file, as Crazyswarm2 writes it."""
ROOM = 2.0
"""m of open space around them."""


def read_crazyflies(path: Path) -> Found:
    """The Crazyflies of a file. Raises SettingsError with file and key, MisuseError without PyYAML."""
    wanted = "no crazyflies.yaml: wanted a table robots with at least one robot"
    values = yaml_document(path, MAX_FILE, wanted, "it has aliases: write the values out").values
    robots = values.get("robots")
    if not isinstance(robots, dict) or not robots:
        raise SettingsError(f"{path}: {wanted}")
    if len(robots) > MAX_ROBOTS:
        raise SettingsError(f"{path}: robots: {len(robots)} of them; at most {MAX_ROBOTS} fit")
    found = Found(path.stem, f"Imported from {path.name}, a fleet of Crazyswarm2.", margin=ROOM)
    if values.get("fileversion", VERSION) != VERSION:
        found.leave_out(f"fileversion {values['fileversion']!s:.20}", f"read as version {VERSION}")
    for name, settings in robots.items():
        _add(path, found, str(name), settings)
    if not found.robots:
        raise SettingsError(f"{path}: robots: none of {len(robots)} is enabled")
    for key, why in (
        ("robot_types", "what its types say of motion capture, battery and firmware is for real ones"),
        ("all", "parameters and logging are for real ones"),
    ):
        if values.get(key):
            found.leave_out(key, why)
    return found


def _add(path: Path, found: Found, name: str, settings: object) -> None:
    """Add one robot, unless it is disabled."""
    where = f"{path}: robots.{name:.60}"
    if not isinstance(settings, dict):
        raise SettingsError(f"{where}: wanted a table with an initial_position, not {settings!r:.60}")
    if settings.get("enabled", True) is not True:
        found.leave_out("robots that are not enabled", "they are not there")
        return
    place = settings.get("initial_position")
    numbers = [each for each in place if _is_number(each)] if isinstance(place, list) else []
    if not isinstance(place, list) or len(place) not in (2, 3) or len(numbers) != len(place):
        raise SettingsError(f"{where}.initial_position: wanted [x, y, z] in metres, not {place!r:.60}")
    if len(place) == 3 and place[2]:
        found.leave_out("heights at the start", "all begin on the ground here")
    kind = str(settings.get("type", "crazyflie"))
    same = next((each for each in found.robots if each.type == kind), None)
    if same is None:
        same = FoundRobots(kind, CRAZYFLIE)
        found.robots.append(same)
    same.poses.append(StartPose(float(place[0]), float(place[1]), 0.0, name))
    for key in sorted({str(key) for key in settings} - {"enabled", "initial_position", "type"}):
        found.leave_out(key, "is for the real one")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
