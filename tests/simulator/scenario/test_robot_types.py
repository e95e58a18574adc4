"""Robot types as data, and several sorts of robots in one scenario: what is said where, and who is called what."""

from __future__ import annotations

from math import inf, radians
from pathlib import Path

import pytest

from sleepcast.simulator import Changes, Scenario, SettingsError, load
from sleepcast.simulator.packing import pack, unpack
from sleepcast.simulator.scenario.robot_types import names_of, slices, type_names
from small_worlds import write

HEAD = """
format = 1
title = "Several sorts"
seconds = "1min"
seed = 3

[world]
width = "20m"
height = "20m"
edge = "wall"
"""
ONE = '\n[robots]\nlike = "scout"\ncount = 4\n'
MIXED = """
[[robots]]
like = "scout"
count = 6

[[robots]]
like = "nomad200"
type = "nomad"
count = 3
motion = "still"

[robots.stores.water]
start = ["1kg", "2kg"]

[[robots]]
like = "disc"
count = 1
"""


def scenario(folder: Path, robots: str, changes: Changes | None = None, head: str = HEAD) -> Scenario:
    return load(write(folder, more=robots, text=head), changes or Changes())


class TestTypes:
    @pytest.mark.parametrize("name", type_names())
    def test_each_type_that_comes_along_is_whole(self, tmp_path: Path, name: str) -> None:
        wide = HEAD.replace('"20m"', '"200m"')  # a plane needs room to circle
        robots = scenario(tmp_path, f'\n[robots]\nlike = "{name}"\ncount = 2\n', head=wide).robots
        assert (robots.type, robots.count) == (name, 2)
        assert robots.bumpers or robots.flight, "what stands on the ground is solid"

    def test_a_scout_is_the_one_of_the_thesis(self, tmp_path: Path) -> None:
        robots = scenario(tmp_path, ONE).robots
        assert robots.wheels is not None
        assert robots.ring is not None
        assert (robots.geometry.radius, robots.wheels.track, robots.limits.speed) == (0.17, 0.3452, 1.0)
        assert (robots.ring.count, robots.ring.most) == (16, 255 * 0.0254)
        assert (robots.stores[0].name, robots.stores[0].reach) == ("battery", inf)

    def test_what_the_scenario_says_goes_before(self, tmp_path: Path) -> None:
        more = (
            ONE
            + '[robots.limits]\nspeed = "0.5m/s"\n[robots.sonar]\nnoise = 0.01\n'
            + '[robots.stores.battery]\nreach = "5km"\n'
        )
        robots = scenario(tmp_path, more).robots
        assert (robots.limits.speed, robots.limits.turn_rate) == (0.5, radians(180))
        assert robots.ring is not None
        assert (robots.ring.noise, robots.ring.count) == (0.01, 16)
        assert (robots.stores[0].reach, robots.stores[0].low) == (5000.0, 1.0)

    def test_a_file_may_be_a_type(self, tmp_path: Path) -> None:
        (tmp_path / "mower.toml").write_text(
            'format = 1\n[limits]\nspeed = 1\nturn_rate = 1\nacceleration = 1\n[body]\nradius = "30cm"\n',
            encoding="utf-8",
        )
        robots = scenario(tmp_path, '\n[robots]\nlike = "mower.toml"\ncount = 2\n').robots
        assert (robots.type, robots.geometry.radius, robots.ring) == ("mower", 0.3, None)

    @pytest.mark.parametrize(
        ("file", "robots", "said"),
        [
            (
                "",
                'like = "scuot"',
                'scenario.toml:14: robots.like: no type "scuot" (did you mean scout?): wanted one of',
            ),
            ("", 'like = "no.toml"', "robots.like: there is no file"),
            ("format = 2\n", 'like = "own.toml"', "own.toml:1: format: format 2 is newer"),
            ("limits = 1\n", 'like = "own.toml"', "own.toml:1: format: is missing"),
            ("format = 1\ncount = 3\n", 'like = "own.toml"', "own.toml:2: count: unknown key"),
            ("format = 1\n[limits]\nspeed = -1\n", 'like = "own.toml"', "own.toml:3: limits.speed: wanted a speed"),
            (
                "format = 1\n[limits]\nspede = 1\n",
                'like = "own.toml"',
                "own.toml:3: limits.spede: unknown key (did you",
            ),
            ("format = 1\nlimits = 5\n", 'like = "own.toml"', "own.toml:2: limits: wanted a table [limits], not 5"),
            ("", 'like = "scout"\n[robots.limits]\nspede = 1', "scenario.toml:16: robots.limits.spede: unknown key"),
        ],
        ids=lambda value: str(value)[:30],
    )
    def test_a_mistake_is_told_with_its_place(self, tmp_path: Path, file: str, robots: str, said: str) -> None:
        (tmp_path / "own.toml").write_text(file, encoding="utf-8")
        with pytest.raises(SettingsError) as caught:
            scenario(tmp_path, f"\n[robots]\ncount = 1\n{robots}\n".replace("\n\n", "\n"))
        assert said in str(caught.value)


