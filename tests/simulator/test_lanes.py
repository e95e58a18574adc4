"""Sixteen at a time and one by one: the same comes out."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("numba")

from sleepcast.simulator import lanes
from sleepcast.simulator.compiled import compiled, strict
from sleepcast.simulator.scratch import LINE, Scratch

pytestmark = pytest.mark.skipif(not lanes.at_once(), reason="this processor does all one by one anyway")


def packs(pack: object) -> object:
    def all_of(flags, into, n):  # type: ignore[no-untyped-def]
        for first in range(0, flags.shape[0], 16):
            n = pack(flags[first : first + 16], np.uint64(first), into, n)  # type: ignore[operator]
        return n

    return strict(all_of)


def keeps(keep: object) -> object:
    def all_of(x, y, last, own, turn, limits, ahead, aside, number):  # type: ignore[no-untyped-def]
        n = np.uint64(0)
        for first in range(np.uint64(0), last, np.uint64(16)):
            n = keep(  # type: ignore[operator]
                *(x, y, first, last, own, x[own], y[own], turn[0], turn[1], limits[0], limits[1], limits[2]),
                *(np.int32(5000), ahead, aside, number, n),
            )
        return n

    return compiled(all_of)


def test_marked_numbers_are_packed_the_same_with_and_without_vectors() -> None:
    flags = np.where(np.random.default_rng(2).random(160) < 0.3, 0.0, 1e9).astype(np.float32)
    wanted = np.flatnonzero(flags == 0.0)
    for pack in (lanes._pack_at_once, lanes._pack_one_by_one):
        into = np.zeros(200, np.int32)
        count = packs(pack)(flags, into, np.uint64(0))  # type: ignore[operator]
        assert into[:count].tolist() == wanted.tolist()


@pytest.mark.parametrize(("behind", "least"), [(-1e9, 20), (-0.5, 10)], ids=["all round", "not behind"])
def test_points_in_reach_are_kept_the_same_with_and_without_vectors(behind: float, least: int) -> None:
    """Among them one where positions begin anew; neither the last points nor the one who looks are kept."""
    chance = np.random.default_rng(3)
    far = chance.integers(-(2**27), 2**27, (2, 176))
    near = (far + 2**31 - 2**20).astype(np.int32)
    own, last, unit, reach = 70, 150, 2.0**-24, 5.0
    turn = (np.float32(0.6 * unit), np.float32(0.8 * unit))
    apart = (far - far[:, [own]]) * unit
    forward = apart[0] * 0.6 + apart[1] * 0.8 + 0.25 * abs(apart[1] * 0.6 - apart[0] * 0.8)
    wanted = np.flatnonzero(((apart**2).sum(axis=0) < reach**2) & (forward > behind))
    wanted = wanted[(wanted < last) & (wanted != own)]
    assert least < len(wanted) < 120
    kept = []
    for keep in (lanes._keep_at_once, lanes._keep_one_by_one):
        ahead, aside, number = np.zeros(200, np.float32), np.zeros(200, np.float32), np.zeros(200, np.int32)
        limits = np.float32((reach / unit) ** 2), np.float32(0.25), np.float32(behind)
        count = keeps(keep)(*near, np.uint64(last), np.uint64(own), turn, limits, ahead, aside, number)  # type: ignore[operator]
        assert (number[:count] - 5000).tolist() == wanted.tolist()
        x, y = apart[:, wanted]
        assert ahead[:count] == pytest.approx(x * 0.6 + y * 0.8, abs=1e-5)
        assert aside[:count] == pytest.approx(y * 0.6 - x * 0.8, abs=1e-5)
        kept.append((ahead[:count].tobytes(), aside[:count].tobytes()))
    assert kept[0] == kept[1]


@pytest.mark.parametrize(("sort", "many"), [(np.float32, 16), (np.float64, 8)])
def test_a_line_of_the_caches_is_written_where_it_belongs(sort: type[np.generic], many: int) -> None:
    def write(values, array, row, column):  # type: ignore[no-untyped-def]
        lanes.pass_by(values, 3, array, row, column)
        lanes.all_passed()

    scratch = Scratch()
    scratch.begin()
    array = scratch.take(sort, 3, 4 * many)
    array[:] = np.full(array.shape, 7, sort)
    values = np.arange(40).astype(sort)
    strict(write)(values, array, 1, 2 * many)  # type: ignore[operator]
    assert array[1, 2 * many : 3 * many].tolist() == values[3 : 3 + many].tolist()
    assert (array == 7).sum() == 12 * many - many + (values[3 : 3 + many] == 7).sum()


def test_scratch_memory_begins_with_a_line_of_the_caches_also_where_there_is_none_left() -> None:
    scratch = Scratch()
    scratch.begin(1_000)
    for _ in range(20):
        assert scratch.take(np.float32, 50).ctypes.data % LINE == 0
