"""The round trip of one command, from the operator's text to a setpoint and back up to his account: the modules of
sleepcast that it enters.

    python -m benchmarks.path [--json] [swarm | air]

swarm: a desk and a simulated swarm in one process. air: a desk here and `sleepcast swarm 1` in a process of its own, on
UDP loopback; what both enter is united. A command like it goes the same way before, so that nothing is imported, set up
or compiled for the first time. What every one of several round trips enters is the way: a tick of the simulator counts,
and a clock measured or a message repaired meanwhile does not.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from socket import AF_INET, SOCK_DGRAM, socket
from tempfile import TemporaryDirectory
from types import FrameType
from unittest import mock

from benchmarks.report import table

WARM, *TRACED = (f'(WHEN (>= x 0) (SETQ drive_speed 0.{k}) (REPORT "here" x))' for k in (1, 2, 3, 4))
"""Each tests a reading, sets an actuator, answers and reports the reading."""
PATIENCE = 60.0
Entered = dict[str, str]
"""The function entered first in each module, in the order of their first entries."""


class Tracer:
    """Which modules of the package are entered by functions called, on all threads that begin after it was made."""

    def __init__(self) -> None:
        spec = find_spec("sleepcast")
        assert spec is not None
        assert spec.origin is not None
        self._folder = str(Path(spec.origin).parent) + os.sep
        self.entered: Entered = {}
        self.on = False
        threading.setprofile(self._called)
        sys.setprofile(self._called)

    def _called(self, frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if self.on and event == "call" and code.co_filename.startswith(self._folder) and code.co_name != "<module>":
            name = code.co_filename.removeprefix(self._folder).removesuffix(".py").replace(os.sep, ".")
            self.entered.setdefault(name, code.co_qualname)

    @contextmanager
    def tracing(self) -> Iterator[Entered]:
        """What is entered meanwhile."""
        self.begin()
        try:
            yield self.entered
        finally:
            self.on = False

    def begin(self) -> None:
        """Entries count from now on, and those before no more."""
        self.entered, self.on = {}, True


def entered_by_each(trips: Iterable[Entered]) -> Entered:
    """What none of the round trips went without, in the order of the first one."""
    first, *others = trips
    return {name: function for name, function in first.items() if all(name in other for other in others)}


def in_swarm() -> Entered:
    """The way in a simulated swarm."""
    from sleepcast.loop import Swarm
    from sleepcast.simulator import Simulator
    from sleepcast.simulator.scenario.scenario import find_scenario
    from sleepcast.station import Station

    tracer = Tracer()
    swarm = Swarm(Simulator(find_scenario("stop")))
    swarm.desk = station = Station(swarm.vocabulary, swarm.minds, swarm.post, swarm)

    def trip(text: str) -> None:
        command, reports = station.send(text), len(station.reports)
        while not station.accounting(command.id).complete or len(station.reports) == reports:
            swarm.step()

    def traced(text: str) -> Entered:
        with tracer.tracing() as entered:
            trip(text)
        return entered

    trip(WARM)
    return entered_by_each(map(traced, TRACED))


def on_air() -> Entered:
    """The way over UDP."""
    from sleepcast.api.connection import FLEET, AirOptions, station_for

    with socket(AF_INET, SOCK_DGRAM) as free, TemporaryDirectory() as home:
        free.bind(("127.0.0.1", 0))
        channel = f"udp://239.255.83.78:{free.getsockname()[1]}?interface=lo"
        settings = {"HOME": home, "XDG_CONFIG_HOME": f"{home}/config", "XDG_DATA_HOME": f"{home}/data"}
        with mock.patch.dict(os.environ, settings), Robot(channel) as robot:
            tracer = Tracer()
            with station_for(AirOptions(channel, FLEET, None, None, None), lambda _: None) as station:

                def trip(text: str) -> None:
                    command, reports = station.send(text), len(station.reports)
                    end = time.monotonic() + PATIENCE
                    while not station.accounting(command.id).matched or len(station.reports) == reports:
                        if time.monotonic() > end:
                            raise TimeoutError(f"no robot has answered and reported within {PATIENCE:g} s")
                        station.wait(0.05)

                def traced(text: str) -> Entered:
                    robot.begin()
                    with tracer.tracing() as entered:
                        trip(text)
                    return entered | {name: function for name, function in robot.end().items() if name not in entered}

                trip(WARM)
                return entered_by_each(map(traced, TRACED))


class Robot:
    """`sleepcast swarm 1` in a process of its own, which traces itself between two signals."""

    def __init__(self, channel: str) -> None:
        command = [sys.executable, "-m", "benchmarks.path", "robot", "swarm", "1", "--channel", channel]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)

    def __enter__(self) -> Robot:
        self._line()
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate()

    def begin(self) -> None:
        """Entries count from now on."""
        self._process.send_signal(signal.SIGUSR1)
        self._line()

    def end(self) -> Entered:
        """Those that there were."""
        self._process.send_signal(signal.SIGUSR2)
        found: Entered = json.loads(self._line())
        return found

    def _line(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError("the robot has ended")
        return line


def robot(arguments: list[str]) -> None:
    """Run a command of sleepcast; SIGUSR1 begins the tracing, SIGUSR2 ends it."""
    from sleepcast.__main__ import start

    tracer = Tracer()

    def begin(*_: object) -> None:
        tracer.begin()
        print("begun", flush=True)

    def end(*_: object) -> None:
        tracer.on = False
        print(json.dumps(tracer.entered), flush=True)

    signal.signal(signal.SIGUSR1, begin)
    signal.signal(signal.SIGUSR2, end)
    sys.argv = ["sleepcast", *arguments]
    start()


WAYS = {"swarm": in_swarm, "air": on_air}


def main() -> None:
    if sys.argv[1:2] == ["robot"]:
        robot(sys.argv[2:])
        return
    parser = argparse.ArgumentParser(prog="python -m benchmarks.path", description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("way", nargs="?", choices=WAYS, help="which way; else each")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    found = {way: WAYS[way]() for way in ([options.way] if options.way else WAYS)}
    if options.json:
        print(json.dumps(found))
        return
    for way, entered in found.items():
        rows = [(str(k), name, function) for k, (name, function) in enumerate(entered.items(), 1)]
        print(f"{way}: {len(entered)} modules\n\n{table(('', 'module', 'entered by'), rows)}\n")


if __name__ == "__main__":
    main()
