"""Sixteen numbers at a time are what single numbers are, and packed all at once they are what one by one gives."""

from __future__ import annotations

import operator
from collections.abc import Callable

import numpy as np
import pytest

pytest.importorskip("numba")

from sleepcast.core.arrays import LINE, Arena
from sleepcast.simulator.simd import formulas, lanes, vectors
from sleepcast.simulator.simd.compiled import compiled, strict

ALL_AT_ONCE = pytest.param(True, marks=pytest.mark.skipif(not lanes.at_once(), reason="this processor cannot"))
SOME = np.array([0.5, -1.25, 3.0, 7.5, -2.0, 1e-3, 9.0, 4.0, 0.75, -6.0, 5.0, 2.5, -0.125, 8.0, 1.0, -3.5])
OTHERS = np.roll(SOME, 5)


@pytest.mark.parametrize("sort", [np.float32, np.float64])
@pytest.mark.parametrize("symbol", ["+", "-", "*", "/"])
def test_reals_are_calculated_with_number_by_number(symbol: str, sort: type[np.floating]) -> None:
    work = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}[symbol]

    def both(x, y, one, into):  # type: ignore[no-untyped-def]
        lanes.put(into, 0, work(lanes.at(x, 0), lanes.at(y, 0)))
        lanes.put(into, 16, work(lanes.at(x, 0), one))
        lanes.put(into, 32, work(one, lanes.at(y, 0)))

    x, y, one, into = SOME.astype(sort), OTHERS.astype(sort), sort(1.1), np.zeros(48, sort)
    compiled(both)(x, y, one, into)  # type: ignore[no-untyped-call]
    assert into.tobytes() == np.concatenate((work(x, y), work(x, one), work(one, y))).astype(sort).tobytes()


@pytest.mark.parametrize("sort", [np.float32, np.float64, np.int32])
@pytest.mark.parametrize("work", [operator.lt, operator.le, operator.gt, operator.ge, operator.eq, operator.ne])
def test_numbers_are_compared_one_by_one(work: Callable[..., object], sort: type[np.generic]) -> None:
    def compare(x, y, into):  # type: ignore[no-untyped-def]
        truths = work(lanes.at(x, 0), lanes.at(y, 0))
        lanes.put(into, 0, vectors.either(truths, vectors.every(np.int32(1)), np.int32(0)))
        return vectors.how_many(truths), vectors.any_of(truths), vectors.any_of(truths ^ truths)

    x, y, into = (SOME * 8).astype(sort), (OTHERS * 8).astype(sort), np.zeros(16, np.int32)
    y[3:6] = x[3:6]
    wanted = work(x, y)
    assert compiled(compare)(x, y, into) == (np.sum(wanted), np.any(wanted), False)  # type: ignore[no-untyped-call]
    assert into.astype(bool).tolist() == np.asarray(wanted).tolist()


def test_whole_numbers_are_calculated_with_one_by_one() -> None:
    def work(x, into):  # type: ignore[no-untyped-def]
        its, five = lanes.at(x, 0), np.int32(5)
        results = (its + five, its - five, its * five, its & five, its | five, its ^ five, its << five, its >> five)
        lanes.put(into, 0, results[0])
        lanes.put(into, 16, results[1])
        lanes.put(into, 32, results[2])
        lanes.put(into, 48, results[3])
        lanes.put(into, 64, results[4])
        lanes.put(into, 80, results[5])
        lanes.put(into, 96, results[6])
        lanes.put(into, 112, results[7])
        lanes.put(into, 128, vectors.places())

    x, into = (SOME * 1000).astype(np.int32), np.zeros(144, np.int32)
    compiled(work)(x, into)  # type: ignore[no-untyped-call]
    wanted = [x + 5, x - 5, x * 5, x & 5, x | 5, x ^ 5, x << 5, x >> 5, np.arange(16)]
    assert into.reshape(9, 16).tolist() == [each.tolist() for each in wanted]


def test_long_whole_numbers_are_calculated_with_without_signs() -> None:
    def work(x, y, into, real):  # type: ignore[no-untyped-def]
        its, other, seven = lanes.at(x, 0), lanes.at(y, 0), np.uint64(7)
        lanes.put(into, 0, its * other)
        lanes.put(into, 16, its + seven)
        lanes.put(into, 32, (its ^ other) - (its & seven))
        lanes.put(into, 48, (its >> seven) | (other << seven))
        lanes.put(real, 0, vectors.counted(its >> np.uint64(11)))
        lanes.put(real, 16, vectors.either(its < other, vectors.every(1.0), 0.0))

    x, y = np.random.default_rng(3).integers(0, 2**64, (2, 16), np.uint64)
    into, real = np.zeros(64, np.uint64), np.zeros(32)
    compiled(work)(x, y, into, real)  # type: ignore[no-untyped-call]
    seven = np.uint64(7)
    wanted = [x * y, x + seven, (x ^ y) - (x & seven), (x >> seven) | (y << seven)]
    assert into.reshape(4, 16).tolist() == [each.tolist() for each in wanted]
    assert real.reshape(2, 16).tolist() == [(x >> np.uint64(11)).astype(float).tolist(), (x < y).astype(float).tolist()]
    assert 0 < real[16:].sum() < 16


