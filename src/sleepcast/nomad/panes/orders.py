"""The orders that a page can give to a robot: every request of the Nomad's programs that makes something happen.

Each has its name, its numbers in the Nomad's own units and bounds, and a sentence. The page makes its buttons, its
completion and its explanations of this table, and what a page sends is checked against it once more.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from sleepcast.core.errors import MisuseError, did_you_mean

MOST_VERTICES = 10
"""Of a polygon in an order: the Nomad's programs promise no more."""
LENGTH = "1/10 in"
ANGLE = "1/10°"
EITHER = "1/10 in/s or 1/10°/s"
AWAY = "1/10 in or 1/10°"
FAR = 1_000_000
"""The greatest length of an order: 2.5 km in tenths of inches."""
QUICK = 10_000
"""The greatest speed or acceleration of an order; what is more than the robot's own is what the robot can do."""
SONARS = 16
END_OF_ORDER = 255
"""Ends a list of sensors."""


class OrderField(msgspec.Struct, frozen=True):
    """One number: its name, unit, bounds, and what it is unless somebody says otherwise (None: it must be said).
    steered: its name where a body steers its wheels together, "" for the same."""

    name: str
    unit: str = ""
    least: int = -FAR
    most: int = FAR
    usual: int | None = None
    steered: str = ""

    def title(self, steers: bool) -> str:
        """Its name, for a body that steers its wheels together or not."""
        return self.steered if steers and self.steered else self.name


class NomadOrder(msgspec.Struct, frozen=True):
    """One order.

    more: what may follow the fields, up to `at_most` numbers in all.
    filled: numbers that are missing then are this.
    beside: its first number says how many corners follow, x and y of each, and so many numbers come beside those; 0: it
        has no corners.
    text: takes words and no numbers.
    shown: has a button and fields on the page.
    """

    name: str
    about: str
    fields: tuple[OrderField, ...] = ()
    more: OrderField | None = None
    at_most: int = 0
    filled: int | None = None
    beside: int = 0
    text: bool = False
    shown: bool = False


def _axes(unit: str, least: int, most: int, usual: int | None = None) -> tuple[OrderField, ...]:
    return (
        OrderField("right", unit, least, most, usual, "way"),
        OrderField("left", unit, least, most, usual, "steering"),
        OrderField("third", unit, least, most, least if least > 0 else 0, "turret"),
    )


_PLACE = (
    OrderField("x", LENGTH),
    OrderField("y", LENGTH),
    OrderField("steering", ANGLE, -36_000, 36_000, 0),
    OrderField("turret", ANGLE, -36_000, 36_000, 0),
)
_SENSOR = OrderField("sensor", "", -1, 255)
_VERTEX = OrderField("x or y", LENGTH)
_MODE = OrderField("colour", "", 1, 23, 1)


def _of_polygon(name: str, about: str, beside: int) -> NomadOrder:
    """An order with a polygon; see `NomadOrder`."""
    corners = OrderField("corners", "", 3, MOST_VERTICES)
    return NomadOrder(name, about, (corners,), more=_VERTEX, at_most=beside + 2 * MOST_VERTICES, beside=beside)


