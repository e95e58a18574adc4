"""`findings/run`, the form that all findings have, and, where their packages are installed, what they find.

By hand a finding installs the versions that it names. Here it finds those of the environment instead: of a family of
counterparts, in the versions of the lock or in the newest ones.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import families

SCRIPTS = sorted(families.FINDINGS.glob("*.sh"))

PIN = re.compile(r"[a-z0-9-](?:==|@)\$?\d|[=@]\$version")
"""A version that is named: `mcap==1.6.0`, `node-cot@14.23.2`, or the variable that holds it."""


@pytest.fixture
def few(tmp_path: Path) -> Path:
    """A folder of findings, one of each kind of end, with the real `run`."""
    shutil.copy(families.FINDINGS / "run", tmp_path)
    ends = {
        "same": "echo 'tool 1.0'",
        "changed": "echo 'tool 1.0'; echo 'It does otherwise now.' >&2; exit 1",
        "unreached": "echo 'no network' >&2; exit 1",
    }
    for name, text in ends.items():
        (tmp_path / f"{name}.sh").write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    return tmp_path


def run(folder: Path, *names: str) -> tuple[int, str, str]:
    done = subprocess.run(["sh", str(folder / "run"), *names], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout, done.stderr


def test_all_findings_are_run_and_each_end_is_named(few: Path) -> None:
    status, told, _ = run(few)
    assert status == 1
    assert told.splitlines() == [
        "otherwise now   changed.sh",
        "    tool 1.0",
        "    It does otherwise now.",
        "as it was       same.sh",
        "not tried       unreached.sh",
        "    no network",
    ]


def test_those_that_are_named_are_run(few: Path) -> None:
    assert run(few, "same") == (0, "as it was       same.sh\n", "")
    assert run(few, "findings/same.sh", "unreached")[0] == 1


def test_a_name_that_is_none_is_refused_before_anything_runs(few: Path) -> None:
    status, told, error = run(few, "same", "other")
    assert (status, told) == (2, "")
    assert "there is no other.sh in" in error


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_a_finding_has_the_form(script: Path) -> None:
    text = script.read_text(encoding="utf-8")
    first, second, *_ = text.splitlines()
    head = " ".join(text.partition("\nset -eu\n")[0].replace("\n#", " ").split())
    assert first == "#!/bin/sh"
    assert second.startswith("# ")
    assert second.endswith(".")
    for part in ("othing of sleepcast runs", "s of ", "Ends with 1 if"):
        assert part in head, part
    assert "trap 'rm -rf \"$folder\"' EXIT" in text, "it works in a temporary folder"
    assert PIN.search(text), "packages are pinned"
    assert text.endswith('cmp -s found wanted || { echo "It does otherwise now." >&2; exit 1; }\n')
    assert script.stat().st_mode & 0o111 == 0o111


ABOUT = [
    pytest.param(script, marks=pytest.mark.counterpart(families.pinned_by(script)[0], alone=True), id=script.stem)
    for script in SCRIPTS
    if families.family_of(set(families.pinned_by(script)[:1]))
]

VENV = """#!/bin/sh
[ "$1 $2" = "-m venv" ] || exec "{python}" "$@"
mkdir -p "$3/bin" && cd "$3/bin" && ln -s "{folder}"/* . && rm -f pip python python3
printf '#!/bin/sh\\nexec "{python}" "$@"\\n' > python
printf '#!/bin/sh\\n' > pip
chmod +x python pip
"""
"""Python, which makes environments that hold what its own one holds; pip leaves them as they are."""

NPM = """#!/bin/sh
[ "$1" != install ] || ln -s "{modules}" node_modules
"""


@pytest.mark.parametrize("script", ABOUT)
def test_a_finding_is_as_it_was(script: Path, tmp_path: Path) -> None:
    about = families.pinned_by(script)[0]
    python = Path(str(families.ROS) if about.startswith("ros-") else sys.executable)
    for name, text in (
        ("python3", VENV.format(python=python, folder=python.parent)),
        ("npm", NPM.format(modules=families.NODE_MODULES)),
    ):
        (tmp_path / name).write_text(text, encoding="utf-8")
        (tmp_path / name).chmod(0o755)
    changed = {"PATH": f"{tmp_path}:{os.environ['PATH']}", "PYTHON": str(tmp_path / "python3")}
    done = subprocess.run(
        ["sh", str(script)], env={**os.environ, **changed}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
