"""`sleepcast demo` and `sleepcast run`: headless outcomes that repeat, the page that starts and stops cleanly."""

from __future__ import annotations

import io
import json
import re
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import forkserver
from cli.calling import LONGEST, called, called_warm
from cli.terminal import terminal
from console.running import Program, open_page
from sleepcast.api import progress
from sleepcast.api.assembly import assemble
from sleepcast.cli import main, run
from sleepcast.console import DEFAULT_PORT
from sleepcast.console.adapters.swarm import SwarmAdapter
from sleepcast.console.incoming import MAX_FACTOR, MIN_FACTOR
from sleepcast.loop import resume, snapshot
from sleepcast.simulator import Changes, Wall, find_scenario
from small_worlds import IN_MAZE, SCOUTS, small, write

WALL = re.compile(r"wall_|realtime_factor|_per_second")
FIELDS = [
    "scenario",
    "seed",
    "robots",
    "seconds",
    "started_at_seconds",
    "wall_setup_seconds",
    "wall_seconds",
    "realtime_factor",
    "robot_steps_per_second",
    "state_hash",
    "accounting",
    "measures",
    "missed",
    "never_sent",
]


def outcome(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> dict[str, Any]:
    """The JSON object that `sleepcast ARGUMENTS` prints, in this process."""
    assert main(list(map(str, arguments))) == 0
    captured = capsys.readouterr()
    found: dict[str, Any] = json.loads(captured.out)
    assert captured.err.count("after the end") == captured.err.count("\n") == bool(found["never_sent"])
    return found


def repeated(found: dict[str, Any]) -> dict[str, Any]:
    """What must be the same in every run."""
    return {name: value for name, value in found.items() if not WALL.search(name)}


# ---- headless


def test_the_outcome_of_bravo(capsys: pytest.CaptureFixture[str]) -> None:
    found = outcome(capsys, "demo", "bravo", "--headless", "--seconds", "12", "--seed", "7", "--json")
    assert list(found) == FIELDS
    assert (found["scenario"], found["seed"], found["robots"], found["seconds"]) == ("bravo", 7, 1000, 12.0)
    (account,) = found["accounting"]
    assert list(account) == ["text", "matched", "held", "not_matched", "unknown", "fault", "silent"]
    assert account["text"].startswith("(WHEN (AND (< (DIST x y vessel_x vessel_y) 5mi)")
    assert account["matched"] + account["not_matched"] == 1000
    assert account["fault"] == account["silent"] == 0
    assert 15 <= account["matched"] <= 45, "about 29 are expected"
    assert found["measures"]["groups"] == {"bravo": account["matched"]}
    assert found["realtime_factor"] == pytest.approx(12.0 / found["wall_seconds"], rel=0.01)
    assert re.fullmatch("[0-9a-f]{64}", found["state_hash"])


def test_the_same_seed_gives_the_same_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONHASHSEED", "random")  # another one for each process, which is none of a fork server's
    arguments = ("demo", "bravo", "--headless", "--seconds", "11", "--robots", "200", "--json")
    first, again, other = (called(*arguments, "--seed", seed).out for seed in ("5", "5", "6"))
    blank = re.compile(r'"(wall_\w+|realtime_factor|\w+_per_second)": [0-9.e+-]+')
    assert blank.sub("", first) == blank.sub("", again)
    assert first.count("\n") == 1
    assert blank.sub("", first) != blank.sub("", other)


def test_run_is_the_same_without_a_page(capsys: pytest.CaptureFixture[str]) -> None:
    common = ("--seconds", "11", "--robots", "50", "--json")
    ran = outcome(capsys, "run", "bravo", *common)
    assert repeated(ran) == repeated(outcome(capsys, "demo", "--headless", *common))


def test_a_scenario_of_ones_own(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    mission = "@1s (WHEN (> battery 60%) (JOIN full))\n@2s (WHEN (IN full) (GOTO house_x house_y))\n@3s (/ 1 0)\n"
    (tmp_path / "own.sleep").write_text(mission, encoding="utf-8")
    file = write(tmp_path, ("seed = 3\n", 'seed = 3\nmission = "own.sleep"\n'))
    found = outcome(capsys, "run", file, "--json")
    assert (found["scenario"], found["seed"], found["robots"], found["seconds"]) == (tmp_path.name, 3, 20, 60.0)
    joined, went, failed = found["accounting"]
    assert joined["matched"] == went["matched"] == found["measures"]["groups"]["full"] > 0
    assert failed["fault"] == 20
    assert repeated(outcome(capsys, "run", tmp_path, "--json")) == repeated(found)


def test_the_seed_chooses_the_maze_too(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    runs = {}
    for written in ("3", "4"):
        (folder := tmp_path / written).mkdir()
        file = write(folder, IN_MAZE, ("seed = 3", f"seed = {written}"), text=SCOUTS)
        runs[written] = outcome(capsys, "run", file, "--seed", "4", "--seconds", "2", "--json")["state_hash"]
    assert runs["3"] == runs["4"]


def test_silence_is_counted_as_silence(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "own.sleep").write_text("@1s (WHEN (> battery 0) (MARK))\n", encoding="utf-8")
    file = write(tmp_path, ("seed = 3\n", 'seed = 3\nmission = "own.sleep"\n'), more="loss = 0.5\n")
    (account,) = outcome(capsys, "run", file, "--json")["accounting"]
    assert account["silent"] > 0
    assert account["matched"] + account["silent"] == 20


def test_the_outcome_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "bravo", "--seconds", "12", "--robots", "300"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert re.match(
        r"bravo, seed 7: 300 robots for 12\.0 s, [0-9.]+ times real time, after [0-9.]+ s of set-up$",
        lines[0],
    )
    assert lines[1].startswith("  (WHEN (AND")
    assert re.match(r"    matched \d+, did not match \d+, fault 0, silent 0", lines[2])
    assert re.match(r"  group bravo: \d+ members", lines[3])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["demo", "--json"], "--json is for runs without a page: add --headless"),
        (["demo", "--seconds", "5"], "--seconds is for runs without a page"),
        (["run", "bravo", "--page", "--json"], "--json is for runs without a page"),
        (["run", "bravo", "--wait"], "--run and --wait are for the page"),
        (["run", "bravo", "--speed", "5"], "--speed is for the page"),
        (["run", "bravo", "--seconds", "0"], "--seconds must be more than 0"),
        (["run", "bravo", "--seconds", "nan"], 'wanted a time such as "30s", not "nan"'),
        (["run", "bravo", "--seconds", "1e99"], "--seconds must be more than 0"),
        (["run", "bravo", "--robots", "0"], "--robots"),
        (["run", "bravo", "--robots", "1000001"], "--robots 1000001 is too many"),
        (["run", "bravo", "--density", "-4"], "--density must be from 1e-06 to 1e+07 square metres, not -4"),
        (["run", "bravo", "--seed", "-1"], "--seed"),
        (["run", "brvo"], "did you mean bravo?"),
        (["demo", "brvo"], "did you mean bravo?"),
        (["demo", "--host", "0.0.0.0"], "can be reached by others"),
    ],
)
def test_what_makes_no_sense_is_misuse(capsys: pytest.CaptureFixture[str], arguments: list[str], words: str) -> None:
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert words in captured.err


