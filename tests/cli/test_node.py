"""`sleepcast node` against the real server: rules, datagrams, what is typed, both vocabularies, and how it ends."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import TextIOWrapper
from pathlib import Path
from threading import Event, Thread

import pytest

from cli.calling import LONGEST, called, called_here
from nomad.serving import Served, empty_room, serving
from sleepcast.channel.plain_datagrams import Datagrams, send
from sleepcast.cli import main
from sleepcast.cli.node_life import install, read_start_script
from sleepcast.language import Vocabulary
from sleepcast.node.node import Node
from sleepcast.nomad.world.nomad_world import NomadWorld


@pytest.fixture
def world() -> NomadWorld:
    return empty_room()


@pytest.fixture
def stepped(world: NomadWorld) -> Iterator[Served]:
    with serving(world, lockstep=True, headless=True) as served:
        yield served


def until(true: Callable[[], object]) -> None:
    deadline = time.monotonic() + LONGEST
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.fixture
def call(stepped: Served, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run a node in step for some simulated time, in this process, with expressions in a file."""

    def calling(rules: str | None, *options: str, seconds: float = 3.0) -> tuple[int, str, str]:
        file = tmp_path / "rules.sleep"
        given = ("--lockstep", "--seconds", str(seconds), *options)
        if rules is not None:
            file.write_text(rules, encoding="utf-8")
            given = (*given, "--rules", str(file))
        status = main(["node", "--body", f"nomad://127.0.0.1:{stepped.port}#1", *given])
        captured = capfd.readouterr()
        return status, captured.out, captured.err.replace(f"{tmp_path}/", "")

    return calling


Call = Callable[..., tuple[int, str, str]]

ROAM = """; a first line that says something
(RULE roam (COND
  ((< front_range 15in) (VM -0.1m/s 0.1m/s))
  (TRUE (VM 0.4m/s 0.4m/s))))
(RULE say (WHEN (= tick 20) (REPORT "speed" speed)))
"""


def test_rules_of_a_file_drive_the_body(call: Call, world: NomadWorld) -> None:
    status, out, err = call(ROAM)
    assert status == 0, err
    assert out == "r1 is up, with 2 rules; Ctrl-C stops its body and ends it\nr1: speed: 0.39878\n"
    assert err == "r1: 30 ticks, 0 late; its body has been stopped\n"
    assert world.observe(0).real.x > 0.8


def test_the_vocabulary_nomad_takes_tenths_of_inches(call: Call, stepped: Served) -> None:
    status, _, err = call("(PROGN (VM 75 50) (DP 100 -50) (DA 900) (CONF_SN 6 0 2 15))", "--vocabulary", "nomad")
    assert status == 0, err
    commands = [text for _, text in stepped.nserver.windows.robots[0].commands]
    assert "vm(75, 50, 0)" in commands
    assert "dp(100, -50)" in commands
    assert "da(900, 900)" in commands
    assert "conf_sn(6, 0, 2, 15, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255)" in commands


def test_orders_come_at_their_times(call: Call) -> None:
    script = '@0.5s (PROGN (REPORT "a" time)\n  (VM 0.1m/s 0.1m/s))\n@1s STOP\n@1.5s (UNHEARD 1)\n@2s (TELL (ST))\n'
    status, out, err = call(script, "--name", "scout-7")
    assert status == 0
    assert "scout-7: a: 0.5" in out
    assert "scout-7: stopped" in out
    assert "scout-7: fault, unknown" in out
    assert "tells others, whom nobody reaches from here: (ST)" in out
    assert "scout-7: " in err
    assert "UNHEARD" in err


