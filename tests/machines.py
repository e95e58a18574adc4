"""The machines that this environment has: tests run on each of them."""

from __future__ import annotations

from importlib.util import find_spec

import pytest

from sleepcast.simulator.engine import choose

ALL = [choose(name) for name in ("numpy", *(["numba"] if find_spec("numba") is not None else []))]
MACHINES = [pytest.param(machine, id=machine.name) for machine in ALL]
