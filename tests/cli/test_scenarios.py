"""`sleepcast scenarios`: the gallery, and the page of each scenario."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from packages import install
from sleepcast.cli import main
from sleepcast.simulator import find_scenario, scenario_names
from sleepcast.simulator.scenario.scenario import GALLERY
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


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where a package is installed that adds two scenarios, of which one is missing."""
    text = (GALLERY / "flood" / "scenario.toml").read_text(encoding="utf-8").replace("mission =", "# mission =")
    (tmp_path / "patrols" / "harbour").mkdir(parents=True)
    (tmp_path / "patrols" / "harbour" / "scenario.toml").write_text(text, encoding="utf-8")
    about = tmp_path / "patrols-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: patrols\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(
        "[sleepcast.scenarios]\nharbour = patrols.harbour\nlost = patrols.lost\nbravo = patrols.harbour\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def test_an_installed_package_adds_scenarios(installed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert find_scenario("harbour").path == installed / "patrols" / "harbour" / "scenario.toml"
    assert find_scenario("bravo").path.is_relative_to(GALLERY), "nobody replaces one of the gallery"
    assert main(["scenarios"]) == 0
    out, err = capsys.readouterr()
    assert "harbour" in [line.split()[0] for line in out.splitlines()]
    assert 'scenario "lost" cannot be found: its package patrols.lost has no scenario.toml' in err
    assert main(["scenarios", "lost"]) == 2
    assert main(["scenarios", "harbuor"]) == 2
    assert "did you mean harbour" in capsys.readouterr().err


def test_a_scenario_that_two_packages_add_is_told_with_both(
    installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Which of them runs would depend on the order in which they are found."""
    install(tmp_path / "other", monkeypatch, "ports", "[sleepcast.scenarios]\nharbour = ports.harbour\n")
    assert run(capsys, "harbour") == (
        2,
        "",
        'scenario "harbour" is added by ports and patrols: uninstall all but one of them\n',
    )


def test_a_package_of_a_scenario_may_do_anything_when_it_is_imported(
    installed: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delitem(sys.modules, "patrols", raising=False)
    (installed / "patrols" / "__init__.py").write_text("raise SystemExit(7)")
    status, _, err = run(capsys)
    assert status == 0
    assert 'scenario "harbour" cannot be found: its package patrols.harbour fails: 7' in err
