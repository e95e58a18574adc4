"""The line of sight, beside a reference in plain Python that knows neither cells nor rounding."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest

from machines import ALL
from simulator.world.sight_reference import blocked, count, exactly
from sleepcast.simulator.engine import choose
from sleepcast.simulator.world.sight import SightLines, hidden, joined, stops, unrolled
from sleepcast.simulator.world.world import Circle, Polygon, Wall, World, boundary, rooms

SIDE = 8.0
"""Of the worlds of this file, m."""
CASES = 100_000
LINES = 100
"""Lines that are looked at in each world."""


def lines_of(world: World, around: tuple[float, float] = (inf, inf)) -> SightLines:
    made = SightLines((SIDE, SIDE), around)
    made.keep_up(world)
    return made


def sees(world: World, line: tuple[float, float, float, float]) -> bool:
    """Whether the end of a line is seen from its beginning, and so from its end, on all machines."""
    there, back = np.array(line)[:, None], np.array(line)[[2, 3, 0, 1], None]
    lines = lines_of(world)
    found = {bool(machine.hidden(lines, *ends)[0]) for machine in ALL for ends in (there, back)}
    assert len(found) == 1
    assert found == {blocked(line, exactly(world.solids.tolist()))}
    return not found.pop()


def solids_by_chance(drawn: np.random.Generator, whole: bool) -> np.ndarray:
    """Lines and discs; with whole numbers many of them touch each other and the lines that are looked at."""
    rows = drawn.uniform(0.0, SIDE, (8, 5))
    rows[:, 2:4] = rows[:, :2] + drawn.normal(0.0, 1.5, (8, 2))
    if whole:
        rows = np.round(rows)
    rows[6:, 2:4] = rows[6:, :2]
    rows[:, 4] = 0.0
    rows[6:, 4] = (1.0, 2.0) if whole else (0.4, 1.3)
    flat = (rows[:, 4] == 0.0) & (rows[:, :2] == rows[:, 2:4]).all(axis=1)
    return rows[~flat]


class TestReference:
    @pytest.mark.parametrize("whole", [True, False], ids=["whole numbers", "any numbers"])
    @pytest.mark.parametrize("around", [(inf, inf), (SIDE, SIDE)], ids=["plain", "torus"])
    def test_it_disagrees_nowhere(self, around: tuple[float, float], whole: bool) -> None:
        drawn = np.random.default_rng([whole, around[0] < inf])
        seen = wrong = 0
        for _ in range(CASES // 4 // LINES):
            solids, lines = solids_by_chance(drawn, whole), SightLines((SIDE, SIDE), around)
            lines.put(solids)
            ends = drawn.uniform(0.0, SIDE, (4, LINES))
            if whole:
                ends = np.floor(ends)
            ends[2:] = [unrolled(*ends[axis::2], around[axis]) for axis in (0, 1)]
            whole_ones = exactly(solids.tolist(), around)
            expected = [blocked(line, whole_ones) for line in ends.T.tolist()]
            for machine in ALL:
                wrong += int(np.count_nonzero(machine.hidden(lines, *ends) != expected))
            seen += expected.count(False)
        assert not wrong
        assert 0.1 * CASES / 4 < seen < 0.9 * CASES / 4, "neither all nor nothing is seen"

    @pytest.mark.parametrize("whole", [True, False], ids=["whole numbers", "any numbers"])
    @pytest.mark.parametrize("around", [(inf, inf), (SIDE, SIDE)], ids=["plain", "torus"])
    def test_crossings_are_counted_once_each(self, around: tuple[float, float], whole: bool) -> None:
        drawn = np.random.default_rng(5)
        most = 0
        for _ in range(20):
            solids, lines = solids_by_chance(drawn, whole), SightLines((SIDE, SIDE), around)
            lines.put(solids)
            ends = drawn.uniform(0.0, SIDE, (4, LINES))
            if whole:
                ends = np.floor(ends)
            ends[2:] = [unrolled(*ends[axis::2], around[axis]) for axis in (0, 1)]
            expected = [count(line, exactly(solids.tolist(), around)) for line in ends.T.tolist()]
            for machine in ALL:
                assert machine.crossings(lines, *ends).tolist() == expected
            assert (hidden(lines, *ends) == (np.array(expected) > 0)).all()
            most = max(most, *expected)
        assert most > 3

    def test_more_lines_than_one_thread_counts(self) -> None:
        drawn = np.random.default_rng(9)
        lines, ends = SightLines((SIDE, SIDE)), drawn.uniform(0.0, SIDE, (4, 5_000))
        for machine in ALL:
            assert not machine.crossings(lines, *ends).any(), "nothing is there"
        solids = np.concatenate([solids_by_chance(drawn, whole=False) for _ in range(20)])
        lines.put(solids)
        names = [machine.name for machine in ALL]
        first, *others = (choose(name, threads).crossings(lines, *ends) for name in names for threads in (1, 3))
        some = slice(0, 5_000, 250)
        assert first[some].tolist() == [count(line, exactly(solids.tolist())) for line in ends.T[some].tolist()]
        for other in others:
            assert np.array_equal(first, other)


class TestStops:
    @pytest.mark.parametrize("around", [(inf, inf), (SIDE, SIDE)], ids=["plain", "torus"])
    def test_a_line_is_free_before_its_stop_and_blocked_there(self, around: tuple[float, float]) -> None:
        drawn, blocked_ones = np.random.default_rng(7), 0
        for _ in range(60):
            solids, lines = solids_by_chance(drawn, whole=False), SightLines((SIDE, SIDE), around)
            lines.put(solids)
            x, y, to_x, to_y = drawn.uniform(0.0, SIDE, (4, LINES))
            to_x, to_y = unrolled(x, to_x, around[0]), unrolled(y, to_y, around[1])
            shares = stops(lines, x, y, to_x, to_y)
            stopped = np.isfinite(shares)
            assert (stopped == hidden(lines, x, y, to_x, to_y)).all()
            for part, wanted in ((1.0 - 1e-6, False), (1.0 + 1e-9, True)):
                share = np.where(stopped, np.minimum(shares * part, 1.0), 0.0)
                found = hidden(lines, x, y, x + share * (to_x - x), y + share * (to_y - y))
                assert (found == wanted)[stopped & (shares > 0.0)].all()
            blocked_ones += np.count_nonzero(stopped & (shares > 0.0))
        assert blocked_ones > 1000

    @pytest.mark.parametrize(
        ("line", "share"),
        [
            ((0, 2, 5, 2), 0.2),  # along the wall: its nearer end
            ((5, 2, 0, 2), 0.4),
            ((2, 2, 6, 2), 0.0),  # from within it
            ((2, 0, 2, 4), 0.5),
            ((2, 2, 2, 2), 0.0),  # without length
            ((0, 6, 8, 6), 0.375),  # the disc
            ((4, 6, 8, 6), 0.0),  # out of the disc
            ((0, 0, 1, 0), inf),
        ],
    )
    def test_where_it_is(self, line: tuple[float, float, float, float], share: float) -> None:
        lines = lines_of(World([Wall(((1.0, 2.0), (3.0, 2.0))), Circle(4.0, 6.0, 1.0)]))
        assert stops(lines, *np.array(line, np.float64)[:, None])[0] == share

    def test_what_may_be_passed_does_not_stop(self) -> None:
        lines = SightLines((SIDE, SIDE))
        lines.put(np.array([(1.0, 2.0, 1.0, 2.0, 0.5), (4.0, 2.0, 4.0, 2.0, 0.5)]))
        ends = [np.array([each]) for each in (1.0, 2.0, 7.0, 2.0)]
        assert stops(lines, *ends)[0] == 0.0
        assert stops(lines, *ends, passing=[np.array([0])])[0] == pytest.approx(2.5 / 6.0)
        assert stops(lines, *ends, passing=[np.array([0]), np.array([1])])[0] == inf


class TestTies:
    """In whole numbers, where nothing is rounded."""

    @pytest.mark.parametrize(
        ("line", "seen"),
        [
            ((2, 1, 2, 3), False),  # across
            ((2, 1, 2, 2), False),  # up to it
            ((1, 1, 1, 3), False),  # through an end
            ((0, 1, 2, 3), False),  # through an end, aslant
            ((0, 2, 4, 2), False),  # along it
            ((0, 2, 1, 2), False),  # up to its end
            ((4, 2, 6, 2), True),  # beyond it, on the same line
            ((4, 1, 4, 3), True),  # beside it
            ((1, 3, 3, 3), True),  # parallel to it
            ((2, 2, 2, 2), False),  # both on it, at one place
            ((5, 5, 5, 5), True),  # both at one place
        ],
    )
    def test_a_wall(self, line: tuple[float, float, float, float], seen: bool) -> None:
        assert sees(World([Wall(((1.0, 2.0), (3.0, 2.0)))]), line) == seen

    @pytest.mark.parametrize(
        ("line", "seen"),
        [
            ((0, 0, 6, 6), False),  # through two corners
            ((1, 3, 3, 1), False),  # touches one from outside
            ((0, 4, 4, 4), False),  # along a side
            ((0, 5, 6, 5), True),
            ((3, 3, 3, 3), True),  # inside
            ((3, 3, 3, 6), False),  # out of it
        ],
    )
    def test_a_polygon(self, line: tuple[float, float, float, float], seen: bool) -> None:
        assert sees(World([Polygon(((2.0, 2.0), (4.0, 2.0), (4.0, 4.0), (2.0, 4.0)))]), line) == seen

    @pytest.mark.parametrize(
        ("line", "seen"),
        [
            ((1, 5, 7, 5), False),  # touches the rim
            ((1, 6, 7, 6), True),
            ((4, 4, 4, 4), False),  # inside
            ((4, 5, 4, 6), False),  # from the rim on
            ((0, 5, 3, 5), True),  # ends before it
            ((0, 5, 4, 5), False),  # ends on it
        ],
    )
    def test_a_disc(self, line: tuple[float, float, float, float], seen: bool) -> None:
        assert sees(World([Circle(4.0, 4.0, 1.0)]), line) == seen

    def test_a_door(self) -> None:
        world = World(rooms(SIDE, SIDE, 4.0, 2.0))  # the doors are from 1 to 3 and from 5 to 7
        assert sees(world, (2, 2, 6, 2))
        assert not sees(world, (2, 2, 6, 6)), "through the crossing"
        assert not sees(world, (3, 1, 5, 1)), "along the end of a wall"
        assert sees(world, (3, 1, 5, 3)), "aslant through the middle of a door"

    def test_the_edge_of_a_world(self) -> None:
        assert not sees(World([boundary(SIDE, SIDE)]), (1, 1, -1, 1))
        assert not sees(World([boundary(SIDE, SIDE)]), (0, 1, 4, 1)), "who stands on it sees nothing"
        assert sees(World(), (1, 1, -1, 1))


def test_what_moves_hides_where_it_is() -> None:
    world = World([Wall(((2.0, 0.0), (2.0, 2.0)))])
    assert not sees(world, (1, 1, 3, 1))
    world.move(1, 0.0, 4.0)
    assert sees(world, (1, 1, 3, 1))
    assert not sees(world, (1, 5, 3, 5))
    world.remove(1)
    assert sees(world, (1, 5, 3, 5))


def test_lines_are_made_anew_only_when_something_has_changed() -> None:
    world = World([Wall(((2.0, 0.0), (2.0, 2.0)))])
    lines = lines_of(world)
    version = lines.version
    lines.keep_up(world)
    assert lines.version == version
    world.clear()
    lines.keep_up(world)
    assert lines.version > version
    assert not lines


def test_pieces_of_one_line_are_joined_and_hide_the_same() -> None:
    drawn = np.random.default_rng(4)
    for _ in range(30):
        pieces = np.zeros((24, 5))
        pieces[:, :2] = drawn.integers(0, 8, (24, 2))
        pieces[:, 2:4] = pieces[:, :2]
        pieces[np.arange(24), np.where(drawn.random(24) < 0.5, 2, 3)] += drawn.choice([-2.0, -1.0, 1.0, 2.0], 24)
        pieces[20:, 4] = 1.0
        pieces[18:20, 2:4] += 1.0
        fewer = joined(pieces)
        assert len(fewer) < len(pieces)
        assert np.array_equal(joined(fewer)[:, 4].sum(), 4.0)
        assert len(joined(fewer)) == len(fewer)
        ends = drawn.integers(0, 9, (4, 300)).astype(float)
        found = []
        for solids in (pieces, fewer):
            lines = SightLines((SIDE, SIDE))
            lines.put(solids)
            found.append(hidden(lines, *ends))
        assert np.array_equal(*found)
    assert joined(np.array([[0.0, 0.0, 2.0, 0.0, 0.0], [4.0, 0.0, 2.0, 0.0, 0.0]])).tolist() == [[0, 0, 4, 0, 0]]


def test_one_cell_lists_all_that_is_within_reach() -> None:
    drawn = np.random.default_rng(6)
    solids, lines = solids_by_chance(drawn, whole=False), SightLines((SIDE, SIDE))
    lines.put(solids)
    for reach in (0.3, 1.0, 2.0):
        near = lines.around(reach)
        assert near
        x, y = drawn.uniform(0.0, SIDE, (2, 200))
        way = drawn.uniform(0.0, 2.0 * np.pi, 200)
        to_x, to_y = x + reach * np.cos(way), y + reach * np.sin(way)
        cells = near.grid.cells_of(x, y)
        for line, cell, is_hidden in zip(
            np.stack((x, y, to_x, to_y), axis=1).tolist(), cells, hidden(lines, x, y, to_x, to_y), strict=True
        ):
            listed = near.listed.items[near.listed.start[cell] : near.listed.start[cell + 1]]
            assert blocked(line, exactly(solids[listed].tolist())) == is_hidden


def test_what_lies_outside_of_the_world_hides_as_well() -> None:
    world = World([Wall(((-2.0, 3.0), (-2.0, 20.0))), Circle(12.0, 12.0, 1.0)])
    assert not sees(world, (-4, 9, 4, 9))
    assert sees(world, (-4, 2, 4, 2))
    assert not sees(world, (9, 9, 14, 14))
    assert not sees(world, (-4, 18, 20, 18))


def test_long_lines_over_many_cells() -> None:
    drawn = np.random.default_rng(2)
    solids = np.zeros((2_000, 5))
    solids[:, :2] = drawn.uniform(0.0, SIDE, (2_000, 2))
    solids[:, 2:4] = solids[:, :2] + drawn.normal(0.0, 0.01, (2_000, 2))
    lines = SightLines((SIDE, SIDE))
    lines.put(solids)
    assert lines.grid.columns > 30
    ends = drawn.uniform(0.0, SIDE, (4, 40))
    whole_ones = exactly(solids.tolist())
    expected = [count(line, whole_ones) for line in ends.T.tolist()]
    blocked_ones = [number > 0 for number in expected]
    assert 5 < sum(blocked_ones) < 38
    for machine in ALL:
        assert machine.hidden(lines, *ends).tolist() == blocked_ones
        assert machine.crossings(lines, *ends).tolist() == expected
