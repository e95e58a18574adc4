"""Leases of groups: one operator alone commands, others hear why not, and nobody is locked out for good."""

from __future__ import annotations

from random import Random

import pytest

from safety.scene import KEYS, Scene
from sleepcast.channel import Kind, Message
from sleepcast.channel.message import LEASE, LeaseAction
from sleepcast.mind.authority import MAX_LEASE, MAX_LEASES, LeaseRequest, Leases
from sleepcast.station import Account
from sleepcast.station.leases import LeaseError, describe_request, lease_body
from sleepcast.station.network import NetworkStation


@pytest.fixture
def scene() -> Scene:
    """Four robots, of which r2 and r3 are in bravo."""
    made = Scene(robots=4)
    made.desk("chief").send("(WHEN (> x 1) (JOIN bravo))")
    made.run(0.5)
    return made


def lease(scene: Scene, who: str, deed: LeaseAction, seconds: float = 60.0, to: str = "") -> Account:
    desk = scene.desk(who)
    sent = desk.post(Kind.COMMAND, body=lease_body(deed, "bravo", seconds, to))
    scene.run(0.5)
    return desk.accounting(sent.id)


def drive(scene: Scene, desk: NetworkStation, text: str = "(DRIVE 1)") -> Account:
    sent = desk.send(text, everybody=True)
    scene.run(0.5)
    return desk.accounting(sent.id)


def test_a_leased_group_refuses_others_and_says_why(scene: Scene) -> None:
    """Must 5: the refusal tells its reason to whoever is refused; robots outside the group obey both."""
    taken = lease(scene, "anna", LeaseAction.TAKE)
    assert (taken.matched, taken.not_matched) == (("r2", "r3"), ("r0", "r1"))
    theirs = drive(scene, scene.desk("bert"))
    assert (theirs.matched, theirs.fault) == (("r0", "r1"), ("r2", "r3"))
    assert theirs.faults["r2"].startswith("bravo is under the lease of anna for 59 s more")
    assert drive(scene, scene.desk("anna")).n_matched == 4
    assert scene.fleet["r2"].body.driven == [1.0]


def test_a_lease_keeps_out_a_commander_too_until_it_is_forced(scene: Scene) -> None:
    """Must 5: request, grant, force; only a commander forces."""
    lease(scene, "anna", LeaseAction.TAKE)
    assert drive(scene, scene.desk("chief")).n_fault == 2
    refused = lease(scene, "bert", LeaseAction.FORCE)
    assert refused.n_fault == 4
    assert "only a commander may force bravo" in refused.faults["r2"]
    assert lease(scene, "chief", LeaseAction.FORCE).n_matched == 2
    assert drive(scene, scene.desk("chief")).n_matched == 4
    assert drive(scene, scene.desk("anna")).n_fault == 2


def test_who_asks_for_a_lease_is_refused_and_its_holder_hears_of_it(scene: Scene) -> None:
    """Must 5: request and grant."""
    lease(scene, "anna", LeaseAction.TAKE)
    asked = lease(scene, "bert", LeaseAction.REQUEST)
    assert asked.n_fault == 4
    assert "sleepcast lease request bravo asks" in asked.faults["r2"]
    (heard,) = [said for said in map(describe_request, scene.desk("anna").news) if said]
    assert heard == "bert asks for bravo: sleepcast lease grant bravo --to bert"
    assert lease(scene, "bert", LeaseAction.GRANT, to="bert").n_fault == 4, "it is not his to grant"
    assert lease(scene, "anna", LeaseAction.GRANT, to="bert").n_matched == 2
    assert drive(scene, scene.desk("bert")).n_matched == 4
    assert drive(scene, scene.desk("anna")).n_fault == 2


def test_a_lease_that_is_not_renewed_ends_by_itself(scene: Scene) -> None:
    lease(scene, "anna", LeaseAction.TAKE, seconds=10.0)
    scene.run(5.0)
    lease(scene, "anna", LeaseAction.TAKE, seconds=10.0)
    scene.run(6.0)
    assert drive(scene, scene.desk("bert")).n_fault == 2
    scene.run(4.0)
    assert drive(scene, scene.desk("bert")).n_matched == 4


@pytest.mark.parametrize("deed", [LeaseAction.TAKE, LeaseAction.REQUEST])
def test_who_holds_a_lease_does_not_shorten_it_by_asking_for_it(scene: Scene, deed: LeaseAction) -> None:
    lease(scene, "anna", LeaseAction.TAKE, seconds=300.0)
    assert lease(scene, "anna", deed, seconds=60.0).n_matched == 2
    scene.run(100.0)
    assert drive(scene, scene.desk("bert")).n_fault == 2


