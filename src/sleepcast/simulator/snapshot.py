"""Snapshots: the state of a simulator, and a simulator resumed from it.

A state includes the scenario as it was simulated, so it needs no other file: a simulator is built from that
scenario, then its arrays are overwritten. Values that follow from the seed alone are not saved; resuming with
another seed gives another random future from the same past.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from math import inf, isnan
from weakref import WeakKeyDictionary

import msgspec
import numpy as np

from sleepcast.channel.message import is_robot_name
from sleepcast.core.errors import SleepcastError
from sleepcast.core.given_numbers import MAX_SEED
from sleepcast.core.records import dataclass
from sleepcast.core.serial import Array, Arrays, SerialError, dump_arrays, load_arrays, within
from sleepcast.core.units import UNITS
from sleepcast.simulator.bodies.bodies import MAX_SAYINGS, Bodies, Mode, Saying
from sleepcast.simulator.bodies.population import MAX_BIRTHS, NOBODY
from sleepcast.simulator.packing import pack, unpack
from sleepcast.simulator.scenario.events import MAX_EVENTS
from sleepcast.simulator.scenario.fields import MAX_PARTS, ScalarField, bounds_of_fields
from sleepcast.simulator.scenario.flight import HIGHEST, MAX_BANK, MIN_BANK
from sleepcast.simulator.scenario.population import delayed_rows, rooms
from sleepcast.simulator.scenario.robot_settings import (
    LEAST,
    LEAST_ANGLE,
    MAX_BUMPERS,
    MAX_ORDER,
    MAX_PAUSE,
    MAX_ROBOTS,
    MAX_SONARS,
    MAX_STORES,
    MAX_TICKS,
    MAX_TIME,
    MAX_WORLD,
    WIDEST_ANGLE,
    WIDEST_BEAM,
    RobotSpec,
)
from sleepcast.simulator.scenario.robot_types import given_names, slices
from sleepcast.simulator.scenario.scanners import LEAST_FIELD, MAX_BEAMS, MAX_RANGES
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.scenario.signals import MAX_DELAYED, MAX_LIGHTS, MAX_QUEUE, MAX_SHARES, MAX_SHOWN_GROUPS
from sleepcast.simulator.scenario.starts import MAX_STARTS, SLACK, Formation, Starts, start_columns
from sleepcast.simulator.scenario.stocks import MAX_STOCKS
from sleepcast.simulator.scenario.wind import FASTEST_WIND
from sleepcast.simulator.simd.formulas import TURN
from sleepcast.simulator.simulation import Simulator
from sleepcast.simulator.sonar.firing import AT_ONCE, Firing
from sleepcast.simulator.world.grey_picture import bounds_of_picture
from sleepcast.simulator.world.world import Shape, World

MAX_WORDS = 16_384
"""Longest text spoken by a robot, characters: what one message holds."""


class SimulatorState(msgspec.Struct):
    """A simulator between two ticks.

    scenario, things: as `packing` writes them; neither where whoever goes on has the scenario, and nothing solid has
        changed since the start
    following: the number that the next solid thing gets
    said: time (s), robot and text
    measures: see `Measuring.state`
    population: see `Population`: the number in each row, and the next one; None where robots do not come and go
    awaited, added: see `Population`
    news: as `said`, what has befallen bodies since the last tick
    fenced: see `Fences.state`
    """

    scenario: bytes
    seed: int
    tick: int
    columns: Arrays
    things: bytes
    following: int
    said: list[tuple[float, int, str]]
    measures: list[tuple[int, list[list[float]]]]
    population: tuple[Array, int] | None = None
    awaited: list[int] = []
    added: int = 0
    news: list[tuple[float, int, str]] = []
    fenced: list[tuple[int, float, bool]] = []


@dataclass(frozen=True, slots=True)
class Things:
    """The shapes of a world with their numbers. Its class name is written into snapshots."""

    numbers: tuple[int, ...]
    shapes: tuple[Shape, ...]


def state_of(simulator: Simulator, *, whole: bool = True) -> SimulatorState:
    """The state of the simulator between two ticks. whole: with its scenario."""
    world, population = simulator.world, simulator.population
    if whole:
        scenario, things = _packed(simulator)
    else:
        as_built = world.version == len(simulator.scenario.shapes)  # each of which has changed it once
        scenario, things = b"", b"" if as_built else _things(world)
    return SimulatorState(
        scenario,
        simulator.seed,
        simulator.tick,
        dump_arrays(simulator.bodies.arrays() | simulator.senses.arrays()),
        things,
        world.following,
        [(saying.time, saying.robot, saying.text) for saying in simulator.sayings],
        simulator.measuring.state(),
        None if population is None else (Array.of(population.numbers.astype(np.int64)), population.following),
        [] if population is None else population.awaited,
        0 if population is None else population.added,
        [(saying.time, saying.robot, saying.text) for saying in simulator.news],
        [] if simulator.fences is None else simulator.fences.state,
    )


_PACKED: WeakKeyDictionary[Simulator, tuple[int, bytes, bytes]] = WeakKeyDictionary()
"""The version of a simulator's world, and its scenario and things as packed then: for a maze that takes longer than
everything else, and hardly ever changes."""


def _packed(simulator: Simulator) -> tuple[bytes, bytes]:
    world = simulator.world
    known = _PACKED.get(simulator)
    if known is None or known[0] != world.version:
        scenario = pack(simulator.scenario) if known is None else known[1]
        known = (world.version, scenario, _things(world))
        _PACKED[simulator] = known
    return known[1], known[2]


def _things(world: World) -> bytes:
    return pack(Things(tuple(world.shapes), tuple(world.shapes.values())))


def resume(state: SimulatorState, seed: int | None = None, threads: int | None = None) -> Simulator:
    """A simulator that continues from `state`. seed: None keeps the old one. Raises SerialError."""
    scenario = scenario_of(state.scenario)
    for number, low, high in ((state.seed, 0, MAX_SEED), (state.tick, 0, MAX_TICKS)):
        if not low <= number <= high:
            raise SerialError(f"a seed or tick {number} that does not lie in {low}..{high}")
    simulator = Simulator(scenario, state.seed if seed is None else seed, threads=threads)
    restore(simulator, state)
    return simulator


def restore(simulator: Simulator, state: SimulatorState) -> None:
    """Let a new simulator of the same scenario continue from `state`. Raises SerialError."""
    bodies = simulator.bodies
    bodies.tick = state.tick
    for number, ring in enumerate(bodies.rings):
        if f"order of ring {number}" in state.columns:
            ring.part()
    load_arrays(state.columns, bodies.arrays() | simulator.senses.arrays())
    _check(simulator)
    if state.things or state.scenario:
        _fill(simulator.world, state)
    simulator.sayings.extend(_sayings(state.said, bodies, MAX_SAYINGS))
    simulator.news.extend(_sayings(state.news, bodies, bodies.most_news))
    simulator.measuring.restore(state.measures)
    if simulator.links is not None:
        simulator.links.look(state.tick)
    if simulator.supplies is not None:
        simulator.supplies.go_on()
    if any(not 0 <= robot < bodies.count for robot, _, _ in state.fenced):
        raise SerialError("a robot at its fence that is not there")
    if simulator.fences is not None:
        simulator.fences.go_on(state.fenced)
    if simulator.population is not None:
        _populate(simulator, state)
    bodies.forget()


def _sayings(stored: list[tuple[float, int, str]], bodies: Bodies, most: int) -> list[Saying]:
    """Raises SerialError for more than `most`, or what nobody can have said."""
    if len(stored) > most:
        raise SerialError(f"{len(stored)} sayings, at most {most} are kept")
    for time, robot, text in stored:
        if not 0 <= robot < bodies.count or isnan(time) or len(text) > MAX_WORDS:
            raise SerialError("a saying of a robot that is not there, or without end")
    return [Saying(*each) for each in stored]


def _populate(simulator: Simulator, state: SimulatorState) -> None:
    """Have the robots that were there. Raises SerialError for numbers that no run can give."""
    population, (listed, following) = simulator.population, state.population or (None, 0)
    if population is None or listed is None:
        raise SerialError("a world in which robots come and go, without saying which are there")
    numbers = listed.made(np.int64, population.numbers.shape, "the numbers of robots")
    within(numbers, NOBODY, following - 1, "the numbers of robots")
    there = numbers[numbers >= 0]
    if len(np.unique(there)) < len(there) or not population.following <= following <= MAX_BIRTHS:
        raise SerialError("robots with the same number, or with numbers that none can have")
    if not {*state.awaited} <= {*population.awaited} or not 0 <= state.added <= following:
        raise SerialError("robots that are to come, of which the scenario knows nothing")
    population.numbers[:], population.following = numbers, following
    population.awaited = [sort for sort in population.awaited if sort in state.awaited]
    population.added = state.added
    population.present[:] = numbers >= 0
    simulator.renumber()


def _fill(world: World, state: SimulatorState) -> None:
    try:
        things = unpack(Things, state.things)
        world.fill(dict(zip(things.numbers, things.shapes, strict=True)), state.following)
    except (ValueError, SleepcastError) as error:
        raise SerialError(f"what stands in the world: {error}") from None


def _check(simulator: Simulator) -> None:
    """Raises SerialError for columns that no run can produce: the next ticks rely on them."""
    bodies = simulator.bodies
    for name in ("x", "y", "encoder_x", "encoder_y", "target_x", "target_y"):
        within(getattr(bodies, name), -2.0 * MAX_WORLD, 2.0 * MAX_WORLD, name)
    for name in ("heading", "encoder_heading"):
        within(getattr(bodies, name), -4.0, 4.0, name)
    for name in ("speed", "left", "right", "wanted_speed", "wanted_turn", "swing", "roaming"):
        within(getattr(bodies, name), -np.finfo(np.float64).max, np.finfo(np.float64).max, name)
    within(bodies.mode, min(Mode), max(Mode), "mode")
    if simulator.scenario.robots.omni:
        for name, speeds in (("wanted_side", bodies.wanted_side), ("side_speed", bodies.side_speed[bodies.omni])):
            within(speeds, -np.finfo(np.float64).max, np.finfo(np.float64).max, name)
    if bodies.flight is not None:
        for name in ("velocity_x", "velocity_y", "wanted_side", "wanted_climb"):
            within(bodies.flight.columns[name], -np.finfo(np.float64).max, np.finfo(np.float64).max, name)
        if bodies.flight.pitch is not None:
            within(bodies.flight.pitch, -2.0, 2.0, "pitch")
        if bodies.flight.wings is not None:
            within(bodies.flight.wings.airspeed, 0.0, 10_000.0, "airspeed")
        within(np.nan_to_num(bodies.flight.z), -2.0 * HIGHEST, 2.0 * HIGHEST, "z")
        if homes := bodies.flight.homes:
            within(np.stack((homes.x, homes.y)), -2.0 * MAX_WORLD, 2.0 * MAX_WORLD, "homes")
            within(homes.z, -2.0 * HIGHEST, 2.0 * HIGHEST, "z of homes")
        if air := bodies.flight.air:
            within(np.stack((air.east, air.north)), -FASTEST_WIND, FASTEST_WIND, "wind")
            within(np.nan_to_num((air.anchor_x, air.anchor_y)), -2.0 * MAX_WORLD, 2.0 * MAX_WORLD, "anchor")
    for ring in bodies.rings:
        columns = ring.arrays()
        if columns:
            _check_firing(ring.firing, ring.ring.count)
        if ring.crosstalk:
            within(columns["ping_by"], 0, ring.ring.count - 1, "ping_by")
            within(columns["ping_next"], 0, columns["ping_by"].shape[1] - 1, "ping_next")
    if simulator.scenario.pings is not None:
        within(simulator.senses.arrays()["pings"], 0, simulator.scenario.pings.queue, "pings")
    for x, y, heading, *z in simulator.senses.delayed_poses():
        within(np.stack((x, y)), -2.0 * MAX_WORLD, 2.0 * MAX_WORLD, "places of neighbours")
        within(heading, -4.0, 4.0, "headings of neighbours")
        within(np.nan_to_num(z), -2.0 * HIGHEST, 2.0 * HIGHEST, "z of neighbours")
    if simulator.senses.stocks is not None:
        for name, values in simulator.senses.stocks.arrays().items():
            within(values, 0.0, np.finfo(np.float64).max, name)
    for field in simulator.scenario.fields:
        if isinstance(field, ScalarField) and (growth := field.growth):
            columns = simulator.senses.arrays()
            within(columns[f"amount of field {field.name}"], 0.0, growth.most, f"amount of field {field.name}")
            within(columns[f"wanted of field {field.name}"], 0.0, np.finfo(np.float64).max, "wanted of a field")
            within(columns[f"cells of field {field.name}"], 0, growth.columns * growth.rows - 1, "cells of a field")
            if growth.delay:
                ticks = growth.delay / simulator.scenario.tick + 1.0
                within(columns[f"waiting of field {field.name}"], 0, ticks, "waiting of a field")


def _check_firing(firing: Firing, sonars: int) -> None:
    """Raises SerialError for a firing state that no run can produce."""
    within(firing.due, 0.0, np.inf, "due")
    within(firing.order, 0, sonars - 1, "order")
    within(firing.length, AT_ONCE, firing.order.shape[1], "length")
    within(firing.pause, 0.0, MAX_PAUSE, "pause")
    within(firing.turn, 0, firing.order.shape[1] - 1, "turn")
    if (firing.turn > np.maximum(firing.length - 1, 0)).any():
        raise SerialError("turn is not everywhere within the order")


# ---- the scenario


def scenario_of(data: bytes) -> Scenario:
    """The scenario packed into `data`. Raises SerialError if it cannot be simulated."""
    try:
        scenario = unpack(Scenario, data)
    except (ValueError, RecursionError, SleepcastError) as error:
        raise SerialError(f"the scenario in it is not one of this version: {error}") from None
    for name, number, least, most in _bounds(scenario):
        if not least <= number <= most:
            raise SerialError(f"a scenario with {number} {name}, wanted {least:g} to {most:g}")
    if _has_nan(scenario):
        raise SerialError("a scenario with a number that is none")
    return scenario


def _bounds(scenario: Scenario) -> Iterator[tuple[str, float, float, float]]:
    """All values that memory or run time depend on: name, value, least and most."""
    yield "s in a tick", scenario.tick, 1e-3, 60.0
    yield "s between two samples", scenario.telemetry, LEAST, MAX_TIME
    yield "simulated s in a second", scenario.speed_up, 1e-3, 1e6
    yield "m across the world", scenario.width, LEAST, MAX_WORLD
    yield "m up the world", scenario.height, LEAST, MAX_WORLD
    yield "robots", scenario.robots.count, 1, MAX_ROBOTS
    yield "rows of robots", sum(rooms(scenario)), 1, MAX_ROBOTS
    yield "links cut", len(scenario.cuts), 0, MAX_EVENTS
    for cut in scenario.cuts:
        yield "index of who is cut off", cut.robot, 0, scenario.robots.count - 1
        yield "s until a link is cut", cut.time, 0.0, MAX_TIME
        yield "s for which a link is cut", cut.lasts, 0.0, inf
    yield "lights", len(scenario.lights), 0, MAX_LIGHTS
    if scenario.pings is not None:
        yield "pings waiting", scenario.pings.queue, 1, MAX_QUEUE
    if scenario.neighbours is not None:
        yield "shared numbers", len(scenario.neighbours.shares), 0, MAX_SHARES
        yield "groups that neighbours see", len(scenario.neighbours.shows_groups), 0, MAX_SHOWN_GROUPS
        yield "s of delay of neighbours", scenario.neighbours.delay, 0.0, MAX_TIME
        yield "robots and ticks of a delay", delayed_rows(scenario), 0, MAX_DELAYED
        yield "shared numbers of no known unit", len({*scenario.neighbours.shares.values()} - {"", *UNITS}), 0, 0
    if scenario.laser is not None:
        yield "beams", scenario.laser.beams, 1, min(MAX_BEAMS, MAX_RANGES // scenario.robots.count)
        yield "rad to the first beam", scenario.laser.first, -TURN, TURN
        yield "rad between beams", scenario.laser.increment, LEAST_FIELD / MAX_BEAMS, TURN
        yield "m in reach of a scanner", scenario.laser.reach, LEAST, MAX_WORLD
    if scenario.wind is not None:
        yield "m/s of wind", scenario.wind.fastest, 0.0, FASTEST_WIND
        yield "swirls of the wind", len(scenario.wind.flow.swirls), 0, MAX_PARTS
        yield "m as a gust", scenario.wind.gust_size, LEAST, MAX_WORLD
    if scenario.ground is not None:
        yield "m as the ground", scenario.ground.low, 0.0, HIGHEST
        yield "m as the highest ground", scenario.ground.high, 0.0, HIGHEST
        yield from bounds_of_picture(scenario.ground)
    if scenario.predation is not None:
        yield "m in reach of who eats", scenario.predation.reach, LEAST, MAX_WORLD
        yield "m as a patch", scenario.predation.cell or MAX_WORLD, LEAST, MAX_WORLD
    stores = {store.name for store in scenario.robots.stores} | {""}
    yield "stocks", len(scenario.stocks), 0, MAX_STOCKS
    yield "stocks of no known store", len({stock.store for stock in scenario.stocks} - stores), 0, 0
    yield "stocks of no known unit", len({stock.unit for stock in scenario.stocks} - {"", *UNITS}), 0, 0
    yield from bounds_of_fields(scenario.fields, (scenario.width, scenario.height), scenario.tick)
    for robots in (scenario.robots, *scenario.sorts):
        yield from _bounds_of(robots)
    for robots, part in zip(scenario.each_type, slices(scenario.each_type, scenario.robots.count), strict=True):
        yield from _bounds_of_starts(robots.starts, part.stop - part.start, (scenario.width, scenario.height))
    names = given_names(scenario.each_type, scenario.robots.count)
    yield "names that several robots have", len(names) - len(set(names)), 0, 0
    yield "names that no robot can have", sum(not is_robot_name(name) for name in names), 0, 0


def _bounds_of(robots: RobotSpec) -> Iterator[tuple[str, float, float, float]]:
    """The same values for one type of robots."""
    ring = robots.ring
    yield "robots of a type", robots.count, 0, MAX_ROBOTS
    yield "m as a radius", robots.geometry.radius, LEAST, MAX_WORLD
    for limit in (robots.limits.speed, robots.limits.turn_rate, robots.limits.acceleration):
        yield "as a limit of motion", limit, LEAST, 10_000.0
    if robots.flight is not None:
        yield "m/s as a climb rate", robots.limits.climb, LEAST, 10_000.0
        yield "m/s as a stall speed", robots.flight.stall, 0.0, robots.limits.speed
        yield "rad of bank", robots.flight.bank, MIN_BANK if robots.flight.stall else 0.0, MAX_BANK
        yield "m as a circle", robots.flight.circle, 0.0, HIGHEST
        yield "m/s in a landing", robots.flight.sink, LEAST, 10_000.0
        yield "m as a ceiling", robots.limits.ceiling, robots.limits.floor, HIGHEST
        yield "rad of a camera", robots.camera, LEAST_ANGLE if robots.camera else 0.0, WIDEST_ANGLE
    yield "stores", len(robots.stores), 0, MAX_STORES
    yield "sonars", robots.geometry.sonars, 0, 360
    yield "bumpers", robots.bumpers, 0, MAX_BUMPERS
    yield "robots at one time", robots.most, 0, MAX_ROBOTS
    yield "s until robots come", robots.at, 0.0, MAX_TIME
    yield "robots in groups", sum(group.count for group in robots.groups), 0, MAX_ROBOTS
    if robots.wheels is not None:
        yield "m between wheels", robots.wheels.track, LEAST, MAX_WORLD
    if ring is not None:
        yield "sonars", ring.count, 1, MAX_SONARS
        yield "rad in a beam", ring.beam, LEAST, WIDEST_BEAM
        yield "m in reach of a sonar", ring.most, LEAST, MAX_WORLD
        yield "sonars in an order", len(ring.order), 1, MAX_ORDER
        for sonar in ring.order:
            yield "as a sonar in an order", sonar, 0, ring.count - 1


def _bounds_of_starts(
    starts: Starts, count: int, size: tuple[float, float]
) -> Iterator[tuple[str, float, float, float]]:
    """The same values for where `count` robots of one type start. size: of the world, m."""
    if isinstance(starts, Formation):
        yield "columns", starts.columns, 0, MAX_STARTS
        yield "m between robots", starts.spacing, 0, MAX_WORLD
    elif starts:
        yield "starts", len(starts), count, MAX_STARTS
    for axis, side in enumerate(size) if starts else ():
        places = start_columns(starts, count)[axis]
        yield "m to the first start", places.min(initial=0.0), -SLACK, side
        yield "m to the last start", places.max(initial=0.0), 0, side + SLACK


def _has_nan(value: object) -> bool:
    if isinstance(value, float):
        return isnan(value)
    if is_dataclass(value) and not isinstance(value, type):
        return any(_has_nan(getattr(value, field.name)) for field in fields(value))
    if isinstance(value, dict):
        return any(map(_has_nan, value.values()))
    return isinstance(value, tuple) and any(map(_has_nan, value))
