"""The runs of the operator's page: the one that the command line asks for, and those that are chosen on the page."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import field, replace
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING

from sleepcast.api.assembly import assemble, assemble_from, others_of, station_of, warm_up
from sleepcast.api.fleet import SimulatedFleet
from sleepcast.cli.page_tests import PageTests
from sleepcast.cli.streams import complain
from sleepcast.console.adapters.live_past import LivePast
from sleepcast.console.adapters.mission import SwarmMission
from sleepcast.console.adapters.swarm import SwarmAdapter, shown_slider
from sleepcast.console.features.plots import ScenarioMeasure
from sleepcast.console.features.renewal import Choices, ShownScenario
from sleepcast.console.renewal import RunRequest, ShownRun
from sleepcast.console.snapshots import Budget
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.given_numbers import read_seed
from sleepcast.core.records import dataclass
from sleepcast.core.settings import toml_document
from sleepcast.experiments.live import live_measures
from sleepcast.experiments.trust import folder_of
from sleepcast.loop import MAX_MINDS, Pace, Swarm, load, resume
from sleepcast.simulator import Changes, MapPicture, Scenario, added_scenarios, find_scenario, scenario_names
from sleepcast.simulator.scenario.scenario import FILE, GALLERY
from sleepcast.station import Journal, Station
from sleepcast.station.journal.journal import MemoryJournal

if TYPE_CHECKING:
    from sleepcast.api.recording import RecordingPlan
    from sleepcast.cli.headless import SnapshotPlan


@dataclass(frozen=True, slots=True)
class Beginning:
    """What the command line asks for: a scenario with changes, or a snapshot.

    name: of the scenario, or its path.
    seed, threads, speed: None where nothing is said.
    budget: of what is stored of each run's past.
    """

    name: str | None
    snapshot: Path | None
    changes: Changes
    seed: int | None
    threads: int | None
    speed: float | None
    journal: Journal | None
    budget: Budget = field(default_factory=Budget)

    @property
    def home(self) -> str:
        """By what the page calls it."""
        return self.name if self.name is not None else f"the snapshot {self.snapshot}"


class PageRuns:
    """Makes the runs of a page (a `RunMaker`). Each is recorded into a file of its own; the snapshot is of the last."""

    def __init__(
        self, beginning: Beginning, recording: RecordingPlan | None, snapshot: SnapshotPlan | None, clock: Clock
    ) -> None:
        self._beginning, self._recording, self._snapshot, self._clock = beginning, recording, snapshot, clock
        self._made = 0
        self.swarm: Swarm | None = None
        """The swarm on the page."""
        self._warm = Event()
        self._current = RunRequest(beginning.home, beginning.seed)

    @property
    def current(self) -> RunRequest:
        """What the run on the page was made of."""
        return self._current

    @property
    def warm(self) -> bool:
        """Whether nothing is being compiled for the run on the page."""
        return self._warm.is_set()

    def scenarios(self) -> list[ShownScenario]:
        """The gallery, the scenarios of installed packages, and what the command line asked for."""
        home, names = self._beginning.home, [*scenario_names(), *added_scenarios()]
        offered = [] if home in names else [ShownScenario(home, self._title(home))]
        for name in names:
            try:
                offered.append(ShownScenario(name, self._title(name)))
            except SleepcastError:  # a mistake of somebody else's hides no other scenario
                continue
        return offered

    def _title(self, name: str) -> str:
        if name == self._beginning.home and self._beginning.name is None:
            return name
        if name in scenario_names():  # much faster than all of it
            return toml_document(GALLERY / name / FILE).root().text("title")
        return find_scenario(name).title

    def choices(self, scenario: str) -> Choices:
        """What may be changed of one; with the values of the run on the page, if it is of this one."""
        request = self._current if self._current.scenario == scenario else RunRequest(scenario)
        if self._is_snapshot(scenario):
            assert self.swarm is not None
            simulator = self.swarm.simulator
            return Choices(str(simulator.seed), len(simulator.names), True, [])
        chosen = self._scenario(request)
        sliders = [shown_slider(slider) for slider in chosen.sliders]
        return Choices(str(chosen.seed), chosen.robots.count, False, sliders)

    def _is_snapshot(self, scenario: str) -> bool:
        return self._beginning.name is None and scenario == self._beginning.home

    def _scenario(self, request: RunRequest) -> Scenario:
        """The scenario as requested. Raises SleepcastError for one that is not offered."""
        name, changes = request.scenario, Changes()
        if name == self._beginning.home:
            changes = self._beginning.changes
        elif name not in scenario_names() and name not in added_scenarios():
            raise MisuseError(f'there is no scenario "{name:.80}" to choose')
        changes = replace(changes, seed=request.seed)
        scenario = find_scenario(name, changes)
        over = _over(scenario, request.values)
        if over:
            changes = replace(changes, over=(*changes.over, *over))
            scenario = find_scenario(name, changes)
        if request.robots is None or request.robots == scenario.robots.count:
            return scenario
        if request.robots > MAX_MINDS:
            raise MisuseError(f"{request.robots:,} robots are too many: at most {MAX_MINDS:,} fit into one run")
        return find_scenario(name, replace(changes, robots=request.robots))

    def make(self, request: RunRequest, tell: Callable[[str], None]) -> ShownRun:
        """A run as requested."""
        beginning = self._beginning
        if request.seed is not None:
            read_seed(request.seed)
        if self._is_snapshot(request.scenario):
            assert beginning.snapshot is not None
            tell("Reading the snapshot")
            data, name = load(beginning.snapshot), str(beginning.snapshot)
            swarm, station = assemble_from(data, request.seed, beginning.threads, beginning.journal, name=name)
        else:
            tell("Reading the scenario")
            scenario = self._scenario(request)
            if scenario.sees_through_walls and not self._made:
                complain(scenario.sees_through_walls)
            tell(f"Placing {scenario.robots.count:,} robots")
            swarm, station = assemble(
                scenario, request.seed, mission=False, threads=beginning.threads, journal=beginning.journal
            )
        tell("Opening the page")
        return self._run(swarm, station, request)

    def fork(self, run: ShownRun, state: bytes) -> ShownRun:
        """A run that goes on from a state of this one, with its desk and its past. Its mission is played by whoever
        wants that: another future is what somebody does."""
        seen, before = run.swarm, run.past
        assert isinstance(seen, SwarmAdapter)
        assert isinstance(before, LivePast)
        swarm = resume(state, threads=self._beginning.threads, name="the state of this run")
        swarm.mission.clear()
        journal = run.station.journal
        swarm.desk = station = station_of(swarm, None if isinstance(journal, MemoryJournal) else journal)
        for desk, old in zip([station, *others_of(swarm)], [run.station, *seen.desks[1:]], strict=True):
            desk.restore(old.state())
            desk.go_back(swarm.now())
        forked = self._run(swarm, station, self._current, run.pace.factor, seen.map_picture)
        assert isinstance(forked.past, LivePast)
        forked.past.go_on(before, state)
        if isinstance(forked.mission, SwarmMission) and run.mission is not None:
            forked.mission.take_over(run.mission.sent())
        return forked

    def _run(
        self,
        swarm: Swarm,
        station: Station,
        request: RunRequest,
        speed: float | None = None,
        map_picture: MapPicture | None = None,
    ) -> ShownRun:
        station.hold(True)  # an open desk: its operator is there
        beginning = self._beginning
        if speed is None and request.scenario == beginning.home:
            speed = beginning.speed
        scenario, warm = swarm.simulator.scenario, Event()

        def prepare() -> None:
            warm_up(scenario, beginning.threads)
            warm.set()

        pace = Pace(self._clock, swarm, scenario.speed_up if speed is None else speed)
        fleet = SimulatedFleet(swarm, station)
        measures = [ScenarioMeasure(*each) for each in live_measures(fleet, folder_of(request.scenario))]
        seen = SwarmAdapter(swarm, map_picture)
        past = LivePast(seen, swarm, station, self._clock, beginning.budget)
        tests, around = PageTests(fleet, past), self._shown_as(swarm, station, request, warm)
        mission = SwarmMission(swarm, station) if scenario.mission else None
        return ShownRun(seen, station, pace, prepare, around, measures, past, tests, mission)

    @contextmanager
    def _shown_as(self, swarm: Swarm, station: Station, request: RunRequest, warm: Event) -> Iterator[None]:
        """Record what happens while a run is on the page, and take the snapshot if it is still there at the end. A page
        that could not be opened does neither: it would leave an empty recording, and replace a good snapshot by one of
        the start."""
        try:
            with self._recorded(swarm, station, self._made + 1):
                self._made += 1
                self.swarm, self._current, self._warm = swarm, request, warm
                yield
        finally:
            if self._snapshot is not None and self.swarm is swarm:
                self._snapshot.take(swarm)

    @contextmanager
    def _recorded(self, swarm: Swarm, station: Station, number: int) -> Iterator[None]:
        if self._recording is None:
            yield
            return
        from sleepcast.api.recording import recorded

        plan = replace(self._recording, file=run_file(self._recording.file, number))
        with recorded(swarm, station, plan, complain):
            yield


def _over(scenario: Scenario, values: Mapping[str, float]) -> list[tuple[str, object]]:
    """What sliders change of a scenario's file: those that stand elsewhere than the file has them."""
    sliders, over = {slider.name: slider for slider in scenario.sliders}, list[tuple[str, object]]()
    for name, value in values.items():
        slider = sliders.get(name)
        if slider is None:
            raise MisuseError(f'{scenario.name} has no slider "{name:.40}"')
        if not slider.low <= value <= slider.high:
            unit = slider.unit
            raise MisuseError(
                f"{slider.title}: wanted {slider.low:g}{unit} to {slider.high:g}{unit}, not {value:g}{unit}"
            )
        if value != slider.value:
            over.append((slider.key, slider.written(value)))
    return over


def run_file(first: Path, number: int) -> Path:
    """The file into which run `number` of a page is recorded, from 1."""
    return first if number == 1 else first.with_name(f"{first.stem}-run{number}{first.suffix}")
