"""`sleepcast replay`: a recording on the page; what it holds; whether the run repeats from it to the last bit."""

from __future__ import annotations

import json
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from sleepcast.channel import Kind
from sleepcast.cli.interrupts import Interrupts
from sleepcast.cli.options import NumberRange, allow_host_option
from sleepcast.cli.run import FASTEST, HOST, PORT, SLOWEST
from sleepcast.cli.streams import announce, put
from sleepcast.core.errors import MisuseError
from sleepcast.core.records import dataclass

if TYPE_CHECKING:
    from sleepcast.loop import Swarm
    from sleepcast.simulator.recording.recording import Recording


@click.command("replay")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--headless", is_flag=True, help="Print what the recording holds instead.")
@click.option("--json", "as_json", is_flag=True, help="Print it as one JSON object.")
@click.option("--verify", is_flag=True, help="Run it again, and compare the hashes of the state.")
@click.option("--quiet", is_flag=True, help="Show no progress on standard error.")
@click.option(
    "--speed",
    metavar="X",
    type=NumberRange(SLOWEST, FASTEST, suffix="x"),
    help="Page: speed, in multiples of real time.",
)
@click.option(
    "--port",
    type=click.IntRange(0, 65_535),
    default=PORT,
    show_default=True,
    help="Page: its port; 0 for any free one.",
)
@click.option("--host", default=HOST, show_default=True, help="Page: the address to listen on.")
@click.option("--insecure", is_flag=True, help="Page: allow a host that others can reach, unencrypted.")
@allow_host_option
@click.option("--no-browser", is_flag=True, help="Page: print its address, but open no browser.")
def replay(
    file: Path,
    headless: bool,
    as_json: bool,
    verify: bool,
    quiet: bool,
    speed: float | None,
    port: int,
    host: str,
    insecure: bool,
    allow: tuple[str, ...],
    no_browser: bool,
) -> int:
    """Show the recording FILE on the page, with a slider for its time.

    With --headless or --json it is printed instead: the run, the operator's messages, and what became of them. With
    --verify the messages are sent again to the same scenario with the same seed, each in its tick; the exit status is 1
    if the state differs from the recorded one, or none was recorded.

    \b
    Examples:
      sleepcast replay run.mcap
      sleepcast replay run.mcap --verify --json
    """
    with Interrupts() as interrupts:
        from sleepcast.simulator.recording.recording import load_recording

        recording = load_recording(file)
        if not (headless or as_json or verify):
            from sleepcast.console import Address, serve_backend
            from sleepcast.console.adapters.recorded_past import RecordedPast
            from sleepcast.console.adapters.recording import load_timeline
            from sleepcast.console.features.plots import ScenarioMeasure
            from sleepcast.console.replay import ReplayBackend, ReplayDriver
            from sleepcast.core.clock import WallClock
            from sleepcast.experiments.live import recorded_measures

            timeline = load_timeline(recording)
            interrupts.release()  # the server has a way of its own to end in good order
            if speed is not None:
                timeline = replace(timeline, speed=speed)
            clock, address = WallClock(), Address(host, port, insecure, not no_browser, allow)
            past = RecordedPast(recording, timeline)
            measures = [ScenarioMeasure(*each) for each in recorded_measures(recording.scenario.name)]
            desk = ReplayBackend(timeline, ReplayDriver(timeline, clock, past), measures, past=past)
            serve_backend(desk, clock, address=address, say=announce)
            return 0
        verdict = _verify(interrupts, recording, quiet=quiet) if verify else None
    put(json.dumps(_to_dict(recording, verdict)) if as_json else _to_text(recording, verdict))
    return 0 if verdict is None or verdict.same else 1


@dataclass(frozen=True, slots=True)
class ReplayCheck:
    """What came of running a recording again.

    compared: how many states.
    differs: the first tick whose state is another one; None if there is none.
    """

    compared: int
    differs: int | None

    @property
    def same(self) -> bool:
        return self.differs is None and self.compared > 0

    def sentence(self, recording: Recording) -> str:
        """The verdict for a person."""
        from sleepcast.core.version import VERSION

        if not self.compared:
            return "not verified: the recording holds no state to compare with, it was broken off too early"
        if self.differs is None:
            return f"verified: run again, the state is the same to the last bit ({self.compared} times compared)"
        other = f"; recorded by version {recording.version}, run again by version {VERSION}"
        return (
            f"run again, the state differs from tick {self.differs} on{other if recording.version != VERSION else ''}"
        )


