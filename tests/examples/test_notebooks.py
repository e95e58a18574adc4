"""The notebooks of examples/ run from their first to their last cell, in a real kernel, and show pictures."""

from __future__ import annotations

import importlib
import sys
from io import StringIO
from pathlib import Path

import pytest

from sleepcast.api import progress

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / "examples").glob("*.ipynb"))
LONGEST = 300
"""Seconds that a cell may take on a busy machine."""


@pytest.mark.filterwarnings("default")  # the kernel's own libraries are not ours to mend
@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_a_notebook_runs_and_shows_pictures(file: Path, tmp_path: Path) -> None:
    # Here, since the import takes seconds, and every process that runs tests collects this file.
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    notebook = nbformat.read(file, as_version=4)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert not any(cell.outputs for cell in cells), "it is kept without results"
    patience = {"timeout": LONGEST, "startup_timeout": LONGEST, "iopub_timeout": LONGEST}
    found = nbclient.NotebookClient(notebook, **patience, resources={"metadata": {"path": tmp_path}}).execute()
    shown = [output.get("data", {}) for cell in found.cells if cell.cell_type == "code" for output in cell.outputs]
    assert any("<svg" in data.get("text/html", "") for data in shown), "a fleet shows itself"
    assert any("image/png" in data for data in shown), "and a plot is drawn"


@pytest.mark.filterwarnings("default")  # as above
def test_bars_are_for_notebooks_not_for_whoever_starts_their_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    """Files had them as well where anything had loaded the kernel's library, as a program that runs notebooks does."""
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    look = "from sleepcast.api import progress; print(progress._somebody_sees())"
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(look)])
    found = nbclient.NotebookClient(notebook, timeout=LONGEST, startup_timeout=LONGEST).execute()
    assert [output.text for output in found.cells[0].outputs] == ["True\n"]
    importlib.import_module("ipykernel.iostream")
    monkeypatch.setattr(sys, "stderr", StringIO())
    assert not progress._somebody_sees()
