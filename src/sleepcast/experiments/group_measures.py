"""Measures of a group as a whole: how closely it keeps together, how much it agrees, how much of the world it covers.

    polarization            1 if all robots head the same way, near 0 if each heads anywhere (Vicsek et al. 1995)
    rotation                1 if all of them circle around their centre in the same sense: the length of the mean of
                            r x v, r and v unit vectors from the centre and ahead (Couzin et al. 2002)
    gyration                root mean square distance from their centre, m
    closest                 distance between the two that are nearest to each other, in space where they fly, m
    largest_cluster 2m      share of the robots in the largest cluster, in which each is within 2 m of another one
    clusters 2m             number of clusters, single robots included
    covered 10m             share of the world within 10 m of a robot
    voronoi_cost            mean squared distance from a point of the world to the nearest robot, m2
    ground_speed            mean speed over the ground, m/s
    velocity_correlation 2m mean cosine between the velocities of robots in one cluster
    close_pairs 2m          share of all pairs of robots whose centres are nearer to each other than that

The last three are order parameters of Vásárhelyi et al. (2018), at one moment; a `time_mean` of them is that of a run.

Of particles they are those of space, but for what is covered and for Voronoi cells, which are those of the map.

An expression after it restricts the group to the robots for which it is true: `largest_cluster 2m (IN bravo)`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from math import nan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sleepcast.api.fleet import SimulatedFleet
from sleepcast.core.errors import MisuseError, decimal_comma
from sleepcast.core.extras import installing
from sleepcast.core.units import LENGTH, UNITS, to_si
from sleepcast.language.evaluate import is_true

Floats = NDArray[np.float64]

SAMPLES = 128
"""Points along each side of the world at which it is looked at: an error of about a hundredth in what is covered."""
_TEXT = re.compile(r"(\w+)(?:\s+(\d+(?:\.\d*)?|\.\d+)\s*([a-z]+))?(?:\s+(\(.+))?", re.DOTALL)


class SwarmSample(NamedTuple):
    """Some robots: positions, m, headings, rad, each of shape (robots,), and width and height of their world, m; z, m,
    0 of what does not fly, or None where nobody does; velocities over the ground, m/s, shape (2, robots); how far the
    directions of particles point up, rad, None of other robots."""

    x: Floats
    y: Floats
    heading: Floats
    size: tuple[float, float]
    z: Floats | None = None
    velocity: Floats = np.zeros((2, 0))
    pitch: Floats | None = None

    @property
    def places(self) -> tuple[Floats, ...]:
        """x and y, and z where robots fly, m: between these, distances are those of bodies."""
        return (self.x, self.y) if self.z is None else (self.x, self.y, self.z)

    @property
    def depth(self) -> Floats:
        """z of particles, m, which have measures of space; 0 of others, which have those of the map."""
        return np.zeros_like(self.x) if self.z is None or self.pitch is None else self.z

    @property
    def ahead(self) -> tuple[Floats, Floats, Floats]:
        """The unit vectors, x, y and z, along which they head."""
        pitch = np.zeros_like(self.heading) if self.pitch is None else self.pitch
        level = np.cos(pitch)
        return np.cos(self.heading) * level, np.sin(self.heading) * level, np.sin(pitch)


def polarization(group: SwarmSample, _: float) -> float:
    return _length(*(part.mean() for part in group.ahead))


def rotation(group: SwarmSample, _: float) -> float:
    """On the plane x and y of the mean are 0, and its length is what it was without them, to the last bit."""
    dx, dy, dz = (place - place.mean() for place in (group.x, group.y, group.depth))
    distance = np.hypot(np.hypot(dx, dy), dz)
    distance = np.where(distance > 0.0, distance, 1.0)
    ahead, aside, up = group.ahead
    moments = dy * up - dz * aside, dz * ahead - dx * up, dx * aside - dy * ahead
    return _length(*((moment / distance).mean() for moment in moments))


def gyration(group: SwarmSample, _: float) -> float:
    return float(np.sqrt(group.x.var() + group.y.var() + group.depth.var()))


def closest(group: SwarmSample, _: float) -> float:
    if group.x.size < 2:
        return nan
    return float(_tree(*group.places).query(np.column_stack(group.places), 2)[0][:, 1].min())


def largest_cluster(group: SwarmSample, near: float) -> float:
    return float(np.bincount(_clusters(group, near)).max() / group.x.size)


def clusters(group: SwarmSample, near: float) -> float:
    return float(_clusters(group, near).max() + 1)


def covered(group: SwarmSample, near: float) -> float:
    return float((_to_nearest(group) <= near).mean())


def voronoi_cost(group: SwarmSample, _: float) -> float:
    return float((_to_nearest(group) ** 2).mean())


def ground_speed(group: SwarmSample, _: float) -> float:
    return float(np.hypot(*group.velocity).mean())


def velocity_correlation(group: SwarmSample, near: float) -> float:
    """0 of robots that stand still, or alone."""
    speed = np.hypot(*group.velocity)
    ways, cluster = group.velocity / np.where(speed > 0.0, speed, 1.0), _clusters(group, near)
    totals = np.stack([np.bincount(cluster, way) for way in ways])[:, cluster]
    others = np.bincount(cluster)[cluster] - 1
    alike = (ways * (totals - ways)).sum(axis=0)
    return float((alike / np.maximum(others, 1)).mean())


def close_pairs(group: SwarmSample, near: float) -> float:
    count = group.x.size
    close = _tree(*group.places).query_pairs(near, output_type="ndarray")
    return len(close) / (count * (count - 1) / 2) if count > 1 else 0.0


ALONE = {each.__name__: each for each in (polarization, rotation, gyration, closest, voronoi_cost, ground_speed)}
WITHIN = {each.__name__: each for each in (largest_cluster, clusters, covered, velocity_correlation, close_pairs)}
"""Those that need a distance."""
NAMES = (*ALONE, *WITHIN)


def read_group_measure(text: str) -> Callable[[SimulatedFleet], float]:
    """The measure of a group that a text describes; it begins with one of NAMES. Raises MisuseError."""
    parts = _TEXT.fullmatch(text.strip())
    name = text.split(maxsplit=1)[0]
    measure = (ALONE | WITHIN)[name]
    distance = parts is not None and parts[2] is not None
    if parts is None or distance != (name in WITHIN):
        wanted = f"{name} 2m" if name in WITHIN else name
        comma = decimal_comma(next(iter(text.split()[1:2]), ""))
        raise MisuseError(
            f'measure "{text:.80}": wanted {wanted}, and perhaps an expression, as in {wanted} (IN bravo){comma}'
        )
    if distance and (parts[3] not in UNITS or UNITS[parts[3]].dimension != LENGTH):
        raise MisuseError(f'measure "{text:.80}": "{parts[3]:.40}" is no unit of length')
    near, predicate = to_si(float(parts[2]), parts[3]) if distance else nan, parts[4]

    def measured(fleet: SimulatedFleet) -> float:
        which = is_true(fleet[predicate]) if predicate else slice(None)
        scenario = fleet.swarm.simulator.scenario
        x, y, z, heading = (each[which] for each in (fleet.x, fleet.y, fleet.z, fleet.heading))
        size, pitch = (scenario.width, scenario.height), fleet.pitch
        above = (z, fleet.velocity[:, which], None if pitch is None else pitch[which])
        return measure(SwarmSample(x, y, heading, size, *above), near) if x.size else nan

    return measured


def _length(x: float, y: float, z: float) -> float:
    return float(np.hypot(np.hypot(x, y), z))


def _clusters(group: SwarmSample, near: float) -> NDArray[np.int32]:
    """The number of each robot's cluster, from 0."""
    tree = _tree(group.x, group.y, group.depth)  # says what is missing, if scipy is
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = tree.query_pairs(near, output_type="ndarray")
    count = group.x.size
    links = coo_array((np.ones(len(pairs), np.bool_), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    numbers: NDArray[np.int32] = connected_components(links, directed=False)[1]
    return numbers


def _to_nearest(group: SwarmSample) -> Floats:
    """Distance from each of SAMPLES times SAMPLES points of the world to the nearest robot, m."""
    middles = (np.arange(SAMPLES) + 0.5) / SAMPLES
    x, y = np.meshgrid(middles * group.size[0], middles * group.size[1])
    distances: Floats = _tree(group.x, group.y).query(np.column_stack((x.ravel(), y.ravel())))[0]
    return distances


def _tree(*places: Floats):  # type: ignore[no-untyped-def]  # scipy has no types
    """Where robots are, a column for each axis, for fast searches."""
    try:
        from scipy.spatial import KDTree
    except ImportError as error:
        raise MisuseError(f"this measure needs scipy; to install it: {installing('experiments')}") from error
    return KDTree(np.column_stack(places))
