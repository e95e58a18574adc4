"""When a robot is catching up with standing commands of a time in which it was not there."""

from __future__ import annotations

from sleepcast.channel.sequencer import MAX_STREAMS, OLD, PATIENCE, QUIET, REPORTED_FOR, CatchingUp, ReportedStreams

NOW = 1_000.0
DESK = (b"desk", 1)
Streams = dict[tuple[bytes, int], int]


def hear(told: ReportedStreams, have: Streams, teller: str = "r1", now: float = NOW) -> None:
    told.hear(teller, have, now, lambda _: False)


def test_new_commands_are_nothing_to_catch_up_with() -> None:
    found = CatchingUp(told := ReportedStreams())
    hear(told, {DESK: 9})
    assert not found.lasts({}, NOW), "the robot may be the only one that has heard of it"
    found.take(NOW - OLD, NOW)
    assert not found.lasts({DESK: 8}, NOW)


def test_it_lasts_until_there_is_everything_that_others_have() -> None:
    found = CatchingUp(told := ReportedStreams())
    found.take(NOW - OLD - 1.0, NOW)
    assert found.lasts({DESK: 1}, NOW + QUIET - 0.1), "nobody has told yet how much there is"
    hear(told, {DESK: 3})
    hear(told, {DESK: 2})
    assert found.lasts({DESK: 2}, NOW + QUIET)
    assert not found.lasts({DESK: 3}, NOW + QUIET)
    assert found.lasts({DESK: 3}, NOW + QUIET - 0.1), "there may be more"


def test_what_never_comes_is_not_waited_for() -> None:
    found = CatchingUp(told := ReportedStreams())
    hear(told, {DESK: 2**60})
    found.take(0.0, NOW)
    assert found.lasts({DESK: 1}, NOW + PATIENCE - 0.1)
    found.take(1.0, NOW + PATIENCE - 0.1)
    assert found.lasts({DESK: 2}, NOW + PATIENCE), "it goes on as long as there is any progress"
    assert not found.lasts({DESK: 2}, NOW + 2 * PATIENCE)


def test_streams_that_are_told_of_are_bounded() -> None:
    lost: list[str] = []
    told = ReportedStreams(lambda teller, _: lost.append(teller))
    for number in range(MAX_STREAMS + 1):
        hear(told, {(b"key", number): 1})
    assert told.latest(NOW) == {(b"key", number): 1 for number in range(1, MAX_STREAMS + 1)}
    assert lost == ["r1"], "and somebody is told"


def test_what_one_key_tells_pushes_out_nothing_of_another() -> None:
    told = ReportedStreams()
    hear(told, {DESK: 3})
    for number in range(10 * MAX_STREAMS):
        hear(told, {(b"key", number): 1}, "liar")
    assert told.latest(NOW)[DESK] == 3


def test_what_nobody_repeats_is_forgotten() -> None:
    """A lie is not believed for ever, and the truth is told every minute."""
    told = ReportedStreams()
    hear(told, {DESK: 2**60}, "liar")
    hear(told, {DESK: 3}, now=NOW + REPORTED_FOR)
    assert told.latest(NOW + REPORTED_FOR)[DESK] == 2**60
    assert told.latest(NOW + REPORTED_FOR + 1.0)[DESK] == 3


def test_a_revoked_key_may_have_less_than_it_had() -> None:
    told = ReportedStreams()
    hear(told, {DESK: 9})
    told.hear("r1", {DESK: 2}, NOW, lambda name: name == DESK)
    assert told.latest(NOW) == {DESK: 2}
