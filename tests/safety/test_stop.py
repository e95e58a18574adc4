"""STOP: heard by all, repeated until everybody is accounted for, latched, and ended by nothing but a RELEASE that was
decided later."""

from __future__ import annotations

from typing import NoReturn

import pytest

from safety.scene import KEYS, START, Scene
from sleepcast.channel import Kind, Message
from sleepcast.channel.envelope import look
from sleepcast.station import CountNeededError, SendPolicy
from sleepcast.station.network import NetworkStation, RoleError
from sleepcast.station.prepared import Terms


def silent(desk: NetworkStation, command: str) -> tuple[str, ...]:
    return desk.accounting(command).silent


@pytest.mark.parametrize("owner", ["chief", "anna", "watch"])
def test_anybody_with_a_role_may_stop(owner: str) -> None:
    """Must 2 and 5: any operator, an observer too, and the language is not asked."""
    scene = Scene()
    desk = scene.desk(owner)
    stop = desk.stop()
    scene.run(0.5)
    assert all(robot.node.stopped for robot in scene.fleet.values())
    found = desk.accounting(stop.id).sentence()
    assert found == "matched 3, did not match 0, fault 0, silent 0 of 3 robots heard so far"


def test_a_robot_may_stop_the_others() -> None:
    """Must 5: anyone with any role."""
    scene = Scene()
    scene.desk()
    scene.say(Message("r9", 1, 1, Kind.STOP, START), KEYS["r*"])
    scene.run(0.1)
    assert all(robot.node.stopped for robot in scene.fleet.values())


def test_stop_is_repeated_until_everybody_is_accounted_for() -> None:
    """Must 2: a robot that was out of reach for half a minute is stopped as soon as it is back, without a new key."""
    scene = Scene()
    desk = scene.desk()
    scene.isolate("r1")
    stop = desk.stop()
    scene.run(30.0)
    assert (desk.accounting(stop.id).matched, silent(desk, stop.id)) == (("r0", "r2"), ("r1",))
    assert not scene.fleet["r1"].node.stopped
    scene.join("r1")
    scene.run(1.2)
    assert scene.fleet["r1"].node.stopped
    assert silent(desk, stop.id) == ()
    before = len(scene.sent)
    scene.run(5.0)
    assert len(scene.sent) - before <= 4, "and then it is quiet"


def test_the_account_never_takes_silence_for_obedience() -> None:
    """Must 2, and `which hosts never answered?`: the ones that are silent are named, with when they were last heard."""
    scene = Scene()
    scene.isolate("r2")
    desk = scene.desk()
    scene.isolate("r2")
    stop = desk.stop()
    scene.run(2.0)
    assert desk.accounting(stop.id).sentence() == (
        "matched 2, did not match 0, fault 0, silent 1 of 3 robots heard so far: r2 (last heard 10 s ago)"
    )


def test_a_stop_that_was_obeyed_and_not_heard_of_is_asked_about_again() -> None:
    """An answer that was lost is no silence for ever, and whoever answered is not asked again."""
    scene = Scene()
    desk = scene.desk()
    scene.deaf.add(("r1", "chief"))
    stop = desk.stop()
    scene.run(2.0)
    assert scene.fleet["r1"].node.stopped
    assert silent(desk, stop.id) == ("r1",)
    said = {name: robot.session.delivery.next_number for name, robot in scene.fleet.items()}
    scene.deaf.clear()
    scene.run(2.0)
    assert silent(desk, stop.id) == ()
    assert scene.fleet["r1"].session.delivery.next_number > said["r1"]
    assert scene.fleet["r0"].session.delivery.next_number <= said["r0"] + 1, "nothing but a digest"


def test_stop_bypasses_the_order_of_commands() -> None:
    """Must 2: STOP does not wait for a command that is missing before it."""
    scene = Scene()
    desk = scene.desk()
    scene.isolate("r0")
    desk.send("(DRIVE 1)", everybody=True, deadline=60.0)
    scene.run(1.0)
    scene.join("r0")
    desk.stop()
    scene.run(0.05)
    assert scene.fleet["r0"].node.stopped


