"""Which machine computes bodies."""

from __future__ import annotations

from pathlib import Path

import pytest

from sleepcast.core.errors import MisuseError
from sleepcast.simulator.engine import choose, has_numba


@pytest.mark.skipif(not has_numba(), reason="numba is not installed")
def test_a_folder_with_settings_for_numba_compiles_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What it would compile is kept for all folders."""
    (tmp_path / ".numba_config.yaml").write_text("opt: 0\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MisuseError, match=r"\.numba_config\.yaml lies in this folder"):
        choose()
    assert choose("numpy").name == "numpy"
