"""The JSON schemas of a recording name exactly the fields that are written."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import msgspec
import pytest

from sleepcast.channel import Message
from sleepcast.simulator.packing import TYPE
from sleepcast.simulator.recording import channel_schemas
from sleepcast.simulator.recording.recorder import (
    AccountBody,
    FailureBody,
    FailuresBody,
    MarksBody,
    RulesBody,
    WorldChange,
)


@pytest.mark.parametrize(
    ("schema", "kind"),
    [
        (channel_schemas.ACCOUNTING, AccountBody),
        (channel_schemas.MARKS, MarksBody),
        (channel_schemas.FAILING, FailuresBody),
        (channel_schemas.FAILING["properties"]["rules"]["items"], FailureBody),  # type: ignore[index]
        (channel_schemas.RULES, RulesBody),
        (channel_schemas.POSTED["properties"]["message"], Message),  # type: ignore[index]
    ],
)
def test_the_fields_of_a_schema_are_those_of_its_class(schema: dict[str, Any], kind: type[msgspec.Struct]) -> None:
    assert set(schema["properties"]) == set(kind.__struct_fields__)


def test_a_change_of_the_world_is_written_with_its_class() -> None:
    assert set(channel_schemas.OBSTACLES["properties"]) == {TYPE, *(each.name for each in fields(WorldChange))}  # type: ignore[call-overload]
