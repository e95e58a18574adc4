"""`sleepcast demo` and `sleepcast run`: a scenario brought to life, on a page or headless."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict, TypeVar, Unpack

import click

from sleepcast.cli.interrupts import INTERRUPTED, TERMINATED, Interrupts, Terminated, end_now
from sleepcast.cli.options import SEED, ByteSize, NumberRange, QuantityType, alert_option, allow_host_option
from sleepcast.cli.streams import announce, complain, put
from sleepcast.core.errors import MisuseError
from sleepcast.core.units import TIME

if TYPE_CHECKING:
    from sleepcast.api.recording import RecordingPlan
    from sleepcast.cli.headless import FinishedRun, SnapshotPlan
    from sleepcast.experiments.acceptance import AcceptanceResult
    from sleepcast.loop import Swarm
    from sleepcast.simulator import Changes
    from sleepcast.station import Journal, Station

HOST, PORT = "127.0.0.1", 8317
FASTEST, SLOWEST = 10_000.0, 0.01
"""Simulated seconds in a second that the page can be asked for."""
MIN_PAST, MAX_PAST = 10_000_000, 100_000_000_000
"""Bytes of the past that a page may store: fewer hold hardly a moment, and no machine has more."""

Function = TypeVar("Function", bound=Callable[..., int])


class Options(TypedDict):
    """What both commands take."""

    seed: int | None
    robots: int | None
    density: float | None
    no_walls: bool
    threads: int | None
    seconds: float | None
    as_json: bool
    quiet: bool
    speed: float | None
    running: bool | None
    port: int
    host: str
    insecure: bool
    allow: tuple[str, ...]
    no_browser: bool
    alerts: tuple[str, ...]
    past: int | None
    record: Path | None
    record_pictures: float | None
    record_readings: float | None
    record_rotate: str | None
    from_: Path | None
    snapshot: Path | None
    snapshot_at: float | None
    journal: Path | None


_PERIOD = QuantityType(TIME, 0.001, 86_400.0)
"""Simulated time, from the shortest tick to a day."""

_COMMON = (
    click.option("--seed", type=SEED, help="Random seed (default: the scenario's)."),
    click.option(
        "--robots", metavar="N", type=click.IntRange(min=1), help="Number of robots (default: the scenario's)."
    ),
    click.option("--density", metavar="M2", type=NumberRange(suffix="m2"), help="Square metres per robot."),
    click.option("--no-walls", is_flag=True, help="Leave out everything solid in the scenario."),
    click.option("--threads", metavar="N", type=click.IntRange(1, 64), help="Worker threads (default: one per core)."),
    click.option(
        "--seconds", metavar="TIME", type=QuantityType(), help="Headless: how long to run, in simulated time."
    ),
    click.option("--json", "as_json", is_flag=True, help="Headless: print the outcome as one JSON object."),
    click.option("--quiet", is_flag=True, help="Headless: show no progress on standard error."),
    click.option(
        "--speed",
        metavar="X",
        type=NumberRange(SLOWEST, FASTEST, suffix="x"),
        help="Page: speed, in multiples of real time.",
    ),
    click.option(
        "--run/--wait",
        "running",
        default=None,
        help="Page: let time run at once, or wait for Play or the first command (the default).",
    ),
    click.option(
        "--port",
        type=click.IntRange(0, 65_535),
        default=PORT,
        show_default=True,
        help="Page: its port; 0 for any free one.",
    ),
    click.option("--host", default=HOST, show_default=True, help="Page: the address to listen on."),
    click.option("--insecure", is_flag=True, help="Page: allow a host that others can reach, unencrypted."),
    allow_host_option,
    click.option("--no-browser", is_flag=True, help="Page: print its address, but open no browser."),
    alert_option,
    click.option(
        "--past",
        metavar="SIZE",
        type=ByteSize(MIN_PAST, MAX_PAST),
        help="Page: memory for the past of the run (default: 300MB).",
    ),
    click.option("--record", metavar="FILE", type=click.Path(path_type=Path), help="Record the run into an MCAP file."),
    click.option(
        "--record-pictures", metavar="TIME", type=_PERIOD, help="Record positions once in this simulated time."
    ),
    click.option(
        "--record-readings", metavar="TIME", type=_PERIOD, help="Record sensor readings so often, in simulated time."
    ),
    click.option("--record-rotate", metavar="WHEN", help="Start a new file after 100MB, 10min, or 100MB,10min."),
    click.option("--from", "from_", metavar="FILE", type=click.Path(path_type=Path), help="Resume from this snapshot."),
    click.option(
        "--snapshot", metavar="FILE", type=click.Path(path_type=Path), help="Write a snapshot of the swarm into a file."
    ),
    click.option(
        "--snapshot-at", metavar="TIME", type=QuantityType(), help="Headless: when, e.g. 30s (default: at the end)."
    ),
    click.option("--journal", metavar="FILE", type=click.Path(path_type=Path), help="Write the journal into a file."),
)


def _common_options(function: Function) -> Function:
    for option in reversed(_COMMON):
        function = option(function)
    return function


@click.command("demo")
@click.argument("name", required=False)
@click.option("--headless", is_flag=True, help="Run the scenario's own mission without a page.")
@_common_options
def demo(name: str | None, headless: bool, **options: Unpack[Options]) -> int:
    """Open the scenario NAME (default: bravo) on the operator's page and command it live.

    With --headless its own mission runs as fast as it can, and the outcome is printed. With --from the swarm resumes
    from a snapshot that --snapshot has written.

    \b
    Examples:
      sleepcast demo
      sleepcast demo bravo --speed 10 --no-browser
      sleepcast demo bravo --headless --seconds 60 --seed 7 --json
    """
    return _start("bravo" if name is None and options["from_"] is None else name, headless, options)


@click.command("run")
@click.argument("scenario", required=False)
@click.option("--headless/--page", default=True, help="Without a page (the default), or on the operator's page.")
@_common_options
def run(scenario: str | None, headless: bool, **options: Unpack[Options]) -> int:
    """Run SCENARIO (a name of the gallery, or the path of one of your own) with its mission, and print the outcome.

    SCENARIO may also be a test that was saved from a session, a folder or a zip file: it is run again, and the exit
    status is 1 if not everything is as it was wanted.

    With --from instead of a SCENARIO, the swarm resumes from a snapshot that --snapshot has written: bit for bit, or,
    with another --seed, as a fork of it.

    \b
    Examples:
      sleepcast run bravo
      sleepcast run ./my-scenario --seed 3 --seconds 120 --json
      sleepcast run bravo --snapshot half.snap --snapshot-at 30s
      sleepcast run --from half.snap --seconds 30 --seed 8
      sleepcast run ./my-scenario --page
      sleepcast run ./my-saved-test --json
    """
    if (scenario is not None and (Path(scenario) / TEST_FILE).is_file()) or Path(scenario or "").suffix == ".zip":
        return _run_test(Path(scenario or ""), headless, options)
    return _start(scenario, headless, options)


TEST_FILE = "test.toml"
_OF_TESTS = ("threads", "as_json", "quiet")
"""Options that a saved test takes: everything else is in it."""


def _run_test(place: Path, headless: bool, options: Options) -> int:
    """Run a test that was saved from a session; gives the exit status."""
    from contextlib import closing

    from sleepcast.api.progress import steps
    from sleepcast.experiments.acceptance import read_test, run_test

    usual = {option.name: option.default for option in run.params if isinstance(option, click.Option)}
    for name, value in options.items():
        if name not in _OF_TESTS and value not in (usual.get(name), None, False, ()):
            raise MisuseError(
                f"{place} is a saved test, which has its own scenario, seed and length: leave out "
                f"--{name.strip('_').replace('_', '-')}"
            )
    if not headless:
        raise MisuseError(f"{place} is a saved test, which runs without a page: leave out --page")
    with Interrupts() as interrupts:
        test = read_test(place)
        with closing(steps(test.ticks, test.name, quiet=options["quiet"])) as ticks:
            verdict = run_test(test, threads=options["threads"], ticks=_checked(ticks, interrupts))
    _say(verdict, options)
    return int(not verdict.passed)


def _say(outcome: AcceptanceResult | FinishedRun, options: Options) -> None:
    """Print what came of a run."""
    if options["as_json"]:
        import json

        put(json.dumps(outcome.to_dict()))
    else:
        put(outcome.to_text())


def _checked(ticks: Iterator[int], interrupts: Interrupts) -> Iterator[int]:
    """The same, until Ctrl-C."""
    for tick in ticks:
        interrupts.check()
        yield tick


def _start(name: str | None, headless: bool, options: Options) -> int:
    """Run a scenario, or a snapshot where name is None; gives the exit status."""
    with Interrupts() as interrupts:
        _refuse_contradictions(headless, options)
        if not options["quiet"]:
            from sleepcast.cli.prepare import advise

            advise()
        recording, snapshot = _recording(options), _snapshot(options)
        if not headless:
            _show(interrupts, name, options, recording, snapshot)
            return 0
        from sleepcast.cli.headless import run_headless

        begin, seconds, quiet = _beginning(name, options), options["seconds"], options["quiet"]
        finished = run_headless(interrupts, begin, seconds, quiet=quiet, recording=recording, snapshot=snapshot)
        _say(finished, options)
        return int(finished.broken or bool(finished.missed()))


def _show(
    interrupts: Interrupts,
    name: str | None,
    options: Options,
    recording: RecordingPlan | None,
    snapshot: SnapshotPlan | None,
) -> None:
    """Serve the page of a swarm until Ctrl-C, which is raised as KeyboardInterrupt. The kernels are compiled while the
    page is served already. Raises what the console raises for the address, and what Recorder raises."""
    from sleepcast.cli.page_runs import Beginning, PageRuns
    from sleepcast.console import Address, serve_runs
    from sleepcast.console.renewal import RunSwitcher
    from sleepcast.console.snapshots import Budget
    from sleepcast.core.clock import WallClock

    _check_beginning(name, options)
    changes = _changes(options)
    beginning = Beginning(
        *(name, options["from_"], changes, options["seed"], options["threads"], options["speed"], _journal(options)),
        Budget() if options["past"] is None else Budget(options["past"]),
    )
    clock = WallClock()
    maker = PageRuns(beginning, recording, snapshot, clock)
    first = maker.make(maker.current, lambda _: None)
    interrupts.release()  # the server has a way of its own to end in good order
    browser, allow = not options["no_browser"], options["allow"]
    address = Address(options["host"], options["port"], options["insecure"], browser, allow)
    runs = RunSwitcher(first, maker, clock, waits=not options["running"])
    runs.desk.alerts.watch(options["alerts"], announce)
    try:
        serve_runs(runs, clock, address=address, say=announce)
    except (KeyboardInterrupt, Terminated) as error:
        if not maker.warm:
            end_now(TERMINATED if isinstance(error, Terminated) else INTERRUPTED)
        raise


def _check_beginning(name: str | None, options: Options) -> None:
    """Raise MisuseError unless there is either a scenario or a snapshot to begin with."""
    if options["from_"] is None:
        if name is None:
            raise MisuseError("no scenario given: give its name or path, or --from and a snapshot")
        return
    if name is not None:
        raise MisuseError(f"a snapshot has its own scenario: leave out either {name} or --from")
    if options["robots"] is not None or options["density"] is not None or options["no_walls"]:
        raise MisuseError("--robots, --density and --no-walls change how a scenario starts: a snapshot has started")


def _beginning(name: str | None, options: Options) -> Callable[[], tuple[Swarm, Station]]:
    """What assembles the swarm of a headless run: of a scenario from its start, with its own orders, or from a
    snapshot, with those that are left in it. It warms up before."""
    from sleepcast.api.assembly import assemble, assemble_from, warm_up

    _check_beginning(name, options)
    seed, threads, file = options["seed"], options["threads"], options["from_"]
    journal = _journal(options)
    if name is not None:
        from sleepcast.simulator import find_scenario

        scenario = find_scenario(name, _changes(options))
        if scenario.sees_through_walls:
            complain(scenario.sees_through_walls)

        def begin() -> tuple[Swarm, Station]:
            warm_up(scenario, threads, quiet=options["quiet"])
            return assemble(scenario, seed, mission=True, threads=threads, journal=journal)

        return begin
    assert file is not None

    def go_on() -> tuple[Swarm, Station]:
        from sleepcast.loop import load

        swarm, station = assemble_from(load(file), seed, threads, journal, name=str(file))
        warm_up(swarm.simulator.scenario, threads, quiet=options["quiet"])
        return swarm, station

    return go_on


def _journal(options: Options) -> Journal | None:
    """The journal in a file, which the end of the process closes; None for one in memory."""
    if options["journal"] is None:
        return None
    from sleepcast.core.clock import UnixClock
    from sleepcast.station.journal.file import SqliteJournal

    return SqliteJournal(options["journal"], UnixClock())


def _snapshot(options: Options) -> SnapshotPlan | None:
    """The snapshot to take; None for none."""
    if options["snapshot"] is None:
        return None
    from sleepcast.cli.headless import SnapshotPlan

    plan = SnapshotPlan(options["snapshot"], options["snapshot_at"])
    plan.check_file()
    return plan


def _refuse_contradictions(headless: bool, options: Options) -> None:
    from sleepcast.simulator.scenario.robot_settings import MAX_TIME

    seconds = options["seconds"]
    if not headless and (options["as_json"] or seconds is not None):
        option = "--json" if options["as_json"] else "--seconds"
        raise MisuseError(f"{option} is for runs without a page: add --headless")
    if options["record"] is None and any(options[name] for name in ("record_pictures", "record_readings")):
        raise MisuseError("--record-pictures and --record-readings say how often to record: add --record FILE")
    if options["record"] is None and options["record_rotate"]:
        raise MisuseError("--record-rotate says when a recording goes on in another file: add --record FILE")
    if options["snapshot_at"] is not None and (not headless or options["snapshot"] is None):
        raise MisuseError("--snapshot-at says when to take the snapshot of a headless run: add --snapshot FILE")
    if headless and options["speed"] is not None:
        raise MisuseError("--speed is for the page: without one, the run goes as fast as it can")
    if headless and options["past"] is not None:
        raise MisuseError("--past is for the page: without one, no past is stored")
    if headless and options["running"] is not None:
        raise MisuseError("--run and --wait are for the page: without one, the run begins at once")
    _refuse_one_file_for_two(options)
    if seconds is not None and not (isfinite(seconds) and 0.0 < seconds <= MAX_TIME):
        raise MisuseError(f"--seconds must be more than 0 and at most {MAX_TIME:.0f} s, not {seconds:g} s")


def _refuse_one_file_for_two(options: Options) -> None:
    """Whatever is written last would replace the other, a recording among them."""
    taken: dict[str, str] = {}
    for option, file in (
        ("--record", options["record"]),
        ("--snapshot", options["snapshot"]),
        ("--journal", options["journal"]),
    ):
        if file is not None and (other := taken.setdefault(os.path.realpath(file), option)) != option:
            raise MisuseError(f"{other} and {option} name the same file {file}: give each one of its own")


def _recording(options: Options) -> RecordingPlan | None:
    """What is to be recorded; None for nothing."""
    if options["record"] is None:
        return None
    from sleepcast.api.recording import RecordingPlan
    from sleepcast.simulator.recording.recorder import ONE_FILE, read_rotation

    rotation = ONE_FILE if options["record_rotate"] is None else read_rotation(options["record_rotate"])
    return RecordingPlan(options["record"], options["record_pictures"], options["record_readings"], rotation)


def _changes(options: Options) -> Changes:
    """What the options change of the scenario's file."""
    from sleepcast.loop import MAX_MINDS
    from sleepcast.simulator import Changes
    from sleepcast.simulator.scenario.robot_settings import LEAST, MAX_WORLD

    robots, density = options["robots"], options["density"]
    if robots is not None and robots > MAX_MINDS:
        raise MisuseError(f"--robots {robots} is too many: at most {MAX_MINDS} fit into one run")
    if density is not None and not LEAST <= density <= MAX_WORLD:
        raise MisuseError(f"--density must be from {LEAST:g} to {MAX_WORLD:g} square metres, not {density:g}")
    return Changes(robots, density, not options["no_walls"], options["seed"])
