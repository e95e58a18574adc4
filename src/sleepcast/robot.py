"""The seam between mind and body: what a mind may know of a robot and ask of it.

A body says what it is (`RobotModel`: the names it answers to, its limits, its shape), gives a `Reading` when
it is asked what it senses, and takes a `Setpoint`. Everything that may move a robot goes through here, and
the body keeps its own limits: whatever is asked of it, it does no more than `Limits` allows, and nothing once
it is stopped.

A simulated robot, a robot behind the Nomad wire and a real one are all a `Robot`; tests/robot_contract.py
says what that promises. SI units throughout; positions in the world's frame (x east, y north), angles
counter-clockwise from the x axis.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import nan
from typing import Protocol, runtime_checkable

from sleepcast.units import Dimension, Quantity


@dataclass(frozen=True, slots=True)
class Limits:
    """What a body never exceeds, whoever asks.

    speed: m/s, forwards and backwards alike. turn_rate: rad/s to either side. acceleration: m/s2, braking
    included. fence: least x, least y, greatest x, greatest y in m; the body turns back there. None: no fence.
    """

    speed: float
    turn_rate: float
    acceleration: float
    fence: tuple[float, float, float, float] | None = None


@dataclass(frozen=True, slots=True)
class Geometry:
    """A body's shape: a disc of `radius` m, with `sonars` range sensors evenly round it, number 0 in front,
    then counter-clockwise, each of which sees one sector and reads `sonar_range` m where nothing is
    nearer."""

    radius: float
    sonars: int = 0
    sonar_range: float = 0.0


@dataclass(frozen=True, slots=True)
class BodyFunction:
    """Something that a body can do or find out, to be called by name: `call(body, *arguments)`.

    The arguments are SI numbers, or one text if the function is `labelled`; the result is a number or None
    (done). dimensions: of each number, None where any will do; `least` of them must be given. result: dimension
    of the value. acts: whether calling it does something to the world. many: the name of the method that does the same
    for many bodies at once (their indices, then a column for each argument), where they are kept so that there is one.
    """

    name: str
    call: Callable[..., float | None]
    dimensions: tuple[Dimension | None, ...] = ()
    least: int | None = None
    arguments: str = ""
    result: Dimension | None = None
    acts: bool = True
    labelled: bool = False
    doc: str = ""
    many: str = ""


@dataclass(frozen=True, slots=True)
class BodyConstant:
    """A number that robots of one type know by name. value: in SI, of the dimension of `unit` ("": a plain number)."""

    name: str
    value: float
    unit: str = ""
    doc: str = ""


@dataclass(frozen=True, slots=True)
class RobotModel:
    """What all robots of one type have in common. sensors: in the order of a `Reading`'s values. actuators:
    in the order of a `Setpoint`'s fields, as many of them as the body has."""

    name: str
    sensors: tuple[Quantity, ...]
    actuators: tuple[Quantity, ...]
    functions: tuple[BodyFunction, ...]
    limits: Limits
    geometry: Geometry
    constants: tuple[BodyConstant, ...] = ()


@dataclass(frozen=True, slots=True)
class Reading:
    """What a body sensed at `time` (s, simulated or monotonic): one SI value per sensor of its model, NaN
    where it measured nothing."""

    time: float
    values: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Setpoint:
    """How a mind wants its body to move: speed in m/s, turn_rate in rad/s. NaN leaves that one as it is."""

    speed: float = nan
    turn_rate: float = nan


@runtime_checkable
class Robot(Protocol):
    """One body. None of these ever waits or fails for what a mind asks."""

    @property
    def model(self) -> RobotModel: ...

    @property
    def stopped(self) -> bool:
        """Whether the body is latched by `stop`."""

    def sense(self) -> Reading: ...

    def act(self, wanted: Setpoint) -> None:
        """Drive as wanted from now on, as far as the limits allow; while stopped, nothing."""

    def stop(self) -> None:
        """Come to rest as fast as the limits allow and stay so, whatever is asked, until `release`."""

    def release(self) -> None:
        """End `stop`. The body stays at rest until it is asked anew: nothing old resumes by itself."""

    def hold(self, still: bool) -> None:
        """Keep still for as long as `still` was the last word; then the motion of before goes on."""
