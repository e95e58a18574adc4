"""Who commands on the air: how sending in stages goes on, and how it ends."""

from __future__ import annotations

import pytest

from safety.scene import START, Scene
from sleepcast.console.adapters.channel import EMPTY, FleetAdapter
from sleepcast.console.network import NetworkDriver
from sleepcast.console.operators import GRACE, OperatorsDesk
from sleepcast.console.view import Scene as Ground
from sleepcast.station.journal.journal import JournalError
from sleepcast.station.remote import RemoteMinds, TelemetryClient


def send(scene: Scene, desk: OperatorsDesk) -> None:
    desk.send_in_stages(scene.desk().prepare("(WHEN (> x 3) (JOIN crew))"), count=20)


def begun(scene: Scene) -> OperatorsDesk:
    desk = OperatorsDesk(scene.desk(), START)
    send(scene, desk)
    return desk


def wait(scene: Scene, desk: OperatorsDesk) -> str:
    """Let the answers to the stage that is under way come; gives what the page says then."""
    scene.run(GRACE)
    desk.attend()
    return desk.shown().staging


def test_a_stage_that_is_refused_is_not_counted_and_its_reason_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was counted as a stage that had been sent, and the page said that the operator had stopped it."""
    scene = Scene(robots=20)
    desk = begun(scene)

    def full(*_: object, **__: object) -> None:
        raise JournalError("no space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(scene.desk().journal, "append", full)
        ended = wait(scene, desk)
    assert ended == (
        "In stages: ended with stage 1 (the next one was refused: no space left on device); "
        "the other robots were sent nothing."
    )
    assert wait(scene, desk) == ended, "it stays so, though the journal can be written again"
    assert len(scene.desk().commands()) == 1
    assert not desk.shown().active
    send(scene, desk)
    assert wait(scene, desk).startswith("In stages: stage 2 is sent"), "another one may begin"


def test_a_lease_of_a_mistyped_group_is_doubted() -> None:
    """It was asked for without a word, and no robot was in that group."""
    scene, minds = Scene(robots=3), RemoteMinds()
    station = scene.desk(minds=minds)
    telemetry = TelemetryClient(station, minds)
    station.listeners.append(telemetry.hear)
    station.send("(JOIN bravo)", everybody=True)
    scene.run(1.0)
    telemetry.look()
    scene.run(1.0)
    desk = OperatorsDesk(station, START)
    doubts = {group: desk.lease("take", group, 60.0, "")[1] for group in ("brvo", "bravo", "alpha")}
    assert doubts == {
        "brvo": 'no robot has told of a group "brvo" (did you mean bravo?)',
        "bravo": "",
        "alpha": "",
    }


def test_a_person_who_stops_it_is_told_so() -> None:
    scene = Scene(robots=20)
    desk = begun(scene)
    assert wait(scene, desk).startswith("In stages: stage 2 is sent")
    scene.run(GRACE)
    desk.halt()
    assert desk.shown().staging == (
        "In stages: ended with stage 2 (you stopped it); the other robots were sent nothing."
    )
    assert len(scene.desk().commands()) == 2


def test_answers_that_came_in_time_count_though_the_desk_was_held_up() -> None:
    """They were called silent: the time for answers was over before the desk had heard them."""
    scene = Scene(robots=20)
    desk = begun(scene)
    ground = Ground("air", "", "robots", (), EMPTY, "m", ())
    fleet = FleetAdapter(scene.desk(), TelemetryClient(scene.desk(), RemoteMinds()), ground, 1.0, START)
    driver = NetworkDriver(fleet, scene.clock, desk.attend)
    scene.run(5.0 * GRACE, busy=("chief",))
    driver.advance(0.0)
    assert desk.shown().staging.startswith("In stages: stage 2 is sent")
