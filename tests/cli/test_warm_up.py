"""A warm-up leaves nothing to be compiled in a tick."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from sleepcast.cli.headless import warm_up
from sleepcast.simulator.engine import choose
from small_worlds import scouts

SONARS = {"all at once": 'noise = "3%"', "in order": 'noise = "3%"\npause = "4ms"'}


@pytest.mark.parametrize("sonar", SONARS.values(), ids=SONARS.keys())
def test_what_a_tick_takes_is_compiled_beforehand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sonar: str) -> None:
    """Every kernel meets the same types in a warm-up as in a tick."""
    numba = pytest.importorskip("numba")
    from sleepcast.simulator import kernels, kernels_contact, kernels_firing, kernels_motion, kernels_sonar

    called: set[tuple[str, object]] = set()

    def listen(name: str, kernel: Callable[..., object]) -> Callable[..., object]:
        def call(*arguments: object) -> object:
            called.add((name, tuple(numba.typeof(argument) for argument in arguments)))
            return kernel(*arguments)

        return call

    for module in (kernels, kernels_contact, kernels_firing, kernels_motion, kernels_sonar):
        for name, kernel in vars(module).items():
            if hasattr(kernel, "signatures") and kernel.__module__ == module.__name__:
                monkeypatch.setattr(module, name, listen(name, kernel))
    rooms = ("[robots]\n", '[world.rooms]\nsize = "6m"\ndoor = "1.5m"\n\n[robots]\n')
    sim = scouts(tmp_path, ("count = 1\n", "count = 40\n"), rooms, more=sonar, machine=choose("numba", 1))
    warm_up(sim.scenario, 1)
    prepared = set(called)
    called.clear()
    sim.step()
    sim.sense()
    assert len(called) >= 8
    assert called <= prepared
