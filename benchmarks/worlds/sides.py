"""Who is compared: this version of sleepcast, the release before it, ARGoS, and libraries that another Python has."""

from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
import tarfile
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory

from benchmarks.children import ROOT, ChildError, child
from benchmarks.report import Json

RELEASE, COMMITS = "0.2.0", ("v0.2.0", "34e0a6c0")
"""What is compared with, and where it is in the history: its tag, or the last commit before the changes after it."""
LIMIT = 7_200.0
"""Seconds until a process that has not ended is given up."""
LENGTH = re.compile(r'\blength="60"')
"""How an experiment of ARGoS says that it lasts a minute."""
POLL = 0.005
"""Seconds between two looks for the first worker."""
CPU = "--cpu"
"""Tells a child to count the processor's time instead of that of the clock."""


class MissingError(Exception):
    """Something cannot be measured here. The text says why, and what is wanted."""


@dataclass(frozen=True)
class Clock:
    """What counts as time: that on the wall; or that of the processor, for a machine which does other work as well."""

    cpu: bool = False

    def of(
        self, command: Sequence[str], environment: Mapping[str, str] | None = None, *, silent: bool = False
    ) -> float:
        """Seconds that a command takes, with all processes that it starts. Raises RuntimeError if it fails."""
        began = time.perf_counter()
        process = begun(command, environment, silent=silent)
        used = self.end(process)
        return used if self.cpu else time.perf_counter() - began

    def end(self, process: subprocess.Popen[bytes]) -> float:
        """Wait for the end of a process; gives the processor's time that it took. Raises RuntimeError if it failed."""
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            raise RuntimeError(f"{process.args!r} ended with {process.returncode}")
        return used.ru_utime + used.ru_stime

    @property
    def options(self) -> tuple[str, ...]:
        """For children, which time things by themselves."""
        return (CPU,) if self.cpu else ()


def begun(
    command: Sequence[str], environment: Mapping[str, str] | None = None, *, silent: bool = False
) -> subprocess.Popen[bytes]:
    """A command at work, of which only complaints are seen, or nothing. environment: variables to add."""
    null = subprocess.DEVNULL
    everything = {**os.environ, **(environment or {})}
    return subprocess.Popen(command, env=everything, cwd=ROOT, stdout=null, stderr=null if silent else None)


@dataclass(frozen=True)
class Version:
    """A version of sleepcast: the folder that its `src` is in."""

    name: str
    folder: Path
    clock: Clock = Clock()

    @property
    def environment(self) -> Mapping[str, str]:
        return {"PYTHONPATH": str(self.folder / "src")}

    def check(self) -> None:
        """Raises MissingError if Python finds another sleepcast than this one."""
        look = "import json, sleepcast; print(json.dumps([sleepcast.__file__, sleepcast.__version__]))"
        everything = {**os.environ, **self.environment}
        done = subprocess.run([sys.executable, "-c", look], env=everything, capture_output=True, text=True, check=False)
        found = json.loads(done.stdout or '["", ""]')
        if not Path(found[0]).is_relative_to(self.folder.resolve()):
            raise MissingError(f"{self.folder} has no sleepcast in src/: wanted a checkout of the repository")

    def process(self, *arguments: str) -> float:
        """Seconds that a whole `sleepcast` command takes."""
        return self.clock.of([sys.executable, "-m", "sleepcast", *arguments], self.environment)

    def loop(self, *arguments: str) -> float:
        """Times real time of the ticks of a whole `sleepcast run`, as it says itself. Raises MissingError if not the
        clock counts."""
        if self.clock.cpu:
            raise MissingError("a run tells its speed by the clock only: leave out --cpu")
        command = [sys.executable, "-m", "sleepcast", "run", *arguments, "--json", "--quiet"]
        everything = {**os.environ, **self.environment}
        done = subprocess.run(command, env=everything, cwd=ROOT, stdout=subprocess.PIPE, check=True)
        return float(json.loads(done.stdout)["realtime_factor"])

    def one(self, *arguments: object) -> Json:
        """What `benchmarks.worlds.one` says of this version. Raises MissingError for what it does not have."""
        texts = [each if isinstance(each, str) else json.dumps(each) for each in arguments]
        return self.child("benchmarks.worlds.one", *texts, *self.clock.options)

    def child(self, module: str, *arguments: str) -> Json:
        """What a module of the benchmarks says, which measures this version. Raises MissingError."""
        return asked(module, *arguments, environment=self.environment)

    def sweep(self, scenario: str, runs: int, seconds: float, measure: str, over: Sequence[str], workers: int) -> float:
        """Seconds from the start of the first worker of a sweep to the last row that it writes; of the processor, those
        of all processes by the number of workers."""
        with TemporaryDirectory() as folder:
            out = Path(folder, "results")
            changes = [word for each in over for word in ("--over", each)]
            command = [
                *(sys.executable, "-m", "sleepcast", "sweep", scenario, *changes, "--seeds", f"{runs}"),
                *("--seconds", f"{seconds:g}s", "--measure", measure, "--quiet", "--out", str(out)),
                *("--workers", f"{workers}"),
            ]
            process = begun(command, self.environment)
            began = first_worker(process)
            used = self.clock.end(process)
            ended = max(file.stat().st_mtime for file in out.rglob("*") if file.is_file())
            return used / workers if self.clock.cpu else ended - began


