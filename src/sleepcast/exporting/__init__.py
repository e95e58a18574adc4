"""Recorded runs as files of other programs: bags of ROS 2, tables, recordings of Rerun.

A recording is read twice, and never kept in memory: once to see that it is one, and how long it is, and once to be
written (`run`). Each format takes the same events; `place` lets the result appear whole or not at all.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import field
from pathlib import Path
from typing import Protocol

from sleepcast.core.errors import MisuseError, SleepcastError, counted
from sleepcast.core.records import dataclass
from sleepcast.exporting.bag import Bag, BagSink, bag_files, left_out
from sleepcast.exporting.place import written_whole
from sleepcast.exporting.run import Event, RecordedRun
from sleepcast.exporting.table_files import CSV_FILES, PARQUET_FILES, CsvWriter, ParquetWriter
from sleepcast.exporting.tables import TableSink
from sleepcast.exporting.viewer import ViewerFile, ViewerSink
from sleepcast.simulator.recording.recording import NoRecordingError, Recording

ALWAYS_LEFT_OUT = "hashes of the state, by which `sleepcast replay --verify` checks a run"


class ExportError(SleepcastError):
    """An export that cannot be written."""


class EventSink(Protocol):
    """What takes events."""

    def take(self, event: Event) -> None: ...


@dataclass(slots=True)
class ExportReport:
    """What was written. counts: rows by table, messages by topic, or entries by entity; types: of topics of ROS 2;
    left_out: sentences."""

    place: Path
    counts: dict[str, int] = field(default_factory=dict)
    types: dict[str, str] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)


def place_of(recording: Path, to: str) -> Path:
    """Where an export lies unless somebody says otherwise: beside the recording, called after it."""
    return recording.with_suffix(".rrd") if to == "rrd" else recording.with_name(f"{recording.stem}-{to}")


def export_recording(
    recording: Recording,
    to: str,
    place: Path,
    *,
    only: Sequence[str] = (),
    force: bool = False,
    progress: Callable[[], object] = lambda: None,
) -> ExportReport:
    """Write a recording in another format.

    recording: as `load_recording` gives it.
    to: one of FORMATS.
    place: the new file or folder.
    only: the robots that are wanted, all if empty.
    force: replace an earlier export.
    progress: called for each entry of the file; what it raises ends the export.

    Raises MisuseError (NoRecordingError for what is in the file, MissingExtraError for a library) and ExportError; then
    nothing has been written.
    """
    if to == "rrd" and place.suffix != ".rrd":
        raise MisuseError(f"{place}: Rerun opens files that end in .rrd; name one with --out")
    if place.exists() and place.samefile(recording.file):
        raise MisuseError(f"{place} is the recording itself: choose another place with --out")
    begin, files = FORMATS[to]
    run, report = RecordedRun(recording, only), ExportReport(place, left_out=[ALWAYS_LEFT_OUT])
    try:
        with written_whole(place, force=force, files=files(place.name)) as new, begin(run, new, report) as sink:
            for event in run.events():
                progress()
                if event is not None:
                    _take(sink, event, recording.file)
    except OSError as error:
        raise ExportError(f"cannot write {place}: {error.strerror or error}. Nothing of it is left") from error
    if run.earlier:
        report.left_out.append(f"{counted(run.earlier, 'command')} of earlier parts of the recording")
    return report


def _take(sink: EventSink, event: Event, file: Path) -> None:
    try:
        sink.take(event)
    except (ValueError, ArithmeticError, LookupError, TypeError) as error:
        reason = str(error).split("\n")[0][:300] or type(error).__name__
        raise NoRecordingError(f"{file} at {event.time:g} s holds what cannot be exported: {reason}") from error


# ---- the formats


@contextmanager
def _bag(run: RecordedRun, new: Path, report: ExportReport) -> Iterator[EventSink]:
    bag = Bag(new, run.facts())
    try:
        sink = BagSink(run, bag)
        yield sink
        bag.close()
    except BaseException:
        bag.abort()
        raise
    report.counts, report.types = bag.counts, bag.types
    report.left_out += left_out(sink)


@contextmanager
def _csv(run: RecordedRun, new: Path, report: ExportReport) -> Iterator[EventSink]:
    with CsvWriter(new, new.name, run.facts()) as writer, _tables(run, writer, report) as sink:
        yield sink


@contextmanager
def _parquet(run: RecordedRun, new: Path, report: ExportReport) -> Iterator[EventSink]:
    with ParquetWriter(new, run.facts()) as writer, _tables(run, writer, report) as sink:
        yield sink


@contextmanager
def _tables(run: RecordedRun, writer: CsvWriter | ParquetWriter, report: ExportReport) -> Iterator[EventSink]:
    sink = TableSink(run, writer)
    yield sink
    sink.close()
    writer.close()
    report.counts = sink.rows
    report.left_out.append("on which robots a rule fails, which `sleepcast replay` shows")


@contextmanager
def _viewer(run: RecordedRun, new: Path, report: ExportReport) -> Iterator[EventSink]:
    file = ViewerFile(new, run.recording.file.stem)
    try:
        yield ViewerSink(run, file)
        file.close()
    except BaseException:
        file.abort()
        raise
    report.counts = file.counts
    report.left_out.append("stored and failing rules, and flags: --to csv has them")


FORMATS: dict[
    str,
    tuple[
        Callable[[RecordedRun, Path, ExportReport], AbstractContextManager[EventSink]],
        Callable[[str], Collection[str]],
    ],
] = {
    "ros2": (_bag, bag_files),
    "csv": (_csv, lambda _: CSV_FILES),
    "parquet": (_parquet, lambda _: PARQUET_FILES),
    "rrd": (_viewer, lambda _: ()),
}
"""Each format: how to write it, and which files are in its folder, none for a single file."""
