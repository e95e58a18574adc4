"""BEST and QUORUM between real desks and real minds, on a radio that loses, repeats and delays."""

from __future__ import annotations

import msgspec
import pytest

from safety.scene import VOCABULARY, Scene
from sleepcast.channel import Kind, Message
from sleepcast.channel.message import AUCTION, HOPS
from sleepcast.console.features.why import show_why
from sleepcast.language import CheckError
from sleepcast.language.explain import Explanation
from sleepcast.mind.auction import AuctionStatus, BidMessage, BidPhase, GrantMessage
from sleepcast.mind.authority import NO_CALLER, Tells
from sleepcast.mind.limits import TOO_MANY_CALLS
from sleepcast.mind.telemetry import read_why, why_text
from sleepcast.node.node import Node
from sleepcast.station.account import Account
from sleepcast.station.network import NetworkStation, RoleError
from sleepcast.station.prepared import Terms
from sleepcast.station.sent import Command
from sleepcast.station.staging import Stages
from sleepcast.station.validation import CommandTypeError

LEASE = 4.0
BEST = "(BEST 4 (ABS (- x 3.2)) TRUE (JOIN red))"


def status_of(desk: NetworkStation, sent: Command) -> AuctionStatus:
    status = desk.accounting(sent.id).auction
    assert status is not None
    return status


def members(scene: Scene, group: str = "red") -> list[str]:
    return [name for name, robot in scene.fleet.items() if robot.on and group in robot.node.groups]


def ended(scene: Scene, desk: NetworkStation, text: str, seconds: float = 3.0) -> tuple[Command, Account]:
    """What became of a text, some seconds after it was sent."""
    sent = desk.send(text, confirmed=True)
    scene.run(seconds)
    return sent, desk.accounting(sent.id)


def test_the_four_robots_of_the_least_cost_obey_and_the_account_says_who_did_not_and_why() -> None:
    scene = Scene(robots=8)
    desk = scene.desk()
    sent, account = ended(scene, desk, "(BEST 4 (IF (= id 7) UNKNOWN (ABS (- x 3.2))) (> id 0) (JOIN red))")
    assert members(scene) == ["r2", "r3", "r4", "r5"]
    assert set(account.matched) == {"r2", "r3", "r4", "r5"}
    assert set(account.not_matched) == {"r0", "r1", "r6"}
    assert (account.unknown, account.fault, account.n_silent) == (("r7",), (), 0)
    status = status_of(desk, sent)
    assert status.chosen == ("r3", "r4", "r2", "r5")
    assert status.bids["r1"] == pytest.approx(2.2)
    assert "r0" not in status.bids
    chosen = ("r3", "r4", "r2", "r5")
    assert status.outbid() == {"r1": chosen, "r6": chosen}
    assert "6 bids; chosen r3 (0.2), r4 (0.8), r2 (1.2), r5 (1.8)" in account.sentence()
    assert account.to_dict()["auction"] == status.to_dict()
    assert desk.answered(sent) < sent.message.issued + 2.0, "nobody waits for more when all have been chosen"
    later = desk.send("(BEST 4 x TRUE (JOIN red))", deadline=3600.0, confirmed=True)
    assert desk.answered(later) == later.message.deadline
    scene.run(3.0)
    assert desk.answered(later) < later.message.issued + 2.0


def test_of_equal_costs_the_smaller_names_obey() -> None:
    scene = Scene(robots=12)
    ended(scene, scene.desk(), "(BEST 3 1 (> id 1) (JOIN red))")
    assert members(scene) == ["r2", "r3", "r4"]


