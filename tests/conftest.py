"""How the whole suite runs.

Hypothesis searches the same examples every time in an ordinary run, fresh ones and more of them at night:
`python3 go.py test --hypothesis-profile nightly`. No deadline for an example, nor for finding one: a busy machine is no
bug, and what must be fast is measured in a test of its own. `python3 go.py test quick` searches few examples, and
leaves out the files of `SLOW`. Contracts shared by several test files say what differed, as tests do.
"""

import gc
import os
import signal
from collections.abc import Generator, Iterator, Set
from functools import cache
from itertools import accumulate
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

import families
from browsers import chromium, context, kept_chromium
from sleepcast.core.files import cache_folder
from slow import SLOW, WAITING

__all__ = ["chromium", "context", "kept_chromium"]

# Programs under test are stopped by Ctrl-C. They inherit what this process does at it, and where a shell runs the tests
# in the background, that is nothing.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

pytest.register_assert_rewrite("channel_contract", "sleepcast.testing.robot_contract", "language.cases")

BUSY = [HealthCheck.too_slow]
settings.register_profile(
    "ordinary", deadline=None, suppress_health_check=BUSY, max_examples=30, derandomize=True, print_blob=True
)
settings.register_profile("nightly", deadline=None, suppress_health_check=BUSY, max_examples=10_000, print_blob=True)
settings.register_profile("quick", settings.get_profile("ordinary"), max_examples=20)
settings.load_profile("ordinary")

# Homes are made up for tests; what is compiled, and what libraries know of this machine, is found there all the same.
os.environ["XDG_CACHE_HOME"] = str(cache_folder().parent)

TESTS = Path(__file__).parent

gc.disable()  # until all tests are collected


def pytest_addoption(parser: pytest.Parser) -> None:
    known = sorted(families.FAMILIES)
    parser.addoption("--counterparts", choices=known, help="only what runs the counterparts of this family")


def pytest_report_header(config: pytest.Config) -> str | None:
    """What is tried for a family, of which nothing may be missing that can be had for this computer."""
    if not (family := config.getoption("--counterparts")):
        return None
    if missing := [name for name, ours in families.members(family).items() if ours and not families.is_installed(name)]:
        raise pytest.UsageError(
            f"--counterparts {family}: {', '.join(missing)}: not installed here, see CONTRIBUTING.md"
        )
    return f"counterparts: {families.versions(family)}"


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave out slow files where a quick check is asked for, and what has no test of a family where that is."""
    quick = config.getoption("--hypothesis-profile") == "quick"
    if family := config.getoption("--counterparts"):
        files = collection_path.rglob("test_*.py") if collection_path.is_dir() else [collection_path]
        return (
            None
            if any(families.belongs(names, family) for file in files for names in families.named_in(file))
            else True
        )
    return True if quick and weight(collection_path) else None


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Let each of several processes begin with other files. All need all of them; in a new clone, where none is
    compiled yet, each then finds most of them compiled by the others, instead of all compiling the same at once."""
    report = yield
    if isinstance(collector, pytest.Directory):
        number = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
        start = len(report.result) * number // int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
        report.result = [*report.result[start:], *report.result[:start]]
    return report


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Order the files by their turns, alike in every process. Leave out what is for the night, unless the nightly
    profile is asked for."""
    when = turns({item.path for item in items})
    items.sort(key=lambda item: (when[item.path], item.path))
    keep_to_counterparts(config, items)
    if config.getoption("--hypothesis-profile") == "nightly":
        return
    skip = pytest.mark.skip(reason="for the night: --hypothesis-profile nightly runs it")
    for item in items:
        if item.get_closest_marker("nightly"):
            item.add_marker(skip)


def keep_to_counterparts(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Skip tests whose counterparts are not here, and leave out those that are for a family's run only (`alone`). In
    that, keep its tests, and skip only what none can have on this computer."""
    family = config.getoption("--counterparts")
    others = []
    for item in items:
        marks = list(item.iter_markers("counterpart"))
        names = {name for mark in marks for name in mark.args}
        if not families.belongs(names, family) if family else any(mark.kwargs.get("alone") for mark in marks):
            others.append(item)
            continue
        if missing := {name for name in names if not families.is_installed(name)}:
            reason = f"needs {', '.join(sorted(missing))}: go.py test counterparts {families.family_of(names)}"
            item.add_marker(pytest.mark.skip(reason=reason))
    if others:
        config.hook.pytest_deselected(items=others)
        items[:] = [item for item in items if item not in set(others)]


def pytest_collection_finish() -> None:
    """Ten thousand collected tests are kept to the end: the collector of garbage need not look at them each time. Nor
    once: to find what little garbage is among them takes most of a second in each process."""
    gc.freeze()
    gc.enable()
    gc.set_threshold(10_000, 10, 10)  # each search for garbage would begin anew with what tests hold meanwhile


def turns(files: Set[Path]) -> dict[Path, float]:
    """When the turn of each file is, from 0 to 1. Those that mostly wait and those that mostly compute are both spread
    over the whole run: if many waited at once, no process would compute. Each kind begins with its slowest, so that no
    process is left alone with one of them in the end."""
    found = dict[Path, float]()
    for waiting in (True, False):
        kind = [
            file
            for file in sorted(files, key=lambda file: (-weight(file), file))
            if (name_of(file) in WAITING) is waiting
        ]
        begins = [0, *accumulate(max(weight(file), 1) for file in kind)]
        found |= {file: begin / begins[-1] for file, begin in zip(kind, begins, strict=False)}
    return found


def name_of(file: Path) -> str:
    """What a test file is called in `slow.py`."""
    return file.relative_to(TESTS).as_posix() if file.is_relative_to(TESTS) else ""


@cache
def weight(path: Path) -> int:
    """Seconds that a test file takes, 0 if it is not slow."""
    return SLOW.get(name_of(path), 0)


@pytest.fixture(scope="module")
def rules_elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Native code goes into a folder of this module's, which makes up thousands of rules that nobody needs again. All
    other tests share the user's: kernels are compiled once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("caches")))
        yield
