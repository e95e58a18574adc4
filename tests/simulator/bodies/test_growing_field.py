"""Growing fields: growth against theory, diffusion without loss, fair shares in any order, the same bits everywhere."""

from __future__ import annotations

from dataclasses import replace
from math import exp
from pathlib import Path

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.core.serial import SerialError
from sleepcast.experiments.measures import MeasureError, read_measure
from sleepcast.simulator import Simulator
from sleepcast.simulator.bodies.bodies import Floats
from sleepcast.simulator.bodies.growing_field import ADD, TAKE, GrowingField
from sleepcast.simulator.packing import pack as packed_scenario
from sleepcast.simulator.scenario.fields import Growth, ScalarField
from sleepcast.simulator.snapshot import SimulatorState, resume, state_of
from small_worlds import simulator, write

LOGISTIC = Growth(4, 3, 2.0, 0.5, True, 0.0)
DELAYED = Growth(4, 3, 2.0, 0.0, False, 0.0, delay=0.5)
SIZE = (40.0, 30.0)
ALGAE = """
[fields.algae]
base = 0.5
hills = [{ x = "300m", y = "300m", peak = 1, radius = "200m" }]

[fields.algae.growth]
cell = "100m"
most = 2
rate = 0.05
diffusion = 20
"""


def field(growth: Growth = LOGISTIC, *, start: float = 0.5, robots: int = 5, torus: bool = False) -> GrowingField:
    numbers = np.arange(robots, dtype=np.uint64)
    return GrowingField(growth, SIZE, torus, 0.1, numbers, np.full((growth.rows, growth.columns), start))


def at(*cells: int) -> tuple[Floats, Floats]:
    """The middles of these cells."""
    row, column = np.divmod(np.array(cells), LOGISTIC.columns)
    return 10.0 * column + 5.0, 10.0 * row + 5.0


class TestGrowth:
    def test_logistic_growth_is_exact(self) -> None:
        grown = field()
        for _ in range(40):
            grown.step(0)
        expected = 2.0 / (1.0 + (2.0 / 0.5 - 1.0) * exp(-0.5 * 4.0))
        assert grown.amount == pytest.approx(np.full((3, 4), expected), rel=1e-12)

    @pytest.mark.parametrize("rate", [0.5, 1000.0])
    def test_it_ends_at_the_most(self, rate: float) -> None:
        grown = field(replace(LOGISTIC, rate=rate))
        for _ in range(1000):
            grown.step(0)
        assert grown.amount == pytest.approx(np.full((3, 4), 2.0))
        assert grown.amount.max() <= 2.0

    def test_what_is_empty_stays_empty(self) -> None:
        grown = field(start=0.0)
        grown.step(0)
        assert not grown.amount.any()

    def test_constant_growth_and_decay(self) -> None:
        grown = field(replace(LOGISTIC, logistic=False))
        for _ in range(10):
            grown.step(0)
        assert grown.amount == pytest.approx(np.full((3, 4), 1.0))
        waning = field(replace(LOGISTIC, logistic=False, rate=-1.0))
        for _ in range(10):
            waning.step(0)
        assert not waning.amount.any()


class TestDelay:
    def test_a_cell_that_is_emptied_is_full_again_after_its_delay(self) -> None:
        grass = field(DELAYED, start=2.0)
        grass.ask(TAKE, np.array([0, 1]), np.array([2.0, 0.5]), *at(5, 6))
        amounts = []
        for _ in range(7):
            grass.step(0)
            amounts.append(grass.amount[1, 1])
        assert amounts == [0.0] * 5 + [2.0] * 2
        assert grass.amount[1, 2] == 1.5, "one that was not emptied stays as it is"

    def test_what_several_take_to_the_last_crumb_empties_a_cell(self) -> None:
        grass = field(DELAYED, start=0.3)
        for _ in range(3):
            grass.ask(TAKE, np.array([0]), np.array([0.1]), *at(5))
            grass.step(0)
        grass.ask(TAKE, np.array([0]), np.array([0.1]), *at(5))
        for _ in range(6):
            grass.step(0)
        assert grass.amount[1, 1] == 2.0

    def test_cells_are_sown_by_chance_and_all_are_full_after_a_delay(self) -> None:
        many = replace(DELAYED, columns=40, rows=30, sown=0.25)
        start = np.full((30, 40), 2.0)
        grass, other = (GrowingField(many, SIZE, False, 0.1, np.arange(1, dtype=np.uint64), start, k) for k in (1, 2))
        assert grass.amount.mean() == pytest.approx(0.5, abs=0.15)
        assert (grass.amount != other.amount).any()
        full = []
        for _ in range(5):
            grass.step(0)
            full.append(int((grass.amount > 0.0).sum()))
        assert full[-1] == 1200
        assert np.diff(full).min() > 100, "a part of them in each tick"


