"""docs/howto/nomad.md: its files are what they claim to be, and its program of 1998 compiles and runs."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from clients.compiling import CLIENTS, workshop
from nomad.serving import LONGEST, serving
from sleepcast.nomad.world.building import nomad_world

PAGE = CLIENTS.parents[1] / "docs" / "howto" / "nomad.md"
TEXT = PAGE.read_text(encoding="utf-8")
SCENARIO = CLIENTS.parents[1] / "src" / "sleepcast" / "scenarios" / "stop"


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """A folder with the files of the page."""
    for name, text in re.findall(r"^```\w+ (\S+)\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL):
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def test_the_rules_on_the_page_are_those_of_the_file() -> None:
    shown = re.search(r"```lisp\n(.*?)```", TEXT, re.DOTALL)
    assert shown
    assert (CLIENTS.parent / "sleep" / "stop.sleep").read_text(encoding="utf-8").endswith(f"\n{shown[1]}")


def test_the_setup_and_the_world_can_be_used(files: Path) -> None:
    world = nomad_world(files / "boxes.txt", files / "laboratory.toml", 3)
    assert world.count == 3
    assert [len(corners) for corners in world.solids()] == [4, 3]
    ring = world.setup.robots.ring
    assert ring
    assert ring.crosstalk
    assert ring.crosstalk.chance == 0.5


def test_the_program_compiles_as_it_is_and_drives_until_something_is_near(files: Path) -> None:
    made = workshop(files, "native")
    source = (files / "sonars.c").read_text(encoding="utf-8")
    with serving(nomad_world(SCENARIO), speed=20.0) as served:
        (files / "sonars.c").write_text(source.replace("7019", str(served.port)), encoding="utf-8")
        program = made.program(files / "sonars.c", "-std=gnu89 -w")
        done = subprocess.run([program], capture_output=True, text=True, timeout=LONGEST, check=True)
    found = re.fullmatch(r"(\d+) inches from something, at (-?\d+), (-?\d+)\n", done.stdout)
    assert found, done
    assert 10 <= int(found[1]) <= 20
