"""Messages as bytes: what goes over the air, and nothing of who believes it.

A message is one datagram, or several parts if it is long, and each part is signed by itself: a receiver never keeps a
byte of which it does not know who sent it. A part is a COSE_Sign1 (RFC 9052) in CBOR (RFC 8949), and what decides
whether it is worth a look - key, kind, number, times - is written with arguments of fixed size, so that it lies at a
fixed place and costs nothing to read. docs/wire.md has every byte.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isinf
from struct import Struct
from typing import NamedTuple

import cbor2

from sleepcast.channel.keys import ID_BYTES, SIGNATURE_BYTES, KeyPair
from sleepcast.channel.message import MAX_NAME, MAX_NUMBER, MAX_TEXT, Kind, Message, MessageError

VERSION = 1
MAX_DATAGRAM = 1_200
"""Bytes of a part: whole on every path, since IPv6 promises 1,280 with its headers."""
MAX_CONTENT = 4 * MAX_TEXT + 4_096
"""Bytes of what a message says: a longest text of the widest characters, and its body."""
NEVER = MAX_NUMBER
"""A deadline that does not come."""
MICRO = 1e6
"""Times are told in microseconds."""
MAX_DEPTH = 4
"""Lists and maps within each other in a body."""

KINDS: Sequence[Kind] = (
    Kind.COMMAND,
    Kind.ASK,
    Kind.STOP,
    Kind.RELEASE,
    Kind.HEARTBEAT,
    Kind.ANSWER,
    Kind.REPORT,
    Kind.DIGEST,
    Kind.REQUEST,
)
"""Kinds by their number on the air."""
NUMBER = {kind: number for number, kind in enumerate(KINDS)}
STANDING = len(KINDS)
"""The number of a command that stands."""
KIND_BY_NUMBER = (*KINDS, Kind.COMMAND)

HEAD = b"\xd2\x84\x43\xa1\x01\x27\xa1\x04\x48"
"""COSE_Sign1; protected: EdDSA; unprotected: the key's id, eight bytes, which follow."""
PAYLOAD_AT = len(HEAD) + ID_BYTES + 3
FIXED = Struct(">BBBBQBQBQBQBBBB")
"""An array of eleven: version, kind, epoch, sequence, issued, deadline, part and parts, each with its CBOR head."""
KIND_AT = PAYLOAD_AT + 2
"""Where the number of the kind lies."""
ARRAY, SMALL, LONG = 0x8B, 0x18, 0x1B
SIGNATURE_HEAD = b"\x58\x40"
TAIL = len(SIGNATURE_HEAD) + SIGNATURE_BYTES
LEAST = PAYLOAD_AT + FIXED.size + 3 + TAIL
"""Bytes of the shortest part: no fleet, no sender, no content."""
MAX_PARTS = 96
"""Parts of one message: `MAX_CONTENT` in datagrams with the longest names."""


class EnvelopeError(MessageError):
    """Bytes that are no part of a message."""


class Part(NamedTuple):
    """What can be read of a part without believing it.

    standing: whether it is of a command that stands. issued, deadline: s of Unix time, inf for none; number: of this
    part, from 0, of `parts`. payload: what is signed.
    """

    key: bytes
    kind: Kind
    standing: bool
    epoch: int
    sequence: int
    issued: float
    deadline: float
    number: int
    parts: int
    payload: bytes
    signature: bytes

    @property
    def signed(self) -> bytes:
        """What the signature covers: the Sig_structure of RFC 9052, section 4.4."""
        return signed_bytes(self.payload)


class Piece(NamedTuple):
    """The rest of a part, read once its signature is known to be good. content: a piece of what the message says."""

    fleet: str
    sender: str
    content: bytes


def encode(message: Message, fleet: str, key: KeyPair) -> list[bytes]:
    """The parts of a message, signed. Times are rounded to microseconds. Raises MessageError for what is too long."""
    content = content_of(message.text, message.body)
    if len(content) > MAX_CONTENT:
        raise MessageError(f"a message says at most {MAX_CONTENT} bytes, this one of {message.sender} {len(content)}")
    if message.standing and message.kind is not Kind.COMMAND:
        raise MessageError(f"only commands stand, no {message.kind}")
    if len(fleet) > MAX_NAME:
        raise MessageError(f"a fleet's name has at most {MAX_NAME} characters, not {len(fleet)}")
    names = cbor2.dumps(fleet) + cbor2.dumps(message.sender)
    room = MAX_DATAGRAM - LEAST - len(names)
    pieces = [content[at : at + room] for at in range(0, len(content), room)]
    deadline = NEVER if isinf(message.deadline) else _micro(message.deadline)
    kind = STANDING if message.standing else NUMBER[message.kind]
    found = []
    for number, piece in enumerate(pieces):
        fixed = FIXED.pack(
            *(ARRAY, VERSION, kind, LONG, message.epoch, LONG, message.sequence),
            *(LONG, _micro(message.issued), LONG, deadline, SMALL, number, SMALL, len(pieces)),
        )
        payload = fixed + names + cbor2.dumps(piece)
        length = b"\x59" + len(payload).to_bytes(2, "big")
        signature = key.sign(signed_bytes(payload))
        found.append(b"".join((HEAD, key.id, length, payload, SIGNATURE_HEAD, signature)))
    return found


