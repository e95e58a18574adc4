"""Messages as bytes: what is written comes back, every byte counts, and nonsense is refused with a reason."""

from __future__ import annotations

import json
from contextlib import suppress
from math import inf
from pathlib import Path

import cbor2
import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sleepcast.channel import Kind, Message, MessageError
from sleepcast.channel.envelope import (
    KINDS,
    LEAST,
    MAX_CONTENT,
    MAX_DATAGRAM,
    MAX_DEPTH,
    MAX_PARTS,
    EnvelopeError,
    encode,
    look,
    plain,
    read_message,
    read_piece,
)
from sleepcast.channel.keys import KeyPair
from sleepcast.channel.message import MAX_NAME, MAX_NUMBER, MAX_TEXT, Role

DESK = KeyPair("desk", Role.COMMANDER, b"d" * 32)
VECTORS = Path(__file__).parents[2] / "docs" / "wire-vectors.json"
NUMBERS = st.integers(0, MAX_NUMBER)
TIMES = st.integers(0, 2**51).map(lambda micro: micro / 1e6)
BODIES = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**63) | st.floats(allow_nan=False) | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=5,
).filter(lambda value: plain(value, MAX_DEPTH - 1))


def plain_body(value: object) -> dict[str, object]:
    return {"value": value}


MESSAGES = st.builds(
    Message,
    sender=st.text(st.characters(exclude_categories=("C", "Z")), min_size=1, max_size=MAX_NAME),
    epoch=NUMBERS,
    sequence=NUMBERS,
    kind=st.sampled_from(KINDS),
    issued=TIMES,
    deadline=TIMES | st.just(inf),
    text=st.text(max_size=3_000),
    body=st.just({}) | st.builds(plain_body, BODIES),
) | st.builds(
    Message,
    sender=st.just("desk"),
    epoch=NUMBERS,
    sequence=NUMBERS,
    kind=st.just(Kind.COMMAND),
    issued=TIMES,
    text=st.text(),
    standing=st.just(True),
)


def decoded(datagrams: list[bytes]) -> Message:
    parts = [look(datagram) for datagram in datagrams]
    assert all(DESK.public.signed(part.signed, part.signature) for part in parts)
    pieces = [read_piece(part) for part in parts]
    return read_message(parts[-1], pieces[0].sender, b"".join(piece.content for piece in pieces))


@given(MESSAGES, st.text(max_size=MAX_NAME))
def test_what_is_written_comes_back(message: Message, fleet: str) -> None:
    datagrams = encode(message, fleet, DESK)
    assert all(LEAST <= len(datagram) <= MAX_DATAGRAM for datagram in datagrams)
    assert decoded(datagrams) == message
    assert {read_piece(look(datagram)).fleet for datagram in datagrams} == {fleet}


def test_every_kind_has_a_number_and_a_message_is_standard_cbor() -> None:
    assert set(KINDS) == set(Kind)
    message = Message("desk", 1, 2, Kind.COMMAND, 1.5, 2.5, "(ST)")
    (datagram,) = encode(message, "lab", DESK)
    found = cbor2.loads(datagram)
    assert found.tag == 18
    protected, unprotected, payload, signature = found.value
    assert (cbor2.loads(protected), unprotected) == ({1: -8}, {4: DESK.id})
    assert cbor2.loads(payload)[:-1] == [1, 0, 1, 2, 1_500_000, 2_500_000, 0, 1, "lab", "desk"]
    assert cbor2.loads(cbor2.loads(payload)[-1]) == ["(ST)", {}]
    signed = cbor2.dumps(["Signature1", protected, b"", payload])
    assert DESK.public.signed(look(datagram).signed, signature)
    assert cbor2.loads(look(datagram).signed) == cbor2.loads(signed)


def test_a_short_command_fits_into_512_bytes() -> None:
    message = Message("d" * 32, 2**40, 2**40, Kind.COMMAND, 1.8e9, 1.8e9 + 5, "x" * 200)
    (datagram,) = encode(message, "f" * 32, DESK)
    assert len(datagram) <= 512