def test_stop_passes_by_all_that_is_asked_about_a_command(monkeypatch: pytest.MonkeyPatch) -> None:
    """Must 2: no check, preview, doubt or number stands between a person and STOP, whatever waits for an answer."""
    scene = Scene(policy=SendPolicy(above=0, irreversible=True, strict=True, doubts=True))
    desk = scene.desk()
    prepared = desk.prepare("(DRIVE 1)", Terms(everybody=True))
    with pytest.raises(CountNeededError):
        desk.commit(prepared)

    def broken(*_: object, **__: object) -> NoReturn:
        raise AssertionError("STOP was taken for a command")

    for name in ("check", "draft", "_draft", "foresee", "_foresee", "accept", "commit", "_settle"):
        monkeypatch.setattr(NetworkStation, name, broken)
    desk.stop()
    scene.run(0.05)
    assert all(robot.node.stopped for robot in scene.fleet.values())
    desk.release_all()
    scene.run(0.5)
    assert not any(robot.node.stopped for robot in scene.fleet.values())


def test_stop_holds_until_an_explicit_release() -> None:
    """Must 2: neither commands nor time nor rules end it, and what was asked meanwhile does not happen."""
    scene = Scene()
    desk = scene.desk()
    desk.stop()
    scene.run(1.0)
    refused = desk.send("(DRIVE 1)", everybody=True)
    scene.run(60.0)
    assert desk.accounting(refused.id).n_fault == 3
    desk.send("(RULE go (DRIVE 2))", standing=True, everybody=True)
    scene.run(1.0)
    assert all(robot.node.stopped and not robot.body.driven for robot in scene.fleet.values())


def test_a_release_that_was_decided_before_a_stop_does_not_end_it() -> None:
    """A RELEASE goes on looking for a robot that missed it; meanwhile somebody else stops all, and that holds."""
    scene = Scene()
    chief, anna = scene.desk("chief"), scene.desk("anna")
    chief.stop()
    scene.run(1.0)
    scene.isolate("r1")
    release = chief.release_all()
    scene.run(1.0)
    assert not scene.fleet["r0"].node.stopped
    scene.deaf = {("anna", "chief")}  # chief does not know
    anna.stop()
    scene.run(5.0)
    assert all(robot.node.stopped for robot in scene.fleet.values())
    assert "the STOP anna-1000000000.1 holds" in chief.accounting(release.id).faults["r1"]


def test_a_stop_that_goes_on_looking_for_a_robot_does_not_undo_a_later_release() -> None:
    """One desk still looks for a robot that missed its STOP, and does not know that another one has released all since:
    who was released goes on, and the robot that never heard of either stops."""
    scene = Scene()
    chief, anna = scene.desk("chief"), scene.desk("anna")
    scene.isolate("r1")
    stop = chief.stop()
    scene.run(6.0)
    scene.deaf.add(("anna", "chief"))
    anna.release_all()
    scene.run(1.0)
    scene.join("r1")
    scene.run(3.0)
    assert {name: robot.node.stopped for name, robot in scene.fleet.items()} == {"r0": False, "r1": True, "r2": False}
    assert chief.accounting(stop.id).complete


def test_a_new_stop_is_obeyed_whatever_the_clocks_say() -> None:
    """A RELEASE of an operator whose clock is ahead does not make robots deaf to the next STOP, also if they hear of it
    only when it is sent again."""
    scene = Scene()
    chief = scene.desk("chief")
    scene.desk("anna")
    stop = chief.stop().message
    scene.run(0.5)
    ahead, ends = scene.clock.now() + 1.9, [[stop.sender, stop.epoch, stop.sequence]]
    scene.say(Message("anna", 1, 1, Kind.RELEASE, ahead, ahead + 5.0, body={"ends": ends}), KEYS["anna"])
    scene.run(0.2)
    assert not scene.fleet["r1"].node.stopped
    scene.isolate("r1")
    chief.stop()
    scene.run(0.5)
    scene.join("r1")
    scene.run(1.0)
    assert all(robot.node.stopped for robot in scene.fleet.values())


