"""`sleepcast scenarios`: the gallery, and the page of each scenario."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sleepcast.cli import main
from sleepcast.simulator import find_scenario, scenario_names
from small_worlds import write


def run(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, str, str]:
    """The status and both streams of `sleepcast scenarios ARGUMENTS`, in this process."""
    status = main(["scenarios", *map(str, arguments)])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def test_the_gallery_has_a_line_for_each(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = run(capsys)
    assert (status, err) == (0, "")
    assert [line.split()[0] for line in out.splitlines()] == scenario_names()
    assert "bravo" in scenario_names()
    bravo = find_scenario("bravo")
    (line,) = [line for line in out.splitlines() if line.split()[0] == "bravo"]
    assert bravo.title in line
    assert "(1000 scouts)" in line


@pytest.mark.parametrize("name", scenario_names())
def test_a_page_tells_the_story_and_what_to_type(capsys: pytest.CaptureFixture[str], name: str) -> None:
    status, out, _ = run(capsys, name)
    scenario = find_scenario(name)
    assert status == 0
    assert out.startswith(f"{name}: {scenario.title}\n")
    assert " ".join(scenario.about.split()) in " ".join(out.split())
    for command in scenario.commands:
        assert " ".join(command.text.split()) in " ".join(out.split())
    assert f"sleepcast demo {name}" in out


def test_a_page_tells_of_lights_and_groups(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = run(capsys, "braitenberg")
    assert "the lamp: a light, seen as sFlag, sRange, sBearing\neyes: 20 of them, with myCaste 4\n" in out


def test_a_scenario_of_ones_own_has_a_page_too(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    write(tmp_path)
    status, out, _ = run(capsys, tmp_path)
    assert status == 0
    assert f"sleepcast demo {tmp_path}" in out


def test_json(capsys: pytest.CaptureFixture[str]) -> None:
    gallery = json.loads(run(capsys, "--json")[1])
    assert [each["name"] for each in gallery] == scenario_names()
    bravo = json.loads(run(capsys, "bravo", "--json")[1])
    assert bravo == next(each for each in gallery if each["name"] == "bravo")
    assert bravo["robots"] == 1000
    assert bravo["commands"][0]["text"].startswith("(WHEN (AND (< (DIST x y vessel_x vessel_y) 5mi)")


def test_an_unknown_name_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = run(capsys, "brvo")
    assert (status, out) == (2, "")
    assert err.startswith('no scenario "brvo" (did you mean bravo?)')
