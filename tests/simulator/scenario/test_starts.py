"""Where robots start: poses, CSV files and formations, the names that they give, and every mistake with its place."""

from __future__ import annotations

import re
from math import pi
from pathlib import Path

import numpy as np
import polars
import pytest

import sleepcast as sc
from sleepcast.core.errors import MisuseError
from sleepcast.core.serial import SerialError
from sleepcast.simulator import Changes, SettingsError, Simulator, load
from sleepcast.simulator.packing import pack
from sleepcast.simulator.scenario.starts import MAX_CSV, MAX_STARTS
from sleepcast.simulator.snapshot import scenario_of

HEAD = 'format = 1\ntitle = "starts"\nseconds = "10s"\n'
WORLD = '[world]\nwidth = "20m"\nheight = "10m"\n'
ROBOTS = '[robots]\nlike = "scout"\nmotion = "still"\n'
POSES = (
    'starts = [["1m", "2m", "90deg", "ada"], ["3m", 2.0], { x = "500cm", y = 2, heading = "-90deg", name = "bob" }]\n'
)
R = 2.0**0.5
TWO = [(1.0, 2.0), (3.0, 2.0)]


def write(folder: Path, robots: str, world: str = "", csv: str | bytes = "") -> Path:
    """A scenario with these lines of its robots and its world, and a file of poses beside it."""
    (folder / "scenario.toml").write_text(HEAD + WORLD + world + ROBOTS + robots)
    (folder / "poses.csv").write_bytes(csv if isinstance(csv, bytes) else csv.encode())
    return folder


def places(folder: Path, changes: Changes = Changes()) -> list[tuple[float, float]]:  # noqa: B008  # frozen
    sim = Simulator(load(folder, changes))
    return [(round(x, 9), round(y, 9)) for x, y in zip(sim.x.tolist(), sim.y.tolist(), strict=True)]


def refusal(folder: Path, changes: Changes = Changes()) -> str:  # noqa: B008  # frozen
    """What is said of a scenario in which robots cannot start, from the file's name on."""
    with pytest.raises(MisuseError) as caught:
        Simulator(load(folder, changes))
    return str(caught.value).removeprefix(f"{folder}/")