def test_a_robot_that_is_first_heard_after_a_stop_is_stopped_too() -> None:
    """Must 2: `every robot on the roster` means those as well that come onto it while STOP holds."""
    scene = Scene()
    desk = scene.desk(heard=("r0", "r1"))
    scene.isolate("r2")
    stop = desk.stop()
    scene.run(3.0)
    assert desk.accounting(stop.id).complete
    scene.join("r2")
    desk.hear(Message("r2", 1, 1, Kind.REPORT, scene.clock.now(), body={"label": "here", "values": []}))
    scene.run(1.0)
    assert scene.fleet["r2"].node.stopped
    assert desk.accounting(stop.id).n_matched == 3


def test_a_desk_that_hears_a_stop_lets_its_release_go() -> None:
    scene = Scene()
    chief, anna = scene.desk("chief"), scene.desk("anna")
    chief.stop()
    scene.run(1.0)
    scene.isolate("r1")
    chief.release_all()
    scene.run(0.5)
    anna.stop()
    scene.run(0.5)
    scene.join("r1")
    before = chief.session.delivery.next_number
    scene.run(3.0)
    assert chief.session.delivery.next_number <= before + 2, "nothing but digests"


def test_a_desk_stops_on_until_a_release_names_its_stop() -> None:
    """A RELEASE that does not name it frees no robot that has it, so those that are missing must still get it."""
    scene = Scene(robots=2)
    chief, anna = scene.desk("chief"), scene.desk("anna")
    scene.deaf |= {("chief", "anna"), ("chief", "r1"), ("r0", "anna")}
    stopped = chief.stop()
    scene.run(0.5)
    anna.post(Kind.RELEASE)
    scene.run(0.5)
    assert (stopped.ended_by, scene.fleet["r0"].node.stopped) == ("", True)
    scene.deaf.clear()
    scene.run(3.0)
    assert chief.accounting(stopped.id).matched == ("r0", "r1")
    anna.post(Kind.ASK, body={"look": "telemetry"})
    scene.run(0.5)
    anna.release_all()
    scene.run(0.5)
    assert stopped.ended_by == "anna"
    assert not any(robot.node.stopped for robot in scene.fleet.values())


def test_a_replayed_release_does_not_end_a_stop() -> None:
    """Must 7: what a stranger recorded of an old RELEASE, and plays to a robot that never heard it, changes nothing."""
    scene = Scene()
    desk = scene.desk()
    scene.isolate("r1")
    desk.stop()
    scene.run(0.2)
    before = len(scene.sent)
    desk.release_all()
    scene.run(0.2)
    recorded = scene.sent[before:]
    scene.join("r1")
    desk.stop()
    scene.run(1.0)
    for datagram in recorded:
        scene.fly("stranger", datagram)
    scene.run(1.0)
    assert all(robot.node.stopped for robot in scene.fleet.values())


@pytest.mark.parametrize("age", [-5.0, "long", None, float("nan"), 1e9])
def test_a_stop_that_says_nonsense_stops_and_a_release_that_does_not_release(age: object) -> None:
    """Must 2: in doubt a robot stands."""
    scene = Scene(robots=1)
    desk = scene.desk()
    desk.stop()
    scene.run(0.3)
    said: dict[str, object] = {"age": age}
    scene.say(Message("anna", 1, 1, Kind.RELEASE, scene.clock.now(), body=said), KEYS["anna"])
    scene.run(0.3)
    assert scene.fleet["r0"].node.stopped
    desk.release_all()
    scene.run(0.3)
    scene.say(Message("anna", 1, 2, Kind.STOP, scene.clock.now(), body=said if age != 1e9 else {}), KEYS["anna"])
    scene.run(0.3)
    assert scene.fleet["r0"].node.stopped


