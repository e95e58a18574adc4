"""Fields on the page: maps that say what is where, drawn only when they are asked for, of now and of the past."""

from __future__ import annotations

import asyncio
import inspect
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from console.asking import put
from sleepcast.console.adapters.fields import MAX_CELLS, FieldPictures, round_above, shown_fields, still_picture
from sleepcast.console.adapters.live_past import LivePast
from sleepcast.console.adapters.recording import TimelineBuilder
from sleepcast.console.adapters.swarm import SwarmAdapter
from sleepcast.console.backend import Backend
from sleepcast.console.connection import encode
from sleepcast.console.driver import Driver
from sleepcast.console.features.field import AGAIN, Field, Fielded, FieldMaps
from sleepcast.console.features.time import ShowMoment
from sleepcast.console.outgoing import Refused
from sleepcast.console.replay import ReplayBackend, ReplayDriver
from sleepcast.console.swarm_dialogue import SwarmDialogue
from sleepcast.console.view import FieldPicture
from sleepcast.core.clock import ManualClock, WallClock
from sleepcast.loop import Pace, Swarm
from sleepcast.simulator import Scenario, Simulator
from sleepcast.simulator.bodies.field_map import coarse
from sleepcast.simulator.recording.recorder import STATE, Recorder
from sleepcast.simulator.recording.recording import load_recording
from small_worlds import small
from swarms import desk_of, station_of

FIELDS = """
[fields.warmth]
unit = "%"
about = "how warm it is"
base = "20%"
hills = [{ x = "250m", y = "750m", peak = "60%", radius = "400m", shape = "linear" }]

[fields.grass]
base = 0.25

[fields.grass.growth]
cell = "100m"
most = 1
rate = 0.5
law = "constant"

[fields.wind]
kind = "vector"
unit = "m/s"
uniform = { y = "2m/s" }
"""


def values(found: FieldPicture) -> np.ndarray[tuple[int, int], np.dtype[np.uint8]]:
    return np.frombuffer(found.cells, np.uint8).reshape(found.rows, found.columns)


def test_a_still_field_has_its_values_where_they_are(tmp_path: Path) -> None:
    scenario = small(tmp_path, more=FIELDS)
    assert [(field.name, field.about, field.grows) for field in shown_fields(scenario)] == [
        ("warmth", "how warm it is", False),
        ("grass", "", True),
        ("wind", "", False),
    ]
    found = still_picture(scenario, "warmth")
    assert (found.columns, found.rows, len(found.cells)) == (MAX_CELLS, MAX_CELLS, MAX_CELLS * MAX_CELLS)
    low, middle, high = (float(text.removesuffix(" %")) for text in found.scale)
    assert (low, middle, high) == pytest.approx((20.0, 50.0, 80.0), rel=0.02)
    cells = values(found)
    row, column = np.unravel_index(cells.argmax(), cells.shape)  # rows from the bottom
    assert ((column + 0.5) / MAX_CELLS, (row + 0.5) / MAX_CELLS) == pytest.approx((0.25, 0.75), abs=0.01)
    assert len(encode(Fielded(1, "warmth", 0, found))) < 30_000


def test_vectors_have_their_directions(tmp_path: Path) -> None:
    found = still_picture(small(tmp_path, more=FIELDS), "wind")
    assert set(found.cells) == {255}
    assert set(found.angles) == {64}  # a quarter of a turn: to the north
    assert found.scale == ("0 m/s", "1 m/s", "2 m/s")
    assert len(encode(Fielded(1, "wind", 0, found))) < 50_000


def test_a_growing_field_is_shown_in_its_cells_on_a_scale_that_ends_at_a_round_number(tmp_path: Path) -> None:
    swarm = Swarm(Simulator(small(tmp_path, more=FIELDS), 3))
    pictures = FieldPictures(swarm.simulator)
    found = pictures.of("grass")
    assert (found.columns, found.rows, found.scale) == (10, 10, ("0", "0.25", "0.5"))
    assert set(found.cells) == {128}
    for _ in range(6):  # by 0.05 each
        swarm.step()
    assert pictures.of("grass").scale == ("0", "0.5", "1")
    assert pictures.of("warmth") is pictures.of("warmth")


def test_a_still_field_with_hidden_hills_is_drawn_anew_when_walls_have_changed(tmp_path: Path) -> None:
    wall = '\n[[world.walls]]\npoints = [["300m", "500m"], ["300m", "1km"]]\n'
    text = FIELDS.replace('shape = "linear"', 'shape = "linear", hidden = true')
    simulator = Simulator(small(tmp_path, ("format = 1", "format = 2"), more=text + wall), 3)
    pictures = FieldPictures(simulator)
    before = pictures.of("warmth")
    assert values(before)[96, 64] == 0, "in the shadow"
    assert still_picture(simulator.scenario, "warmth") == before
    simulator.world.clear()
    assert values(pictures.of("warmth"))[96, 64] > 0
    assert pictures.of("warmth") is pictures.of("warmth")


def test_a_field_that_dies_away_is_empty_at_last(tmp_path: Path) -> None:
    """Its amounts end as the least number that there is, below any power of ten."""
    text = FIELDS.replace('rate = 0.5\nlaw = "constant"', 'rate = -20\nlaw = "logistic"')
    swarm = Swarm(Simulator(small(tmp_path, more=text), 3))
    pictures = FieldPictures(swarm.simulator)
    amount = swarm.simulator.senses.amount("grass")
    assert amount is not None
    while amount.max() >= 1e-323:
        swarm.step()
    assert amount.max() > 0.0
    found = pictures.of("grass")
    assert (set(found.cells), found.scale) == ({0}, ("0", "0.5", "1"))


