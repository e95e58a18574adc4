"""Compiling before anybody waits, and doing without."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from cli.calling import called
from sleepcast.cli import main
from sleepcast.core.extras import installing
from sleepcast.simulator import KERNELS, kernel_count, scenario_names

MISSES = """
import sys
from sleepcast.api.assembly import assemble, warm_up
from sleepcast.simulator import Changes, find_scenario, scenario_names

changes = {"crowd": Changes(robots=6_000), "stop": Changes(), "calibrate": Changes(), "rehearsal": Changes()}
for name in scenario_names():
    scenario = find_scenario(name, changes.get(name, Changes(robots=60)))
    warm_up(scenario, 2)
    swarm, _ = assemble(scenario, None, mission=True, threads=2)
    for _ in range(3):
        swarm.step()
for name, module in sys.modules.items():
    if name.startswith("sleepcast.simulator") and ".kernels" in name:
        for kernel in vars(module).values():
            if hasattr(kernel, "stats") and sum(kernel.stats.cache_misses.values()):
                print(name, kernel.__name__, dict(kernel.stats.cache_misses))
"""


def test_after_it_no_scenario_compiles_anything() -> None:
    pytest.importorskip("numba")
    done = called("prepare", "--json")
    assert done.status == 0, done.err
    found = json.loads(done.out)
    assert "crowd" in found["scenarios"]
    assert Path(found["folder"]).is_dir()
    assert kernel_count() >= KERNELS  # worlds of other tests may have needed more
    ran = subprocess.run([sys.executable, "-c", MISSES], capture_output=True, text=True, check=False)
    assert (ran.stdout, ran.stderr) == ("", "")
    again = called("prepare", "--quiet")
    assert f"{len(scenario_names())} scenarios are ready to start" in again.out
    assert again.err == ""


def test_where_nothing_can_be_kept_it_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("numba")
    (tmp_path / "file").write_text("where the folders should be")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "file"))
    monkeypatch.setattr("sleepcast.simulator.scenario_names", lambda: ["bravo"])
    assert main(["prepare"]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert "compiled code can be kept neither in " in err


@pytest.fixture(params=[("numba", "llvmlite"), ("llvmlite",)], ids=" ".join)
def without_numba(request: pytest.FixtureRequest, tmp_path: Path) -> dict[str, str]:
    """An environment in which these cannot be imported, and so numba cannot; there may be kernels that were kept."""
    hidden = "".join(f"sys.modules[{each!r}] = None\n" for each in request.param)
    (tmp_path / "sitecustomize.py").write_text(f"import sys\n{hidden}")
    return {**os.environ, "PYTHONPATH": str(tmp_path)}


def test_without_numba_everything_works_and_says_once_how_to_get_it(without_numba: dict[str, str]) -> None:
    run = [sys.executable, "-m", "sleepcast"]
    options = ("--robots", "20", "--seconds", "1", "--json")
    done = subprocess.run(
        [*run, "run", "crowd", *options], env=without_numba, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["robots"] == 20
    without = f"numba is not installed, so simulations run several times slower; to install it: {installing('fast')}"
    assert done.stderr == f"{without}\n"
    done = subprocess.run([*run, "prepare"], env=without_numba, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == f"there is nothing to compile: {without}\n"
