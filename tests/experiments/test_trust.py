"""Plans and results of others are looked at, not run; what somebody calls his own is run without a word more."""

from __future__ import annotations

import io
import os
import shutil
import sys
from collections.abc import Iterable, Iterator
from contextlib import nullcontext
from pathlib import Path

import pytest

import sleepcast as sc
from cli.calling import called
from sleepcast.cli import main
from sleepcast.cli.sweep import let_programs_run, written_in
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.experiments import run
from sleepcast.experiments.live import live_measures
from sleepcast.experiments.measures import read_measure
from sleepcast.experiments.plan import Experiment, PlannedRun, experiment_of, read_experiment
from sleepcast.experiments.results import Results, RunResult
from sleepcast.experiments.run import Workers, do
from sleepcast.experiments.trust import is_own, make_own, programs

PLAN = 'scenario = "crowd"\nseconds = "0.2s"\n[over]\nrobots.count = [5]\n[measures]\nspread = "loud.spread"\n'
LOUD = "from pathlib import Path\nPath(__file__).with_suffix('.ran').touch()\ndef spread(fleet):\n    return 3.0\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with a plan, and a module that leaves a mark when it is imported."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    monkeypatch.setattr(sys, "path", [*sys.path])
    place = tmp_path / "stranger"
    place.mkdir()
    (place / "experiment.toml").write_text(PLAN)
    (place / "loud.py").write_text(LOUD)
    monkeypatch.chdir(place)
    yield place
    sys.modules.pop("loud", None)


def ran(folder: Path) -> bool:
    return (folder / "loud.ran").exists()


def test_what_a_plan_would_run_is_found_without_importing_it(folder: Path) -> None:
    (folder / "package").mkdir()
    for file in ("package/__init__.py", "package/inside.py"):
        (folder / file).write_text(LOUD)
    text = PLAN.replace("[over]", 'until = "package.inside.far >= 1"\n[over]') + 'mean = "mean x"\npid = "os.getpid"\n'
    found = programs(read_experiment(folder / "experiment.toml", text), [folder])
    assert [(each.function, each.file) for each in found] == [
        ("loud.spread", folder / "loud.py"),
        ("os.getpid", None),
        ("package.inside.far", folder / "package" / "inside.py"),
    ]
    assert not list(folder.rglob("*.ran"))


@pytest.mark.parametrize("first", ["", "import this\n"], ids=["package without a file", "package"])
def test_a_module_is_found_where_python_would(folder: Path, monkeypatch: pytest.MonkeyPatch, first: str) -> None:
    for place in (folder / "outer" / "inner", folder.parent / "elsewhere" / "outer"):  # a package before a mere folder
        place.mkdir(parents=True)
    (folder / "outer" / "inner" / "deep.py").write_text(LOUD)
    if first:
        (folder / "outer" / "__init__.py").write_text(first)
        monkeypatch.syspath_prepend(str(folder.parent / "elsewhere"))
    experiment = experiment_of("crowd", measures=["outer.inner.deep.spread"])
    assert [each.file for each in programs(experiment, [folder])] == [folder / "outer" / "inner" / "deep.py"]


def test_measures_in_python_are_refused_unless_they_are_asked_for() -> None:
    with pytest.raises(MisuseError, match="function in Python, and what comes from others is not run"):
        read_measure("os.getpid")
    assert callable(read_measure("os.getpid", own=True))
    with pytest.raises(MisuseError, match="no measure"):
        read_measure("lengthy")


