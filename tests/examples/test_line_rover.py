"""The example of a bridge is installed, passes the contract, and is found by its scheme."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from installing import install

pytest.importorskip("hatchling")

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "line_rover"
SCHEME = "from sleepcast.bridges import open_robot; open_robot('line://127.0.0.1:9?x=1')"


def test_the_installed_package_passes_the_contract_of_every_bridge(tmp_path: Path) -> None:
    install(EXAMPLE, tmp_path)
    env = {**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
    contract = tmp_path / "source" / "line_rover" / "test_line_rover.py"
    for module in ("line_rover.py", "rover.py"):
        contract.with_name(module).unlink()  # what is tested is what was installed
    test = (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", os.devnull, contract)
    done = subprocess.run(test, cwd=tmp_path, env=env, capture_output=True, text=True, timeout=120)
    assert "17 passed" in done.stdout, done.stdout + done.stderr
    opened = subprocess.run([sys.executable, "-c", SCHEME], cwd=tmp_path, env=env, capture_output=True, text=True)
    assert "there is no setting 'x'" in opened.stderr