def test_members_stay_while_the_desk_is_there_and_leave_by_themselves_when_it_is_gone() -> None:
    scene = Scene(robots=6, loss=0.3, twice=0.2, delay=0.05)
    desk = scene.desk()
    ended(scene, desk, "(BEST 2 x TRUE (PROGN (JOIN red) (RULE shine (MARK))))", 20.0)
    assert members(scene) == ["r0", "r1"]
    rules = [[rule.name for rule in scene.fleet[name].node.rules()] for name in ("r0", "r1", "r2")]
    assert rules == [["shine"], ["shine"], []]
    scene.run(LEASE + 0.5, busy={"chief"})
    assert members(scene) == []
    assert not any(robot.node.rules() for robot in scene.fleet.values())
    scene.run(3.0)  # the desk is back, and none of them is
    assert members(scene) == []


def test_what_a_robot_was_before_it_stays() -> None:
    scene = Scene(robots=2)
    desk = scene.desk()
    ended(scene, desk, "(WHEN (= id 0) (JOIN red))", 0.5)
    ended(scene, desk, "(BEST 2 x TRUE (JOIN red))")
    assert members(scene) == ["r0", "r1"]
    desk.send("(WHEN (= id 1) (RULE other (MARK)))", confirmed=True)
    scene.run(LEASE + 1.0, busy={"chief"})
    assert members(scene) == ["r0"]


def test_a_rule_that_a_later_command_has_changed_is_not_forgotten() -> None:
    scene = Scene(robots=1)
    desk = scene.desk()
    ended(scene, desk, "(BEST 1 x TRUE (RULE shine (MARK)))")
    ended(scene, desk, "(WHEN (= id 0) (RULE shine (UNMARK)))", 0.5)
    scene.run(LEASE + 1.0, busy={"chief"})
    assert [rule.text for rule in scene.fleet["r0"].node.rules()] == ["(UNMARK)"]


@pytest.mark.parametrize("deadline", [None, 30.0])
def test_a_place_is_given_again_only_when_its_lease_is_over(deadline: float | None) -> None:
    scene = Scene(robots=6)
    desk = scene.desk()
    sent = desk.send("(BEST 2 x TRUE (JOIN red))", deadline=deadline, confirmed=True)
    scene.run(0.9)
    scene.isolate("r0")  # it has bid, and hears nothing any more
    scene.run(3.0)
    assert members(scene) == ["r1"]
    scene.run(2.5)
    assert members(scene) == ["r1", "r2"]
    assert status_of(desk, sent).chosen == ("r0", "r1", "r2")
    scene.join("r0")
    scene.run(3.0)
    assert members(scene) == ["r1", "r2"]
    assert "r0" in desk.accounting(sent.id).not_matched


def test_a_robot_whose_test_is_false_by_the_time_of_the_grant_makes_way() -> None:
    scene = Scene(robots=4)
    desk = scene.desk()
    sent = desk.send("(BEST 2 x (NOT marked) (JOIN red))", confirmed=True)
    scene.run(0.5)
    desk.send("(WHEN (= id 0) (MARK))", confirmed=True)
    scene.run(3.0)
    assert members(scene) == ["r1", "r2"]
    assert status_of(desk, sent).members == ("r1", "r2")


@pytest.mark.parametrize(("times", "seconds"), [("", 7.5), (":lease 10s :window 2s", 14.5), (":lease 1h", 5.0)])
def test_it_is_good_until_a_place_of_a_dead_robot_can_be_given_again(times: str, seconds: float) -> None:
    message = Scene(robots=2).desk().send(f"(BEST 1 x TRUE (JOIN red) {times})", confirmed=True).message
    assert message.deadline - message.issued == pytest.approx(seconds, abs=0.02)


@pytest.mark.parametrize("who", ["chief", "watch"])
def test_stop_ends_every_bid_and_grant_and_release_brings_none_back(who: str) -> None:
    scene = Scene(robots=4)
    desk, other = scene.desk(), scene.desk(who)
    ended(scene, desk, "(BEST 2 x TRUE (JOIN red))")
    sent = desk.send("(BEST 2 x TRUE (JOIN blue))", confirmed=True)
    scene.run(0.5)
    other.stop()
    scene.run(0.5)
    assert members(scene) == members(scene, "blue") == []
    assert {account.fault or "" for account in desk.accounting(sent.id).answers.values()} == {"STOP has ended its bid"}
    desk.release_all()
    scene.run(3.0)
    assert not any(robot.node.stopped for robot in scene.fleet.values())
    assert members(scene) == members(scene, "blue") == []


