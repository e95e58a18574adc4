"""What other programs read of recordings, as docs/counterparts.md says."""

from __future__ import annotations

import struct
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from mcap.exceptions import EndOfFile, McapError
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import Writer

import families
import sleepcast as sc
from exporting.recorded import YARD
from sleepcast.exporting import export_recording
from sleepcast.simulator.recording.recording import load_recording


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("recorded") / "run.mcap"
    with sc.open("bravo", seed=1) as fleet:
        fleet.record(file)
        fleet.run(2.0)
    return file


@pytest.mark.counterpart("mcap")
def test_mcap_gives_nothing_of_a_cut_file_but_in_the_order_of_the_file(recording: Path, tmp_path: Path) -> None:
    cut, torn = tmp_path / "cut.mcap", (EndOfFile, struct.error)
    cut.write_bytes(recording.read_bytes()[:-50])
    with cut.open("rb") as stream, pytest.raises(McapError):
        next(make_reader(stream).iter_messages())
    with cut.open("rb") as stream, pytest.raises(torn):
        next(NonSeekingReader(stream).iter_messages())
    topics = set[str]()
    with cut.open("rb") as stream, suppress(*torn):
        for _, channel, _ in NonSeekingReader(stream).iter_messages(log_time_order=False):
            topics.add(channel.topic)
    assert topics >= {"/poses", "/readings"}


READERS = """
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
const { McapIndexedReader, McapStreamReader } = createRequire(process.argv[2] + '/')('@mcap/core');
const bytes = readFileSync(process.argv[3]);
const readable = {
    size: async () => BigInt(bytes.length),
    read: async (start, length) => new Uint8Array(bytes.buffer, bytes.byteOffset + Number(start), Number(length)),
};
async function tried(name, read) {
    try {
        console.log(name, await read());
    } catch (error) {
        console.log(name, error.message);
    }
}
await tried('indexed', async () => {
    const reader = await McapIndexedReader.Initialize({ readable });
    for await (const message of reader.readMessages()) return message.type;
});
await tried('in order', () => {
    const reader = new McapStreamReader();
    reader.append(bytes);
    for (let record; (record = reader.nextRecord()); ) if (record.type === 'Message') return record.type;
});
"""


@pytest.mark.counterpart("@mcap/core", "node")
def test_mcap_core_unpacks_nothing_by_itself(recording: Path) -> None:
    command = ["node", "--input-type=module", "-", str(families.NODE_MODULES), str(recording)]
    done = subprocess.run(command, input=READERS, capture_output=True, text=True, check=True)
    indexed, in_order = done.stdout.splitlines()
    assert indexed.startswith("indexed Unsupported compression lz4")
    assert in_order.startswith("in order Unsupported compression lz4")


@pytest.mark.counterpart("rosbags")
def test_rosbags_refuses_a_file_without_the_profile_of_ros(recording: Path) -> None:
    from rosbags.highlevel import AnyReader, AnyReaderError

    with pytest.raises(AnyReaderError, match="Profile is not ros2"), AnyReader([recording]):
        pass


@pytest.mark.counterpart("mcap", "mcap-protobuf-support")
def test_a_decoder_factory_reads_a_second_file_with_the_schemas_of_the_first(tmp_path: Path) -> None:
    """Here field 1 is `first` in one file and `second` in the other."""
    from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet
    from mcap_protobuf.decoder import DecoderFactory

    factory, files = DecoderFactory(), list[Path]()
    for name in ("first", "second"):
        described = FileDescriptorProto(name=f"{name}.proto", package=name, syntax="proto3")
        field = described.message_type.add(name="Reading").field.add()
        field.name, field.number, field.type, field.label = name, 1, FieldDescriptorProto.TYPE_DOUBLE, 1
        files.append(tmp_path / f"{name}.mcap")
        with files[-1].open("wb") as stream:
            writer = Writer(stream)
            writer.start()
            data = FileDescriptorSet(file=[described]).SerializeToString()
            channel = writer.register_channel(
                "/one", "protobuf", writer.register_schema(f"{name}.Reading", "protobuf", data)
            )
            writer.add_message(channel, 0, b"\x09" + struct.pack("<d", 1.5), 0)
            writer.finish()

    def fields(file: Path, factory: DecoderFactory) -> list[str]:
        with file.open("rb") as stream:
            (found,) = make_reader(stream, decoder_factories=[factory]).iter_decoded_messages()
        return [field.name for field, _ in found.decoded_message.ListFields()]

    assert [fields(file, factory) for file in files] == [["first"], ["first"]]
    assert fields(files[1], DecoderFactory()) == ["second"]


