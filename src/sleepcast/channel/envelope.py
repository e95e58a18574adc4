"""The envelope: messages as signed bytes, and back. Whether a signature is trusted is not decided here.

A message is one datagram, or several parts if it is long. Each part is signed by itself, so a receiver never stores a
byte of unknown origin. A part is a COSE_Sign1 (RFC 9052) in CBOR (RFC 8949). The fields by which most parts are dropped
(key, kind, number, times) have a fixed size, so they lie at fixed offsets and cost almost nothing to read. docs/wire.md
describes every byte.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import inf, isinf
from struct import Struct

import cbor2
import msgspec

from sleepcast.channel.keys import ID_BYTES, SIGNATURE_BYTES, KeyPair
from sleepcast.channel.message import MAX_NAME, MAX_NUMBER, MAX_TEXT, Kind, Message, MessageError

_VERSION = 1
MAX_DATAGRAM = 1_200
"""Bytes of a part. It is never fragmented: IPv6 guarantees 1,280 bytes with its headers."""
MAX_CONTENT = 4 * MAX_TEXT + 4_096
"""Bytes of a message's content: the longest text in the widest characters, and its body."""
NEVER = MAX_NUMBER
"""The deadline of a message that never expires."""
_MICRO = 1e6
"""Times are sent in microseconds."""
MAX_DEPTH = 4
"""Nesting of lists and maps in a body."""
_SCALARS = frozenset({type(None), bool, int, float, str, bytes})
_TEXTS = frozenset({str})

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
"""Kinds by their number on the wire."""
NUMBER = {kind: number for number, kind in enumerate(KINDS)}
STANDING = len(KINDS)
"""The number of a standing command."""
_KIND_BY_NUMBER = (*KINDS, Kind.COMMAND)

HEAD = b"\xd2\x84\x43\xa1\x01\x27\xa1\x04\x48"
"""COSE_Sign1; protected: EdDSA; unprotected: the key's id, whose eight bytes follow."""
PAYLOAD_AT = len(HEAD) + ID_BYTES + 3
FIXED = Struct(">BBBBQBQBQBQBBBB")
"""An array of eleven: version, kind, epoch, sequence, issued, deadline, part and parts, each with its CBOR head."""
_BEGINNING = Struct(f">{ID_BYTES}sBH{FIXED.format.removeprefix('>')}")
"""The key's id, the length of the payload, and `FIXED`."""
KIND_AT = PAYLOAD_AT + 2
"""Offset of the kind's number."""
_ARRAY, _SMALL, LONG, _LONG_BYTES = 0x8B, 0x18, 0x1B, 0x59
_BYTES, _TEXT = 0x40, 0x60
"""The CBOR heads of an empty byte string and of an empty text. A length up to 23 is added to them."""
_LENGTHS = {24: 1, 25: 2, 26: 4, 27: 8}
"""What is added instead where the length follows, and in how many bytes."""
_HEADS = (LONG, LONG, LONG, LONG, _SMALL, _SMALL)
"""The CBOR heads in `FIXED`, from the epoch's on."""
SIGNATURE_HEAD = b"\x58\x40"
TAIL = len(SIGNATURE_HEAD) + SIGNATURE_BYTES
LEAST = PAYLOAD_AT + FIXED.size + 3 + TAIL
"""Bytes of the shortest part: no fleet, no sender, no content."""
MAX_PARTS = 96
"""Parts of one message: enough for `MAX_CONTENT` with the longest names."""


class EnvelopeError(MessageError):
    """Bytes that are not a part of a message."""


class Fragment(msgspec.Struct, frozen=True, gc=False):
    """The fields of a part that are readable before its signature is checked.

    standing: whether it belongs to a standing command
    issued, deadline: s of Unix time, inf for none
    number: of this part, from 0, of `parts`
    payload: the signed bytes
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
        """The bytes that the signature covers: the Sig_structure of RFC 9052, section 4.4."""
        return signed_bytes(self.payload)


class Piece(msgspec.Struct, frozen=True, gc=False):
    """The rest of a part, read once its signature is verified. content: a piece of the message's content."""

    fleet: str
    sender: str
    content: bytes


