"""Files of other simulators and fleets, read into scenario folders: who reads which, and what comes out.

Each reader turns one file into a `Found`: solid things, robots and places in the file's own frame, and a note of each
thing that a scenario cannot hold. `folder` writes it.
"""

from __future__ import annotations

from pathlib import Path

from sleepcast.core.errors import MisuseError
from sleepcast.importing.argos import read_argos
from sleepcast.importing.crazyswarm import read_crazyflies
from sleepcast.importing.found import Found
from sleepcast.importing.plans import read_plan, read_waypoints
from sleepcast.importing.stage import read_stage

READERS = {
    ".argos": (read_argos, "an experiment of ARGoS"),
    ".world": (read_stage, "a world of Stage"),
    ".yaml": (read_crazyflies, "Crazyswarm2's crazyflies.yaml"),
    ".yml": (read_crazyflies, "Crazyswarm2's crazyflies.yaml"),
    ".plan": (read_plan, "a plan of QGroundControl"),
    ".waypoints": (read_waypoints, "waypoints of ArduPilot"),
    ".txt": (read_waypoints, "waypoints, fences and rally points that MAVProxy saves"),
}


def read_foreign(path: Path) -> Found:
    """What stands in a file of another program, by its ending. Raises MisuseError for an ending that nobody reads, and
    SettingsError with file and line for what the file says wrong."""
    reader, _ = READERS.get(path.suffix.lower(), (None, ""))
    if reader is None:
        known = ", ".join(f"*{ending} ({what})" for ending, (_, what) in READERS.items() if ending != ".yml")
        raise MisuseError(f"{path}: nobody here reads such files: wanted one of {known}")
    return reader(path)
