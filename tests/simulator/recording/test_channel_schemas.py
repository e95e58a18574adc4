"""The JSON schemas of a recording name exactly the fields that are written."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import msgspec
import pytest
from mcap.reader import make_reader

from sleepcast.channel import Kind, Message
from sleepcast.simulator import find_scenario
from sleepcast.simulator.packing import TYPE
from sleepcast.simulator.recording import channel_schemas
from sleepcast.simulator.recording.recorder import (
    AccountBody,
    FailureBody,
    FailuresBody,
    MarksBody,
    Recorder,
    RulesBody,
    WorldChange,
)
from sleepcast.simulator.recording.recording import load_recording


@pytest.mark.parametrize(
    ("schema", "kind"),
    [
        (channel_schemas.ACCOUNTING, AccountBody),
        (channel_schemas.MARKS, MarksBody),
        (channel_schemas.FAILING, FailuresBody),
        (channel_schemas.FAILING["properties"]["rules"]["items"], FailureBody),  # type: ignore[index]
        (channel_schemas.RULES, RulesBody),
    ],
)
def test_the_fields_of_a_schema_are_those_of_its_class(schema: dict[str, Any], kind: type[msgspec.Struct]) -> None:
    assert set(schema["properties"]) == set(kind.__struct_fields__)


def test_a_recorded_message_keeps_its_fields_and_gains_none(tmp_path: Path) -> None:
    """A new field of messages on the air is no field of recordings until somebody decides so."""
    form = channel_schemas.POSTED["properties"]["message"]  # type: ignore[index]
    assert set(form["properties"]) | {"key"} == set(Message.__struct_fields__), "in a simulation nobody signs"
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
    assert set(channel_schemas.OBSTACLES["properties"]) == {TYPE, *(each.name for each in fields(WorldChange))}  # type: ignore[call-overload]