class TestDiffusion:
    @pytest.mark.parametrize("torus", [True, False])
    def test_nothing_is_lost_and_differences_vanish(self, torus: bool) -> None:
        still = field(replace(LOGISTIC, rate=0.0, diffusion=100.0), torus=torus)
        still.amount[0, 0] = 2.0
        total = still.amount.sum()
        for _ in range(2000):
            still.step(0)
        assert still.amount.sum() == pytest.approx(total)
        assert np.ptp(still.amount) < 1e-6

    def test_only_a_torus_has_neighbours_across_the_edge(self) -> None:
        for torus in (True, False):
            still = field(replace(LOGISTIC, rate=0.0, diffusion=100.0), start=0.0, torus=torus)
            still.amount[0, 0] = 2.0
            still.step(0)
            assert bool(still.amount[0, 3] > 0.0) is torus
            assert bool(still.amount[2, 0] > 0.0) is torus


class TestSlopes:
    def test_they_are_those_between_the_cells_on_both_sides(self) -> None:
        ramp = field(start=0.0)
        ramp.amount[:] = np.arange(4) * 0.5 + np.arange(3)[:, None] * 0.1
        value, across, up = ramp.read(*at(0, 5, 11))
        assert value == pytest.approx([0.0, 0.6, 1.7])
        assert across == pytest.approx([0.05] * 3)
        assert up == pytest.approx([0.01] * 3)

    def test_across_the_edge_of_a_torus(self) -> None:
        ramp = field(start=0.0, torus=True)
        ramp.amount[0, 3] = 2.0
        assert ramp.read(*at(0))[1] == pytest.approx([-0.1])


class TestRequests:
    def still(self) -> GrowingField:
        return field(replace(LOGISTIC, rate=0.0))

    def test_one_robot_takes_what_it_wants_in_the_next_tick(self) -> None:
        still = self.still()
        still.ask(TAKE, np.array([2]), np.array([0.2]), *at(5))
        assert still.amount[1, 1] == 0.5
        assert still.step(0).tolist() == [0.0, 0.0, 0.2, 0.0, 0.0]
        assert still.amount[1, 1] == 0.3
        assert not still.step(0).any()

    def test_where_there_is_too_little_all_get_the_same_share(self) -> None:
        still = self.still()
        still.ask(TAKE, np.arange(4), np.array([0.3, 0.6, 0.1, 0.2]), *at(5, 5, 5, 6))
        assert still.step(0) == pytest.approx([0.15, 0.3, 0.05, 0.2, 0.0])
        assert still.amount[1, 1] == 0.0
        assert still.amount[1, 2] == pytest.approx(0.3)

    def test_in_turn_one_gets_all_that_it_wants_and_chance_says_who(self) -> None:
        first = set()
        for tick in range(30):
            grass = field(replace(DELAYED, in_turn=True), start=0.5)
            grass.ask(TAKE, np.array([3, 0, 1, 2, 4]), np.array([0.3, 0.1, 0.3, 0.3, 0.1]), *at(5, 6, 5, 5, 6))
            taken = grass.step(tick)
            assert np.sort(taken[1:4]) == pytest.approx([0.0, 0.2, 0.3])
            assert taken[[0, 4]].tolist() == [0.1, 0.1], "there is enough for both"
            assert grass.amount[1].tolist() == [0.5, 0.0, 0.3, 0.5]
            first.add(int(np.argmax(taken)))
        assert first == {1, 2, 3}

    def test_what_is_added_stays_below_the_most(self) -> None:
        still = self.still()
        still.ask(ADD, np.arange(3), np.array([1.0, 1.0, 0.25]), *at(5, 5, 6))
        still.step(0)
        assert still.amount[1, 1:3].tolist() == [2.0, 0.75]

    def test_taking_comes_first(self) -> None:
        still = self.still()
        still.ask(ADD, np.array([0]), np.array([1.0]), *at(5))
        still.ask(TAKE, np.array([1]), np.array([1.0]), *at(5))
        assert still.step(0).tolist() == [0.0, 0.5, 0.0, 0.0, 0.0]
        assert still.amount[1, 1] == 1.0

    def test_the_last_wish_counts_and_a_negative_one_is_none(self) -> None:
        still = self.still()
        for amount in (0.4, 0.1):
            still.ask(TAKE, np.array([0]), np.array([amount]), *at(5))
        still.ask(TAKE, np.array([1]), np.array([-1.0]), *at(6))
        assert still.step(0).tolist() == [0.1, 0.0, 0.0, 0.0, 0.0]

    def test_the_order_of_asking_does_not_matter(self) -> None:
        drawn = np.random.default_rng(1)
        cells, amounts = drawn.integers(0, 3, 5), drawn.uniform(0.1, 0.7, 5)
        results = []
        for order in (np.arange(5), np.array([3, 1, 4, 0, 2])):
            still = self.still()
            for robot in order:
                still.ask(TAKE, np.array([robot]), amounts[[robot]], *at(int(cells[robot])))
            results.append((still.step(0).tobytes(), still.amount.tobytes()))
        assert results[0] == results[1]


def grazing(folder: Path) -> Simulator:
    sim = simulator(folder, ('motion = "still"', 'motion = "wander"'), more=ALGAE)
    for _ in range(10):
        ask(sim)
        sim.step()
    return sim


