"""When a robot is catching up with standing commands of a time in which it was not there."""

from __future__ import annotations

from sleepcast.channel.sequencer import MAX_STREAMS, OLD, PATIENCE, QUIET, CatchingUp

NOW = 1_000.0
DESK = (b"desk", 1)


def test_new_commands_are_nothing_to_catch_up_with() -> None:
    found = CatchingUp()
    found.hear({DESK: 9})
    assert not found.lasts({}, NOW), "the robot may be the only one that has heard of it"
    found.take(NOW - OLD, NOW)
    assert not found.lasts({DESK: 8}, NOW)


def test_it_lasts_until_there_is_everything_that_others_have() -> None:
    found = CatchingUp()
    found.take(NOW - OLD - 1.0, NOW)
    assert found.lasts({DESK: 1}, NOW + QUIET - 0.1), "nobody has told yet how much there is"
    found.hear({DESK: 3})
    found.hear({DESK: 2})
    assert found.lasts({DESK: 2}, NOW + QUIET)
    assert not found.lasts({DESK: 3}, NOW + QUIET)
    assert found.lasts({DESK: 3}, NOW + QUIET - 0.1), "there may be more"


def test_what_never_comes_is_not_waited_for() -> None:
    found = CatchingUp()
    found.hear({DESK: 2**60})
    found.take(0.0, NOW)
    assert found.lasts({DESK: 1}, NOW + PATIENCE - 0.1)
    found.take(1.0, NOW + PATIENCE - 0.1)
    assert found.lasts({DESK: 2}, NOW + PATIENCE), "it goes on as long as there is any progress"
    assert not found.lasts({DESK: 2}, NOW + 2 * PATIENCE)


def test_streams_that_are_told_of_are_bounded() -> None:
    found = CatchingUp()
    found.take(0.0, NOW)
    for number in range(MAX_STREAMS + 1):
        found.hear({(b"key", number): 1})
    assert not found.lasts({(b"key", number): 1 for number in range(1, MAX_STREAMS + 1)}, NOW + QUIET)
