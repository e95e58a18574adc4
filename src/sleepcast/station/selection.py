"""From robots to words: the shortest test that holds for exactly these robots.

A candidate is a conjunction of up to three conditions, each of which holds for all chosen robots: membership of a
group, a flag, an area, a variable that is above, below or between two numbers, or the distance from a point. Together
they must exclude every other robot, so this is a set cover. It is searched from the robot that the fewest conditions
exclude. Then each number is written with as few digits as still exclude what the other conditions leave over, and the
shortest text wins. Numbers are read as robots read them, so what is found here holds for exactly these robots by the
same telemetry. The search is bounded by steps, not by time: the same robots give the same text.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, islice
from math import inf

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.errors import MisuseError
from sleepcast.core.records import dataclass
from sleepcast.core.units import UNITS
from sleepcast.language.evaluate import is_true
from sleepcast.language.functions import MANY
from sleepcast.language.reader import MAX_TEXT
from sleepcast.station.facts import Facts, Mask, Measured, Values, joined, listed, literal, rounded, shortest

MAX_CONDITIONS = 3
"""Conditions in one test: people do not read longer ones at a glance."""
MAX_TRIED = 4_000
"""Combinations of each size that are looked at."""
MAX_PATTERNS = 256
"""Robots that are looked at one by one, those that the fewest conditions exclude."""
MAX_WRITTEN = 300
"""Combinations whose numbers are written out, the most promising first."""
MAX_FOUND = 3
"""Tests that are given: the shortest, and others to choose from."""
MAX_LISTED = 1_000
"""Robots that are named one by one: more do not fit into one message."""
ROUNDINGS = 6
"""Steps of a tenth in which the middle of the chosen robots is rounded, from coarse to fine."""
MAX_HELPERS = 12
"""Conditions, those that exclude most, with which a distance from the middle is tried together."""
MAX_MOVES = 200
"""Steps in which the middle of the chosen robots is looked for."""


@dataclass(frozen=True)
class Selection:
    """tests: those that hold for exactly the chosen robots, the shortest first; none if there is none within the bound.
    listed: the test that names each robot, "" if there are too many. unknown: how many of the chosen robots have sent
    no recent telemetry, so that no test holds for them."""

    tests: tuple[str, ...]
    listed: str = ""
    unknown: int = 0


@dataclass(frozen=True, eq=False)
class Criterion:
    """Something that holds for all chosen robots.

    excludes: of the others, those for whom it does not hold at its tightest
    length: characters at least
    text: where it has no number, else ""
    values: of the others
    low, high: least and greatest of the chosen ones, infinite where there is no such bound
    """

    excludes: Mask
    length: int
    rank: int
    text: str = ""
    name: str = ""
    unit: str = ""
    values: Values | None = None
    low: float = -inf
    high: float = inf

    def written(self, left: Mask) -> tuple[str, Mask]:
        """The text that excludes these others, and all that it excludes."""
        if self.values is None:
            return self.text, self.excludes
        values, low, high = self.values, self.low, self.high
        under, over = values[left & (values < low)], values[left & (values > high)]
        above = shortest(float(under.max()), low, self.unit, below=True) if under.size else ""
        below = shortest(high, float(over.min()), self.unit, below=False) if over.size else ""
        if not above and not below:  # it only has to be known, if anything is left at all
            nothing = np.isnan(values)
            return (f"(KNOWN {self.name})" if (left & nothing).any() else ""), nothing
        holds = np.ones(len(values), np.bool_)
        if above:
            holds &= values > _number(above, self.unit)
        if below:
            holds &= values < _number(below, self.unit)
        if above and below:
            return f"(< {above} {self.name} {below})", ~holds
        return (f"(> {self.name} {above})" if above else f"(< {self.name} {below})"), ~holds


def _number(text: str, unit: str) -> float:
    return literal(float(text.removesuffix(unit)), unit) if unit and text.endswith(unit) else float(text)


def select(facts: Facts, chosen: Mask) -> Selection:
    """The tests for the chosen robots. Raises MisuseError if nobody is chosen."""
    if not chosen.any():
        raise MisuseError("no robot is selected: select some on the map, and their test is written for you")
    unknown = int(np.count_nonzero(chosen & ~facts.known))
    if unknown:
        return Selection((), "", unknown)
    others = ~chosen & facts.known
    names = _listed(facts, chosen)
    if not others.any():
        return Selection(("TRUE",), names)
    tests = {text: (len(text), 0) for text in _by_number(facts, chosen, others, names)}
    for cover in _promising(_conditions(facts, chosen, others)):
        if len(tests) >= MAX_FOUND and _least(cover) > sorted(tests.values())[MAX_FOUND - 1][0]:
            break
        text = _write(cover)
        tests[text] = (len(text), sum(each.rank for each in cover))
    return Selection(tuple(sorted(tests, key=lambda text: tests[text])[:MAX_FOUND]), names)


def _by_number(facts: Facts, chosen: Mask, others: Mask, names: str) -> Iterator[str]:
    """Tests that name a few robots: those that are chosen, or those that are not."""
    if names and int(np.count_nonzero(chosen)) <= MAX_CONDITIONS:
        yield names
    if int(np.count_nonzero(others)) <= MAX_CONDITIONS and facts.ids is not None:
        left_out = _listed(facts, others)
        if left_out and not np.isnan(facts.ids[chosen]).any():
            yield f"(NOT {left_out})"


def _listed(facts: Facts, chosen: Mask) -> str:
    """The test that names each robot, "" where that is not possible."""
    ids = facts.ids
    if ids is None or int(np.count_nonzero(chosen)) > MAX_LISTED:
        return ""
    mine = ids[chosen]
    if not (mine == np.round(mine)).all() or np.isin(ids[~chosen], mine).any():
        return ""
    text = listed([int(number) for number in set(mine.tolist())], MANY)
    return text if len(text) <= MAX_TEXT else ""


# ---- conditions


def _conditions(facts: Facts, chosen: Mask, others: Mask) -> list[Criterion]:
    conditions = [
        Criterion(~each.holds[others], len(each.text), each.rank, each.text)
        for each in facts.properties
        if each.holds[chosen].all()
    ]
    for quantity in facts.quantities:
        conditions += _of_quantity(quantity, chosen, others)
    conditions += _from_points(facts, chosen, others)
    helpers = sorted(conditions, key=lambda each: -int(np.count_nonzero(each.excludes)))[:MAX_HELPERS]
    conditions += _from_the_middle(facts, chosen, others, [np.zeros(int(others.sum()), np.bool_)])
    if not any(each.excludes.all() for each in conditions):
        conditions += _from_the_middle(facts, chosen, others, [each.excludes for each in helpers])
    return [each for each in conditions if each.excludes.any()]


def _of_quantity(quantity: Measured, chosen: Mask, others: Mask) -> Iterator[Criterion]:
    mine, values, name, rank = quantity.values[chosen], quantity.values[others], quantity.text, quantity.rank
    if np.isnan(mine).all():
        yield Criterion(~np.isnan(values), len(name) + 14, rank + 1, f"(NOT (KNOWN {name}))")
    if np.isnan(mine).any():
        return
    if quantity.flag:
        if (mine != 0.0).all():
            yield Criterion(~is_true(values), len(name), rank, name)
        elif (mine == 0.0).all():
            yield Criterion(~(values == 0.0), len(name) + 6, rank, f"(NOT {name})")
        return
    low, high = float(mine.min()), float(mine.max())
    if low == high and not quantity.unit and low == round(low) and abs(low) < 1e15:
        text = f"(= {name} {int(low)})"
        yield Criterion(~(values == low), len(text), rank, text)
        return
    yield from _bounds(name, values, low, high, quantity.unit, rank)


def _bounds(name: str, values: Values, low: float, high: float, unit: str, rank: int) -> Iterator[Criterion]:
    shortest_number = 1 + len(unit)
    length = len(name) + 5 + shortest_number
    nothing = np.isnan(values)
    above, below = (values < low) | nothing, (values > high) | nothing
    yield Criterion(above, length, rank, "", name, unit, values, low, inf)
    yield Criterion(below, length, rank, "", name, unit, values, -inf, high)
    yield Criterion(above | below, length + 1 + shortest_number, rank, "", name, unit, values, low, high)


def _from_points(facts: Facts, chosen: Mask, others: Mask) -> Iterator[Criterion]:
    """Near to a point with a name, or far from it."""
    if facts.place is None:
        return
    x, y = facts.place
    for named_x, named_y, to_x, to_y in facts.points:
        away = _distance(x.values, y.values, to_x, to_y)
        if not np.isnan(away[chosen]).any():
            low, high = float(away[chosen].min()), float(away[chosen].max())
            yield from _bounds(f"(DIST {x.text} {y.text} {named_x} {named_y})", away[others], low, high, x.unit, 0)


def _from_the_middle(facts: Facts, chosen: Mask, others: Mask, helped: list[Mask]) -> Iterator[Criterion]:
    """Near to the middle of the chosen robots, whose numbers are as coarse as the others allow. helped: others that
    another condition excludes, once for each middle that is looked for."""
    if facts.place is None:
        return
    x, y = facts.place
    placed = ~np.isnan(x.values) & ~np.isnan(y.values)
    if not placed[chosen].all():
        return
    spread = max(float(np.ptp(each.values[chosen])) / UNITS[each.unit].factor for each in (x, y))
    step = 10.0 ** np.ceil(np.log10(max(spread, 1e-6)))
    for excluded in helped:
        against = others & placed
        against[np.flatnonzero(others)[excluded]] = False
        if not against.any():
            continue
        middle = _middle(x.values, y.values, chosen, against)
        tried = (_round(middle, (x, y), step / 10.0**fineness, chosen, others) for fineness in range(ROUNDINGS))
        nearest = next((each for each in tried if (each.excludes | excluded).all()), None)
        if nearest is not None:
            yield nearest


def _round(
    at: tuple[float, float], place: tuple[Measured, Measured], step: float, chosen: Mask, others: Mask
) -> Criterion:
    """Near to a point that is rounded to a step."""
    x, y = place
    texts = [rounded(value / UNITS[each.unit].factor, step) + each.unit for value, each in zip(at, place, strict=True)]
    to_x, to_y = (_number(text, each.unit) for text, each in zip(texts, place, strict=True))
    away = _distance(x.values, y.values, to_x, to_y)
    high, beyond = float(away[chosen].max()), away[others]
    name = f"(DIST {x.text} {y.text} {' '.join(texts)})"
    return Criterion(~(beyond <= high), len(name) + 6 + len(x.unit), 1, "", name, x.unit, beyond, -inf, high)


def _distance(x: Values, y: Values, to_x: Values | float, to_y: Values | float) -> Values:
    """As the language measures it, to the last bit."""
    dx, dy = x - to_x, y - to_y
    distances: Values = np.sqrt(dx * dx + dy * dy)
    return distances


def _middle(x: Values, y: Values, chosen: Mask, others: Mask) -> tuple[float, float]:
    """A point that is nearer to all chosen robots than to the others, or nearly so. Squares of distances differ by
    something that is linear in the point, so it goes as far as the worst pair of robots asks for, time and again."""
    (mine_x, mine_y), (its_x, its_y) = (x[chosen], y[chosen]), (x[others], y[others])
    at_x, at_y = 0.5 * float(mine_x.min() + mine_x.max()), 0.5 * float(mine_y.min() + mine_y.max())
    for _ in range(MAX_MOVES):
        away, beyond = _distance(mine_x, mine_y, at_x, at_y), _distance(its_x, its_y, at_x, at_y)
        mine, its = int(np.argmax(away)), int(np.nanargmin(beyond))
        too_far = float(away[mine]) ** 2 - float(beyond[its]) ** 2
        dx, dy = float(mine_x[mine] - its_x[its]), float(mine_y[mine] - its_y[its])
        if too_far < 0.0 or not (dx or dy):
            break
        share = 1.5 * too_far / (2.0 * (dx * dx + dy * dy)) + 1e-9
        at_x, at_y = at_x + share * dx, at_y + share * dy
    return at_x, at_y


# ---- covers

Cover = tuple[Criterion, ...]


def _promising(conditions: list[Criterion]) -> list[Cover]:
    """Combinations that exclude all others, those that may become shortest first."""
    if not conditions:
        return []
    return sorted(_covers(conditions), key=lambda cover: (_least(cover), sum(each.rank for each in cover)))[
        :MAX_WRITTEN
    ]


def _least(cover: Cover) -> int:
    """Characters that the text of a cover has at least."""
    return sum(each.length for each in cover) + (len("(AND)") + len(cover) if len(cover) > 1 else 0)


def _covers(conditions: list[Criterion]) -> Iterator[Cover]:
    """Every combination that is needed whole, the smaller ones first."""
    table = _hardest(np.array([each.excludes for each in conditions]))
    seen: set[tuple[int, ...]] = set()
    for size in range(1, MAX_CONDITIONS + 1):
        for rows in islice(_of_size(table, np.ones(table.shape[1], np.bool_), size), MAX_TRIED):
            key = tuple(sorted(rows))
            names = [conditions[at].name for at in key if conditions[at].name]
            if len(set(names)) < len(names):
                continue  # a variable between two numbers is one condition
            parts = (part for many in range(1, size) for part in combinations(key, many))
            if key in seen or not seen.isdisjoint(parts):
                continue
            cover = tuple(conditions[at] for at in key)
            if np.logical_or.reduce([each.excludes for each in cover]).all():
                seen.add(key)
                yield cover


def _hardest(table: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """What the conditions (rows) say of those others that decide: who excludes them excludes the rest, too."""
    bits = np.packbits(table, axis=0)
    counts = table.sum(axis=0)
    places = np.argsort(counts, kind="stable")
    kept: list[int] = []
    while places.size and len(kept) < MAX_PATTERNS:
        first = int(places[0])
        kept.append(first)
        pattern = bits[:, first : first + 1]
        places = places[((bits[:, places] & pattern) != pattern).any(axis=0)]
    return table[:, kept]


def _of_size(table: NDArray[np.bool_], left: Mask, size: int) -> Iterator[tuple[int, ...]]:
    """Combinations of so many conditions, by their rows, that exclude all who are left."""
    for at in np.flatnonzero(table[:, int(np.argmax(left))]).tolist():
        still = left & ~table[at]
        if size == 1:
            if not still.any():
                yield (at,)
        elif still.any():
            for rest in _of_size(table, still, size - 1):
                yield (at, *rest)


def _write(cover: Cover) -> str:
    """The cover as a test, each number as short as the other conditions allow."""
    excluded = [each.excludes for each in cover]
    texts: list[str] = []
    for at, each in enumerate(cover):
        elsewhere = np.zeros(len(each.excludes), np.bool_)
        for other in excluded[:at] + excluded[at + 1 :]:
            elsewhere |= other
        text, excluded[at] = each.written(~elsewhere)
        texts.append(text)
    return joined(filter(None, texts), "AND")
