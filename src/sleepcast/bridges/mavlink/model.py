"""What a vehicle that speaks MAVLink answers to: a copter to what all that hover do, with modes of its own; a rover; a
plane, which is driven to places only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

from sleepcast.bridges.mavlink.transfer import MAX_ITEMS
from sleepcast.core.model import HostFunction, MapOutline, Quantity
from sleepcast.robot import FRESH, BodyConstant, Geometry, Limits, RobotModel, hovering
from sleepcast.robot.hovering import SELDOM, Hovering

AUTO, GUIDED, LAND, TAKEOFF = "AUTO", "GUIDED", "LAND", "TAKEOFF"
COPTER = {"STABILIZE": 0, "ALT_HOLD": 2, AUTO: 3, GUIDED: 4, "LOITER": 5, "RTL": 6, LAND: 9, "BRAKE": 17}
ROVER = {"MANUAL": 0, "HOLD": 4, "LOITER": 5, AUTO: 10, "RTL": 11, GUIDED: 15}
PLANE = {
    "MANUAL": 0,
    "CIRCLE": 1,
    "STABILIZE": 2,
    "FBWA": 5,
    "FBWB": 6,
    "CRUISE": 7,
    AUTO: 10,
    "RTL": 11,
    "LOITER": 12,
    TAKEOFF: 13,
    GUIDED: 15,
}
"""Numbers of ArduPilot's modes."""
MODES = {**dict.fromkeys((2, 3, 4, 13, 14, 15, 29, 35), COPTER), **dict.fromkeys((10, 11), ROVER), 1: PLANE}
"""Of each type of vehicle that MAVLink has a number for, and that is known here."""

OWN = (
    Quantity("mode", "", 0.0, 255.0, FRESH, "number of its mode: GUIDED, LOITER, RTL"),
    Quantity("volts", "", 0.0, 100.0, SELDOM, "of its battery"),
    Quantity("gps_fix", "", 0.0, 8.0, SELDOM, "3 and more: it knows where it is"),
    Quantity("satellites", "", 0.0, 254.0, SELDOM, "that its GPS sees"),
)
"""What a vehicle measures besides what all do that hover."""
ON_GROUND = (
    *("x", "y", "heading", "speed", "turn_rate", "height", "climb_rate", "armed", "mode", "battery"),
    *("volts", "gps_fix", "satellites"),
)
"""What a rover measures."""
IN_AIR = (*ON_GROUND, "z", "flying")


OF_PLANES = {
    **hovering.OF_PLANES,
    "TAKEOFF": "Chooses its mode TAKEOFF, arms, and then circles at this height.",
    "LAND": "Lands as its own mission says.",
}
"""What functions do on planes."""


OF_PLANS = (
    Quantity(
        "waypoint", "", 0.0, float(MAX_ITEMS), FRESH, "number of the item of its plan to which it goes, 0 for none"
    ),
    Quantity("plan_progress", "", 0.0, 1.0, FRESH, "share of its plan that it has done", "%"),
)
"""What vehicles measure that have plans."""


class Vehicle(Hovering, Protocol):
    """What expressions may ask of a vehicle; a rover answers to what can be done on the ground."""

    def fly_plan(self, plan: float) -> None:
        """Fly the plan with this number."""

    def set_mode(self, mode: float) -> None:
        """Change its mode to the one with this number."""


def model_of(
    modes: dict[str, int],
    limits: Limits,
    body: type[Vehicle],
    plans: Sequence[str] = (),
    outlines: Sequence[MapOutline] = (),
) -> RobotModel:
    """Of vehicles with these modes, whose bodies are of this class. plans: names, each of which is a number, from 1;
    outlines: see `RobotModel`."""
    name, measured, driven = ("rover", ON_GROUND, 2) if modes is ROVER else ("copter", IN_AIR, None)
    if modes is PLANE:  # follows places, and no speeds
        name, driven = "plane", 0
    known = {quantity.name: quantity for quantity in (*hovering.sensors(limits, FRESH), *OWN)}
    functions = (*functions_of(modes, body), *([plan_function(body)] if plans else []))
    called = {function.name for function in functions}
    return RobotModel(
        name,
        (*(known[each] for each in measured), *(OF_PLANS if plans else ())),
        hovering.actuators(limits)[:driven],
        functions,
        limits,
        Geometry(0.5),
        (
            *(BodyConstant(name, float(number), doc="a mode") for name, number in modes.items() if name not in called),
            *(BodyConstant(name, float(number), doc="a plan") for number, name in enumerate(plans, 1)),
        ),
        outlines=tuple(outlines),
    )


def plan_function(body: type[Vehicle]) -> HostFunction:
    """PLAN, of vehicles that have plans."""
    doc = "Flies or drives a plan by its name, from its begin."
    return HostFunction("PLAN", body.fly_plan, (None,), arguments="name", doc=doc)


def functions_of(modes: dict[str, int], body: type[Vehicle]) -> tuple[HostFunction, ...]:
    """See `model_of`. A mode that has the name of a function stays the number of that name."""
    set_mode = HostFunction(
        "SET_MODE",
        body.set_mode,
        (None,),
        arguments="mode",
        doc="Changes its mode, for instance (SET_MODE GUIDED), in which it does what it is told.",
    )
    common = {function.name: function for function in hovering.functions(body)}
    if modes is ROVER:
        go_to = replace(common["GOTO"], arguments="x y height", doc="Goes to a place, at this height if it flies.")
        return common["ARM"], common["DISARM"], set_mode, go_to
    if modes is PLANE:
        common |= {name: replace(common[name], doc=doc) for name, doc in OF_PLANES.items()}
    return set_mode, *(replace(each, value=modes.get(each.name)) for each in common.values())