def test_a_cancel_ends_the_bids_and_grants_of_its_sender() -> None:
    scene = Scene(robots=4)
    desk, other = scene.desk(), scene.desk("anna")
    ended(scene, desk, "(BEST 2 x TRUE (JOIN red))")
    ended(scene, other, "(BEST 2 x TRUE (JOIN blue))")
    sent = desk.send("(BEST 2 x TRUE (JOIN green))", confirmed=True)
    scene.run(0.5)
    cancel = desk.send("(WHEN (< x 3) (CANCEL))", confirmed=True)
    scene.run(3.0)
    assert desk.accounting(cancel.id).answers["r0"].value == 2.0
    assert (members(scene), members(scene, "blue"), members(scene, "green")) == ([], ["r0", "r1"], ["r3"])
    assert set(desk.accounting(sent.id).faults.values()) == {"CANCEL has ended its bid"}
    assert told(scene, "r0", sent).render().endswith("it bid 0, and CANCEL ended that")


def test_nobody_waits_for_the_deadline_of_what_stop_has_ended() -> None:
    scene = Scene(robots=3)
    desk = scene.desk()
    scene.isolate("r2")
    sent = desk.send("(BEST 1 x TRUE (JOIN red))", deadline=3600.0, confirmed=True)
    scene.run(0.5)
    assert desk.answered(sent) == sent.message.deadline
    desk.stop()
    assert desk.answered(sent) < sent.message.issued + 3.0


def test_robots_that_are_stopped_do_not_bid() -> None:
    scene = Scene(robots=3)
    desk = scene.desk()
    desk.stop()
    scene.run(0.5)
    _, account = ended(scene, desk, "(BEST 2 x TRUE (DRIVE 1))")
    assert set(account.faults.values()) == {"it is held still, so it does not bid"}
    desk.release()
    scene.run(1.0)
    assert not any(robot.body.driven for robot in scene.fleet.values())


def test_two_callers_are_two_auctions_whose_tests_are_looked_at_again() -> None:
    scene = Scene(robots=6)
    chief, anna = scene.desk(), scene.desk("anna")
    text = "(BEST 2 x (NOT (IN busy)) (JOIN busy))"
    sent = [desk.send(text, confirmed=True) for desk in (chief, anna)]
    scene.run(4.0)
    both = [set(status_of(desk, each).members) for desk, each in zip((chief, anna), sent, strict=True)]
    assert not both[0] & both[1]
    assert both[0] | both[1] == {"r0", "r1", "r2", "r3"}
    assert members(scene, "busy") == ["r0", "r1", "r2", "r3"]


def test_who_may_not_command_chooses_nobody() -> None:
    scene = Scene(robots=3)
    with pytest.raises(RoleError):
        scene.desk("watch").send(BEST, confirmed=True)
    with pytest.raises(RoleError, match="changes no rules"):
        scene.desk("anna").send("(BEST 2 x TRUE (RULE a (MARK)))", confirmed=True)
    ended(scene, scene.desk("anna"), "(BEST 1 x TRUE (JOIN red))")
    assert members(scene) == ["r0"]


def test_nobody_begins_without_a_quorum_and_the_account_says_so() -> None:
    scene = Scene(robots=6)
    desk = scene.desk()
    sent, account = ended(scene, desk, "(QUORUM 5 8 (> id 1) (JOIN red))")
    assert members(scene) == []
    assert (account.n_matched, account.n_not_matched, account.n_silent) == (0, 6, 0)
    assert not status_of(desk, sent).started
    assert "4 bids, wanted 5: nobody was chosen" in account.sentence()
    assert status_of(desk, sent).outbid() == {}
    assert told(scene, "r2", sent).render().endswith("it accepted, and nobody was chosen")
    _, account = ended(scene, desk, "(QUORUM 3 4 (> id 0) (JOIN red))")
    assert members(scene) == ["r1", "r2", "r3", "r4"]
    assert "5 bids; chosen r1, r2, r3, r4" in account.sentence()


