"""Quiet ticks, made by compiled code alone, come to the same as all others, bit for bit, in one world or in many."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf
from threading import Thread
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sleepcast.api.assembly import assemble
from sleepcast.columns.values import Rows
from sleepcast.fleet.native import compiler
from sleepcast.fleet.native.kernels import HOT, SequencePlan
from sleepcast.loop import Swarm, snapshot, step_swarm
from sleepcast.loop.quiet import QuietTicks
from sleepcast.simulator import Changes, Scenario, Simulator, choose, find_scenario, scenario_names
from sleepcast.simulator.quiet.blocks import BodyBlock, WorldTable
from sleepcast.station import JournalEvent
from swarms import desk_of, drive, settle, station_of, swarm_of

pytest.importorskip("numba")

LAST = 60
LOOKS = (7, 33, LAST)
"""Ticks after which snapshots are compared."""
FEW = 24
LOSSY = (("radio.loss", 0.1),)


def few(name: str, robots: int = FEW, over: tuple[tuple[str, object], ...] = ()) -> Scenario:
    """A scenario of the gallery, with few robots if it may have any number."""
    whole = find_scenario(name)
    fixed = whole.robots.groups or whole.robots.count < robots
    return find_scenario(name, Changes(None if fixed else robots, over=over))


def singly(swarm: Swarm, ticks: int) -> None:
    """Let so many ticks pass, each as a tick with messages."""
    for _ in range(ticks):
        step_swarm(swarm)
        settle(swarm)


def at_once(swarm: Swarm, ticks: int) -> None:
    """Let so many ticks pass, as many at once as may be."""
    while ticks:
        ticks -= swarm.advance(ticks)
        settle(swarm)


def compare(scenario: Scenario, threads: int = 1) -> Swarm:
    """Compare a run by quiet ticks with one without; gives the first."""
    expected, swarm = (swarm_of(scenario, 3, threads) for _ in range(2))
    for before, look in zip((0, *LOOKS), LOOKS, strict=False):
        singly(expected, look - before)
        at_once(swarm, look - before)
        assert snapshot(swarm) == snapshot(expected), f"at tick {look}"
    assert expected.quiet.ticks == 0
    return swarm


@pytest.mark.parametrize(
    ("name", "over"),
    [
        pytest.param(name, over, marks=pytest.mark.nightly if (number + bool(over)) % 2 else (), id=f"{name}{over}")
        for number, name in enumerate(scenario_names())
        for over in ((), LOSSY)
    ],
)
def test_each_scenario_runs_the_same(name: str, over: tuple[tuple[str, object], ...]) -> None:
    swarm = swarm_of(few(name), 3, 1)
    if swarm.quiet.block is None:  # no compiled code does all that its bodies do
        at_once(swarm, 10)
        assert swarm.quiet.ticks == 0
        return
    compare(few(name, over=over))


def test_hardly_any_tick_of_a_crowd_at_work_is_not_quiet() -> None:
    swarm = compare(few("crowd"))
    assert swarm.quiet.ticks >= 0.8 * LAST
    sees = swarm_of(few("crowd"), 3, 1)
    sees.simulator.world.add(next(iter(sees.simulator.world.shapes.values())))
    at_once(sees, LAST)
    assert sees.quiet.ticks >= 0.8 * LAST


@pytest.mark.parametrize(
    ("name", "over"),
    [
        ("gauci", ()),
        ("crowd", (("robots.body.contact", "slide"),)),
        ("vicsek", ()),
        ("vicsek", (("robots.wheels", {"track": "1cm", "slip_noise": "1mm"}),)),
        ("couzin", ()),
    ],
)
def test_bodies_that_slide_or_go_round_a_torus_are_quiet_too(name: str, over: tuple[tuple[str, object], ...]) -> None:
    assert compare(few(name, over=over)).quiet.ticks >= 0.8 * LAST


def test_whoever_asks_after_quiet_ticks_senses_its_neighbours_as_they_are_now() -> None:
    found = []
    for how in (singly, at_once):
        swarm = swarm_of(few("vicsek"), 3, 1)
        for _ in range(3):
            how(swarm, 12)
            found.append(swarm.values_of("(+ (COUNT 0.4) (MEAN_X 0.4))").tobytes())
    assert found[:3] == found[3:]


def test_threads_make_no_difference() -> None:
    one, two = (swarm_of(few("crowd", 30), 3, threads) for threads in (1, 2))
    for swarm in (one, two):
        at_once(swarm, LAST)
    assert two.quiet.ticks >= 0.8 * LAST
    assert snapshot(one) == snapshot(two)


@pytest.mark.parametrize("threads", [1, 2])
def test_many_worlds_make_their_ticks_in_one_call(threads: int) -> None:
    def made() -> list[Swarm]:
        worlds = [swarm_of(few("crowd", robots), seed, 1) for seed, robots in ((1, 9), (2, 20), (3, 33))]
        return [*worlds, swarm_of(few("election"), 4, 1)]

    alone, together = made(), made()
    ticks = QuietTicks(together, threads)
    for before, look in zip((0, *LOOKS), LOOKS, strict=False):
        for swarm in alone:
            singly(swarm, look - before)
        for _ in range(look - before - 5):
            ticks.step()
            for swarm in together:
                settle(swarm)
        ticks.step(5)
        for one, other in zip(together, alone, strict=True):
            assert snapshot(one) == snapshot(other), f"at tick {look}"
    assert all(swarm.quiet.ticks >= 0.8 * LAST for swarm in together[:3])


def test_a_world_takes_the_place_of_another() -> None:
    def made(seed: int, robots: int = 9) -> Swarm:
        return swarm_of(few("crowd", robots), seed, 1)

    worlds, later = [made(1), made(2), swarm_of(few("election"), 3, 1)], [made(4, 20), swarm_of(few("election"), 5, 1)]
    ticks = QuietTicks(worlds)
    ticks.step(12)
    for number, swarm in enumerate(later):
        ticks.replace(number, swarm)
    ticks.replace(2, made(6))
    ticks.step(9, [0, 2])
    ticks.step(3)
    assert [swarm.simulator.tick for swarm in (*worlds, *later)] == [12, 12, 12, 12, 3]
    for swarm, alone in ((worlds[1], made(2)), (later[0], made(4, 20)), (later[1], swarm_of(few("election"), 5, 1))):
        singly(alone, swarm.simulator.tick)
        assert snapshot(swarm) == snapshot(alone)


def test_commands_of_all_sorts_come_between_quiet_ticks() -> None:
    def commanded(how: Callable[[Swarm, int], None]) -> bytes:
        swarm = swarm_of(few("crowd", 20), 5, 1)
        drive(swarm, LAST, lambda swarm: how(swarm, 1))
        return snapshot(swarm)

    assert commanded(at_once) == commanded(singly)


@pytest.mark.parametrize(
    ("texts", "walked"),
    [
        (["(RULE odd (WHEN (> (MOD (+ id (FLOOR time)) 5) 3) (SETQ drive_speed (+ nobody 1))))"], True),
        (["(RULE odd (SETQ drive_speed (* 0.1 (SQRT (- (MOD (+ id (FLOOR time)) 7) 3)))))"], True),
        (
            ["(DEFUN pace (a) (IF (PROB 30%) (+ a (RANDOM 0 0.1)) a))", "(RULE odd (SETQ drive_speed (pace 0.3)))"],
            False,
        ),
    ],
)
def test_robots_that_have_to_be_walked_end_a_call_but_nothing_else(texts: list[str], walked: bool) -> None:
    expected, swarm = (swarm_of(few("crowd", 20), 5, 1) for _ in range(2))
    finished = list[int]()
    resume = swarm.fleet.scheduler.resume

    def noted(plan: SequencePlan, leg: int, left: Rows) -> None:
        finished.append(left.size)
        resume(plan, leg, left)

    swarm.fleet.scheduler.resume = noted  # type: ignore[method-assign]  # to count how often it is needed
    for each, how in ((expected, singly), (swarm, at_once)):
        how(each, 20 + 2 * HOT)
        for text in texts:
            desk_of(each).send(text, everybody=True)
        how(each, 40 + 2 * HOT)
    assert swarm.quiet.ticks > 20
    assert (len(finished) > 0) == walked
    assert snapshot(swarm) == snapshot(expected)


CHUNKS = st.lists(st.tuples(st.integers(1, 40), st.sampled_from(["wait", "stop", "release", "wall", "place", "ask"])))


@settings(max_examples=8, deadline=None)
@given(CHUNKS)
def test_any_chunks_come_to_the_same(chunks: list[tuple[int, str]]) -> None:
    expected, swarm = (swarm_of(few("crowd", 8), 7, 1) for _ in range(2))
    for each, how in ((expected, singly), (swarm, at_once)):
        how(each, 8)
        for ticks, what in chunks:
            if what == "stop":
                desk_of(each).stop()
            elif what == "release":
                desk_of(each).release()
            elif what == "wall":
                world = each.simulator.world
                world.move(next(iter(world.shapes)), 0.05, 0.0)
            elif what == "place":
                each.simulator.place(0, 1.0, 1.0, 0.5)
            elif what == "ask":
                each.values_of("(+ x front_range)")
            how(each, ticks)
    assert snapshot(swarm) == snapshot(expected)


@pytest.mark.parametrize("lease", [inf, 1.0])
def test_a_desk_that_drives_repeats_what_is_not_confirmed(lease: float) -> None:
    """Whether or not robots want to hear of their operator all the time."""

    def stopped(how: Callable[[Swarm, int], None]) -> bytes:
        whole = few("crowd", 8, (("radio.loss", 0.7),))
        scenario = replace(whole, mission=(), minds=replace(whole.minds, lease=lease))
        swarm, desk = assemble(scenario, 3, mission=False, threads=1)
        desk.hold(True)
        how(swarm, 20)
        desk.stop()
        how(swarm, LAST)
        repeats = [each for each in desk.journal.entries() if each.event is JournalEvent.REPEATED]
        assert len(repeats) > 1
        return snapshot(swarm)

    assert stopped(at_once) == stopped(singly)


def test_a_run_without_commands_ends_with_the_same_snapshot() -> None:
    expected, swarm = (swarm_of(replace(few("crowd"), mission=()), 3, 1) for _ in range(2))
    singly(expected, LAST)
    at_once(swarm, LAST)
    assert swarm.quiet.ticks == LAST
    assert snapshot(swarm) == snapshot(expected)


def test_telemetry_that_nobody_has_to_see_ends_no_call(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sampled by compiled code, it is the same; a desk that counts who is stopped is told of each sample."""

    def told(how: Callable[[Swarm, int], None], *, stops: bool) -> bytes:
        swarm = swarm_of(replace(few("crowd"), mission=()), 3, 1)
        how(swarm, 12)
        if stops:
            desk_of(swarm).stop()
        calls.clear()
        how(swarm, 43)
        return snapshot(swarm)

    calls, make = list[object](), BodyBlock.make

    def counted(block: BodyBlock) -> None:
        calls.append(block)
        make(block)

    monkeypatch.setattr(BodyBlock, "make", counted)
    for stops in (False, True):
        quiet = told(at_once, stops=stops)
        assert len(calls) > 4 if stops else len(calls) == 1
        assert quiet == told(singly, stops=stops)


