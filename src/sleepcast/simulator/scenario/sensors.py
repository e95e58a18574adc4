"""The sensors of robots: names, units and ranges, in the order of a reading's values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf, pi

from sleepcast.core.model import Quantity
from sleepcast.robot import FRESH, hovering
from sleepcast.simulator.scenario.fields import field_sensors
from sleepcast.simulator.scenario.flight import BATTERY, flight_sensors
from sleepcast.simulator.scenario.groups import value_quantities
from sleepcast.simulator.scenario.predation import predation_sensors
from sleepcast.simulator.scenario.robot_settings import SIDE_SPEED, Ring
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.scenario.signals import signal_sensors
from sleepcast.simulator.scenario.stocks import stock_sensors

BUMPER = "the part of the bumper that touches something, from 1 in front, counter-clockwise; 0 for none"
"""The description of the bumper's sensor."""


def sensors_of(scenario: Scenario) -> tuple[Quantity, ...]:
    """The sensors of the scenario's robots, in the order of the rows of `Bodies.sensed`; sonars come last."""
    length, robots = scenario.length_unit, scenario.robots
    speed = robots.limits.speed
    # Odometry may place a robot outside the world.
    low, right, top = (-inf, inf, inf) if robots.wheels else (0.0, scenario.width, scenario.height)
    return (
        Quantity("x", "m", low, right, doc="where the robot is, to the east", shown_as=length),
        Quantity("y", "m", low, top, doc="where the robot is, to the north", shown_as=length),
        Quantity("heading", "rad", -pi, pi, doc="counter-clockwise from east", shown_as="deg"),
        Quantity("speed", "m/s", -speed, speed, doc="along the heading", shown_as=robots.speed_unit),
        *(
            Quantity(store.name, store.unit, 0.0, store.full, doc=store.about, shown_as=store.unit)
            for store in robots.stores
        ),
        *(
            Quantity(f"{place.name}_{axis}", "m", 0.0, size, doc=f"where {place.title} is, {way}", shown_as=length)
            for place in scenario.places
            for axis, size, way in (("x", scenario.width, "to the east"), ("y", scenario.height, "to the north"))
        ),
        *value_quantities(robots.groups),
        *((Quantity("bumper", "", 0.0, float(robots.bumpers), doc=BUMPER),) if robots.bumpers else ()),
        *(
            (Quantity(SIDE_SPEED, "m/s", -speed, speed, doc="to its left", shown_as=robots.speed_unit),)
            if robots.omni
            else ()
        ),
        *(flight_sensors(robots.flight, robots.limits) if robots.flight else ()),
        *signal_sensors(scenario.lights, scenario.pings, length),
        *stock_sensors(scenario.stocks, length),
        *field_sensors(scenario.fields),
        *predation_sensors(scenario.predation),
    )


def by_link(scenario: Scenario, sensors: Sequence[Quantity]) -> tuple[Quantity, ...]:
    """These sensors as minds have them. Where a scenario cuts links, what a body has measured grows old as it does
    behind a bridge; what robots are told before they start does not."""
    if not scenario.cuts:
        return tuple(sensors)
    told = {f"{place.name}_{axis}" for place in scenario.places for axis in "xy"}
    told |= {value.name for value in value_quantities(scenario.robots.groups)}
    ages = {BATTERY: hovering.SELDOM}
    return tuple(each if each.name in told else replace(each, freshness=ages.get(each.name, FRESH)) for each in sensors)


def sonar_sensors(ring: Ring, length: str) -> tuple[Quantity, ...]:
    """One sensor for each sonar, and the shortest range of those in front. length: the unit in which it is shown."""
    unit = length if length in ("in", "ft", "cm", "m") else "m"
    return (
        *(
            Quantity(f"sonar{i}", "m", ring.least, ring.most, doc=f"range of sonar {i}", shown_as=unit)
            for i in range(ring.count)
        ),
        Quantity("front_range", "m", ring.least, ring.most, doc="least range of the sonars in front", shown_as=unit),
    )
