"""Many robots: commands, accounts, previews and memory at a hundred thousand, where everything must go in bulk."""

from __future__ import annotations

import gc
import tracemalloc
from time import thread_time

import numpy as np
import pytest

from sleepcast.loop import Swarm
from sleepcast.simulator import Changes, Simulator, find_scenario
from sleepcast.station import NO, UNKNOWN, YES, Command, Station

MANY = 100_000
NEAR = "(WHEN (AND (< (DIST x y vessel_x vessel_y) 5mi) (> fuel 50%) (> ordnance 70%)) (JOIN bravo))"


def manned(scenario: str) -> tuple[Swarm, Station]:
    simulator = Simulator(find_scenario(scenario, Changes(robots=MANY)))
    swarm = Swarm(simulator, simulator.scenario.mission if scenario == "crowd" else ())
    swarm.desk = station = Station(swarm.vocabulary, swarm.minds, swarm.post, swarm)
    return swarm, station


@pytest.fixture(scope="module")
def bravo() -> tuple[Swarm, Station]:
    """Scouts whose telemetry is there."""
    swarm, station = manned("bravo")
    swarm.run(1.2)
    return swarm, station


def tell(swarm: Swarm) -> None:
    """Go on until the robots have just sent telemetry."""
    swarm.step()
    while swarm.simulator.tick % swarm.telemetry_ticks:
        swarm.step()


def answered(swarm: Swarm, station: Station, text: str) -> tuple[Command, float]:
    """A command after all have answered, and the seconds of this thread that it took from the text to its account."""
    began = thread_time()
    command = station.send(text, everybody=True)
    swarm.run(0.3)
    assert station.accounting(command.id).complete
    return command, thread_time() - began


def test_a_command_takes_two_microseconds_a_robot_its_account_included(bravo: tuple[Swarm, Station]) -> None:
    swarm, station = bravo
    answered(swarm, station, NEAR)
    assert min(answered(swarm, station, NEAR)[1] for _ in range(3)) < 2e-6 * MANY
    simulator = swarm.simulator
    vessel = simulator.scenario.places[0]
    near = np.hypot(simulator.x - vessel.x, simulator.y - vessel.y) < 5 * 1852.0
    command, _ = answered(swarm, station, NEAR)
    assert 0 < station.accounting(command.id).n_matched <= near.sum()


def test_a_command_takes_less_than_two_hundred_bytes_a_robot(bravo: tuple[Swarm, Station]) -> None:
    """At its peak, beyond what the very same ticks take without it."""
    swarm, station = bravo
    answered(swarm, station, NEAR)
    tracemalloc.start()
    peaks = []
    for text in ("", "(WHEN (> fuel 50%) (DRIVE 1m/s 0deg/s) (MARK))"):
        tell(swarm)
        gc.collect()
        tracemalloc.reset_peak()
        before = tracemalloc.get_traced_memory()[0]
        if text:
            answered(swarm, station, text)
        else:
            swarm.run(0.3)
        peaks.append(tracemalloc.get_traced_memory()[1] - before)
    tracemalloc.stop()
    assert peaks[1] - peaks[0] < 200 * MANY


def test_a_preview_is_quicker_than_a_keystroke(bravo: tuple[Swarm, Station]) -> None:
    swarm, station = bravo
    tell(swarm)
    fuel = swarm.fleet.column(swarm.vocabulary.bindings["fuel"].slot)
    for text, codes in (
        ("(WHEN (> fuel 50%) (MARK))", np.where(fuel > 0.5, YES, NO)),
        ("(WHEN (AND (> fuel 50%) (PROB 0.5)) (MARK))", np.where(fuel > 0.5, UNKNOWN, NO)),
    ):
        times = []
        for _ in range(3):
            began = thread_time()
            found = station.preview(text)
            times.append(thread_time() - began)
        assert min(times) < 0.1
        assert np.array_equal(found.codes, codes)


def test_stop_and_release_reach_all_bodies(bravo: tuple[Swarm, Station]) -> None:
    swarm, station = bravo
    stop = station.stop()
    swarm.run(0.3)
    assert swarm.simulator.bodies.stopped.all()
    assert station.accounting(stop.id).n_matched == MANY
    release = station.release()
    swarm.run(0.3)
    assert not swarm.simulator.bodies.stopped.any()
    assert station.accounting(release.id).n_matched == MANY


def test_ten_rules_the_radio_and_the_desk_take_less_than_a_kilobyte_a_robot() -> None:
    """Besides the body; the telemetry that the desk keeps is a third of it."""
    pytest.importorskip("numba")
    simulator = Simulator(find_scenario("crowd", Changes(robots=MANY, walls=False)))
    tracemalloc.start()
    swarm = Swarm(simulator, simulator.scenario.mission)
    swarm.desk = station = Station(swarm.vocabulary, swarm.minds, swarm.post, swarm)
    swarm.run(1.2)
    gc.collect()
    taken = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    (command,) = station.commands()
    assert station.accounting(command.id).n_matched == MANY
    assert taken < 1_000 * MANY, f"{taken / MANY:.0f} bytes a robot"
