"""What the console shows: the swarm as it wants to see it, and the scene in which the swarm moves.

The console knows no simulator and no loop. The roof gives it something with these few members.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple, Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from sleepcast.console.sensing import BodyView
from sleepcast.core.model import ReadyCommand, RestState
from sleepcast.fleet.failing import FailingRule
from sleepcast.fleet.marks import FleetMarks
from sleepcast.language import Vocabulary
from sleepcast.station import ObservedMind


class MapLabel(msgspec.Struct, frozen=True):
    """A named point; x, y in m of the world's frame. key: robots know it as the variables KEY_x and KEY_y; "" if they
    do not."""

    name: str
    x: float
    y: float
    key: str = ""


Outline = tuple[tuple[float, float], ...]


class NamedOutline(msgspec.Struct, frozen=True, omit_defaults=True):
    """A named area by the corners of its outline, (x, y) in m, or a way, which is not closed."""

    name: str
    corners: Outline
    closed: bool = True


class ShownSlider(msgspec.Struct, frozen=True):
    """A number that may be changed, between `low` and `high` in steps, all in `unit`."""

    name: str
    title: str
    unit: str
    value: float
    low: float
    high: float
    step: float


class PicturePlace(msgspec.Struct, frozen=True):
    """Where a picture lies under the world: its lower left corner, m; by how much it is turned round that, rad,
    counter-clockwise; and the side of a pixel, m."""

    x: float
    y: float
    yaw: float
    resolution: float


class ShownField(msgspec.Struct, frozen=True):
    """A field that fills the world. about: what it is, "" for nothing. grows: whether it changes as time passes."""

    name: str
    about: str
    grows: bool


class FieldPicture(msgspec.Struct, frozen=True):
    """A field as a map of cells that fill the world, row by row from the bottom: a byte each, 0 where it is least, 255
    where it is greatest. scale: the values of 0, of the middle and of 255, with their unit. angles: where vectors
    point, a byte each, 256 for a whole turn, counter-clockwise from x; empty of other fields."""

    columns: int
    rows: int
    cells: bytes
    scale: tuple[str, str, str]
    angles: bytes = b""


class ReliefMap(msgspec.Struct, frozen=True):
    """How high the ground is, at points in even distances that fill the world from edge to edge, row by row from the
    bottom: two bytes each, the lower one first, 0 at `low` and 65535 at `high`, m."""

    columns: int
    rows: int
    cells: bytes
    low: float
    high: float


class Solids(NamedTuple):
    """What is solid, and how high that is; both as in a scene."""

    obstacles: tuple[tuple[Outline, ...], ...]
    tall: tuple[float | None, ...] = ()


class Scene(msgspec.Struct, frozen=True):
    """What does not change while the swarm runs.

    title, story: of the scenario
    noun: what the robots are called, in the plural
    names: of the robots, by their index
    area: least x, least y, greatest x, greatest y in m
    unit: a length of `sleepcast.core.units`, in which people read the map
    sizes: how many robots have bodies of which radius (m), in the order of their indices
    kinds: what those of each size are called, empty where all are of one kind
    forms: what those of each size look like in three dimensions: "copter", "plane" or "rover"; empty where none flies
    cameras: how much farther those of each size see below them with each metre of height, 0 of those without a camera;
        empty where none has one
    places, lights: where they are, with their names
    areas: those that robots know by name from the start, and ways
    obstacles: each is what lies inside an odd number of its closed outlines, lists of corners (x, y) in m
    tall: how high each of them is, m, none without limit; empty where all are without
    version: of the obstacles, where people may change them; else None
    addable: the types of robots that people may add
    commands: ready-made ones
    supplies: what robots use up when they drive, such as fuel
    blanks: numbers that ready-made commands name in braces
    repeats: how often those that work only together are sent, since the radio may lose one
    picture: where the picture of the map lies, None if there is none; the desk is asked for it
    fields: likewise
    relief: how high the ground is, None where it is flat
    senses: of the robots, those that see or hear something elsewhere; unset where nobody can tell what they see
    """

    title: str
    story: str
    noun: str
    names: tuple[str, ...]
    area: tuple[float, float, float, float]
    unit: str
    sizes: tuple[tuple[int, float], ...]
    kinds: tuple[str, ...] = msgspec.field(default=(), name="sorts")
    forms: tuple[str, ...] = ()
    cameras: tuple[float, ...] = ()
    places: tuple[MapLabel, ...] = ()
    lights: tuple[MapLabel, ...] = ()
    areas: tuple[NamedOutline, ...] = ()
    obstacles: tuple[tuple[Outline, ...], ...] = ()
    tall: tuple[float | None, ...] = ()
    version: int | None = None
    addable: tuple[str, ...] = ()
    commands: tuple[ReadyCommand, ...] = ()
    supplies: tuple[str, ...] = ()
    blanks: tuple[ShownSlider, ...] = ()
    repeats: int = 1
    picture: PicturePlace | None = None
    fields: tuple[ShownField, ...] = ()
    relief: ReliefMap | None = None
    senses: tuple[str, ...] | msgspec.UnsetType = msgspec.UNSET


class KeptRule(Protocol):
    """One expression that a robot keeps: its last value (SI, people read it in `unit`) is NaN, its last fault "" where
    there is none."""

    @property
    def name(self) -> str: ...
    @property
    def text(self) -> str: ...
    @property
    def active(self) -> bool: ...
    @property
    def last_value(self) -> float: ...
    @property
    def last_fault(self) -> str: ...
    @property
    def priority(self) -> int: ...
    @property
    def unit(self) -> str: ...


class MindView(ObservedMind, Protocol):
    """A mind that can be looked into from here."""

    def rest_state(self) -> RestState | None:
        """Whether the stopped body has come to rest; None if it does not tell."""

    def variables(self) -> Iterable[tuple[str, float]]:
        """Every variable by name with its value in SI, NaN for unknown."""

    def rules(self) -> Iterable[KeptRule]:
        """Every kept expression."""


class MindsView(FleetMarks, Protocol):
    """All minds: one by its name, and what the page asks of all of them, in the order of `scene.names`."""

    def __getitem__(self, name: str, /) -> MindView: ...

    def heard(self) -> Iterable[str]:
        """Every name that any robot has learned, as written."""


class ObstacleChange(NamedTuple):
    """A change that was made. change: its number, by which it can be undone; obstacle: that of the thing, which it
    keeps while others come and go."""

    change: int
    obstacle: int


class ObstacleEditor(Protocol):
    """Changes what is solid. A thing is known by its index among the obstacles of this version. All raise MisuseError,
    and change nothing then."""

    @property
    def version(self) -> int:
        """Counts the changes."""

    def build(self, corners: Sequence[tuple[float, float]]) -> ObstacleChange:
        """Add a polygon with these corners, m."""

    def shift(self, version: int, index: int, dx: float, dy: float) -> ObstacleChange:
        """Move a thing by this vector, m."""

    def clear(self, version: int, index: int) -> ObstacleChange:
        """Take a thing away."""

    def undo(self, change: int, again: bool) -> None:
        """Undo a change, or (again) do once more what was undone."""


Picture = Callable[[], bytes]
"""Gives a picture of the map as a PNG, which may take a while. Raises SleepcastError."""


class SwarmView(Protocol):
    """A swarm in its scene. vocabulary: what all minds know."""

    @property
    def scene(self) -> Scene: ...
    @property
    def minds(self) -> MindsView: ...
    @property
    def vocabulary(self) -> Vocabulary: ...
    @property
    def picture(self) -> Picture | None:
        """The picture that the scene tells the place of."""

    @property
    def editor(self) -> ObstacleEditor | None:
        """What changes the obstacles, None where nobody may."""

    @property
    def tick(self) -> int:
        """Ticks since the start."""

    def now(self) -> float:
        """Simulated seconds since the start."""

    def send_initial_telemetry(self) -> None:
        """Let the station know how robots are, if there has been no tick that would have."""

    def step(self) -> None:
        """One tick of everything: bodies, channel, minds, and the station's news of them."""

    def obstacles(self) -> Solids | None:
        """What is solid now, as in the scene; None while it is what the scene says."""

    @property
    def recent(self) -> float:
        """Simulated seconds after a fault for which its rule counts as failing."""

    def failing(self) -> list[FailingRule]:
        """The rules that fail on any robot now or have a short while ago, those on most robots first."""

    def pings(self) -> bytes:
        """Who has pinged since this was last asked: as in a frame, empty for nobody."""

    def exhausted(self) -> NDArray[np.bool_] | None:
        """Which robots have used up one of the scene's supplies, so that they stand; None where nobody knows."""

    def crashed(self) -> NDArray[np.bool_] | None:
        """Which robots have crashed, and lie where they fell; None where none can, or nobody knows."""

    def colours(self) -> bytes:
        """The colour that each robot shows: as in a frame, empty for none."""

    def field(self, name: str) -> FieldPicture:
        """A field of the scene as it is now."""

    def sensing(self, robot: int) -> BodyView | None:
        """What the body of the robot with this index senses, None where nobody knows."""

    def poses(self) -> bytes:
        """Where robots are, as of `frames.packed_poses`."""


class PaceControl(Protocol):
    """How fast the swarm runs. factor: simulated seconds in a second that are wanted. paused: time stands still."""

    factor: float
    paused: bool

    @property
    def achieved(self) -> float:
        """Recent speed: simulated seconds in a second."""

    def keep_up(self, budget: float) -> int:
        """Make the ticks that are due, for at most about `budget` s; gives how many were made."""
