"""Events: things come, go and move at their times, by name, and robots and recordings know it."""

from __future__ import annotations

from pathlib import Path

import pytest

from sleepcast.simulator import Changes, Circle, Scenario, SettingsError, Simulator, Wall, load
from sleepcast.simulator.packing import pack, unpack
from small_worlds import SCOUTS, write

THINGS = """
[[world.walls]]
points = [["5m", "5m"], ["5m", "7m"]]
name = "gate"

[[world.circles]]
center = ["9m", "6m"]
radius = "50cm"
name = "ball"
absent = true

[[events]]
at = "1s"
remove = "gate"

[[events]]
at = "3s"
add = "gate"

[[events]]
at = "2s"
add = "ball"

[[events]]
at = "2.5s"
move = "ball"
by = ["1m", "0m"]
"""


def scenario(folder: Path, *changes: tuple[str, str], run: Changes | None = None) -> Scenario:
    text = THINGS
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return load(write(folder, more=text, text=SCOUTS), run or Changes())


def seen(simulator: Simulator, seconds: float) -> float:
    """What a scout at rest at 2 m, looking east, sees after so many seconds."""
    while simulator.tick < round(seconds / 0.1):
        simulator.step()
    return simulator.robots[0].sonar(0)


def test_things_come_and_go_at_their_times(tmp_path: Path) -> None:
    simulator = Simulator(scenario(tmp_path))
    simulator.place(0, 2.0, 6.0, 0.0)
    wall, ball, moved, gate = 12.0 - 2.17, 8.5 - 2.17, 9.5 - 2.17, 5.0 - 2.17
    most = 255 * 0.0254
    for seconds, wanted in [
        (0.0, gate),
        (0.9, gate),
        (1.0, min(wall, most)),
        (2.0, ball),
        (2.5, min(moved, most)),
        (3.0, gate),
    ]:
        assert seen(simulator, seconds) == pytest.approx(wanted, abs=1e-5), seconds
    assert {shape.name for shape in simulator.world.shapes.values()} == {"gate", "ball", ""}


def test_a_thing_that_is_added_again_stands_where_the_file_has_it(tmp_path: Path) -> None:
    simulator = Simulator(scenario(tmp_path, ('at = "1s"\nremove = "gate"', 'at = "1s"\nmove = "gate"\nby = [1, 1]'),
                                   ('at = "3s"\nadd', 'at = "3s"\nremove')))  # fmt: skip
    seen(simulator, 1.5)
    assert Wall(((6.0, 6.0), (6.0, 8.0)), "gate") in simulator.world.shapes.values()
    seen(simulator, 3.0)
    assert "gate" not in {shape.name for shape in simulator.world.shapes.values()}


def test_the_same_run_comes_of_a_packed_scenario(tmp_path: Path) -> None:
    first = Simulator(scenario(tmp_path))
    again = Simulator(unpack(Scenario, pack(first.scenario)))
    for _ in range(25):
        first.step()
        again.step()
    assert first.state_hash() == again.state_hash()
    assert Circle(10.0, 6.0, 0.5, "ball") in first.world.shapes.values()


def test_what_is_due_at_once_happens_in_the_first_tick(tmp_path: Path) -> None:
    simulator = Simulator(scenario(tmp_path, ('at = "1s"', "at = 0")))
    assert "gate" in {shape.name for shape in simulator.world.shapes.values()}
    simulator.step()
    assert "gate" not in {shape.name for shape in simulator.world.shapes.values()}


def test_without_walls_nothing_happens(tmp_path: Path) -> None:
    bare = scenario(tmp_path, run=Changes(walls=False))
    assert (bare.shapes, bare.absent, bare.events) == ((), (), ())


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('remove = "gate"', 'remove = "gaet"', 'remove: there is no thing called "gaet" (did you mean gate?)'),
        ('remove = "gate"', 'remove = "ball"', 'events[0].remove: "ball" is not there at that time'),
        ('remove = "gate"', 'add = "gate"', 'events[0].add: "gate" is there already at that time'),
        ('remove = "gate"', 'remove = "gate"\nadd = "gate"', "wanted one of add, remove, move and cut_off"),
        ('remove = "gate"', "", "events[0].add: wanted one of add, remove, move and cut_off in each event"),
        ('by = ["1m", "0m"]', "", "events[3].by: is missing"),
        ('by = ["1m", "0m"]', 'by = ["1km", "0m"]', "events[3].by: wanted" ),
        ('at = "1s"', 'at = "-1s"', "events[0].at: wanted a time"),
        ('name = "ball"\n', "", "world.circles[0].absent: what no name is given to can never be added"),
    ],
    ids=lambda value: str(value)[:24],
)  # fmt: skip
def test_a_mistake_is_told_with_its_place(tmp_path: Path, old: str, new: str, said: str) -> None:
    with pytest.raises(SettingsError) as caught:
        scenario(tmp_path, (old, new))
    assert said in str(caught.value)
