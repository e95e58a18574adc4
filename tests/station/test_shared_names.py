"""Two robots of one name at a desk: the name has answered when both have, and nobody is told otherwise."""

from __future__ import annotations

import pytest

from safety.scene import KEYS, START, Robot, Scene
from sleepcast.channel import Kind, Message
from sleepcast.channel.message import LOOK, Inspection
from sleepcast.channel.name_conflicts import LASTS
from sleepcast.cli.watch import SHARED, Window
from sleepcast.console import Scene as Ground
from sleepcast.console.adapters.channel import EMPTY, FleetAdapter
from sleepcast.station import DoubtError
from sleepcast.station.journal.journal import CONFLICT
from sleepcast.station.network import NetworkStation
from sleepcast.station.remote import RemoteMinds, TelemetryClient
from sleepcast.station.validation import YES, SendPolicy

R1, AGAIN = "r1", "r1 again"


def shared(robots: int = 3) -> tuple[Scene, Robot]:
    """Robots of which two are r1."""
    scene = Scene(robots, policy=SendPolicy(doubts=True))
    scene.run(1.0)
    return scene, scene.another(R1)


def known(scene: Scene) -> NetworkStation:
    """The chief's desk, which has heard both."""
    desk = scene.desk()
    for _ in range(3):
        desk.post(Kind.ASK, body={LOOK: Inspection.TELEMETRY.value})
        scene.run(0.3)
    assert desk.shared_names == {R1}
    return desk


def silence(scene: Scene, name: str) -> None:
    """A robot goes on, and nobody hears it or is heard: as a process that is frozen."""
    scene.fleet[name].on = False


def test_a_watch_marks_a_robot_that_has_told_nothing_yet() -> None:
    scene, _ = shared()
    desk = known(scene)
    window = Window(desk, TelemetryClient(desk, RemoteMinds()), None, None)
    (robot,) = [each for each in map(dict, window.as_dict()["robots"]) if each["name"] == R1]
    assert (robot["told"], robot["shared"]) == (None, True)
    names, _, states, *_ = (list(column.cells) for column in window.table(10).columns)
    assert [str(name) for name, state in zip(names, states, strict=True) if SHARED in str(state)] == [R1]


def test_a_stop_counts_when_both_have_confirmed_it() -> None:
    scene, _ = shared()
    desk = scene.desk()
    scene.run(1.0)
    silence(scene, AGAIN)
    sent = desk.stop()
    scene.run(1.0)
    found = desk.accounting(sent.id)
    assert (found.matched, found.silent) == (("r0", "r2"), (R1,)), "though r1 has answered, and desk heard no other"
    epochs = [scene.fleet[each].session.delivery.epoch for each in (R1, AGAIN)]
    assert found.conflicts == {
        R1: f"2 robots have the name r1: one with epoch {epochs[0]} has answered, one with epoch {epochs[1]} has not "
        "answered"
    }
    assert "several robots have this name" in found.silence()
    scene.fleet[AGAIN].on = True
    scene.run(1.5)
    found = desk.accounting(sent.id)
    assert (found.n_matched, found.silent) == (3, ())
    assert scene.fleet[AGAIN].node.stopped


def test_a_stop_does_not_count_when_the_conflict_is_over() -> None:
    """The frozen robot may still drive."""
    scene, _ = shared()
    desk = known(scene)
    silence(scene, R1)
    sent = desk.stop()
    scene.run(LASTS + 1.0)
    assert not desk.shared_names
    assert desk.accounting(sent.id).silent == (R1,)
    assert desk.is_over(sent)


def test_telemetry_of_one_does_not_confirm_stop_for_both() -> None:
    scene, _ = shared()
    minds = RemoteMinds()
    desk = scene.desk(minds=minds)
    minds.conflicts = desk.conflicts
    telemetry = TelemetryClient(desk, minds)
    desk.listeners.append(telemetry.hear)
    known(scene)
    telemetry.look()
    scene.run(1.0)
    assert R1 in minds
    x = dict(minds[R1].variables())["x"]
    silence(scene, AGAIN)
    sent = desk.stop()
    for _ in range(4):
        telemetry.look()
        scene.run(0.5)
    assert minds["r0"].stopped
    assert not minds[R1].stopped, "one of them has not said so"
    assert desk.accounting(sent.id).silent == (R1,)
    scene.fleet[AGAIN].on = True
    for _ in range(4):
        telemetry.look()
        scene.run(0.5)
        assert dict(minds[R1].variables())["x"] == x, "a robot does not jump to and fro"
    assert minds[R1].stopped
    assert desk.accounting(sent.id).silent == ()


def test_a_command_to_them_is_doubted_and_previews_do_not_know() -> None:
    scene, _ = shared()
    desk = known(scene)
    assert desk.preview("(DRIVE 1)").unknown[R1] == "several robots have this name"
    with pytest.raises(DoubtError, match="2 robots have the name r1, one with epoch") as refused:
        desk.send("(DRIVE 1)", everybody=True)
    assert "--anyway" in str(refused.value)
    assert [entry.text for entry in desk.journal.entries() if entry.event == "refused"] == ["(DRIVE 1)"]
    desk.send("(DRIVE 1)", only=["r0"])
    sent = desk.send("(DRIVE 1)", everybody=True, confirmed=True)
    scene.run(0.5)
    assert desk.accounting(sent.id).n_matched == 3, "both have obeyed"