def test_an_observer_does_not_release() -> None:
    """Must 5: refused at the desk with the reason, and at the robot if the desk is a forger's."""
    scene = Scene()
    watch = scene.desk("watch")
    watch.stop()
    scene.run(0.5)
    with pytest.raises(RoleError, match="watch is an observer"):
        watch.release_all()
    scene.say(Message("watch", 1, 99, Kind.RELEASE, scene.clock.now()), KEYS["watch"])
    scene.run(0.5)
    assert all(robot.node.stopped for robot in scene.fleet.values())


def test_stop_gets_through_where_half_of_everything_is_lost() -> None:
    """Must 2 and the bar of the issue: within half a second of the key almost all bodies are stopped at 30 % loss, and
    with half of everything lost all of them, sooner or later, are stopped and accounted for."""
    scene = Scene(robots=40, loss=0.3, twice=0.1, delay=0.03)
    desk = scene.desk()
    stop = desk.stop()
    scene.run(0.5)
    assert sum(robot.node.stopped for robot in scene.fleet.values()) >= 39
    scene.loss = 0.5
    scene.run(8.0)
    assert desk.accounting(stop.id).complete
    assert all(robot.node.stopped for robot in scene.fleet.values())


def test_a_stop_is_given_up_by_hand_only() -> None:
    scene = Scene()
    scene.isolate("r1")
    desk = scene.desk()
    scene.isolate("r1")
    stop = desk.stop()
    scene.run(2.0)
    desk.give_up(stop.id)
    before = desk.session.delivery.next_number
    scene.run(5.0)
    assert desk.session.delivery.next_number <= before + 2, "nothing but digests"
    assert silent(desk, stop.id) == ("r1",), "and what is not known stays unknown"


@pytest.mark.parametrize("off", [3_600.0, -3_600.0, 86_400.0, -86_400.0, 4.0, -9.0, -START])
def test_stop_is_obeyed_whatever_its_time_says(off: float) -> None:
    """Must 2: an operator with a wrong clock stops everybody; of all else of his nothing is obeyed."""
    scene = Scene(robots=1)
    scene.desk("chief")
    issued = scene.clock.now() + off
    scene.say(Message("anna", 1, 1, Kind.STOP, issued, issued + 5.0), KEYS["anna"])
    scene.run(0.1)
    assert scene.fleet["r0"].node.stopped
    scene.say(Message("anna", 1, 2, Kind.RELEASE, issued, issued + 5.0), KEYS["anna"])
    scene.run(0.1)
    assert scene.fleet["r0"].node.stopped


def test_a_recorded_stop_that_was_released_is_over_years_later() -> None:
    """Its number says so; also to a robot that has forgotten which numbers it has heard, as far as it can."""
    scene = Scene(robots=1)
    desk = scene.desk()
    desk.stop()
    scene.run(0.3)
    recorded = [datagram for datagram in scene.sent if look(datagram).kind is Kind.STOP]
    desk.release_all()
    scene.run(1.0)
    robot = scene.fleet["r0"]
    assert not robot.node.stopped
    robot.session.delivery.admission._heard.clear()
    scene.clock.advance(1e8)
    for datagram in recorded:
        scene.fly("stranger", datagram)
    scene.run(0.3)
    assert not robot.node.stopped


def test_a_release_by_somebody_who_heard_the_stop_ends_it() -> None:
    scene = Scene()
    chief, anna = scene.desk("chief"), scene.desk("anna")
    anna.stop()
    scene.run(0.5)
    release = chief.release_all()
    scene.run(0.5)
    assert not any(robot.node.stopped for robot in scene.fleet.values())
    assert chief.accounting(release.id).n_matched == 3


def test_a_release_by_somebody_who_did_not_hear_of_a_stop_is_refused_until_robots_have_told_him() -> None:
    scene = Scene()
    chief, anna = scene.desk("chief"), scene.desk("anna")
    scene.deaf.add(("anna", "chief"))
    anna.stop()
    scene.run(0.5)
    release = chief.release_all()
    scene.run(0.5)
    assert all(robot.node.stopped for robot in scene.fleet.values())
    assert chief.accounting(release.id).n_fault == 3
    decided = chief.now
    chief.post(Kind.ASK, body={"look": "telemetry"})
    scene.run(0.5)
    again = chief.release_all(decided)
    scene.run(0.5)
    assert chief.accounting(again.id).n_matched == 3
    assert not any(robot.node.stopped for robot in scene.fleet.values())