def test_a_quorum_of_which_too_few_obey_is_told() -> None:
    scene = Scene(robots=3)
    desk = scene.desk()
    sent = desk.send("(QUORUM 3 3 (NOT marked) (JOIN red))", confirmed=True)
    scene.run(0.5)
    desk.send("(WHEN (= id 0) (MARK))", confirmed=True)
    scene.run(6.0)
    assert members(scene) == ["r1", "r2"]
    assert status_of(desk, sent).short
    assert "short: only 2 obeyed, wanted 3" in desk.accounting(sent.id).sentence()


def test_on_a_radio_that_loses_half_four_obey_and_never_five() -> None:
    scene = Scene(robots=9, loss=0.5, twice=0.1, delay=0.1)
    desk = scene.desk()
    sent = desk.send(BEST, confirmed=True)
    most = 0
    for _ in range(60):
        scene.run(0.1)
        most = max(most, len(members(scene)))
    account = desk.accounting(sent.id)
    assert most == 4
    assert set(account.matched) == set(members(scene)) == set(status_of(desk, sent).members)
    assert account.n_silent == 0


def test_of_two_robots_of_one_name_at_most_one_obeys() -> None:
    scene = Scene(robots=3)
    scene.run(0.05)
    twin = scene.another("r0", number=0)
    twin.node.sense((0.0, 0.5), 0.0)
    desk = scene.desk()
    ended(scene, desk, "(BEST 2 x TRUE (JOIN red))")
    assert len(members(scene)) <= 2


def told(scene: Scene, robot: str, sent: Command) -> Explanation:
    """Why a robot did what it did, as it says it over the air."""
    explanation = read_why(why_text(scene.fleet[robot].node.why(sent.id)))
    assert explanation.bid == scene.fleet[robot].node.why(sent.id).bid
    assert show_why(explanation).bid == ("" if explanation.bid is None else explanation.bid.sentence)
    return explanation


def test_why_says_what_a_robot_has_bid_and_who_bid_less() -> None:
    scene = Scene(robots=5)
    desk = scene.desk()
    sent, _ = ended(scene, desk, "(BEST 2 (IF (= id 4) UNKNOWN (+ x 0.5)) (> id 0) (JOIN red))")
    member, outbid, unsure = (told(scene, name, sent) for name in ("r1", "r3", "r4"))
    assert (member.matched, member.verdict, member.text[-12:]) == (True, "obeyed", " (JOIN red))")
    assert member.render().endswith("it bid 1.5, and is one of those who were chosen")
    assert (outbid.matched, outbid.verdict, outbid.value) == (False, "was outbid", 3.5)
    assert outbid.render().endswith("it bid 3.5, and others were chosen: r1 (1.5), r2 (2.5)")
    assert outbid.to_dict()["bid"] == {"cost": 3.5, "state": "outbid", "better": {"r1": 1.5, "r2": 2.5}}
    assert (unsure.matched, unsure.verdict) == (False, "did not bid")
    assert unsure.render().endswith("its cost was unknown, so it did not bid")
    assert told(scene, "r0", sent).bid is None
    assert not told(scene, "r0", sent).matched
    scene.run(LEASE + 1.0, busy={"chief"})
    assert told(scene, "r1", sent).render().endswith("it bid 1.5, was one of those who were chosen, and has left since")


