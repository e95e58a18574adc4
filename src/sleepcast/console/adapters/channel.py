"""Robots on the air, as the operator's page shows them.

Where a robot is, is what it reported last. A robot that has reported no position stands in a row below the map, so that
every robot ever heard is on it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from math import inf, nan, pi

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from sleepcast.channel import Kind, Message
from sleepcast.columns.values import Rows
from sleepcast.console import KeptRule, NamedOutline, SafetyOrder, Scene
from sleepcast.console.frames import packed_poses
from sleepcast.console.network import PendingExplanation
from sleepcast.console.sensing import BodyView
from sleepcast.console.view import FieldPicture, Picture, Solids
from sleepcast.core.errors import MisuseError, SleepcastError, printable
from sleepcast.core.model import RestState
from sleepcast.core.units import LENGTH, UNITS
from sleepcast.fleet.failing import FailingRule, most_first
from sleepcast.language import Explanation, Variable, Vocabulary
from sleepcast.language.parts import Part
from sleepcast.language.program import Program
from sleepcast.language.symbols import Declared
from sleepcast.station import Station
from sleepcast.station.asking import AwaitedRelease
from sleepcast.station.network import NetworkStation
from sleepcast.station.remote import RemoteMind, RemoteMinds, TelemetryClient
from sleepcast.station.roster import longer

X, Y, Z, HEADING = "x", "y", "z", "heading"
"""The variables in which a robot says where it is (m, m, m, rad)."""
MARGIN = 0.1
"""Of the width and the height of where robots are, left free around them."""
LEAST_SIDE = 2.0
"""m: a map of one robot has a size, too."""
ROW = 0.05
"""Of the map's height: from the map to the row of robots without a position, and to the next such row."""
ROBOTS_PER_ROW = 40
"""Robots in one such row."""
RADIUS = 0.2
"""m: a robot of unknown size; the page draws it large enough to be seen."""
FARTHEST = 1e7
"""m: positions farther away are ignored; robots stay on the Earth."""
SHARED = "several robots have this name: what is shown is of one of them"
CATCHING_UP = "at rest until it has all standing commands"
EMPTY = (0.0, 0.0, 10.0, 10.0)
"""m: the map before any position is known."""

Area = tuple[float, float, float, float]


class SilentRobot:
    """A robot that was heard and has sent no telemetry (a `MindView`)."""

    stopped = False
    groups: frozenset[str] = frozenset()

    def __init__(self, name: str, vocabulary: Vocabulary) -> None:
        self.name, self.values = name, [nan] * vocabulary.size

    def rest_state(self) -> RestState | None:
        """Nothing is known."""
        return None

    def declared(self, key: str) -> Declared | None:
        """Nothing is known."""
        return None

    def heard(self) -> Iterable[str]:
        """No names are known."""
        return ()

    def fetch(self, part: Part) -> Program | None:
        """Nothing is known."""
        return None

    def operator(self, part: Part) -> Program | None:
        """Nothing is known."""
        return None

    def why(self, command: str | None = None) -> Explanation:
        """Refused: the robot has to be asked on the air."""
        raise SleepcastError(f"{self.name} is far away: ask it why on the air")

    def variables(self) -> Iterable[tuple[str, float]]:
        """None is known."""
        return ()

    def rules(self) -> Iterable[KeptRule]:
        """None is known."""
        return ()


class FleetMinds:
    """The minds of the robots on a desk's roster, as columns (the page's `Minds`): those of the desk's own table of
    telemetry. `look` brings them up to date."""

    def __init__(self, station: Station, minds: RemoteMinds) -> None:
        self._station, self._minds = station, minds
        self._names: tuple[str, ...] = ()
        self._table = station.told.latest()
        self._groups: dict[str, NDArray[np.bool_]] = {}
        self.stopped: NDArray[np.bool_] = np.zeros(0, np.bool_)

    def look(self, names: tuple[str, ...]) -> None:
        """Take the latest telemetry of these robots, in the order of the roster."""
        self._names, self._table = names, self._station.told.latest()
        minds = map(self._minds.get, names)
        self.stopped = np.array([mind is not None and mind.stopped for mind in minds], np.bool_)
        groups = self._table.groups
        known = {key: groups[key] for key in self._groups if key in groups}  # the oldest first, as ever
        self._groups = {key: longer(members, len(names)) for key, members in {**known, **groups}.items()}

    @property
    def groups(self) -> Mapping[str, NDArray[np.bool_]]:
        """Who is in which group, by its key; the newest group last."""
        return self._groups

    def __len__(self) -> int:
        return len(self._names)

    def __getitem__(self, name: str) -> RemoteMind | SilentRobot:
        return self._minds.get(name) or SilentRobot(name, self._minds.vocabulary)

    def column(self, slot: int) -> NDArray[np.float64]:
        """A variable of all robots in SI, NaN for unknown."""
        told = self._table.column(slot, Rows.run(0, self._table.count))
        return np.append(told, np.full(len(self._names) - len(told), nan))

    def named(self, name: str) -> NDArray[np.float64]:
        """The same by the variable's name, unknown where no robot has it."""
        binding = self._minds.vocabulary.bindings.get(name)
        return self.column(binding.slot) if isinstance(binding, Variable) else np.full(len(self._names), nan)

    def declared(self, key: str) -> Declared | None:
        """What any robot has learned under this key."""
        return self._minds.declared(key)

    def heard(self) -> Iterable[str]:
        """Every name that any robot has learned, as written."""
        return self._minds.heard()


