"""Tables, as data frame libraries take them."""

from __future__ import annotations

import numpy as np
import polars
import pytest

import sleepcast as sc
from sleepcast.api.table import DataTable


def test_a_data_frame_has_what_the_table_has() -> None:
    table = DataTable({"robot": ["a", "", "zoë"], "fuel": np.array([0.5, np.nan, 1.0]), "count": np.array([1, 2, 3])})
    frame = polars.DataFrame(table)
    assert frame.to_dict(as_series=False) == table.to_dict()
    assert table.to_dict()["fuel"] == [0.5, None, 1.0]
    assert frame["fuel"].null_count() == 1


def test_many_rows_and_none() -> None:
    names = [f"r{number}" for number in range(1_000)]
    numbers = np.where(np.arange(1_000) % 3 == 0, np.nan, np.arange(1_000.0))
    frame = polars.DataFrame(DataTable({"robot": names, "number": numbers}))
    assert frame["robot"].to_list() == names
    assert frame["number"].null_count() == 334
    assert polars.DataFrame(DataTable({"robot": [], "number": np.empty(0)})).shape == (0, 2)


def test_a_history_is_a_data_frame_in_long_form() -> None:
    fleet = sc.open("bravo", robots=3, seed=1)
    history = fleet.history("fuel")
    fleet.run(2)
    frame = polars.DataFrame(history)
    assert frame.columns == ["time", "robot", "fuel"]
    assert frame["robot"].to_list() == [*fleet.names] * 3
    assert frame["time"].unique().sort().to_list() == pytest.approx([0.0, 1.0, 2.0])


def test_a_variable_does_not_take_the_place_of_a_key() -> None:
    fleet = sc.open("bravo", robots=3, seed=1)
    fleet.send("(PROGN (DEFVAR robot 5) (DEFVAR robot_value 9))", everybody=True)
    fleet.run(1)  # the desk hears of them
    history = fleet.history("robot", "time")
    fleet.run(2)
    now, then = fleet.table("robot", "robot_value", "fuel"), history.table()
    assert list(now.columns) == ["robot", "robot_value", "robot_value_value", "fuel"]
    assert list(now["robot"]) == list(fleet.names)
    assert (list(now["robot_value"]), list(now["robot_value_value"])) == ([5.0] * 3, [9.0] * 3)
    assert list(then.columns) == ["time", "robot", "robot_value", "time_value"]
    assert list(then["robot"]) == [*fleet.names] * 3
    assert list(then["robot_value"]) == [5.0] * 9
    assert list(then["time"])[-1] == pytest.approx(3.0)


def test_it_shows_its_first_rows() -> None:
    table = DataTable({"robot": [f"r<{number}" for number in range(12)], "fuel": np.arange(12.0)})
    assert str(table).splitlines()[:2] == ["robot  fuel", "r<0    0"]
    assert str(table).endswith("... 2 more rows")
    assert "r&lt;0" in table._repr_html_()
    assert "r<0" not in table._repr_html_()


def test_what_is_wrong_is_said() -> None:
    with pytest.raises(ValueError, match="same length"):
        DataTable({"a": ["x"], "b": np.zeros(2)})
    with pytest.raises(sc.errors.MisuseError, match="did you mean fuel"):
        DataTable({"fuel": np.zeros(2)})["fule"]


def test_who_goes_through_it_as_through_a_list_is_told_what_it_is() -> None:
    with pytest.raises(sc.errors.MisuseError, match='no column "0": wanted one of robot'):
        list(DataTable({"robot": ["r1"]}))  # type: ignore[call-overload]
