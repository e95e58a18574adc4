"""A run without a page: the scenario's mission, as fast as the machine goes, and what came of it."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING

from sleepcast.cli.progress import steps
from sleepcast.loop import Swarm
from sleepcast.simulator import Scenario, Simulator
from sleepcast.station import Station

if TYPE_CHECKING:
    from sleepcast.cli.recording import Wanted


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


@dataclass(frozen=True, slots=True)
class Run:
    """A finished run. setup, wall: seconds that a person waited for the start and for the run itself. broken: whether
    it was recorded and the recording broke off."""

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
            f"{found['realtime_factor']} times as fast as real time"
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
    scenario: Scenario,
    seed: int | None,
    seconds: float,
    *,
    quiet: bool,
    threads: int | None = None,
    wanted: Wanted | None = None,
) -> Run:
    """Run `scenario` with its mission for so many simulated seconds, a tick at least.

    wanted: what is recorded of it. Raises what Recorder raises.
    """
    began = perf_counter()
    swarm, station = assemble(scenario, seed, mission=True, threads=threads)
    ready = perf_counter()
    recorder = None
    with ExitStack() as stack:
        if wanted is not None:
            from sleepcast.cli.recording import recorded

            recorder = stack.enter_context(recorded(swarm, station, wanted))
        for _ in steps(max(1, round(seconds / scenario.tick)), scenario.name, quiet=quiet):
            swarm.step()
    broken = recorder is not None and recorder.failed
    return Run(swarm, station, ready - began, perf_counter() - ready, broken)