def ask(sim: Simulator) -> None:
    functions = {function.name: function for function in sim.model.functions}
    for robot in range(0, 20, 2):
        functions["TAKE_ALGAE"].call(sim.robots[robot], 0.1 * robot)
    many = functions["ADD_ALGAE"].many
    assert many
    many(sim.robots, np.arange(1, 20, 2), np.full(10, 0.01))


class TestState:
    def test_a_resumed_run_goes_on_to_the_last_bit(self, tmp_path: Path) -> None:
        sim = grazing(tmp_path)
        ask(sim)
        again = resume(state_of(sim))
        assert again.state_hash() == sim.state_hash()
        for each in (sim, again):
            each.step()
            ask(each)
            each.step()
        assert again.state_hash() == sim.state_hash()
        assert again.readings() == sim.readings()

    def test_amounts_and_wishes_are_state(self, tmp_path: Path) -> None:
        sim = grazing(tmp_path)
        before = sim.state_hash()
        ask(sim)
        assert sim.state_hash() != before
        sim.senses.arrays()["amount of field algae"][0, 0] += 0.125
        assert sim.state_hash() != before

    @pytest.mark.parametrize(
        ("name", "value"),
        [("amount", -1.0), ("amount", np.nan), ("amount", 9.0), ("wanted", np.inf), ("cells", 100), ("cells", -1)],
    )
    def test_what_no_run_comes_to_is_refused(self, tmp_path: Path, name: str, value: float) -> None:
        sim = grazing(tmp_path)
        sim.senses.arrays()[f"{name} of field algae"][0, 0] = value
        with pytest.raises(SerialError, match=name):
            resume(state_of(sim))

    @pytest.mark.parametrize("value", [-1, 999])
    def test_a_delay_no_run_comes_to_is_refused(self, tmp_path: Path, value: int) -> None:
        sim = simulator(tmp_path, more=ALGAE.replace("rate = 0.05\ndiffusion = 20", 'law = "delayed"\ndelay = "9s"'))
        state = state_of(sim)
        assert resume(state).state_hash() == sim.state_hash()
        sim.senses.arrays()["waiting of field algae"][0, 0] = value
        with pytest.raises(SerialError, match="waiting"):
            resume(state_of(sim))

    @pytest.mark.parametrize(
        ("growth", "sentence"),
        [
            (Growth(2000, 2000, 2.0, 0.1, True, 0.0), "cells"),
            (Growth(10, 10, 2.0, 1e9, True, 0.0), "growth"),
            (Growth(10, 10, 2.0, 0.1, True, 1e6), "diffusion"),
            (Growth(10, 10, 2.0, 0.0, False, 0.0, 1e9), "delay"),
            (Growth(10, 10, 2.0, 0.0, False, 0.0, 1.0, 2.0), "sown"),
        ],
    )
    def test_a_scenario_with_what_cannot_be_is_refused(self, tmp_path: Path, growth: Growth, sentence: str) -> None:
        sim = grazing(tmp_path)
        (algae,) = sim.scenario.fields
        assert isinstance(algae, ScalarField)
        state = state_of(sim)
        packed = packed_scenario(replace(sim.scenario, fields=(replace(algae, growth=growth),)))
        changed = {name: getattr(state, name) for name in state.__struct_fields__} | {"scenario": packed}
        with pytest.raises(SerialError, match=sentence):
            resume(SimulatorState(**changed))


RULE = "(RULE graze (COND ((> algae 0.6) (TAKE_ALGAE (* 0.02 id))) ((> algae_dx 0) (ADD_ALGAE 0.01))))"


def test_one_robot_at_a_time_and_all_at_once_give_the_same_bits(tmp_path: Path) -> None:
    """A fleet evaluates a rule in columns; the same rule evaluated robot by robot asks for the same."""
    path = str(write(tmp_path, ('motion = "still"', 'motion = "wander"'), more=ALGAE))
    with sc.open(path, seed=5) as together, sc.open(path, seed=5) as alone:
        together.send(RULE, everybody=True)
        alone.send("(RULE graze 1)", everybody=True)
        assert together.time == alone.time
        text = RULE.removeprefix("(RULE graze ").removesuffix(")")
        for _ in range(30):
            together.swarm.step()
            for name in reversed(alone.swarm.simulator.names):
                alone.swarm.evaluate(name, text)
            alone.swarm.step()
        amounts = [each.swarm.simulator.senses.arrays()["amount of field algae"] for each in (together, alone)]
        assert amounts[1].tobytes() == amounts[0].tobytes()
        assert (together["algae_taken"] > 0.0).any()


def test_experiments_measure_what_all_cells_have(tmp_path: Path) -> None:
    with sc.open(str(write(tmp_path, more=ALGAE)), seed=5) as fleet:
        amount = fleet.swarm.simulator.senses.arrays()["amount of field algae"]
        assert read_measure("field algae")(fleet) == amount.sum() > 0.0
        with pytest.raises(MeasureError, match=r'no growing field "alga" \(did you mean algae\?\)'):
            read_measure("field alga")(fleet)
