"""What flies: the table [robots.flight], which makes of a body on the ground one that hovers.

It then has the names of whatever hovers (`robot.hovering`), and the limits of its climb and height beside those of
[robots.limits].
"""

from __future__ import annotations

from dataclasses import replace
from math import inf, pi, tan

from sleepcast.core.model import Quantity
from sleepcast.core.records import dataclass
from sleepcast.core.settings import Table
from sleepcast.core.units import LENGTH, SPEED, TIME
from sleepcast.robot import Limits, hovering

BATTERY = "battery"
"""The store that flying uses up."""
HIGHEST = 10_000.0
"""m above the ground to which anything may fly: higher, the air is another one."""
SENSORS = ("z", "turn_rate", "height", "climb_rate", "armed", "flying")
"""What a body senses because it flies, of `hovering.sensors`."""
CRASHED = "crashed"
"""What a real one cannot say of itself."""
GRAVITY = 9.81
"""m/s2 at which a body falls whose motors are off, and by which a plane turns in its bank."""
LEAST_STALL = 0.1
"""m/s: slower, a plane would be a balloon."""
MIN_BANK, MAX_BANK = pi / 180.0, 80.0 * pi / 180.0
"""rad: below, a plane does not turn; above, it would need six times its lift."""
NAMES = (*SENSORS, CRASHED, "drive_side", "drive_climb")
"""The variables that it has because it flies."""


@dataclass(frozen=True, slots=True)
class FlightSpec:
    """How bodies of one type fly, besides what their `Limits` say.

    sink: m/s in a landing
    height: of a take-off that says none, m above the ground
    hovers: s for which a full battery keeps it in the air, inf for ever
    climbs: m that it climbs on a full battery, apart from that
    failsafe: "hover" or "land": what it does where nobody drives it any more
    cuts: whether it has an emergency stop, after which it falls
    stall: speed below which it does not fly, m/s, of a plane; 0 for what hovers
    bank: greatest one of a plane, rad
    circle: radius in which a plane circles, m
    """

    sink: float
    height: float
    hovers: float = inf
    climbs: float = inf
    failsafe: str = "hover"
    cuts: bool = False
    stall: float = 0.0
    bank: float = 0.0
    circle: float = 0.0


def read_flight(robots: Table, limits: Limits, size: tuple[float, float]) -> tuple[FlightSpec, Limits]:
    """The table [robots.flight], and these limits with those of flying. size: of the world, m."""
    for key, why in (("wheels", "go on wheels"), ("sonar", "have sonars")):
        if robots.has(key):
            raise robots.error(key, f"robots that fly do not {why}: leave this out, or [robots.flight]")
    with robots.table("flight") as table:
        climb = table.number("climb", SPEED, low=1e-3, high=100.0)
        floor = table.number("floor", LENGTH, 0.5, low=0.0, high=HIGHEST)
        ceiling = table.number("ceiling", LENGTH, low=0.0, high=HIGHEST)
        if ceiling <= floor:
            raise table.error("ceiling", f"wanted more than the floor, {floor:g} m")
        spec = FlightSpec(
            sink=table.number("sink", SPEED, climb, low=1e-3, high=100.0),
            height=table.number("height", LENGTH, low=floor, high=ceiling),
            hovers=table.number("hovers", TIME, inf, low=1.0),
            climbs=table.number("climbs", LENGTH, inf, low=1.0),
            failsafe=table.text("failsafe", "hover", choices=("hover", "land")),
            cuts=table.flag("emergency_stop", False),
            **_wings(table, limits, size) if table.has("stall") else {},
        )
        return spec, replace(limits, climb=climb, floor=floor, ceiling=ceiling)


def _wings(table: Table, limits: Limits, size: tuple[float, float]) -> dict[str, float]:
    """What a plane has besides."""
    stall = table.number("stall", SPEED, low=LEAST_STALL, high=limits.speed)
    bank = table.number("bank", low=MIN_BANK, high=MAX_BANK)
    circle = table.number("circle", LENGTH, low=0.0, high=HIGHEST)
    turn_rate = min(GRAVITY * tan(bank) / limits.speed, limits.turn_rate)
    if circle * turn_rate < limits.speed:
        radius = limits.speed / turn_rate
        raise table.error("circle", f"at {limits.speed:g} m/s it turns within {radius:.4g} m: say at least as much")
    with table.answering("circle"):
        hovering.check_room(*size, circle)
    return {"stall": stall, "bank": bank, "circle": circle}


def flight_sensors(limits: Limits) -> tuple[Quantity, ...]:
    """What bodies sense because they fly; in a simulation, nothing that was measured grows old."""
    known = {each.name: each for each in hovering.sensors(limits, inf)}
    above_ground = replace(known["height"], doc="above the ground")
    crashed = Quantity(CRASHED, "", 0.0, 1.0, doc="whether it has touched another one, and lies where it fell")
    return (*(above_ground if name == "height" else known[name] for name in SENSORS), crashed)
