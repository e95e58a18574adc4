"""The driver: swarm and server take turns, and a change of pace is seen at once."""

from __future__ import annotations

import asyncio
import struct
from pathlib import Path
from threading import Event
from time import sleep, thread_time

import pytest

from console.running import PATIENCE
from sleepcast.console.adapters.swarm import SwarmAdapter
from sleepcast.console.driver import FRAME_PERIOD, HEARD_AFTER, SLICE, Driver
from sleepcast.core.clock import ManualClock, WallClock
from sleepcast.loop import Pace, Swarm
from small_worlds import simulator


@pytest.fixture
def driver(tmp_path: Path) -> Driver:
    swarm = Swarm(simulator(tmp_path))
    clock = WallClock()
    return Driver(SwarmAdapter(swarm), Pace(clock, swarm, 10.0), clock)


def tick_in(frame: bytes) -> int:
    found: int = struct.unpack_from("<I", frame, 12)[0]
    return found


def drive(driver: Driver, job: object) -> None:
    """Run a coroutine function beside the driver."""

    async def both() -> None:
        running = asyncio.create_task(driver.run())
        try:
            await asyncio.wait_for(job(), PATIENCE)  # type: ignore[operator]
        finally:
            running.cancel()
            await asyncio.wait({running})

    asyncio.run(both())


def test_time_runs_and_frames_come(driver: Driver) -> None:
    async def job() -> None:
        first = await driver.frame_after(0)
        later = first
        for _ in range(10):
            later = await driver.frame_after(driver.number)
        assert tick_in(later) > tick_in(first)
        assert int.from_bytes(later[8:12], "little") == driver.number >= 11

    drive(driver, job)


def test_the_page_is_served_while_what_ticks_take_is_prepared(tmp_path: Path) -> None:
    swarm, clock, ready = Swarm(simulator(tmp_path)), WallClock(), Event()

    def prepare() -> None:
        assert ready.wait(PATIENCE)

    driver = Driver(SwarmAdapter(swarm), Pace(clock, swarm, 10.0), clock, prepare)

    async def job() -> None:
        assert tick_in(await driver.frame_after(0)) == 0
        assert driver.frame[1] & 4  # and says so
        driver.draw()  # as when somebody asks for another pace
        assert tick_in(await driver.frame_after(1)) == 0
        driver.step()  # a tick would wait for what is being prepared, and the server with it
        assert tick_in(await driver.frame_after(2)) == 0
        ready.set()
        while driver.frame[1] & 4:  # also while time stands still
            await driver.frame_after(driver.number)
        driver.set_pace(running=True)
        while tick_in(await driver.frame_after(driver.number)) < 2:
            pass

    drive(driver, job)


def test_frames_come_no_faster_than_the_eye_needs_them(driver: Driver) -> None:
    async def job() -> None:
        await driver.frame_after(0)
        before, start = driver.number, asyncio.get_running_loop().time()
        await asyncio.sleep(0.5)
        lasted = asyncio.get_running_loop().time() - start
        assert 1 <= driver.number - before <= lasted / FRAME_PERIOD + 2

    drive(driver, job)


def test_the_next_picture_after_a_stop_is_of_the_tick_that_heard_it(tmp_path: Path) -> None:
    swarm = Swarm(simulator(tmp_path))
    driver = Driver(SwarmAdapter(swarm), Pace(WallClock(), swarm, 10.0), ManualClock())  # so no frame is ever due

    async def job() -> None:
        await driver.frame_after(2)
        driver.expedite()
        sent, drawn = driver.swarm.tick, driver.number
        assert tick_in(await driver.frame_after(drawn)) >= sent + HEARD_AFTER
        assert driver.number == drawn + 1
        driver.set_pace(running=False)
        drawn = driver.number
        driver.expedite()  # no tick will hear it now
        assert driver.number == drawn + 1

    drive(driver, job)


def test_while_paused_nothing_moves_and_nothing_is_drawn_until_a_step(driver: Driver) -> None:
    async def job() -> None:
        await driver.frame_after(0)
        driver.set_pace(running=False)
        paused = driver.frame
        await asyncio.sleep(0.2)
        assert driver.frame is paused
        assert paused[1] & 1 == 0
        driver.step()
        assert tick_in(driver.frame) == tick_in(paused) + 1
        driver.set_pace(running=True, factor=20.0)
        while tick_in(driver.frame) < tick_in(paused) + 5:
            await driver.frame_after(driver.number)
        assert struct.unpack_from("<f", driver.frame, 24) == (20.0,)

    drive(driver, job)


def test_the_server_has_its_turn_however_fast_time_is_wanted(driver: Driver) -> None:
    driver.set_pace(factor=10_000.0)  # more than any machine reaches: every slice is used up

    async def job() -> None:
        waits = []
        for _ in range(50):
            start = thread_time()  # of the processor: what else the machine does is not the driver's fault
            await asyncio.sleep(0.0)
            waits.append(thread_time() - start)
        # One turn of the driver lies in between: a slice, its last tick, perhaps a frame.
        assert sorted(waits)[25] < 5 * SLICE

    drive(driver, job)


def test_an_answer_does_not_wait_for_a_long_tick_before_each_of_its_steps(driver: Driver) -> None:
    ticks: list[float] = []

    def tick(budget: float) -> int:
        ticks.append(budget)
        sleep(5 * SLICE)
        return 1

    driver.pace.keep_up = tick  # type: ignore[method-assign]

    async def job() -> None:
        await driver.frame_after(1)
        before = len(ticks)
        for _ in range(8):
            await asyncio.sleep(0.0)
        assert len(ticks) - before <= 3

    drive(driver, job)


def test_what_ends_the_swarm_is_raised(driver: Driver) -> None:
    async def job() -> None:
        running = asyncio.create_task(driver.run())
        driver.pace.keep_up = lambda budget: 1 // 0  # type: ignore[method-assign]
        with pytest.raises(ZeroDivisionError):
            await running

    asyncio.run(job())
