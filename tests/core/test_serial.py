"""Parcels: what goes in comes out, and nothing else does, whatever the bytes."""

from __future__ import annotations

import tracemalloc
import zlib
from concurrent.futures import ThreadPoolExecutor
from threading import Lock
from time import sleep

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from sleepcast.core import serial
from sleepcast.core.serial import Array, Arrays, SerialError, dump_arrays, load_arrays, pack, unpack, within

SORTS = (np.float64, np.float32, np.int64, np.int32, np.int16, np.int8, np.uint8, np.uint64, np.bool_)
MOST = 1 << 20


class Box(msgspec.Struct):
    name: str
    numbers: Arrays
    pairs: list[tuple[int, float]] = []


def test_one_thread_alone_finds_out_what_is_in_a_struct(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where two do, msgspec crashes."""

    class Fresh(msgspec.Struct):
        number: int = 7

    made, inside, decoder = [], Lock(), msgspec.msgpack.Decoder

    def slow(kind: type[Fresh]) -> msgspec.msgpack.Decoder[Fresh]:
        assert inside.acquire(blocking=False)
        sleep(0.01)  # so that others have the time to come in as well
        made.append(kind)
        inside.release()
        return decoder(kind)

    monkeypatch.setattr(msgspec.msgpack, "Decoder", slow)
    parcel = pack(Fresh(), MOST)
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda _: unpack(Fresh, parcel, MOST, "it"), range(8)))
    assert found == [Fresh()] * 8
    assert made == [Fresh]


def count(value: object) -> int:
    """Values in a document, one after or in the other."""
    if isinstance(value, dict):
        return 1 + sum(count(key) + count(each) for key, each in value.items())
    return 1 + sum(map(count, value)) if isinstance(value, list) else 1


PLAIN = st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | st.text(max_size=400) | st.binary()
DOCUMENTS = st.recursive(
    PLAIN, lambda inside: st.lists(inside, max_size=40) | st.dictionaries(st.text(max_size=40), inside, max_size=20)
)


@settings(max_examples=40)
@given(DOCUMENTS)
def test_values_are_counted_without_being_made(document: object) -> None:
    packed, values = msgspec.msgpack.encode(document), count(document)
    assert serial._has_at_most(packed, values)
    assert not serial._has_at_most(packed, values - 1)


@pytest.mark.parametrize("size", [255, 256, 70_000])
def test_long_ones_are_counted_too(size: int) -> None:
    document = ["a" * size, b"a" * size, [0] * size, {str(number): None for number in range(size)}]
    packed = msgspec.msgpack.encode(document)
    assert serial._has_at_most(packed, 5 + 3 * size)
    assert not serial._has_at_most(packed, 4 + 3 * size)
    assert serial._has_at_most(packed[: size // 2], 5 + 3 * size)  # half of one is left to who decodes it


def test_a_parcel_of_millions_of_values_is_refused_before_they_are_made() -> None:
    values = serial.UNCOUNTED
    body = b"\x83\xa4name\xa0\xa7numbers\x80\xa5pairs\xdd" + values.to_bytes(4, "big") + b"\x92\x00\x00" * values
    data = zlib.compress(body, 9)
    del body
    tracemalloc.start()
    try:
        with pytest.raises(SerialError, match="the box has more than 262144 values"):
            opened(data, 32 * 1024**2)
        assert tracemalloc.get_traced_memory()[1] < 64 * 1024**2
    finally:
        tracemalloc.stop()


def opened(data: bytes, most: int = MOST) -> Box:
    return unpack(Box, data, most, "the box")


@given(
    values=st.sampled_from(SORTS).flatmap(
        lambda sort: arrays.arrays(sort, arrays.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=5))
    )
)
def test_an_array_comes_back_as_it_was(values: np.ndarray[tuple[int, ...], np.dtype[np.generic]]) -> None:
    found = opened(pack(Box("a", {"values": Array.of(values)}), MOST)).numbers["values"]
    made = found.made(values.dtype.type, values.shape, "values")
    assert (made.dtype, made.shape, made.tobytes()) == (values.dtype, values.shape, values.tobytes())
    assert made.flags.writeable
    before = values.tobytes()
    made[...] = np.zeros_like(made)
    assert values.tobytes() == before


def test_an_array_that_lies_in_another_order_comes_back() -> None:
    values = np.arange(12.0).reshape(3, 4).T[::2]
    assert Array.of(values).made(np.float64, (2, 3), "values").tolist() == values.tolist()
    assert Array.of(values.astype(">f8")).made(np.float64, (2, 3), "values").tolist() == values.tolist()


@pytest.mark.parametrize(
    ("array", "why"),
    [
        (Array("<f4", (3,), bytes(12)), r"values is <f4\[3\], wanted <f8\[3\]"),
        (Array("<f8", (4,), bytes(32)), r"values is <f8\[4\], wanted <f8\[3\]"),
        (Array("<f8", (3, 1), bytes(24)), "wanted"),
        (Array("<f8", (3,), bytes(23)), "has 23 bytes, wanted 24"),
        (Array("<f8", (3,), b""), "has 0 bytes"),
        (Array("|O8", (3,), bytes(24)), "wanted"),
        (Array("x" * 10_000, tuple(range(1000)), b""), "wanted"),
    ],
)
def test_another_array_is_refused(array: Array, why: str) -> None:
    with pytest.raises(SerialError, match=why) as caught:
        array.made(np.float64, (3,), "values")
    assert len(str(caught.value)) < 100


def test_a_truth_is_true_or_false() -> None:
    with pytest.raises(SerialError, match="neither true nor false"):
        Array("|b1", (2,), b"\1\2").made(np.bool_, (2,), "flags")


def test_a_list_has_its_longest() -> None:
    assert Array.of(np.arange(3)).column(np.int64, 3, "list").tolist() == [0, 1, 2]
    for wrong in (Array.of(np.arange(4)), Array.of(np.zeros((1, 1), np.int64)), Array("<i8", (-1,), b"")):
        with pytest.raises(SerialError, match="a list of at most 3"):
            wrong.column(np.int64, 3, "list")


def test_columns_are_written_in_place() -> None:
    values = {"x": np.arange(3.0), "flags": np.array([True, False])}
    parcel = dump_arrays(values)
    x = values["x"]
    x[:] = 0.0
    load_arrays(parcel, values)
    assert x.tolist() == [0.0, 1.0, 2.0]
    for wrong in ({"x": parcel["x"]}, parcel | {"y": parcel["x"]}, parcel | {"x": parcel["flags"]}):
        with pytest.raises(SerialError):
            load_arrays(wrong, values)


def test_bounds_leave_out_what_is_no_number() -> None:
    within(np.array([0.0, 1.0]), 0.0, 1.0, "share")
    within(np.array([]), 0.0, 1.0, "share")
    for wrong in (-0.1, 1.1, np.nan, np.inf):
        with pytest.raises(SerialError, match="share is not everywhere from 0 to 1"):
            within(np.array([0.5, wrong]), 0.0, 1.0, "share")


def test_a_bomb_does_not_go_off() -> None:
    bomb = zlib.compress(b"\xc6\xff\xff\xff\xff" + bytes(50_000_000), 9)
    with pytest.raises(SerialError, match="has more than 1000 bytes"):
        opened(bomb, 1000)


def test_bytes_that_claim_more_than_they_are_ask_for_no_memory() -> None:
    for claim in (b"\xdd\xff\xff\xff\xff", b"\xdf\xff\xff\xff\xff", b"\xc6\xff\xff\xff\xff"):
        with pytest.raises(SerialError):
            opened(zlib.compress(claim))


def test_what_is_nested_too_deep_is_refused() -> None:
    name = msgspec.msgpack.encode("pairs")
    with pytest.raises(SerialError):
        opened(zlib.compress(b"\x81" + name + b"\x91" * 200_000))


WHOLE = pack(Box("whole", dump_arrays({"x": np.arange(40.0)}), [(1, 2.0)] * 30), MOST)


@given(cut=st.integers(0, len(WHOLE) - 1))
def test_a_parcel_that_ends_early_is_refused(cut: int) -> None:
    with pytest.raises(SerialError):
        opened(WHOLE[:cut])


@given(place=st.integers(0, len(WHOLE) - 1), bits=st.integers(1, 255))
def test_a_parcel_with_a_changed_byte_is_refused_or_the_same(place: int, bits: int) -> None:
    changed = bytearray(WHOLE)
    changed[place] ^= bits
    try:
        assert opened(bytes(changed)) == opened(WHOLE)
    except SerialError:
        return


@given(data=st.binary(max_size=200))
def test_any_bytes_are_refused(data: bytes) -> None:
    for packed in (data, zlib.compress(data)):
        with pytest.raises(SerialError):
            opened(packed)