def test_the_longest_text_gets_through_in_parts() -> None:
    message = Message("d" * MAX_NAME, 1, 1, Kind.COMMAND, 1.0, text="\N{GRINNING FACE}" * MAX_TEXT)
    datagrams = encode(message, "\N{GRINNING FACE}" * MAX_NAME, DESK)
    assert len(datagrams) <= MAX_PARTS
    assert decoded(datagrams) == message


@pytest.mark.parametrize(
    ("message", "fleet"),
    [
        (Message("desk", 1, 1, Kind.REPORT, 1.0, body={"x": "y" * MAX_CONTENT}), "lab"),
        (Message("desk", 1, 1, Kind.REPORT, 1.0), "f" * (MAX_NAME + 1)),
        (Message("desk", 1, 1, Kind.REPORT, -1.0), "lab"),
        (Message("desk", 1, 1, Kind.REPORT, 1e30), "lab"),
        (Message("desk", 1, 1, Kind.REPORT, 1.0, standing=True), "lab"),
    ],
)
def test_what_does_not_fit_is_refused(message: Message, fleet: str) -> None:
    with pytest.raises(MessageError):
        encode(message, fleet, DESK)


@given(st.data())
def test_no_byte_can_be_changed_unseen(data: st.DataObject) -> None:
    (datagram,) = encode(Message("desk", 3, 4, Kind.COMMAND, 5.0, text="(ST)"), "lab", DESK)
    at = data.draw(st.integers(0, len(datagram) - 1))
    forged = datagram[:at] + bytes([datagram[at] ^ data.draw(st.integers(1, 255))]) + datagram[at + 1 :]
    try:
        part = look(forged)
    except EnvelopeError:
        return
    assert part.key != DESK.id or not DESK.public.signed(part.signed, part.signature)


@given(
    st.binary(max_size=MAX_DATAGRAM + 10) | st.binary(max_size=200).map(lambda tail: b"\xd2\x84\x43\xa1\x01\x27" + tail)
)
def test_nonsense_is_refused_with_a_reason(datagram: bytes) -> None:
    with pytest.raises(EnvelopeError):
        look(datagram)


@given(st.binary(max_size=300))
def test_nonsense_with_a_good_signature_is_refused_too(content: bytes) -> None:
    (datagram,) = encode(Message("desk", 3, 4, Kind.COMMAND, 5.0), "lab", DESK)
    part = look(datagram)
    with suppress(EnvelopeError):
        read_message(part, "desk", content)
    with suppress(EnvelopeError):
        read_piece(msgspec.structs.replace(part, payload=part.payload[:51] + content))


def unwritten(value: object) -> object:
    """What a vector says: JSON has no bytes, so they stand there as a map of one."""
    if isinstance(value, dict):
        if set(value) == {"bytes"}:
            return bytes.fromhex(value["bytes"])
        return {key: unwritten(each) for key, each in value.items()}
    return [unwritten(each) for each in value] if isinstance(value, list) else value


def test_the_vectors_of_the_documentation() -> None:
    vectors = json.loads(VECTORS.read_text(encoding="utf-8"))
    for vector in vectors["messages"]:
        key = KeyPair(vector["owner"], Role(vector["role"]), bytes.fromhex(vector["seed"]))
        assert (key.public.public.hex(), key.id.hex()) == (vector["public"], vector["key"])
        told = dict(vector["message"], kind=Kind(vector["message"]["kind"]))
        if told["deadline"] is None:
            told["deadline"] = inf
        told["body"] = unwritten(told["body"])
        message = Message(**told)
        assert [datagram.hex() for datagram in encode(message, vector["fleet"], key)] == vector["datagrams"]
        assert decoded_by(key, [bytes.fromhex(datagram) for datagram in vector["datagrams"]]) == message
    for vector in vectors["refused"]:
        with pytest.raises(EnvelopeError):
            look(bytes.fromhex(vector["datagram"]))


def decoded_by(key: KeyPair, datagrams: list[bytes]) -> Message:
    parts = [look(datagram) for datagram in datagrams]
    assert all(part.key == key.id and key.public.signed(part.signed, part.signature) for part in parts)
    pieces = [read_piece(part) for part in parts]
    return read_message(parts[-1], pieces[0].sender, b"".join(piece.content for piece in pieces))