class TestPoses:
    def test_robots_begin_where_they_are_put_and_are_called_as_they_are_named(self, tmp_path: Path) -> None:
        sim = Simulator(load(write(tmp_path, POSES)))
        assert places(tmp_path) == [*TWO, (5.0, 2.0)]
        assert tuple(sim.names) == ("ada", "scout2", "bob")
        assert (sim.bodies.heading[0], sim.bodies.heading[2]) == (pi / 2, -pi / 2)
        for believed, true in (("encoder_x", "x"), ("encoder_y", "y"), ("encoder_heading", "heading")):
            assert (getattr(sim.bodies, believed) == getattr(sim.bodies, true)).all()

    def test_a_heading_that_nobody_says_is_what_it_would_be_without_starts(self, tmp_path: Path) -> None:
        given = Simulator(load(write(tmp_path, POSES)))
        free = Simulator(load(write(tmp_path, "count = 3\n")))
        assert given.bodies.heading[1] == free.bodies.heading[1]

    def test_a_csv_file_says_the_same_in_any_order_of_columns(self, tmp_path: Path) -> None:
        text = "\ufeffName,Heading (deg), y [cm],x [m]\nada,90,200,1\n\n,,200.,3\r\nbob,-90deg,2m,5\n"
        of_file = Simulator(load(write(tmp_path, 'starts = "poses.csv"\n', csv=text)))
        listed = Simulator(load(write(tmp_path, POSES)))
        assert tuple(of_file.names) == tuple(listed.names)
        assert of_file.state_hash() == listed.state_hash()

    @pytest.mark.parametrize(
        "text",
        [
            "# from a spreadsheet\nx,y,heading,name\n# first\n1,2,90°,ada\n3,2\n5,2,-90 °,bob\n",
            "x,y,heading [°],name\n1,2,90,ada\n3,2,,\n #,last\n5,2,-90,bob\n",
            ",robot,x,y,heading\n0,ada,1.0,2.0,90°\n1,,3.0,2.0,\n2,bob,5.0,2.0,-90°\n",  # as pandas numbers rows
        ],
    )
    def test_a_csv_file_may_have_comments_and_degrees_as_tables_write_them(self, tmp_path: Path, text: str) -> None:
        of_file = Simulator(load(write(tmp_path, 'starts = "poses.csv"\n', csv=text.replace("3,2\n", "3,2,,\n"))))
        assert of_file.state_hash() == Simulator(load(write(tmp_path, POSES))).state_hash()

    def test_a_table_of_robots_is_where_those_of_another_run_start(self, tmp_path: Path) -> None:
        write(tmp_path, POSES)
        fleet = sc.open(tmp_path)
        fleet.run(2)
        polars.DataFrame(fleet.table("heading", "x", "y")).write_csv(tmp_path / "poses.csv")
        again = sc.open(write(tmp_path, 'starts = "poses.csv"\n', csv=(tmp_path / "poses.csv").read_text()))
        assert tuple(again.names) == tuple(fleet.names)
        assert again.x.tolist() == fleet.x.tolist()
        assert again["heading"].tolist() == pytest.approx(fleet["heading"].tolist())

    def test_a_run_may_have_fewer_robots_than_poses_and_no_more(self, tmp_path: Path) -> None:
        write(tmp_path, POSES)
        for fewer in (Changes(robots=2), Changes(over=(("robots.count", 2),))):
            assert places(tmp_path, fewer) == TWO
        for more in (Changes(robots=4), Changes(over=(("robots.count", 4),))):
            assert refusal(tmp_path, more) == (
                "scenario.toml:10: robots.starts: 3 starts for 4 robots: write more starts, or use fewer robots"
            )

    def test_each_type_has_its_own_and_the_others_begin_around_them(self, tmp_path: Path) -> None:
        several = '[[robots]]\nlike = "scout"\ncount = 10\nx = [0, 2]\ny = [0, 2]\n[[robots]]\nlike = "scout"\n'
        (tmp_path / "scenario.toml").write_text(HEAD + WORLD + several + 'starts = [[1, 1, 0, "ada"], [1, "1.5m"]]\n')
        sim = Simulator(load(tmp_path))
        assert tuple(sim.names[9:]) == ("scout10", "ada", "scout12")
        assert sim.x[10:].tolist() == [1.0, 1.0]
        apart = np.hypot(sim.x[:, None] - sim.x, sim.y[:, None] - sim.y) + np.eye(12)
        assert apart.min() > 0.34

    def test_bodies_that_nothing_stops_may_begin_at_one_place(self, tmp_path: Path) -> None:
        assert places(write(tmp_path, "body.bumpers = 0\nstarts = [[1, 1], [1, 1]]\n")) == [(1.0, 1.0)] * 2

    def test_groups_go_through_them_in_their_order(self, tmp_path: Path) -> None:
        groups = "[robots.groups.a]\ncount = 1\nvalues = { c = 1 }\n[robots.groups.b]\ncount = 2\nvalues = { c = 2 }\n"
        fleet = sc.open(write(tmp_path, POSES + groups))
        assert fleet["c"].tolist() == [1.0, 2.0, 2.0]

    @pytest.mark.parametrize(
        ("robots", "said"),
        [
            (POSES + "count = 5\n", "12: robots.starts: 3 starts for 5 robots: write one for each"),
            (POSES + "[robots.groups.a]\ncount = 2\n", "12: robots.starts: 3 starts for 2 robots: write one for each"),
            ("starts = []\n", "12: robots.starts: wanted a list of poses such as"),
            ("starts = [[1]]\n", "12: robots.starts.pose 1: wanted x, y, and perhaps heading and name"),
            ("starts = [[1, 2], 3]\n", "12: robots.starts.pose 2: wanted x, y, and perhaps heading and name"),
            ("starts = [{ x = 1, y = 1, z = 1 }]\n", "12: robots.starts.pose 1.z: these robots do not fly"),
            ("starts = [[1, 11]]\n", "12: robots.starts.pose 1.y: 11 m is outside the world, which goes"),
            ("starts = [[1, 1, 90]]\n", "12: robots.starts.pose 1.heading: wanted an angle from -360deg"),
            ('starts = [[1, 1, "E"]]\n', '12: robots.starts.pose 1.heading: wanted an angle such as "90deg", not "E"'),
            ('starts = [[1, 1, 0, "a b"]]\n', "12: robots.starts.pose 1.name: 'a b': wanted 1 to 64"),
            ('starts = [[1, 1, 0, "a"], [2, 2, 0, "a"]]\n', "12: robots.starts.pose 2.name: another robot is"),
            ('starts = [[1, 1, 0, "scout2"], [2, 2]]\n', "12: robots.starts.pose 1.name: another robot is"),
            ("starts = [[1, 1]]\nx = [0, 1]\n", "13: robots.x: the robots have starts, which say where they begin"),
            ('starts = "none.csv"\n', "12: robots.starts: there is no file"),
            ("starts = [[1, 1], [1.2, 1]]\n", ": robots.starts: robots 1 and 2 cannot start 0.2 m apart"),
            ("starts = [[1, 1], [4, 4.9]]\n", ": robots.starts: robot 2 cannot start at 4, 4.9 m: that is"),
            ("starts = [[1, 1], [6, 4]]\n", ": robots.starts: robot 2 cannot start at 6, 4 m: its body"),
        ],
    )
    def test_a_mistake_is_told_with_its_place(self, tmp_path: Path, robots: str, said: str) -> None:
        walls = "circles = [{ center = [4, 5], radius = 1 }]\nwalls = [{ points = [[6.1, 3], [6.1, 6]] }]\n"
        assert refusal(write(tmp_path, robots, walls)).startswith("scenario.toml:" + said.removeprefix(":"))

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            ("", "1: no poses"),
            ("x,y\n", "1: no poses"),
            ("x,w\n1,2\n", '1: "w" is no column: wanted x, y, and perhaps heading and name'),
            ("x,x,y\n1,2\n", '1: "x" is there twice'),
            ("x [miles],y\n1,2\n", '1: unknown unit in "x [miles]"'),
            ("90°,1,2\n", '1: "90°" is no column: wanted x, y, and perhaps heading and name. The first line names '),
            ("x,heading\n1,2\n", "1: there is no column y"),
            ("x,,y\n1,2,3\n", '1: "" is no column: wanted x, y, and perhaps heading and name'),
            ("x,y,name,robot\n1,2,a,b\n", '1: "robot" is there twice'),
            ("x;y\n1;2\n", '1: "x;y": wanted commas between the columns, not semicolons'),
            ("x,y\n1,2\n1,2,3\n", "3: 3 values in 2 columns: one for each. Decimals have a point, not a comma"),
            ("x,y\n1,2\n\n1,abc\n", '4: y: wanted a length such as "5m", not "abc"'),
            ("x,y\n1,2\n1,\n", "3: y: is missing"),
            ("x,y\n1,2\n1,200\n", "3: y: 200 m is outside the world"),
            ('x,y\n1,"2\n', "2: not CSV: unexpected end of data"),
            ("x,y\n" + "1,1\n" * (MAX_STARTS + 1), f"{MAX_STARTS + 2}: more than {MAX_STARTS} poses"),
            ("x,y\n" + " " * MAX_CSV, f" too long for a file of starts: at most {MAX_CSV} bytes"),
            (b"x,y\n\xff,1\n", "2: not UTF-8 text"),
            ("x,y\n1e400,2\n", '2: x: wanted a length such as "5m", not "1e400"'),
            ("x,y\n1,2\x0b3,4\n", "2: 3 values in 2 columns"),
            ('x,y,name\n1,2,"a\nb"\n', "3: name: 'a\\nb': wanted 1 to 64 characters"),
            ("x,y,name\n1,2,a\u2028b\n", "2: name: "),
        ],
        ids=range(22),
    )
    def test_a_bad_line_of_a_file_is_told_by_its_number(self, tmp_path: Path, text: str | bytes, said: str) -> None:
        assert refusal(write(tmp_path, 'starts = "poses.csv"\n', csv=text)).startswith(f"poses.csv:{said}")


