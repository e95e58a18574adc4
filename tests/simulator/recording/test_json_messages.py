"""The JSON messages of a recording, and their schemas."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path

import msgspec
import pytest
from mcap.reader import make_reader

from sleepcast.channel import Kind, Message
from sleepcast.simulator import find_scenario
from sleepcast.simulator.packing import TYPE
from sleepcast.simulator.recording.json_messages import (
    AccountBody,
    FailureBody,
    FailuresBody,
    MarksBody,
    ObstaclesBody,
    PostedBody,
    RulesBody,
    StateBody,
    schema_of,
)
from sleepcast.simulator.recording.recorder import Recorder, WorldChange
from sleepcast.simulator.recording.recording import load_recording


@pytest.mark.parametrize(
    "body", [AccountBody, MarksBody, FailuresBody, FailureBody, RulesBody, PostedBody, StateBody, ObstaclesBody]
)
def test_viewers_can_read_the_schema(body: type[msgspec.Struct]) -> None:
    """Each part has one type, and nothing refers to something elsewhere."""
    parts = [schema_of(body)]
    while parts:
        part = parts.pop()
        assert isinstance(part["type"], str), part
        assert not {"$ref", "anyOf", "oneOf", "title", "default"} & set(part)
        parts += [*part.get("properties", {}).values(), *([part["items"]] if "items" in part else [])]


def test_a_recorded_message_keeps_its_fields_and_gains_none(tmp_path: Path) -> None:
    """A new field of messages on the air is no field of recordings until somebody decides so."""
    form = schema_of(PostedBody)["properties"]["message"]
    assert set(form["properties"]) | {"key", "late"} == set(Message.__struct_fields__), "nobody signs, clocks are right"
    message = Message(
        "desk", 1, 2, Kind.COMMAND, 1.0, 6.0, "(MARK)", True, {"for": ["r1"]}, "operator", 2.0, 0.5, "key"
    )
    file = tmp_path / "run.mcap"
    with Recorder(file, find_scenario("bravo"), 1, version="1", complain=print) as recorder:
        recorder.posted(1.0, 3, message)
        recorder.posted(1.0, 4, Message("desk", 1, 3, Kind.STOP, 1.0))
    with file.open("rb") as stream:
        bare = [json.loads(each.data) for _, _, each in make_reader(stream).iter_messages(["/sleepcast/posted"])]
    assert set(bare[0]["message"]) == set(form["properties"])
    assert set(bare[1]["message"]) == set(form["required"])
    assert load_recording(file).posted[0].message == msgspec.structs.replace(message, key="")


def test_a_change_of_the_world_is_written_with_its_class() -> None:
    assert set(schema_of(ObstaclesBody)["properties"]) == {TYPE, *(each.name for each in fields(WorldChange))}
