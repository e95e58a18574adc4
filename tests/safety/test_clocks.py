"""Wrong clocks: what is dropped for one is told, at the robot and at the desk; nobody is missing from an account."""

from __future__ import annotations

import pytest

from safety.scene import KEYS, START, Scene
from sleepcast.channel import Kind, Message
from sleepcast.channel.admission import UNTIMELY_A_SECOND


@pytest.mark.parametrize(
    ("by", "differs"),
    [
        (3_600.0, "1 h ahead"),
        (-3_600.0, "1 h behind"),
        (10 * 86_400.0, "10 days ahead"),
        (-START, "12 days behind"),
    ],
)
def test_a_robot_whose_clock_is_wrong_obeys_stop_and_tells_why_it_obeys_nothing_else(by: float, differs: str) -> None:
    scene = Scene()
    scene.set_clock("r1", by)
    desk, node = scene.desk(), scene.fleet["r1"].node
    sent = desk.send("(DRIVE 1)", everybody=True)
    scene.run(1.0)
    found = desk.accounting(sent.id)
    assert (found.n_matched, found.n_silent, found.faults) == (
        2,
        0,
        {"r1": f"its clock is {differs}: it obeys STOP only"},
    )
    assert desk.notices()[:1] == [f"r1: its clock is {differs}; it obeys STOP only"]
    words = "behind" if by < 0 else "ahead of"
    assert [line.split(words)[0] for line in scene.admission("r1").clocks.of_operators()] == [
        f"our clock is {differs.rsplit(' ', 1)[0]} "
    ]
    assert not scene.fleet["r1"].body.driven
    stop = desk.stop()
    scene.run(1.0)
    assert node.stopped
    assert desk.accounting(stop.id).n_matched == 3


def test_a_look_at_a_robot_whose_clock_is_wrong_is_answered_too() -> None:
    """So `who`, `watch` and the page say it, whatever else they ask for."""
    scene = Scene()
    scene.set_clock("r1", -3_600.0)
    desk = scene.desk()
    look = desk.post(Kind.ASK, body={"look": "telemetry"})
    scene.run(1.0)
    assert look.n_silent == 0
    assert desk.notices()[:1] == ["r1: its clock is 1 h behind; it obeys STOP only"]


def test_a_robot_whose_clock_is_four_seconds_ahead_is_counted_and_told() -> None:
    scene = Scene()
    scene.set_clock("r1", 4.0)
    scene.run(5.0)
    desk = scene.desk()
    sent = desk.send("(DRIVE 1)", everybody=True)
    scene.run(1.0)
    assert desk.accounting(sent.id).n_matched == 3
    assert desk.notices()[:1] == ["r1: its clock is 4 s ahead"]


@pytest.mark.parametrize(("by", "words"), [(3_600.0, "1 h ahead of"), (-3_600.0, "1 h behind")])
def test_an_operator_whose_own_clock_is_wrong_is_told_so_and_his_stop_works(by: float, words: str) -> None:
    scene = Scene(robots=10)
    scene.set_clock("anna", by)
    anna = scene.desk("anna")
    sent = anna.send("(DRIVE 1)", everybody=True)
    scene.run(1.0)
    assert anna.accounting(sent.id).n_fault == 10
    assert anna.notices()[:1] == [
        f"your clock is {words} 10 robots: they obey nothing but your STOP; set it, and start sleepcast again"
    ]
    stop = anna.stop()
    scene.run(1.0)
    assert anna.accounting(stop.id).n_matched == 10
    assert all(robot.node.stopped for robot in scene.fleet.values())
    scene.desk("chief").send("(DRIVE 1)", everybody=True)
    scene.run(0.5)
    assert scene.admission("r3").clocks.of_operators(), "what chief says in time makes the clock of anna no better"


def test_what_was_recorded_of_a_robot_tells_nothing_of_its_clock() -> None:
    """Old answers, played again to another desk, are no news: they answer nothing that it has sent."""
    scene = Scene()
    chief = scene.desk("chief")
    chief.send("(DRIVE 1)", everybody=True)
    scene.run(1.0)
    recorded = list(scene.sent)
    scene.clock.advance(3_600.0)
    anna = scene.desk("anna", heard=())
    for datagram in recorded:
        scene.fly("stranger", datagram)
    scene.run(0.5)
    assert anna.clocks.of_robots(5.0) == []
    assert not len(anna.names)


