"""A Nomad's program on another computer, which is cut off: its robot stops."""

from __future__ import annotations

import subprocess
import sys
from threading import Timer

import pytest
from benchmarks.channel.lab import PATIENCE, Lab, why_not

REASON = why_not()
ADDRESS = "10.83.0.1"
SERVE = ("-m", "sleepcast", "nserver", "--headless", "--robots", "2", "--host", "0.0.0.0")
DRIVE = """
import sys
from sleepcast.nomad.client.nomad import Nomad
address, robot, how = sys.argv[1:]
nomad = Nomad.connect(address, robot=int(robot))
nomad.vm(10, 10)
print("drives", flush=True)
while how == "asking":
    nomad.gs()
sys.stdin.read()
"""


@pytest.mark.skipif(bool(REASON), reason=f"no networks of our own here: {REASON}")
def test_programs_that_are_cut_off_leave_their_robots_at_rest() -> None:
    pipe = subprocess.PIPE
    with Lab(["server", "programs"]) as lab:
        server = lab.start("server", sys.executable, *SERVE, stdout=pipe, stderr=pipe)
        assert server.stdout is not None
        assert server.stderr is not None
        assert "port 7019" in server.stdout.readline()
        for robot, how in (("1", "asking"), ("2", "silent")):
            command = (sys.executable, "-c", DRIVE, ADDRESS, robot, how)
            program = lab.start("programs", *command, stdin=pipe, stdout=pipe)
            assert program.stdout is not None
            assert program.stdout.readline() == "drives\n"
        lab.cut("programs")
        watchdog = Timer(3 * PATIENCE, server.kill)
        watchdog.start()
        left = {"robot 1 is stopped", "robot 2 is stopped"}
        for line in server.stderr:
            left -= {line.strip().rpartition("disconnect_robot: ")[2]}
            if not left:
                break
        watchdog.cancel()
        assert not left
