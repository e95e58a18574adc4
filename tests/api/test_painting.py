"""What a recording shows to other viewers, decoded with the schemas that Foxglove publishes, and its JSON with the
schemas that stand in the file."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.descriptor import Descriptor
from google.protobuf.descriptor_pb2 import DescriptorProto, FileDescriptorSet
from google.protobuf.message import Message
from mcap.reader import make_reader
from mcap.records import Channel, Schema

import sleepcast as sc
from sleepcast.api.looks import INKS, LOOKS, of_colour, of_group
from sleepcast.simulator import Circle, Wall
from sleepcast.simulator.recording.recording import load_recording
from small_worlds import write

PUBLISHED: dict[str, type[Message]] = {
    "/poses": PosesInFrame,
    "/points": PointCloud,
    "/scene": SceneUpdate,
    "/groups": SceneUpdate,
    "/log": Log,
}
MORE = """
[areas.yard]
center = ["200m", "300m"]
radius = "50m"

[lights.lamp]
title = "a lamp"
x = "900m"
y = "100m"

[neighbours]
reach = "50m"
"""
JOIN = "(WHEN (> battery 50%) (JOIN full))"
SHOW = "(WHEN (<= battery 50%) (COLOUR 3))"
SECONDS = 8


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of a world with everything that is drawn: half of the robots join a group, the others show a colour,
    and the group ends; an obstacle comes, moves and goes."""
    folder = tmp_path_factory.mktemp("painted")
    write(folder, more=MORE)
    with sc.open(str(folder)) as fleet, fleet.record(folder / "run.mcap", pictures=0.1, readings=1.0):
        fleet.send(JOIN)
        fleet.send(SHOW)
        gate = fleet.world.add(Circle(500.0, 500.0, 20.0))
        fleet.world.add(Wall(((0.0, 0.0), (10.0, 5.0), (20.0, 0.0))))
        fleet.send("(RULE turn (WHEN (> x 600m) (ST)))", everybody=True)
        fleet.run(1.0)
        fleet.world.move(gate, 100.0, 0.0)
        fleet.run(1.0)
        fleet.world.remove(gate)
        fleet.send('(WHEN (IN full) (LEAVE full) (REPORT "left with" battery))')
        fleet.ask("battery")
        fleet.run(SECONDS - fleet.time)
    return folder / "run.mcap"


def messages(file: Path) -> Iterator[tuple[Schema, Channel, float, bytes]]:
    with file.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            yield schema, channel, message.log_time / 1e9, message.data


def decoded(file: Path, topic: str) -> list[tuple[float, Any]]:
    return [
        (at, PUBLISHED[topic].FromString(data)) for _, channel, at, data in messages(file) if channel.topic == topic
    ]


def colour(look: int) -> tuple[int, int, int]:
    ink = INKS[LOOKS[look].ink]
    return int(ink[1:3], 16), int(ink[3:5], 16), int(ink[5:7], 16)


def ends_of(entity: Any) -> set[tuple[float, float]]:
    return {(point.x, point.y) for line in entity.lines for point in line.points}


# ---- standard messages


def test_every_standard_message_has_only_fields_that_are_published(file: Path) -> None:
    seen = set()
    for _, channel, _, data in messages(file):
        if channel.topic in PUBLISHED:
            seen.add(channel.topic)
            message = PUBLISHED[channel.topic].FromString(data)
            before = message.ByteSize()
            message.DiscardUnknownFields()
            assert message.ByteSize() == before > 0
    assert seen == set(PUBLISHED)


def fields_of(described: DescriptorProto | Descriptor) -> list[tuple[str, int, int, bool, str]]:
    if isinstance(described, DescriptorProto):
        fields = [
            (each.name, each.number, each.type, each.label == each.LABEL_REPEATED, each.type_name.lstrip("."))
            for each in described.field
        ]
    else:
        fields = [
            (each.name, each.number, each.type, each.is_repeated, (each.message_type or each.enum_type).full_name)
            if each.message_type or each.enum_type
            else (each.name, each.number, each.type, each.is_repeated, "")
            for each in described.fields
        ]
    return sorted(fields, key=lambda field: field[1])


def reached(described: Descriptor, found: dict[str, Descriptor]) -> dict[str, Descriptor]:
    """Every message that a message is made of, by its name."""
    if described.full_name not in found:
        found[described.full_name] = described
        for field in described.fields:
            if field.message_type is not None:
                reached(field.message_type, found)
    return found


@pytest.mark.parametrize("topic", PUBLISHED)
def test_a_schema_in_the_file_is_the_published_one(file: Path, topic: str) -> None:
    schema = next(schema for schema, channel, _, _ in messages(file) if channel.topic == topic)
    published = PUBLISHED[topic].DESCRIPTOR
    assert (schema.name, schema.encoding) == (published.full_name, "protobuf")
    files = FileDescriptorSet.FromString(schema.data).file
    own = {f"{each.package}.{message.name}": message for each in files for message in each.message_type}
    wanted = reached(published, {})
    assert set(own) == set(wanted)
    for name, described in own.items():
        assert fields_of(described) == fields_of(wanted[name]), name
        enums = {each.name: [(v.name, v.number) for v in each.value] for each in described.enum_type}
        assert enums == {e.name: [(v.name, v.number) for v in e.values] for e in wanted[name].enum_types}


