"""`sleepcast sweep` and `sleepcast plot`: a scenario run many times, and figures of what came of it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING

import click

from sleepcast.cli.options import QuantityType
from sleepcast.cli.streams import announce, complain, put, somebody_there
from sleepcast.core.errors import MisuseError, decimal_comma, printable

if TYPE_CHECKING:
    from sleepcast.experiments.findings import SweepFindings
    from sleepcast.experiments.plan import Experiment
    from sleepcast.experiments.results import Results, Summary

PORT = 8317
TABLES = (".parquet", ".csv")
SHOWN_UNSENT = 3
"""Commands that were never sent which are printed at the end."""
SHOWN_ERRORS = 3
"""Different errors of failed runs that are printed at the end."""


@click.command("sweep")
@click.argument("what", metavar="SCENARIO|FILE.toml|RESULTS")
@click.option("--over", metavar="KEY=V,V", multiple=True, help="Values of a key of the scenario; may be repeated.")
@click.option("--seeds", metavar="N", type=click.IntRange(min=1), help="Runs at each point (default: 1).")
@click.option(
    "--measure", "measures", metavar="[NAME=]M", multiple=True, help="What is measured: mean fuel; may be repeated."
)
@click.option("--seconds", metavar="TIME", type=QuantityType(), help="Length of a run (default: the scenario's).")
@click.option("--every", metavar="TIME", type=QuantityType(), help="Sample during the run, not only at its end.")
@click.option("--until", metavar="M>=V", help="End a run early, as soon as this holds.")
@click.option("--no-mission", is_flag=True, help="Leave out the scenario's own commands.")
@click.option("--out", metavar="RESULTS", type=click.Path(path_type=Path), help="Folder, or table beside its folder.")
@click.option("--workers", metavar="N", type=click.IntRange(1, 1024), help="Processes (default: one per core).")
@click.option("--timeout", metavar="TIME", type=QuantityType(), help="Longest time for a run (default: 1h).")
@click.option("--cluster", metavar="ADDRESS", help="Instead: the workers of a dask cluster, as tcp://host:8786.")
@click.option("--insecure", is_flag=True, help="Allow a cluster on other machines, unencrypted: trust its network.")
@click.option("--retry", is_flag=True, help="Re-run failed runs.")
@click.option("--verify", is_flag=True, help="Do finished runs again, and compare.")
@click.option("--runs", metavar="N", type=click.IntRange(min=1), help="With --verify: only the first N.")
@click.option("--trust", is_flag=True, help="Run the Python files that the plan names, now and in future.")
@click.option("--page", is_flag=True, help="Show progress and curves in the browser.")
@click.option("--port", type=click.IntRange(0, 65_535), help="Page: its port (default: 8317; 0 for any free one).")
@click.option("--no-browser", is_flag=True, help="Page: print its address, but open no browser.")
@click.option("--json", "as_json", is_flag=True, help="Print the outcome as one JSON object.")
@click.option("--quiet", is_flag=True, help="Show no progress on standard error.")
def sweep(what: str, out: Path | None, verify: bool, workers: int | None, as_json: bool, quiet: bool, **how) -> int:  # type: ignore[no-untyped-def]
    """Run SCENARIO at every point of what is varied, with every seed, and keep what was measured in a folder.

    Without --measure, the experiment of the scenario's own folder is done, if there is one, with the settings and
    seeds that you give. A TOML file says the same as the options (see docs/howto/run-experiments.md). Begun again,
    it goes on where it was interrupted. --out coverage.csv keeps the results in the folder coverage and writes the
    table coverage.csv at the end; .parquet likewise. --page shows in the browser how far it has come, with curves
    that grow; a click on a point lists its runs, and each opens on a page of its own.

    A measure may be a function in Python. A file or folder that names one is a program: it is run if you say that it is
    yours, when you are asked or by --trust, which is remembered for its folder.

    \b
    Examples:
      sleepcast sweep crowd --over radio.loss=0,0.3 --seeds 5 --seconds 10s --measure 'mean battery' --out loss.csv
      sleepcast sweep search --out found
      sleepcast sweep search --over constants.CHANCE=0.2,0.9 --out chances
      sleepcast sweep experiment.toml --out results
      sleepcast sweep results
      sleepcast sweep results --verify --runs 10
    """
    from sleepcast.experiments.run import checked_cluster, cores

    folder, table = _folder(what, out)
    if how["cluster"] and workers:
        raise MisuseError("--workers are processes here, --cluster others elsewhere: choose one of them")
    if how["cluster"] and how["timeout"]:
        raise MisuseError("--timeout ends processes here; those of a --cluster belong to others: leave it out")
    if how["insecure"] and not how["cluster"]:
        raise MisuseError("--insecure is about the network to a --cluster: leave it out")
    cluster = how["cluster"] and checked_cluster(how["cluster"], insecure=how["insecure"])
    many = cluster or workers or cores()
    if not how["page"] and (how["port"] is not None or how["no_browser"]):
        raise MisuseError("--port and --no-browser are about a page: add --page")
    if verify and how["page"]:
        raise MisuseError("--page shows a sweep: leave out --verify")
    if verify:
        from sleepcast.experiments.results import experiment_in

        let_programs_run(experiment_in(folder), folder, trusted=how["trust"])
        return _verify(folder, many, how["runs"], as_json=as_json, quiet=quiet)
    experiment = _experiment(what, folder, how)
    from sleepcast.experiments.results import Results
    from sleepcast.experiments.run import LONGEST_RUN, try_out

    limit = how["timeout"] or LONGEST_RUN
    runs_programs = let_programs_run(experiment, written_in(what), trusted=how["trust"])
    with _comma_named(how["over"]):
        try_out(experiment, limit)
    for sentence in experiment.repeats():
        complain(sentence)
    _tell_too_late(experiment)
    with Results(folder, experiment) as results, ExitStack() as stack:
        if runs_programs:
            _remember(folder)
        if not quiet and (done := results.count()):
            announce(f"{done:,} of {len(experiment):,} runs are done already")
        findings = stack.enter_context(_page(results, how["port"], not how["no_browser"])) if how["page"] else None
        errors = _sweep(results, many, findings, limit, retry=how["retry"], quiet=quiet)
        status = _tell(results, table, errors, as_json=as_json)
        if findings is not None:
            findings.finish()
            complain("the sweep has ended; its page stays open until Ctrl-C")
            with suppress(KeyboardInterrupt):
                Event().wait()
    return status


@contextmanager
def _comma_named(over: Sequence[str]) -> Iterator[None]:
    """Name a decimal comma where what stands before or after one is refused as a value of its own."""
    try:
        yield
    except MisuseError as error:
        for each in over:
            key, _, values = each.partition("=")
            if f"over {key.strip()}:" in str(error) and (comma := decimal_comma(values.strip())):
                raise MisuseError(f"{error}{comma}") from error
        raise


def _tell_too_late(experiment: Experiment) -> None:
    """Say which commands are never sent, before anything is run."""
    from sleepcast.api.session_test import late_sentence
    from sleepcast.experiments.run import too_late

    orders, end = too_late(experiment)
    if orders:
        complain(late_sentence(orders, end))


def _folder(what: str, out: Path | None) -> tuple[Path, Path | None]:
    """The folder of the results, and the table that is written at the end."""
    from sleepcast.experiments.plan import is_results

    if out is None:
        path = Path(what)
        if is_results(path):
            return path, None
        raise MisuseError("say where the results are to be kept: --out results, or --out results.csv")
    return (out.with_suffix(""), out) if out.suffix in TABLES else (out, None)


def _experiment(what: str, folder: Path, how: dict[str, object]) -> Experiment:
    from sleepcast.experiments.plan import (
        experiment_of,
        experiment_of_scenario,
        is_results,
        is_written,
        read_experiment,
    )
    from sleepcast.experiments.results import experiment_in

    options = {key: how[key] for key in ("over", "measures", "seeds", "seconds", "every", "until") if how[key]}
    given = [f"--{'measure' if key == 'measures' else key}" for key in options]
    given += ["--no-mission"] if how["no_mission"] else []
    own = experiment_of_scenario(what)
    if own is not None and not given:
        return own
    path = Path(what)
    if is_written(path):
        if given:
            raise MisuseError(f"{what} says what is varied and measured: leave out {', '.join(given)}")
        return experiment_in(path) if is_results(path) else read_experiment(path)
    if own is not None and "measures" not in options:
        return own.varied(mission=not how["no_mission"], **options)  # type: ignore[arg-type]  # click has checked them
    return experiment_of(what, mission=not how["no_mission"], **options)  # type: ignore[arg-type]  # as above


def written_in(what: str) -> Path | None:
    """What a plan is written in: a file, or a folder of results; None for one that was typed or is of the gallery."""
    from sleepcast.experiments.plan import experiment_file, is_written
    from sleepcast.simulator import scenario_names

    path = Path(what)
    if what in scenario_names():
        return None
    return path if is_written(path) else experiment_file(what)


def _modules(experiment: Experiment, written: Path | None) -> list[Path]:
    """Where modules are looked for besides where Python does: beside the plan or the results, beside the scenario, and
    in the current folder."""
    from sleepcast.experiments.trust import folder_of

    beside = [written.parent if written else None, folder_of(experiment.scenario), Path.cwd()]
    return list(dict.fromkeys(each.resolve() for each in beside if each is not None))


def let_programs_run(experiment: Experiment, written: Path | None, *, trusted: bool) -> bool:
    """See that functions in Python which an experiment names may be run, and let Python find their modules; gives
    whether there are any. Raises MisuseError for what nobody answers for, and for modules that are nowhere.

    written: see `written_in`.
    trusted: whether somebody has said so.
    """
    from sleepcast.experiments.trust import is_own, look_in, programs

    modules = _modules(experiment, written)
    to_run = programs(experiment, modules)
    if not to_run:
        return False
    complain(printable(f"this sweep runs programs: {', '.join(each.sentence() for each in to_run)}"))
    used = [each for each in modules if any(each in program.roots for program in to_run)]
    files = [file for each in to_run for file in each.files]
    named = [] if written is None else [written.resolve() if written.is_dir() else written.resolve().parent]
    folders = list(dict.fromkeys(named + used))
    unknown = [each for each in folders if not is_own(each, files)]
    typed_here = written is None and used in ([], [Path.cwd().resolve()])
    question = f"They can do whatever you can. Run what {_listed(unknown)} names or holds"
    if unknown and not (typed_here or trusted or (somebody_there() and click.confirm(question, err=True))):
        raise MisuseError(
            f"{_listed(unknown)} may be anybody's, and nobody has said here that Python files named or lying there may "
            "be run: look at them, and add --trust if they are yours or you trust who wrote them"
        )
    for each in unknown:
        _remember(each)
        if not is_own(each, files):
            complain(f"this is asked again next time: others may write to {each}, or to its Python files")
    look_in(used)
    return True


def _remember(folder: Path) -> None:
    """Ask no more for this folder."""
    from sleepcast.experiments.trust import TrustError, make_own

    try:
        make_own(folder)
    except TrustError as error:
        complain(str(error))


def _listed(folders: list[Path]) -> str:
    return printable(" and ".join(map(str, folders)))


@contextmanager
def _page(results: Results, port: int | None, browser: bool) -> Iterator[SweepFindings]:
    """What has been found, shown on a page for as long as this is entered. Raises what the console raises for the
    address."""
    from sleepcast.console import Address
    from sleepcast.experiment_page.server import experiment_page
    from sleepcast.experiments.findings import SweepFindings
    from sleepcast.experiments.results import outcomes_in

    findings = SweepFindings(results.experiment, outcomes_in(results.folder))
    address = Address("127.0.0.1", PORT if port is None else port, insecure=False, browser=browser)
    with experiment_page(findings, results.folder, address=address, say=complain):
        yield findings


def _sweep(
    results: Results, workers: int | str, findings: SweepFindings | None, limit: float, *, retry: bool, quiet: bool
) -> dict[str, int]:
    """Do what is missing; gives the errors of failed runs, with their counts."""
    from sleepcast.api.progress import steps
    from sleepcast.experiments.run import run_all

    errors: dict[str, int] = {}
    outcomes = run_all(results, workers, retry=retry, limit=limit, remark=complain)
    try:
        with closing(outcomes), closing(steps(results.left(retry=retry), "sweep", quiet=quiet)) as bar:
            for outcome in outcomes:
                next(bar, None)
                if outcome.error:
                    errors[outcome.error] = errors.get(outcome.error, 0) + 1
                if findings is not None:
                    findings.add(outcome)
    except KeyboardInterrupt:
        complain(f"interrupted; what is done is kept: go on with sleepcast sweep {results.folder}")
        raise
    return errors


def _tell(results: Results, table: Path | None, errors: dict[str, int], *, as_json: bool) -> int:
    """Write the table, and say what came of it; gives the exit status: 1 if runs failed, or are missing."""
    from sleepcast.experiments.results import best_of, export, summary_of

    folder = results.folder
    if table is not None:
        export(folder, table)
    summary = summary_of(folder)
    counts = {"runs": summary.runs, "done": summary.done, "failed": summary.failed, "unknown": summary.unknown}
    place: dict[str, object] = {"results": str(folder), "table": None if table is None else str(table)}
    place |= {"never_sent": summary.unsent, "missed": summary.missed}
    best = best_of(folder)
    if best is not None:
        place["best"] = {"measure": best.measure, "value": best.value, "point": best.point, "runs": best.runs}
    announce(json.dumps(counts | place) if as_json else f"{summary.sentence()}: {table or folder}")
    if best is not None and not as_json:
        announce(best.sentence())
    if not as_json:
        _tell_never_sent(summary)
        _tell_missed(summary)
    for error, count in list(errors.items())[:SHOWN_ERRORS]:
        complain(f"{count:,} {'run' if count == 1 else 'runs'} failed: {error}")
    missing = len(results.missing())
    if missing:
        complain(f"{missing:,} {'run is' if missing == 1 else 'runs are'} missing: go on with sleepcast sweep {folder}")
    return int(summary.failed > 0 or missing > 0)


def _tell_never_sent(summary: Summary) -> None:
    for command, count in list(summary.unsent.items())[:SHOWN_UNSENT]:
        complain(f"never sent in {count:,} of {summary.done:,} runs, which ended before: {command}")
    if (more := len(summary.unsent) - SHOWN_UNSENT) > 0:
        complain(f"and {more:,} more commands were never sent in some runs: see --json")


def _tell_missed(summary: Summary) -> None:
    for wanted, count in list(summary.missed.items())[:SHOWN_UNSENT]:
        complain(f"not as its mission wanted in {count:,} of {summary.done:,} runs: {wanted}")
    if (more := len(summary.missed) - SHOWN_UNSENT) > 0:
        complain(f"and {more:,} more counts came otherwise than the mission wanted in some runs: see --json")


def _verify(folder: Path, workers: int | str, most: int | None, *, as_json: bool, quiet: bool) -> int:
    from sleepcast.api.progress import steps
    from sleepcast.experiments.results import outcomes_in
    from sleepcast.experiments.run import verify

    count = min(sum(1 for _ in outcomes_in(folder)), most or 1_000_000_000)
    different = []
    outcomes = verify(folder, workers, most)
    with closing(outcomes), closing(steps(count, "verify", quiet=quiet)) as bar:
        for _, (again, same) in zip(bar, outcomes, strict=False):
            if not same:
                different.append(again.run)
    if as_json:
        put(json.dumps({"verified": count, "different": [run.number for run in different]}))
    else:
        put(f"{count - len(different):,} of {count:,} runs came out the same")
        for run in different[:SHOWN_ERRORS]:
            complain(f"run {run.number} ({run.point}, seed {run.seed}) came out differently")
    return int(bool(different))


@click.command("plot")
@click.argument("results", type=click.Path(path_type=Path))
@click.option("--x", required=True, metavar="COLUMN", help="Column for the x axis: a varied key, or time.")
@click.option(
    "--y", required=True, multiple=True, metavar="COLUMN", help="Column for the y axis: a measure; may be repeated."
)
@click.option("--by", metavar="COLUMN", help="A line or box for each of its values; in a heat map, the other axis.")
@click.option("--kind", type=click.Choice(["line", "box", "heat"]), default="line", show_default=True)
@click.option("--title", default="", help="Above the figure.")
@click.option("--out", required=True, metavar="FILE", type=click.Path(path_type=Path), help="An SVG, PDF or PNG file.")
@click.option(
    "--angle", "angles", multiple=True, metavar="COLUMN", help="A column of angles (rad), where only a CSV is there."
)
def plot(
    results: Path, x: str, y: tuple[str, ...], by: str | None, kind: str, title: str, out: Path, angles: tuple[str, ...]
) -> int:
    """Draw a figure of RESULTS: a folder of `sleepcast sweep`, or its table as CSV.

    A line shows means with 95 % bootstrap bands over the seeds. Beside the figure stand the program that drew it and
    the table that it reads, so that you can change it.

    \b
    Examples:
      sleepcast plot loss --x radio.loss --y mean_battery --out loss.svg
      sleepcast plot results --x time --y covered --by robots.count --out covered.pdf
      sleepcast plot results --x radio.loss --y covered --by robots.count --kind heat --out phases.png
    """
    from sleepcast.experiments.figures import figure

    figure(results, out, x=x, y=y, by=by, kind=kind, title=title, angles=angles)
    put(str(out))
    return 0