ORDERS: dict[str, NomadOrder] = {
    order.name: order
    for order in (
        NomadOrder("vm", "Turn the wheels this fast, until told otherwise.", _axes(EITHER, -QUICK, QUICK), shown=True),
        NomadOrder("pr", "Go this far with each wheel, and stop.", _axes(AWAY, -FAR, FAR), shown=True),
        NomadOrder("st", "Stop and hold the position.", shown=True),
        NomadOrder("lp", "Let go: the wheels roll out.", shown=True),
        NomadOrder("gs", "Ask for the state, and show it.", shown=True),
        NomadOrder(
            "ws",
            "Wait until the axes marked 1 stand still, for so many seconds at most; 0: as long as it takes.",
            (
                OrderField("right", "", 0, 1, 1, "way"),
                OrderField("left", "", 0, 1, 1, "steering"),
                OrderField("third", "", 0, 1, 0, "turret"),
                OrderField("s", "s", 0, 255, 0),
            ),
            shown=True,
        ),
        NomadOrder("zr", "Zero: stand at the origin with heading 0.", shown=True),
        NomadOrder("dp", "Say where the robot is; it does not move.", _PLACE[:2], shown=True),
        NomadOrder("da", "Say which way the robot looks; it does not turn.", _PLACE[2:], shown=True),
        NomadOrder("place_robot", "Move the robot there, and its odometry.", _PLACE, shown=True),
        NomadOrder("sp", "How fast pr goes.", _axes(EITHER, 0, QUICK), shown=True),
        NomadOrder("ac", "How fast speeds change.", _axes(EITHER, 1, QUICK), shown=True),
        NomadOrder(
            "conf_sn",
            "Fire the sonars in this order, pausing 4 ms times the rate between two; none for all off.",
            (OrderField("rate", "4 ms", 0, 255, 1),),
            more=_SENSOR,
            at_most=1 + SONARS,
            filled=END_OF_ORDER,
            shown=True,
        ),
        NomadOrder(
            "conf_tm",
            "Stop when no command came for so long; 0: never.",
            (OrderField("s", "s", 0, 255, 1),),
            shown=True,
        ),
        NomadOrder("tk", "Say something.", text=True, shown=True),
        NomadOrder(
            "mv",
            "For each axis a mode (0 leave, 1 speed, 2 distance, 3 limp, 4 acceleration, 5 cruise) and its number.",
            tuple(
                field
                for axis, steered in (("right", "way"), ("left", "steering"), ("third", "turret"))
                for field in (
                    OrderField(f"{axis} mode", "", 0, 5, 0, f"{steered} mode"),
                    OrderField(axis, "", -FAR, FAR, 0, steered),
                )
            ),
        ),
        NomadOrder(
            "conf_ir",
            "Use these infrared sensors, averaging over so many readings.",
            (OrderField("history", "", 0, 10, 0),),
            more=_SENSOR,
            at_most=1 + SONARS,
            filled=END_OF_ORDER,
        ),
        NomadOrder("conf_cp", "Compass: 0 off, 1 on, 2 calibrate.", (OrderField("mode", "", 0, 2, 1),)),
        NomadOrder(
            "conf_ls",
            "Laser: its mode and settings.",
            tuple(OrderField(name, "", 0, 1023) for name in ("mode", "threshold", "width", "data", "processing")),
        ),
        NomadOrder(
            "conf_sg",
            "Laser: what counts as a line.",
            tuple(OrderField(name, "", 0, 1023) for name in ("threshold", "points", "gap")),
        ),
        _of_polygon("add_obstacle", "Put up a polygon: how many corners, then x y of each, counter-clockwise.", 1),
        _of_polygon("delete_obstacle", "Take the polygon with these corners away.", 1),
        _of_polygon(
            "move_obstacle", "Move the polygon with these corners; the last two numbers say how far across and up.", 3
        ),
        NomadOrder("new_world", "Take all obstacles away."),
        NomadOrder("draw_robot", "Draw a robot.", (*_PLACE, _MODE)),
        NomadOrder(
            "draw_line", "Draw a line.", (*(OrderField(name, LENGTH) for name in ("x1", "y1", "x2", "y2")), _MODE)
        ),
        NomadOrder(
            "draw_arc",
            "Draw a piece of an ellipse; x y is the upper left corner of its box.",
            (
                *_PLACE[:2],
                OrderField("width", LENGTH, 0),
                OrderField("height", LENGTH, 0),
                OrderField("from", ANGLE, -36_000, 36_000, 0),
                OrderField("to", ANGLE, -36_000, 36_000, 3600),
                _MODE,
            ),
        ),
        NomadOrder("refresh_all", "Erase everything that was drawn."),
        NomadOrder("refresh_all_traces", "Erase both traces."),
        NomadOrder("refresh_actual_trace", "Erase where the robot was."),
        NomadOrder("refresh_encoder_trace", "Erase where it believed to be."),
        NomadOrder("refresh_all_sensors", "Erase what all sensors saw."),
        NomadOrder("refresh_bumper_sensor", "Erase what the bumper felt."),
        NomadOrder("refresh_infrared_sensor", "Erase what the infrared sensors saw."),
        NomadOrder("refresh_sonar_sensor", "Erase what the sonars saw."),
        NomadOrder("refresh_laser_sensor", "Erase what the laser saw."),
        NomadOrder("refresh_client_graphics", "Erase what programs have drawn."),
        NomadOrder("real_robot", "Let the real robot behind this one take the orders, where there is one."),
        NomadOrder("simulated_robot", "Let the simulated robot take the orders again."),
    )
}


def check(name: str, numbers: Sequence[int], *, steers: bool = False) -> list[int]:
    """The numbers of the order as a program would send them. steers: whether the body steers its wheels together.

    Raises MisuseError, in words for who typed it.
    """
    order = ORDERS.get(name)
    if order is None:
        meant = did_you_mean(name, ORDERS) or ", as there is vm, pr or st"
        raise MisuseError(f"there is no order {name!r}{meant}")
    given = [*numbers, *_usual(order, len(numbers))]
    most = order.at_most if order.more is not None else len(order.fields)
    if len(given) < len(order.fields) or len(given) > most:
        count = f"{len(numbers)} number{'' if len(numbers) == 1 else 's'}"
        raise MisuseError(f"{name} takes {_wanted(order, steers)}; this has {count}")
    if order.beside and len(given) != order.beside + 2 * given[0]:
        raise MisuseError(f"{name}: {given[0]} corners make {order.beside + 2 * given[0]} numbers, not {len(given)}")
    for place, number in enumerate(given):
        field = order.fields[place] if place < len(order.fields) else order.more
        if field is not None and not field.least <= number <= field.most:
            wanted = f"must lie from {field.least} to {field.most}, not be {number}"
            raise MisuseError(f"{name}: {field.title(steers)} {wanted}")
    return given if order.filled is None else given + [order.filled] * (most - len(given))


def _usual(order: NomadOrder, given: int) -> list[int]:
    """What the fields are that were left out at the end."""
    left = [field.usual for field in order.fields[given:]]
    return [] if None in left else [usual for usual in left if usual is not None]


def _wanted(order: NomadOrder, steers: bool) -> str:
    titles = ((field.title(steers), field.usual) for field in order.fields)
    names = " ".join(title if usual is None else f"[{title}]" for title, usual in titles)
    return f"{names} ..." if order.more is not None else names or "no numbers"
