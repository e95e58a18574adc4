"""Setup files of 1998: what is known is applied, what is not is told by line, and no text does any harm."""

from __future__ import annotations

from collections.abc import Callable
from math import pi, sqrt
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sleepcast.core.settings import SettingsError
from sleepcast.nomad.world.building import nomad_world
from sleepcast.nomad.world.setup_files import MAX_FILE, MOST_TOLD, WorldSetup, read_robot_setup, read_world_setup
from sleepcast.nomad.world.setups import Setup, read_setup
from sleepcast.simulator.scenario.robot_settings import INCH, TENTH

IDEAL = read_setup("ideal")
INTERLEAVED = (0, 2, 15, 1, 14, 3, 13, 4, 12, 5, 11, 6, 10, 7, 9, 8)
LASER = """[laser]
calibration = -0.003470 0.000008 0.011963 0.001830
              27.5535913 0.000428 0.031102 -0.444624   ; eight of them
offset 0 0
"""


def robot(folder: Path, text: str | bytes) -> Setup:
    file = folder / "robot.setup"
    file.write_bytes(text if isinstance(text, bytes) else text.encode("latin-1"))
    return read_robot_setup(file, IDEAL)


def world(folder: Path, text: str) -> WorldSetup:
    file = folder / "world.setup"
    file.write_text(text, encoding="latin-1")
    return read_world_setup(file)


def test_what_is_known_of_the_laser_is_read_and_said_to_be_of_no_use(tmp_path: Path) -> None:
    found = robot(tmp_path, LASER)
    assert found.robots == IDEAL.robots
    assert [line.removeprefix(str(tmp_path)) for line in found.ignored] == [
        "/robot.setup:2: read, but no robot here has a laser",
        "/robot.setup:4: read, but no robot here has a laser",
    ]


def test_sonars_and_control_in_the_units_of_the_nomad(tmp_path: Path) -> None:
    text = (
        "[SONAR]\nRate: 15\norder = %s\nminimum 10\nmaximum=200.5\nhalf_cone = 100\nerror = .02\n[Control]\nerror 5\n"
    )
    found = robot(tmp_path, text % ", ".join(map(str, INTERLEAVED)))
    ring, wheels = found.robots.ring, found.robots.wheels
    assert ring is not None
    assert wheels is not None
    assert (ring.pause, ring.order, ring.noise) == (pytest.approx(0.06), INTERLEAVED, 0.02)
    assert (ring.least, ring.most) == (pytest.approx(10 * INCH), pytest.approx(200.5 * INCH))
    assert ring.beam == pytest.approx(20.0 * pi / 180.0)
    assert wheels.slip_noise == pytest.approx(5 * TENTH / sqrt(100 * INCH))
    assert found.ignored == ()
    assert nomad_world(None, tmp_path / "robot.setup", 1).setup == found


def test_a_world_says_its_port_its_map_and_who_may_end_it(tmp_path: Path) -> None:
    found = world(
        tmp_path, "// lab\r\n[server]\r\nTCP_PORT = 7771\r\nquit_server = Yes\r\n[world]\r\nmap lab.txt\r\nrobots 2"
    )
    assert found == WorldSetup(7771, True, 2, tmp_path / "lab.txt")
    assert world(tmp_path, "") == WorldSetup()


def test_what_is_not_understood_is_told_by_its_line_and_ignored(tmp_path: Path) -> None:
    found = world(tmp_path, "loose words\n[windows]\nrefresh = 10 20\n30\n= 5\n[half\nport = 7020\n")
    assert found.port == 7020
    assert [line.removeprefix(str(tmp_path)) for line in found.ignored] == [
        "/world.setup:1: ignored: loose words",
        "/world.setup:3: ignored: refresh = 10 20",
        "/world.setup:5: ignored: = 5",
        "/world.setup:6: ignored: [half",
    ]
    many = world(tmp_path, "a = b\n" * 500).ignored
    assert len(many) == MOST_TOLD + 1
    assert many[-1] == "and 480 more"


def test_of_a_key_that_comes_twice_the_later_line_counts_and_the_earlier_one_is_told(tmp_path: Path) -> None:
    found = world(tmp_path, "port = 7000\n[server]\ntcp_port = 7001\n")
    file = tmp_path / "world.setup"
    assert found == WorldSetup(7001, ignored=(f"{file}:1: ignored, as {file}:3 says it again: port = 7000",))
    twice = robot(tmp_path, "[sonar]\nrate 6\nrate 7\n[other]\nsonar.rate 8\n")
    assert twice.robots.ring is not None
    assert twice.robots.ring.pause == pytest.approx(0.028)
    assert [line.rpartition("ignored")[2] for line in twice.ignored] == [
        f", as {tmp_path / 'robot.setup'}:3 says it again: rate 6",
        ": sonar.rate 8",
    ]


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("/maps//lab.txt", "/maps//lab.txt"),
        ('"lab;2.txt" ; the second', "lab;2.txt"),
        ("lab,  1.txt // a comment", "lab,  1.txt"),
        ("lab.txt#", "lab.txt"),
    ],
)
def test_the_name_of_a_map_is_taken_as_it_stands(tmp_path: Path, text: str, name: str) -> None:
    assert world(tmp_path, f"map = {text}\n").map == tmp_path / name