@pytest.mark.parametrize(
    ("base", "peak", "scale"),
    [
        ("300.1", "0.02", ("300.1", "300.11", "300.12")),
        ("1000000", "0.5", ("1000000", "1000000.25", "1000000.5")),
        ("-3", "0", ("-3", "-3", "-3")),
        ("0", "-1e-12", ("-1e-12", "-5e-13", "0")),
    ],
)
def test_the_ends_of_a_scale_are_told_apart(tmp_path: Path, base: str, peak: str, scale: tuple[str, str, str]) -> None:
    zone = f'{{ value = {peak}, x = ["0m", "500m"], y = ["0m", "1km"] }}'
    scenario = small(tmp_path, more=f"[fields.warmth]\nbase = {base}\nzones = [{zone}]\n")
    assert still_picture(scenario, "warmth").scale == scale


def test_large_fields_are_shown_by_the_means_of_blocks() -> None:
    amount = np.arange(300.0 * 7).reshape(7, 300)
    found = coarse(amount, 128).values
    assert found.shape == (7, 100)
    assert found[0, :2] == pytest.approx([1.0, 4.0])
    assert coarse(amount, 300).values == pytest.approx(amount)


def test_scales_end_at_round_numbers() -> None:
    assert [round_above(value) for value in (0.0, 0.013, 0.2, 4.1, 7.0)] == [1.0, 0.02, 0.2, 5.0, 10.0]


def test_all_pages_are_given_one_map_and_it_is_not_made_too_often() -> None:
    drawn, clock = list[str](), ManualClock()

    def draw(name: str) -> FieldPicture:
        drawn.append(name)
        return FieldPicture(1, 1, b"\0", ("0", "0", "0"))

    maps = FieldMaps(draw, clock)
    clock.advance(1.0)
    assert maps.answer(Field(1, "grass"), 5).tick == 5
    clock.advance(AGAIN / 2)
    assert maps.answer(Field(2, "grass"), 50).tick == 5
    clock.advance(AGAIN)
    assert maps.answer(Field(3, "grass"), 60).tick == 60
    assert maps.answer(Field(4, "grass"), 60).tick == 60
    clock.advance(10.0)
    assert maps.answer(Field(5, "grass"), 60).tick == 60  # time stands still
    assert drawn == ["grass"] * 2


def test_a_moment_of_the_past_has_the_field_of_then(tmp_path: Path) -> None:
    swarm = Swarm(Simulator(small(tmp_path, more=FIELDS), 3))
    swarm.desk = station_of(swarm)
    station, view, clock = desk_of(swarm), SwarmAdapter(swarm), WallClock()
    past = LivePast(view, swarm, station, clock)
    driver = Driver(view, Pace(clock, swarm, 1.0), clock)
    dialogue = SwarmDialogue(Backend(view, station, driver, clock, past=past))
    for _ in range(8):
        swarm.step()
    now = dialogue.answer(Field(1, "grass"))
    assert isinstance(now, Fielded)
    assert (now.tick, now.picture.scale[2]) == (8, "1")

    async def look() -> None:
        dialogue.answer(ShowMoment(2 * past.tick))
        asked = dialogue.answer(Field(2, "grass"))
        assert inspect.isawaitable(asked)
        said = await asked
        assert isinstance(said, msgspec.Raw)
        then = msgspec.json.decode(bytes(said), type=Fielded)
        assert (then.tick, then.serial) == (2, 2)
        assert then.picture.scale[2] == "0.5"
        assert set(then.picture.cells) == {round(255 * 0.35 / 0.5)}
        assert isinstance(dialogue.answer(Field(3, "warmth")), Fielded)  # as it is at any time
        refused = dialogue.answer(Field(4, "snow"))
        assert isinstance(refused, Refused)
        assert 'no field "snow"' in refused.reason
        dialogue.leave()

    asyncio.run(look())
    past.close()


def test_a_recording_draws_a_still_field_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages may ask a hundred times a second, and a field of many parts takes a third of one."""
    scenario, drawn = small(tmp_path, more=FIELDS), list[str]()
    file = tmp_path / "run.mcap"
    with Recorder(file, scenario, 3, version="1", complain=pytest.fail) as recorder:
        recorder.note(STATE, 0.0, {"tick": 0, "hash": "first"})

    def draw(scenario: Scenario, name: str) -> FieldPicture:
        drawn.append(name)
        return still_picture(scenario, name)

    monkeypatch.setattr("sleepcast.console.adapters.recording.still_picture", draw)
    timeline = TimelineBuilder(load_recording(file)).timeline
    assert timeline.field is not None
    assert timeline.field("warmth") is timeline.field("warmth")
    assert drawn == ["warmth"]


def test_a_recording_shows_still_fields_and_says_why_it_cannot_show_others(tmp_path: Path) -> None:
    scenario = small(tmp_path, more=FIELDS)
    swarm = Swarm(Simulator(scenario, 3))
    swarm.desk = station_of(swarm)
    past = LivePast(SwarmAdapter(swarm), swarm, desk_of(swarm), WallClock())
    swarm.step()
    timeline = replace(past.timeline, field=lambda name: still_picture(scenario, name))
    desk = ReplayBackend(timeline, ReplayDriver(timeline, ManualClock()))
    found = put(desk, Field, 1, "warmth")
    assert isinstance(found, Fielded)
    assert found.picture.columns == MAX_CELLS
    refused = SwarmDialogue(desk).answer(Field(2, "grass"))
    assert isinstance(refused, Refused)
    assert refused.reason == "The recording does not hold how grass was at this time."
    past.close()
