"""The measures of a scenario's experiment, of a fleet that runs on a page."""

from __future__ import annotations

from math import isnan
from pathlib import Path

import pytest

import sleepcast as sc
from sleepcast.core.errors import SleepcastError
from sleepcast.experiments import live
from sleepcast.experiments.live import live_measures, recorded_measures


def test_the_measures_of_an_experiment_are_taken_when_asked() -> None:
    fleet = sc.open("vicsek", robots=30, seed=2)
    ((name, text, read),) = live_measures(fleet)
    assert (name, text) == ("order", "polarization")
    assert 0.0 < read() < 0.9  # each heads anywhere
    fleet.swarm.simulator.bodies.heading[:] = 1.0
    fleet.run(1.0, quiet=True)
    assert read() == pytest.approx(1.0)


def test_series_of_the_scenario_itself_are_among_them() -> None:
    fleet = sc.open("braitenberg", robots=5, seed=2)
    found = {name: read for name, _, read in live_measures(fleet)}
    assert {"distance_to_light", "radius_of_gyration"} <= set(found)
    assert found["radius_of_gyration"]() > 0.0


def test_both_are_shown_where_they_share_a_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "_texts", lambda *_: {"radius_of_gyration": "mean x"})
    found = live_measures(sc.open("braitenberg", robots=5, seed=2))
    names = [name for name, _, _ in found]
    assert {"radius_of_gyration", "radius_of_gyration_value"} <= set(names)
    assert len(set(names)) == len(names)


def test_a_scenario_without_an_experiment_has_none() -> None:
    assert live_measures(sc.open("crowd", robots=5)) == []


def test_a_recording_names_them_and_says_what_is_not_in_it() -> None:
    ((name, text, read),) = recorded_measures("vicsek")
    assert (name, text) == ("order", "polarization")
    with pytest.raises(SleepcastError, match="not in a recording"):
        read()
    assert recorded_measures("crowd") == []


def test_of_a_scenario_of_ones_own_they_stand_beside_it(tmp_path: Path) -> None:
    file = tmp_path / "experiment.toml"
    file.write_text('scenario = "crowd"\n[measures]\nfar = "max x"\nodd = "nowhere.spread"\n', encoding="utf-8")
    fleet = sc.open("crowd", robots=5)
    far, odd = (read for _, _, read in live_measures(fleet, tmp_path))
    assert far() == fleet["x"].max()
    with pytest.raises(SleepcastError, match=r"nowhere\.spread.* is not run"):
        odd()
    file.write_text("measures = 5", encoding="utf-8")
    assert live_measures(fleet, tmp_path) == []


def test_of_too_many_robots_nothing_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    fleet = sc.open("vicsek", robots=30, seed=2)
    ((_, _, read),) = live_measures(fleet)
    assert not isnan(read())
    monkeypatch.setattr(live, "MAX_ROBOTS", 29)
    with pytest.raises(SleepcastError, match="at most 29"):
        read()