class TestSeveralSorts:
    def test_they_have_one_vocabulary(self, tmp_path: Path) -> None:
        mixed = scenario(tmp_path, MIXED)
        assert [(sort.type, sort.count) for sort in mixed.sorts] == [("scout", 6), ("nomad", 3), ("disc", 1)]
        robots = mixed.robots
        assert (robots.type, robots.count, robots.bumpers) == ("robot", 10, 20)
        assert [store.name for store in robots.stores] == ["battery", "water"]
        assert robots.wheels is not None
        assert robots.limits.speed == 1.0
        assert robots.geometry.radius == 0.225

    def test_they_are_numbered_sort_by_sort(self, tmp_path: Path) -> None:
        mixed = scenario(tmp_path, MIXED)
        assert tuple(names_of(mixed.sorts, 10)) == (
            *(f"scout{i}" for i in range(1, 7)),
            "nomad1",
            "nomad2",
            "nomad3",
            "disc1",
        )

    def test_another_number_of_robots_keeps_their_proportion(self, tmp_path: Path) -> None:
        mixed = scenario(tmp_path, MIXED, Changes(robots=100))
        assert mixed.robots.count == 100
        assert slices(mixed.sorts, 100) == [slice(0, 60), slice(60, 90), slice(90, 100)]
        assert slices(mixed.sorts, 1) == [slice(0, 1), slice(1, 1), slice(1, 1)]

    def test_two_sorts_of_one_type_share_its_numbers(self, tmp_path: Path) -> None:
        two = scenario(tmp_path, ONE.replace("[robots]", "[[robots]]") * 2)
        assert two.robots.type == "scout"
        assert tuple(names_of(two.sorts, 8)) == tuple(f"scout{i}" for i in range(1, 9))

    def test_groups_go_on_through_the_sorts(self, tmp_path: Path) -> None:
        groups = "\n[robots.groups.eyes]\ncount = 2\nvalues = { caste = 4 }\n[robots.groups.body]\ncount = 2\n"
        mixed = scenario(
            tmp_path, ONE.replace("[robots]", "[[robots]]") + groups + '[[robots]]\nlike = "disc"\ncount = 3\n'
        )
        assert [(group.name, group.count) for group in mixed.robots.groups] == [("eyes", 2), ("body", 2), ("disc", 3)]

    def test_a_recording_holds_them(self, tmp_path: Path) -> None:
        mixed = scenario(tmp_path, MIXED)
        again = unpack(Scenario, pack(mixed))
        assert (again.sorts, again.robots) == (mixed.sorts, mixed.robots)

    @pytest.mark.parametrize(
        ("robots", "said"),
        [
            ("robots = []\n", "robots: no robots at all"),
            (ONE.replace("[robots]", "[[robots]]") * 9, "robots: 9 of them; at most 8 fit"),
            (
                MIXED + "[robots.stores.Battery]\nstart = [0, 1]\n",
                "robots[2].stores.Battery: other robots spell it battery",
            ),
            (
                MIXED.replace(
                    '[robots.stores.water]\nstart = ["1kg", "2kg"]', '[robots.stores.battery]\nstart = ["1kg", "2kg"]'
                ),
                'robots[1].stores.battery: other robots have it in "%"; use one dimension',
            ),
            (MIXED.replace('"nomad"', '"scout1"'), "type: scout with a number may mean a scout1, too"),
            (MIXED.replace("count = 1\n", "count = 999_995\n"), "robots: 1000004 robots in all; at most 1000000 fit"),
            (MIXED.replace("count = 1\n", "cuont = 1\n"), "robots[2].cuont: unknown key (did you mean count?)"),
        ],
        ids=lambda value: str(value)[-30:],
    )
    def test_a_mistake_is_told_with_its_place(self, tmp_path: Path, robots: str, said: str) -> None:
        text = HEAD if robots.startswith("\n") else HEAD.replace("seed = 3\n", f"seed = 3\n{robots}")
        with pytest.raises(SettingsError) as caught:
            load(write(tmp_path, more=robots if robots.startswith("\n") else "", text=text))
        assert said in str(caught.value)