def test_a_malformed_scenario_is_told_with_line_and_key(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = write(tmp_path, ('width = "1km"', 'width = "1kg"'))
    assert main(["run", str(file)]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith(f"{file}:9: world.width: ")


@pytest.mark.parametrize("content", [b"\xff\xfe", b"[[[", b"", b"format = 99\n"])
def test_a_broken_scenario_file_is_a_sentence(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, content: bytes
) -> None:
    file = tmp_path / "scenario.toml"
    file.write_bytes(content)
    assert main(["run", str(file)]) == 2
    assert capsys.readouterr().err.startswith(f"{file}")


def test_an_order_that_cannot_be_read_is_told_before_the_run(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "own.sleep").write_text("@50s (MARK\n", encoding="utf-8")
    file = write(tmp_path, ("seed = 3\n", 'seed = 3\nmission = "own.sleep"\n'))
    assert main(["run", str(file)]) == 2
    captured = capsys.readouterr()
    assert 'own.sleep:1: the "(" is not closed' in captured.err
    assert captured.out == ""


def test_ctrl_c_ends_a_headless_run(tmp_path: Path) -> None:
    with terminal(["run", "bravo", "--seconds", "1000000", "--robots", "2"], tmp_path) as screen:
        screen.wait_for("%")  # the bar appears when a run takes its time
        screen.interrupt()
        assert screen.status() == 130
        assert "Traceback" not in screen.screen


class Screen(io.StringIO):
    """A terminal that keeps what is written to it."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("stream", "quiet", "patience", "seen"),
    [
        (Screen(), False, 0.0, True),
        (Screen(), True, 0.0, False),
        (Screen(), False, 60.0, False),
        (io.StringIO(), False, 0.0, False),
    ],
    ids=["slow work", "quiet", "fast work", "no terminal"],
)
def test_a_bar_where_somebody_waits_and_looks(
    monkeypatch: pytest.MonkeyPatch, stream: io.StringIO, quiet: bool, patience: float, seen: bool
) -> None:
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(progress, "PATIENCE", patience)
    assert list(progress.steps(50, "bravo", quiet=quiet)) == list(range(50))
    assert ("bravo" in stream.getvalue()) is seen


# ---- the page


@contextmanager
def page(*arguments: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """`sleepcast ARGUMENTS` serving its page: the process and the address it printed."""
    command = [sys.executable, "-m", "sleepcast", *arguments, "--no-browser"]
    process = forkserver.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        address = ""
        while not address.startswith("http"):
            line = process.stdout.readline()
            assert line, process.stderr.read() if process.stderr else ""
            address = line.strip()
        yield process, address
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


def get(address: str) -> tuple[int, str]:
    """What a browser would get."""
    try:
        with urllib.request.urlopen(address, timeout=LONGEST) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read().decode()


@pytest.mark.parametrize("arguments", [(), ("demo",), ("run", "bravo", "--page")])
def test_the_page_is_served_until_ctrl_c(arguments: tuple[str, ...]) -> None:
    options = ("--port", "0") if arguments else ()
    if not options and _in_use(DEFAULT_PORT):
        pytest.skip(f"port {DEFAULT_PORT} is in use on this machine")
    with page(*(arguments or ("demo",)), *options) as (process, address):
        assert address.startswith("http://127.0.0.1:")
        status, text = get(address)
        assert status == 200
        assert "<html" in text
        bare = address.partition("?")[0]
        status, entrance = get(bare)
        assert (status, "lacks the right token" in entrance) == (200, True), "without the token nobody gets in"
        assert entrance != text
        assert get(f"{bare}?token=another")[0] == 403
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=LONGEST)
        assert process.returncode == 130
        assert "Traceback" not in err


def _in_use(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def test_alerts_are_told_in_the_terminal(tmp_path: Path) -> None:
    with Program("run", write(tmp_path), "--page", "--alert", "marked") as program:
        with open_page(program) as seen:
            seen.until("alerts", lambda said: said["alerts"][0]["count"] == 0)
            assert seen.ask("send", text="(WHEN (< id 3) (MARK))")["type"] == "sent"
            seen.until("alerts", lambda said: bool(said["firings"]))
        assert program.end() == 130
    assert re.search(r"^alert at 0:00:\d\d: marked: rover1, rover2$", program.said, re.MULTILINE)


def test_an_alert_that_is_no_test_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path)
    assert main(["run", str(tmp_path), "--page", "--port", "0", "--alert", "(> tim 2s)"]) == 2
    assert "did you mean time?" in capsys.readouterr().err


def test_no_argument_is_the_demo_of_bravo(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[object] = []

    def start(name: str, headless: bool, options: run.Options) -> int:
        started.append((name, headless, dict(options)))
        return 0

    monkeypatch.setattr(run, "_start", start)
    assert main([]) == 0
    assert main(["demo", "bravo"]) == 0
    assert started[0] == started[1]
    assert started[0] == (
        "bravo",
        False,
        {
            "seed": None,
            "robots": None,
            "density": None,
            "no_walls": False,
            "threads": None,
            "seconds": None,
            "as_json": False,
            "quiet": False,
            "speed": None,
            "running": None,
            "port": DEFAULT_PORT,
            "host": "127.0.0.1",
            "insecure": False,
            "allow": (),
            "no_browser": False,
            "alerts": (),
            "past": None,
            "record": None,
            "record_pictures": None,
            "record_readings": None,
            "record_rotate": None,
            "from_": None,
            "snapshot": None,
            "snapshot_at": None,
            "journal": None,
        },
    )


def test_a_port_in_use_is_told_and_another_offered() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        done = called("demo", "--no-browser", "--port", str(port), "--robots", "5")
    assert (done.status, done.out) == (1, "")
    assert done.err.startswith(f"port {port} of 127.0.0.1 is in use")
    assert "--port" in done.err


def test_a_browser_that_cannot_be_opened_leaves_the_address(tmp_path: Path) -> None:
    # Nothing on the path is a browser, and the one that is wanted is not there.
    environment = {"BROWSER": f"{tmp_path}/browser %s", "DISPLAY": ":99", "PATH": str(tmp_path)}
    with terminal(["demo", "--port", "0", "--robots", "5"], tmp_path, environment) as screen:
        screen.wait_for("Open this address in a browser on this machine:")
        screen.wait_for("http://127.0.0.1:")
        screen.wait_for("Ctrl-C ends it.")
        screen.interrupt()
        assert screen.status() == 130
        assert "Traceback" not in screen.screen


def test_the_options_have_the_bounds_of_the_page() -> None:
    assert (run.PORT, run.SLOWEST, run.FASTEST) == (DEFAULT_PORT, MIN_FACTOR, MAX_FACTOR)


def test_the_page_shows_where_the_robots_are(tmp_path: Path) -> None:
    from array import array

    built, _ = assemble(small(tmp_path), 1, mission=False)
    shown = SwarmAdapter(built)
    shown.step()
    poses = array("f", shown.poses())
    simulator = built.simulator
    assert len(poses) == 60
    assert poses[0::3].tolist() == pytest.approx(simulator.x.tolist(), rel=1e-6)
    assert poses[1::3].tolist() == pytest.approx(simulator.y.tolist(), rel=1e-6)
    assert poses[2::3].tolist() == pytest.approx(simulator.bodies.heading.tolist(), rel=1e-6)
    assert (shown.tick, shown.now()) == (1, pytest.approx(0.1))
    assert list(shown.minds) == list(shown.scene.names)


def test_the_page_shows_what_is_solid_where_a_snapshot_goes_on() -> None:
    """Not what stood there when the scenario began."""
    built, _ = assemble(find_scenario("crowd", Changes(robots=40)), None, mission=False)
    world = built.simulator.world
    for number in list(world.shapes):
        world.remove(number)
    world.add(Wall(((1.0, 1.0), (2.0, 1.0))))
    built.step()
    shown = SwarmAdapter(resume(snapshot(built)))
    assert shown.scene.obstacles == ((((1.0, 1.0), (2.0, 1.0)),),)
    assert shown.obstacles() is None


def test_the_scene_has_the_lights() -> None:
    built, _ = assemble(find_scenario("braitenberg"), None, mission=False)
    scene = SwarmAdapter(built).scene
    assert [(light.name, light.x, light.y) for light in scene.lights] == [("the lamp", 140.0, 80.0)]
    assert scene.places == ()


def test_the_outcome_for_people_tells_the_measures() -> None:
    out = called("run", "braitenberg", "--seconds", "20", "--seed", "1").out
    assert re.search(r"^  distance_to_light: 60\.\d+ m at the start, \d+\.\d+ m after 20 s$", out, re.MULTILINE)
    assert "  radius_of_gyration: 3." in out


def test_the_scene_is_the_scenario() -> None:
    scenario = find_scenario("bravo")
    built, station = assemble(scenario, None, mission=False)
    scene = SwarmAdapter(built).scene
    assert scene.noun == "scouts"
    assert scene.area == (0.0, 0.0, scenario.width, scenario.height)
    assert scene.places[0].name == "vessel X"
    assert [command.text for command in scene.commands] == [command.text.strip() for command in scenario.commands]
    for command in scene.commands:
        assert station.check(command.text).findings == ()


def test_a_run_says_once_what_robots_sense_through_walls_for_its_format(tmp_path: Path) -> None:
    more = '\n[world.rooms]\nsize = "400m"\ndoor = "9m"\n\n[pings]\nreach = "9m"\n\n[neighbours]\nreach = "9m"\n'
    file = write(tmp_path, more=more)
    first = called_warm("run", str(file), "--seconds", "1", "--json")
    assert first.err == (
        f"{file} is of format 1: robots sense pings and neighbours through walls. With format = 2 walls hide them\n"
    )
    write(tmp_path, ("format = 1", "format = 2"), more=more)
    assert called_warm("run", str(file), "--seconds", "1", "--json").err == ""
