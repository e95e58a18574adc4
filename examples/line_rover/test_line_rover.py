"""The contract of sleepcast, on a rover in this process whose time passes in the test only."""

import pytest
from line_rover import LineRover
from rover import Rover

from sleepcast.core.clock import ManualClock
from sleepcast.testing.robot_contract import BridgeContract, BridgeRig


class FakeLine:
    """A way to a rover that can be cut."""

    def __init__(self) -> None:
        self.rover, self.whole = Rover(), True

    def open(self) -> None:
        if not self.whole:
            raise ConnectionRefusedError("nobody listens")

    def ask(self, line: str) -> str:
        self.open()
        return self.rover.answer(line)

    def close(self) -> None:
        pass


class TestLineRover(BridgeContract):
    @pytest.fixture
    def rig(self) -> BridgeRig:
        line, clock = FakeLine(), ManualClock()

        def cut() -> None:
            line.whole = False

        def mend() -> None:
            line.whole, line.rover = True, Rover()  # it has been started anew

        return BridgeRig(
            LineRover(line, clock=clock), clock, lambda s: line.rover.advance(s), cut, mend, resolution=0.001
        )
