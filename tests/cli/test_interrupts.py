"""Ctrl-C at any moment: while libraries load, kernels are compiled, or a run goes on and is recorded."""

from __future__ import annotations

import select
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from cli.calling import LONGEST
from processes import start
from sleepcast.core.errors import SleepcastError
from sleepcast.loop import load, resume
from sleepcast.simulator.recording.recording import load_recording
from small_worlds import write

START = """
import sys
from sleepcast.__main__ import start
print("up", flush=True)
sys.exit(start())
"""
"""The program, which says when it begins: what Python itself does before is not ours."""


def begin(*arguments: str | Path, **changes: str) -> subprocess.Popen[str]:
    """The program. changes: of its environment."""
    process = start(sys.executable, "-c", START, *arguments, **changes)
    assert process.stdout is not None
    assert process.stdout.readline() == "up\n"
    return process


def wait_for(file: Path, seconds: float) -> None:
    """Wait until so many simulated seconds are recorded."""
    deadline = time.monotonic() + LONGEST
    while time.monotonic() < deadline:
        with suppress(SleepcastError):  # it is about to be
            if load_recording(file).seconds >= seconds:
                return
        time.sleep(0.1)
    raise AssertionError(f"{seconds} s of {file} did not come")


def end(process: subprocess.Popen[str]) -> str:
    """Press Ctrl-C; gives what was said on standard error, the exit status being that of Ctrl-C."""
    process.send_signal(signal.SIGINT)
    try:
        out, err = process.communicate(timeout=LONGEST)
    finally:
        process.kill()
    assert (process.returncode, out) == (130, ""), err
    assert "Traceback" not in err
    return err.strip()


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where kernels are kept: each run goes on compiling where the one before was ended, until they are all there."""
    return tmp_path_factory.mktemp("kernels")


@pytest.mark.parametrize(
    "delay",
    [
        pytest.param(delay, marks=pytest.mark.nightly if at % 3 else ())
        for at, delay in enumerate([0.1, 0.4, 0.8, 1.3, 2.0, 2.5, 3.0, 3.5])
    ],
)
def test_a_run_that_compiles_its_kernels_ends_at_any_moment(delay: float, compiled: Path, tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    options = ("--robots", "40", "--seconds", "100000", "--record", file)
    process = begin("run", "crowd", *options, XDG_CACHE_HOME=str(compiled))
    time.sleep(delay)
    said = end(process)
    assert said in ("", "ended by Ctrl-C before anything had started") or said.startswith("ended by Ctrl-C at ")
    if file.exists():
        recording = load_recording(file)
        assert recording.complete
        assert recording.states


EARLY = """
import os, signal
import sleepcast.cli
from sleepcast.__main__ import run
sleepcast.cli.main = lambda: os.kill(os.getpid(), signal.SIGINT)
run()
"""


def test_pressed_just_before_the_command_minds_it_it_ends_the_program_as_ever() -> None:
    done = subprocess.run([sys.executable, "-c", EARLY], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "")


def test_a_run_says_where_it_ended_and_what_is_kept(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    options = ("--seconds", "100000", "--record", file)
    process = begin("run", write(tmp_path).parent, *options)
    wait_for(file, 5.0)
    said = end(process)
    recording = load_recording(file)
    assert recording.complete
    assert said == f"ended by Ctrl-C at {recording.seconds:g} s of simulated time; {file} holds what came before"


def test_a_verification_ends_as_well(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    process = begin("run", write(tmp_path).parent, "--seconds", "100000", "--record", file)
    wait_for(file, 5.0)
    time.sleep(3.0)  # so that to run it again takes some seconds as well
    end(process)
    process = begin("replay", file, "--verify")
    time.sleep(0.5)
    end(process)


def test_whoever_ignores_ctrl_c_is_obeyed(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "sleepcast", "run", str(write(tmp_path).parent), "--seconds", "500", "--json"]
    with subprocess.Popen(
        ["sh", "-c", 'trap "" INT; echo up; exec "$@"', "sh", *command], stdout=subprocess.PIPE
    ) as run:
        assert run.stdout is not None
        assert run.stdout.readline() == b"up\n"
        while not select.select([run.stdout], [], [], 0.05)[0]:
            run.send_signal(signal.SIGINT)
        assert b'"seconds":500.0' in run.stdout.read().replace(b" ", b"")
    assert run.returncode == 0


def test_a_run_that_is_to_be_kept_at_its_end_is_kept_where_it_ends(tmp_path: Path) -> None:
    file, kept = tmp_path / "run.mcap", tmp_path / "run.snap"
    options = ("--seconds", "100000", "--record", file, "--snapshot", kept)
    process = begin("run", write(tmp_path).parent, *options)
    wait_for(file, 2.0)
    assert end(process).endswith(f"; {file} holds what came before; go on with --from {kept}")
    assert resume(load(kept)).now() == pytest.approx(load_recording(file).seconds, abs=1e-6)


TWICE = """
import os, signal, sys
from sleepcast.cli import main
from sleepcast.fleet import Fleet
think = Fleet.think
def pressed_twice(fleet, tick, now, robots):
    if tick == 25:
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGINT)
    think(fleet, tick, now, robots)
Fleet.think = pressed_twice
sys.exit(main(sys.argv[1:]))
"""


def test_pressed_twice_within_a_tick_nothing_of_that_tick_is_kept(tmp_path: Path) -> None:
    file, kept = tmp_path / "run.mcap", tmp_path / "run.snap"
    kept.write_text("the old one")
    options = ["--robots", "30", "--seconds", "100", "--quiet", "--record", str(file), "--snapshot", str(kept)]
    command = [sys.executable, "-c", TWICE, "run", "crowd", *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LONGEST)
    assert done.returncode == 130
    assert "no snapshot was taken: the tick of 2.5 s was broken off" in done.stderr
    assert "ended by Ctrl-C at 2.5 s" in done.stderr
    assert "--from" not in done.stderr
    assert kept.read_text() == "the old one"
    recording = load_recording(file)
    assert recording.complete
    assert 25 not in recording.states, "the state of half a tick, to which nobody comes again"
