"""The bodies of simulated robots, as the map shows what they sense."""

from __future__ import annotations

from math import atan2, hypot

import numpy as np

from sleepcast.console.sensing import BodyKind, BodyView
from sleepcast.simulator import Scenario, Simulator
from sleepcast.simulator.scenario.robot_settings import RobotSpec
from sleepcast.simulator.simd.formulas import wrap


def kind_of(scenario: Scenario, spec: RobotSpec) -> BodyKind:
    """What bodies of this kind have in this scenario."""
    senses = (("neighbours", scenario.neighbours), ("pings", scenario.pings))
    most = hypot(scenario.width, scenario.height)  # a circle that lies around everything tells nothing
    reaches = tuple((name, sense.reach) for name, sense in senses if sense is not None and sense.reach < most)
    ring = spec.ring
    if ring is None:
        return BodyKind(spec.geometry.radius, spec.wheels is not None, reaches=reaches)
    return BodyKind(spec.geometry.radius, spec.wheels is not None, ring.count, ring.beam, ring.most, reaches)


def sensing_of(simulator: Simulator, robot: int) -> BodyView:
    """What the body of this robot senses now. Changes nothing that a run depends on."""
    bodies = simulator.bodies
    kind = kind_of(simulator.scenario, bodies.part_of(robot).scenario.robots)
    ranges = bodies.sonar_ranges([robot])[0, : kind.sonars].tolist() if kind.sonars else []
    x, y, heading = (float(column[robot]) for column in (bodies.x, bodies.y, bodies.heading))
    columns = (bodies.encoder_x, bodies.encoder_y, bodies.encoder_heading)
    believed_x, believed_y, believed_heading = (float(column[robot]) for column in columns)
    touched: tuple[float, ...] = ()
    if bodies.contact is not None and bodies.bumper[robot] > 0.0:
        away = atan2(float(bodies.hit_y[robot]), float(bodies.hit_x[robot])) - heading
        touched = (float(wrap(np.array([away]))[0]),)
    return kind.sensing((x, y, heading), (believed_x, believed_y, believed_heading), ranges, touched)
