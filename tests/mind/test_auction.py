"""Both halves of an auction: on a radio that loses, delays and repeats, with robots and callers that die."""

from __future__ import annotations

from math import inf
from random import Random

import msgspec
import pytest
from benchmarks.auctions.radio import LIFE, Rounds, best, quorum
from hypothesis import given
from hypothesis import strategies as st

from sleepcast.core.errors import MisuseError
from sleepcast.mind import auction
from sleepcast.mind.auction import (
    LATE,
    SOON,
    Auctioneer,
    Bid,
    BidMessage,
    BidPhase,
    GrantMessage,
    TakenPlace,
    rank,
)

POLL = ("desk", 1, 7)


def bid(name: str = "r1", cost: float = 1.0, now: float = 0.0, most: int = 4, lease: float = 4.0) -> Bid:
    return Bid(best(most, lease), POLL, name, cost, now, now + LIFE, 0.0)


def heard(beat: int, cost: float = 1.0, phase: BidPhase = BidPhase.BIDDING) -> BidMessage:
    return BidMessage(*POLL, beat, phase, cost)


def granting(name: str, beat: int, *, is_open: bool = True) -> GrantMessage:
    return GrantMessage(7, is_open, {name: beat}, ())


@given(
    st.integers(0, 2**32),
    st.sampled_from((0.0, 0.1, 0.3, 0.5)),
    st.sampled_from((1.0, 2.0, 4.0)),
    st.integers(1, 8),
    st.booleans(),
)
def test_there_are_never_too_many_whatever_is_lost_late_repeated_or_killed(
    seed: int, loss: float, lease: float, most: int, stop: bool
) -> None:
    chance = Random(seed)
    least = chance.randint(1, most)
    rounds = Rounds(chance, [best(most, lease), quorum(least, most, lease)], chance.randint(0, 12), loss)
    for robot in rounds.robots:
        robot.dies = chance.uniform(0.0, 8.0) if chance.random() < 0.3 else inf
        robot.willing = chance.random() < 0.8
        robot.stopped = chance.uniform(0.0, 6.0) if stop else inf
    rounds.caller_dies[0] = chance.choice((inf, chance.uniform(0.0, 6.0)))
    rounds.run(6.0)
    begun = rounds.callers[1].status()
    rounds.caller_dies = [rounds.time] * 2
    rounds.run(lease + 1.0)

    assert max(rounds.most_members) <= most
    assert rounds.members(0) == rounds.members(1) == [], "leases have run out, since the callers are gone"
    assert begun.started or not begun.chosen
    assert not begun.started or len(begun.bids) >= least


@given(st.lists(st.tuples(st.sampled_from([f"r{n}" for n in range(1, 15)]), st.integers(0, 3)), max_size=40))
def test_the_least_of_the_bids_that_were_heard_are_chosen_of_equal_ones_the_smaller_names(
    bids: list[tuple[str, int]],
) -> None:
    caller, costs = Auctioneer(best(4), 7, 0.0, LIFE), dict[str, float]()
    for beat, (name, cost) in enumerate(bids, 1):
        costs.setdefault(name, float(cost))  # the cost is that of the first bid
        caller.hear(name, 1, heard(beat, float(cost)), 0.5)
    grants = caller.step(1.0)

    chosen = sorted(costs, key=lambda name: rank(costs[name], name))[:4]
    assert caller.status().chosen == tuple(chosen)
    assert (set() if grants is None else set(grants.granted)) == set(chosen)
    assert set(caller.status().outbid()) == set(costs) - set(chosen)
    assert all(by == tuple(chosen) for by in caller.status().outbid().values())


def test_r2_is_a_smaller_name_than_r10() -> None:
    assert rank(1.0, "r2") < rank(1.0, "r10") < rank(1.5, "r1")


def test_nobody_begins_without_a_quorum() -> None:
    caller = Auctioneer(quorum(3, 5), 7, 0.0, LIFE)
    for name in ("r1", "r2"):
        caller.hear(name, 1, heard(1, 0.0), 0.4)
    grants = caller.step(1.0)
    assert grants is not None
    assert not grants.granted
    assert not grants.is_open
    assert not caller.status().started
    caller.hear("r3", 1, heard(1, 0.0), 1.1)  # too late
    assert caller.step(1.3) == grants._replace(best=((0.0, "r1"), (0.0, "r2"), (0.0, "r3")))


def test_a_quorum_of_which_too_few_obey_is_short() -> None:
    caller = Auctioneer(quorum(2, 2), 7, 0.0, LIFE)
    for name in ("r1", "r2"):
        caller.hear(name, 1, heard(1, 0.0), 0.4)
    caller.step(1.0)
    caller.hear("r1", 1, heard(2, 0.0, BidPhase.MEMBER), 1.2)
    caller.hear("r2", 1, heard(2, 0.0, BidPhase.OUT), 1.2)
    caller.step(3.0)
    status = caller.status()
    assert (status.started, status.over, status.short, status.members) == (True, True, True, ("r1",))