class FleetAdapter:
    """Robots on the air as the page wants to see them (its `FleetOnAir`).

    ground: what is drawn under them, with no names and no sizes of its own
    every: s between two questions to all of them, at least
    began: when the page's time began, s of the station's clock
    """

    def __init__(
        self,
        station: NetworkStation,
        telemetry: TelemetryClient,
        ground: Scene,
        every: float,
        began: float,
        picture: Picture | None = None,
    ) -> None:
        self.asking = True
        self.minds = FleetMinds(station, telemetry.minds)
        self.scene, self.picture, self._ground = ground, picture, ground.areas
        self._station, self._telemetry, self._every, self._began = station, telemetry, every, began
        self._mapped = ground.area != EMPTY
        """Whether the area is one in which robots are."""
        self._news = True
        station.listeners.append(self._listen)

    def _listen(self, heard: list[Message]) -> None:
        self._news = True

    # ---- what the page asks

    @property
    def vocabulary(self) -> Vocabulary:
        return self._telemetry.minds.vocabulary

    @property
    def tick(self) -> int:
        """Seconds since the page began; there are no ticks here."""
        return int(self.now())

    def now(self) -> float:
        """Seconds since the page began."""
        return self._station.now - self._began

    def step(self) -> None:
        """Request telemetry of all robots once."""
        self._telemetry.look()

    @property
    def editor(self) -> None:
        """What is solid around real robots is not changed by a page."""
        return None

    def obstacles(self) -> Solids | None:
        """What is solid stays as in the scene."""
        return None

    def send_initial_telemetry(self) -> None:
        """Robots tell of themselves when they are asked."""

    def exhausted(self) -> None:
        """Nobody knows what these robots drive with."""

    def crashed(self) -> NDArray[np.bool_]:
        """Which robots tell that they have crashed, as simulated ones do."""
        return self.minds.named("crashed") > 0.0

    @property
    def recent(self) -> float:
        """A rule counts as failing as long as robots have deactivated it."""
        return 0.0

    def failing(self) -> list[FailingRule]:
        """The rules that robots have deactivated because of faults, unless their telemetry says that this is over."""
        failures, names = self._station.failures, self._station.names
        rules = (
            FailingRule(key, printable(failures.names[key]), np.array(robots, np.intp), len(robots))
            for key, robots in failures.left(names, self._telemetry.minds)
        )
        return most_first(rules)

    def pings(self) -> bytes:
        """Pings go from robot to robot; the desk does not hear them."""
        return b""

    def colours(self) -> bytes:
        """Colours are shown from robot to robot; the desk does not see them."""
        return b""

    def sensing(self, robot: int) -> BodyView | None:
        """Telemetry has the values of sensors, but not the shapes of bodies."""
        return None

    def field(self, name: str) -> FieldPicture:
        """There is none in the scene: robots tell what they sense, not what is where nobody is."""
        raise MisuseError(f"Nobody tells of the field {name:.40}.")

    def poses(self) -> bytes:
        """Where robots are, as of `packed_poses`; heading NaN: it stands aside."""
        x, y = self._places()
        heading = np.remainder(self.minds.named(HEADING), 2.0 * pi)
        lost = np.isnan(x)
        left, low, right, high = self.scene.area
        row, column = np.divmod(np.arange(np.count_nonzero(lost)), ROBOTS_PER_ROW)  # below the map
        x[lost] = left + (column + 0.5) * (right - left) / ROBOTS_PER_ROW
        y[lost] = low - (row + 0.6) * ROW * (high - low)
        z = self.minds.named(Z)
        flying = ~lost & (np.abs(z) <= FARTHEST)
        heights = np.where(flying, z, 0.0) if flying.any() else None
        return packed_poses(x, y, np.where(lost, nan, np.nan_to_num(heading)), heights)

    def _places(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """x and y of each robot, m; NaN for both where its position is unknown."""
        x, y = self.minds.named(X), self.minds.named(Y)
        known = (np.abs(x) <= FARTHEST) & (np.abs(y) <= FARTHEST)
        return np.where(known, x, nan), np.where(known, y, nan)

    # ---- what goes on

    def hear(self) -> bool:
        """Hear what has come, and ask for more if it is time; whether there is any news."""
        self._station.pump()
        if self.asking and self._telemetry.is_due(self._every):
            self._telemetry.look()
        if not self._news:
            return False
        self._news = False
        self._look()
        return True

    def orders(self) -> Iterator[SafetyOrder]:
        """What other operators said of STOP, the latest first."""
        for message in reversed(self._station.news):
            if message.kind in (Kind.STOP, Kind.RELEASE):
                yield SafetyOrder(message.sender, message.kind is Kind.STOP, message.issued)

    def stopped(self, since: float) -> int:
        """How many robots report stopped, of those whose telemetry is of later."""
        return sum(mind.stopped for mind in self._telemetry.minds.values() if mind.reported_at >= since)

    def moving(self, since: float) -> int:
        """How many of those say that they still move."""
        told = (mind.rest_state() for mind in self._telemetry.minds.values() if mind.reported_at >= since)
        return sum(rest is not None and not rest.at_rest for rest in told)

    def standing(self) -> str:
        """Robots that stand although there may have been no STOP, and why."""
        return self._telemetry.minds.standing()

    def states(self, robot: str) -> list[str]:
        """Why this one rests, and whether it is one of several."""
        mind = self._telemetry.minds.get(robot)
        shared = [SHARED] * (robot in self._station.shared_names)
        if mind is None:
            return shared
        return (
            shared + [f"until RELEASE, as {mind.doubt}"] * bool(mind.doubt) + [CATCHING_UP] * mind.telemetry.catching_up
        )

    def notices(self) -> list[str]:
        """What else is going on that a person should know of."""
        return self._station.notices()

    def silent(self) -> NDArray[np.bool_]:
        """Robots with stale telemetry."""
        late = self._station.now - self._station.stale_after
        return np.array([self._told(name) < late for name in self.scene.names], np.bool_)

    def _told(self, robot: str) -> float:
        mind = self._telemetry.minds.get(robot)
        return -inf if mind is None else mind.reported_at

    def age(self, robot: str) -> float | None:
        """Age of a robot's telemetry in s, None if there is none."""
        age = self._station.now - self._told(robot)
        return age if age < inf else None

    def awaited_release(self) -> AwaitedRelease:
        """A RELEASE, once robots have told whose STOPs hold."""
        return AwaitedRelease(self._station, self._telemetry)

    def ask_why(self, robot: str, command: str) -> PendingExplanation:
        """Ask a robot how it evaluated a command."""
        return PendingExplanation(self._station, self._telemetry, self._telemetry.ask_why(robot, command), robot)

    def _look(self) -> None:
        """Bring the columns up to date, and the scene if robots are new or have left the map."""
        names = tuple(self._station.roster)
        self.minds.look(names)
        area = self._area()
        drawn = self._outlines()
        if len(names) != len(self.scene.names) or area != self.scene.area or drawn != self.scene.areas:
            radius = self.scene.sizes[0][1] if self.scene.sizes else RADIUS
            sizes = ((len(names), radius),)
            self.scene = replace(self.scene, names=names, area=area, unit=self._unit(), sizes=sizes, areas=drawn)

    def _outlines(self) -> tuple[NamedOutline, ...]:
        """What the ground has, and what robots tell of their fences and plans."""
        told = (NamedOutline(each.name, each.points, each.closed) for each in self.vocabulary.outlines if each.points)
        return (*self._ground, *told)

    def _unit(self) -> str:
        """In which people read where robots are."""
        binding = self.vocabulary.bindings.get(X)
        quantity = binding.quantity if isinstance(binding, Variable) else None
        unit = "" if quantity is None else quantity.shown_unit
        return unit if unit in UNITS and UNITS[unit].dimension == LENGTH else self.scene.unit

    def _area(self) -> Area:
        """Where the robots and what they tell of are, with a margin; what was on the map stays on it."""
        points = [point for each in self.vocabulary.outlines for point in each.points]
        x, y = (np.append(each, [point[axis] for point in points]) for axis, each in enumerate(self._places()))
        known = ~np.isnan(x)
        if not known.any():
            return self.scene.area
        low, high = (float(x[known].min()), float(y[known].min())), (float(x[known].max()), float(y[known].max()))
        area = self.scene.area
        if self._mapped:
            if area[0] <= low[0] and area[1] <= low[1] and high[0] <= area[2] and high[1] <= area[3]:
                return area
            low, high = (min(low[0], area[0]), min(low[1], area[1])), (max(high[0], area[2]), max(high[1], area[3]))
        self._mapped = True
        wide, tall = (MARGIN * max(LEAST_SIDE, high[i] - low[i]) for i in (0, 1))
        return low[0] - wide, low[1] - tall, high[0] + wide, high[1] + tall
