"""Sorts of Nomads: what the three axes of each are, and how fast they may turn. SI, and words of the wire at the edge.

A Scout has a right and a left wheel. A Nomad 200 has wheels that steer together, and a turret with the sonars, which
follows the steering as long as nobody turns it: so what is in front of the turret is what is ahead.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi

from sleepcast.nomad.report import State
from sleepcast.nomad.units import TENTH, TENTH_DEGREE
from sleepcast.robot import Axes, Limits

_DEGREE = pi / 180.0


@dataclass(frozen=True, slots=True)
class Base:
    """A sort of Nomad. radius: of the body, m. limits: whatever is asked of it. track: between its wheels, m; 0 where
    they steer together. units: what one of the wire is for each axis, m or rad; 0 for an axis that it lacks.
    accelerations: of each axis at most, m/s2 or rad/s2."""

    name: str
    radius: float
    limits: Limits
    track: float
    units: Axes
    accelerations: Axes

    def limited(self, limits: Limits) -> Base:
        """The same, never asked for more than this, nor for more than it can."""
        share = min(1.0, limits.acceleration / self.limits.acceleration)
        slower = Axes(*(most * share for most in self.accelerations))
        return replace(self, limits=self.limits.within(limits), accelerations=slower)

    @property
    def speeds(self) -> Axes:
        """Of each axis at most, in whole units of the wire."""
        speed, turn_rate = self.limits.speed, self.limits.turn_rate
        return self.whole(Axes(speed, speed, 0.0) if self.track else Axes(speed, turn_rate, turn_rate))

    def axes(self, speed: float, turn_rate: float) -> Axes:
        """Speeds of the axes for a body that goes so fast along its heading (m/s) and turns so fast (rad/s)."""
        if not self.track:
            return Axes(speed, turn_rate, turn_rate)
        return Axes(speed + turn_rate * self.track / 2.0, speed - turn_rate * self.track / 2.0, 0.0)

    def motion(self, speeds: Axes) -> tuple[float, float]:
        """The other way: speed and turn rate."""
        first, second, _ = speeds
        return ((first + second) / 2.0, (first - second) / self.track) if self.track else (first, second)

    def within(self, speeds: Axes) -> Axes:
        """Speeds within the limits; two wheels slow down together, so that the body stays on its curve."""
        if self.track:
            speed, turn_rate = self.motion(speeds)
            limits = self.limits
            turn_rate = min(max(turn_rate, -limits.turn_rate), limits.turn_rate)
            speeds = self.axes(min(max(speed, -limits.speed), limits.speed), turn_rate)
            most = self.speeds.first
            share = min(1.0, most / max(abs(speeds.first), abs(speeds.second), most))
            return Axes(speeds.first * share, speeds.second * share, 0.0)
        return Axes(*(min(max(speed, -most), most) for speed, most in zip(speeds, self.speeds, strict=True)))

    def whole(self, sizes: Axes) -> Axes:
        """As much of each as the wire can say, at most."""
        return Axes(
            *(int(size / unit + 1e-6) * unit if unit else 0.0 for size, unit in zip(sizes, self.units, strict=True))
        )

    def words(self, values: Axes) -> tuple[int, int, int]:
        """Values of the axes as the wire has them."""
        first, second, third = (round(v / unit) if unit else 0 for v, unit in zip(values, self.units, strict=True))
        return first, second, third

    def measured(self, state: State) -> tuple[float, float]:
        """Speed and turn rate that a server tells."""
        first, second, third = (word * unit for word, unit in zip(state.velocities, self.units, strict=True))
        return self.motion(Axes(first, second, third))


SCOUT = Base(
    "scout",
    radius=0.17,
    # Its wheels could turn it twice as fast on the spot, but no sonar could follow.
    limits=Limits(speed=1.0, turn_rate=pi, acceleration=2.0),
    track=0.3452,
    units=Axes(TENTH, TENTH, 0.0),
    accelerations=Axes(2.0, 2.0, 0.0),
)
NOMAD200 = Base(
    "nomad200",
    radius=0.225,
    limits=Limits(speed=0.508, turn_rate=45.0 * _DEGREE, acceleration=0.762),
    track=0.0,
    units=Axes(TENTH, TENTH_DEGREE, TENTH_DEGREE),
    accelerations=Axes(0.762, 60.0 * _DEGREE, 60.0 * _DEGREE),
)
BASES = {base.name: base for base in (SCOUT, NOMAD200)}