def first_worker(process: subprocess.Popen[bytes]) -> float:
    """Wait until a sweep has a worker; gives when, as `time.time()`. Where the system does not show processes, or none
    was seen, it is when the sweep itself began."""
    began, shown = time.time(), Path(f"/proc/{process.pid}/stat")
    while shown.exists() and shown.read_text().rpartition(")")[2].split()[0] != "Z":
        if any(b"multiprocessing" in command for command in commands_of(process.pid)):
            return time.time()
        time.sleep(POLL)
    return began


def commands_of(parent: int) -> Iterator[bytes]:
    """The command lines of its processes."""
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if int((folder / "stat").read_text().rpartition(")")[2].split()[1]) == parent:
                yield (folder / "cmdline").read_bytes()
        except OSError:  # it has just ended
            continue


@contextmanager
def before(folder: Path | None, clock: Clock) -> Iterator[Version]:
    """The release before: in `folder`, or else taken from the history of this repository for as long as it is needed.
    Raises MissingError."""
    if folder is not None:
        found = Version(RELEASE, folder, clock)
        found.check()
        yield found
        return
    with TemporaryDirectory() as made:
        with tarfile.open(fileobj=io.BytesIO(archive())) as files:
            files.extractall(made, filter="data")
        found = Version(RELEASE, Path(made), clock)
        found.check()
        yield found


def archive() -> bytes:
    """The files of the release before. Raises MissingError without a history that has it."""
    for commit in COMMITS:
        try:
            return subprocess.run(
                ["git", "archive", "--format=tar", commit, "src"], cwd=ROOT, capture_output=True, check=True
            ).stdout
        except (OSError, subprocess.CalledProcessError):
            continue
    raise MissingError(
        f"the history here has no {RELEASE} ({' or '.join(COMMITS)}): give a folder with it by --before FOLDER"
    )


@dataclass(frozen=True)
class Argos:
    """ARGoS, and the folder with the experiments that it does: N.argos has N robots and lasts for a minute. what:
    these experiments in words."""

    folder: Path | None
    clock: Clock = Clock()
    what: str = "its diffusion example"

    def experiment(self, robots: int) -> Path:
        """Raises MissingError without ARGoS or this experiment."""
        if which("argos3") is None or self.folder is None:
            raise MissingError(f"ARGoS takes argos3 on the PATH, and --argos FOLDER with {self.what}")
        file = self.folder / f"{robots}.argos"
        if not (file.is_file() and LENGTH.search(file.read_text())):
            raise MissingError(f'{file}: wanted an experiment of ARGoS with {robots} robots and length="60"')
        return file

    def process(self, robots: int, minutes: int = 1) -> float:
        """Seconds that a whole process takes which does so many simulated minutes. Raises MissingError."""
        file = self.experiment(robots)
        with TemporaryDirectory() as folder:
            longer = Path(folder, file.name)
            longer.write_text(LENGTH.sub(f'length="{60 * minutes}"', file.read_text()))
            return self.clock.of(["argos3", "-c", str(longer)], silent=True)

    def many(self, robots: int, runs: int, cores: int) -> tuple[float, list[float]]:
        """Seconds that so many processes take, as many at a time as there are cores, and what each of them took; of the
        processor, those of all by the number of cores."""
        self.experiment(robots)
        began = time.perf_counter()
        with ThreadPoolExecutor(cores) as pool:
            each = list(pool.map(lambda _: self.process(robots), range(runs)))
        return sum(each) / cores if self.clock.cpu else time.perf_counter() - began, each


@dataclass(frozen=True)
class Libraries:
    """Libraries that are compared with, in any of these Pythons."""

    pythons: Sequence[str]
    clock: Clock = Clock()
    _known: dict[str, str] = field(default_factory=dict)

    def asked(self, library: str, *arguments: str) -> Json:
        """What `benchmarks.worlds.with_LIBRARY` says. Raises MissingError if no Python has the library."""
        module = f"benchmarks.worlds.with_{library}"
        return asked(module, *arguments, *self.clock.options, python=self.python(library))

    def python(self, library: str) -> str:
        """The first Python that has it. Raises MissingError."""
        if library not in self._known:
            self._known[library] = python_with(library, self.pythons)
        return self._known[library]


def python_with(library: str, pythons: Sequence[str]) -> str:
    """The first of these Pythons that has the library. Raises MissingError."""
    look = f"import importlib.util as look, sys; sys.exit(look.find_spec({library!r}) is None)"
    for python in pythons:
        if subprocess.run([python, "-c", look], check=False).returncode == 0:
            return python
    raise MissingError(f"{library} is not installed: --rivals-python names a Python that has it")


def asked(
    module: str, *arguments: str, environment: Mapping[str, str] | None = None, python: str = sys.executable
) -> Json:
    """What a child says. Raises MissingError for one that fails, or says that something is missing."""
    try:
        found = child(module, *arguments, limit=LIMIT, environment=environment, python=python)
    except ChildError as error:
        raise MissingError(str(error)) from error
    if "missing" in found:
        raise MissingError(str(found["missing"]))
    return found