def test_a_snapshot_does_not_depend_on_when_native_code_was_ready() -> None:
    def told(how: Callable[[Swarm, int], None]) -> bytes:
        swarm = swarm_of(replace(few("crowd", 8), mission=()), 3, 1)
        swarm.step()
        desk_of(swarm).send("(RULE rare (WHEN (< x -1km) (SETQ drive_turn 1)))", everybody=True)
        how(swarm, LAST)
        return snapshot(swarm)

    def walked(swarm: Swarm, ticks: int) -> None:
        assert swarm.fleet.kernels is not None
        swarm.fleet.memory.kernels = None
        singly(swarm, ticks)

    assert told(at_once) == told(walked)


def test_worlds_have_the_scratch_memory_of_the_thread_that_steps_them() -> None:
    here, there, larger, expected = (swarm_of(few("crowd", robots), 3, 1) for robots in (9, 9, 20, 9))
    for swarm in (here, there, larger):
        at_once(swarm, 10)
        at_once(here, 10)
        at_once(there, 10)
        block, beside = here.quiet.block, there.quiet.block
        assert block is not None
        assert beside is not None
        assert block.scratch is beside.scratch
        other = Thread(target=at_once, args=(here, 10))
        other.start()
        other.join()
        assert block.scratch is not beside.scratch
    singly(expected, here.simulator.tick)
    assert snapshot(here) == snapshot(expected)


