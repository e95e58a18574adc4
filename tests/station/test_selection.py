"""From robots to words: whatever robots are chosen, the tests that are found hold for exactly these, as every robot's
own mind evaluates them."""

from __future__ import annotations

from dataclasses import dataclass
from random import Random

import numpy as np
import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st

from sleepcast.core.clock import ManualClock
from sleepcast.core.errors import MisuseError
from sleepcast.core.model import NamedArea, Quantity
from sleepcast.core.units import LENGTH
from sleepcast.fleet import Fleet
from sleepcast.language import Constant, Vocabulary
from sleepcast.language.reader import Number, read
from sleepcast.station import YES, Station
from sleepcast.station.facts import Mask, facts_of, listed, shortest
from sleepcast.station.selection import MAX_FOUND, Selection, select

SENSORS = (
    Quantity("x", "m", shown_as="km"),
    Quantity("y", "m", shown_as="km"),
    Quantity("fuel", low=0.0, high=1.0, shown_as="%"),
    Quantity("heading", "rad", shown_as="deg"),
    Quantity("caste"),
    Quantity("sonar1", "m"),
)
X, Y, FUEL, HEADING, CASTE, SONAR = range(len(SENSORS))
FAMILIES = (
    "(< (DIST x y mast_x mast_y) {far}km)",
    "(> (DIST x y mast_x mast_y) {far}km)",
    "(< (DIST x y {at}km {up}km) {far}km)",
    "(AND (< {at}km x {end}km) (< {up}km y {top}km))",
    "(IN bravo)",
    "(NOT (IN bravo))",
    "(> fuel {part}%)",
    "(< heading {angle}deg)",
    "(= caste {small})",
    "marked",
    "(INSIDE yard)",
    "(KNOWN sonar1)",
    "(NOT (KNOWN sonar1))",
    "(AND (IN bravo) (> fuel {part}%))",
    "(AND marked (< (DIST x y {at}km {up}km) {far}km))",
    "(AND (INSIDE yard) (< caste {small}) (> fuel {part}%))",
    "(PROB {part}%)",
    "TRUE",
)


@dataclass
class Crowd:
    """Robots with their minds, and a desk that has their telemetry."""

    fleet: Fleet
    station: Station

    @classmethod
    def random(cls, luck: Random, count: int) -> Crowd:
        vocabulary = Vocabulary(
            "scout",
            SENSORS,
            constants=(Constant("mast_x", 4000.0, LENGTH), Constant("mast_y", 6000.0, LENGTH)),
            areas=(NamedArea("yard", (1000.0, 1000.0, 8000.0, 1000.0, 5000.0, 9000.0)),),
        )
        fleet = Fleet([f"r{i}" for i in range(count)], vocabulary, seed=luck.randrange(1000))
        readings = np.array(
            [
                (
                    luck.uniform(0.0, 1e4),
                    luck.uniform(0.0, 1e4),
                    luck.choice((luck.random(), round(luck.random(), 1))),
                    luck.uniform(-3.1, 3.1),
                    luck.randrange(4),
                    luck.choice((np.nan, luck.uniform(0.0, 5.0))),
                )
                for _ in range(count)
            ]
        )
        fleet.sense(readings, 0.0)
        for robot in fleet.values():
            for text in ("(JOIN bravo)", "(JOIN crew)", "(MARK)"):
                if luck.random() < 0.4:
                    robot.evaluate(text)
        crowd = cls(fleet, Station(vocabulary, fleet, lambda message: None, ManualClock()))
        crowd.report(range(count))
        return crowd

    def report(self, robots: range | list[int]) -> None:
        self.station.observe_many(0.0, np.array(robots, np.intp))

    def holds(self, test: str) -> Mask:
        """For whom a test holds, each robot being asked by itself."""
        return np.array([abs(robot.evaluate(test).value) > 0.0 for robot in self.fleet.values()])

    def select(self, chosen: Mask) -> Selection:
        return select(facts_of(self.station), chosen)

    def check(self, found: Selection, chosen: Mask) -> None:
        """Everything that was found holds for the chosen robots and for nobody else, and nobody doubts it."""
        for test in (*found.tests, *[found.listed] * bool(found.listed)):
            assert self.holds(test).tolist() == chosen.tolist(), test
            command = f"(WHEN {test} (MARK))"
            assert (self.station.preview(command).codes == YES).tolist() == chosen.tolist()
            assert not self.station.check(command).doubts


def chance(luck: Random) -> dict[str, str]:
    at, up = luck.uniform(0, 9), luck.uniform(0, 9)
    return {
        "far": f"{luck.uniform(1, 6):.2f}",
        "at": f"{at:.2f}",
        "up": f"{up:.2f}",
        "end": f"{at + luck.uniform(1, 6):.2f}",
        "top": f"{up + luck.uniform(1, 6):.2f}",
        "part": f"{luck.uniform(5, 95):.1f}",
        "angle": f"{luck.uniform(-120, 120):.0f}",
        "small": str(luck.randrange(1, 4)),
    }


