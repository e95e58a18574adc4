"""What `sleepcast send` costs the desk's computer, with many robots that answer: processor time of its process.

The robots are those of `sleepcast swarm`, in a process of its own that does not count. The desk asks them for
telemetry, finds out who would obey, sends, and hears the answers; what it takes to start is measured with `who --told`,
which does all but ask and send. As on a computer where sleepcast is installed, its modules are compiled beforehand.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from tempfile import TemporaryDirectory
from unittest import mock

from benchmarks.channel.proofs import Proof, middle
from benchmarks.report import Bar, number
from sleepcast.api.progress import steps

SHORT = "(WHEN (> id 0) (MARK))"
LONG = (
    f"(WHEN (AND (> id 0) {' '.join(f'(OR (> x -{k}km) (< (DIST x y {k}m 0m) 900km))' for k in range(1, 41))}) (MARK))"
)
"""Eighty tests, all of which are evaluated on what each robot has told."""
BAR = 0.5
"""Milliseconds for each robot, which speaks twice: with a thousand, a command takes a quarter of a processor's time in
the two seconds that it lasts. To verify two signatures takes 0.08."""


def sending(robots: int, times: int) -> Proof:
    """So many sendings of each text, to so many robots."""
    took: dict[str, list[float]] = {name: [] for name in ("start", "one test", "eighty tests")}
    answered: list[int] = []
    with TemporaryDirectory() as home, mock.patch.dict(os.environ, _at_home(home)), _swarm(robots) as channel:
        _cpu("roster", "--expect", str(robots), "--channel", channel)
        _cpu("send", SHORT, "--count", str(robots), "--json", "--channel", channel)
        for _ in steps(times, "sending", quiet=False):
            took["start"].append(_cpu("who", "--told", SHORT, "--channel", channel)[0])
            for name, text in (("one test", SHORT), ("eighty tests", LONG)):
                cpu, said = _cpu("send", text, "--count", str(robots), "--json", "--channel", channel)
                took[name].append(cpu)
                answered.append(json.loads(said)["n_matched"])
    rows = [[name, *map(number, (min(each), middle(each), max(each)))] for name, each in took.items()]
    each = 1e3 * (middle(took["one test"]) - middle(took["start"])) / robots
    bar = Bar("processor time of the desk for each robot, besides its start", each, BAR, "ms", at_least=False)
    note = f"{robots:,} robots, of which {middle(answered):,} answered (middle); seconds of processor time"
    return Proof("sending", ["", "least", "middle", "most"], rows, [bar], note)


def _at_home(home: str) -> dict[str, str]:
    folders = {"HOME": home, "XDG_CONFIG_HOME": f"{home}/config", "XDG_DATA_HOME": f"{home}/data"}
    return folders | {"PYTHONPYCACHEPREFIX": f"{home}/compiled", "PYTHONDONTWRITEBYTECODE": ""}


@contextmanager
def _swarm(robots: int) -> Iterator[str]:
    """The channel of robots that are up."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        channel = f"udp://239.255.83.78:{free.getsockname()[1]}?interface=lo"
    command = [sys.executable, "-m", "sleepcast", "swarm", str(robots), "--channel", channel]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        assert process.stdout is not None
        process.stdout.readline()  # that they are up
        try:
            yield channel
        finally:
            process.kill()


def _cpu(*arguments: str) -> tuple[float, str]:
    """Seconds of processor time of one command, and what it printed."""
    command = [sys.executable, "-m", "sleepcast", *arguments]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert process.stdout is not None
    said = process.stdout.read()
    _, _, used = os.wait4(process.pid, 0)
    return used.ru_utime + used.ru_stime, said
