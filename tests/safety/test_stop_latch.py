"""Which STOPs hold a robot, and which are over: by numbers, in whatever order everything comes, and by no clock."""

from __future__ import annotations

from collections.abc import Iterable
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sleepcast.channel import Kind, Message
from sleepcast.mind.authority import FORGOTTEN, MAX_MARKS, Latch, StopMark, mark_of, restored


def stop(
    sender: str, number: int, epoch: int = 1, issued: float = 0.0, key: str | None = None, **body: object
) -> Message:
    return Message(sender, epoch, number, Kind.STOP, issued, body=body, key=f"key of {sender}" if key is None else key)


def release(sender: str, number: int, epoch: int = 1, issued: float = 0.0, **body: object) -> Message:
    return Message(sender, epoch, number, Kind.RELEASE, issued, body=body, key=f"key of {sender}")


def after(*messages: Message) -> Latch:
    """The latch of a robot that has heard these."""
    latch = Latch()
    for message in messages:
        latch = (latch.stop(message) if message.kind is Kind.STOP else latch.release(message)) or latch
    return latch


def named(marks: Iterable[StopMark]) -> list[list[object]]:
    return [mark.named for mark in marks]


@pytest.mark.parametrize("issued", [0.0, 1e9, -1e9])
def test_numbers_order_what_one_operator_says(issued: float) -> None:
    assert after(stop("anna", 1), release("anna", 2, issued=issued)).holding == ()
    assert after(release("anna", 2), stop("anna", 1, issued=issued)).holding == (), "the STOP was late"
    assert after(release("anna", 2), stop("anna", 3, issued=issued)).holding == (StopMark("anna", 1, 3, "key of anna"),)
    assert after(stop("anna", 3), release("anna", 2, issued=issued)).holding == (StopMark("anna", 1, 3, "key of anna"),)


def test_a_release_ends_of_others_what_it_names_and_no_more() -> None:
    held = after(stop("anna", 5), release("chief", 9))
    assert held.refusal() == "the STOP anna-1.5 holds: the RELEASE does not name it"
    assert after(stop("anna", 5), release("chief", 9, ends=[["anna", 1, 4]])).holding
    assert not after(stop("anna", 5), release("chief", 9, ends=[["anna", 1, 5]])).holding
    assert after(stop("anna", 5), stop("chief", 1), release("chief", 9)).holding == (
        StopMark("anna", 1, 5, "key of anna"),
    )


def test_a_name_ends_nothing_that_has_not_come_yet() -> None:
    """Whoever lies about what others sent keeps no later STOP of theirs out."""
    lie = release("chief", 9, ends=[["anna", 1, 2**62]])
    assert after(lie, stop("anna", 6)).holding
    assert after(stop("anna", 5), lie, stop("anna", 6)).holding


def test_what_is_sent_again_counts_as_the_first() -> None:
    again = stop("anna", 8, first="anna-1.5", age=3.0)
    assert mark_of(again) == StopMark("anna", 1, 5, "key of anna")
    assert not after(again, release("chief", 1, ends=[["anna", 1, 5]]), stop("anna", 9, first="anna-1.5")).holding
    assert not after(release("anna", 6), again).holding


@pytest.mark.parametrize("first", ["anna-1.99", "anna-2.1", "bert-1.1", "anna-1.-3", "anna-1.x", "anna-1.", 7, None])
def test_a_first_one_that_cannot_be_is_none(first: object) -> None:
    assert mark_of(stop("anna", 8, first=first)) == StopMark("anna", 1, 8, "key of anna")


def test_another_life_of_a_sender_is_another_sender() -> None:
    """Numbers of two lives do not compare, since a life may begin with any clock: in doubt a robot stands."""
    assert after(stop("anna", 3, epoch=9), release("anna", 1, epoch=10)).holding
    assert after(release("anna", 50, epoch=10), stop("anna", 1, epoch=9)).holding
    assert not after(stop("anna", 3, epoch=9), release("anna", 1, epoch=10, ends=[["anna", 9, 3]])).holding


@pytest.mark.parametrize("ends", [None, 7, "anna", [["anna"]], [["anna", 1]], [["anna", "1", 5]], [["x" * 99, 1, 5]]])
def test_names_that_say_nothing_end_nothing(ends: object) -> None:
    assert after(stop("anna", 5), release("chief", 9, ends=ends)).holding


def test_what_is_kept_is_bounded_and_comes_back() -> None:
    latch = after(*(stop(f"r{n}", 1) for n in range(MAX_MARKS + 9)), *(release(f"r{n}", 2) for n in range(200)))
    assert len(latch.ended) == MAX_MARKS - 1
    latch = after(stop("anna", 5), stop("chief", 2), release("chief", 3))
    assert restored(latch.written()) == latch
    assert restored({"stopped": 3.0, "holding": "nonsense"}) == Latch()


