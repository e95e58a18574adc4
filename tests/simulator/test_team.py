"""A team of threads: what is shared is done once, by whoever comes, and errors come back to the one who asked."""

from __future__ import annotations

import gc
import threading
import time

import pytest

pytest.importorskip("numba")

from sleepcast.simulator.team import Team

STRETCHES = [(number, number + 1) for number in range(100)]
LONG = 10.0
"""s that a thread may take to come or to go on a busy machine."""


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_every_stretch_is_done_once(threads: int) -> None:
    team = Team(threads)
    for _ in range(50):
        done = team.share(lambda first, last: (first, last), STRETCHES)
        assert sorted(done) == STRETCHES


def test_nothing_to_do_is_done_at_once() -> None:
    assert Team(2).share(lambda first, last: first, []) == []


def test_threads_work_at_the_same_time() -> None:
    together = threading.Barrier(3)
    who = Team(3).share(lambda first, last: (together.wait(LONG), threading.get_ident())[1], STRETCHES[:3])
    assert len(set(who)) == 3


def test_one_who_is_done_waits_for_a_long_stretch_of_another() -> None:
    """Much longer than it looks out without sleeping."""
    me, begun = threading.get_ident(), threading.Event()

    def work(first: int, last: int) -> int:
        if threading.get_ident() == me:
            assert begun.wait(LONG)
        else:
            begun.set()
            time.sleep(0.2)
        return first

    assert sorted(Team(2).share(work, STRETCHES[:2])) == [0, 1]


@pytest.mark.parametrize("mine", [True, False])
def test_an_error_comes_back_when_all_else_is_done(mine: bool) -> None:
    me, others, done = threading.get_ident(), threading.Barrier(2), []

    def work(first: int, last: int) -> None:
        others.wait(LONG)
        if (threading.get_ident() == me) == mine:
            raise MemoryError(f"no room for {first}")
        done.append(first)

    team = Team(2)
    with pytest.raises(MemoryError, match="no room for"):
        team.share(work, STRETCHES[:2])
    assert len(done) == 1
    assert sorted(team.share(lambda first, last: first, STRETCHES)) == list(range(100))


def test_threads_end_with_their_team() -> None:
    before = set(threading.enumerate())
    team = Team(4)
    team.share(lambda first, last: None, STRETCHES)
    helpers = set(threading.enumerate()) - before
    assert len(helpers) == 3
    del team
    gc.collect()
    for helper in helpers:
        helper.join(LONG)
        assert not helper.is_alive()
