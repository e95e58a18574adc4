"""The seam between mind and body: what counts as a robot, and what a setpoint leaves alone."""

from __future__ import annotations

from math import isnan

from sleepcast.robot import Robot, Setpoint


class NoBrakes:
    """Everything that a robot has but `stop`."""

    model = None
    stopped = False

    def sense(self) -> None: ...

    def act(self, wanted: Setpoint) -> None: ...

    def release(self) -> None: ...

    def hold(self, still: bool) -> None: ...


class Brakes(NoBrakes):
    def stop(self) -> None: ...


def test_what_cannot_be_stopped_is_no_robot() -> None:
    assert not isinstance(NoBrakes(), Robot)
    assert isinstance(Brakes(), Robot)


def test_a_setpoint_leaves_alone_what_it_does_not_name() -> None:
    assert isnan(Setpoint(speed=1.0).turn_rate)
    assert isnan(Setpoint(turn_rate=1.0).speed)