def _verify(interrupts: Interrupts, recording: Recording, *, quiet: bool) -> ReplayCheck:
    """Run the recording again, up to the last state that it holds."""
    from sleepcast.api.assembly import warm_up
    from sleepcast.api.progress import steps
    from sleepcast.console.adapters.recording import inputs_of
    from sleepcast.loop.rerun import Rerun
    from sleepcast.simulator.recording.recording import alive

    with alive(recording):
        warm_up(recording.scenario, None)
        again = Rerun(_beginning(recording), inputs_of(recording))
    interrupts.defer()
    compared = 0
    first = recording.first
    count = max(1, max(recording.states, default=first) + 1 - first)
    with closing(steps(count, recording.scenario.name, quiet=quiet)) as ticks:
        for tick in (first + step for step in ticks):
            interrupts.check()
            if tick > first:
                again.step()
            wanted = recording.states.get(tick)
            if wanted is not None:
                compared += 1
                if again.swarm.simulator.state_hash() != wanted:
                    return ReplayCheck(compared, tick)
    return ReplayCheck(compared, None)


def _beginning(recording: Recording) -> Swarm:
    """The swarm of a recording at its start, which only the recording commands. Raises MisuseError."""
    if not recording.first and not recording.snapshot:
        from sleepcast.api.assembly import assemble

        swarm, _ = assemble(recording.scenario, recording.seed, mission=False)
        return swarm
    if not recording.snapshot:
        raise MisuseError(
            f"{recording.file} goes on from a snapshot that was too large to be recorded: without that it cannot be "
            "run again"
        )
    from sleepcast.loop import resume

    return resume(recording.snapshot, name=f"the snapshot in {recording.file}")


def _to_dict(recording: Recording, verdict: ReplayCheck | None) -> dict[str, object]:
    scenario = recording.scenario
    last = max(recording.states, default=None)
    summary: dict[str, object] = {
        "scenario": scenario.name,
        "seed": recording.seed,
        "robots": scenario.robots.count,
        "tick": scenario.tick,
        "seconds": recording.seconds,
        "part": recording.part,
        "began": recording.began,
        "following": recording.following or None,
        "started_at_seconds": recording.first * scenario.tick,
        "version": recording.version,
        "complete": recording.complete,
        "state_hash": None if last is None else recording.states[last],
        "state_tick": last,
        "channels": recording.counts,
        "messages": [
            {"time": each.tick * scenario.tick, "tick": each.tick, "id": each.message.id}
            | {"kind": each.message.kind.value, "text": each.message.text}
            for each in recording.posted
        ],
        "accounting": list(recording.accounting.values()),
    }
    if verdict is not None:
        summary["verified"] = {"same": verdict.same, "compared": verdict.compared, "differs_from_tick": verdict.differs}
    return summary


def _to_text(recording: Recording, verdict: ReplayCheck | None) -> str:
    scenario = recording.scenario
    lines = [
        f"{scenario.name}, seed {recording.seed}: {scenario.robots.count} robots for {recording.seconds:g} s, "
        f"recorded by version {recording.version}"
    ]
    if recording.part > 1 or recording.following:
        following = f", goes on in {recording.following}" if recording.following else ""
        lines.append(f"  part {recording.part}: from {recording.began:g} s on{following}")
    if not recording.complete:
        lines.append("  the file ends early: the recording was broken off, and this is what came before")
    lines += [f"  {topic}: {count}" for topic, count in sorted(recording.counts.items())]
    commands = (each for each in recording.posted if each.message.kind is not Kind.REQUEST)
    for each in commands:  # not what desks say of their auctions, several times a second
        first, *more = (each.message.text or each.message.kind.name).strip().split("\n")
        lines += [f"  @{each.tick * scenario.tick:g}s {first}", *(f"    {line}" for line in more)]
    if verdict is not None:
        lines.append(f"  {verdict.sentence(recording)}")
    return "\n".join(lines)
