"""What robots reported before a command does not say who obeys the next one."""

from __future__ import annotations

from math import inf

import numpy as np

from safety.scene import Scene
from sleepcast.station.network import NetworkStation
from sleepcast.station.remote import OBEYED, RemoteMinds, TelemetryClient
from sleepcast.station.roster import CommandedTimes
from sleepcast.station.validation import COMMANDED

MEMBERS = "(WHEN (IN bravo) (DRIVE 1))"


def observing(scene: Scene, owner: str) -> tuple[NetworkStation, TelemetryClient]:
    """A desk that has asked robots for their telemetry."""
    minds = RemoteMinds()
    desk = scene.desk(owner, minds=minds)
    telemetry = TelemetryClient(desk, minds)
    desk.listeners.append(telemetry.hear)
    for _ in range(3):
        telemetry.look()
        scene.run(0.5)
    return desk, telemetry


def test_times_of_all_robots_and_of_single_ones() -> None:
    times = CommandedTimes()
    assert times.latest == -inf
    times.note(2.0, np.array([1], np.intp))
    times.note(1.0)
    assert times.of(3).tolist() == [1.0, 2.0, 1.0]
    times.note(3.0)
    times.note(2.5, np.array([0], np.intp))
    assert times.of(2).tolist() == [3.0, 3.0]
    assert times.latest == 3.0


def test_a_desk_that_runs_on_foresees_nothing_by_telemetry_from_before_its_command() -> None:
    scene = Scene(robots=3)
    desk, telemetry = observing(scene, "chief")
    assert len(desk.preview(MEMBERS).no) == 3
    desk.send("(JOIN bravo)", everybody=True)
    scene.run(0.5)
    assert desk.preview(MEMBERS).unknown == dict.fromkeys(("r0", "r1", "r2"), COMMANDED)
    assert desk.prepare(MEMBERS).forecast.may == 3
    telemetry.look()
    scene.run(0.5)
    assert len(desk.preview(MEMBERS).yes) == 3


def test_a_command_to_one_robot_leaves_the_others_known() -> None:
    scene = Scene(robots=3)
    desk, _ = observing(scene, "chief")
    desk.send("(JOIN bravo)", only=["r1"])
    assert set(desk.preview(MEMBERS).unknown) == {"r1"}
    assert set(desk.preview(MEMBERS).no) == {"r0", "r2"}


def test_commands_of_other_operators_count_as_ours() -> None:
    scene = Scene(robots=3)
    desk, _ = observing(scene, "chief")
    scene.desk("anna").send("(JOIN bravo)", only=["r2"])
    scene.run(0.5)
    assert set(desk.preview(MEMBERS).unknown) == {"r2"}
    scene.desk("anna").send("(JOIN bravo)", everybody=True)
    scene.run(0.5)
    assert len(desk.preview(MEMBERS).unknown) == 3


def test_what_robots_said_before_a_command_does_not_count_after_it() -> None:
    """A poll is telemetry of another kind."""
    scene = Scene(robots=2)
    desk = scene.desk()
    desk.session.listen = lambda seconds, _=0.0: scene.run(seconds)  # type: ignore[method-assign]
    desk.poll(MEMBERS, 0.5)
    assert set(desk.prepare(MEMBERS).forecast.no) == {"r0", "r1"}
    desk.send("(JOIN bravo)", only=["r0"])
    assert (set(desk.prepare(MEMBERS).forecast.no), set(desk.prepare(MEMBERS).forecast.unknown)) == ({"r1"}, {"r0"})


def test_robots_are_looked_at_again_soon_after_a_command() -> None:
    scene = Scene(robots=2)
    desk, telemetry = observing(scene, "chief")
    telemetry.look()
    scene.run(0.1)
    assert not telemetry.is_due(60.0)
    desk.send("(JOIN bravo)", everybody=True)
    assert not telemetry.is_due(60.0)
    scene.run(OBEYED + 0.1)
    assert telemetry.is_due(60.0)
    telemetry.look()
    assert not telemetry.is_due(60.0)