def test_no_lease_is_granted_to_who_may_not_command(scene: Scene) -> None:
    lease(scene, "anna", LeaseAction.TAKE)
    anna = scene.desk("anna")
    with pytest.raises(LeaseError, match=r"^watch is an observer, who commands no robots"):
        anna.lease(LeaseAction.GRANT, "bravo", 60.0, "watch")
    for named in ("bert", "chief", "zoe"):  # of zoe nothing is known
        anna.lease(LeaseAction.GRANT, "bravo", 60.0, named)


def test_a_lease_is_given_back(scene: Scene) -> None:
    lease(scene, "anna", LeaseAction.TAKE)
    assert lease(scene, "bert", LeaseAction.GIVE).n_fault == 4, "it is not his to give"
    assert lease(scene, "anna", LeaseAction.GIVE).n_matched == 2
    assert lease(scene, "bert", LeaseAction.TAKE).n_matched == 2


def test_nobody_gets_round_a_lease_by_joining_or_leaving(scene: Scene) -> None:
    """A robot that joins comes under the lease, and others neither take robots out of the group nor into it."""
    lease(scene, "anna", LeaseAction.TAKE)
    bert = scene.desk("bert")
    for text in ("(JOIN bravo)", "(LEAVE bravo)", "(WHEN (< x 5) (PROGN 1 (LEAVE bravo)))"):
        assert drive(scene, bert, text).n_fault == 4, text
    assert drive(scene, scene.desk("anna"), "(JOIN bravo)").n_matched == 4
    assert drive(scene, bert).n_fault == 4


def test_stop_and_questions_are_no_matter_of_leases(scene: Scene) -> None:
    """Must 2: STOP by whoever is there."""
    lease(scene, "anna", LeaseAction.TAKE)
    bert = scene.desk("bert")
    asked = bert.ask("x")
    scene.desk("watch").stop()
    scene.run(0.5)
    assert bert.accounting(asked.id).n_matched == 4
    assert all(robot.node.stopped for robot in scene.fleet.values())


def test_what_stands_goes_to_all_so_that_rules_agree(scene: Scene) -> None:
    lease(scene, "anna", LeaseAction.TAKE)
    scene.desk("chief").send("(RULE go (SETQ throttle 0.1))", standing=True, everybody=True)
    scene.run(0.5)
    assert {len(robot.node.rules()) for robot in scene.fleet.values()} == {1}


@pytest.mark.parametrize(
    "body",
    [
        None,
        5,
        {},
        {"do": "take"},
        {"do": "steal", "group": "bravo"},
        {"do": ["take"], "group": "bravo"},
        {"do": "take", "group": ""},
        {"do": "take", "group": "b" * 65},
        {"do": "take", "group": "bravo", "seconds": -1.0},
        {"do": "take", "group": "bravo", "seconds": MAX_LEASE + 1.0},
        {"do": "take", "group": "bravo", "seconds": float("nan")},
        {"do": "take", "group": "bravo", "seconds": "long"},
        {"do": "grant", "group": "bravo", "to": 7},
    ],
)
def test_a_lease_that_means_nothing_is_refused(scene: Scene, body: object) -> None:
    """Must 7: bounded, and no nonsense of a desk that is none of ours crashes a robot."""
    anna = scene.desk("anna")
    sent = anna.post(Kind.COMMAND, body={LEASE: body})
    scene.run(0.5)
    assert anna.accounting(sent.id).n_fault == 4
    assert drive(scene, scene.desk("bert")).n_matched == 4


def test_leases_are_bounded() -> None:
    """Must 7: an operator who takes ever more groups fills no robot's memory."""
    scene = Scene(robots=1)
    node = scene.fleet["r0"].node
    for number in range(MAX_LEASES + 1):
        body = lease_body(LeaseAction.TAKE, f"g{number}", 60.0)
        node.receive(Message("anna", 1, number, Kind.COMMAND, 0.0, body=body, role="operator"))
        node.think(number, 0.0)
    last = node.outbox[-1].body if len(node.outbox) < 256 else None
    node.outbox.clear()
    node.receive(
        Message("anna", 2, 1, Kind.COMMAND, 0.0, body=lease_body(LeaseAction.TAKE, "more", 60.0), role="operator")
    )
    node.think(1, 0.0)
    assert last is None
    assert "no room for another lease" in str(node.outbox[-1].body["fault"])


def test_a_lease_outlives_a_restart(scene: Scene) -> None:
    """What a robot must not forget is plain data with times as seconds, for whatever its clock says afterwards."""
    from sleepcast.mind.authority import Authority

    lease(scene, "anna", LeaseAction.TAKE)
    kept = scene.fleet["r2"].node.authority.state(20.0)
    again = Authority()
    again.restore(kept, 5.0)
    assert "under the lease of anna" in again.leases.objection("bert", ["bravo"], 5.0)
    assert again.leases.objection("bert", ["bravo"], 5.0 + 60.0) == ""


