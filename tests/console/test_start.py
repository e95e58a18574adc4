"""How a run on the page begins, and what becomes of robots that have nothing left to drive with."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from console.asking import put
from console.running import Program, open_page
from sleepcast.api.assembly import assemble
from sleepcast.console.adapters.swarm import SwarmAdapter
from sleepcast.console.backend import Backend
from sleepcast.console.driver import Driver
from sleepcast.console.features.preview import GetPreview
from sleepcast.console.features.send import Send
from sleepcast.console.outgoing import Compiling, WatchedRobot
from sleepcast.core.clock import ManualClock
from sleepcast.core.errors import SleepcastError
from sleepcast.loop import Pace, Swarm
from sleepcast.simulator import KERNELS, load
from sleepcast.station import Station
from small_worlds import SMALL, write

EXHAUSTED = 32
THIRSTY = SMALL.replace('reach = "20km"', 'reach = "10m"').replace('start = ["20%", "100%"]', 'start = ["50%", "100%"]')


class Desk:
    """A small world behind a page that waits."""

    def __init__(self, folder: Path, text: str = SMALL) -> None:
        self.swarm: Swarm
        self.station: Station
        self.swarm, self.station = assemble(load(write(folder, text=text)), None, mission=False)
        seen, clock = SwarmAdapter(self.swarm), ManualClock()
        self.driver = Driver(seen, Pace(clock, self.swarm, 1.0), clock, waits=True)
        self.backend = Backend(seen, self.station, self.driver, clock)

    @property
    def waiting(self) -> bool:
        """As the page is shown."""
        self.driver.draw()
        return bool(self.driver.frame[1] & 8)


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    return Desk(tmp_path)


def test_the_first_command_starts_time(desk: Desk) -> None:
    assert desk.waiting
    desk.driver.set_pace(factor=5.0)
    assert desk.waiting
    put(desk.backend, Send, 1, "(WHEN (> battery 60%) (JOIN crew))", False)
    assert not desk.waiting
    assert not desk.driver.pace.paused


def test_while_the_simulator_is_compiled_the_page_counts_kernels(desk: Desk) -> None:
    assert not [said for said in desk.backend.news(-1) if isinstance(said, Compiling)]
    driver = Driver(desk.backend.driver.swarm, desk.driver.pace, ManualClock(), lambda: None)
    backend = Backend(SwarmAdapter(desk.swarm), desk.station, driver, ManualClock())
    (counted,) = [said for said in backend.news(-1) if isinstance(said, Compiling)]
    assert 0 <= counted.done <= counted.most == KERNELS


def test_a_question_starts_time_but_a_refused_command_does_not(desk: Desk) -> None:
    with pytest.raises(SleepcastError):
        put(desk.backend, Send, 1, "(JOIN", False)
    assert desk.waiting
    put(desk.backend, Send, 2, "battery", False, "ask")
    assert not desk.waiting


def test_a_command_in_a_pause_starts_nothing(desk: Desk) -> None:
    desk.driver.step()
    assert not desk.waiting
    put(desk.backend, Send, 1, "(WHEN (> battery 60%) (JOIN crew))", False)
    assert desk.driver.pace.paused


def test_stop_starts_nothing(desk: Desk) -> None:
    desk.backend.stop()
    assert desk.waiting


def test_the_start_picture_has_a_preview_and_looking_at_it_changes_no_run(desk: Desk, tmp_path: Path) -> None:
    assert put(desk.backend, GetPreview, 1, "(WHEN (> battery 60%) (MARK))").unknown == 20
    desk.driver.swarm.send_initial_telemetry()
    found = put(desk.backend, GetPreview, 2, "(WHEN (> battery 60%) (MARK))")
    assert found.unknown == 0
    assert 0 < found.yes < 20
    other = Desk(tmp_path)
    for each in (desk, other):
        each.station.send("(RULE go (DRIVE (* battery 2m/s) 10deg/s))", everybody=True)
        each.swarm.run(20.0)
    assert desk.swarm.simulator.state_hash() == other.swarm.simulator.state_hash()


def test_the_program_waits_at_its_start_picture_until_a_page_starts_it(tmp_path: Path) -> None:
    write(tmp_path)
    with Program("run", tmp_path, "--page", waits=True) as program, open_page(program) as page:
        while page.frame()[1] & 4:  # it makes itself ready
            pass
        page.tell("step")
        while not int.from_bytes(page.frame()[12:16], "little"):
            pass
        assert int.from_bytes(page.frames[-1][12:16], "little") == 1  # not one tick has passed before
        assert not page.frames[-1][1] & 8
        assert page.frames[0][1] & 8


def test_robots_with_nothing_left_to_drive_with_are_marked(tmp_path: Path) -> None:
    desk = Desk(tmp_path, THIRSTY)
    assert desk.driver.swarm.scene.supplies == ("battery",)
    assert not np.frombuffer(desk.driver.flags(), np.uint8).any()
    desk.station.send("(WHEN (< id 11) (DRIVE 5m/s 0))", everybody=True)
    desk.swarm.run(60.0)
    flags = np.frombuffer(desk.driver.flags(), np.uint8)
    assert flags.tolist() == [EXHAUSTED] * 10 + [0] * 10
    assert desk.swarm.simulator.bodies.speed[:10].tolist() == [0.0] * 10
    states = [news.state for robot in (0, 19) for news in desk.backend.news(robot) if isinstance(news, WatchedRobot)]
    assert states == [["no battery left"], []]
