"""`sleepcast import`: files of other simulators and fleets, as scenario folders."""

from __future__ import annotations

import json
from pathlib import Path

import click

from sleepcast.cli.streams import complain, put
from sleepcast.core.errors import MisuseError, counted


@click.command("import")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--into",
    metavar="FOLDER",
    type=click.Path(path_type=Path),
    help="The new folder; default: named like the file, here.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the outcome as one JSON object.")
def import_(file: Path, into: Path | None, as_json: bool) -> int:
    """Make a scenario folder of a file of another program, and say what was left out.

    It reads experiments of ARGoS (*.argos), worlds of Stage (*.world), fleets of Crazyswarm2 (crazyflies.yaml), plans
    of QGroundControl (*.plan), and waypoints of ArduPilot (*.waypoints; *.txt from MAVProxy).

    \b
    Examples:
      sleepcast import diffusion_10.argos
      sleepcast import cave.world --into my-cave
    """
    from sleepcast.api.assembly import assemble
    from sleepcast.importing import read_foreign
    from sleepcast.importing.folder import write_folder
    from sleepcast.simulator import find_scenario

    found = read_foreign(file)
    folder = into or Path(file.stem)
    opened = []
    try:
        write_folder(found, folder, lambda new: opened.append(assemble(find_scenario(str(new)), None, mission=True)[0]))
    except OSError as error:
        raise MisuseError(f"cannot write {folder}: {error.strerror or error}") from None
    robots, notes = len(opened[0].fleet), found.left_out()
    outcome = {
        "folder": str(folder),
        "robots": robots,
        "solids": len(found.solids),
        "map": found.cells is not None,
        "places": list(found.places),
        "areas": list(found.areas),
        "left_out": notes,
    }
    if as_json:
        put(json.dumps(outcome))
        return 0
    put(f"{folder}: {counted(robots, 'robot')}; start it with: sleepcast run {folder} --page")
    if notes:
        complain(f"what is missing or otherwise than in {file.name}:")
    for sentence in notes:
        complain(f"  {sentence}")
    return 0
