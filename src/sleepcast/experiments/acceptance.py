"""Tests that were saved from a session: read, run again, and compared with what was wanted.

`api/session_test` describes the files. Orders are sent between two ticks, as by hand, so a run repeats bit for bit.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Iterable, Iterator
from io import BytesIO
from pathlib import Path

from sleepcast.api.assembly import assemble, warm_up
from sleepcast.api.fleet import SimulatedFleet
from sleepcast.api.session_test import FILE, FORMAT, MISSION, SentOrder, late_sentence, never_sent, send_order, unmet
from sleepcast.core.errors import MisuseError
from sleepcast.core.files import open_file
from sleepcast.core.given_numbers import MAX_SEED
from sleepcast.core.records import dataclass
from sleepcast.core.settings import MAX_BYTES, Table, read_text, toml_document
from sleepcast.core.ticks import tick_at
from sleepcast.core.units import TIME
from sleepcast.experiments.goals import MAX_GOALS, Goal, GoalJudge, read_goal
from sleepcast.simulator import Changes, Order, Scenario, find_scenario, parse_mission, scenario_names
from sleepcast.simulator.scenario.robot_settings import MAX_TIME

MAX_PACKED = 4 * MAX_BYTES
"""Bytes of a zip file, of which all is read: those that a page saves have a thousandth of it."""
MAX_MEMBERS = 100
"""Files in it."""
BAD_ZIP = (zipfile.BadZipFile, zlib.error, EOFError, ValueError, RuntimeError, NotImplementedError)
"""What reading a malformed zip file may raise."""


@dataclass(frozen=True)
class SavedTest:
    """A test as it was saved.

    seconds: how long it runs, in simulated time.
    own_mission: whether the scenario's own orders are sent too.
    state: the hash at the end; "" for no matter.
    """

    name: str
    title: str
    scenario: Scenario
    seed: int
    seconds: float
    orders: tuple[Order, ...]
    goals: tuple[Goal, ...]
    own_mission: bool = False
    state: str = ""

    @property
    def ticks(self) -> int:
        return max(1, tick_at(self.seconds, self.scenario.tick))


@dataclass(frozen=True)
class AcceptanceResult:
    """What came of a test.

    missed: a sentence for each thing that was wanted and did not come.
    """

    test: SavedTest
    missed: tuple[str, ...]
    state: str
    counts: tuple[dict[str, int], ...]
    """Of each order."""
    late: tuple[Order, ...] = ()
    """Those that were never sent, the scenario's own among them."""

    @property
    def passed(self) -> bool:
        return not self.missed

    def to_dict(self) -> dict[str, object]:
        """For scripts."""
        test = self.test
        return {
            "test": test.name,
            "passed": self.passed,
            "missed": list(self.missed),
            "scenario": test.scenario.name,
            "seed": test.seed,
            "robots": test.scenario.robots.count,
            "seconds": test.seconds,
            "state_hash": self.state,
            "never_sent": never_sent(self.late),
            "commands": [
                {"time": order.time, "text": order.text, **counts}
                for order, counts in zip(test.orders, self.counts, strict=True)
            ],
        }

    def to_text(self) -> str:
        """For people."""
        test = self.test
        wanted = sum(len(order.wanted) for order in test.orders)
        lines = [
            f"{test.name}: {'passed' if self.passed else 'not yet'}",
            f"  {test.scenario.name}, seed {test.seed}: {test.scenario.robots.count} robots for {test.seconds:g} s; "
            f"{len(test.orders)} commands, {wanted} counts of them and {len(test.goals)} goals were compared",
            *(f"  {each}" for each in self.missed),
            *([f"  {late_sentence(self.late, test.ticks * test.scenario.tick)}"] if self.late else []),
        ]
        return "\n".join(lines)


def read_test(place: Path) -> SavedTest:
    """The test in a folder, or in a zip file. Raises MisuseError."""
    if place.is_dir():
        texts = {name: read_text(place / name) for name in (FILE, MISSION)}
        home = place
    else:
        texts, home = _unzipped(place), place.parent
    with toml_document(place / FILE, texts[FILE]).root() as root:
        return _read(root, home, place, texts[MISSION])


def _unzipped(file: Path) -> dict[str, str]:
    try:
        with open_file(file) as opened:
            packed = opened.read(MAX_PACKED + 1)
        if len(packed) > MAX_PACKED:
            raise MisuseError(f"{file} is too large for a saved test: at most {MAX_PACKED} bytes")
        with zipfile.ZipFile(BytesIO(packed)) as archive:
            texts = dict(_members(archive, file))
    except (OSError, UnicodeError, *BAD_ZIP) as error:
        raise MisuseError(f"{file} cannot be read: {error}") from error
    for name in (FILE, MISSION):
        if name not in texts:
            raise MisuseError(f"{file} is no saved test: it has no {name}")
    return texts