@pytest.mark.parametrize("early", [False, True])
def test_ctrl_c_ends_a_call_between_two_ticks(monkeypatch: pytest.MonkeyPatch, early: bool) -> None:
    """It waits for compiled code, so that is where it comes nearly always."""

    def interrupting(made: Callable[..., None]) -> Callable[..., None]:
        def interrupted(*given: object) -> None:
            if not early:
                made(*given)
            raise KeyboardInterrupt

        return interrupted

    alone, together, expected = (swarm_of(few("crowd", 9), 3, 1) for _ in range(3))
    for swarm in (alone, together, expected):
        at_once(swarm, 13)
    with monkeypatch.context() as patch:
        patch.setattr(WorldTable, "make", interrupting(WorldTable.make))
        patch.setattr(BodyBlock, "make", interrupting(BodyBlock.make))
        with pytest.raises(KeyboardInterrupt):
            alone.advance(5)
        with pytest.raises(KeyboardInterrupt):
            QuietTicks([together]).step(5)
    for swarm in (alone, together):
        assert swarm.whole
        at_once(swarm, LAST - swarm.simulator.tick)
    singly(expected, LAST - 13)
    assert snapshot(alone) == snapshot(expected)
    assert snapshot(together) == snapshot(expected)


def test_what_goes_wrong_in_one_world_leaves_the_others_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    first, second, expected = (swarm_of(few("crowd", 9), 3, 1) for _ in range(3))
    for swarm in (first, second, expected):
        at_once(swarm, 13)
    with monkeypatch.context() as patch:
        patch.setattr(first.fleet, "tidy", lambda: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            QuietTicks([first, second]).step(5)
    singly(expected, second.simulator.tick - 13)
    assert not first.whole
    assert second.whole
    assert snapshot(second) == snapshot(expected)


def test_numpy_alone_makes_no_quiet_ticks() -> None:
    scenario = few("crowd")
    swarm = Swarm(Simulator(scenario, 3, choose("numpy")), scenario.mission)
    swarm.desk = station_of(swarm)
    at_once(swarm, 30)
    assert swarm.quiet.ticks == 0


def test_a_sender_sees_each_tick() -> None:
    swarm, seen = swarm_of(few("crowd"), 3, 1), list[int]()
    swarm.senders.append(lambda: seen.append(swarm.simulator.tick))
    at_once(swarm, 30)
    assert seen == list(range(30))


def test_code_that_is_kept_is_taken_sooner_than_rules_of_few_are_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    kept = dict[str, bytes]()
    monkeypatch.setattr(compiler, "CACHE", SimpleNamespace(load=kept.get, save=kept.__setitem__))

    def native_after() -> int:
        """Ticks until a rule that robots have got is native code."""
        compiler._compiled.cache_clear()
        swarm = swarm_of(few("crowd", 8), 3, 1)
        desk_of(swarm).send("(RULE slow (SETQ drive_speed (* 0.0123 id)))", everybody=True)
        assert swarm.fleet.kernels is not None
        for tick in range(10 * HOT):
            singly(swarm, 1)
            if any(not code.exception() for code in swarm.fleet.kernels._rules.values()):
                return tick
        raise AssertionError("it never was")

    assert native_after() - native_after() == HOT
