"""`findings/run`, and the form that all findings have. What they find is tried by hand: it needs the network."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

FINDINGS = Path(__file__).resolve().parent.parent / "findings"
SCRIPTS = sorted(FINDINGS.glob("*.sh"))
COUNTERPARTS = FINDINGS.parent / "docs" / "counterparts.md"

PIN = re.compile(r"[a-z0-9-](?:==|@)\$?\d|[=@]\$version")
"""A version that is named: `mcap==1.6.0`, `node-cot@14.23.2`, or the variable that holds it."""


@pytest.fixture
def few(tmp_path: Path) -> Path:
    """A folder of findings, one of each kind of end, with the real `run`."""
    shutil.copy(FINDINGS / "run", tmp_path)
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