def test_formulas_for_arrays_hold_for_lanes() -> None:
    def work(x, single, into):  # type: ignore[no-untyped-def]
        a = lanes.at(x, 0)
        lanes.put(into, 0, formulas.either(a < 0.0, -a, np.floor(a)))
        lanes.put(into, 16, np.sqrt(np.abs(a)))
        lanes.put(into, 32, vectors.doubles(lanes.at(single, 0)))
        lanes.put(into, 48, vectors.either(a != a, vectors.every(1.0), 0.0))
        return vectors.singles(into[0] / 3.0), vectors.doubles(single[1]), vectors.counted(np.uint64(2**53))

    x, into = SOME.copy(), np.zeros(64)
    x[3] = np.nan
    single = x.astype(np.float32)
    alone = strict(work)(x, single, into)  # type: ignore[no-untyped-call]
    wanted = np.stack((np.where(x < 0.0, -x, np.floor(x)), np.sqrt(np.abs(x)), single.astype(float), np.isnan(x)))
    assert np.array_equal(into.reshape(4, 16), wanted, equal_nan=True)
    assert alone == (np.float32(into[0] / 3.0), float(single[1]), 2.0**53)


@pytest.mark.parametrize("sort", [np.float64, np.uint64])
def test_at_the_end_of_a_row_there_may_be_fewer_numbers(sort: type[np.generic]) -> None:
    def work(x, into, more, most):  # type: ignore[no-untyped-def]
        lanes.put_some(into, 2, lanes.some(x, 3, most), most)
        lanes.put(more, 0, lanes.some(x, 3, most))
        lanes.put_some(more, 16, lanes.some(x, 3, None), None)

    x, into, more = np.arange(1, 24).astype(sort), np.full(10, 99, sort), np.zeros(32, sort)
    compiled(work)(x, into, more, 5)  # type: ignore[no-untyped-call]
    assert into.tolist() == [99, 99, 4, 5, 6, 7, 8, 99, 99, 99]
    assert more.tolist() == [4, 5, 6, 7, 8, *([0] * 11), *range(4, 20)]


def test_rows_are_written_as_columns() -> None:
    def work(table, into):  # type: ignore[no-untyped-def]
        lanes.put_turned(table, 1, 16, 100, into, 5, 20)
        lanes.put_turned(table, 12, 0, 19, into, 500, 16)

    table, into = np.arange(20 * 32, dtype=np.float32).reshape(20, 32), np.zeros(800, np.float32)
    compiled(work)(table, into)  # type: ignore[no-untyped-call]
    for k in range(16):
        assert into[5 + 20 * k : 21 + 20 * k].tolist() == table[1:17, 16 + k].tolist()
        assert into[500 + 16 * k : 516 + 16 * k].tolist() == [*table[12:20, k], *([table[19, k]] * 8)]


def test_functions_of_numbers_work_one_by_one() -> None:
    def work(x, y, whole, single, double, short):  # type: ignore[no-untyped-def]
        a, b = lanes.at(x, 0), lanes.at(y, 0)
        lanes.put(double, 0, vectors.root_of(vectors.size_of(a)))
        lanes.put(double, 16, vectors.minus(a))
        lanes.put(double, 32, vectors.least_of(a, b))
        lanes.put(double, 48, vectors.most_of(a, 1.5))
        lanes.put(double, 64, vectors.either(a < b, a, 7.0))
        lanes.put(double, 80, vectors.like(0.0, a))
        lanes.put(single, 0, vectors.singles(a / 3.0))
        lanes.put(single, 16, vectors.like(np.float32(0), a / 3.0))
        lanes.put(single, 32, vectors.reals(lanes.at(whole, 0)))
        lanes.put(short, 0, vectors.shorts(a * 10.0))

    whole = np.arange(16, dtype=np.int32) * 123_456_789
    double, single, short = np.zeros(96), np.zeros(48, np.float32), np.zeros(16, np.int32)
    compiled(work)(SOME, OTHERS, whole, single, double, short)  # type: ignore[no-untyped-call]
    x, y = SOME, OTHERS
    wanted = [np.sqrt(abs(x)), -x, np.minimum(x, y), np.maximum(x, 1.5), np.where(x < y, x, 7.0), x]
    assert double.reshape(6, 16).tolist() == [each.tolist() for each in wanted]
    assert short.tolist() == (x * 10.0).astype(np.int32).tolist()
    third = (x / 3.0).astype(np.float32)
    assert single.reshape(3, 16).tolist() == [each.tolist() for each in (third, third, whole.astype(np.float32))]


