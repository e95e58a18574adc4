"""Heartbeats: sent while robots are driven at a desk's word and somebody is there, and at no other time."""

from __future__ import annotations

from safety.scene import KEYS, Scene
from sleepcast.channel import Kind, Message
from sleepcast.channel.envelope import look
from sleepcast.station.network import LEASE


def beats(scene: Scene, seconds: float) -> int:
    before = len(scene.sent)
    scene.run(seconds)
    return sum(look(datagram).kind is Kind.HEARTBEAT for datagram in scene.sent[before:])


def test_a_quiet_fleet_is_quiet() -> None:
    """Ruling 13: no heartbeat while nobody drives, however long a desk is open."""
    scene = Scene()
    scene.desk().holding = True
    assert beats(scene, 10.0) == 0


def test_a_desk_keeps_those_going_that_obeyed() -> None:
    """Must 3: three heartbeats in the time after which a robot stops, so that one may be lost, or two."""
    scene = Scene()
    desk = scene.desk()
    desk.holding = True
    desk.send("(WHEN (> x 1) (DRIVE 1))")
    assert 28 <= beats(scene, 10.0 * LEASE) <= 32
    desk.holding = False
    assert beats(scene, 10.0) == 0


def test_nobody_is_kept_going_whom_nobody_drives() -> None:
    """Must 3: a command that matched nobody, and one whose robots were stopped, want no heartbeat."""
    scene = Scene()
    desk = scene.desk()
    desk.holding = True
    desk.send("(WHEN (> x 5) (DRIVE 1))")
    scene.run(1.0)
    assert beats(scene, 5.0) == 0
    desk.send("(DRIVE 1)", everybody=True)
    assert beats(scene, 5.0) > 10
    desk.stop()
    scene.run(0.1)
    assert beats(scene, 5.0) == 0
    desk.release_all()
    assert beats(scene, 5.0) == 0, "nothing old resumes"


def test_who_is_driven_goes_on_while_others_are_spoken_to() -> None:
    """A second command, which nobody obeys, does not let those go that obeyed the first."""
    scene = Scene(lease=LEASE)
    desk = scene.desk()
    desk.holding = True
    desk.send("(WHEN (< x 1) (DRIVE 1))")
    scene.run(2.0)
    desk.send("(WHEN (> x 50) (DRIVE 1))")
    scene.run(5.0)
    assert driven(scene) == [True, False, False]


def test_silence_is_no_reason_to_go_on_for_ever() -> None:
    """A command that nobody obeyed, and to which one robot never answered, keeps a desk from being quiet no longer than
    it is good."""
    scene = Scene()
    desk = scene.desk()
    desk.holding = True
    scene.isolate("r1")
    desk.send("(WHEN (> x 50) (DRIVE 1))", deadline=3.0)
    assert beats(scene, 3.0) > 5
    assert beats(scene, 5.0) <= 1


def test_another_operators_stop_ends_the_heartbeats_too() -> None:
    """Must 2 and 3."""
    scene = Scene()
    chief, watch = scene.desk("chief"), scene.desk("watch")
    chief.holding = True
    chief.send("(DRIVE 1)", everybody=True)
    assert beats(scene, 2.0) > 4
    watch.stop()
    scene.run(0.2)
    assert beats(scene, 5.0) == 0


def driven(scene: Scene) -> list[bool]:
    return [robot.node.driven for robot in scene.fleet.values()]


def test_who_is_driven_rests_when_nobody_is_heard_any_more_and_nothing_old_resumes() -> None:
    """Must 3: with a desk that goes away, with a link that goes away, and when it comes back."""
    scene = Scene(lease=LEASE)
    desk = scene.desk()
    desk.holding = True
    desk.send("(DRIVE 1)", everybody=True)
    scene.run(10.0)
    assert driven(scene) == [True] * 3
    scene.isolate("r1")
    scene.run(LEASE + 0.1)
    assert driven(scene) == [True, False, True]
    scene.join("r1")
    scene.run(3.0)
    assert driven(scene) == [True, False, True]
    desk.holding = False
    scene.run(LEASE + 0.1)
    assert driven(scene) == [False] * 3
    assert [report.body["label"] for report in desk.reports].count("at rest: nobody drives it any more") == 2
    assert [robot.body.driven for robot in scene.fleet.values()] == [[1.0]] * 3


def test_heartbeats_of_those_who_may_not_command_keep_nobody_going() -> None:
    """Musts 3 and 5: an observer's, a robot's, a stranger's, and one that is played again."""
    scene = Scene(robots=1, lease=LEASE)
    desk = scene.desk()
    desk.holding = True
    scene.desk("watch")
    desk.send("(DRIVE 1)", everybody=True)
    scene.run(3.0)
    recorded = [datagram for datagram in scene.sent if look(datagram).kind is Kind.HEARTBEAT]
    assert driven(scene) == [True]
    desk.holding = False
    for number in range(15):
        now = scene.clock.now()
        scene.say(Message("watch", 1, 100 + number, Kind.HEARTBEAT, now, now + 1.0), KEYS["watch"])
        scene.say(Message("r9", 1, 100 + number, Kind.HEARTBEAT, now, now + 1.0), KEYS["r*"])
        scene.fly("stranger", recorded[number % len(recorded)])
        scene.run(0.1)
    assert driven(scene) == [False]