def content_of(text: str, body: dict[str, object]) -> bytes:
    """What a message says, as bytes."""
    return cbor2.dumps([text, body])


def kind_of(datagram: bytes) -> Kind | None:
    """The kind that a datagram has if it is a message at all, at the price of a glance; None if that cannot be."""
    if len(datagram) < LEAST or not datagram.startswith(HEAD) or datagram[KIND_AT] > STANDING:
        return None
    return KIND_BY_NUMBER[datagram[KIND_AT]]


def look(datagram: bytes) -> Part:
    """What can be read of a datagram without believing it. Raises EnvelopeError for what is no part of a message."""
    if not LEAST <= len(datagram) <= MAX_DATAGRAM:
        raise EnvelopeError(f"a part of a message has {LEAST} to {MAX_DATAGRAM} bytes, not {len(datagram)}")
    if not datagram.startswith(HEAD):
        raise EnvelopeError("these bytes do not begin as a signed message does")
    end = len(datagram) - TAIL
    length = datagram[PAYLOAD_AT - 3 : PAYLOAD_AT]
    if length != b"\x59" + (end - PAYLOAD_AT).to_bytes(2, "big") or datagram[end : end + 2] != SIGNATURE_HEAD:
        raise EnvelopeError("a message whose parts do not have the lengths that it says")
    (array, version, kind, *heads_and_numbers) = FIXED.unpack_from(datagram, PAYLOAD_AT)
    heads, numbers = heads_and_numbers[::2], heads_and_numbers[1::2]
    if array != ARRAY or heads != [LONG, LONG, LONG, LONG, SMALL, SMALL]:
        raise EnvelopeError("a message whose fields are not where they belong")
    if version != VERSION:
        raise EnvelopeError(
            f"a message of version {version}, and this sleepcast reads {VERSION}: a newer one is needed"
        )
    epoch, sequence, issued, deadline, number, parts = numbers
    if kind > STANDING or max(numbers) > MAX_NUMBER or not number < parts <= MAX_PARTS:
        raise EnvelopeError("a message with numbers beyond their bounds")
    return Part(
        datagram[len(HEAD) : len(HEAD) + ID_BYTES],
        KIND_BY_NUMBER[kind],
        kind == STANDING,
        epoch,
        sequence,
        issued / MICRO,
        inf if deadline == NEVER else deadline / MICRO,
        number,
        parts,
        datagram[PAYLOAD_AT:end],
        datagram[end + len(SIGNATURE_HEAD) :],
    )


def signed_bytes(payload: bytes) -> bytes:
    """See `Part.signed`."""
    return b"\x84\x6aSignature1\x43\xa1\x01\x27\x40\x59" + len(payload).to_bytes(2, "big") + payload


def read_piece(part: Part) -> Piece:
    """The rest of a part that is believed. Raises EnvelopeError if even its sender wrote nonsense."""
    found = _decoded(b"\x83" + part.payload[FIXED.size :])
    match found:
        case [str() as fleet, str() as sender, bytes() as content] if len(fleet) <= MAX_NAME:
            return Piece(fleet, sender, content)
    raise EnvelopeError("a message without fleet, sender and content")


def read_message(part: Part, sender: str, content: bytes, role: str = "") -> Message:
    """The message whose last part to arrive is `part`, and whose pieces make `content`. role: of the key that signed
    it. Raises EnvelopeError."""
    found = _decoded(content)
    match found:
        case [str() as text, dict() as body] if plain(body):
            try:
                return Message(
                    *(sender, part.epoch, part.sequence, part.kind, part.issued, part.deadline, text, part.standing),
                    body,
                    role,
                )
            except MessageError as error:
                raise EnvelopeError(str(error)) from None
    raise EnvelopeError("a message that says something else than a text and a body")


def plain(body: object, depth: int = MAX_DEPTH) -> bool:
    """Whether this is plain data: maps by text, lists, texts, bytes, numbers, truth, nothing."""
    if isinstance(body, dict):
        return depth > 0 and all(isinstance(key, str) and plain(value, depth - 1) for key, value in body.items())
    if isinstance(body, list):
        return depth > 0 and all(plain(value, depth - 1) for value in body)
    return body is None or isinstance(body, str | bytes | bool | int | float)


def _decoded(data: bytes) -> object:
    try:
        return cbor2.loads(data)
    except (cbor2.CBORDecodeError, ValueError, RecursionError, MemoryError) as error:
        raise EnvelopeError(f"a message whose content is no CBOR: {error}") from None


def _micro(time: float) -> int:
    found = round(time * MICRO)
    if not 0 <= found < NEVER:
        raise MessageError(f"a time of {time} s cannot be sent: it must lie between 0 and {NEVER / MICRO:g} s")
    return found
