"""The command itself: how it starts, what it says to mistakes, and how it ends."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from cli.calling import LONGEST
from packages import install
from sleepcast.cli import COMMANDS, main
from sleepcast.core.extensions import BUILT_IN
from sleepcast.core.version import VERSION

QUICK = 0.150
"""Seconds of work for the smallest job, the start of Python included, on a machine that has little else to do."""
REFERENCE, REFERENCE_SECONDS = "import asyncio, http.client, xml.dom.minidom", 0.070
"""A part of Python's own library, and the seconds of work that its start takes on such a machine."""
SLEEPCAST = [sys.executable, "-m", "sleepcast"]
ALL = [*COMMANDS, *BUILT_IN["sleepcast.commands"]]
"""Commands of a sleepcast to which no package adds any."""


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"sleepcast {VERSION}\n"


def test_help_lists_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    page = capsys.readouterr().out
    listed = [line.split()[0] for line in page.partition("Commands:")[2].splitlines() if line.strip()]
    assert listed == ALL


def test_to_list_the_commands_imports_none_of_them() -> None:
    """Of sleepcast, too: this is why the page of all commands is as quick as that of one."""
    program = "import sys; from sleepcast.cli import main; main(['--help']); print(*sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    loaded = {name for name in done.stderr.split() if name.startswith("sleepcast.")}
    assert {name for name in loaded if name.startswith("sleepcast.cli.")} == {
        "sleepcast.cli.interrupts",
        "sleepcast.cli.streams",
    }
    assert "importlib.metadata" not in done.stderr.split()


def test_a_package_adds_a_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    good = "import click\n@click.command()\ndef mow():\n    print('mown')\n    return 3\nnone = 7\n"
    points = "[sleepcast.commands]\nmow = good_lawn:mow\nbroken = broken_lawn:mow\nnone = good_lawn:none\n"
    install(tmp_path, monkeypatch, "lawn-bots", points, good_lawn=good, broken_lawn="1 / 0")
    assert main(["--help"]) == 0
    assert "  mow             Of the package lawn-bots.\n" in capsys.readouterr().out
    assert main(["mow"]) == 3
    assert capsys.readouterr() == ("mown\n", "")
    assert main(["broken"]) == 2
    assert capsys.readouterr() == (
        "",
        'command "broken" of the package lawn-bots cannot be loaded: ZeroDivisionError: division by zero\n',
    )
    assert main(["none"]) == 2
    assert capsys.readouterr() == ("", 'command "none" of the package lawn-bots is no click.Command but 7\n')
    assert main(["moww"]) == 2
    assert "unknown command 'moww' (did you mean mow?)" in capsys.readouterr().err


@pytest.mark.parametrize("command", ALL)
def test_help_of_every_command_has_examples(capsys: pytest.CaptureFixture[str], command: str) -> None:
    assert main([command, "--help"]) == 0
    page = capsys.readouterr().out
    examples = page.partition("Examples:\n")[2].splitlines()
    assert any(line.strip().startswith(("sleepcast", "echo")) for line in examples)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["evl", "1"], "unknown command 'evl' (did you mean eval?)"),
        (["frobnicate"], "unknown command 'frobnicate': commands are demo, run,"),
        (["bravo"], "unknown command 'bravo' (did you mean sleepcast demo bravo?)"),
        (["replay", "none.mcap"], "cannot read none.mcap: No such file or directory"),
        (["eval", "--dialct", "classic", "1"], "--dialect"),
        (["--vresion"], "--version"),
        (["eval"], "Missing argument 'EXPR...'"),
        (["run"], "no scenario given"),
        (["eval", "--dialect", "klassik", "1"], "'standard', 'classic', 'faithful', 'appendix-a'"),
        (["eval", "--seed", "x", "1"], "--seed"),
        (["demo", "--port", "70000"], "--port"),
        (["demo", "bravo", "more"], "more"),
        (["demo", "--speed", "nan"], "wanted a number, not 'nan'"),
        (["node", "--tick", "nan"], 'wanted a time such as "30s", not "nan"'),
        (["swarm", "3", "--seconds", "nan"], 'wanted a time such as "30s", not "nan"'),
        (["nserver", "--speed", "nan"], "wanted a number, not 'nan'"),
    ],
)
def test_misuse_is_told_with_what_might_be_meant(
    capsys: pytest.CaptureFixture[str], arguments: list[str], words: str
) -> None:
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert words in captured.err


def test_the_smallest_job_starts_fast() -> None:
    """Measured as the work of a process of its own, against the start of a part of Python: where other work keeps the
    memory and the cores busy, both take longer."""
    times = [(work(*SLEEPCAST, "eval", "(+ 1 2)"), work(sys.executable, "-c", REFERENCE)) for _ in range(7)]
    job, reference = (min(column) for column in zip(*times, strict=True))
    limit = QUICK * max(1.0, reference / REFERENCE_SECONDS)
    assert job < limit, f"sleepcast eval '(+ 1 2)' takes {job * 1000:.0f} ms, wanted at most {limit * 1000:.0f}"