def test_a_desk_says_what_no_robot_could_grant() -> None:
    with pytest.raises(LeaseError, match="renew it"):
        lease_body(LeaseAction.TAKE, "bravo", MAX_LEASE + 1.0)
    with pytest.raises(LeaseError, match="to whom"):
        lease_body(LeaseAction.GRANT, "bravo", 5.0)
    assert describe_request(Message("bert", 1, 1, Kind.COMMAND, 0.0, text="(DRIVE 1)")) == ""


def test_robots_take_no_leases(scene: Scene) -> None:
    now = scene.clock.now()
    body = lease_body(LeaseAction.TAKE, "bravo", 60.0)
    scene.say(Message("r9", 1, 1, Kind.COMMAND, now, now + 5.0, body=body), KEYS["r*"])
    scene.run(0.3)
    assert drive(scene, scene.desk("bert")).n_matched == 4


def settled(leases: Leases, who: str, deed: LeaseAction, group: str, to: str = "", seconds: float = 60.0) -> str:
    wish = LeaseRequest(deed, group, seconds, to)
    return leases.settle(wish, Message(who, 1, 1, Kind.COMMAND, 0.0, role="operator"), 0.0)


@pytest.mark.parametrize("granted", [False, True])
def test_whoever_takes_all_leases_leaves_room_for_those_of_others(granted: bool) -> None:
    """Groups are invented as quickly as names, and a lease can be granted to anybody."""
    leases = Leases()
    assert not settled(leases, "anna", LeaseAction.TAKE, "bravo")
    refused = ""
    for number in range(2 * MAX_LEASES):
        refused = refused or settled(leases, "bert", LeaseAction.TAKE, f"g{number}")
        if granted:
            settled(leases, "bert", LeaseAction.GRANT, f"g{number}", f"x{number}")
    assert refused == f"no room for another lease: there are {MAX_LEASES}, most of them of bert"
    for number in range(9):
        assert not settled(leases, "anna", LeaseAction.TAKE, f"h{number}")
    assert not settled(leases, "anna", LeaseAction.TAKE, "bravo")
    assert leases.objection("bert", ["bravo", "h8"], 0.0)
    assert len(leases.state(0.0)) == MAX_LEASES


@pytest.mark.parametrize("seed", range(2))
def test_two_operators_never_hold_one_robot_at_once_while_clocks_jump(seed: int) -> None:
    """Both take the group again and again over a bad radio, while the clocks of robots are set by up to what is allowed
    and farther: no lease ends early, none lasts longer than its seconds, and nobody else commands meanwhile."""
    made = Scene(robots=2, loss=0.3, twice=0.2, delay=0.1, seed=seed)
    made.set_clock("bert", 1.0)
    made.desk("chief").send("(WHEN (> x 0) (JOIN bravo))")
    made.run(0.5)
    robot, chance, seconds = made.fleet["r1"], Random(seed), 0.4
    speeds, had, until = {"anna": 1.0, "bert": 2.0}, "", 0.0
    holders = set()
    for step in range(24):
        often, seldom = ("anna", "bert") if step // 6 % 2 else ("bert", "anna")
        who = often if chance.random() < 0.8 else seldom
        made.desk(who).post(Kind.COMMAND, body=lease_body(LeaseAction.TAKE, "bravo", seconds))
        made.desk(who).send(f"(DRIVE {speeds[who]})", everybody=True)
        if step % 5 == 3:
            made.set_clock("r1", chance.choice((-1.5, 1.5, 3_600.0, -86_400.0)))
        for _ in range(4):
            robot.body.driven.clear()
            made.run(0.05)
            state = robot.node.authority.leases.state(made._clocks["r1"].now() - robot.session.zero)
            holder, left = (str(state["bravo"][0]), float(state["bravo"][1])) if state else ("", 0.0)
            assert left <= seconds + 1e-6
            if had == holder != "":
                assert {*robot.body.driven} <= {speeds[had]}, "only the holder commands"
            elif had and holder:
                assert made.clock.now() >= until - 0.01, "it had not ended yet"
            had, until = holder, made.clock.now() + left
            holders.add(holder)
    assert holders >= {"anna", "bert"}


def test_a_lease_does_not_last_longer_because_a_clock_was_set_back_before_a_restart() -> None:
    """What is left of it begins to run when the robot is there again."""
    leases = Leases()
    assert not settled(leases, "anna", LeaseAction.TAKE, "bravo", seconds=60.0)
    again = Leases()
    again.restore(leases.state(20.0), 1_000_000.0)
    assert again.objection("bert", ["bravo"], 1_000_039.9)
    assert not again.objection("bert", ["bravo"], 1_000_040.1)
    assert not settled(again, "anna", LeaseAction.TAKE, "bravo", seconds=0.0)
    again.restore({"bravo": ["anna", 1e12]}, 0.0)
    assert not again.objection("bert", ["bravo"], MAX_LEASE + 0.1), "a damaged store gives nobody a lease for ever"
