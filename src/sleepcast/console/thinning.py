"""What of a timeline takes how many bytes, and what of it is left out when they become too many.

Pictures are left out evenly: every second one, again and again. Of accounts, those go first that were told anew later,
then the oldest.
"""

from __future__ import annotations

from sleepcast.console.account_table import CommandRow
from sleepcast.console.timeline import Kind, RobotMarks, Timeline, Track
from sleepcast.console.view import Outline

BESIDE = 250
"""Bytes of a picture besides its content: of one robot they are most of it."""
CORNER = 150
"""Bytes of a corner of an obstacle."""
ROW = 700
"""Bytes of an account besides its texts."""


def cut(into: Track[Kind], track: Track[Kind], time: float) -> None:
    """Have what a track has up to a time."""
    count = track.before(time)
    into.times, into.values = track.times[:count], track.values[:count]


# ---- pictures


def size_of_marks(marks: RobotMarks) -> int:
    """Bytes that marks take, about."""
    return BESIDE + len(marks.groups) + len(marks.flags) + len(marks.second) + len(marks.colours)


def size_of_obstacles(solid: tuple[tuple[Outline, ...], ...]) -> int:
    """Bytes that obstacles take, about."""
    return BESIDE + sum(CORNER * (1 + len(corners)) for outlines in solid for corners in outlines)


def size_of_pictures(timeline: Timeline) -> int:
    """Bytes of all pictures, with the marks, failing rules and obstacles on them, but for the obstacles of now: these
    are there in any case."""
    poses = sum(BESIDE + len(data) for _, data in timeline.poses.values)
    failures = sum(BESIDE + each.size for each in timeline.failures.values)
    solid = sum(map(size_of_obstacles, timeline.obstacles.values[:-1]))
    return poses + failures + solid + sum(map(size_of_marks, timeline.marks.values))


def thin(timeline: Timeline, every: int) -> None:
    """Leave out all pictures but the first and those of every so many ticks."""
    poses = timeline.poses
    kept = [at for at, (tick, _) in enumerate(poses.values) if tick % every == 0 or at == 0]
    poses.times, poses.values = [poses.times[at] for at in kept], [poses.values[at] for at in kept]
    _keep_seen(timeline.marks, poses.times)
    _keep_seen(timeline.failures, poses.times)
    _keep_seen(timeline.obstacles, poses.times)


def _keep_seen(track: Track[Kind], times: list[float]) -> None:
    """Leave out what a track has at none of these times, but not the last, which holds now."""
    needed = {at - 1 for time in times if (at := track.before(time))}
    if track.times:
        needed.add(len(track.times) - 1)
    kept = sorted(needed)
    track.times, track.values = [track.times[at] for at in kept], [track.values[at] for at in kept]


# ---- accounts


def size_of_row(row: CommandRow) -> int:
    """Bytes that an account takes, about."""
    return ROW + len(row.text) + len(row.values) + len(row.scope)


def size_of_rows(timeline: Timeline) -> int:
    """Bytes of all accounts."""
    return sum(map(size_of_row, timeline.rows.values))


def forget_accounts(timeline: Timeline, most: int) -> None:
    """Leave out accounts until they take half as many bytes as they may."""
    _drop_superseded(timeline.rows)
    _drop_oldest(timeline.rows, size_of_rows(timeline) - most // 2)


def _drop_superseded(rows: Track[CommandRow]) -> None:
    """Leave out those of the older half of which there is a later one in it, of the same command."""
    half = len(rows.times) // 2
    latest = {row.id: at for at, row in enumerate(rows.values[:half])}
    _keep(rows, [*sorted(latest.values()), *range(half, len(rows.times))])


def _drop_oldest(rows: Track[CommandRow], size: int) -> None:
    """Leave out the oldest, so many bytes of them; but it stays known whether STOP held."""
    count, latch = 0, list[int]()
    while size > 0 and count < len(rows.values) - 1:
        row = rows.values[count]
        size -= size_of_row(row)
        latch = [count] if row.kind in ("stop", "release") else latch
        count += 1
    _keep(rows, [*latch, *range(count, len(rows.times))])


def _keep(rows: Track[CommandRow], places: list[int]) -> None:
    rows.times, rows.values = [rows.times[at] for at in places], [rows.values[at] for at in places]
