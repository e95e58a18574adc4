"""Prints how long the program takes to start: a value, a page's first picture, and a short run as a whole.

    python -m benchmarks.start [--quick] [--json] [--argos FOLDER]

Cold: in an empty cache folder, without kernels and without the bytecode of any module, as on the first start ever.
Warm: the same again, with what the start before has kept. Times are those of whole processes on the wall clock; of
several warm ones the best counts, because other work can only make a start longer. A picture moves when a frame of the
first tick has come through the WebSocket: a large crowd is shown while its kernels are compiled, and sets out when they
are. A short run is 60 simulated seconds without a page, from the command to the end of its process. The files of the
system are in its memory both times.

ARGoS is timed beside it where `argos3` is on the PATH and FOLDER has experiments of 60 s without a visualization in it,
`100.argos` and `1000.argos`: those of its diffusion example, with so many robots and as much room for each.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import urlsplit

from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from benchmarks.programs import PATIENCE, Program
from benchmarks.report import Bar, described, machine, table

EVAL, WARM, COLD = 0.150, 2.0, 10.0
"""Seconds at most: the value of an expression; the first frame of moving robots with and without kernels."""
WHOLE = {100: 0.5, 1_000: 1.1}
"""Seconds at most of a whole process in which so many robots live for `SECONDS` simulated ones, with kernels."""
SECONDS = 60
MEDDLING = "PYTHONDONTWRITEBYTECODE"
"""A variable that would keep nothing."""
LINUX = sys.platform == "linux"
STARTS = 7
"""Warm starts of each."""


@dataclass(frozen=True)
class Time:
    """Seconds on the wall clock, and of the processor; None where the system does not tell."""

    wall: float
    cpu: float | None


Start = Callable[[Mapping[str, str]], Time]


@dataclass(frozen=True)
class Row:
    """What is started. kept: bytes of kernels in the cache folder after the cold start; added: by the warm ones."""

    name: str
    cold: Time
    warm: tuple[Time, ...]
    kept: int
    added: int

    @property
    def best(self) -> Time:
        return min(self.warm, key=lambda time: time.wall)


def value(environment: Mapping[str, str]) -> Time:
    """Time until `sleepcast eval '(+ 1 2)'` has ended."""
    taken, said = _timed([sys.executable, "-m", "sleepcast", "eval", "(+ 1 2)"], environment)
    if said.strip() != "3":
        raise RuntimeError(f"(+ 1 2) gives {said.strip()!r}")
    return taken


def whole(robots: int) -> Start:
    """Time until a run of so many robots of `crowd` has ended."""

    def start(environment: Mapping[str, str]) -> Time:
        options = ("--robots", str(robots), "--seconds", str(SECONDS), "--quiet", "--json")
        taken, said = _timed([sys.executable, "-m", "sleepcast", "run", "crowd", *options], environment)
        if json.loads(said)["robots"] != robots:
            raise RuntimeError(f"the run says {said[:200]!r}")
        return taken

    return start


def argos(experiment: Path) -> Start:
    """Time until ARGoS has ended an experiment."""
    return lambda environment: _timed(["argos3", "-c", str(experiment)], environment)[0]


def _timed(command: Sequence[str], environment: Mapping[str, str]) -> tuple[Time, str]:
    """How long a program takes, and what it says."""
    begin, used = time.perf_counter(), _children()
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return Time(time.perf_counter() - begin, _children() - used), done.stdout


def _children() -> float:
    """Seconds of the processor that processes which have ended have used."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def moving(*scenario: str) -> Start:
    """Time until the page of a scenario has a frame in which its robots move."""

    def start(environment: Mapping[str, str]) -> Time:
        begin = time.perf_counter()
        with Program("demo", *scenario, "--run", environment=environment) as program:
            parts = urlsplit(program.address)
            address = f"ws://{parts.netloc}/live?{parts.query}"
            origin = Origin(f"http://{parts.netloc}")
            with connect(address, origin=origin, compression=None, max_size=None) as socket:
                while not _tick(socket):
                    pass
                return Time(time.perf_counter() - begin, program.cpu() if LINUX else None)

    return start