def test_why_says_how_a_bid_stands_that_nobody_has_granted() -> None:
    scene = Scene(robots=4)
    desk = scene.desk()
    sent = desk.send("(QUORUM 2 2 (NOT marked) (JOIN red))", confirmed=True)
    scene.run(0.5)
    waiting = told(scene, "r1", sent)
    assert (waiting.matched, waiting.verdict) == (False, "waits to be chosen")
    assert waiting.render().endswith("it accepted, and waits to be chosen; names before its own: r0")
    desk.send("(WHEN (= id 0) (MARK))", confirmed=True)
    scene.run(1.0)
    assert told(scene, "r0", sent).render().endswith("it accepted, was chosen, and did not obey then")
    lost = desk.send("(BEST 1 x TRUE (JOIN red))", confirmed=True)
    scene.run(0.5)
    scene.isolate("r3")
    scene.run(8.0)
    assert (
        told(scene, "r3", lost).render().endswith("it bid 3, and nobody chose it in time; bids before its own: r0 (0)")
    )
    stopped = desk.send("(BEST 1 x TRUE (JOIN red))", confirmed=True)
    scene.run(0.5)
    desk.stop()
    scene.run(0.5)
    assert told(scene, "r0", stopped).verdict == "was not chosen"
    assert told(scene, "r0", stopped).render().endswith("it bid 0, and STOP ended that")


@pytest.mark.parametrize("text", [BEST, "(QUORUM 1 2 TRUE (JOIN red))"])
def test_it_is_sent_once(text: str) -> None:
    scene = Scene(robots=2)
    with pytest.raises(CommandTypeError, match="cannot be standing: who is chosen is a matter of the moment"):
        scene.desk().prepare(text, Terms(standing=True))
    with pytest.raises(CheckError, match="stands in no other expression"):
        scene.desk().send(f"(RULE choose {text})", confirmed=True)


def test_it_is_not_sent_in_stages() -> None:
    desk = Scene(robots=2).desk()
    with pytest.raises(CommandTypeError, match="chooses among all robots at once"):
        Stages(desk, desk.prepare(BEST))


def test_what_others_tell_and_standing_commands_choose_nobody() -> None:
    for sent in ({"standing": True}, {"body": {HOPS: 1}}):
        node = Node("r1", VOCABULARY)
        node.receive(Message("r2", 1, 1, Kind.COMMAND, 0.0, text=BEST, **sent))  # type: ignore[arg-type]
        node.think(1, 0.1)
        (answer,) = node.outbox
        assert answer.body["fault"] == NO_CALLER


def test_a_robot_takes_part_in_so_many_auctions_of_one_caller_and_of_all() -> None:
    scene = Scene(robots=1)
    desks = [scene.desk(), scene.desk("anna"), scene.desk("bert")]
    sent = [
        (desk, desk.send(f"(BEST 1 x TRUE (PROGN (JOIN g{n}) 0))", confirmed=True)) for desk in desks for n in range(9)
    ]
    scene.run(2.5)
    refused = [desk.accounting(each.id).n_fault for desk, each in sent]
    assert refused == [*[0] * 8, 1] * 2 + [1] * 9


def test_who_is_no_robot_does_not_bid() -> None:
    scene = Scene(robots=2)
    chief, watch = scene.desk(), scene.desk("watch")
    sent = chief.send("(BEST 1 x TRUE (JOIN red))", confirmed=True)
    poll = sent.message
    for beat in range(10):
        bid = BidMessage(poll.sender, poll.epoch, poll.sequence, beat, BidPhase.BIDDING, -9.0)
        watch.session.delivery.post(Kind.REQUEST, scene.clock.now(), body=bid.body())
        scene.run(0.1)
    scene.run(1.0)
    assert members(scene) == ["r0"]
    assert status_of(chief, sent).bids.keys() == {"r0", "r1"}