def invented(count: int, sender: str = "watch", first: int = 1) -> list[Message]:
    """STOPs of one key in as many epochs."""
    return [stop(sender, 1, epoch=epoch) for epoch in range(first, first + count)]


def test_stops_of_one_key_push_out_none_of_another() -> None:
    """Otherwise whoever may stop ends the STOPs of everybody else by a release of their own."""
    latch = after(stop("anna", 5), *invented(70), *(stop(f"r{n}", 1, key="key of r*") for n in range(200)))
    assert StopMark("anna", 1, 5, "key of anna") in latch.holding
    assert len(latch.holding) == MAX_MARKS
    assert {mark.owner for mark in latch.holding} == {"key of anna", "key of watch", "key of r*", FORGOTTEN}


def test_stops_without_room_hold_until_a_release_names_the_mark_that_counts_them() -> None:
    latch = after(*invented(70))
    forgotten = latch.holding[-1]
    assert (forgotten.sender, forgotten.epoch, len(latch.holding)) == (FORGOTTEN, 0, MAX_MARKS)
    rest = latch.release(release("anna", 1, ends=named(latch.holding[:-1])))
    assert rest is not None
    assert rest.holding == (forgotten,)
    assert rest.refusal() == (
        f"the STOP ?-0.{forgotten.number} (more STOPs than there is room for) holds: the RELEASE does not name it"
    )
    free = rest.release(release("anna", 2, ends=named([forgotten])))
    assert free is not None
    assert not free.holding


def test_a_release_that_was_sent_before_there_were_more_stops_without_room_does_not_end_those() -> None:
    before = after(*invented(70))
    release_of_it = release("anna", 1, ends=named(before.holding))
    latch = after(*invented(70), *invented(9, first=71))
    rest = latch.release(release_of_it)
    assert rest is not None
    assert FORGOTTEN in {mark.sender for mark in rest.holding}
    free = rest.release(release("anna", 2, ends=named(rest.holding)))
    assert free is not None
    assert not free.holding
    again = free
    for message in invented(66, "bert"):
        again = again.stop(message) or again
    (counted,) = (mark for mark in again.holding if mark.sender == FORGOTTEN)
    assert counted.number > 9, "its number never begins again"


@pytest.mark.parametrize("number", [0, 1, 2**40])
def test_whoever_is_named_like_that_mark_neither_ends_it_nor_hides_behind_it(number: int) -> None:
    held = after(*invented(70))
    assert FORGOTTEN in {mark.sender for mark in after(*invented(70), release(FORGOTTEN, number, epoch=0)).holding}
    alone = after(release("anna", 1, ends=named(held.holding)), stop(FORGOTTEN, number, epoch=0))
    assert [mark.sender for mark in alone.holding] == [FORGOTTEN]


def test_what_an_earlier_version_stored_is_read() -> None:
    """Its marks have no key."""
    stored = {"holding": [["anna", 1, 5], ["bert", 2, 7]], "ended": [["anna", 1, 4]]}
    assert restored(stored) == Latch((StopMark("anna", 1, 5), StopMark("bert", 2, 7)), (StopMark("anna", 1, 4),))
    with_keys = after(stop("anna", 5), *invented(70))
    assert restored(with_keys.written()) == with_keys


@given(st.integers(0, 2**32))
def test_whatever_a_relay_does_a_robot_moves_only_after_a_release_that_knew_of_all_its_stops(seed: int) -> None:
    """Operators stop and release by turns, each knowing of some of what the others have said; a relay delays, repeats
    and reorders all of it. Free is only who has heard, of every STOP that has come, a RELEASE that came after it was
    said, by its sender or by somebody who named it."""
    chance = Random(seed)
    said: list[Message] = []
    for number in range(1, chance.randint(2, 12)):
        who = chance.choice(("anna", "bert"))
        if chance.random() < 0.5:
            said.append(stop(who, number, issued=chance.uniform(-1e4, 1e4)))
        else:
            known = [mark_of(each).named for each in said if each.kind is Kind.STOP and chance.random() < 0.7]
            said.append(release(who, number, issued=chance.uniform(-1e4, 1e4), ends=known))
    heard = [chance.choice(said) for _ in range(chance.randint(1, 30))]
    ended = {
        mark
        for mark in (mark_of(each) for each in heard if each.kind is Kind.STOP)
        if any(
            each.kind is Kind.RELEASE
            and (
                (each.sender == mark.sender and each.sequence > mark.number)
                or any(StopMark(*named).covers(mark) for named in each.body["ends"])  # type: ignore[attr-defined]
            )
            for each in heard
        )
    }
    latch = after(*heard)
    stopped_by = {mark_of(each) for each in heard if each.kind is Kind.STOP}
    if not latch.holding:
        assert stopped_by <= ended
    assert {mark.sender for mark in latch.holding} <= {mark.sender for mark in stopped_by}