def test_pairs_are_kept_and_seen_by_the_lanes_that_are_meant() -> None:
    def work(x, y, bits, into, seen):  # type: ignore[no-untyped-def]
        lanes.put_pairs(into, 2, lanes.at(x, 0), lanes.at(y, 0))
        lanes.put(seen, 0, vectors.either(vectors.truths_of(bits), lanes.pair_at(into, 6), np.float32(9)))

    x, y = SOME.astype(np.float32), OTHERS.astype(np.float32)
    into, seen = np.zeros(40, np.float32), np.zeros(16, np.float32)
    compiled(work)(x, y, np.int32(0x5000A), into, seen)  # type: ignore[no-untyped-call]
    assert into[2:34].reshape(16, 2).tolist() == np.stack((x, y), axis=1).tolist()
    assert into[:2].tolist() == [0.0] * 2
    assert into[34:].tolist() == [0.0] * 6
    assert seen.tolist() == [y[2] if lane in (1, 3) else 9.0 for lane in range(16)]


@pytest.mark.parametrize("whole", [False, ALL_AT_ONCE])
def test_memory_is_read_and_written_by_its_address(whole: bool) -> None:
    pack = lanes.packing(whole, by_address=True)

    def all_of(places, chosen, into, doubled):  # type: ignore[no-untyped-def]
        numbers = lanes.wholes_at(chosen, 1)
        some = lanes.reals_at(places, 2)
        lanes.put_reals(doubled, 3, some + some)
        pack(into, 2, numbers, some > 4.0)

    places, chosen = np.arange(18.0) % 7.0, np.arange(17, dtype=np.int32)
    into, doubled = np.zeros(40, np.int32), np.zeros(19)
    compiled(all_of)(*(each.ctypes.data for each in (places, chosen, into, doubled)))  # type: ignore[no-untyped-call]
    found = (chosen[1:])[places[2:] > 4.0]
    assert into[2 : 2 + len(found)].tolist() == found.tolist()
    assert into[:2].tolist() == [0, 0]
    assert doubled.tolist() == [0.0, 0.0, 0.0, *(2.0 * places[2:])]


@pytest.mark.parametrize("whole", [False, ALL_AT_ONCE])
@pytest.mark.parametrize("sort", [np.float32, np.int32])
def test_true_ones_are_packed_one_after_the_other(whole: bool, sort: type[np.generic]) -> None:
    pack = lanes.packing(whole)

    def all_of(values, into):  # type: ignore[no-untyped-def]
        n = np.uint64(0)
        for first in range(0, values.shape[0], 16):
            some = lanes.at(values, first)
            kept = some > values[0]
            pack(into, n, some, kept)
            n += vectors.how_many(kept)
        return n

    values = np.random.default_rng(2).integers(0, 1_000, 160).astype(sort)
    values[0] = 700
    into = np.zeros(200, sort)
    count = compiled(all_of)(values, into)  # type: ignore[no-untyped-call]
    assert 30 < count < 70
    assert into[:count].tolist() == values[values > 700].tolist()


@pytest.mark.parametrize(("sort", "many"), [(np.float32, 16), (np.float64, 16)])
def test_a_line_of_the_caches_is_written_where_it_belongs(sort: type[np.generic], many: int) -> None:
    def write(values, array, row, column):  # type: ignore[no-untyped-def]
        lanes.put_by(array, row, column, lanes.at(values, 3))
        lanes.all_passed()

    arena = Arena()
    arena.begin()
    array = arena.take(sort, 3, 4 * many)
    array[:] = np.full(array.shape, 7, sort)
    values = np.arange(40).astype(sort)
    strict(write)(values, array, 1, 2 * many)  # type: ignore[operator]
    assert array[1, 2 * many : 3 * many].tolist() == values[3 : 3 + many].tolist()
    assert (array == 7).sum() == 12 * many - many + (values[3 : 3 + many] == 7).sum()


def test_lanes_are_written_past_the_caches_where_they_belong() -> None:
    def write(values, array, row, column):  # type: ignore[no-untyped-def]
        lanes.put_by(array, row, column, lanes.at(values, 0))
        lanes.all_passed()

    arena = Arena()
    arena.begin()
    array = arena.take(np.float64, 3, 32)
    array[:] = 99.0
    strict(write)(SOME, array, 1, 8)  # type: ignore[no-untyped-call]
    assert array[1, 8:24].tolist() == SOME.tolist()
    assert (array == 99.0).sum() == 96 - 16


def test_scratch_memory_begins_with_a_line_of_the_caches_also_where_there_is_none_left() -> None:
    arena = Arena()
    arena.begin(1_000)
    for _ in range(20):
        assert arena.take(np.float32, 50).ctypes.data % LINE == 0