def encode(message: Message, fleet: str, key: KeyPair) -> list[bytes]:
    """The signed parts of a message. Times are rounded to microseconds. Raises MessageError if it is too long."""
    content = content_of(message.text, message.body)
    if len(content) > MAX_CONTENT:
        raise MessageError(
            f"a message has at most {MAX_CONTENT} bytes of content, this one from {message.sender} has {len(content)}"
        )
    if message.standing and message.kind is not Kind.COMMAND:
        raise MessageError(f"only commands can be standing, not {message.kind}")
    if len(fleet) > MAX_NAME:
        raise MessageError(f"a fleet's name has at most {MAX_NAME} characters, not {len(fleet)}")
    names = cbor2.dumps(fleet) + cbor2.dumps(message.sender)
    room = MAX_DATAGRAM - LEAST - len(names)
    pieces = [content[at : at + room] for at in range(0, len(content), room)]
    deadline = NEVER if isinf(message.deadline) else _micro(message.deadline)
    kind = STANDING if message.standing else NUMBER[message.kind]
    datagrams = []
    for number, piece in enumerate(pieces):
        fixed = FIXED.pack(
            *(_ARRAY, _VERSION, kind, LONG, message.epoch, LONG, message.sequence),
            *(LONG, _micro(message.issued), LONG, deadline, _SMALL, number, _SMALL, len(pieces)),
        )
        payload = fixed + names + cbor2.dumps(piece)
        length = b"\x59" + len(payload).to_bytes(2, "big")
        signature = key.sign(signed_bytes(payload))
        datagrams.append(b"".join((HEAD, key.id, length, payload, SIGNATURE_HEAD, signature)))
    return datagrams