class TestFormations:
    @pytest.mark.parametrize(
        ("keys", "wanted"),
        [
            ('shape = "line", spacing = "1m", center = [5, 5]', [(5, 6.5), (5, 5.5), (5, 4.5), (5, 3.5)]),
            ('shape = "line", spacing = 1, heading = "90deg"', [(8.5, 5), (9.5, 5), (10.5, 5), (11.5, 5)]),
            ('shape = "grid", spacing = 2, heading = "90deg"', [(9, 6), (11, 6), (9, 4), (11, 4)]),
            ('shape = "grid", spacing = 1, columns = 1', [(11.5, 5), (10.5, 5), (9.5, 5), (8.5, 5)]),
            ('shape = "grid", spacing = 1, columns = 3', [(10.5, 6), (10.5, 5), (10.5, 4), (9.5, 6)]),
            ('shape = "circle", spacing = "200cm"', [(10 + R, 5), (10, 5 + R), (10 - R, 5), (10, 5 - R)]),
        ],
    )
    def test_robots_stand_as_is_said(self, tmp_path: Path, keys: str, wanted: list[tuple[float, float]]) -> None:
        found = places(write(tmp_path, f"count = 4\nstarts = {{ {keys} }}\n"))
        assert found == [pytest.approx(place) for place in wanted]

    def test_they_look_along_or_out_of_a_circle(self, tmp_path: Path) -> None:
        seen = {}
        for heading in ("90deg", "outward", "inward"):
            keys = f'shape = "circle", spacing = 1, heading = "{heading}"'
            sim = Simulator(load(write(tmp_path, f"count = 2\nstarts = {{ {keys} }}\n")))
            seen[heading] = np.cos(sim.bodies.heading).round(9).tolist()
        assert seen == {"90deg": [0.0, 0.0], "outward": [1.0, -1.0], "inward": [-1.0, 1.0]}

    def test_it_is_there_for_any_number_of_robots(self, tmp_path: Path) -> None:
        write(tmp_path, 'count = 4\nstarts = { shape = "circle", spacing = 1 }\n')
        assert places(tmp_path, Changes(robots=1)) == [(10.0, 5.0)]
        around = np.array(places(tmp_path, Changes(robots=20)))
        assert np.hypot(*(around - np.roll(around, 1, 0)).T) == pytest.approx(1.0)

    @pytest.mark.parametrize(
        ("keys", "said"),
        [
            ('shape = "lin"', "robots.starts.shape: wanted one of line, circle, grid, not"),
            ('shape = "grid", spacing = 1, columns = 0', "robots.starts.columns: wanted a whole number from 1 to"),
            ('shape = "line", spacing = 1, columns = 2', "robots.starts.columns: unknown key"),
            (
                'shape = "circle", spacing = 1, heading = "out"',
                'robots.starts.heading: wanted an angle such as "90deg"',
            ),
            ('shape = "line", spacing = "4m"', "robots.starts: a line of 4 robots 4 m apart does not fit"),
        ],
    )
    def test_a_mistake_is_told(self, tmp_path: Path, keys: str, said: str) -> None:
        found = refusal(write(tmp_path, f"count = 4\nstarts = {{ {keys} }}\n"))
        assert re.sub(r"^scenario.toml:\d+: ", "", found).startswith(said)


