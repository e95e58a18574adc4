"""`mavlink://HOST:PORT#SYSTEM`: the address of a vehicle, what can be set in it, and which body stands behind it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import Any

from sleepcast.bridges import Opening
from sleepcast.bridges.address import BodyAddress, BodyError, read_body_address
from sleepcast.bridges.body import PATIENCE
from sleepcast.bridges.mavlink.fences import fence_of
from sleepcast.bridges.mavlink.link import LINK, MavlinkConnection, open_link, system_of
from sleepcast.bridges.mavlink.model import MODES, PLANE
from sleepcast.bridges.mavlink.plane import MavlinkPlane
from sleepcast.bridges.mavlink.plans import Plan, read_plans
from sleepcast.bridges.mavlink.transfer import Party
from sleepcast.bridges.mavlink.vehicle import GCS_COMPONENT_ID, GCS_SYSTEM_ID, USUAL, MavlinkVehicle
from sleepcast.core.geodesy import LocalMap, Origin
from sleepcast.core.model import MapOutline
from sleepcast.robot import Limits, OutOfReachError

EXAMPLE = "mavlink://0.0.0.0:14550?listen=yes&key=vehicle.key#1"
PORT = 14_550
OF_KIND = ("speed", "turn_rate", "acceleration", "ceiling", "floor", "height", "circle")
SETTINGS = {
    **LINK,
    "failsafe": "loiter",
    "origin": "",
    **dict.fromkeys(OF_KIND, ""),
    "altitude": "",
    "plans": "",
    "fence": "",
}
"""What can be set in a URI, and what holds otherwise; of `OF_KIND` that depends on the vehicle. Speeds in m/s, rad/s;
ceiling, floor, and the height of a take-off: m above where it started; altitude of z = 0: m above the sea; circle: the
radius in which a plane circles, m."""
HOVERING = {
    "speed": "2",
    "turn_rate": "1",
    "acceleration": "2",
    "ceiling": "30",
    "floor": "0.5",
    "height": f"{USUAL:g}",
}
FLYING_ON = {"speed": "15", "turn_rate": "1", "acceleration": "4", "ceiling": "120", "floor": "30", "height": "50"}
"""What holds otherwise for planes."""
LOWEST = -1e4
"""m: floors and altitudes may lie below 0."""
LARGEST = 1_000.0
"""m: radius of a circle."""
HIGHEST_CLIMB = 1.0
"""m/s."""
AUTOPILOT = 3
"""ArduPilot."""
FAILSAFES = ("loiter", "rtl", "land")


def open_body(uri: str, opening: Opening) -> MavlinkVehicle:
    """The vehicle at `mavlink://HOST:PORT#SYSTEM`, which listens there, or, with `listen=yes`, sends to there. Raises
    BodyError, OutOfReachError.

    Its setting `key` names a file with the phrase of its signing key, without which `unsigned=yes` must be given.
    """
    address = read_body_address(uri, EXAMPLE, SETTINGS)
    system = system_of(address)
    if opening.in_step:
        raise BodyError(f"{uri!r:.100}: real vehicles cannot run in lockstep: no --lockstep")
    address.choice("failsafe", FAILSAFES)
    try:
        _limits(address, HOVERING)
    except BodyError:  # wrong for everything that is known here, or right for planes alone
        _limits(address, FLYING_ON)
    _frame(address)
    plans = read_plans(Path(address.settings["plans"])) if address.settings["plans"] else ()
    link = open_link(address, PORT, GCS_SYSTEM_ID, GCS_COMPONENT_ID)
    try:
        heartbeat = _meet(link, system, f"{address.host}:{address.port or PORT}")
        vehicle = _body(address, link, system, MODES[heartbeat.type], plans)
        vehicle.take(heartbeat)
        return vehicle
    except BaseException:
        link.close()
        raise


def _body(
    address: BodyAddress, link: MavlinkConnection, system: int, modes: dict[str, int], plans: tuple[Plan, ...]
) -> MavlinkVehicle:
    """The body of a vehicle with these modes and plans."""
    failsafe = address.settings["failsafe"].upper()
    if failsafe not in modes:
        lands = "a plane lands by its own mission: with rtl, and RTL_AUTOLAND set in it, " if modes is PLANE else ""
        known = ", ".join(each for each in FAILSAFES if each.upper() in modes)
        raise BodyError(f"{address.uri!r:.100}: this vehicle has no mode {failsafe}; {lands}wanted {known}")
    origin, altitude = _frame(address)
    limits, height = _limits(address, FLYING_ON if modes is PLANE else HOVERING)
    earth = None if origin is None else LocalMap(origin)
    fence = fence_of(address, link, Party(system, GCS_SYSTEM_ID, GCS_COMPONENT_ID), earth)
    limits = replace(limits, inside=fence.inside, outside=fence.outside)
    make = MavlinkPlane if modes is PLANE else MavlinkVehicle
    outlines = [*fence.outlines(), *(() if earth is None else (_way(plan, earth) for plan in plans))]
    vehicle = make(
        link,
        system,
        modes,
        limits,
        failsafe=failsafe,
        origin=origin,
        altitude=altitude,
        height=height,
        plans=plans,
        outlines=outlines,
    )
    if modes is PLANE and address.settings["circle"]:
        vehicle.CIRCLE = address.number("circle", most=LARGEST, unit="m")
    return vehicle


def _way(plan: Plan, earth: LocalMap) -> MapOutline:
    """What is drawn of a plan."""
    points = (earth.metres(*place) for place in plan.places())
    return MapOutline(plan.name, tuple(point for point in points if point is not None), False)


def _frame(address: BodyAddress) -> tuple[Origin | None, float]:
    """Where x = 0, y = 0 lies, and the altitude of z = 0, m above the sea; None and NaN for what the vehicle itself
    says. Raises MisuseError."""
    origin = Origin.read(address.settings["origin"]) if address.settings["origin"] else None
    return origin, address.number("altitude", LOWEST, -LOWEST, "m") if address.settings["altitude"] else nan


def _limits(address: BodyAddress, usual: Mapping[str, str]) -> tuple[Limits, float]:
    """The limits in an address, and the height of a take-off, with what is usual for what it leaves open. Raises
    BodyError."""
    given = {name: text for name, text in address.settings.items() if text or name not in usual}
    address = replace(address, settings={**usual, **given})
    speed, turn, acceleration = (address.number(name, most=100.0) for name in ("speed", "turn_rate", "acceleration"))
    ceiling = address.number("ceiling", most=10_000.0, unit="m")
    floor = address.number("floor", LOWEST, ceiling, "m")
    limits = Limits(speed, turn, acceleration, climb=HIGHEST_CLIMB, floor=floor, ceiling=ceiling)
    if given.get("height"):
        return limits, address.number("height", floor, ceiling, "m")
    return limits, max(floor, min(float(usual["height"]), ceiling))


def _meet(link: MavlinkConnection, system: int, where: str) -> Any:
    """Wait for a vehicle whose modes are known; gives its heartbeat."""
    end, others = time.monotonic() + PATIENCE, set[str]()
    while time.monotonic() < end:
        link.send(link.mav.heartbeat_encode(6, 8, 0, 0, 4))
        for message in link.receive():
            if message.get_type() != "HEARTBEAT":
                continue
            component = message.get_srcComponent()
            if (message.get_srcSystem(), component) == (system, 1):
                if message.autopilot != AUTOPILOT or message.type not in MODES:
                    what = f"type {message.type} with autopilot {message.autopilot}"
                    raise BodyError(
                        f"vehicle {system} at {where} is of {what}: wanted an ArduPilot rover, copter or plane"
                    )
                return message
            others.add(f"{message.get_srcSystem()}" + (f" (its component {component})" if component != 1 else ""))
        time.sleep(0.1)
    heard = f"; heard were {', '.join(sorted(others))}" if others else ""
    why = "".join(f"; {sentence}" for sentence in link.complaints())
    raise OutOfReachError(f"vehicle {system} was not heard at {where} in {PATIENCE:g} s{heard}{why}")
