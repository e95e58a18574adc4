"""A run without a page: the scenario's mission, as fast as the machine allows, and its results."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from sleepcast.api.progress import steps
from sleepcast.api.session_test import late_sentence, missed_in, never_sent, sent_commands, unsent
from sleepcast.cli.interrupts import Interrupts, Terminated
from sleepcast.cli.streams import complain
from sleepcast.core.errors import MisuseError
from sleepcast.core.records import dataclass
from sleepcast.core.ticks import nearest_ticks
from sleepcast.loop import Swarm
from sleepcast.simulator.scenario.mission import after_end
from sleepcast.station import Command, Station

if TYPE_CHECKING:
    from sleepcast.api.recording import RecordingPlan


@dataclass(frozen=True, slots=True)
class FinishedRun:
    """A finished run.

    first: the tick that it went on from.
    setup: s that a person waited for the start, all compiling included.
    wall: s that the run itself took.
    broken: whether a recording of it broke off, or a snapshot could not be written.
    """

    swarm: Swarm
    station: Station
    first: int
    setup: float
    wall: float
    broken: bool = False

    def to_dict(self) -> dict[str, object]:
        """The outcome for scripts. Names with wall, realtime and per_second are of this computer; the rest repeats."""
        simulator = self.swarm.simulator
        robots, ticks, tick = int(simulator.there.sum()), simulator.tick - self.first, simulator.scenario.tick
        return {
            "scenario": simulator.scenario.name,
            "seed": simulator.seed,
            "robots": robots,
            "seconds": round(self.swarm.now(), 6),
            "started_at_seconds": round(self.first * tick, 6),
            "wall_setup_seconds": round(self.setup, 6),
            "wall_seconds": round(self.wall, 6),
            "realtime_factor": round(ticks * tick / self.wall, 3),
            "robot_steps_per_second": round(ticks * robots / self.wall, 1),
            "state_hash": simulator.state_hash(),
            "accounting": [station.accounting(command.id).to_dict() for station, command in self.commands()],
            "measures": self.swarm.measures(),
            "missed": self.missed(),
            "never_sent": never_sent(self.swarm.mission),
        }

    def commands(self) -> list[tuple[Station, Command]]:
        """What was sent, oldest first, each with the desk that has sent it."""
        return sent_commands(self.swarm, self.station)

    def missed(self) -> list[str]:
        """A sentence for each count that the mission wanted, and that came otherwise."""
        late = [each for order in self.swarm.mission for each in unsent(order, self.swarm.now())]
        return missed_in(self.swarm, self.station) + late

    def to_text(self) -> str:
        """The outcome for people."""
        outcome = self.to_dict()
        lines = [
            f"{outcome['scenario']}, seed {outcome['seed']}: {outcome['robots']} robots for {outcome['seconds']} s, "
            f"{outcome['realtime_factor']} times real time, after {self.setup:.1f} s of set-up"
        ]
        for station, command in self.commands():
            by = f"{station.operator}: " if self.swarm.operators else ""
            lines += [f"  {line}" for line in f"{by}{command.text.strip()}".split("\n")]
            account = station.accounting(command.id)
            lines.append(f"    {account.sentence()}")
            if self.swarm.operators and account.n_fault:
                lines.append(f"    {next(iter(account.faults.values()))}")
        groups = outcome["measures"]["groups"] if isinstance(outcome["measures"], dict) else {}
        lines += [f"  group {name}: {count} members" for name, count in groups.items()]
        for name, series in self.swarm.simulator.measured().items():
            (_, first), (seconds, last) = series[0], series[-1]
            lines.append(f"  {name}: {first:.4g} m at the start, {last:.4g} m after {seconds:g} s")
        lines += [f"  {each}" for each in self.missed()]
        if late := list(self.swarm.mission):
            lines.append(f"  {late_sentence(late, self.swarm.now())}")
        lines.append(f"  state {outcome['state_hash']}")
        return "\n".join(lines)


def run_headless(
    interrupts: Interrupts,
    begin: Callable[[], tuple[Swarm, Station]],
    seconds: float | None,
    *,
    quiet: bool,
    recording: RecordingPlan | None = None,
    snapshot: SnapshotPlan | None = None,
) -> FinishedRun:
    """Let a swarm run on, a tick at least. Raises MisuseError where the scenario has ended already or does not come by
    the time of the snapshot, what Recorder raises, and KeyboardInterrupt after Ctrl-C.

    interrupts: entered.
    begin: warms up and assembles the swarm.
    seconds: for how long, in simulated time; None: to the scenario's end.
    recording: what is recorded of it.
    snapshot: the snapshot to take.
    """
    began = perf_counter()
    swarm, station = begin()
    ready = perf_counter()
    interrupts.defer()
    scenario, first = swarm.simulator.scenario, swarm.simulator.tick
    ticks = _ticks(swarm, seconds)
    due = snapshot.tick(first, ticks, scenario.tick) if snapshot is not None else None
    if late := after_end(swarm.mission, first + ticks, scenario.tick):
        complain(late_sentence(late, (first + ticks) * scenario.tick))
    recorder, lost = None, False
    with _end_reported(swarm, recording, snapshot), ExitStack() as stack:
        if recording is not None:
            from sleepcast.api.recording import recorded

            recorder = stack.enter_context(recorded(swarm, station, recording, complain))
        reached = 0
        for number in stack.enter_context(closing(steps(ticks, scenario.name, quiet=quiet))):
            if number < reached:
                continue
            before_snapshot = ticks if due is None or due <= swarm.simulator.tick else due - swarm.simulator.tick
            reached += swarm.advance(min(ticks - number, before_snapshot))
            if snapshot is not None and swarm.simulator.tick == due:
                lost = not snapshot.take(swarm)
            interrupts.check()
    broken = lost or (recorder is not None and recorder.failed)
    return FinishedRun(swarm, station, first, ready - began, perf_counter() - ready, broken)


def _ticks(swarm: Swarm, seconds: float | None) -> int:
    """How many ticks a run is to make."""
    scenario, tick = swarm.simulator.scenario, swarm.simulator.scenario.tick
    if seconds is not None:
        return max(1, nearest_ticks(seconds, tick))
    left = nearest_ticks(scenario.seconds, tick) - swarm.simulator.tick
    if left < 1 and swarm.simulator.tick:
        raise MisuseError(
            f"the snapshot was taken at {swarm.now():g} s, and {scenario.name} ends at {scenario.seconds:g} s: say "
            "with --seconds for how long to go on"
        )
    return max(1, left)


@contextmanager
def _end_reported(swarm: Swarm, recording: RecordingPlan | None, snapshot: SnapshotPlan | None) -> Iterator[None]:
    """Say where a signal has ended the run, once everything is closed; take the snapshot that was due at its end."""
    try:
        yield
    except (KeyboardInterrupt, Terminated) as error:
        sentences = [f"ended by {str(error) or 'Ctrl-C'} at {swarm.now():g} s of simulated time"]
        if recording is not None:
            sentences.append(f"{recording.file} holds what came before")
        if snapshot is not None and snapshot.at is None and snapshot.take(swarm):
            sentences.append(f"go on with --from {snapshot.file}")
        complain("; ".join(sentences))
        raise


@dataclass(frozen=True, slots=True)
class SnapshotPlan:
    """A snapshot that is to be taken: into which file, and at which simulated time (s; None: at the end)."""

    file: Path
    at: float | None = None

    def check_file(self) -> None:
        """Raises MisuseError where nothing can be written: better now than after a long run."""
        file = Path(os.path.realpath(self.file))
        if not file.parent.is_dir():
            raise MisuseError(
                f"--snapshot {self.file}: there is no folder {file.parent}; create it, or choose another name"
            )
        if file.exists() and not file.is_file():
            raise MisuseError(f"--snapshot {self.file}: not a regular file; choose another name")
        if not os.access(file.parent, os.W_OK):
            raise MisuseError(f"--snapshot {self.file}: cannot write in {file.parent}; choose another folder")

    def tick(self, first: int, ticks: int, tick: float) -> int:
        """The tick after which it is taken, in a run of so many ticks from the `first` on. Raises MisuseError for a
        time at which the run does not come by.

        tick: how long each lasts, s.
        """
        last = first + ticks
        if self.at is None:
            return last
        due = nearest_ticks(self.at, tick)
        if not first < due <= last:
            raise MisuseError(
                f"--snapshot-at {self.at:g} s: the run goes from {first * tick:g} s to {last * tick:g} s, so take the "
                "snapshot later than its start and not later than its end"
            )
        return due

    def take(self, swarm: Swarm) -> bool:
        """Take it; gives whether that was done. Prints on standard error why not."""
        from sleepcast.loop import save, snapshot
        from sleepcast.loop.snapshots import SnapshotLostError

        try:
            save(snapshot(swarm), self.file)
        except SnapshotLostError as error:
            complain(str(error))
            return False
        return True