class TestElsewhere:
    def test_a_fleet_that_goes_on_is_called_the_same(self, tmp_path: Path) -> None:
        fleet = sc.open(write(tmp_path, POSES))
        fleet.send("(DRIVE 0.1m/s 0)", only=["ada"])
        fleet.run(1)
        again = fleet.fork()
        assert tuple(again.names) == ("ada", "scout2", "bob")
        assert again.hash == fleet.hash
        assert tuple(fleet.ask("y", only=["bob"]).values.items()) == (("bob", 2.0),)

    def test_a_snapshot_of_strangers_names_no_robot_twice_and_puts_none_outside(self, tmp_path: Path) -> None:
        packed = pack(load(write(tmp_path, POSES)))
        assert scenario_of(packed).robots.starts[2].name == "bob"
        for before, after in ((b'"bob"', b'"ada"'), (b'"bob"', b'"\\u001b"'), (b"[5.0,2.0", b"[5e9,2.0")):
            assert before in packed
            with pytest.raises(SerialError):
                scenario_of(packed.replace(before, after))

    def test_files_of_before_are_read_as_before(self, tmp_path: Path) -> None:
        packed = pack(load(write(tmp_path, "count = 3\n")))
        assert b',"starts":[]' in packed
        assert scenario_of(packed.replace(b',"starts":[]', b"")) == scenario_of(packed)

    def test_a_file_is_named_in_a_change(self, tmp_path: Path) -> None:
        write(tmp_path, POSES, csv="x,y\n1,2\n3,2\n")
        assert places(tmp_path, Changes(over=(("robots.starts", "poses.csv"),))) == TWO
        with pytest.raises(SettingsError, match=r"over robots\.starts"):
            load(tmp_path, Changes(over=(("robots.starts", "pose.csv"),)))