def test_points_have_the_colours_of_groups_and_of_what_robots_show(file: Path) -> None:
    clouds = decoded(file, "/points")
    assert [field.name for field in clouds[0][1].fields] == ["x", "y", "z", "red", "green", "blue", "alpha"]
    data = [(at, np.frombuffer(each.data, np.uint8).reshape(-1, each.point_stride)) for at, each in clouds]
    first, last = data[0][1][:, 12:15], data[-1][1][:, 12:15]
    assert {tuple(row) for row in first.tolist()} == {colour(0)}
    middle = next(rows[:, 12:15] for at, rows in data if at > 2.0)
    assert {tuple(row) for row in middle.tolist()} == {colour(of_group(1)), colour(of_colour(3))}
    assert {tuple(row) for row in last.tolist()} == {colour(0), colour(of_colour(3))}
    recording = load_recording(file)
    joined = sum(tuple(row) == colour(of_group(1)) for row in middle.tolist())
    assert joined == next(each["matched"] for each in recording.accounting.values() if each["text"] == JOIN)


def test_the_scene_holds_the_world_and_what_is_solid_at_any_time(file: Path) -> None:
    updates = decoded(file, "/scene")
    first = {entity.id: entity for entity in updates[0][1].entities}
    assert {entity.frame_id for entity in first.values()} == {"world"}
    assert ends_of(first["world"]) == {(0.0, 0.0), (1000.0, 0.0), (1000.0, 1000.0), (0.0, 1000.0)}
    assert [text.text for text in first["places"].texts] == ["house"]
    assert [(text.text, text.pose.position.x) for text in first["lights"].texts] == [("a lamp", 900.0)]
    assert [text.text for text in first["areas"].texts] == ["yard"]
    assert all([entity.id for entity in update.entities] == list(first) for _, update in updates), "each is whole"
    solid = [(at, entity) for at, update in updates for entity in update.entities if entity.id == "walls"]
    corners = [ends_of(entity) for _, entity in solid]
    assert [len(each) for each in corners] == [0, 32 + 3, 32 + 3, 3]
    assert max(x for x, _ in corners[1]) == pytest.approx(520.0)
    assert max(x for x, _ in corners[2]) == pytest.approx(620.0)
    assert corners[3] == {(0.0, 0.0), (10.0, 5.0), (20.0, 0.0)}


def test_the_robots_of_a_group_are_drawn_where_they_are_until_it_ends(file: Path) -> None:
    updates = decoded(file, "/groups")
    poses = dict(decoded(file, "/poses"))
    drawn = [(at, entity) for at, update in updates for entity in update.entities if entity.id == "group full"]
    assert len(drawn) > 10
    for at, entity in drawn:
        (triangles,) = entity.triangles
        assert len(triangles.points) == 3 * int(entity.metadata[0].value) > 0
        tint = [round(255 * part) for part in (triangles.color.r, triangles.color.g, triangles.color.b)]
        assert tuple(tint) == colour(of_group(1))
        places = {(pose.position.x, pose.position.y) for pose in poses[at].poses}
        for tip, left, right in zip(*[iter(triangles.points)] * 3, strict=True):
            middle = ((tip.x * 8 + 5 * (left.x + right.x)) / 18, (tip.y * 8 + 5 * (left.y + right.y)) / 18)
            assert min(abs(x - middle[0]) + abs(y - middle[1]) for x, y in places) < 0.01
    gone = [(at, each.id) for at, update in updates for each in update.deletions]
    assert [name for _, name in gone] == ["group full"]
    assert gone[0][0] > drawn[-1][0]
    assert "colour 3" in {entity.id for entity in updates[-1][1].entities}


# ---- JSON


def known(value: object) -> object:
    """The value with a number in place of null, which stands for an unknown number."""
    if isinstance(value, dict):
        return {name: known(each) for name, each in value.items()}
    if isinstance(value, list):
        return [0 if each is None else known(each) for each in value]
    return value


def no_json(word: str) -> None:
    pytest.fail(f"{word} is not JSON")


def test_all_that_is_json_keeps_to_the_schema_in_the_file(file: Path) -> None:
    from jsonschema import Draft202012Validator  # importing it takes a second, which every process would wait for

    counts: dict[str, int] = {}
    for schema, channel, _, data in messages(file):
        if channel.message_encoding != "json":
            continue
        counts[schema.name] = counts.get(schema.name, 0) + 1
        form = json.loads(schema.data)
        Draft202012Validator.check_schema(form)
        body = json.loads(data, parse_constant=no_json)
        Draft202012Validator(form).validate(known(body) if schema.name == "sleepcast.Readings" else body)
    wanted = {"Readings", "Accounting", "Rules", "Marks", "Posted", "State", "Obstacles"}
    assert set(counts) == {f"sleepcast.{name}" for name in wanted}


def unreadable(schema: dict[str, Any], path: str = "") -> Iterator[str]:
    """Where a schema is such as Foxglove and Lichtblick refuse: they want one type each, and properties."""
    if schema["type"] == "object":
        if "properties" not in schema:
            yield f"{path}: no properties"
        for name, each in schema.get("properties", {}).items():
            yield from unreadable(each, f"{path}.{name}")
    elif schema["type"] == "array":
        if schema["items"]["type"] == "array":
            yield f"{path}: a list of lists"
        yield from unreadable(schema["items"], f"{path}[]")
    elif schema["type"] not in ("string", "number", "integer", "boolean"):
        yield f"{path}: {schema['type']}"


def test_a_schema_of_json_is_such_as_viewers_read(file: Path) -> None:
    forms = {
        schema.name: json.loads(schema.data)
        for schema, channel, *_ in messages(file)
        if schema.encoding == "jsonschema"
    }
    assert [found for form in forms.values() for found in unreadable(form)] == []
    readings = forms["sleepcast.Readings"]["properties"]
    assert {"x", "y", "battery", "house_x"} <= set(readings)
    assert readings["x"]["items"] == {"type": "number"}
    assert readings["x"]["description"] == "where the robot is, to the east, m, null where unknown"
