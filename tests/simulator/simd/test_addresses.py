"""Kernels by their addresses: made once, kept for other processes, and there without numba."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from sleepcast.core.code_cache import target_machine
from sleepcast.simulator.simd import addresses
from sleepcast.simulator.simd.cached import ENTRIES, identity

ASK = """
import sys
from sleepcast.simulator.simd.addresses import addresses
print(sorted(addresses()), "numba" in sys.modules)
"""


def asked() -> str:
    """What another process says."""
    done = subprocess.run([sys.executable, "-c", ASK], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_another_process_needs_no_numba(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor does it take code that is damaged."""
    pytest.importorskip("numba")
    assert addresses.addresses()
    code = ENTRIES.load(f"{identity()}-by-address")
    assert code
    names = sorted(addresses.SIGNATURES)
    assert asked() == f"{names} False"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert ENTRIES.save(f"{identity()}-by-address", code)
    assert asked() == f"{names} False"
    (file,) = tmp_path.rglob("*-by-address")
    file.write_bytes(file.read_bytes()[:-7])
    assert ENTRIES.load(f"{identity()}-by-address") is None


def test_without_numba_there_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    found = find_spec
    monkeypatch.setattr(addresses, "find_spec", lambda name: None if name == "numba" else found(name))
    assert addresses._loaded.__wrapped__(False) is None


def test_code_that_calls_what_is_not_in_every_process_is_none() -> None:
    """Linking it would end the process."""
    binding = pytest.importorskip("llvmlite.binding")
    target = target_machine()
    for called, usable in (("memset", True), ("nowhere", False)):
        text = f"declare ptr @{called}(ptr)\ndefine ptr @f(ptr %a) {{\n%b = call ptr @{called}(ptr %a)\nret ptr %b\n}}"
        assert (addresses._object(binding.parse_assembly(text), target) is not None) == usable
