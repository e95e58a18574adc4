"""Stocks: what robots take from and add to, and that no result depends on the order in which they do it."""

from __future__ import annotations

from math import isnan
from pathlib import Path

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.core.serial import SerialError
from sleepcast.core.settings import SettingsError
from sleepcast.experiments.measures import MeasureError, read_measure
from sleepcast.simulator import Simulator, load
from sleepcast.simulator.engine import choose
from sleepcast.simulator.snapshot import resume, state_of
from small_worlds import SMALL, simulator, write

ORE = """
[stocks.ore]
x = "500m"
y = "500m"
radius = "10m"
start = "6kg"
"""
LOAD = '\n[robots.stores.load]\nstart = ["0kg", "0kg"]\nfull = "2kg"\n'
CARRIED = ORE + 'store = "load"\n' + LOAD


def at_the_stock(folder: Path, more: str, away: float = 0.0) -> Simulator:
    """Twenty robots that stand still at the stock, or so far east of it, m."""
    sim = simulator(folder, more=more)
    sim.bodies.x[:], sim.bodies.y[:] = 500.0 + away, 500.0
    return sim


def ask(sim: Simulator, name: str, robots: list[int], amounts: list[float]) -> None:
    function = next(each for each in sim.model.functions if each.name == name)
    assert function.many
    function.many(sim.robots, np.array(robots), np.array(amounts))


def sensed(sim: Simulator, name: str) -> np.ndarray:
    return sim.sensed[[sensor.name for sensor in sim.model.sensors].index(name)]


class TestTaking:
    def test_what_is_taken_in_one_tick_is_gone_in_the_next(self, tmp_path: Path) -> None:
        sim = at_the_stock(tmp_path, CARRIED)
        ask(sim, "TAKE_ORE", [3, 4], [1.0, 0.5])
        assert sensed(sim, "ore").tolist() == [6.0] * 20
        sim.step()
        assert sensed(sim, "ore").tolist() == [4.5] * 20
        assert sensed(sim, "load")[:5].tolist() == [0, 0, 0, 1.0, 0.5]
        sim.step()
        assert sim.stocks() == {"ore": 4.5}

    def test_requests_of_one_tick_add_up(self, tmp_path: Path) -> None:
        sim = at_the_stock(tmp_path, CARRIED)
        for _ in range(3):
            ask(sim, "TAKE_ORE", [3], [0.25])
        sim.step()
        assert sensed(sim, "load")[3] == 0.75

    def test_too_little_is_shared_in_proportion(self, tmp_path: Path) -> None:
        sim = at_the_stock(tmp_path, CARRIED)
        ask(sim, "TAKE_ORE", [0, 1, 2, 3, 4], [2.0, 2.0, 2.0, 1.0, 1.0])
        sim.step()
        assert sim.stocks() == {"ore": 0.0}
        assert sensed(sim, "load")[:5].tolist() == [1.5, 1.5, 1.5, 0.75, 0.75]

    def test_only_within_the_radius(self, tmp_path: Path) -> None:
        sim = at_the_stock(tmp_path, CARRIED, away=10.5)
        sim.bodies.x[3] = 509.5
        ask(sim, "TAKE_ORE", [2, 3], [1.0, 1.0])
        ask(sim, "GIVE_ORE", [2], [1.0])
        sim.step()
        assert sim.stocks() == {"ore": 5.0}
        assert sensed(sim, "load")[:4].tolist() == [0, 0, 0, 1.0]

    def test_a_store_takes_no_more_than_fits(self, tmp_path: Path) -> None:
        sim = at_the_stock(tmp_path, CARRIED)
        ask(sim, "TAKE_ORE", [0], [5.0])
        sim.step()
        assert sensed(sim, "load")[0] == 2.0
        assert sim.stocks() == {"ore": 4.0}

    def test_nobody_takes_less_than_nothing(self, tmp_path: Path) -> None:
        sim = at_the_stock(tmp_path, CARRIED)
        ask(sim, "TAKE_ORE", [0, 1], [-1.0, 1.0])
        sim.step()
        assert sim.stocks() == {"ore": 5.0}

    def test_one_robot_takes_at_its_rate(self, tmp_path: Path) -> None:
        sim = at_the_stock(tmp_path, ORE + 'rate = "2kg"\n')
        for _ in range(2):
            ask(sim, "TAKE_ORE", [0, 1], [1.0, 0.1])
        sim.step()  # a tick is 0.1 s
        assert sim.stocks()["ore"] == pytest.approx(6.0 - 0.2 - 0.2)


