"""The playground of the documentation's site (docs/site/playground.py) gives what the language's page says."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType

import pytest

from test_docs import REFERENCE, blocks_of, joined

ROOT = Path(__file__).resolve().parent.parent
SITE = ROOT / "docs" / "site"
READINGS = json.loads((SITE / "static" / "playground" / "readings.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def playground() -> ModuleType:
    spec = importlib.util.spec_from_file_location("playground", SITE / "playground.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def ask(playground: ModuleType, text: str, readings: Mapping[str, str] = READINGS) -> dict[str, object]:
    found = json.loads(playground.answer(text, readings))
    assert isinstance(found, dict)
    return found


def test_every_reading_has_its_field(playground: ModuleType) -> None:
    assert list(READINGS) == [sensor.name for sensor in playground.SENSORS]


def test_what_the_robot_would_do_is_told_and_how_its_value_came(playground: ModuleType) -> None:
    found = ask(playground, "(WHEN (AND (< (DIST x y vessel_x vessel_y) 5mi) (> fuel 50%)) (JOIN bravo))")
    assert (found["value"], found["deeds"], found["said"]) == ("1", ["(JOIN bravo)"], [])
    far = ask(playground, "(WHEN (< (DIST x y vessel_x vessel_y) 1mi) (JOIN bravo))")
    assert (far["value"], far["deeds"]) == ("0", [])
    assert "not for this robot: (DIST x y vessel_x vessel_y)" in str(far["course"])


def test_what_is_wrong_is_shown_with_its_place(playground: ModuleType) -> None:
    assert ask(playground, "(SQRT 1 2)") == {
        "error": "error: (SQRT x) takes 1 argument, got 2 at 1:1\n  (SQRT 1 2)\n  ^^^^^^^^^^"
    }
    assert "is not closed" in str(ask(playground, "(+ 1")["error"])
    assert 'fuel: "full" is no number' in str(ask(playground, "1", {"fuel": "full"})["error"])
    for readings in ({"fuel": "12kg"}, {"x": "3s"}):
        assert "does not fit" in str(ask(playground, "1", readings)["error"])
    fault = ask(playground, "(VM 1m/s (SONAR 4))")
    assert (fault["value"], fault["deeds"]) == ("UNKNOWN", [])
    assert fault["said"] == ["fault: VM is not asked: an argument is unknown in (VM 1m/s (SONAR 4))"]


def test_the_examples_of_the_page_give_what_they_say(playground: ModuleType) -> None:
    """The first of each block: those below it may need what it has done, which the playground does not keep."""
    count = 0
    for block in blocks_of(REFERENCE):
        readings: dict[str, str] = {}
        for where, line in joined(block) if block.sort == "sleep" else ():
            if line.startswith(":set "):
                readings |= [line.removeprefix(":set ").split("=")]
                continue
            text, _, rest = line.partition(" => ")
            value = rest.split(" ; ")[0]
            if rest and not value.startswith(("~", "error")):
                assert ask(playground, text, readings).get("value") == value, where
                count += 1
            break
    assert count > 20


def test_a_browsers_python_needs_the_standard_library_only() -> None:
    start = f"import sys; sys.path[:0] = [{str(SITE)!r}, {str(ROOT / 'src')!r}]; import playground"
    done = subprocess.run([sys.executable, "-I", "-S", "-c", start], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
