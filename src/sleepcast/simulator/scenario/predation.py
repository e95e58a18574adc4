"""Robots that eat others, as a scenario file describes them, and the sensor that tells them what they have eaten."""

from __future__ import annotations

from sleepcast.core.model import Quantity
from sleepcast.core.records import dataclass
from sleepcast.core.settings import Table
from sleepcast.core.units import LENGTH
from sleepcast.simulator.scenario.robot_settings import LEAST, MAX_WORLD

EATEN = "eaten"
"""The sensor that says how many robots this one ate in the last tick."""


@dataclass(frozen=True, slots=True)
class PredationModel:
    """How robots eat others.

    reach: the farthest at which one is caught, m from centre to centre
    cell: side of the patches where only those on the same one are caught, m; 0 without patches
    """

    reach: float
    cell: float = 0.0


def read_predation(root: Table, *, gone: bool) -> PredationModel | None:
    """The table `[predation]`, None if there is none. gone: whether robots may go during a run."""
    if not root.has("predation"):
        return None
    with root.table("predation") as table:
        if not gone:
            raise root.error(
                "predation", "who is eaten is gone: say hatch = true in [robots], with which robots may go"
            )
        if not root.has("neighbours"):
            raise root.error("predation", "robots eat those that they sense: a table [neighbours] lets them")
        cell = table.number("cell", LENGTH, low=LEAST, high=MAX_WORLD) if table.has("cell") else 0.0
        return PredationModel(table.number("reach", LENGTH, low=LEAST, high=MAX_WORLD), cell)


def predation_sensors(model: PredationModel | None) -> tuple[Quantity, ...]:
    """The sensor of robots that eat others."""
    return () if model is None else (Quantity(EATEN, "", 0.0, 1.0, doc="robots that this one ate in the last tick"),)
