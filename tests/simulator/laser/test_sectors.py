"""What expressions ask of a scan, beside the same in plain Python."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isnan, nan, pi, radians
from random import Random

import numpy as np
import pytest

from sleepcast.simulator.laser.sectors import gap, least
from sleepcast.simulator.scenario.scanners import LaserModel

AROUND = LaserModel(12, -pi, radians(30), 0.2, 5.0, 0.0)
"""Beams at -180, -150, ... 150 degrees."""
AHEAD = LaserModel(7, radians(-90), radians(30), 0.2, 5.0, 0.0)


def ask(model: LaserModel, ranges: Sequence[float], first: float, last: float) -> float:
    return float(least(model, np.array([ranges], np.float32), np.array([radians(first)]), np.array([radians(last)]))[0])


def bearing(model: LaserModel, ranges: list[float], first: float, last: float, *free: float) -> float:
    ends = np.array([radians(first)]), np.array([radians(last)])
    return float(np.degrees(gap(model, np.array([ranges], np.float32), *ends, *(np.array([x]) for x in free))[0]))


class TestLeast:
    RANGES = (4.0, 3.5, 3.0, 2.5, 2.0, 1.5, 1.0, 1.25, 1.75, inf, inf, inf)

    @pytest.mark.parametrize(
        ("first", "last", "found"),
        [
            (-30, 30, 1.0),  # through 0
            (30, 60, 1.25),  # the ends belong to it
            (31, 60, 1.75),
            (0, 0, 1.0),
            (330, 350, 1.5),
            (90, 150, nan),  # nothing returns
            (1, 29, nan),  # no beam is there
            (150, -150, 3.5),  # counter-clockwise, past the back
            (30, -30, 1.25),  # all but what is ahead
            (-180, 180, 1.0),
            (0, 360, 1.0),
            (-1000, 1000, 1.0),
        ],
    )
    def test_of_sectors(self, first: float, last: float, found: float) -> None:
        assert ask(AROUND, self.RANGES, first, last) == pytest.approx(found, nan_ok=True)

    def test_too_near_counts_as_the_nearest_that_is_measured(self) -> None:
        assert ask(AHEAD, [1.0, 1.0, 1.0, -inf, 1.0, 1.0, 1.0], -30, 30) == 0.2

    def test_a_sector_behind_a_scanner_that_looks_ahead(self) -> None:
        assert isnan(ask(AHEAD, [1.0] * 7, 120, -120))

    def test_of_nobody(self) -> None:
        assert least(AHEAD, np.empty((0, 7), np.float32), np.empty(0), np.empty(0)).shape == (0,)
        assert gap(AHEAD, np.empty((0, 7), np.float32), np.empty(0), np.empty(0)).shape == (0,)


class TestGap:
    @pytest.mark.parametrize(
        ("ranges", "first", "last", "free", "found"),
        [
            ([1, 1, 1, 4, 4, 1, 1], -90, 90, (), 15),  # half as far as 4 m or more
            ([1, 1, 1, 4, 4, 1, 1], -90, 90, (0.5,), 0),  # all are free for half a metre
            ([1, 1, 1, 4, 4, 1, 1], -90, 90, (4.5,), nan),
            ([1, 1, 1, 4, 4, 1, 1], -90, -30, (), -60),
            ([1, inf, 1, 4, 4, 1, 1], -90, 90, (), 15),  # nothing within 5 m; 4 m is more than half of it
            ([1, inf, 1, 2.4, 2.4, 1, 1], -90, 90, (), -60),
            ([4, 4, 1, 1, 1, 4, 4], -90, 90, (), -75),  # equally wide and equally far off: the first one
            ([4, 4, 1, 4, 4, 1, 1], -90, 90, (), 15),  # equally wide: nearer to the heading
            ([inf] * 7, -90, 90, (), 0),
            ([inf] * 7, 0, 90, (), 45),
            ([inf] * 7, 120, 240, (), nan),  # no beam is there
            ([-inf] * 7, -90, 90, (), nan),
            ([-inf, -inf, 1, -inf, -inf, -inf, -inf], -90, 90, (), -30),
        ],
    )
    def test_of_a_scanner_that_looks_ahead(
        self, ranges: list[float], first: float, last: float, free: tuple[float, ...], found: float
    ) -> None:
        assert bearing(AHEAD, ranges, first, last, *free) == pytest.approx(found, nan_ok=True, abs=1e-6)

    def test_a_gap_goes_on_past_the_back(self) -> None:
        ranges = [4.0, 4.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 4.0]
        assert bearing(AROUND, ranges, -180, 180) == pytest.approx(-180)
        assert bearing(AROUND, ranges, 0, 359.999) == pytest.approx(-180)
        assert bearing(AROUND, ranges, -90, 90) == pytest.approx(0, abs=1e-6), "of equal ones all are one gap"

    def test_a_gap_does_not_go_on_where_no_beam_looks(self) -> None:
        assert bearing(AHEAD, [4.0, 1.0, 1.0, 1.0, 1.0, 1.0, 4.0], 0, 360, 3.0) == pytest.approx(90)

    def test_a_whole_turn_that_is_free_leads_ahead(self) -> None:
        assert bearing(AROUND, [inf] * 12, -180, 180) == pytest.approx(0, abs=1e-6)


def plain(model: LaserModel, ranges: list[float], first: float, last: float, free: float | None) -> tuple[float, float]:
    """Least range and bearing of the widest gap, beam by beam."""
    wide = last - first
    wide = wide if wide >= 2 * pi else wide % (2 * pi)
    angles = model.angles.tolist()
    order = sorted(range(model.beams), key=lambda k: (angles[k] - first + 1e-9) % (2 * pi))
    order = [k for k in order if (angles[k] - first + 1e-9) % (2 * pi) <= wide + 2e-9]
    told = [ranges[k] for k in order if ranges[k] < inf]
    nearest = nan if not told else max(min(told), model.least) if min(told) == -inf else min(told)
    depth = {k: model.reach if ranges[k] == inf else max(ranges[k], 0.0) for k in order}
    most = max(depth.values(), default=0.0)
    enough = most / 2 if free is None else free
    runs, whole = list[list[int]](), len(order) == model.beams and model.closed
    for k in order * 2 if whole else order:
        if depth[k] < enough or most == 0:
            runs.append([])
        elif runs and runs[-1] and (runs[-1][-1] + 1) % model.beams == k and (k or model.closed):
            runs[-1] += [k] if len(runs[-1]) < model.beams else []
        else:
            runs.append([k])
    width = max(map(len, runs), default=0)
    if not width or (whole and width == model.beams):
        return nearest, 0.0 if width else nan
    middles = [angles[r[0]] + (width - 1) * model.increment / 2 for r in runs if len(r) == width]
    middles = [(m + pi) % (2 * pi) - pi for m in middles]
    return nearest, min(middles, key=lambda m: round(abs(m) / 1e-9))


@pytest.mark.parametrize("alike", [True, False])
def test_random_scans(alike: bool) -> None:
    random, count = Random(7), 150
    for model in (AROUND, AHEAD, LaserModel(1, 0.3, 2 * pi, 0.2, 5.0, 0.0), LaserModel(1, 0.3, 1.0, 0.2, 5.0, 0.0)):
        some = [0.5, 1.0, 2.0, 3.0, 5.0, inf, inf, -inf]
        ranges = np.array([[random.choice(some) for _ in range(model.beams)] for _ in range(count)], np.float32)
        ends = np.array([[random.uniform(-8, 8) for _ in range(2)] for _ in range(count)])
        if alike:
            ends[:] = ends[0]
        for free in (None, 2.0):
            nearest = least(model, ranges, *ends.T)
            middle = gap(model, ranges, *ends.T, *([] if free is None else [np.full(count, free)]))
            for i in range(count):
                expected = plain(model, ranges[i].tolist(), *ends[i].tolist(), free)
                off = (middle[i] - expected[1] + pi) % (2 * pi) - pi
                assert nearest[i] == pytest.approx(expected[0], nan_ok=True), (i, ends[i])
                assert isnan(middle[i]) == isnan(expected[1]), (i, ends[i])
                assert isnan(off) or abs(off) < 1e-6, (i, ends[i])
