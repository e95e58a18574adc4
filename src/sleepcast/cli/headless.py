"""A run without a page: the scenario's mission, as fast as the machine goes, and what came of it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING

from sleepcast.cli.interrupts import Interrupts
from sleepcast.cli.progress import steps
from sleepcast.cli.streams import complain
from sleepcast.loop import Swarm
from sleepcast.simulator import Scenario, Simulator
from sleepcast.station import Station

if TYPE_CHECKING:
    from sleepcast.cli.recording import Wanted


FEW, WARM_TICKS = 12, 3
"""Robots and ticks of a warm-up: some of each group, and all that happens only when something has moved."""


def assemble(
    scenario: Scenario, seed: int | None, *, mission: bool, threads: int | None = None
) -> tuple[Swarm, Station]:
    """A swarm in its scenario and the operator's desk. mission: whether the desk sends the scenario's own orders.
    threads: for the bodies; None is one for each core."""
    simulator = Simulator(scenario, seed, threads=threads)
    swarm = Swarm(simulator, scenario.mission if mission else ())
    station = Station(swarm.vocabulary, swarm.minds, swarm.post, swarm)
    swarm.desk = station
    return swarm, station


def warm_up(scenario: Scenario, threads: int | None) -> None:
    """Load and compile all that a tick of `scenario` needs, by letting a few robots live in it for a moment."""
    few = replace(scenario.robots, count=min(scenario.robots.count, FEW))
    swarm, _ = assemble(replace(scenario, robots=few), None, mission=False, threads=threads)
    for _ in range(WARM_TICKS):
        swarm.step()
        swarm.simulator.readings()


@dataclass(frozen=True, slots=True)
class Run:
    """A finished run. setup, wall: seconds that a person waited for the start, all compiling included, and for the run
    itself. broken: whether it was recorded and the recording broke off."""

    swarm: Swarm
    station: Station
    setup: float
    wall: float
    broken: bool = False

    def to_dict(self) -> dict[str, object]:
        """The outcome for scripts. Names with wall, realtime and per_second are of this computer; the rest repeats."""
        simulator = self.swarm.simulator
        robots, seconds = len(simulator.names), round(self.swarm.now(), 6)
        return {
            "scenario": simulator.scenario.name,
            "seed": simulator.seed,
            "robots": robots,
            "seconds": seconds,
            "wall_setup_seconds": round(self.setup, 6),
            "wall_seconds": round(self.wall, 6),
            "realtime_factor": round(seconds / self.wall, 3),
            "robot_steps_per_second": round(simulator.tick * robots / self.wall, 1),
            "state_hash": simulator.state_hash(),
            "accounting": [self.station.accounting(command.id).to_dict() for command in self.station.commands()],
            "measures": self.swarm.measures(),
        }

    def to_text(self) -> str:
        """The outcome for people."""
        found = self.to_dict()
        lines = [
            f"{found['scenario']}, seed {found['seed']}: {found['robots']} robots for {found['seconds']} s, "
            f"{found['realtime_factor']} times as fast as real time, after {self.setup:.1f} s to set it up"
        ]
        for command in self.station.commands():
            lines += [f"  {line}" for line in command.text.strip().split("\n")]
            lines.append(f"    {self.station.accounting(command.id).sentence()}")
        groups = found["measures"]["groups"] if isinstance(found["measures"], dict) else {}
        lines += [f"  group {name}: {count} members" for name, count in groups.items()]
        for name, series in self.swarm.simulator.measured().items():
            (_, first), (seconds, last) = series[0], series[-1]
            lines.append(f"  {name}: {first:.4g} m at the start, {last:.4g} m after {seconds:g} s")
        lines.append(f"  state {found['state_hash']}")
        return "\n".join(lines)


def run_headless(
    interrupts: Interrupts,
    scenario: Scenario,
    seed: int | None,
    seconds: float,
    *,
    quiet: bool,
    threads: int | None = None,
    wanted: Wanted | None = None,
) -> Run:
    """Run `scenario` with its mission for so many simulated seconds, a tick at least.

    interrupts: entered. wanted: what is recorded of it. Raises what Recorder raises, KeyboardInterrupt after Ctrl-C.
    """
    began = perf_counter()
    warm_up(scenario, threads)
    swarm, station = assemble(scenario, seed, mission=True, threads=threads)
    ready = perf_counter()
    interrupts.defer()
    recorder = None
    with _told(swarm, wanted), ExitStack() as stack:
        if wanted is not None:
            from sleepcast.cli.recording import recorded

            recorder = stack.enter_context(recorded(swarm, station, wanted))
        count = max(1, round(seconds / scenario.tick))
        for _ in stack.enter_context(closing(steps(count, scenario.name, quiet=quiet))):
            swarm.step()
            interrupts.check()
    broken = recorder is not None and recorder.failed
    return Run(swarm, station, ready - began, perf_counter() - ready, broken)


@contextmanager
def _told(swarm: Swarm, wanted: Wanted | None) -> Iterator[None]:
    """Say where Ctrl-C has ended the run, once everything is closed."""
    try:
        yield
    except KeyboardInterrupt:
        kept = "" if wanted is None else f"; {wanted.file} holds what came before"
        complain(f"ended by Ctrl-C at {swarm.now():g} s of simulated time{kept}")
        raise
