"""What flies: the table [robots.flight], which makes of a body on the ground one that hovers; and particles.

What hovers has the names of whatever hovers (`robot.hovering`), and the limits of its climb and height beside those of
[robots.limits]. A particle, `body.drive = "particle"`, is a point that moves in space: see `bodies.particles`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf, pi, tan
from typing import Any

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
LEAST_WATCHDOG = 0.1
"""s: shorter, the motors of a body would stop between two of its mind's ticks."""
LEAST_STALL = 0.1
"""m/s: slower, a plane would be a balloon."""
MIN_BANK, MAX_BANK = pi / 180.0, 80.0 * pi / 180.0
"""rad: below, a plane does not turn; above, it would need six times its lift."""
PITCH = "pitch"
"""How far a particle's direction points up."""
PARTICLE_SENSORS = ("z", "climb_rate")
"""What a particle senses of `hovering.sensors`, beside its pitch."""
PARTICLE = "particle"
"""As `body.drive`."""
LEAVE_OUT = f'leave this out, or the drive "{PARTICLE}"'
PARTICLE_NAMES = (*PARTICLE_SENSORS, PITCH)
"""The variables that a particle has because it moves in space."""
NAMES = (*SENSORS, CRASHED, "drive_side", "drive_climb")
"""The variables that it has because it flies."""


@dataclass(frozen=True, slots=True)
class FlightSpec:
    """How bodies of one type fly, besides what their `Limits` say.

    sink: m/s in a landing
    height: of a take-off that says none, m above the ground
    hovers: s for which a full battery keeps it in the air, inf for ever
    climbs: m that it climbs on a full battery, apart from that
    failsafe: "hover", "land" or "rtl", to return and land: what it does where nobody drives it any more
    watchdog: s without a setpoint after which its motors stop for good; inf for never
    cuts: whether it has an emergency stop, after which it falls
    stall: speed below which it does not fly, m/s, of a plane; 0 for what hovers
    bank: greatest one of a plane, rad
    circle: radius in which a plane circles, m
    particle: whether it is a point that moves in space in its own direction
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
    particle: bool = False
    watchdog: float = inf

    @property
    def let_go(self) -> str:
        """The sentence that says what it does now that nobody drives it any more."""
        return hovering.let_go((hovering.FAILSAFES_OF_PLANES if self.stall else hovering.FAILSAFES)[self.failsafe])


def read_particle(robots: Table, limits: Limits) -> tuple[FlightSpec, Limits]:
    """How particles move, and these limits with those of their space."""
    body = robots.table("body")
    for key in ("wheels", "sonar", "flight", "camera"):
        if robots.has(key):
            raise robots.error(key, f"a particle moves by itself and has none of this: {LEAVE_OUT}")
    for key in ("bumpers", "sonars"):
        if body.has(key):
            raise body.error(key, f"a particle touches nothing and has none: {LEAVE_OUT}")
    spec = FlightSpec(sink=limits.speed, height=0.0, particle=True)
    return spec, replace(limits, climb=limits.speed, floor=0.0, ceiling=HIGHEST)


def refuse_mixture(tables: Sequence[Table], flights: Sequence[FlightSpec | None]) -> None:
    """Raise SettingsError where particles share their world with bodies that touch things or stand on the ground."""
    particles = [flight is not None and flight.particle for flight in flights]
    if any(particles) and not all(particles):
        other = tables[particles.index(False)]
        raise other.error("body", "particles touch nothing and have their world for themselves: leave these robots out")


def read_flight(robots: Table, limits: Limits, size: tuple[float, float]) -> tuple[FlightSpec, Limits]:
    """The table [robots.flight], and these limits with those of flying. size: of the world, m."""
    for key, why in (("wheels", "go on wheels"), ("sonar", "have sonars")):
        if robots.has(key):
            raise robots.error(key, f"robots that fly do not {why}: leave this out, or [robots.flight]")
    body = robots.table("body")
    for key in ("bumpers", "sonars"):
        if body.whole(key, 0, low=0, high=360):
            raise body.error(key, f"robots that fly have no {key}: leave this out, or [robots.flight]")
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
            failsafe=table.text("failsafe", "hover", choices=tuple(hovering.FAILSAFES)),
            cuts=table.flag("emergency_stop", False),
            watchdog=table.number("watchdog", TIME, inf, low=LEAST_WATCHDOG),
            **_wings(table, limits, size) if table.has("stall") else {},
        )
        return spec, replace(limits, climb=climb, floor=floor, ceiling=ceiling)


def seen_above(flight: FlightSpec | None) -> dict[str, str]:
    """What robots sense of their neighbours besides because they fly like this: names, each with its unit."""
    if flight is None:
        return {}
    return {"z": "m", PITCH: "rad"} if flight.particle else {"z": "m"}


def _wings(table: Table, limits: Limits, size: tuple[float, float]) -> dict[str, Any]:
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


def flight_sensors(flight: FlightSpec, limits: Limits) -> tuple[Quantity, ...]:
    """What bodies sense because they fly; in a simulation, nothing that was measured grows old."""
    known = {each.name: each for each in hovering.sensors(limits, inf)}
    if flight.particle:
        pitch = Quantity(PITCH, "rad", -pi / 2.0, pi / 2.0, doc="how far its direction points up", shown_as="deg")
        return (*(known[name] for name in PARTICLE_SENSORS), pitch)
    above_ground = replace(known["height"], doc="above the ground")
    crashed = Quantity(CRASHED, "", 0.0, 1.0, doc="whether it has touched another one, and lies where it fell")
    return (*(above_ground if name == "height" else known[name] for name in SENSORS), crashed)