@pytest.mark.parametrize("deaf", [False, True])
def test_a_release_ends_what_an_observer_piles_up_once_its_operator_has_seen_it(deaf: bool) -> None:
    """An observer's STOPs in invented epochs hide no other's STOP, and the desk that looked can end all of them. deaf:
    whether it has heard none of them itself."""
    scene = Scene(robots=2)
    bert = scene.desk("bert")
    first = scene.desk("anna").stop()
    scene.run(0.3)
    if deaf:
        scene.deaf.add(("stranger", "bert"))
    for epoch in range(70):
        scene.say(Message("watch", epoch, 1, Kind.STOP, scene.clock.now()), KEYS["watch"])
    scene.run(0.5)
    latch = scene.fleet["r0"].node.authority.latch
    assert first.message.sender in {mark.sender for mark in latch.holding}
    refused = bert.post(Kind.RELEASE)
    scene.run(0.5)
    assert "more STOPs than there is room for" in bert.accounting(refused.id).faults["r0"]
    bert.post(Kind.ASK, body={"look": "telemetry"})
    scene.run(0.5)
    released = bert.release_all()
    scene.run(0.5)
    assert bert.accounting(released.id).n_matched == 2
    assert not any(robot.node.stopped for robot in scene.fleet.values())


def test_a_stop_that_came_after_a_release_was_decided_is_not_named_by_it() -> None:
    """While a RELEASE asks who is stopped, somebody stops: that holds."""
    scene = Scene()
    chief, anna = scene.desk("chief"), scene.desk("anna")
    scene.deaf.add(("anna", "chief"))
    decided = chief.now
    scene.run(0.2)
    anna.stop()
    chief.post(Kind.ASK, body={"look": "telemetry"})
    scene.run(0.5)
    chief.release_all(decided)
    scene.run(0.5)
    assert all(robot.node.stopped for robot in scene.fleet.values())


@pytest.mark.parametrize(
    "seed", [pytest.param(seed, marks=() if seed < 3 else pytest.mark.nightly) for seed in range(8)]
)
def test_a_relay_that_delays_repeats_and_reorders_neither_frees_nor_loses_a_stop(seed: int) -> None:
    """Two operators stop and release by turns; what they say comes up to two seconds late, twice, and in any order. In
    the end everybody is as the last word of each had it, and nobody was freed while a STOP that he knew of held."""
    scene = Scene(seed=seed, twice=0.5, delay=2.0, loss=0.2)
    desks = scene.desk("chief"), scene.desk("anna")
    chance = scene.chance
    for _ in range(6):
        desk = chance.choice(desks)
        (desk.stop if chance.random() < 0.5 else desk.release)()
        scene.run(chance.uniform(0.0, 1.5))
    last = chance.choice(desks).stop()
    scene.run(8.0)
    assert all(robot.node.stopped for robot in scene.fleet.values())
    assert last.n_silent == 0
    for desk in desks:  # each has heard of the other one's
        desk.release_all()
        scene.run(8.0)
    assert not any(robot.node.stopped for robot in scene.fleet.values())


def test_a_robot_in_doubt_moves_after_a_release_that_was_sent_since_it_started() -> None:
    """What it has forgotten may have come after a RELEASE that is played again now."""
    scene = Scene(robots=1)
    scene.run(1.0)
    node = scene.fleet["r0"].node
    node.halt("its store is damaged")
    scene.say(Message("anna", 1, 1, Kind.RELEASE, START - 0.5), KEYS["anna"])
    scene.run(0.1)
    assert node.stopped
    scene.desk().release_all()
    scene.run(0.5)
    assert not node.stopped
