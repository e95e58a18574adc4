"""How much of a machine a sweep makes use of: `crowd` with 100 robots for a minute, many times.

    python -m benchmarks.sweep [--runs N] [--quick] [--json]

loop: the ticks of one warm run on one core, without anything around them: what all cores together could do at best.
sweep: `sleepcast sweep` on all cores, from the start of its workers to the last written result.
a process a run: `sleepcast run`, as shell scripts around a simulator do it, as many at a time as there are cores.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory

from benchmarks.report import Bar, Json, described, machine, table

ROBOTS, SECONDS = 100, 60.0
WANTED = 0.8
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


def sweep(runs: int, folder: Path) -> float:
    """The same of a whole sweep."""
    command = [
        *(sys.executable, "-m", "sleepcast", "sweep", "crowd", "--over", f"robots.count={ROBOTS}"),
        *("--seeds", f"{runs}", "--seconds", f"{SECONDS:g}s", "--measure", "mean battery", "--quiet"),
        *("--out", str(folder / "results")),
    ]
    began = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return runs * SECONDS / (time.perf_counter() - began)


def processes(runs: int, cores: int) -> float:
    """The same of processes of their own."""

    def one(seed: int) -> None:
        command = [
            *(sys.executable, "-m", "sleepcast", "run", "crowd", "--robots", f"{ROBOTS}", "--threads", "1", "--json"),
            *("--seconds", f"{SECONDS:g}", "--seed", f"{seed}", "--quiet"),
        ]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)

    began = time.perf_counter()
    with ThreadPoolExecutor(cores) as pool:
        list(pool.map(one, range(runs)))
    return runs * SECONDS / (time.perf_counter() - began)


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.sweep", description=(__doc__ or "").partition("\n\n")[0]
    )
    parser.add_argument("--runs", type=int, default=1_000, help="of the sweep")
    parser.add_argument("--quick", action="store_true", help="a few runs; rough numbers")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    runs = 20 if options.quick else options.runs
    found = machine()
    cores = int(str(found["cores"]))
    with TemporaryDirectory() as folder:
        best = loop() * cores
        speeds = {
            f"{cores} warm loops": best,
            "sleepcast sweep": sweep(runs, Path(folder)),
            "a process a run": processes(max(cores, runs // FEWER), cores),
        }
    bar = Bar(
        f"{runs:,} runs of {ROBOTS} robots for {SECONDS:g} s", speeds["sleepcast sweep"] / best, WANTED, "of the loops"
    )
    missing = [] if which("argos3") else ["ARGoS is not installed, so it is not in this table."]
    if options.json:
        print(json.dumps(Json(machine=found, speeds=speeds, bars=[bar.to_dict()], missing=missing)))
        return 0
    rows = [(name, f"{speed:,.0f}", f"{speed / best:.2f}") for name, speed in speeds.items()]
    print(f"{described(found)}\n\n{table(('', 'x real time', 'of the loops'), rows)}\n\n{bar.text}", *missing, sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
