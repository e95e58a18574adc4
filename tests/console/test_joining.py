"""The page's modules and style sheets as two files."""

from __future__ import annotations

import re
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from sleepcast.console import joining
from sleepcast.console.joining import joined_modules, names, read, text_for, with_joined_styles


def test_imports_become_constants_under_the_names_by_which_they_were_taken_in() -> None:
    text = joined_modules()
    constants = re.findall(r"^const \{ (.*) \} = take\(\"\w+\"\);$", text, re.MULTILINE)
    taken = [name for constant in constants for name in constant.split(", ")]
    assert "font: fontOf" in taken
    assert all(re.fullmatch(r"\w+(: \w+)?", name) for name in taken)
    assert re.findall(r"^(?:import|export)\b.*", text, re.MULTILINE) == [
        "export const take = (name) => (made[name] ??= makers[name]());"
    ]


def test_no_module_needs_itself() -> None:
    needs = {
        name: re.findall(r'^import .* from "\./(\w+)\.js";$', read(f"{name}.js"), re.MULTILINE) for name in names()
    }
    assert list(TopologicalSorter(needs).static_order())[-1] == "main"
    assert "enter" not in needs


def test_a_module_can_be_had_at_its_own_address() -> None:
    assert text_for("spread.js") == (
        'import { take } from "./joined.js";\nexport const { drawSpread } = take("spread");\n'
    )
    for alone in ("enter.js", "experiment/main.js", "icon.svg", "nothing.js"):
        assert text_for(alone) is None


def test_another_form_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "odd.js").write_text("export default class {}\n")
    monkeypatch.setattr(joining, "STATIC", tmp_path)
    with pytest.raises(ValueError, match=r"odd\.js: 'export default class \{\}' is not a form that can be joined"):
        joined_modules()


def test_sheets_stay_in_their_order() -> None:
    page = read("index.html")
    sheets = re.findall(r'href="static/([\w/.]+css)"', page)
    last = sheets.pop()  # which comes after those of packages
    joined = with_joined_styles(page)
    assert re.findall(r'href="static/([\w/.]+css)"', joined) == ["joined.css", last]
    other = read("experiment/index.html")
    assert with_joined_styles(other) == other, "a page with other sheets"
    assert text_for("joined.css") == "".join(read(sheet) for sheet in sheets)
