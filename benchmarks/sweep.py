"""How much of a machine a sweep makes use of: `crowd` with 100 robots for a minute, many times.

    python -m benchmarks.sweep [--runs N] [--quick] [--json] [--argos FOLDER]

loop: the ticks of one warm run on one core, without anything around them: what all cores together could do at best.
sweep: `sleepcast sweep` on all cores, from the start of its workers to the last written result.
2 processes, 2 dask workers: the same sweep on two worker processes, and on two workers of a dask cluster, all on this
machine.
a process a run: `sleepcast run`, as shell scripts around a simulator do it, as many at a time as there are cores.
ARGoS, a process a run: the same with `argos3`, where it is on the PATH and FOLDER has an experiment of 60 s without a
visualization, `100.argos`: that of its diffusion example, with 100 robots.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory

from benchmarks.report import Bar, Json, described, machine, number, table

ROBOTS, SECONDS = 100, 60.0
WANTED = 0.8
WORKERS, SLOWER = 2, 1.2
"""Dask is compared on so many workers, and may take so many times as long as processes."""
SILENT: Json = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
ABSENT = "not installed"
FEWER = 20
"""Of so many runs, one is done as a process of its own: they differ little."""


def loop() -> float:
    """Simulated seconds a second of one core, the median of some warm runs."""
    from sleepcast.experiments.plan import experiment_of
    from sleepcast.experiments.run import opened

    experiment = experiment_of("crowd", over=[f"robots.count={ROBOTS}"], measures=["mean battery"], seeds=7)
    speeds = []
    for run in experiment.runs():
        with opened(experiment, run) as fleet:
            began = time.perf_counter()
            fleet.swarm.run(SECONDS)
            speeds.append(SECONDS / (time.perf_counter() - began))
    return sorted(speeds[1:])[len(speeds[1:]) // 2]


def sweep(runs: int, folder: Path, *where: str) -> float:
    """The same of a whole sweep. where: options that say on which workers."""
    command = [
        *(sys.executable, "-m", "sleepcast", "sweep", "crowd", "--over", f"robots.count={ROBOTS}"),
        *("--seeds", f"{runs}", "--seconds", f"{SECONDS:g}s", "--measure", "mean battery", "--quiet"),
        *("--out", str(folder / "-".join(["results", *where]).replace("/", "_")), *where),
    ]
    began = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return runs * SECONDS / (time.perf_counter() - began)


@contextmanager
def cluster(folder: Path) -> Iterator[str]:
    """The address of a dask scheduler with two workers, started with its own command line."""
    file = folder / "scheduler.json"
    dask = (sys.executable, "-W", "ignore", "-m", "dask")
    quiet = ("--no-dashboard", "--scheduler-file", str(file))
    started = [subprocess.Popen([*dask, "scheduler", "--host", "127.0.0.1", "--port", "0", *quiet], **SILENT)]
    try:
        started += [
            subprocess.Popen([*dask, "worker", "--nthreads", "1", "--no-nanny", *quiet], **SILENT)
            for _ in range(WORKERS)
        ]
        while not (file.exists() and file.stat().st_size):
            if started[0].poll() is not None:
                raise SystemExit("the dask scheduler has ended before it was up")
            time.sleep(0.05)
        yield str(json.loads(file.read_text())["address"])
    finally:
        for process in started:
            process.kill()
            process.wait()


def own(seed: int) -> None:
    """One run of sleepcast in a process of its own."""
    command = [
        *(sys.executable, "-m", "sleepcast", "run", "crowd", "--robots", f"{ROBOTS}", "--threads", "1", "--json"),
        *("--seconds", f"{SECONDS:g}", "--seed", f"{seed}", "--quiet"),
    ]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def processes(runs: int, cores: int, one: Callable[[int], None]) -> float:
    """Simulated seconds a second of processes of their own. one: does the run of a number."""
    began = time.perf_counter()
    with ThreadPoolExecutor(cores) as pool:
        list(pool.map(one, range(runs)))
    return runs * SECONDS / (time.perf_counter() - began)


def argos(folder: Path | None, runs: int, cores: int) -> float | None:
    """The same of ARGoS; None where it is not installed, or without an experiment."""
    if folder is None or which("argos3") is None:
        return None

    def one(_: int) -> None:
        subprocess.run(["argos3", "-c", str(folder / f"{ROBOTS}.argos")], check=True, **SILENT)

    return processes(runs, cores, one)


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.sweep", description=(__doc__ or "").partition("\n\n")[0]
    )
    parser.add_argument("--runs", type=int, default=1_000, help="of the sweep")
    parser.add_argument("--quick", action="store_true", help="a few runs; rough numbers")
    parser.add_argument("--argos", metavar="FOLDER", type=Path, help="with an experiment of ARGoS, 100.argos")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    runs = 20 if options.quick else options.runs
    found = machine()
    cores = int(str(found["cores"]))
    single = max(cores, runs // FEWER)
    speeds: dict[str, float | None] = {}
    with TemporaryDirectory() as folder:
        speeds[f"{cores} warm loops"] = best = loop() * cores
        speeds["sleepcast sweep"] = whole = sweep(runs, Path(folder))
        pool = whole if cores == WORKERS else sweep(runs, Path(folder), "--workers", f"{WORKERS}")
        speeds[f"sleepcast sweep, {WORKERS} processes"] = pool
        dask = None
        if find_spec("distributed"):
            with cluster(Path(folder)) as address:
                dask = sweep(runs, Path(folder), "--cluster", address)
        speeds[f"sleepcast sweep, {WORKERS} dask workers"] = dask
        speeds["sleepcast run, a process a run"] = processes(single, cores, own)
        speeds["ARGoS, a process a run"] = argos(options.argos, single, cores)
    bars = [
        Bar(f"{runs:,} runs of {ROBOTS} robots for {SECONDS:g} s", whole / best, WANTED, "of the loops"),
        Bar(
            f"{WORKERS} dask workers",
            None if dask is None else pool / dask,
            SLOWER,
            f"times as long as {WORKERS} processes",
            at_least=False,
            note="dask is not installed",
        ),
    ]
    if options.json:
        print(json.dumps(Json(machine=found, speeds=speeds, bars=[bar.to_dict() for bar in bars])))
        return 0
    rows = [
        (name, ABSENT, "") if speed is None else (name, f"{speed:,.0f}", number(speed / best))
        for name, speed in speeds.items()
    ]
    print(
        f"{described(found)}\n\n{table(('', 'x real time', 'of the loops'), rows)}\n",
        *[bar.text for bar in bars],
        sep="\n",
    )
    if speeds["ARGoS, a process a run"] is None:
        print("ARGoS takes argos3 on the PATH, and --argos with a folder that has 100.argos")
    return 0


if __name__ == "__main__":
    sys.exit(main())
