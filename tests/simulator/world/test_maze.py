"""Mazes: one way from each cell to every other, loops as wished, and the same maze for the same seed."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest

from sleepcast.core.errors import MisuseError
from sleepcast.simulator import Changes, SettingsError, Simulator, Wall, load
from sleepcast.simulator.world.maze import MAX_CELLS, maze
from small_worlds import IN_MAZE, SCOUTS, write

Cell = tuple[int, int]


def passages(walls: list[Wall], across: int, up: int, cell: float) -> set[tuple[Cell, Cell]]:
    """The neighbouring cells between which no wall stands, found by looking at each wall piece by piece."""
    standing = set()
    for wall in walls:
        (x0, y0), (x1, y1) = ((round(x / cell, 6), round(y / cell, 6)) for x, y in wall.points)
        assert x0 == x1 or y0 == y1
        if x0 == x1:
            standing |= {((int(x0) - 1, y), (int(x0), y)) for y in range(int(y0), int(y1))}
        else:
            standing |= {((x, int(y0) - 1), (x, int(y0))) for x in range(int(x0), int(x1))}
    beside = {((x, y), (x + 1, y)) for x in range(across - 1) for y in range(up)}
    above = {((x, y), (x, y + 1)) for x in range(across) for y in range(up - 1)}
    assert standing <= beside | above
    return (beside | above) - standing


def reached(ways: set[tuple[Cell, Cell]]) -> int:
    """How many cells can be reached from the first one."""
    seen, waiting = {(0, 0)}, [(0, 0)]
    while waiting:
        x, y = waiting.pop()
        for there in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
            if there not in seen and (((x, y), there) in ways or (there, (x, y)) in ways):
                seen.add(there)
                waiting.append(there)
    return len(seen)


@pytest.mark.parametrize(("across", "up"), [(1, 1), (1, 9), (9, 1), (2, 2), (17, 23), (40, 31)])
def test_a_perfect_maze_has_one_way_from_each_cell_to_every_other(across: int, up: int) -> None:
    ways = passages(maze(across * 2.5, up * 2.5, 2.5, 0.0, 5), across, up, 2.5)
    assert reached(ways) == across * up
    assert len(ways) == across * up - 1  # with one way less a cell would be shut in, with one more there is a loop


def test_loops_leave_out_a_share_of_the_walls() -> None:
    cells = 100
    perfect = passages(maze(100.0, 100.0, 1.0, 0.0, 5), cells, cells, 1.0)
    looped = passages(maze(100.0, 100.0, 1.0, 0.2, 5), cells, cells, 1.0)
    assert perfect < looped
    closed = 2 * cells * (cells - 1) - len(perfect)
    assert (len(looped) - len(perfect)) / closed == pytest.approx(0.2, abs=0.02)
    assert maze(100.0, 100.0, 1.0, 1.0, 5) == []


def test_the_seed_chooses_the_maze() -> None:
    first, again, other = (maze(30.0, 30.0, 2.0, 0.1, seed) for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_walls_in_one_line_are_one_wall_and_reach_the_edge_exactly() -> None:
    walls = maze(10.0, 7.0, 0.7, 0.0, 3)
    ends = {point for wall in walls for point in wall.points}
    assert {0.0, 10.0} <= {x for x, _ in ends}
    assert {0.0, 7.0} <= {y for _, y in ends}
    level = sorted((wall.points[0][1], wall.points[0][0], wall.points[1][0]) for wall in walls
                   if wall.points[0][1] == wall.points[1][1])  # fmt: skip
    assert all(a[0] != b[0] or a[2] < b[1] for a, b in pairwise(level))


def test_too_many_cells_are_refused() -> None:
    with pytest.raises(MisuseError, match=f"a maze of 2000 by 1000 cells; at most {MAX_CELLS}"):
        maze(2000.0, 1000.0, 1.0, 0.0, 1)


class TestInScenarios:
    def test_scouts_move_in_a_maze_that_grows_with_them(self, tmp_path: Path) -> None:
        grown = ('width = "12m"\nheight = "12m"', "area_per_robot = 4")
        file = write(tmp_path, IN_MAZE, grown, ('motion = "still"\n', ""), text=SCOUTS)
        scenario = load(file, Changes(robots=100))
        assert (scenario.width, scenario.height) == (20.0, 20.0)
        inner = scenario.shapes[:-1]  # without the edge
        assert reached(passages([s for s in inner if isinstance(s, Wall)], 10, 10, 2.0)) == 100
        simulator = Simulator(scenario)
        start = simulator.x.copy()
        for _ in range(20):
            simulator.step()
        assert abs(simulator.x - start).max() > 0.5

    def test_the_runs_seed_chooses_the_maze_unless_the_file_does(self, tmp_path: Path) -> None:
        file = write(tmp_path, IN_MAZE, text=SCOUTS)
        assert load(file) == load(file, Changes(seed=3))
        assert load(file, Changes(seed=4)).shapes != load(file).shapes
        assert load(file, Changes(seed=4)).seed == 4
        fixed = write(tmp_path, IN_MAZE, ("[robots]\n", "seed = 9\n\n[robots]\n"), text=SCOUTS)
        assert load(fixed, Changes(seed=4)).shapes == load(fixed).shapes

    def test_a_mistake_is_told_with_its_place(self, tmp_path: Path) -> None:
        file = write(tmp_path, ('"12m"', '"5km"'), IN_MAZE, text=SCOUTS)
        with pytest.raises(SettingsError, match=r"scenario.toml:\d+: world.maze: a maze of 2500 by 2500 cells"):
            load(file)
