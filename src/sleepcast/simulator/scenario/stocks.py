"""Stocks as a scenario file describes them, and the variables in which robots sense them.

    [stocks.ore]
    x = "20m"
    y = "5m"
    radius = "2m"
    start = "40kg"

A stock is an amount of something at a place. Robots sense it as the variable `ore`, and its place as `ore_x` and
`ore_y`; within its radius they take from it and add to it with `(TAKE_ORE amount)` and `(GIVE_ORE amount)`.
`bodies.stocks` simulates this.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import inf

from sleepcast.core.model import Quantity
from sleepcast.core.records import dataclass
from sleepcast.core.settings import Table, checked_name
from sleepcast.core.units import LENGTH, NONE, UNITS, Dimension
from sleepcast.simulator.scenario.robot_settings import LEAST, Supply

MAX_STOCKS = 16
"""Stocks of one world: each is three variables and two functions on every robot."""
MAX_AMOUNT = 1e12
"""Greatest amount, in SI: beyond it, what one robot moves would be lost in rounding."""


@dataclass(frozen=True, slots=True)
class Stock:
    """An amount at (x, y), m, of which robots within `radius` m take and to which they add. Amounts are in SI.

    unit: in which the amount is shown, "" for a plain number
    start, capacity: amount at the start and at most (inf without a limit)
    inflow: what comes in per second
    endless: whether the amount never changes, however much is taken
    rate: what one robot can take or add per second
    reach: distance from which the amount is sensed, m
    store: the robots' store into which goes what they take and from which comes what they add; "" for none
    """

    name: str
    title: str
    x: float
    y: float
    radius: float
    unit: str
    start: float
    capacity: float = inf
    inflow: float = 0.0
    endless: bool = False
    rate: float = inf
    reach: float = inf
    store: str = ""
    about: str = ""

    @property
    def dimension(self) -> Dimension:
        return UNITS[self.unit].dimension if self.unit else NONE

    @property
    def names(self) -> tuple[str, str, str]:
        """The variables in which robots sense its amount and its place."""
        return self.name, f"{self.name}_x", f"{self.name}_y"


def read_stocks(
    root: Table, size: tuple[float, float], stores: Sequence[Supply], taken: Iterable[str]
) -> tuple[Stock, ...]:
    """The tables `[stocks.NAME]`.

    size: of the world, m
    stores: of the robots
    taken: names already in use
    """
    used, stocks = {name.casefold() for name in taken}, list[Stock]()
    carried = {store.name.casefold(): store for store in stores}
    for name, table in root.tables("stocks", most=MAX_STOCKS).items():
        around = root.table("stocks")
        checked_name(around, name)
        with table:
            stock = _read(table, name, size, carried)
        for each in stock.names:
            if each.casefold() in used:
                raise around.error(name, f"robots have a variable {each} already; choose another name")
            used.add(each.casefold())
        stocks.append(stock)
    return tuple(stocks)


def _read(table: Table, name: str, size: tuple[float, float], carried: Mapping[str, Supply]) -> Stock:
    start = table.measure("start", None, low=0.0, high=MAX_AMOUNT)
    stock = Stock(name, "", 0.0, 0.0, 0.0, start.unit, start.value)
    dimension, endless = stock.dimension, table.flag("endless", False)
    for key in ("capacity", "inflow") if endless else ():
        if table.has(key):
            raise table.error(key, "an endless stock never changes: leave this out, or endless")
    table.has("capacity"), table.has("inflow")
    return Stock(
        name=name,
        title=table.text("title", name, most=60),
        x=table.number("x", LENGTH, low=0.0, high=size[0]),
        y=table.number("y", LENGTH, low=0.0, high=size[1]),
        radius=table.number("radius", LENGTH, low=LEAST),
        unit=start.unit,
        start=start.value,
        capacity=inf if endless else table.number("capacity", dimension, inf, low=max(start.value, LEAST)),
        inflow=0.0 if endless else table.number("inflow", dimension, 0.0, low=0.0, high=MAX_AMOUNT),
        endless=endless,
        rate=table.number("rate", dimension, inf, low=LEAST),
        reach=table.number("reach", LENGTH, inf, low=0.0),
        store=_store(table, carried, stock),
        about=table.text("about", ""),
    )


def _store(table: Table, carried: Mapping[str, Supply], stock: Stock) -> str:
    if not table.has("store"):
        return ""
    wanted = table.text("store", choices=tuple(store.name for store in carried.values()) or ("",))
    store = carried.get(wanted.casefold())
    if store is None:
        raise table.error("store", "robots have no stores: add [robots.stores.NAME], or leave this out")
    if store.dimension != stock.dimension:
        raise table.error("store", f"{store.name} is {store.dimension}, and this stock is {stock.dimension}")
    return store.name


def stock_sensors(stocks: Sequence[Stock], length: str) -> tuple[Quantity, ...]:
    """The sensors for stocks. length: the unit in which their places are shown."""
    return tuple(
        sensor
        for stock in stocks
        for sensor in (
            Quantity(stock.name, stock.unit, 0.0, stock.capacity, doc=stock.about or f"what is left at {stock.title}"),
            *(
                Quantity(name, "m", 0.0, inf, doc=f"where {stock.title} is, {way}", shown_as=length)
                for name, way in zip(stock.names[1:], ("to the east", "to the north"), strict=True)
            ),
        )
    )