def test_a_place_is_given_again_when_its_lease_and_the_clocks_bound_are_over_or_the_robot_is_out() -> None:
    caller = Auctioneer(best(1), 7, 0.0, 60.0)
    caller.hear("r1", 1, heard(1, 1.0), 0.9)
    caller.hear("r2", 1, heard(1, 2.0), 0.9)
    caller.hear("r3", 1, heard(1, 3.0), 0.9)
    caller.step(1.0)
    for tenth in range(11, 100):
        now = tenth / 10
        for name in ("r2", "r3"):
            caller.hear(name, 1, heard(tenth), now)
        grants = caller.step(now)
        assert grants is None or list(grants.granted) == ["r1"] or now > 0.9 + 4.0 + LATE
    assert caller.status().chosen == ("r1", "r2")
    caller.hear("r2", 1, heard(100, phase=BidPhase.OUT), 10.0)
    grants = caller.step(10.1)
    assert grants is not None
    assert list(grants.granted) == ["r3"]
    assert not caller.is_over(10.1)
    caller.hear("r1", 1, heard(99, phase=BidPhase.MEMBER), 10.2)  # it said so long ago
    assert caller.status().members == ()


def test_a_caller_remembers_so_many_bids_and_robots_that_are_gone_and_all_who_were_chosen(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(auction, "MAX_BIDS", 10)
    caller = Auctioneer(best(2), 7, 0.0, 60.0)
    for number in range(100):
        caller.hear(f"r{number}", 1, heard(1, float(number)), 0.9)
        assert len(caller.status().bids) <= 20
    caller.step(1.0)
    for number in range(1_000):  # somebody with a key goes on, with ever better bids, after all places are taken
        caller.hear(f"f{number}", 1, heard(1, -1.0), 1.1)
        caller.hear(f"g{number}", 1, heard(1, phase=BidPhase.OUT), 1.1)
    status = caller.status()
    assert status.chosen == ("r0", "r1")
    assert len(status.bids) <= 20
    assert {"r0", "r1"} < status.bids.keys()
    assert len(caller.gone) <= 20
    assert "g999" in caller.gone
    grants = caller.step(1.2)
    assert grants is not None
    assert list(grants.granted) == ["r0", "r1"]


def test_a_member_that_looks_seldom_leaves_before_its_place_is_given_to_another() -> None:
    mine = bid()
    said = mine.say(1.0)
    assert said is not None
    assert mine.hear(granting("r1", said.beat), 1, 1.0)
    mine.settle(True)
    mine.tick(1.0)
    mine.tick(2.7)
    assert mine.phase is BidPhase.MEMBER
    mine.tick(4.4)  # at the next look, at 6.1 s, its place may be another's
    assert mine.phase is BidPhase.OUT


def test_a_member_leaves_by_itself_when_its_lease_is_not_renewed() -> None:
    mine = bid()
    said = mine.say(0.1)
    assert said is not None
    assert mine.hear(granting("r1", said.beat), 1, 1.2)
    mine.settle(True)
    renewed = mine.say(2.0)
    assert renewed is not None
    assert renewed.phase is BidPhase.MEMBER
    mine.tick(4.0)
    assert mine.phase is BidPhase.MEMBER
    assert not mine.hear(granting("r1", renewed.beat), 2, 4.0)
    for now in (4.5, 5.0, 5.5, 5.9):
        mine.tick(now)
    assert mine.phase is BidPhase.MEMBER
    mine.tick(6.0)  # four seconds after it sent what was granted, not after it heard the grant
    assert mine.phase is BidPhase.OUT
    assert not mine.hear(granting("r1", renewed.beat), 3, 6.1)
    said = mine.say(6.1)
    assert said is not None
    assert said.phase is BidPhase.OUT


@pytest.mark.parametrize(
    "grants",
    [
        granting("r1", 3),  # it never sent this one: another robot of its name did
        granting("r2", 1),
        GrantMessage(8, True, {"r1": 1}, ()),
    ],
)
def test_what_is_not_granted_to_this_robot_makes_it_no_member(grants: GrantMessage) -> None:
    mine = bid()
    mine.say(0.1)
    assert not mine.hear(grants, 1, 0.5)
    assert mine.phase is BidPhase.BIDDING


def test_a_grant_that_comes_when_its_lease_or_the_deadline_is_over_is_none() -> None:
    for lease, now in ((4.0, 4.0), (60.0, LIFE + 0.1)):
        mine = bid(lease=lease)
        said = mine.say(0.1)
        assert said is not None
        assert not mine.hear(granting("r1", said.beat), 1, now)


def test_a_robot_bids_seldom_while_it_hears_nothing_of_the_caller() -> None:
    mine = Bid(best(1), POLL, "r1", 1.0, 0.0, 3_600.0, 0.0)

    def bids(begin: float, seconds: float) -> int:
        return sum(mine.say(begin + tenth / 10.0) is not None for tenth in range(int(seconds * 10.0)))

    assert bids(0.0, 5.0) >= 40
    assert bids(20.0, 10.0) == 10
    mine.hear(GrantMessage(7, True, {}, ()), 1, 30.0)
    assert bids(31.0, 5.0) >= 35, "the caller is there again"
    assert bids(50.0, 10.0) == 10


def test_who_hears_of_enough_better_bids_is_silent_until_one_of_them_is_gone() -> None:
    mine = bid(cost=5.0, most=2)
    assert mine.say(0.0) is not None
    better = ((1.0, "r7"), (5.0, "r0"))
    mine.hear(GrantMessage(7, True, {}, better), 1, 0.2)
    assert mine.say(0.2) is None
    mine.hear(GrantMessage(7, True, {}, ((1.0, "r7"), (5.0, "r1"))), 3, 0.4)
    mine.hear(GrantMessage(7, True, {}, better), 2, 0.5)  # an earlier message that comes later
    assert mine.say(0.5) is not None


def test_a_robot_that_is_not_chosen_knows_who_was() -> None:
    mine = bid(cost=5.0)
    mine.hear(GrantMessage(7, False, {"r3": 9, "r4": 8}, ((1.0, "r3"), (2.0, "r4"))), 1, 1.3)
    assert (mine.phase, mine.outbid) == (BidPhase.OUT, ("r3", "r4"))
    while not mine.is_over:
        mine.say(mine.next)
    late = bid()
    late.tick(LIFE + 0.1)
    assert (late.phase, late.outbid) == (BidPhase.OUT, ())


def test_first_bids_are_spread() -> None:
    bids = [Bid(best(4), POLL, f"r{n}", 1.0, 0.0, LIFE, 0.5) for n in range(40)]
    at_once = [mine.say(0.0) for mine in bids]
    assert at_once.count(None) > 30
    assert all(mine.say(0.5) is not None for mine, said in zip(bids, at_once, strict=True) if said is None)
    assert all(mine.say(0.5 + SOON / 2) is None for mine in bids)


def test_of_two_robots_of_one_name_only_one_is_chosen() -> None:
    first, second = bid(now=0.0), bid(now=0.01)
    caller = Auctioneer(best(4), 7, 0.0, LIFE)
    for life, mine in ((5, first), (6, second)):
        said = mine.say(0.1)
        assert said is not None
        caller.hear("r1", life, said, 0.2)
    grants = caller.step(1.0)
    assert grants is not None
    assert first.hear(grants, 1, 1.1)
    assert not second.hear(grants, 1, 1.1)


def test_messages_come_back_as_they_went_and_others_are_none() -> None:
    said, grants = heard(3, 2.5), GrantMessage(7, True, {"r1": 3}, ((2.5, "r1"),))
    assert BidMessage.of(said.body()) == said
    assert GrantMessage.of(grants.body()) == grants
    for body in (
        {},
        {"bid": 3},
        {"bid": ["desk", 1, 7, 3, "bid", float("nan")]},
        {"bid": ["desk", 1, 7, -3, "bid", 1.0]},
        {"bid": ["desk", 1, 7, 3, "perhaps", 1.0]},
        {"bid": ["d" * 65, 1, 7, 3, "bid", 1.0]},
    ):
        assert BidMessage.of(body) is None
    said_of = grants.body()["grants"]
    assert isinstance(said_of, dict)
    for changed in (
        {"beats": []},
        {"granted": [3]},
        {"costs": ["1"]},
        {"open": 1},
        {"best": ["r"] * 65, "costs": [1.0] * 65},
    ):
        assert GrantMessage.of({"grants": {**said_of, **changed}}) is None
    assert GrantMessage.of({"grants": []}) is None


@pytest.mark.parametrize(
    "change",
    [
        {"auction": best(4)._replace(most=65)},
        {"auction": best(4)._replace(lease=inf)},
        {"places": {"r9": TakenPlace(1, 5.0)}},
        {"number": -1},
    ],
)
def test_an_auction_that_nobody_can_have_begun_is_not_taken_from_a_snapshot(change: dict[str, object]) -> None:
    caller = Auctioneer(best(4), 7, 0.0, LIFE)
    caller.hear("r1", 1, heard(1), 0.5)
    caller.step(1.0)
    caller.validate()
    with pytest.raises(MisuseError):
        msgspec.structs.replace(caller, **change).validate()


@pytest.mark.parametrize("change", [{"cost": inf}, {"beat": 2**62}, {"farewells": 5}])
def test_a_bid_that_no_robot_can_have_made_is_not_taken_from_a_snapshot(change: dict[str, object]) -> None:
    mine = bid()
    mine.validate()
    with pytest.raises(MisuseError):
        msgspec.structs.replace(mine, **change).validate()