@pytest.mark.parametrize("how", ["utf-8", "utf-8-sig", "latin-1"])
def test_editors_of_today_and_of_then_may_have_saved_it(tmp_path: Path, how: str) -> None:
    file = tmp_path / "WORLD.SETUP"
    file.write_bytes("[server]\nport 7020\nmap = caf\N{LATIN SMALL LETTER E WITH ACUTE}.txt\n".encode(how))
    assert read_world_setup(file) == WorldSetup(7020, map=tmp_path / "caf\N{LATIN SMALL LETTER E WITH ACUTE}.txt")


def test_255_ends_an_order_as_in_conf_sn(tmp_path: Path) -> None:
    ring = robot(tmp_path, "[sonar]\norder = 0 2 15 1 255 255 3\n").robots.ring
    assert ring is not None
    assert ring.order == (0, 2, 15, 1)
    (tmp_path / "ROBOT.SETUP").write_text("[sonar]\nrate 6\n")
    big = nomad_world(None, tmp_path / "ROBOT.SETUP", 1).setup.robots.ring
    assert big is not None
    assert big.pause == pytest.approx(0.024)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[laser]\ncalibration = 1 2 3\n", ":2: [laser] calibration: wanted 8 numbers, got 1 2 3"),
        ("[laser]\n\noffset\n", ":3: [laser] offset: wanted 2 numbers, got nothing"),
        ("[sonar]\nrate = 300", ":2: [sonar] rate: wanted a firing rate from 0 to 255, got 300"),
        ("[sonar]\nrate = 1.5", ":2: [sonar] rate: wanted a firing rate, a whole number, got 1.5"),
        ("[sonar]\norder = 0 16", ":2: [sonar] order: wanted numbers of sonars from 0 to 15, got 0 16"),
        ("[sonar]\norder =", "wanted numbers of sonars from 0 to 15, got nothing"),
        ("[sonar]\nminimum = 1e400", "wanted a number, got 1e400"),
        ("[sonar]\nmaximum = 5", "the minimum of 6 in is not below the maximum"),
        ("[control]\nerror = \x1b[2J", "wanted a number, got \N{REPLACEMENT CHARACTER}[2J"),
        ("[laser]\noffset " + "1\n" * 300, "more than 256 values of offset"),
        ("[sonar]\norder = 255", "wanted numbers of sonars from 0 to 15, got 255"),
        ("[control]\nerror = 601", "tenths of an inch from 0 to 600"),
        (b"x" * (MAX_FILE + 1), "at most 65536 bytes"),
    ],
)
def test_a_wrong_value_is_an_error_with_its_file_and_line(tmp_path: Path, text: str | bytes, said: str) -> None:
    with pytest.raises(SettingsError) as caught:
        robot(tmp_path, text)
    assert said in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path / "robot.setup"))


@pytest.mark.parametrize(
    "text",
    ["port = 0", "port = 70000", "quit_server = perhaps", "robots = 0", "map =", "map a.SETUP", "map = a.txt\n5"],
)
def test_a_wrong_value_of_a_world_is_an_error(tmp_path: Path, text: str) -> None:
    with pytest.raises(SettingsError, match=r"world\.setup:1: "):
        world(tmp_path, text)


def test_a_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="cannot be read: No such file"):
        read_world_setup(tmp_path / "world.setup")


WORDS = [
    "[",
    "]",
    "=",
    ":",
    ",",
    ";",
    "#",
    "laser",
    "sonar",
    "control",
    "calibration",
    "offset",
    "rate",
    "order",
    "minimum",
    "maximum",
    "half_cone",
    "error",
    "port",
]
WORDS += ["quit_server", "robots", "map", "0", "-1", "6", "1e9", "\n", "\n", "\r", "[sonar]\n", "[laser]\n"]
SOME = st.lists(st.sampled_from(WORDS), max_size=60).map(lambda words: " ".join(words).encode())


@given(st.one_of(st.binary(max_size=400), SOME))
def test_any_bytes_are_a_setup_or_one_error(tmp_path_factory: pytest.TempPathFactory, raw: bytes) -> None:
    file = tmp_path_factory.getbasetemp() / "any.setup"
    file.write_bytes(raw)
    for read in (read_world_setup, lambda each: read_robot_setup(each, IDEAL)):
        told, refused = outcome(read, file)
        assert not refused or refused.startswith(str(file))
        assert all(line.isprintable() for line in told)


def outcome(read: Callable[[Path], WorldSetup | Setup], file: Path) -> tuple[tuple[str, ...], str]:
    """What is told of a file, or why it is refused."""
    try:
        return read(file).ignored, ""
    except SettingsError as error:
        return (), str(error)
