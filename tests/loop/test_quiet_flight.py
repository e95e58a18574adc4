"""Quiet ticks of what flies come to the same as all others, bit for bit, also where bodies touch and crash."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from loop.test_quiet import LAST, LOOKS, at_once, few, singly
from sleepcast.fleet.native.kernels import HOT
from sleepcast.loop import Swarm, snapshot
from sleepcast.loop.quiet import QuietTicks
from sleepcast.robot import FENCE_AHEAD, brought_to_rest
from sleepcast.simulator import Wall, read_scenario
from sleepcast.simulator.bodies.fences import HELD_BACK
from swarms import desk_of, swarm_of

pytest.importorskip("numba")

SKY = """
format = 2
title = "a crowded sky"
seconds = "1min"

[world]
width = "16m"
height = "14m"
{edge}

[robots]
like = "copter"
count = {count}
z = ["0m", "9m"]

[robots.body]
radius = "0.3m"

[robots.flight]
hovers = "30s"

[robots.stores.battery]
start = ["5%", "100%"]

[neighbours]
reach = "6m"
"""
RULES = (
    "(RULE up (WHEN (< z 1m) (SETQ drive_climb 0.4m/s)))",
    "(RULE away (WHEN (< (NEAREST_DIST 5m) 3m) (SETQ drive_climb (IF (< (NEAREST_Z 5m) z) 0.5m/s -0.5m/s))))",
    "(RULE stroll (SETQ drive_speed (+ 1 (* 0.1 (COUNT 5m)))))",
    "(RULE turn (WHEN (PROB 5%) (SETQ drive_turn (RANDOM -1 1)) (SETQ drive_side (RANDOM -1 1))))",
)


def sky(seed: int = 3, count: int = 40, edge: str = "", threads: int = 1) -> Swarm:
    """Copters that take off, stroll, avoid each other badly, and run dry."""
    swarm = swarm_of(read_scenario(SKY.format(count=count, edge=edge)), seed, threads)
    for text in ("(WHEN (NOT flying) (TAKEOFF 2m))", *RULES):
        desk_of(swarm).send(text, everybody=True)
    return swarm


def crashed(swarm: Swarm) -> int:
    flight = swarm.simulator.bodies.flight
    assert flight is not None
    return int(flight.crashed.sum())


@pytest.mark.parametrize("edge", ["", 'edge = "torus"'])
def test_who_touches_in_a_quiet_tick_crashes_as_always(edge: str) -> None:
    expected, swarm = sky(22, edge=edge), sky(22, edge=edge)  # in which enough of them meet on their ways
    for before, look in zip((0, *LOOKS), LOOKS, strict=False):
        singly(expected, look - before)
        at_once(swarm, look - before)
        assert snapshot(swarm) == snapshot(expected), f"at tick {look}"
    assert swarm.quiet.ticks >= 0.8 * (LAST - 2 * HOT), "once the rules are native"
    assert expected.quiet.ticks == 0
    assert 3 < crashed(swarm) < 40
    reports = [(each.heard, each.robot, each.body["label"]) for each in desk_of(swarm).reports]
    assert reports == [(each.heard, each.robot, each.body["label"]) for each in desk_of(expected).reports]
    told = {label for _, _, label in reports}
    assert told & {brought_to_rest(FENCE_AHEAD), HELD_BACK} if edge == "" else not told & {HELD_BACK}


@pytest.mark.parametrize("threads", [1, 2])
def test_worlds_on_the_ground_and_in_the_air_make_their_ticks_in_one_call(threads: int) -> None:
    def made() -> list[Swarm]:
        return [sky(1, 30), swarm_of(few("crowd", 9), 1, 1), sky(2, 50), sky(5, 3)]

    alone, together = made(), made()
    ticks = QuietTicks(together, threads)
    for swarm in alone:
        singly(swarm, LAST)
    for _ in range(12):
        ticks.step(5)
        for swarm in together:
            at_once(swarm, 0)
    for one, other in zip(together, alone, strict=True):
        assert snapshot(one) == snapshot(other)
        assert one.quiet.ticks > 20
    assert crashed(together[0]) > 0


def test_threads_make_no_difference() -> None:
    one, two = sky(threads=1), sky(threads=2)
    for swarm in (one, two):
        at_once(swarm, LAST)
    assert snapshot(one) == snapshot(two)


CHUNKS = st.lists(
    st.tuples(st.integers(1, 30), st.sampled_from(["wait", "stop", "release", "wall", "open", "place", "land", "goto"]))
)


@settings(max_examples=8, deadline=None)
@given(CHUNKS)
def test_any_chunks_come_to_the_same(chunks: list[tuple[int, str]]) -> None:
    expected, swarm = sky(7, 12), sky(7, 12)
    for each, how in ((expected, singly), (swarm, at_once)):
        how(each, 8)
        desk, simulator, walls = desk_of(each), each.simulator, list[str]()
        for ticks, what in chunks:
            if what == "stop":
                desk.stop()
            elif what == "release":
                desk.release()
            elif what == "wall":
                walls.append(simulator.world.add(Wall(((8.0, 0.0), (8.0, 14.0)), tall=4.0)))
            elif what == "open" and walls:
                simulator.world.remove(walls.pop())
            elif what == "place":
                simulator.place(0, 5.0, 5.0, 0.5)
            elif what == "land":
                desk.send("(WHEN (= (MOD id 3) 1) (LAND))", everybody=True)
            elif what == "goto":
                desk.send("(WHEN (= (MOD id 2) 1) (GOTO 4m 4m 3m))", everybody=True)
            how(each, ticks)
    assert snapshot(swarm) == snapshot(expected)
