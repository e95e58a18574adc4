"""Robot types: the equipment of robots, as TOML files, and several types of robots in one world.

A table [robots], or each of several [[robots]], may name a type: one that is included, or a file. Values in the
table override those of the type.

Robots of several types share one vocabulary, all names of all types: a sensor that a type lacks is unknown on its
robots, and calling a function that it lacks is a runtime fault. Robots are numbered type by type.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import inf
from pathlib import Path

import numpy as np

from sleepcast.channel.message_batch import NameIndex
from sleepcast.core.errors import did_you_mean
from sleepcast.core.settings import Table, toml_document
from sleepcast.robot import Geometry, Limits
from sleepcast.simulator.scenario.groups import RobotGroup
from sleepcast.simulator.scenario.robot_settings import Ring, RobotSpec, Supply
from sleepcast.simulator.scenario.starts import StartPose

FORMAT = 1
"""Version of the format of type files; newer ones are refused."""
TYPES = Path(__file__).parent.parent / "types"
MAX_TYPES = 8
"""Types of robots in one world: motion and sonar of each type are computed separately."""
MADE = ("limits", "body", "wheels", "sonar", "stores", "wander", "flight", "camera")
"""What a type defines; the scenario defines how many robots there are, and where."""


def type_names() -> list[str]:
    """The included types, sorted."""
    return sorted(file.stem for file in TYPES.glob("*.toml"))


def robot_tables(root: Table) -> list[Table]:
    """The table [robots], or each of [[robots]], with the values of its type filled in. Raises SettingsError."""
    if isinstance(root.values.get("robots"), list):
        tables = root.array("robots", most=MAX_TYPES)
        if not tables:
            raise root.error("robots", "no robots at all; wanted at least one [[robots]]")
    else:
        tables = [root.table("robots")]
    return [_on_its_type(table) for table in tables]


def _on_its_type(robots: Table) -> Table:
    if not robots.has("like"):
        return robots
    name = robots.text("like", most=200)
    known = type_names()
    if name in known:
        file = TYPES / f"{name}.toml"
    elif name.endswith(".toml"):
        file = robots.file("like")
    else:
        near = did_you_mean(name, known)
        raise robots.error("like", f'no type "{name}"{near}: wanted one of {", ".join(known)}, or a file *.toml')
    below = toml_document(file).root()
    with below:
        version = below.whole("format", low=1, high=1_000_000)
        if version > FORMAT:
            raise below.error("format", f"format {version} is newer than this sleepcast, which reads format {FORMAT}")
        below.text("about", "", most=500)
        for part in MADE:
            below.has(part)
    made = {part: below.values[part] for part in MADE if part in below.values} | {"type": file.stem}
    completed = Table(robots.document, robots.values, robots.where, Table(below.document, made, ()))
    completed.has("like")
    return completed


def combined(tables: Sequence[Table], specs: Sequence[RobotSpec]) -> RobotSpec:
    """The union of robots of several types, given with their tables: every name and the widest ranges. Raises
    SettingsError if two of them use one name with different meanings."""
    if len(specs) == 1:
        return specs[0]
    kinds = {spec.type for spec in specs}
    for table, spec in zip(tables, specs, strict=True):
        for other in kinds:
            if other.startswith(spec.type) and other[len(spec.type) :].isdigit():
                raise table.error("type", f"{spec.type} with a number may mean a {other}, too: call it something else")
    rings = [spec.ring for spec in specs if spec.ring]
    wheels = [spec.wheels for spec in specs if spec.wheels]
    return replace(
        specs[0],
        type=specs[0].type if len(kinds) == 1 else "robot",
        count=sum(spec.count for spec in specs),
        limits=_widest([spec.limits for spec in specs]),
        geometry=Geometry(
            max(spec.geometry.radius for spec in specs),
            max(spec.geometry.sonars for spec in specs),
            max(spec.geometry.sonar_range for spec in specs),
        ),
        stores=_stores(tables, specs),
        wheels=wheels[0] if wheels else None,
        ring=_ring(rings) if rings else None,
        bumpers=max(spec.bumpers for spec in specs),
        starts=(),
        flight=next((spec.flight for spec in specs if spec.flight), None),
        omni=any(spec.omni for spec in specs),
        camera=max(spec.camera for spec in specs),
        groups=tuple(group for spec in specs for group in spec.groups or (RobotGroup(spec.type, spec.count, {}),)),
    )


def _widest(limits: Sequence[Limits]) -> Limits:
    flights = [each for each in limits if each.climb < inf]
    return replace(
        limits[0],
        climb=max((each.climb for each in flights), default=inf),
        floor=min((each.floor for each in flights), default=-inf),
        ceiling=max((each.ceiling for each in flights), default=inf),
        speed=max(each.speed for each in limits),
        turn_rate=max(each.turn_rate for each in limits),
        acceleration=max(each.acceleration for each in limits),
    )


def _ring(rings: Sequence[Ring]) -> Ring:
    count = max(ring.count for ring in rings)
    return replace(
        rings[0],
        count=count,
        least=min(ring.least for ring in rings),
        most=max(ring.most for ring in rings),
        pause=None,
        order=tuple(range(count)),
        crosstalk=None,
    )


def _stores(tables: Sequence[Table], specs: Sequence[RobotSpec]) -> tuple[Supply, ...]:
    stores: dict[str, Supply] = {}
    for table, spec in zip(tables, specs, strict=True):
        for store in spec.stores:
            other = stores.setdefault(store.name.casefold(), store)
            if other.name != store.name:
                raise table.table("stores").error(store.name, f"other robots spell it {other.name}; use one spelling")
            if other.dimension != store.dimension:
                raise table.table("stores").error(
                    store.name, f'other robots have it in "{other.unit or "plain numbers"}"; use one dimension'
                )
            stores[store.name.casefold()] = replace(other, full=max(other.full, store.full))
    return tuple(stores.values())


def slices(specs: Sequence[RobotSpec], count: int) -> list[slice]:
    """The slice of `count` robots that each type has: sizes as in the file, or in proportion to them, in its order."""
    ends = np.cumsum([spec.count for spec in specs])
    bounds = np.rint(ends * (count / ends[-1])).astype(np.int64).tolist()
    return [slice(begin, end) for begin, end in pairwise([0, *bounds])]


def names_of(specs: Sequence[RobotSpec], count: int) -> NameIndex:
    """Names of the robots: those that their starts give them, else their type, and a number within it."""
    if given := given_names(specs, count):
        return NameIndex(given)
    if len({spec.type for spec in specs}) == 1:
        return NameIndex(prefix=specs[0].type, count=count)
    return NameIndex(_numbered(specs, count))


def given_names(specs: Sequence[RobotSpec], count: int) -> list[str]:
    """The names of all robots, if starts name any of them; else none."""
    named = any(pose.name for spec in specs for pose in _poses(spec))
    return named_by_starts(specs, _numbered(specs, count)) if named else []


def named_by_starts(specs: Sequence[RobotSpec], names: Sequence[str]) -> list[str]:
    """These names of all robots, but for those that their starts name."""
    named = list(names)
    for spec, part in zip(specs, slices(specs, len(named)), strict=True):
        for index, pose in zip(range(part.start, part.stop), _poses(spec), strict=False):
            named[index] = pose.name or named[index]
    return named


def later_starts(spec: RobotSpec, skipped: int) -> RobotSpec | None:
    """These robots without the first starts of a list; None if too few are left."""
    rest = _poses(spec)[skipped:]
    return replace(spec, starts=rest) if len(rest) >= spec.count else None


def _poses(spec: RobotSpec) -> tuple[StartPose, ...]:
    return spec.starts if isinstance(spec.starts, tuple) else ()


def _numbered(specs: Sequence[RobotSpec], count: int) -> list[str]:
    used: dict[str, int] = {}
    names = []
    for spec, part in zip(specs, slices(specs, count), strict=True):
        first = used.get(spec.type, 0)
        used[spec.type] = first + part.stop - part.start
        names += [f"{spec.type}{number + 1}" for number in range(first, used[spec.type])]
    return names
