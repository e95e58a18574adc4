"""Whether a run in a batch equals the same run alone: every scenario of the gallery, at its full length.

    python -m benchmarks.worlds.equal SCENARIO SECONDS    # one of them, its states; prints one JSON object

*States*: so many worlds of a scenario are run together, and each of them alone beside it; on every 50th tick and at the
end their whole states, as snapshots have them, must be the same bytes. *Rows*: they are swept, sampled all along, and
`sleepcast sweep --verify`, which does each run again by itself, must find the same samples, errors and hashes.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import sleepcast as sc
from benchmarks.children import ROOT, ChildError, child
from benchmarks.report import Json
from benchmarks.worlds.sides import LIMIT
from sleepcast.simulator import find_scenario, scenario_names

WORLDS, SAMPLES, LOOKS = 3, 10, 50
"""Worlds of each scenario; samples of a run; ticks between two looks at the states."""
QUICK_TICKS = 20
"""Of a run that is to show only that this works."""
MEASURES = ("mean x", "mean y", "mean heading")


@dataclass(frozen=True)
class Compared:
    """A scenario. states, rows: what differs, nothing for equal; None where nothing was compared: `note` says why."""

    name: str
    seconds: float
    looks: int
    states: Sequence[str] | None
    rows: Sequence[str]
    note: str = ""

    @property
    def equal(self) -> bool:
        """Whether states were compared, and nothing differs."""
        return self.states is not None and not (self.states or self.rows)

    @property
    def cells(self) -> tuple[str, ...]:
        states, rows = (
            "not measured" if each is None else ", ".join(each) or "equal" for each in (self.states, self.rows)
        )
        return self.name, f"{self.seconds:g}", f"{self.looks}", states, rows, self.note


def compared(names: Sequence[str], *, quick: bool) -> Iterator[Compared]:
    """Scenarios of the gallery, all of them for no names."""
    for name in names or scenario_names():
        print(f"{name} ...", file=sys.stderr, flush=True)
        scenario = find_scenario(name)
        seconds = scenario.tick * QUICK_TICKS if quick else scenario.seconds
        looks, states, note = 0, None, ""
        try:
            found = child("benchmarks.worlds.equal", name, repr(seconds), limit=LIMIT)
            looks, states = int(str(found["looks"])), _texts(found["differ"])
        except ChildError as error:
            note = str(error)
        rows = different_rows(name, seconds, max(scenario.tick, seconds / SAMPLES))
        yield Compared(name, seconds, looks, states, rows, note)


def _texts(found: object) -> list[str]:
    assert isinstance(found, list)
    return [str(each) for each in found]


def different_rows(name: str, seconds: float, every: float) -> list[str]:
    """The runs of a sweep that come out otherwise by themselves."""
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "sleepcast", "sweep"]
        options = ["--seeds", f"{WORLDS}", "--seconds", f"{seconds!r}s", "--every", f"{every!r}s"]
        measures = [word for each in MEASURES for word in ("--measure", each)]
        results = str(Path(folder, "results"))
        _run([*command, name, *options, *measures, "--quiet", "--out", results])
        said = _run([*command, results, "--verify", "--quiet", "--json"])
    verdict = json.loads(said)
    if verdict["verified"] != WORLDS:
        return [f"only {verdict['verified']} of {WORLDS} runs were done"]
    return [f"run {number}" for number in verdict["different"]]


def _run(command: Sequence[str]) -> str:
    """What a command says, whose exit status may be 1: it says itself what is wrong."""
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1) or not done.stdout:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr}")
    return done.stdout


def different_states(name: str, seconds: float) -> Json:
    """How often states were compared, and the first tick and world in which they differ."""
    together = sc.open_many(name, seeds=range(WORLDS), mission=True, quiet=True)
    alone = [sc.open(name, seed=seed, mission=True, threads=1) for seed in range(WORLDS)]
    tick = alone[0].swarm.simulator.scenario.tick
    left, looks = round(seconds / tick), 0
    while True:
        looks += 1
        differ = [world for world, fleet in enumerate(alone) if together[world].snapshot() != fleet.snapshot()]
        if differ or left <= 0:
            at = alone[0].swarm.simulator.tick
            return {"looks": looks, "differ": [f"world {world} at tick {at}" for world in differ]}
        ticks = min(LOOKS, left)
        left -= ticks
        together.run(ticks * tick, quiet=True)
        for fleet in alone:
            fleet.run(ticks * tick, quiet=True)


def main() -> None:
    if not hasattr(sc, "open_many"):
        sys.exit("not there: there is no open_many")
    print(json.dumps(different_states(sys.argv[1], float(sys.argv[2]))))


if __name__ == "__main__":
    main()
