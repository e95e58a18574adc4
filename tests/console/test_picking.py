"""What the page asks the desk: the test for selected robots, and how the quantity beside a number is spread."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sleepcast.console.features import pick as picking
from sleepcast.console.features import spread as histogram
from sleepcast.console.features.pick import Pick, Picked, pick
from sleepcast.console.features.spread import GetSpread, Spread, compared, spread
from sleepcast.core.errors import MisuseError
from sleepcast.loop import Swarm
from sleepcast.station import YES, Station
from small_worlds import simulator
from swarms import station_of

COUNT = 20


@pytest.fixture
def station(tmp_path: Path) -> Station:
    """The desk of twenty rovers that have run for two seconds."""
    swarm = Swarm(simulator(tmp_path))
    swarm.desk = found = station_of(swarm)
    swarm.run(2.0)
    return found


def marks(*robots: int) -> bytes:
    bits = np.zeros(COUNT, np.uint8)
    bits[list(robots)] = 1
    return np.packbits(bits, bitorder="little").tobytes()


def source(station: Station) -> Any:
    """A desk of this station: what both features need of it."""
    scene = SimpleNamespace(names=[f"rover{number}" for number in range(1, COUNT + 1)])
    return SimpleNamespace(station=station, facts=station, scene=scene, at_once=False)


def ask(station: Station, *robots: int) -> Picked:
    found = pick(source(station), Pick(1, marks(*robots)))
    assert isinstance(found, Picked)
    return found


class TestPicking:
    def test_the_test_holds_for_the_marked_robots_alone(self, station: Station) -> None:
        robots = np.flatnonzero(station.values("(> battery 60%)")[0] == 1.0).tolist()
        found = ask(station, *robots)
        assert (found.count, found.sentence) == (len(robots), "")
        for test in found.tests:
            codes = station.preview(f"(WHEN {test} (MARK))").codes
            assert np.flatnonzero(codes == YES).tolist() == robots
        assert len(found.tests[0]) <= len("(> battery 60%)")

    def test_of_many_robots_it_is_looked_for_beside_the_server(
        self, station: Station, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        now = ask(station, 3, 4, 5)
        monkeypatch.setattr(picking, "AT_ONCE", 10)
        later = pick(source(station), Pick(1, marks(3, 4, 5)))
        assert isinstance(later, Awaitable)

        async def wait() -> Picked:
            return await later

        assert asyncio.run(wait()) == now

    def test_where_there_is_none_a_sentence_says_so(self, station: Station) -> None:
        found = ask(station, *range(0, COUNT, 2))
        assert found.tests == []
        assert found.listed.startswith("(OR (= id ")
        assert found.sentence.startswith("No 3 conditions together hold for exactly these robots.")

    def test_silent_robots_have_none(self, tmp_path: Path) -> None:
        swarm = Swarm(simulator(tmp_path))
        found = ask(station_of(swarm), 1, 2)
        assert found.sentence.startswith("2 of these robots have sent no recent telemetry")
        assert (found.tests, found.listed) == ([], "")

    @pytest.mark.parametrize("wrong", [b"", bytes(2), bytes(4), b"\0\0\xff"])
    def test_marks_of_other_robots_are_refused(self, station: Station, wrong: bytes) -> None:
        with pytest.raises(MisuseError, match="and there are 20"):
            pick(source(station), Pick(1, wrong))

    def test_nobody_is_refused(self, station: Station) -> None:
        with pytest.raises(MisuseError, match="no robot is selected"):
            ask(station)


def at(station: Station, text: str) -> Spread:
    """The histogram of the number where the text has a `|`."""
    place = text.index("|")
    return spread(source(station), GetSpread(1, text.replace("|", ""), place))


class TestHistogram:
    def test_every_robot_is_in_a_column(self, station: Station) -> None:
        found = at(station, "(WHEN (> battery |60%) (MARK))")
        values = 100.0 * station.values("battery")[0]
        assert (found.quantity, found.unit, found.unknown) == ("battery", "%", 0)
        assert (found.low, found.high) == (pytest.approx(values.min()), pytest.approx(values.max()))
        assert sum(found.every) == sum(found.deciding) == COUNT
        edges = np.linspace(found.low, found.high, len(found.every) + 1)
        assert found.every == np.histogram(values, edges)[0].tolist()

    @pytest.mark.parametrize(
        ("text", "decides"),
        [
            ("(WHEN (AND (> battery |60%) (< id 5)) (MARK))", "(< id 5)"),
            ("(WHEN (OR (> battery |60%) (< id 5)) (MARK))", "(NOT (< id 5))"),
            ("(WHEN (AND (< id 5) (NOT (> battery |60%))) (MARK))", "(< id 5)"),
        ],
    )
    def test_those_for_whom_it_decides_are_counted_apart(self, station: Station, text: str, decides: str) -> None:
        found = at(station, text)
        assert sum(found.every) == COUNT
        assert sum(found.deciding) == np.count_nonzero(station.values(decides)[0])

    def test_whole_numbers_have_a_column_each(self, station: Station) -> None:
        found = at(station, "(< id |5)")
        assert found.whole
        assert (found.low, found.high, found.every) == (0.5, 20.5, [1] * COUNT)

    def test_the_unit_is_that_of_the_number(self, station: Station) -> None:
        metres, feet = at(station, "(< x |5m)"), at(station, "(< x |5ft)")
        assert feet.high == pytest.approx(metres.high / 0.3048)

    def test_a_chain_is_read_like_a_person_reads_it(self) -> None:
        text = "(< 1m x 5m)"
        assert [compared(text, place).quantity.start for place in (3, 8)] == [6, 6]

    @pytest.mark.parametrize("text", ["(SETQ drive_speed |0.5)", "(< |1 2)", "|5", "(< (+ x |1m) 5m)"])
    def test_other_numbers_have_none(self, station: Station, text: str) -> None:
        with pytest.raises(MisuseError, match="compared with nothing"):
            at(station, text)

    def test_what_nobody_has_told_has_none(self, tmp_path: Path) -> None:
        with pytest.raises(MisuseError, match="no robot has told battery"):
            at(station_of(Swarm(simulator(tmp_path))), "(> battery |60%)")

    def test_a_value_that_all_share_stands_in_the_middle(self, station: Station) -> None:
        found = at(station, "(> (* 0.5 TRUE) |1)")
        assert found.low < 0.5 < found.high
        assert sum(found.every) == COUNT
        assert len(found.every) == histogram.BINS
