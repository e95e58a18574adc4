"""`sim:`, a body in the simulator for one node: the entry point of that scheme."""

from __future__ import annotations

from sleepcast.bridges import BridgedBody, Opening
from sleepcast.core.clock import WallClock
from sleepcast.core.counter_rng import key
from sleepcast.robot import Limits
from sleepcast.simulator import (
    Changes,
    FlyingBody,
    SafetyLimits,
    Simulator,
    SingleRobot,
    choose,
    find_scenario,
    limited,
)

SCENARIO = "bravo"
"""Whose world a body has unless it says otherwise."""


class LoneBody(SingleRobot):
    """Alone in its world, which stands still a second after its mind has looked last."""

    __slots__ = ()

    def narrow(self, limits: Limits) -> None:
        """They are kept already: by the scenario's robot, and by `SafetyLimits` in each tick."""

    def begin(self) -> None:
        """Its time goes with the looks of its mind."""


class FlyingLoneBody(LoneBody, FlyingBody):
    """The same where robots fly."""

    __slots__ = ()


BridgedBody.register(LoneBody)


def open_body(uri: str, opening: Opening) -> LoneBody:
    """A body alone in the world of a scenario: `sim`, `sim:maze`. Raises MisuseError for a scenario that there is
    not."""
    name = uri.partition(":")[2] or SCENARIO
    scenario = limited(find_scenario(name, Changes(1, None, True)), opening.limits)
    # Another one begins elsewhere; for one body no kernels need be loaded.
    simulator = Simulator(scenario, key(opening.seed, "alone", opening.number) >> 1, choose("numpy", 1))
    clock = None if opening.in_step else WallClock()
    kind = LoneBody if simulator.bodies.flight is None else FlyingLoneBody
    return kind(simulator, clock, SafetyLimits(simulator, opening.limits))