class TestAdding:
    def test_what_is_added_leaves_the_store(self, tmp_path: Path) -> None:
        sim = at_the_stock(tmp_path, CARRIED.replace('"0kg", "0kg"', '"1kg", "1kg"'))
        ask(sim, "GIVE_ORE", [0, 1], [0.25, 3.0])
        sim.step()
        assert sim.stocks() == {"ore": 7.25}
        assert sensed(sim, "load")[:3].tolist() == [0.75, 0.0, 1.0]

    def test_what_does_not_fit_in_stays_with_the_robots(self, tmp_path: Path) -> None:
        more = CARRIED.replace('"0kg", "0kg"', '"1kg", "1kg"').replace('"6kg"', '"6kg"\ncapacity = "7kg"')
        sim = at_the_stock(tmp_path, more)
        ask(sim, "GIVE_ORE", [0, 1], [1.0, 1.0])
        sim.step()
        assert sim.stocks() == {"ore": 7.0}
        assert sensed(sim, "load")[:3].tolist() == [0.5, 0.5, 1.0]

    def test_what_is_added_can_be_taken_in_the_same_tick(self, tmp_path: Path) -> None:
        sim = at_the_stock(tmp_path, ORE.replace('"6kg"', '"0kg"'))
        ask(sim, "TAKE_ORE", [0], [1.0])
        ask(sim, "GIVE_ORE", [1], [3.0])
        sim.step()
        assert sim.stocks() == {"ore": 2.0}

    def test_the_inflow_ends_at_the_capacity(self, tmp_path: Path) -> None:
        sim = at_the_stock(tmp_path, ORE + 'capacity = "6.25kg"\ninflow = "1kg"\n')
        levels = []
        for _ in range(4):
            sim.step()
            levels.append(sim.stocks()["ore"])
        assert levels == pytest.approx([6.1, 6.2, 6.25, 6.25])

    def test_an_endless_stock_never_changes(self, tmp_path: Path) -> None:
        sim = at_the_stock(tmp_path, CARRIED.replace('"6kg"', '"1kg"\nendless = true'))
        ask(sim, "TAKE_ORE", [0, 1], [2.0, 2.0])
        sim.step()
        assert sim.stocks() == {"ore": 1.0}
        assert sensed(sim, "load")[:2].tolist() == [2.0, 2.0]

    def test_a_charger_fills_a_battery_as_driving_empties_it(self, tmp_path: Path) -> None:
        more = ORE.replace('"6kg"', '"100%"\nendless = true\nrate = "10%"\nstore = "battery"')
        sim = at_the_stock(tmp_path, more)
        sim.bodies.stores[0] = 0.5
        ask(sim, "TAKE_ORE", list(range(20)), [1.0] * 20)
        sim.step()
        assert sensed(sim, "battery") == pytest.approx(0.51)


class TestSensing:
    def test_its_place_is_known_and_its_amount_within_reach(self, tmp_path: Path) -> None:
        sim = at_the_stock(tmp_path, ORE + 'reach = "100m"\n', away=101.0)
        sim.bodies.x[0] = 599.0
        sim.step()
        assert (sensed(sim, "ore_x")[5], sensed(sim, "ore_y")[5]) == (500.0, 500.0)
        assert sensed(sim, "ore")[0] == 6.0
        assert isnan(sensed(sim, "ore")[1])

    def test_across_the_edge_of_a_torus(self, tmp_path: Path) -> None:
        text = SMALL.replace('height = "1km"', 'height = "1km"\nedge = "torus"')
        sim = Simulator(load(write(tmp_path, text=text, more=ORE.replace('x = "500m"', 'x = "1km"'))))
        sim.bodies.x[:], sim.bodies.y[:] = 5.0, 500.0
        ask(sim, "TAKE_ORE", [0], [1.0])
        sim.step()
        assert sim.stocks() == {"ore": 5.0}

    def test_two_stocks_share_one_store(self, tmp_path: Path) -> None:
        more = CARRIED + ORE.replace("ore", "coal") + 'store = "load"\n'
        sim = at_the_stock(tmp_path, more)
        for name in ("TAKE_COAL", "TAKE_ORE"):
            ask(sim, name, [0], [1.5])
        sim.step()
        assert sim.stocks() == {"ore": 4.5, "coal": 5.5}  # in the order of the file
        assert sensed(sim, "load")[0] == 2.0


