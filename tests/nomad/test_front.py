"""What programs of other people import stays where it was when the Nomads became a plug-in."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module

import pytest

CLIENT = ("Kind", "LostError", "Nomad", "NomadError", "Pose", "RefusedError", "RequestError", "Stamp", "State")
SERVER = (
    *("DEFAULT_PORT", "Nserver", "RealAddress", "RobotWindow", "ServerError", "ServerPace", "SimulatedRobot", "Sketch"),
    *("Windows", "listening_places", "own_addresses", "real_robot", "unheard"),
)


@pytest.mark.parametrize(("module", "names"), [("sleepcast.nomad.client", CLIENT), ("sleepcast.nomad", SERVER)])
def test_names_that_programs_import(module: str, names: tuple[str, ...]) -> None:
    front = import_module(module)
    assert sorted(front.__all__) == sorted(names)
    assert all(hasattr(front, name) for name in names)
    with pytest.raises(AttributeError):
        front.nothing  # noqa: B018  # to read it is the test


def test_a_client_loads_no_server() -> None:
    program = "import sys, sleepcast.nomad.client; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.split()
    assert not {"asyncio", "numpy", "click", "sleepcast.nomad.server", "sleepcast.console"} & set(loaded)