def test_different_answers_are_a_fault_that_says_so() -> None:
    scene, _ = shared()
    desk = known(scene)
    sent = desk.ask("id")
    scene.run(0.5)
    found = desk.accounting(sent.id)
    assert (found.matched, found.fault) == (("r0", "r2"), (R1,))
    assert "2 robots have this name: one with epoch" in found.faults[R1]
    assert "answers 1, " in found.faults[R1]
    assert found.faults[R1].endswith("answers 7")
    assert found.values is not None
    assert found.values.count == 2
    sent = desk.send("(WHEN (> id 5) (JOIN bravo))", confirmed=True)
    scene.run(0.5)
    found = desk.accounting(sent.id)
    assert (found.not_matched, found.fault) == (("r0", "r2"), (R1,))
    assert ": not matched, one with epoch" in found.faults[R1]
    assert found.faults[R1].endswith(": matched")


def test_a_restart_is_counted_as_one_robot() -> None:
    scene = Scene(3)
    desk = scene.desk()
    scene.run(1.0)
    sent = desk.stop()
    scene.run(1.0)
    assert desk.accounting(sent.id).n_matched == 3
    scene.restart(R1)
    scene.run(3.0)
    sent = desk.stop()
    scene.run(3.0)
    found = desk.accounting(sent.id)
    assert (found.n_matched, found.conflicts) == (3, {})
    assert desk.notices() == []
    again = desk.ask("id")
    scene.run(0.5)
    assert desk.accounting(again.id).n_matched == 3


def test_replays_of_a_robot_that_has_restarted_are_no_other_robot() -> None:
    scene = Scene(3)
    desk = scene.desk()
    scene.run(1.0)
    scene.deaf.add((R1, "chief"))
    desk.ask("id")
    scene.sent.clear()
    scene.run(0.3)
    recorded = list(scene.sent)
    scene.deaf.clear()
    desk.ask("id")
    scene.run(0.3)
    scene.restart(R1)
    for _ in range(3):
        desk.ask("id")
        scene.run(0.5)
        for datagram in recorded:
            scene.fly("stranger", datagram)
        scene.run(0.5)
    assert desk.notices() == []
    assert desk.conflicts.contested(scene.clock.now()) == {}


def test_desks_and_journal_name_them() -> None:
    scene, _ = shared()
    desk = scene.desk()
    alarms: list[str] = []
    desk.alarm = alarms.append
    known(scene)
    (notice,) = desk.notices()
    assert notice.startswith("2 robots have the name r1, one with epoch 1000000000, one with epoch ")
    assert alarms == [notice]
    told = [entry for entry in desk.journal.entries() if entry.details.get("kind") == CONFLICT]
    assert [(entry.who, entry.text) for entry in told] == [(R1, notice)]


def test_values_of_a_name_with_two_robots_are_unknown() -> None:
    scene, _ = shared()
    minds = RemoteMinds()
    desk = scene.desk(minds=minds)
    telemetry = TelemetryClient(desk, minds)
    desk.listeners.append(telemetry.hear)
    known(scene)
    for _ in range(3):
        telemetry.look()
        scene.run(0.5)
    values, asked = desk.values("x")
    assert [value == value for value in values.tolist()] == [True, False, True]
    assert list(asked) == []


def test_a_key_that_is_no_robots_makes_no_conflict() -> None:
    scene = Scene(1)
    for epoch in (1, 2, 1):
        scene.say(Message("anna", epoch, epoch, Kind.STOP, scene.clock.now()), KEYS["anna"])
        scene.run(0.1)
    assert scene.desk().notices() == []


def test_a_page_names_them() -> None:
    scene, _ = shared()
    minds = RemoteMinds()
    desk = scene.desk(minds=minds)
    telemetry = TelemetryClient(desk, minds)
    desk.listeners.append(telemetry.hear)
    fleet = FleetAdapter(desk, telemetry, Ground("air", "", "robots", (), EMPTY, "m", ()), 1.0, START)
    known(scene)
    telemetry.look()
    scene.run(1.0)
    assert fleet.states("r1") == ["several robots have this name: what is shown is of one of them"]
    assert fleet.states("r0") == []
    assert fleet.notices()[0].startswith("2 robots have the name r1, ")


def test_asked_themselves_they_must_agree() -> None:
    scene, _ = shared()
    desk = known(scene)
    text = "(WHEN (> id 5) (JOIN bravo))"
    for busy, would in ((text, set()), ("(WHEN (> id 0) (JOIN bravo))", {"r1", "r2"})):
        monkey = desk.gather
        desk.gather = lambda command, patience: scene.run(1.0)  # type: ignore[method-assign]
        asked, poll = desk.poll(busy, 0.0)
        desk.gather = monkey  # type: ignore[method-assign]
        assert {name for name, code in poll.said.items() if code == YES} == would
        assert desk.accounting(asked.id).n_silent == 0