def encoded_size(message: Message, fleet: str) -> int:
    """Bytes of all parts of a message, however long it is."""
    content = len(content_of(message.text, message.body))
    head = LEAST + len(cbor2.dumps(fleet)) + len(cbor2.dumps(message.sender))
    return content + head * -(-content // (MAX_DATAGRAM - head))


def content_of(text: str, body: dict[str, object]) -> bytes:
    """The content of a message as bytes."""
    return cbor2.dumps([text, body])


def kind_of(datagram: bytes) -> Kind | None:
    """The kind that a datagram claims, without any other check; None if it cannot be a message."""
    if len(datagram) < LEAST or not datagram.startswith(HEAD) or datagram[KIND_AT] > STANDING:
        return None
    return _KIND_BY_NUMBER[datagram[KIND_AT]]


def look(datagram: bytes) -> Fragment:
    """The fields of a datagram that are readable before its signature is checked. Raises EnvelopeError if it is not a
    part of a message."""
    if not LEAST <= len(datagram) <= MAX_DATAGRAM:
        raise EnvelopeError(f"a part of a message has {LEAST} to {MAX_DATAGRAM} bytes, not {len(datagram)}")
    if not datagram.startswith(HEAD):
        raise EnvelopeError("these bytes do not begin like a signed message")
    end = len(datagram) - TAIL
    key, long, length, array, version, kind, *fields = _BEGINNING.unpack_from(datagram, len(HEAD))
    if long != _LONG_BYTES or length != end - PAYLOAD_AT or datagram[end : end + 2] != SIGNATURE_HEAD:
        raise EnvelopeError("a message whose lengths are not those that it states")
    head_1, epoch, head_2, sequence, head_3, issued, head_4, deadline, head_5, number, head_6, parts = fields
    if array != _ARRAY or (head_1, head_2, head_3, head_4, head_5, head_6) != _HEADS:
        raise EnvelopeError("a message whose fields are not where they belong")
    if version != _VERSION:
        raise EnvelopeError(
            f"a message of version {version}, and this sleepcast reads {_VERSION}: a newer one is needed"
        )
    if kind > STANDING or max(epoch, sequence, issued, deadline) > MAX_NUMBER or not number < parts <= MAX_PARTS:
        raise EnvelopeError("a message with numbers out of range")
    return Fragment(
        key,
        _KIND_BY_NUMBER[kind],
        kind == STANDING,
        epoch,
        sequence,
        issued / _MICRO,
        inf if deadline == NEVER else deadline / _MICRO,
        number,
        parts,
        datagram[PAYLOAD_AT:end],
        datagram[end + len(SIGNATURE_HEAD) :],
    )


def signed_bytes(payload: bytes) -> bytes:
    """See `Fragment.signed`."""
    return b"\x84\x6aSignature1\x43\xa1\x01\x27\x40\x59" + len(payload).to_bytes(2, "big") + payload


def read_piece(part: Fragment) -> Piece:
    """The rest of a verified part. Raises EnvelopeError if its signer wrote something malformed."""
    payload = part.payload
    try:
        fleet, at = _string(payload, FIXED.size, _TEXT)
        sender, at = _string(payload, at, _TEXT)
        content, at = _string(payload, at, _BYTES)
        piece = Piece(fleet.decode(), sender.decode(), content)
    except ValueError:
        piece = None
    if piece is None or at != len(payload) or len(piece.fleet) > MAX_NAME:
        raise EnvelopeError("a message without fleet, sender and content")
    return piece


def _string(payload: bytes, at: int, kind: int) -> tuple[bytes, int]:
    """The text or the bytes (`kind`) at an offset, as CBOR has them, and the offset of what follows, which is past the
    end where some are missing. Raises ValueError for anything else."""
    size, at = payload[at] - kind if at < len(payload) else -1, at + 1
    if size in _LENGTHS:
        size, at = int.from_bytes(payload[at : at + _LENGTHS[size]], "big"), at + _LENGTHS[size]
    elif not 0 <= size < 24:
        raise ValueError(f"no string at {at}")
    return payload[at : at + size], at + size


def read_message(part: Fragment, sender: str, content: bytes, role: str = "", ahead: float = 0.0) -> Message:
    """The message whose pieces make `content`, and of which `part` arrived last. role: of the key that signed it,
    "" where nobody has verified it; ahead: see `Message`. Raises EnvelopeError."""
    decoded = _decoded(content)
    match decoded:
        case [str() as text, dict() as body] if plain(body):
            sent, key = (part.kind, part.issued, part.deadline), part.key.hex() if role else ""
            try:
                return Message(
                    sender, part.epoch, part.sequence, *sent, text, part.standing, body, role, None, ahead, key
                )
            except MessageError as error:
                raise EnvelopeError(str(error)) from None
    raise EnvelopeError("a message whose content is not a text and a body")


def plain(body: object, depth: int = MAX_DEPTH) -> bool:
    """Whether this is plain data: maps with text keys, lists, texts, bytes, numbers, booleans, null."""
    if isinstance(body, dict):
        if not _TEXTS.issuperset(map(type, body)):
            return False
        inner: Iterable[object] = body.values()
    elif isinstance(body, list):
        inner = body
    else:
        return type(body) in _SCALARS
    if depth <= 0:
        return False
    if _SCALARS.issuperset(map(type, inner)):  # so it often is, and this is done for each message
        return True
    return all(type(value) in _SCALARS or plain(value, depth - 1) for value in inner)


def _decoded(data: bytes) -> object:
    try:
        return cbor2.loads(data)
    except (cbor2.CBORDecodeError, ValueError, RecursionError, MemoryError) as error:
        raise EnvelopeError(f"a message whose content is not CBOR: {error}") from None


def _micro(time: float) -> int:
    micros = round(time * _MICRO)
    if not 0 <= micros < NEVER:
        raise MessageError(f"a time of {time} s cannot be sent: it must lie between 0 and {NEVER / _MICRO:g} s")
    return micros
