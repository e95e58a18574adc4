"""A team of threads: what is shared is done once, by whoever comes, and errors come back to the one who asked."""

from __future__ import annotations

import gc
import threading
import time
from importlib.util import find_spec
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sleepcast.core.threads import Look, ThreadPool, borders

ENDS = range(101)
STRETCHES = list(pairwise(ENDS))
LONG = 60.0
"""s that a thread may take to come or to go on a busy machine."""


def _compiled() -> Look:
    from sleepcast.simulator.simd.kernels_wait import wait

    return wait


LOOKS = [None, _compiled()] if find_spec("numba") else [None]


@pytest.fixture(params=LOOKS, ids=["asleep", "looking out"][: len(LOOKS)])
def look(request: pytest.FixtureRequest) -> Look | None:
    """How threads wait, if they do not go to sleep at once."""
    found: Look | None = request.param
    return found


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_every_stretch_is_done_once(threads: int, look: Look | None) -> None:
    pool = ThreadPool(threads, look)
    for _ in range(50):
        done = pool.share(lambda first, last: (first, last), ENDS)
        assert sorted(done) == STRETCHES


@given(count=st.integers(0, 10_000), threads=st.integers(1, 64), grain=st.integers(1, 64))
def test_stretches_begin_at_multiples_and_are_no_shorter(count: int, threads: int, grain: int) -> None:
    ends = borders(count, threads, grain=grain)
    sizes = [last - first for first, last in pairwise(ends)]
    assert (ends[0], ends[-1]) == (0, count)
    assert all(end % grain == 0 for end in ends[:-1])
    assert all(size == 0 or size >= min(grain, count) for size in sizes)


def test_stretches_are_several_for_each_thread_and_small_at_the_end() -> None:
    sizes = [last - first for first, last in pairwise(borders(16_000, 2))]
    assert len(sizes) > 2
    assert sizes == sorted(sizes, reverse=True)
    assert 4 * sizes[-1] < 16_000 / 2


@pytest.mark.parametrize("ends", [[], [0], [3, 3]])
def test_nothing_to_do_is_done_at_once(ends: list[int], look: Look | None) -> None:
    assert ThreadPool(2, look).share(lambda first, last: first, ends) == []


def test_threads_work_at_the_same_time(look: Look | None) -> None:
    together = threading.Barrier(3)
    who = ThreadPool(3, look).share(lambda first, last: (together.wait(LONG), threading.get_ident())[1], ENDS[:4])
    assert len(set(who)) == 3


def test_one_who_is_done_waits_for_a_long_stretch_of_another(look: Look | None) -> None:
    """Much longer than it looks out without sleeping."""
    me, begun = threading.get_ident(), threading.Event()

    def work(first: int, last: int) -> int:
        if threading.get_ident() == me:
            assert begun.wait(LONG)
        else:
            begun.set()
            time.sleep(0.2)
        return first

    assert sorted(ThreadPool(2, look).share(work, ENDS[:3])) == [0, 1]


@pytest.mark.parametrize("pause", [0.0, 0.2])
def test_others_come_again_after_a_pause(pause: float, look: Look | None) -> None:
    pool, together = ThreadPool(2, look), threading.Barrier(2)
    for _ in range(5):
        assert len(set(pool.share(lambda first, last: together.wait(LONG), ENDS[:3]))) == 2
        time.sleep(pause)


@pytest.mark.parametrize("mine", [True, False])
def test_an_error_comes_back_when_all_else_is_done(mine: bool, look: Look | None) -> None:
    me, others, done = threading.get_ident(), threading.Barrier(2), []

    def work(first: int, last: int) -> None:
        others.wait(LONG)
        if (threading.get_ident() == me) == mine:
            raise MemoryError(f"no room for {first}")
        done.append(first)

    pool = ThreadPool(2, look)
    with pytest.raises(MemoryError, match="no room for"):
        pool.share(work, ENDS[:3])
    assert len(done) == 1
    assert sorted(pool.share(lambda first, last: first, ENDS)) == list(range(100))


def test_threads_end_with_their_team(look: Look | None) -> None:
    before = set(threading.enumerate())
    pool = ThreadPool(4, look)
    pool.share(lambda first, last: None, ENDS)
    helpers = set(threading.enumerate()) - before
    assert len(helpers) == 3
    del pool
    gc.collect()
    for helper in helpers:
        helper.join(LONG)
        assert not helper.is_alive()