@pytest.mark.parametrize("family", FAMILIES)
@settings(max_examples=8)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(2, 25))
def test_what_is_found_holds_for_exactly_the_chosen_robots(family: str, seed: int, count: int) -> None:
    luck = Random(seed)
    crowd = Crowd.random(luck, count)
    test = family.format(**chance(luck))
    chosen = crowd.holds(test)
    if not chosen.any():
        return
    note(test)
    found = crowd.select(chosen)
    crowd.check(found, chosen)
    if "PROB" not in family and "DIST x y {" not in family:
        assert found.tests, "there is a conjunction of three at most, and it was not found"
        assert len(found.tests[0]) <= len(test) + 1  # 100 is rounder than 99


@pytest.fixture
def crowd() -> Crowd:
    return Crowd.random(Random(7), 60)


def test_a_circle_is_found_again(crowd: Crowd) -> None:
    chosen = crowd.holds("(< (DIST x y 5km 5km) 3km)")
    found = crowd.select(chosen)
    crowd.check(found, chosen)
    assert found.tests[0].startswith(("(< (DIST x y ", "(AND (< "))
    assert len(found.tests[0]) < 45


def test_numbers_have_as_few_digits_as_still_separate(crowd: Crowd) -> None:
    fuel = crowd.station.values("fuel")[0]
    ordered = np.sort(fuel)
    gap = int(np.argmax(np.diff(ordered)))
    chosen = fuel > ordered[gap]
    tests = [test for test in crowd.select(chosen).tests if test.startswith("(> fuel ")]
    crowd.check(Selection(tuple(tests)), chosen)
    assert len(tests[0]) <= len("(> fuel 12%)")


def test_one_robot_is_named_by_its_number(crowd: Crowd) -> None:
    chosen = np.arange(60) == 17
    found = crowd.select(chosen)
    assert "(= id 18)" in found.tests
    assert found.listed == "(= id 18)"
    crowd.check(found, chosen)


def test_all_but_one_are_those_that_have_not_its_number(crowd: Crowd) -> None:
    found = crowd.select(np.arange(60) != 17)
    assert "(NOT (= id 18))" in found.tests


def test_where_there_is_no_short_test_the_robots_are_listed(crowd: Crowd) -> None:
    chosen = np.isin(np.arange(60), Random(3).sample(range(60), 25))
    found = crowd.select(chosen)
    assert found.tests == ()
    assert found.listed.startswith("(OR ")
    crowd.check(found, chosen)


def test_everybody_is_everybody(crowd: Crowd) -> None:
    assert crowd.select(np.ones(60, np.bool_)).tests == ("TRUE",)


def test_nobody_has_no_test(crowd: Crowd) -> None:
    with pytest.raises(MisuseError, match="no robot is selected"):
        crowd.select(np.zeros(60, np.bool_))


def test_robots_that_have_sent_no_telemetry_have_no_test(crowd: Crowd) -> None:
    silent = Station(crowd.station.vocabulary, crowd.fleet, lambda message: None, ManualClock())
    silent.observe_many(0.0, np.arange(10, dtype=np.intp))
    facts = facts_of(silent)
    assert select(facts, np.arange(60) == 30) == Selection((), "", 1)
    assert select(facts, np.arange(60) < 10).tests == ("TRUE",)


def test_the_same_robots_give_the_same_tests(crowd: Crowd) -> None:
    chosen = crowd.holds("(AND (IN bravo) (< (DIST x y 5km 5km) 3km))")
    first = crowd.select(chosen)
    assert first == crowd.select(chosen)
    assert len(first.tests) <= MAX_FOUND


@given(
    low=st.floats(-1e6, 1e6),
    width=st.floats(1e-9, 1e6),
    unit=st.sampled_from(["", "m", "km", "%", "deg", "kn"]),
    below=st.booleans(),
)
def test_a_literal_lies_where_it_must(low: float, width: float, unit: str, below: bool) -> None:
    high = low + width
    if not low < high:
        return
    form = read(shortest(low, high, unit, below=below))
    assert isinstance(form, Number)
    assert (low <= form.value < high) if below else (low < form.value <= high)


def test_literals_are_as_short_as_can_be() -> None:
    assert shortest(0.4321, 0.5678, "%", below=True) == "50%"
    assert shortest(9.0, 21.0, "m", below=True) == "9m"
    assert shortest(995.0, 1204.0, "m", below=True) == "1000m"
    assert shortest(3140.0, 3160.0, "km", below=False) == "3.15km"
    assert shortest(-0.2, 0.3, "", below=True) == "0"


def test_runs_of_numbers_are_one_test() -> None:
    assert listed([5, 3, 4, 9, 11, 12], 100) == "(OR (<= 3 id 5) (= id 9) (= id 11) (= id 12))"
    assert listed([1, 3, 5, 7], 2) == "(OR (OR (= id 1) (= id 3)) (OR (= id 5) (= id 7)))"