@pytest.mark.counterpart("rerun-sdk", "rosbags")
def test_rerun_draws_maps_and_ranges_of_a_bag_and_no_arrays_of_poses(tmp_path: Path) -> None:
    export_recording(load_recording(YARD), "ros2", tmp_path / "bag")
    convert = [sys.executable, "-m", "rerun", "mcap", "convert", "bag/bag.mcap", "-o", "bag.rrd"]
    subprocess.run(convert, cwd=tmp_path, capture_output=True, check=True)
    from rerun.chunk import RrdReader

    drawn: dict[str, set[str]] = {}
    for chunk in RrdReader(tmp_path / "bag.rrd").stream().to_chunks():
        names = {name.partition(":")[0] for name in chunk.to_record_batch().schema.names if ":" in name}
        drawn.setdefault(chunk.entity_path, set()).update(names - {"McapChannel", "McapSchema"})
    assert "GridMap" in drawn["/map"]
    assert "InstancePoses3D" in drawn["/scout1/pose"]
    assert drawn["/tf"] == {"Transform3D"}
    assert drawn["/scout1/sonar"] == drawn["/scout1/battery_state"] == {"Scalars", "SeriesLines"}
    assert drawn["/rosout"] == {"TextLog"}
    assert drawn["/poses"] == {"geometry_msgs.msg.PoseArray"}
    assert drawn["/scout1/readings/x"] == {"std_msgs.msg.Float64"}


@pytest.mark.counterpart("rosbags")
def test_rosbags_refuses_a_fleets_numbers_until_they_are_converted() -> None:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg("float32[] ranges", "demo/msg/Scan"))
    scan = store.types["demo/msg/Scan"]
    with sc.open("bravo", seed=1, robots=3) as fleet:
        ranges = fleet["speed"]
    with pytest.raises(ValueError, match="different structures"):
        store.serialize_cdr(scan(ranges), "demo/msg/Scan")
    data = store.serialize_cdr(scan(ranges.astype("<f4")), "demo/msg/Scan")
    assert store.deserialize_cdr(data, "demo/msg/Scan").ranges == pytest.approx(ranges)


NUMBERS = """
import { createRequire } from 'node:module';
const required = createRequire(process.argv[2] + '/');
const { MessageReader } = required('@foxglove/rosmsg2-serialization');
const { parse } = required('@foxglove/rosmsg');
const reader = new MessageReader(parse('float64 x', { ros2: true }));
console.log(reader.readMessage(Uint8Array.from(Buffer.from(process.argv[3], 'hex'))).x);
"""


@pytest.mark.counterpart("@foxglove/rosmsg2-serialization", "@foxglove/rosmsg", "rosbags", "node")
def test_foxglove_reads_a_length_for_a_number_where_rosbags_refuses() -> None:
    from rosbags.serde import SerdeError
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg("float64 x", "demo/msg/One"))
    plain, delimited = b"\0\1\0\0" + struct.pack("<d", 1.5), b"\0\x09\0\0" + struct.pack("<Id", 8, 1.5)
    assert store.deserialize_cdr(plain, "demo/msg/One").x == 1.5
    with pytest.raises(SerdeError, match="unsupported CDR encapsulation"):
        store.deserialize_cdr(delimited, "demo/msg/One")
    found = list[float]()
    for data in (plain, delimited):
        command = ["node", "--input-type=module", "-", str(families.NODE_MODULES), data.hex()]
        done = subprocess.run(command, input=NUMBERS, capture_output=True, text=True, check=True)
        found.append(float(done.stdout))
    assert found[0] == 1.5
    assert found[1] != 1.5