class TestOneResult:
    def test_the_order_of_robots_does_not_matter(self, tmp_path: Path) -> None:
        chance = np.random.default_rng(5)
        amounts = chance.random(20)
        found = []
        for order in (np.arange(20), chance.permutation(20)):
            sim = at_the_stock(tmp_path, CARRIED)
            for robot in order.tolist():
                ask(sim, "TAKE_ORE", [robot], [amounts[robot]])
            sim.step()
            found.append(sim.state_hash())
        assert found[0] == found[1]

    def test_one_robot_and_all_at_once(self, tmp_path: Path) -> None:
        amounts = np.random.default_rng(6).random(20)
        alone, together = (at_the_stock(tmp_path, CARRIED) for _ in range(2))
        function = next(each for each in alone.model.functions if each.name == "TAKE_ORE")
        for robot in range(20):
            function.call(alone.robots[robot], float(amounts[robot]))
        ask(together, "TAKE_ORE", list(range(20)), amounts.tolist())
        for each in (alone, together):
            each.step()
        assert alone.state_hash() == together.state_hash()

    def test_a_run_has_one_result_on_any_number_of_threads(self, tmp_path: Path) -> None:
        path = str(write(tmp_path, ('motion = "still"', 'motion = "wander"'), more=CARRIED.replace("10m", "400m")))
        found = []
        for threads in (1, 2):
            with sc.open(path, threads=threads) as fleet:
                fleet.send("(RULE dig (TAKE_ORE (* 0.001kg battery)))", everybody=True)
                fleet.run(20, quiet=True)
                assert 0.0 < fleet.swarm.simulator.stocks()["ore"] < 5.5
                found.append(fleet.swarm.simulator.state_hash())
        assert found[0] == found[1]

    def test_with_compiled_kernels(self, tmp_path: Path) -> None:
        pytest.importorskip("numba")
        path = write(tmp_path, more=CARRIED)
        found = []
        for name in ("numpy", "numba"):
            sim = Simulator(load(path), machine=choose(name, 2))
            sim.bodies.x[:], sim.bodies.y[:] = 500.0, 500.0
            ask(sim, "TAKE_ORE", list(range(20)), [0.4] * 20)
            sim.step()
            found.append((sim.stocks(), sensed(sim, "load").tolist()))
        assert found[0] == found[1]


class TestState:
    def test_levels_and_requests_are_state(self, tmp_path: Path) -> None:
        sim = at_the_stock(tmp_path, CARRIED)
        sim.step()
        before = sim.state_hash()
        ask(sim, "TAKE_ORE", [1], [1.0])
        assert sim.state_hash() != before
        again = resume(state_of(sim))
        assert again.state_hash() == sim.state_hash()
        for each in (sim, again):
            each.step()
        assert again.stocks() == sim.stocks() == {"ore": 5.0}

    def test_a_snapshot_with_less_than_nothing_is_refused(self, tmp_path: Path) -> None:
        sim = at_the_stock(tmp_path, CARRIED)
        assert sim.senses.stocks
        sim.senses.stocks.level[0] = -1.0
        with pytest.raises(SerialError, match="stock levels"):
            resume(state_of(sim))


class TestInExpressions:
    def test_rules_and_measures(self, tmp_path: Path) -> None:
        path = str(write(tmp_path, more=CARRIED.replace('"10m"', '"1km"') + ORE.replace("ore", "coal")))
        with sc.open(path) as fleet:
            sent = fleet.send("(WHEN (> ore 1kg) (TAKE_ORE 0.1kg))", everybody=True, wait=0)
            fleet.run(1, quiet=True)
            assert len(sent.matched) == 20
            left = [read_measure(text)(fleet) for text in ("stock ore", "mean ore", "stock ore coal", "sum load")]
            assert left == pytest.approx([4.0, 4.0, 10.0, 2.0])
            with pytest.raises(MeasureError, match=r'no stock "or" \(did you mean ore\?\)'):
                read_measure("stock or")(fleet)
            with pytest.raises(sc.errors.SleepcastError, match="cannot be previewed"):
                fleet["(TAKE_ORE 1kg)"]

    def test_a_stopped_robot_takes_nothing(self, tmp_path: Path) -> None:
        with sc.open(str(write(tmp_path, more=CARRIED.replace('"10m"', '"1km"')))) as fleet:
            fleet.send("(RULE dig (TAKE_ORE 0.01kg))", everybody=True)
            fleet.run(1, quiet=True)
            fleet.stop()
            left = fleet.swarm.simulator.stocks()
            fleet.run(1, quiet=True)
            assert 0.0 < left["ore"] == fleet.swarm.simulator.stocks()["ore"]

    def test_without_a_stock_there_is_no_measure(self, tmp_path: Path) -> None:
        with sc.open(str(write(tmp_path))) as fleet, pytest.raises(MeasureError, match="has none"):
            read_measure("stock ore")(fleet)


