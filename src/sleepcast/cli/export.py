"""`sleepcast export`: a recording as a bag of ROS 2, as tables, or as a recording of Rerun."""

from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import click

from sleepcast.cli.interrupts import Interrupts
from sleepcast.cli.streams import complain, put

if TYPE_CHECKING:
    from sleepcast.exporting import ExportReport
    from sleepcast.simulator.recording.recording import Recording

COUNTED = {"ros2": "message", "csv": "row", "parquet": "row", "rrd": "entry"}
"""What an export in each format consists of."""


@click.command("export")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--to", required=True, type=click.Choice(list(COUNTED)), help="The format, see above.")
@click.option(
    "--out",
    metavar="PLACE",
    type=click.Path(path_type=Path),
    help="The new folder, for rrd a file; default: beside FILE, named after it.",
)
@click.option("--force", is_flag=True, help="Replace an earlier export there.")
@click.option("--only", metavar="NAMES", help="Export these robots only, e.g. r1,r2.")
@click.option("--json", "as_json", is_flag=True, help="Print what was written as one JSON object.")
@click.option("--quiet", is_flag=True, help="Show no progress on standard error.")
def export(file: Path, to: str, out: Path | None, force: bool, only: str | None, as_json: bool, quiet: bool) -> int:
    """Write the recording FILE in a format of other programs, and say what was left out.

    \b
    ros2     a bag that ros2 bag, rosbags, PlotJuggler and Foxglove read
    csv      a folder of tables, with units in datapackage.json
    parquet  the same tables, with units in the metadata of each column
    rrd      a recording for Rerun

    It appears whole, or, if something goes wrong, not at all. Of a recording that was broken off, all that is complete
    is exported.

    \b
    Examples:
      sleepcast export rescue.mcap --to ros2
      sleepcast export rescue.mcap --to parquet --out tables --only scout1,scout2
    """
    with Interrupts() as interrupts:
        from sleepcast.api.progress import steps
        from sleepcast.exporting import export_recording, place_of
        from sleepcast.simulator.recording.recording import load_recording

        recording = load_recording(file)
        complete, count = recording.complete, sum(recording.counts.values())
        interrupts.defer()
        with closing(steps(count + 2, f"{file.name} to {to}", quiet=quiet)) as bar:

            def progress() -> None:
                interrupts.check()
                next(bar, None)

            names = [name for name in (only or "").split(",") if name]
            place = out or place_of(file, to)
            report = export_recording(recording, to, place, only=names, force=force, progress=progress)
    notes = [*_of_file(recording, complete), *report.left_out]
    if as_json:
        put(json.dumps(_to_dict(report, to, recording, complete, notes)))
        return 0
    total = sum(report.counts.values())
    noun = COUNTED[to] if total == 1 else f"{COUNTED[to]}s".replace("ys", "ies")
    put(f"{report.place}: {total} {noun} of {recording.scenario.name}, {recording.seconds:g} s")
    complain("what is missing or otherwise:")
    for sentence in notes:
        complain(f"  {sentence}")
    return 0


def _of_file(recording: Recording, complete: bool) -> list[str]:
    """What is to be said of the recording itself."""
    notes = []
    if not complete:
        notes.append(f"the recording was broken off: this is what came before, up to {recording.seconds:g} s")
    if recording.part > 1:
        notes.append(f"what came before {recording.began:g} s: this is part {recording.part} of a recording")
    if recording.following:
        notes.append(f"what comes after {recording.seconds:g} s: it is in {recording.following}")
    return notes


def _to_dict(
    report: ExportReport, to: str, recording: Recording, complete: bool, notes: list[str]
) -> dict[str, object]:
    parts = [
        {"name": name, f"{COUNTED[to]}s".replace("ys", "ies"): count}
        | ({"type": report.types[name]} if name in report.types else {})
        for name, count in report.counts.items()
    ]
    return {
        "place": str(report.place),
        "to": to,
        "scenario": recording.scenario.name,
        "seed": recording.seed,
        "began": recording.began,
        "seconds": recording.seconds,
        "complete": complete,
        "parts": parts,
        "left_out": notes,
    }
