"""Lights and pings as a scenario file describes them, and the variables in which robots sense them.

After Hoskins's vehicles: a ping carries the caste of its sender and is heard with its range and from the front or the
rear; a light is seen in the same way. One ping at a time is presented, in pFlag, pRange, pBearing and pCaste, for one
tick; the light in sFlag, sRange and sBearing, for as long as it is seen. `bodies.senses` simulates them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

from sleepcast.core.model import Quantity
from sleepcast.core.settings import Table, checked_name
from sleepcast.core.units import LENGTH
from sleepcast.robot import BodyConstant

MAX_LIGHTS = 32
"""Every robot looks for the nearest of them at every tick."""
MAX_QUEUE = 64
"""Pings waiting on one robot: at one a tick, the last of them is old news already."""
FRONT, REAR = 1.0, -1.0
"""Bearings: within a quarter of a turn of the heading, or not."""
LIGHT_NAMES = ("sFlag", "sRange", "sBearing")
PING_NAMES = ("pFlag", "pRange", "pBearing", "pCaste")


@dataclass(frozen=True, slots=True)
class Light:
    """A light at (x, y), in m, seen from as far as `reach` m."""

    name: str
    title: str
    x: float
    y: float
    reach: float


@dataclass(frozen=True, slots=True)
class PingModel:
    """How pings are heard. reach: how far, in m. loss: the chance that one hearer misses one ping.

    queue: how many wait on a robot; a new one drives the oldest out.
    """

    reach: float
    loss: float
    queue: int


def read_lights(root: Table, size: tuple[float, float], places: Sequence[str]) -> tuple[Light, ...]:
    """The tables `[lights.NAME]`. places: names that are taken."""
    found = []
    for name, table in root.tables("lights", most=MAX_LIGHTS).items():
        if checked_name(root.table("lights"), name) in places:
            raise root.table("lights").error(name, "a place has this name already; choose another")
        with table:
            x = table.number("x", LENGTH, low=0.0, high=size[0])
            y = table.number("y", LENGTH, low=0.0, high=size[1])
            reach = table.number("reach", LENGTH, inf, low=0.0)
            found.append(Light(name, table.text("title", name, most=60), x, y, reach))
    return tuple(found)


def read_pings(root: Table) -> PingModel | None:
    """The table `[pings]`, None where nobody pings."""
    if not root.has("pings"):
        return None
    with root.table("pings") as table:
        return PingModel(
            reach=table.number("reach", LENGTH, low=0.0),
            loss=table.number("loss", default=0.0, low=0.0, high=1.0),
            queue=table.whole("queue", 4, low=1, high=MAX_QUEUE),
        )


def signal_sensors(lights: tuple[Light, ...], pings: PingModel | None, length: str) -> tuple[Quantity, ...]:
    """The sensors for what there is to see and to hear. length: the unit in which people read ranges."""
    return (
        *(_sensors(LIGHT_NAMES, "a light is seen", "of the nearest light", length) if lights else ()),
        *(_sensors(PING_NAMES[:3], "a ping is presented", "of its sender", length) if pings else ()),
        *((Quantity(PING_NAMES[3], doc="the caste that the ping carries"),) if pings else ()),
    )


def _sensors(names: tuple[str, ...], flag: str, whose: str, length: str) -> tuple[Quantity, ...]:
    return (
        Quantity(names[0], low=0.0, high=1.0, doc=f"whether {flag}"),
        Quantity(names[1], "m", 0.0, inf, doc=f"distance {whose}", shown_as=length),
        Quantity(names[2], low=REAR, high=FRONT, doc=f"FRONT or REAR: bearing {whose}"),
    )


def signal_constants(lights: tuple[Light, ...], pings: PingModel | None) -> tuple[BodyConstant, ...]:
    """The names of the bearings, where anything has one."""
    if not lights and pings is None:
        return ()
    return (
        BodyConstant("FRONT", FRONT, doc="bearing of what lies ahead, within 90 degrees of the heading"),
        BodyConstant("REAR", REAR, doc="bearing of what lies behind"),
    )
