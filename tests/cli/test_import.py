"""`import` as a person meets it: a folder that runs, and what is missing in it."""

from __future__ import annotations

import json
from pathlib import Path

from cli.calling import called_warm

WORLD = (
    'define rover position ( size [0.4 0.3 0.2] )\nrover ( name "ada" pose [ 1 1 0 90 ] )\nblender ( pose [0 0 0 0] )\n'
)


def test_a_world_runs_and_what_is_missing_is_said(tmp_path: Path) -> None:
    (tmp_path / "room.world").write_text(WORLD)
    made = str(tmp_path / "made")
    done = called_warm("import", str(tmp_path / "room.world"), "--into", made)
    assert (done.status, done.out) == (0, f"{made}: 1 robot; start it with: sleepcast run {made} --page\n")
    assert "missing or otherwise than in room.world:\n  blender: no model of this name is defined" in done.err
    run = called_warm("run", made, "--seconds", "1", "--json")
    assert (run.status, json.loads(run.out)["robots"]) == (0, 1)
    again = called_warm("import", str(tmp_path / "room.world"), "--into", made)
    assert (again.status, "is there already" in again.err) == (2, True)


def test_scripts_read_it_as_json(tmp_path: Path) -> None:
    (tmp_path / "room.world").write_text(WORLD)
    done = called_warm("import", str(tmp_path / "room.world"), "--into", str(tmp_path / "made"), "--json")
    outcome = json.loads(done.out)
    assert (outcome["robots"], outcome["left_out"]) == (1, ["blender: no model of this name is defined"])


def test_a_missing_file_is_a_sentence(tmp_path: Path) -> None:
    done = called_warm("import", str(tmp_path / "lost.argos"))
    assert (done.status, done.out) == (2, "")
    assert "lost.argos: cannot be read: No such file or directory" in done.err