def test_bids_of_many_others_do_not_keep_a_grant_out() -> None:
    scene = Scene(robots=2)
    chief = scene.desk()
    chief.send("(BEST 1 x TRUE (JOIN red))", confirmed=True)
    scene.run(0.4)
    robot = scene.fleet["r0"].node
    assert robot.auctions is not None
    poll, bid = robot.auctions.bidding._open[0].poll, robot.auctions.bidding._open[0].bid
    grants = GrantMessage(poll.sequence, True, {"r0": max(bid.beats)}, ())
    about = {"kind": Kind.REQUEST, "issued": poll.issued}
    robot.receive(msgspec.structs.replace(poll, sequence=poll.sequence + 1_000, text="", body=grants.body(), **about))
    other = BidMessage(poll.sender, poll.epoch, poll.sequence, 1, BidPhase.BIDDING, 9.0).body()
    for number in range(1_000):
        robot.receive(Message(f"r{number + 2}", 1, 1, body=other, **about))
    robot.think(1_000, scene.clock.now() - scene.fleet["r0"].session.zero)
    assert "red" in robot.groups


def test_grants_of_somebody_else_make_nobody_a_member() -> None:
    scene = Scene(robots=2)
    chief, anna = scene.desk(), scene.desk("anna")
    sent = chief.send("(BEST 1 (- x) TRUE (JOIN red))", confirmed=True)
    scene.run(0.4)
    robot = scene.fleet["r0"]
    assert robot.node.auctions is not None
    for beat in list(robot.node.auctions.bidding._open[0].bid.beats):
        grants = {
            "of": sent.message.sequence,
            "open": True,
            "granted": ["r0"],
            "beats": [beat],
            "best": [],
            "costs": [],
        }
        anna.session.delivery.post("request", scene.clock.now(), body={"grants": grants})  # type: ignore[arg-type]
    scene.run(0.3)
    assert members(scene) == []
    scene.run(2.0)
    assert members(scene) == ["r1"]


# ---- robots that call


CALL = "(RULE call (TELL (BEST 2 x (> id 0) (JOIN red))))"


def test_a_robot_chooses_others_and_a_restart_makes_them_never_too_many() -> None:
    scene = Scene(robots=6, loss=0.2, twice=0.2, delay=0.05)
    scene.fleet["r0"].node.evaluate(CALL)
    scene.run(3.0)
    assert members(scene) == ["r1", "r2"]
    scene.run(10.0)
    assert members(scene) == ["r1", "r2"]
    restarted = scene.restart("r0")
    restarted.node.evaluate("(RULE call (TELL (BEST 2 (- x) (> id 0) (JOIN red))))")  # others are the best by now
    counts = []
    for _ in range(80):
        scene.run(0.1)
        counts.append(len(members(scene)))
    assert max(counts) == 2
    assert members(scene) == ["r4", "r5"]


def test_a_robot_that_is_stopped_calls_nobody() -> None:
    scene = Scene(robots=4)
    desk = scene.desk()
    scene.fleet["r0"].node.evaluate(CALL)
    scene.run(3.0)
    desk.stop()
    scene.run(1.0)
    assert members(scene) == []
    scene.run(4.0)
    desk.release_all()
    scene.run(6.0)
    assert members(scene) == ["r1", "r2"], "its rule is there, and tells it again"


@pytest.mark.parametrize(("tells", "joined"), [(Tells.MARKS, ["r1", "r2"]), (Tells.NONE, [])])
def test_who_obeys_no_tell_does_not_bid(tells: Tells, joined: list[str]) -> None:
    scene = Scene(robots=3, tells=tells)
    scene.fleet["r0"].node.evaluate(CALL)
    scene.run(3.0)
    assert members(scene) == joined


def test_a_robot_calls_so_many_at_once() -> None:
    node = Node("r1", VOCABULARY)
    node.think(1, 0.1)
    faults = [node.evaluate(f"(TELL (BEST {n} 1 TRUE (MARK)))").faults for n in range(1, 10)]
    assert [len(each) for each in faults] == [*[0] * 8, 1]
    assert faults[-1][0].reason == TOO_MANY_CALLS
    numbers = [said.body[AUCTION] for said in node.outbox if said.text]
    assert len(set(numbers)) == 8
