"""Fields in scenario files: what is read, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from sleepcast.core.settings import SettingsError
from sleepcast.simulator import Area, Circle, Scenario, load
from sleepcast.simulator.packing import pack, unpack
from sleepcast.simulator.scenario.fields import ScalarField, VectorField
from small_worlds import small, write

EVERY_KIND = """
[fields.light]
base = 1
about = "how bright it is"
hills = [{ x = "500m", y = "500m", peak = 5, radius = "10m" }]
zones = [
  { center = ["100m", "100m"], radius = "5m", value = 2 },
  { x = ["0m", "10m"], y = ["20m", "30m"], value = 3 },
  { corners = [["0m", "0m"], ["9m", "0m"], ["0m", "9m"]], value = 4 },
]
image = { file = "grey.png", low = -1, high = 1 }

[fields.grass]
unit = "kg"

[fields.grass.growth]
cell = "30m"
most = "2kg"
rate = 0.1
law = "constant"
diffusion = 1

[fields.wind]
kind = "vector"
unit = "m/s"
uniform = { x = "2m/s", y = "-1m/s" }
swirls = [{ x = "500m", y = "500m", peak = "3m/s", radius = "20m" }]
"""


def world(folder: Path, more: str = EVERY_KIND) -> Scenario:
    Image.fromarray(np.array([[0, 255], [128, 64]], np.uint8)).save(folder / "grey.png")
    return small(folder, more=more)


def test_every_kind_of_field(tmp_path: Path) -> None:
    light, grass, wind = world(tmp_path).fields
    assert isinstance(light, ScalarField)
    assert (light.base, light.hills[0].gaussian, light.about) == (1.0, True, "how bright it is")
    assert [type(zone.shape) for zone in light.zones] == [Circle, Area, Area]
    assert light.picture
    assert (light.picture.columns, light.picture.rows, light.picture.grey) == (2, 2, "00ff8040")
    assert isinstance(grass, ScalarField)
    assert grass.growth
    assert (grass.growth.columns, grass.growth.rows, grass.growth.logistic) == (34, 34, False)
    assert isinstance(wind, VectorField)
    assert wind.uniform == (2.0, -1.0)


def test_sensors_and_functions_have_the_fields_names_and_units(tmp_path: Path) -> None:
    from sleepcast.simulator import Simulator

    model = Simulator(world(tmp_path)).model
    units = {sensor.name: sensor.unit for sensor in model.sensors}
    found = {name: unit for name, unit in units.items() if name.split("_")[0] in ("light", "grass", "wind")}
    assert found == {
        **dict.fromkeys(("light", "light_dx", "light_dy"), ""),
        **dict.fromkeys(("grass", "grass_dx", "grass_dy", "grass_taken"), "kg"),
        **dict.fromkeys(("wind_x", "wind_y"), "m/s"),
    }
    assert {"TAKE_GRASS", "ADD_GRASS"} <= {function.name for function in model.functions}


def test_it_comes_back_from_a_parcel(tmp_path: Path) -> None:
    assert unpack(Scenario, pack(world(tmp_path))).fields == world(tmp_path).fields


GROWING = '[fields.a.growth]\ncell = "10m"\nmost = 1\nrate = 0.1\n'


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        ('[fields.a]\nkind = "tensor"', "scalar, vector"),
        ('[fields.a]\nunit = "lux"', "lux"),
        ('[fields.a]\nunit = "kg"\nbase = "3m"', "a mass"),
        ("[fields.a]\nuniform = { x = 1 }", "unknown key"),
        (
            '[fields.a]\nhills = [{ x = "2km", y = "1m", peak = 1, radius = "1m" }]',
            r"hills\[0\].x: wanted a length from 0km to 1km",
        ),
        ('[fields.a]\nhills = [{ x = "1m", y = "1m", peak = 1, radius = "0m" }]', "radius"),
        ('[fields.a]\nzones = [{ x = ["0m", "1m"], value = 1 }]', "y: is missing"),
        ('[fields.a]\nimage = { file = "none.png" }', "there is no file"),
        ("[fields.house_x]", "something called house_x already"),
        ("[fields.battery_x]\n[fields.Battery_X]", "something called Battery_X already"),
        ('[fields.a]\n[fields.a_d]\nkind = "vector"\n[fields.A]', "something called A already"),
        ("".join(f"[fields.f{i}]\n" for i in range(9)), "at most 8"),
        (GROWING.replace('"10m"', '"10cm"'), "at most 1000000 fit: make them larger"),
        (GROWING.replace("0.1", "1e4"), "rate"),
        (GROWING + "diffusion = 1e5", "too fast for such cells"),
        (GROWING.replace("most = 1", "most = 0"), "most"),
        (GROWING + 'law = "slow"', "logistic, constant, delayed"),
        (GROWING + 'law = "delayed"', "delay: is missing"),
        (GROWING + 'law = "delayed"\ndelay = "1s"', "unknown key"),
        (GROWING.replace("rate = 0.1", 'law = "delayed"\ndelay = "10ms"'), "wanted a time from"),
        (GROWING + 'sharing = "never"', "equal, in turn"),
        ("[fields.battery]", "variable of this name"),
        ("[noise]\nlight = 1", "unknown key"),
    ],
)
def test_a_table_that_cannot_be(tmp_path: Path, more: str, sentence: str) -> None:
    with pytest.raises(SettingsError, match=sentence):
        load(write(tmp_path, more=f"\n{more}\n"))


def test_a_picture_that_is_too_large(tmp_path: Path) -> None:
    Image.fromarray(np.zeros((600, 600), np.uint8)).save(tmp_path / "grey.png")
    with pytest.raises(SettingsError, match=r"grey.png: 600 by 600 pixels; at most 262144 fit"):
        small(tmp_path, more='\n[fields.a]\nimage = { file = "grey.png" }\n')