def test_a_plan_of_nobody_known_is_not_run(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sweep", "experiment.toml", "--out", "found"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert said[0] == f"this sweep runs programs: loud.spread of {folder / 'loud.py'}"
    assert "add --trust" in said[1]
    assert not ran(folder)
    assert not (folder / "found").exists()


def test_trust_is_remembered_for_plan_and_results_but_not_for_a_copy(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Here(Workers):
        """Does runs in this process: that workers find modules is tried elsewhere, and a process costs seconds."""

        def __init__(self, experiment: Experiment, count: int, limit: float) -> None:
            super().__init__(experiment, 0, limit)
            self._wanted = experiment

        def map(self, runs: Iterable[PlannedRun]) -> Iterator[list[RunResult]]:
            return ([do(self._wanted, each)] for each in runs)

    monkeypatch.setattr(run, "Workers", Here)
    sweep = ["sweep", "experiment.toml", "--out", "found", "--workers", "1", "--quiet"]
    assert main([*sweep, "--trust"]) == 0
    assert capsys.readouterr().err.startswith("this sweep runs programs: loud.spread of ")
    assert main(["sweep", "found"]) == 0
    (folder / "loud.ran").unlink()
    sys.modules.pop("loud", None)
    shutil.copytree(folder / "found", folder / "copy")
    for again in (["sweep", "copy"], ["sweep", "copy", "--verify"], ["sweep", "copy", "--page", "--no-browser"]):
        assert main(again) == 2
    assert not ran(folder)


def test_results_of_ones_own_run_no_module_of_the_folder_in_which_one_stands(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    results = tmp_path / "results"
    with Results(results, read_experiment(folder / "experiment.toml")):
        make_own(results)
    for again in (["sweep", str(results)], ["sweep", str(results), "--verify"]):
        assert main(again) == 2
        assert f"{folder} may be anybody's" in capsys.readouterr().err
    assert let_programs_run(read_experiment(results / "experiment.toml"), results, trusted=True)
    assert is_own(folder)


def test_who_will_be_asked_again_hears_why(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    os.chmod(folder / "loud.py", 0o666)
    plan = folder / "experiment.toml"
    assert let_programs_run(read_experiment(plan), plan, trusted=True)
    assert "asked again next time: others may write" in capsys.readouterr().err


@pytest.mark.parametrize("typed", ["y\n", "n\n"])
def test_a_person_at_the_terminal_is_asked(folder: Path, monkeypatch: pytest.MonkeyPatch, typed: str) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setattr(sys, "stdin", Terminal(typed))
    plan = read_experiment(folder / "experiment.toml")
    with nullcontext() if typed == "y\n" else pytest.raises(MisuseError, match="add --trust"):
        assert let_programs_run(plan, folder / "experiment.toml", trusted=False)
    assert is_own(folder) == (str(folder) in sys.path) == (typed == "y\n")


def test_what_was_typed_is_named_and_run(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    typed = experiment_of("crowd", measures=["loud.spread"])
    assert let_programs_run(typed, written_in("crowd"), trusted=False)
    assert capsys.readouterr().err == f"this sweep runs programs: loud.spread of {folder / 'loud.py'}\n"
    assert is_own(folder)  # so that the results, which name it too, can be gone on with
    typed.checked()
    assert ran(folder)


POND = """
format = 1
title = "A pond"
about = "Five boats."
seconds = "0.2s"
[world]
width = "50m"
height = "50m"
[robots]
type = "vehicle"
count = 5
limits = { speed = "1m/s", turn_rate = "90deg/s", acceleration = "1m/s2" }
body = { radius = "0.2m" }
"""


@pytest.fixture
def pond(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Somebody's scenario with its experiment and a module, and a person who stands elsewhere."""
    (folder / "scenario.toml").write_text(POND)
    (folder / "experiment.toml").write_text('scenario = "scenario.toml"\n[measures]\nspread = "loud.spread"\n')
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    return folder


@pytest.mark.parametrize("what", ["", "scenario.toml"])
def test_measures_are_found_beside_the_scenario(pond: Path, capsys: pytest.CaptureFixture[str], what: str) -> None:
    sweep = ["sweep", str(pond / what), "--measure", "loud.spread", "--out", "found", "--workers", "1", "--quiet"]
    assert main(sweep) == 2
    assert f"{pond} may be anybody's" in capsys.readouterr().err, "only the folder in which one stands is not asked for"
    assert not ran(pond)
    assert main([*sweep, "--trust"]) == 0
    assert (Path("found") / "experiment.toml").is_file()
    assert capsys.readouterr().err == f"this sweep runs programs: loud.spread of {pond / 'loud.py'}\n"


def test_measures_are_found_beside_the_plan_and_beside_the_results(pond: Path, tmp_path: Path) -> None:
    plan = pond / "experiment.toml"
    plan.write_text(PLAN)
    results = pond / "found"
    assert main(["sweep", str(plan), "--out", str(results), "--workers", "1", "--quiet", "--trust"]) == 0
    (pond / "loud.ran").unlink()
    assert main(["sweep", str(results), "--verify", "--workers", "1", "--quiet"]) == 0
    assert ran(pond)


def test_who_looks_for_a_module_in_vain_hears_where(pond: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for text in ("laud.spread", "loud.inner.spread"):
        assert main(["sweep", str(pond), "--measure", text, "--out", "found", "--quiet"]) == 2
        here, module = Path.cwd(), text.rpartition(".")[0]
        said = f"no module {module}: looked in {pond}, in {here}, and where this Python looks (sys.path)"
        assert said in capsys.readouterr().err
    assert not ran(pond)


def test_the_page_of_ones_own_scenario_takes_measures_beside_it(pond: Path) -> None:
    make_own(pond)
    with sc.open(pond) as fleet:
        ((_, _, read),) = live_measures(fleet, pond)
        assert read() == 3.0


@pytest.mark.parametrize("linked", ["loud.py", "package"])
def test_links_are_found_where_they_lie(pond: Path, tmp_path: Path, linked: str) -> None:
    (tmp_path / "far" / "package").mkdir(parents=True)
    for file in ("loud.py", "package/__init__.py"):
        (tmp_path / "far" / file).write_text(LOUD)
    (pond / "loud.py").unlink()
    (pond / linked).symlink_to(tmp_path / "far" / linked)
    text = f"{linked.removesuffix('.py')}.spread"
    sweep = ["sweep", str(pond), "--measure", text, "--out", "found", "--workers", "1", "--quiet"]
    assert main(sweep) == 2
    assert not list((tmp_path / "far").rglob("*.ran"))
    try:
        assert main([*sweep, "--trust"]) == 0
    finally:
        sys.modules.pop("package", None)


@pytest.mark.parametrize("open_to_all", ["package/__init__.py", "package/inside.py"])
def test_the_page_looks_who_may_write_to_the_files_that_it_would_run(pond: Path, open_to_all: str) -> None:
    (pond / "package").mkdir()
    for file in ("package/__init__.py", "package/inside.py"):
        (pond / file).write_text(LOUD)
    (pond / "experiment.toml").write_text('scenario = "scenario.toml"\n[measures]\nspread = "package.inside.spread"\n')
    make_own(pond)
    os.chmod(pond / open_to_all, 0o666)
    with sc.open(pond) as fleet:
        ((_, _, read),) = live_measures(fleet, pond)
        with pytest.raises(SleepcastError, match="not run"):
            read()
    assert not list(pond.rglob("*.ran"))


def test_a_folder_where_others_may_write_is_nobodys_own(folder: Path) -> None:
    make_own(folder)
    assert is_own(folder)
    os.chmod(folder, 0o777)
    assert not is_own(folder)
    os.chmod(folder, 0o755)
    os.chmod(folder / "loud.py", 0o666)
    assert not is_own(folder, [folder / "loud.py"])


@pytest.mark.parametrize("kept", ["", "[", "[" * 100_000, '{"a": 1}', "[1, null]", "\xff"])
def test_a_damaged_list_of_own_folders_trusts_nothing(folder: Path, tmp_path: Path, kept: str) -> None:
    file = tmp_path / "data" / "sleepcast" / "own-folders.json"
    file.parent.mkdir(parents=True)
    file.write_text(kept, encoding="latin-1")
    assert not is_own(folder)
    make_own(folder)
    assert is_own(folder)


def test_the_page_of_a_strangers_scenario_runs_none_of_its_measures(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(folder))
    with sc.open("crowd", robots=5) as fleet:
        ((_, _, read),) = live_measures(fleet, folder)
        with pytest.raises(SleepcastError, match="not run"):
            read()
        assert not ran(folder)
        make_own(folder)
        ((_, _, read),) = live_measures(fleet, folder)
        assert read() == 3.0


def test_nothing_is_imported_from_the_folder_in_which_the_command_starts(tmp_path: Path) -> None:
    """Neither by `python -m`, nor by its workers, which look for modules before anything is told to them."""
    for module in ("click.py", "msgspec.py", "struct.py", "multiprocessing.py"):
        (tmp_path / module).write_text(LOUD)
    for settings in (".env", "matplotlibrc", "sitecustomize.py"):
        (tmp_path / settings).write_text("raise SystemExit('read')\n")
    found = called(
        *("sweep", "crowd", "--over", "robots.count=5", "--seconds", "0.2s", "--measure", "mean x", "--out", "found"),
        *("--workers", "1", "--quiet"),
        folder=tmp_path,
    )
    assert (found.status, found.out) == (0, "1 of 1 runs done: found\n"), found.err
    assert not list(tmp_path.glob("*.ran"))