def _members(archive: zipfile.ZipFile, file: Path) -> Iterator[tuple[str, str]]:
    """The texts of a test. No more is read of any than may be in it, whatever size its directory says. Raises
    MisuseError, and what is in BAD_ZIP."""
    members = archive.infolist()
    if len(members) > MAX_MEMBERS:
        raise MisuseError(f"{file} holds {len(members)} files: at most {MAX_MEMBERS} belong to a saved test")
    for info in members:
        name = info.filename.rpartition("/")[2]
        if name not in (FILE, MISSION):
            continue
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):  # the others unpack without a bound
            raise MisuseError(f"{file}: {name} is packed in another way than zip files of tests are: pack it anew")
        with archive.open(info) as member:
            data = member.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise MisuseError(f"{file}: {name} is too long: at most {MAX_BYTES} bytes")
        yield name, data.decode()


def _read(root: Table, home: Path, place: Path, mission: str) -> SavedTest:
    version = root.whole("format", low=1, high=MAX_SEED)
    if version > FORMAT:
        raise root.error("format", f"format {version} is newer than this sleepcast, which reads format {FORMAT}")
    name = root.text("scenario", most=4096)
    if name not in scenario_names() and (home / name).exists():
        name = str(home / name)
    seed = root.whole("seed", low=0, high=MAX_SEED)
    with root.table("over") as table:
        over = tuple((key, _plain(table, key)) for key in table.names())
    changes = Changes(
        root.whole("robots", low=1, high=10_000_000) if root.has("robots") else None,
        root.number("area_per_robot", low=0.0) if root.has("area_per_robot") else None,
        root.flag("walls", True),
        root.whole("world_seed", seed, low=0, high=MAX_SEED),
        over,
    )
    root.text("mission", MISSION, choices=(MISSION,))
    with root.answering("scenario"):
        scenario = find_scenario(name, changes)
    return SavedTest(
        name=place.resolve().stem if place.is_file() else place.resolve().name,
        title=root.text("title", ""),
        scenario=scenario,
        seed=seed,
        seconds=root.number("seconds", TIME, low=0.0, high=MAX_TIME),
        orders=parse_mission(mission, str(place / MISSION)),
        goals=tuple(map(read_goal, root.array("goals", most=MAX_GOALS))),
        own_mission=root.flag("own_mission", False),
        state=root.text("state", ""),
    )


def _plain(table: Table, key: str) -> object:
    table.has(key)
    value = table.values[key]
    if isinstance(value, dict):
        raise table.error(key, 'wanted a value: write a key with dots in quotes, as "radio.loss" = 0.1')
    return value


def run_test(test: SavedTest, *, threads: int | None = None, ticks: Iterable[int] | None = None) -> AcceptanceResult:
    """Run a test again. Raises MissionError for an order that cannot be sent, MisuseError for a goal that cannot be
    measured.

    threads: None is one for each core.
    ticks: the numbers of its ticks, from 0, by which to show how far it is.
    """
    warm_up(test.scenario, threads)
    fleet = SimulatedFleet(*assemble(test.scenario, test.seed, mission=test.own_mission, threads=threads))
    swarm, tick = fleet.swarm, test.scenario.tick
    swarm.send_initial_telemetry()
    judge, waiting, sent = GoalJudge(test.goals, test.name), list(reversed(test.orders)), list[SentOrder]()
    with fleet:
        for done in range(test.ticks) if ticks is None else ticks:
            while waiting and tick_at(waiting[-1].time, tick) <= done + 1:
                sent.append(send_order(swarm, waiting.pop()))
            swarm.step()
            judge.look(fleet, is_end=done + 1 == test.ticks)
        counts = [each.counts() for each in sent]
        state = fleet.hash
    missed = [f"{order.place}: it was to be sent at {order.time:g} s, after the end" for order in reversed(waiting)]
    for order, count in zip(test.orders, counts, strict=False):
        missed += unmet(order, count)
    missed += [miss.sentence() for miss in judge.missed]
    if test.state and state != test.state:
        missed.append(f"wanted the state {test.state} at the end, but it was {state}")
    counts += [{}] * len(waiting)
    return AcceptanceResult(test, tuple(missed), state, tuple(counts), (*reversed(waiting), *swarm.mission))
