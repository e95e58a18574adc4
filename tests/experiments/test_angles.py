"""Measures of angles: circular in a run, over runs, and in figures."""

from __future__ import annotations

from math import isnan, pi, radians
from pathlib import Path

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.experiments.angles import angles_of
from sleepcast.experiments.drawing import around, band, direction
from sleepcast.experiments.figures import figure
from sleepcast.experiments.findings import CurveAxes, SweepFindings
from sleepcast.experiments.measures import angle_of, read_measure
from sleepcast.experiments.plan import Experiment, experiment_of
from sleepcast.experiments.results import Results, RunResult
from sleepcast.experiments.run import run_all
from sleepcast.station.account import values_in_words

FIELD = """format = 1
title = "west"
seconds = "1s"
[world]
width = "20m"
height = "20m"
[robots]
type = "rover"
motion = "still"
starts = [[5, 5, "{}deg"], [5, 10, "{}deg"], [5, 15, "{}deg"]]
limits = {{ speed = "1m/s", turn_rate = "1rad/s", acceleration = "1m/s2" }}
body.radius = "0.2m"
[neighbours]
reach = "9m"
shares = {{ course = "deg", share = "" }}
"""


def measured(text: str, headings: tuple[int, int, int] = (170, 180, -170)) -> float:
    """A measure in degrees, of three rovers that head there."""
    return float(np.degrees(read_measure(text)(sc.open(FIELD.format(*headings)))))


class TestInARun:
    def test_the_mean_of_what_heads_west_is_west(self) -> None:
        assert abs(measured("mean heading")) == pytest.approx(180.0)
        assert abs(measured("median heading")) == pytest.approx(180.0)
        assert abs(measured("mean (- heading 90deg)", (-90, -80, -100))) == pytest.approx(180.0)
        assert measured("mean heading", (10, 20, 30)) == pytest.approx(20.0)

    def test_least_and_greatest_lie_on_either_side_of_it(self) -> None:
        assert measured("min heading") == pytest.approx(170.0)
        assert measured("max heading") == pytest.approx(-170.0)
        assert measured("quantile 0.25 heading") == pytest.approx(175.0)
        assert measured("gap heading") == pytest.approx(340.0)
        assert measured("std heading") == pytest.approx(measured("std heading", (-10, 0, 10)))

    def test_it_is_unknown_where_directions_cancel(self) -> None:
        for text in ("mean heading", "min heading", "median heading", "std heading"):
            assert isnan(measured(text, (0, 120, -120)))

    def test_other_numbers_have_the_means_of_numbers(self) -> None:
        assert read_measure("mean x")(sc.open(FIELD.format(0, 0, 0))) == 5.0

    def test_an_answer_is_summed_up_in_the_same_way(self) -> None:
        fleet = sc.open(FIELD.format(170, 180, -170))
        asked = fleet.ask("(- heading 0)")
        found = asked.account.values
        assert found is not None
        assert np.degrees([found.least, abs(found.mean), found.greatest]) == pytest.approx([170.0, 180.0, -170.0])
        said = values_in_words(fleet.station.commands()[-1], asked.account)
        assert "min 170 deg, mean" in said

    def test_robots_know_the_same_mean_of_their_neighbours(self) -> None:
        fleet = sc.open(FIELD.format(180, 170, -170))
        fleet.send("(SHARE_COURSE heading)", everybody=True)
        fleet.run(0.2)
        for text in ("(MEAN_HEADING 9m)", "(MEAN_COURSE 9m)"):
            found = np.degrees(np.abs(fleet[text]))
            assert found == pytest.approx([170.0, 175.0, 170.0])
        opposite = sc.open(FIELD.format(90, 45, -90))  # the one in the middle sees two that are opposite
        assert isnan(opposite["(MEAN_HEADING 6m)"][1])


@pytest.fixture
def experiment(tmp_path: Path) -> Experiment:
    """Two seeds, and headings that are none of chance."""
    (tmp_path / "scenario.toml").write_text(FIELD.format(170, 180, -170))
    measures = ["west=mean heading", "mean x", "spread=std heading"]
    return experiment_of(str(tmp_path), measures=measures, over=["radio.loss=0,0.5"], seeds=3)


class TestOverRuns:
    def test_measures_that_are_angles_are_known(self, experiment: Experiment) -> None:
        assert angles_of(experiment) == {"west"}
        assert angle_of("quantile 0.9 (WRAP x)") == "(WRAP x)"
        assert [angle_of(text) for text in ("order heading", "std heading", "count heading", "polarization")] == [
            ""
        ] * 4

    def test_a_mark_of_a_curve_is_a_direction(self, experiment: Experiment) -> None:
        found = SweepFindings(experiment)
        for run in experiment.runs():
            degrees = ((179, -179, 180) if run.point["radio.loss"] == 0 else (0, 120, -120))[run.seed - 1]
            found.add(RunResult(run, ((1.0, radians(degrees), 5.0, 0.1),)))
        (curve,) = found.curves(CurveAxes("radio.loss", "west")).curves
        (mark,) = curve.marks  # where directions cancel there is none
        assert abs(mark.mean) == pytest.approx(pi)
        assert mark.high - mark.low == pytest.approx(radians(2.0), abs=0.01)

    def test_bands_and_boxes_go_around(self) -> None:
        west = np.radians([179.0, -179.0])
        mean, low, high = band(west, angle=True)
        assert (abs(mean), high - low) == (pytest.approx(pi), pytest.approx(radians(2.0)))
        assert np.ptp(around(direction(west), west)) == pytest.approx(radians(2.0))
        assert all(map(isnan, band(np.array([0.0, pi]), angle=True)))

    def test_a_figure_says_so_to_its_program(self, experiment: Experiment, tmp_path: Path) -> None:
        pytest.importorskip("matplotlib")
        with Results(tmp_path / "found", experiment) as results:
            assert len(list(run_all(results, 1))) == 6
        for kind, by in (("line", None), ("box", None), ("heat", "seed")):
            out = tmp_path / f"{kind}.svg"
            figure(tmp_path / "found", out, x="radio.loss", y=["west"], by=by, kind=kind, title="")
            assert "angles=['west']" in out.with_suffix(".py").read_text()
