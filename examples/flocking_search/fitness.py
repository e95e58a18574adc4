"""What searches for good numbers make as large as they can: how well copters fly at one moment, from 0 to 1.

sleepcast sweep examples/flocking_search/search.toml --trust --out found
"""

from __future__ import annotations

from sleepcast.api.fleet import SimulatedFleet
from sleepcast.experiments.measures import read_measure

ALIKE = read_measure("velocity_correlation 60m (= crashed 0)")
SPEED = read_measure("ground_speed (= crashed 0)")
FLYING = read_measure("share (= crashed 0)")
CLOSE = read_measure("close_pairs 3m (= crashed 0)")
OUTSIDE = read_measure("mean (MAX 0 (- (TO-EDGE arena)))")
MUCH = 2.0
"""m beyond the walls on average that count half."""


def safe(fleet: SimulatedFleet) -> float:
    """The product of how near the speed is to the wanted one, of the share that has not crashed, and of how well all
    keep within the arena; 0 while two of them are nearer to each other than 3 m."""
    pace = next(each.value for each in fleet.swarm.simulator.scenario.constants if each.name == "PACE")
    if not FLYING(fleet) or CLOSE(fleet) > 0.0:
        return 0.0
    return min(1.0, SPEED(fleet) / pace) * FLYING(fleet) / (1.0 + OUTSIDE(fleet) / MUCH)


def flocking(fleet: SimulatedFleet) -> float:
    """The same times the correlation of velocities."""
    return max(0.0, ALIKE(fleet)) * good if (good := safe(fleet)) else 0.0
