"""Heartbeats: sent while robots are driven at a desk's word and somebody is there, and at no other time."""

from __future__ import annotations

from safety.scene import Scene
from sleepcast.channel import Kind
from sleepcast.channel.envelope import look
from sleepcast.station.aired import LEASE


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
    desk.release()
    assert beats(scene, 5.0) == 0, "nothing old resumes"


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