def _tick(socket: ClientConnection) -> int:
    """The tick of the next frame, which is drawn at once; 0 for anything else."""
    frame = socket.recv(PATIENCE)
    if not isinstance(frame, bytes):
        return 0
    number, tick = struct.unpack_from("<II", frame, 8)
    socket.send(json.dumps({"type": "drawn", "number": number}))
    return int(tick)


STARTED: dict[str, Start] = {
    "sleepcast eval '(+ 1 2)'": value,
    "demo bravo moves": moving("bravo"),
    "demo crowd moves": moving("crowd"),
    "demo crowd --robots 10000 moves": moving("crowd", "--robots", "10000"),
    **{f"run crowd --robots {robots}, whole": whole(robots) for robots in WHOLE},
}


def rivals(folder: Path | None) -> dict[str, Start]:
    """What is timed beside it: ARGoS, if it is there."""
    if folder is None or shutil.which("argos3") is None:
        return {}
    return {f"ARGoS, {robots} robots, whole": argos(folder / f"{robots}.argos") for robots in WHOLE}


def measure(name: str, start: Start, starts: int) -> Row:
    """One cold start and so many warm ones after it."""
    with TemporaryDirectory() as folder:
        places = {"XDG_CACHE_HOME": folder, "PYTHONPYCACHEPREFIX": str(Path(folder, "bytecode"))}
        environment = {key: text for key, text in os.environ.items() if key != MEDDLING} | places
        cold = start(environment)
        kept = _size(Path(folder, "sleepcast"))
        warm = tuple(start(environment) for _ in range(starts))
        return Row(name, cold, warm, kept, _size(Path(folder, "sleepcast")) - kept)


def _size(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())


def bars(rows: Sequence[Row]) -> list[Bar]:
    runs = {f"run crowd --robots {robots}, whole": seconds for robots, seconds in WHOLE.items()}
    found = []
    for row in rows:
        if row.name.startswith("ARGoS"):
            continue
        frame = row.name.startswith("demo")
        wanted = runs.get(row.name, WARM if frame else EVAL)
        found.append(Bar(f"{row.name}, warm", row.best.wall, wanted, "s", at_least=False))
        if frame:
            found.append(Bar(f"{row.name}, cold", row.cold.wall, COLD, "s", at_least=False))
    return found


def show(rows: Sequence[Row]) -> str:
    heads = ["", "cold, s", "of the processor", "warm, s", "of the processor", "kernels kept", "added when warm"]
    lines = [
        [row.name, *_cells(row.cold), *_cells(row.best), f"{row.kept / 1e3:,.0f} kB", f"{row.added / 1e3:,.0f} kB"]
        for row in rows
    ]
    return table(heads, lines)


def _cells(time: Time) -> list[str]:
    return [f"{time.wall:.3f}", "" if time.cpu is None else f"{time.cpu:.2f}"]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.start", description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="one warm start of each, and no large crowd")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of a table")
    parser.add_argument(
        "--argos", metavar="FOLDER", type=Path, help="with experiments of ARGoS, 100.argos and 1000.argos"
    )
    options = parser.parse_args()
    started = [*STARTED.items(), *rivals(options.argos).items()][: 3 if options.quick else None]
    rows = [measure(name, start, 1 if options.quick else STARTS) for name, start in started]
    if options.json:
        report = [{**asdict(row), "best": asdict(row.best)} for row in rows]
        print(json.dumps({"machine": machine(), "rows": report, "bars": [bar.to_dict() for bar in bars(rows)]}))
        return
    print(f"{described(machine())}\n\n{show(rows)}\n")
    print("\n".join(bar.text for bar in bars(rows)))
    if not rivals(options.argos):
        print("\nARGoS is left out: it takes argos3 on the PATH, and --argos with a folder of experiments")


if __name__ == "__main__":
    main()