def test_plain_datagrams_become_variables(
    world: NomadWorld, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with Datagrams("127.0.0.1", 0) as free:
        port = free.port
    rules = tmp_path / "rules.sleep"
    rules.write_text(
        '(DEFVAR m1 7) (IF message UNKNOWN (REPORT "at first" message m1))\n'
        '(RULE obey (WHEN message (PROGN (REPORT "got" m0 m1 m2) (SETQ message FALSE))))'
    )

    def play() -> None:
        send((1.25, -2.0, 3.0), ("127.0.0.1", port))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.sendto(b"(VM 1 1)", ("127.0.0.1", port))
        send((4.0, 5.0, 6.0), ("127.0.0.1", port))

    with serving(world, speed=1.0, headless=True) as served, once_it_listens(monkeypatch, play):
        body = f"nomad://127.0.0.1:{served.port}#1"
        options = ("--seconds", "3", "--rules", str(rules), "--datagrams", str(port))
        status = main(["node", "--body", body, *options])
    out, err = capfd.readouterr()
    assert status == 0, err
    assert "r1: at first: 0 7" in out
    assert [line for line in out.splitlines() if "got" in line] == ["r1: got: 1.25 -2 3", "r1: got: 4 5 6"]
    assert "; 2 datagrams, 1 others dropped; its body has been stopped" in err


@contextmanager
def once_it_listens(monkeypatch: pytest.MonkeyPatch, play: Callable[[], None]) -> Iterator[None]:
    """Call `play` as soon as a node of this process has its port. (To look whether it is taken would take it.)"""
    listens = Event()

    class Listening(Datagrams):
        def __init__(self, host: str, port: int) -> None:
            super().__init__(host, port)
            listens.set()

    def watch() -> None:
        assert listens.wait(LONGEST)
        play()

    monkeypatch.setattr("sleepcast.channel.plain_datagrams.Datagrams", Listening)
    thread = Thread(target=watch)
    thread.start()
    try:
        yield
    finally:
        thread.join(LONGEST)


def test_lines_that_are_typed_are_commands(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    reading, writing = os.pipe()
    os.write(writing, b'(REPORT "typed"\n\n  (+ 1 2))\n; nothing\nSTOP\nrelease\n(SETQ\xff 1)\n(unfinished')
    os.close(writing)
    with TextIOWrapper(os.fdopen(reading, "rb")) as typed:
        monkeypatch.setattr(sys, "stdin", typed)
        status, out, err = call(None)
    assert status == 0
    assert "r1: typed: 3\n" in out
    assert "r1: stopped, and at rest until RELEASE\nr1: released, and free to be moved again\n" in out
    assert out.count("r1: fault, unknown") == 2
    assert err.count("r1: ") == 3  # two faults and the end


@pytest.mark.parametrize(
    ("rules", "options", "status", "said"),
    [
        ("(RULE a (VM 1))", (), 2, "rules.sleep:1: "),
        ("(ST)\n(+ 1", (), 2, "rules.sleep:2: "),
        ("(SETQ x 1)", (), 2, "rules.sleep:1: "),
        ("(PROGN (+ 1 (SETQQ E0 1)))", (), 2, "rules.sleep:1: "),
        ("@soon (ST)", (), 2, "rules.sleep:1: wanted a time"),
        (None, ("--name", "a b"), 2, "--name 'a b': wanted 1 to 64 characters"),
        (None, ("--body", "nomat://127.0.0.1"), 2, "did you mean nomad"),
        (None, ("--body", "nomad://127.0.0.1:1#1"), 1, "no server listens at 127.0.0.1:1"),
        (None, ("--rules", "/nowhere/rules.sleep"), 2, "there is no file"),
        (None, ("--datagrams", "5001", "--host", "no such host"), 1, "'no such host' is not an address to listen on"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(
    call: Call, rules: str | None, options: tuple[str, ...], status: int, said: str
) -> None:
    ended, out, err = call(rules, *options)
    assert (ended, out) == (status, "")
    assert said in err
    assert "Traceback" not in err


def test_golden_rules_are_nobodys_to_change(call: Call, tmp_path: Path, world: NomadWorld) -> None:
    golden = tmp_path / "golden.sleep"
    golden.write_text("; what keeps it slow\n(RULE slow (VM 0.1m/s 0.1m/s))", encoding="utf-8")
    script = "@0.3s (FORGET slow)\n@0.6s (RULE slow (VM 0.5m/s 0.5m/s))\n@0.9s (ROLLBACK)\n"
    status, out, err = call(script, "--golden", str(golden))
    assert (status, out.count("r1: fault, unknown")) == (0, 2), err
    assert err.count("slow is built in: it cannot be changed over the air") == 2
    assert world.observe(0).real.x == pytest.approx(0.29, abs=0.05)


def test_golden_rules_may_come_above_all_from_the_air(tmp_path: Path) -> None:
    golden = tmp_path / "golden.sleep"
    golden.write_text("(RULE keep (SETQ n 7) :priority 1)\n(RULE low 1)", encoding="utf-8")
    node = Node("r", Vocabulary())
    node.evaluate("(DEFVAR n 0)")
    install(node, read_start_script(golden))
    assert [(rule.name, rule.priority, rule.protected) for rule in node.rules()] == [
        ("keep", 1, True),
        ("low", 0, True),
    ]
    node.evaluate("(RULE late (SETQ n 1))")
    node.think(1, 0.1)
    assert dict(node.variables())["n"] == 7.0


@pytest.mark.parametrize(
    ("golden", "said"),
    [
        ("(VM 1 1)", "golden.sleep:1: wanted (RULE name expression), not '(VM 1 1)'"),
        (
            "(RULE a 1 :priority 10)",
            "golden.sleep:1: RULE stores one expression: what follows it can only be :priority",
        ),
        ("(RULE a)", "golden.sleep:1: wanted (RULE name expression), not '(RULE a)'"),
        ("\n(RULE a (SETQ x 1))", "golden.sleep:2: "),
        ("@1s (RULE a 1)", "golden.sleep is a mission script: locked rules have no times"),
    ],
)
def test_what_is_no_golden_rule_is_refused(call: Call, tmp_path: Path, golden: str, said: str) -> None:
    (tmp_path / "golden.sleep").write_text(golden, encoding="utf-8")
    status, out, err = call(None, "--golden", str(tmp_path / "golden.sleep"))
    assert (status, out) == (2, "")
    assert said in err


def test_a_node_goes_on_from_its_store(call: Call, tmp_path: Path) -> None:
    store = ("--store", str(tmp_path / "r1.store"))
    status, out, err = call("(DEFVAR n 0)\n(RULE count (SETQ n (+ n 1)))", *store)
    assert status == 0, err
    status, out, err = call('@0.1s (REPORT "n" (> n 25))\n@0.2s (FORGET count)', *store, seconds=0.5)
    assert status == 0, err
    assert "r1 is up, with 1 rule" in out
    assert "r1: n: 1\n" in out
    assert err.startswith("r1 goes on where it was (r1.store)\n")
    status, out, err = call("(RULE other 1)", *store, seconds=0.1)
    assert "r1 is up, with 0 rules" in out, "what a robot begins with is for its first life"


def test_a_server_in_step_that_goes_away_ends_the_node(world: NomadWorld, capfd: pytest.CaptureFixture[str]) -> None:
    with serving(world, lockstep=True, headless=True) as served:
        ending = Thread(target=lambda: (until(lambda: world.time > 2.0), served.end()))
        ending.start()
        status = main(["node", "--body", f"nomad://127.0.0.1:{served.port}", "--lockstep"])
        ending.join(LONGEST)
    captured = capfd.readouterr()
    assert status == 1
    assert "see whether it is still running" in captured.err
    assert "its body is out of reach" in captured.err
    assert "has been stopped" not in captured.err


def test_a_node_finds_its_server_again_with_its_body_at_rest(world: NomadWorld, tmp_path: Path) -> None:
    rules = tmp_path / "go.sleep"
    rules.write_text("(WHEN TRUE (VM 0.3m/s 0.3m/s))", encoding="utf-8")  # once, and no rule
    with serving(world, speed=1.0, headless=True) as served:
        port = served.port
        uri = f"nomad://127.0.0.1:{port}#1"
        process = subprocess.Popen(
            [sys.executable, "-c", START, "node", "--body", uri, "--rules", rules],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        try:
            until(lambda: world.observe(0).speeds[0] > 0.2)
            served.end()
            assert "the body is out of reach: " in process.stderr.readline()
            process.stdin.write("(VM 0.1m/s 0.1m/s)\n(PROGN 7)\n")
            process.stdin.flush()
            said = [process.stdout.readline() for _ in range(3)]
            assert said[2] == "r1: matched, 7\n", said  # the mind lives on
            assert "the body is out of reach, and does nothing" in process.stderr.readline()
            anew = empty_room()
            with serving(anew, speed=1.0, headless=True, port=port):
                line = process.stderr.readline()
                while "within reach" not in line:
                    assert "no server listens" in line
                    line = process.stderr.readline()
                began = anew.time
                until(lambda: anew.time > began + 1.0)
                assert anew.observe(0).speeds[0] == 0.0, "nothing old resumes"
                process.stdin.write("(VM 0.1m/s 0.1m/s)\n(KNOWN front_range)\n")
                process.stdin.flush()
                until(lambda: anew.observe(0).speeds[0] > 0.05)
                assert [process.stdout.readline() for _ in range(2)][1] == "r1: matched, 1\n"  # it sees again
            assert "the body is out of reach: " in process.stderr.readline()
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=LONGEST)
        finally:
            process.kill()
            process.communicate()
        assert process.returncode == 130, err
        assert "its body is out of reach" in err
        assert "has been stopped" not in err


def test_ctrl_c_stops_the_body_and_ends_it(world: NomadWorld, tmp_path: Path) -> None:
    rules = tmp_path / "go.sleep"
    rules.write_text("(RULE go (VM 0.3m/s 0.3m/s))", encoding="utf-8")
    with serving(world, speed=1.0, headless=True) as served:
        process = subprocess.Popen(
            [sys.executable, "-c", START, "node", "--body", f"nomad://127.0.0.1:{served.port}#1", "--rules", rules],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            until(lambda: world.observe(0).speeds[0] > 0.2)
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=LONGEST)
        finally:
            process.kill()
        assert process.returncode == 130, err
        assert "r1 is up, with 1 rule;" in out
        assert err.strip().endswith("its body has been stopped")
        assert "st()" in [text for _, text in served.nserver.windows.robots[0].commands][-1]
        until(lambda: world.observe(0).speeds[:2] == (0.0, 0.0))


START = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
from sleepcast.__main__ import start
sys.exit(start())
"""


def test_a_body_in_the_simulator_with_limits(tmp_path: Path) -> None:
    limits = tmp_path / "limits.toml"
    limits.write_text('speed = "2m/s"\n[fence]\nx = ["100m", "130m"]\ny = ["100m", "130m"]\n')
    rules = tmp_path / "go.sleep"
    rules.write_text('@0s (DRIVE 99 0)\n@5s (REPORT "speed" speed)\n@59s (REPORT "place" x y speed id)\n')
    arguments = ("--body", "sim", "--name", "r7", "--lockstep", "--seconds", "60", "--limits", str(limits))
    found = called("node", *arguments, "--rules", str(rules))
    assert found.status == 0, found.err
    speed = next(line for line in found.out.splitlines() if line.startswith("r7: speed"))
    assert 0.0 <= float(speed.split()[-1]) <= 2.0
    x, y, still, number = map(float, next(line for line in found.out.splitlines() if "place" in line).split()[-4:])
    assert 100.0 <= x <= 130.0
    assert 100.0 <= y <= 130.0
    assert (still, number) == (0.0, 7.0), "it stands at the fence"


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("--body", "sim:brav"), "bravo"),
        (("--body", "sym:bravo"), "sim:bravo"),
        (("--body", "sim", "--vocabulary", "nomad"), "no --vocabulary"),
        (("--body", "sim", "--lease", "0"), "or off"),
    ],
)
def test_what_is_no_body_in_the_simulator(
    arguments: tuple[str, ...], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    refused = called_here(capsys, "node", *arguments)
    assert (refused.status, refused.out) == (2, "")
    assert complaint in refused.err