class TestStores:
    def test_a_store_can_run_down_with_time(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path, ('reach = "20km"', 'reach = "20km"\nlasts = "100s"'))
        sim.bodies.stores[0] = 0.5
        sim.bodies.stores[0, 1] = 0.001
        for _ in range(100):
            sim.step()
        assert sensed(sim, "battery")[0] == pytest.approx(0.4)
        assert sensed(sim, "battery")[1] == 0.0

    def test_without_lasts_time_uses_none(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        before = sim.bodies.stores.copy()
        sim.step()
        assert np.array_equal(sim.bodies.stores, before)

    def test_types_of_robots_have_stores_of_their_own(self, tmp_path: Path) -> None:
        loads = '[robots.stores.load]\nstart = ["0kg", "0kg"]\nfull = {}\n'
        sorts = SMALL.split("[robots]")[0] + "".join(
            f'[[robots]]\nlike = "disc"\ntype = "{name}"\ncount = {count}\n{more}'
            for name, count, more in (
                ("rover", 20, loads.format('"2kg"\nlasts = "100s"')),
                ("truck", 2, loads.format('"9kg"')),
                ("spectator", 1, ""),
            )
        )
        sim = Simulator(load(write(tmp_path, text=sorts, more=ORE.replace('"6kg"', '"90kg"') + 'store = "load"\n')))
        sim.bodies.x[:], sim.bodies.y[:] = 500.0, 500.0
        ask(sim, "TAKE_ORE", [0, 20, 22], [20.0, 20.0, 20.0])
        sim.step()
        assert sim.stocks() == {"ore": 79.0}
        load_of = sensed(sim, "load")
        assert (load_of[0], load_of[20], isnan(load_of[22])) == (2.0, 9.0, True)
        sim.step()
        assert (load_of[0], load_of[20]) == (pytest.approx(1.998), 9.0)


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        (('radius = "10m"', ""), "stocks.ore.radius: is missing"),
        (('radius = "10m"', 'radius = "0m"'), "stocks.ore.radius: wanted a length"),
        (('x = "500m"', 'x = "2km"'), "stocks.ore.x: wanted a length from 0km to 1km"),
        (('start = "6kg"', 'start = "-6kg"'), "stocks.ore.start: wanted a value"),
        (('start = "6kg"', 'start = "6kg"\ncapacity = "5kg"'), "stocks.ore.capacity: wanted a mass of at least 6kg"),
        (('start = "6kg"', 'start = "6kg"\ncapacity = "50%"'), "stocks.ore.capacity: wanted a mass"),
        (('start = "6kg"', 'start = "6kg"\ninflow = "5m"'), "stocks.ore.inflow: wanted a mass"),
        (('start = "6kg"', 'start = "6kg"\nendless = true\ninflow = "5kg"'), "stocks.ore.inflow: an endless stock"),
        (('start = "6kg"', 'start = "6kg"\nstore = "battery"'), "battery is a plain number, and this stock is a mass"),
        (('start = "6kg"', 'start = "6kg"\nstore = "load"'), "stocks.ore.store: wanted one of battery"),
        (('start = "6kg"', 'start = "6kg"\nshop = "load"'), "stocks.ore.shop: unknown key"),
        (("[stocks.ore]", "[stocks.house]"), "robots have a variable house_x already"),
        (("[stocks.ore]", "[stocks.speed]"), "robots have a variable speed already"),
        (("[stocks.ore]", "[stocks.BATTERY]"), "robots have a variable BATTERY already"),
        (("[stocks.ore]", "[constants]\nore = 1\n[stocks.ore]"), "constants.ore: robots know something of this name"),
    ],
)
def test_a_stock_that_cannot_be(tmp_path: Path, changed: tuple[str, str], sentence: str) -> None:
    with pytest.raises(SettingsError) as caught:
        load(write(tmp_path, more=ORE.replace(*changed)))
    assert sentence in str(caught.value)


def test_there_are_not_too_many(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="at most 16 fit"):
        load(write(tmp_path, more="".join(ORE.replace("ore", f"ore{number}") for number in range(17))))
