"""Bodies that are simulated for one node, each in a world of its own."""

from __future__ import annotations

from pathlib import Path

import pytest

from sleepcast.bridges import Opening, open_robot
from sleepcast.robot import Failsafe

SKY = """
format = 2
title = "a sky"
seconds = "1min"

[world]
width = "10m"
height = "10m"

[robots]
like = "crazyflie"
count = 1
z = ["1m", "1m"]
flight.failsafe = "{failsafe}"
"""


@pytest.mark.parametrize(("failsafe", "height"), [("land", 0.0), ("hover", 1.0)])
def test_a_copter_whose_operator_is_gone_does_what_its_type_says(failsafe: str, height: float, tmp_path: Path) -> None:
    (tmp_path / "scenario.toml").write_text(SKY.format(failsafe=failsafe))
    with open_robot(f"sim:{tmp_path}", Opening(in_step=True)) as body:
        assert isinstance(body, Failsafe)
        body.let_go()
        readings = [body.sense() for _ in range(80)]
    sensors = [sensor.name for sensor in body.model.sensors]
    assert readings[-1].values[sensors.index("height")] == height


def test_on_the_ground_there_is_nothing_but_rest() -> None:
    with open_robot("sim:stop", Opening(in_step=True)) as body:
        assert not isinstance(body, Failsafe)
