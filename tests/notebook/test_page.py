"""The page as one text."""

from __future__ import annotations

import re

from sleepcast.notebook.page import bundle


def test_imports_become_constants_under_the_names_by_which_they_were_taken_in() -> None:
    text = bundle()
    constants = re.findall(r"^const \{ (.*) \} = module_\w+;$", text, re.MULTILINE)
    names = [name for constant in constants for name in constant.split(", ")]
    assert "font: fontOf" in names
    assert all(re.fullmatch(r"\w+(: \w+)?", name) for name in names)
    assert not re.search(r"^(?:import|export)\b", text, re.MULTILINE)