def test_old_commands_that_are_played_again_say_nothing_of_a_clock_that_was_good_just_now() -> None:
    scene = Scene(robots=1)
    desk = scene.desk()
    before = len(scene.sent)
    scene.isolate("r0")
    desk.send("(DRIVE 1)", everybody=True)
    scene.run(1.0)
    recorded = scene.sent[before:]
    scene.run(20.0)
    scene.join("r0")
    desk.ask("fuel")
    scene.run(1.0)
    for datagram in recorded:
        scene.fly("stranger", datagram)
    scene.run(1.0)
    assert scene.admission("r0").clocks.of_operators() == []
    assert not scene.fleet["r0"].body.driven


def test_a_robot_that_listened_before_it_could_hear_takes_old_commands_for_late_and_no_clock_for_wrong() -> None:
    """What came during a long start is read at once, the oldest first."""
    scene = Scene(robots=1)
    desk = scene.desk()
    before = len(scene.sent)
    scene.isolate("r0")
    early = desk.send("(DRIVE 1)", everybody=True)
    scene.run(1.0)
    recorded = scene.sent[before:]
    scene.clock.advance(20.0)
    scene.join("r0")
    for datagram in recorded:
        scene.fly("stranger", datagram)
    now = desk.send("(DRIVE 0)", everybody=True)
    scene.run(1.0)
    assert desk.accounting(early.id).faults == {"r0": "heard after its deadline, so not evaluated"}
    assert desk.accounting(now.id).n_matched == 1
    assert scene.admission("r0").clocks.of_operators() == []


def test_nobody_makes_a_robot_talk_by_playing_old_commands() -> None:
    """At most `UNTIMELY_A_SECOND` answers a second, each to a message that was not answered yet."""
    scene = Scene(robots=1)
    scene.desk()
    for number in range(500):
        old = Message("anna", 1, number + 1, Kind.COMMAND, START - 900.0, START - 890.0, "(DRIVE 1)")
        for _ in range(2):
            scene.say(old, KEYS["anna"])
    before = len(scene.sent)
    scene.run(1.0)
    assert len(scene.sent) - before <= 2 * UNTIMELY_A_SECOND


def test_clocks_that_jump_change_nothing_between_two_operators_in_conflict() -> None:
    """Two operators stop and release by turns while their clocks jump about by hours and a relay delays, repeats and
    reorders: nobody moves while a STOP holds that no RELEASE in time has ended by its number or its name."""
    for seed in range(20):
        scene = Scene(seed=seed, loss=0.2, twice=0.3, delay=0.3)
        chance, stops = scene.chance, list[Message]()
        for number in range(1, 14):
            who, jump = chance.choice(("anna", "bert")), chance.choice((0.0, 0.0, 3_600.0, -3_600.0, 1.0))
            issued, kind = scene.clock.now() + jump, chance.choice((Kind.STOP, Kind.RELEASE))
            ends = [[stop.sender, 1, stop.sequence] for stop in stops]
            message = Message(who, 1, number, kind, issued, issued + 5.0, body={"ends": ends})
            stops += [message] if kind is Kind.STOP else []
            scene.say(message, KEYS[who])
            scene.run(chance.uniform(0.0, 0.6))
        last = Message("anna", 1, 14, Kind.STOP, START + chance.choice((3_600.0, -3_600.0)))
        for _ in range(20):
            scene.say(last, KEYS["anna"])
        scene.run(6.0)
        assert all(robot.node.stopped for robot in scene.fleet.values()), seed
        for jump, freed in ((3_600.0, False), (-3_600.0, False), (0.0, True)):
            issued, ends = scene.clock.now() + jump, [["anna", 1, 14], ["bert", 1, 14]]
            release = Message("bert", 1, 20 + int(freed), Kind.RELEASE, issued, issued + 5.0, body={"ends": ends})
            for _ in range(20):
                scene.say(release, KEYS["bert"])
            scene.run(1.0)
            assert all(robot.node.stopped is not freed for robot in scene.fleet.values()), (seed, jump)