def work(*command: str) -> float:
    """Seconds of the processor that a command takes, its own start included."""
    call = f"subprocess.run({command!r}, stdout=subprocess.DEVNULL, check=True)"
    used = "resource.getrusage(resource.RUSAGE_CHILDREN)"
    code = f"import resource, subprocess; {call}; used = {used}; print(used.ru_utime + used.ru_stime)"
    usual = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return float(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, env=usual).stdout)


@pytest.mark.parametrize(
    ("arguments", "unwanted"),
    [
        (["eval", "(+ 1 2)"], {"numpy", "rich", "starlette", "uvicorn", "prompt_toolkit", "asyncio"}),
        (["check", "(+ 1 2)"], {"numpy", "rich", "starlette", "uvicorn", "prompt_toolkit", "asyncio"}),
        (["--help"], {"numpy", "rich", "starlette", "uvicorn", "prompt_toolkit", "asyncio", "sleepcast.language"}),
        (
            ["demo", "--headless", "--seconds", "0.1", "--robots", "2"],
            {"rich", "starlette", "uvicorn", "prompt_toolkit"},
        ),
    ],
)
def test_a_job_loads_only_what_it_needs(arguments: list[str], unwanted: set[str]) -> None:
    code = (
        "import sys\nfrom sleepcast.cli import main\n"
        f"status = main({arguments!r})\nprint(*sys.modules, file=sys.stderr)\nsys.exit(status)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=LONGEST, check=True)
    assert not unwanted & set(done.stderr.split())


# ---- streams that are not there


def test_a_reader_that_goes_away_ends_it_quietly() -> None:
    many = ["1"] * 50_000
    with subprocess.Popen([*SLEEPCAST, "eval", *many], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline() == b"1\n"
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait(LONGEST) == 141


def test_closed_standard_output_is_told() -> None:
    done = subprocess.run(
        ["sh", "-c", f"exec {sys.executable} -m sleepcast eval '(+ 1 2)' >&-"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr.startswith("standard output is closed")
    assert "Traceback" not in done.stderr


def test_closed_standard_input_is_told() -> None:
    for arguments in ("eval -", "check -", "repl"):
        done = subprocess.run(
            ["sh", "-c", f"exec {sys.executable} -m sleepcast {arguments} <&-"],
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 2
        assert done.stderr.startswith("standard input is closed")


def test_closed_standard_error_does_no_harm() -> None:
    done = subprocess.run(
        ["sh", "-c", f"exec {sys.executable} -m sleepcast eval '(/ 1 0)' 2>&-"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (1, "UNKNOWN\n")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has a device that is always full")
def test_a_full_disk_is_told() -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run([*SLEEPCAST, "eval", "1"], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == "cannot write the output: No space left on device\n"


def test_any_label_prints_whatever_the_encoding() -> None:
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run(
        [*SLEEPCAST, "eval", '(REPORT "größe" 1)', "lost", "(+ é 1)"], capture_output=True, env=environment, check=False
    )
    assert done.stdout == b"1\nUNKNOWN\n"
    assert b"gr\\xf6\\xdfe: 1" in done.stderr
    assert b"Traceback" not in done.stderr


ENDING = """
import atexit, gc, sys
from sleepcast.__main__ import start

atexit.register(lambda: print(gc.get_freeze_count() > 1_000))
sys.argv[1:] = ["eval", "(+ 1 2)"]
sys.exit(start())
"""


def test_nobody_looks_for_garbage_at_the_end() -> None:
    """Of a process that has simulated it takes a quarter of a second."""
    done = subprocess.run([sys.executable, "-c", ENDING], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("3\nTrue\n", "")


THREADS = """
import atexit, sys, threading
from concurrent.futures import ThreadPoolExecutor
from sleepcast.__main__ import run

class Left:
    def __del__(self):
        print("taken apart")

def work():
    threading.main_thread().join()
    print("worked")

left, pool = Left(), ThreadPoolExecutor(1)
pool.submit(int).result()
threading.Thread(target=work).start()
atexit.register(print, "told")
sys.argv[1:] = ["eval", "(+ 1 2)"]
run()
"""


def test_threads_that_work_are_waited_for_and_nothing_is_taken_apart() -> None:
    """A run has a thread that compiles, and that has nothing to do at the end."""
    done = subprocess.run([sys.executable, "-c", THREADS], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr, done.returncode) == ("3\nworked\ntold\n", "", 0)


HEADLESS = """
import sys
import sleepcast.cli.headless
heavy = {"nacl", "cbor2", "rich", "prompt_toolkit", "starlette", "uvicorn", "mcap", "numba", "llvmlite"}
print(sorted(heavy & sys.modules.keys()), [name for name in sys.modules if name.startswith("sleepcast.node")])
later = {"loop.snapshots", "fleet.snapshot", "simulator.snapshot", "language.codegen", "simulator.world.ros_map"}
print(sorted(name for name in later if f"sleepcast.{name}" in sys.modules))
"""


def test_a_run_without_a_page_loads_neither_nodes_nor_what_others_need() -> None:
    done = subprocess.run([sys.executable, "-c", HEADLESS], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("[] []\n[]\n", "")
