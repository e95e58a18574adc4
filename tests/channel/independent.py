"""A receiver that was written from docs/wire.md alone: nothing of sleepcast, nothing for CBOR, only struct, hashlib and
Ed25519. If it reads what sleepcast sends, and drops what sleepcast drops, a robot in another language can."""

from __future__ import annotations

import hashlib
import struct
from dataclasses import dataclass, field

from nacl.exceptions import BadSignatureError
from nacl.signing import VerifyKey

KINDS = ["command", "ask", "stop", "release", "heartbeat", "answer", "report", "digest", "request", "command"]
STANDING = 9
ANYBODY = {"stop", "digest", "request"}
COMMANDING = ANYBODY | {"ask", "command", "release", "heartbeat"}
MAY = {
    "observer": ANYBODY | {"ask"},
    "operator": COMMANDING,
    "commander": COMMANDING,
    "robot": ANYBODY | {"command", "answer", "report"},
}
SKEW, NEWS, WINDOW, NEVER = 2_000_000, 3_600_000_000, 4_096, 2**63 - 1


class MalformedError(Exception):
    """Bytes that are no part of a message."""


def cbor(data: bytes, at: int) -> tuple[object, int]:
    """The value that begins at this place, and where the next one does."""
    if at >= len(data):
        raise MalformedError
    major, small, at = data[at] >> 5, data[at] & 31, at + 1
    size = {24: 1, 25: 2, 26: 4, 27: 8}.get(small, 0)
    raw = data[at : at + size]
    if small > 27 or len(raw) < size:
        raise MalformedError
    at += size
    if major == 7:
        simple = {20: False, 21: True, 22: None}
        if size > 1:
            return struct.unpack({2: ">e", 4: ">f", 8: ">d"}[size], raw)[0], at
        if small not in simple:
            raise MalformedError
        return simple[small], at
    count = int.from_bytes(raw, "big") if size else small
    if major in (0, 1):
        return (count if major == 0 else -1 - count), at
    if major in (2, 3):
        piece = data[at : at + count]
        if len(piece) < count:
            raise MalformedError
        try:
            return (piece if major == 2 else piece.decode()), at + count
        except UnicodeDecodeError:
            raise MalformedError from None
    items: list[object] = []
    for _ in range(count * (major - 3)):  # a list has as many, a map twice as many
        item, at = cbor(data, at)
        items.append(item)
    if major == 4:
        return items, at
    if major != 5 or not all(isinstance(name, str) for name in items[::2]):
        raise MalformedError
    return dict(zip(items[::2], items[1::2], strict=True)), at


def whole(data: bytes) -> object:
    """The one value that these bytes are."""
    value, end = cbor(data, 0)
    if end != len(data):
        raise MalformedError
    return value


@dataclass
class Part:
    """One datagram, by the places of its fields. Times are microseconds."""

    key: bytes
    kind: str
    stands: bool
    epoch: int
    sequence: int
    issued: int
    deadline: int
    number: int
    parts: int
    rest: bytes
    signed: bytes
    signature: bytes


def part_of(datagram: bytes) -> Part:
    """The fields that lie at fixed places. Raises MalformedError."""
    end = len(datagram) - 66
    if not 132 <= len(datagram) <= 1_200 or datagram[:9] != bytes.fromhex("d28443a10127a10448"):
        raise MalformedError
    payload = datagram[20:end]
    if datagram[17:20] != b"\x59" + struct.pack(">H", len(payload)) or datagram[end : end + 2] != b"\x58\x40":
        raise MalformedError
    heads = [payload[at] for at in (0, 3, 12, 21, 30, 39, 41)]
    version, kind = payload[1], payload[2]
    if heads != [0x8B, 0x1B, 0x1B, 0x1B, 0x1B, 0x18, 0x18] or version != 1 or kind > STANDING:
        raise MalformedError
    epoch, sequence, issued, deadline = (struct.unpack_from(">Q", payload, at)[0] for at in (4, 13, 22, 31))
    number, parts = payload[40], payload[42]
    if max(epoch, sequence, issued, deadline) > NEVER or not number < parts <= 96:
        raise MalformedError
    signed = b"\x84\x6aSignature1\x43\xa1\x01\x27\x40\x59" + struct.pack(">H", len(payload)) + payload
    fields = (KINDS[kind], kind == STANDING, epoch, sequence, issued, deadline, number, parts)
    return Part(datagram[9:17], *fields, payload[43:], signed, datagram[end + 2 :])


def names_and_piece(part: Part) -> tuple[str, str, bytes]:
    """Fleet, sender, and a piece of the content."""
    fleet, at = cbor(part.rest, 0)
    sender, at = cbor(part.rest, at)
    piece, at = cbor(part.rest, at)
    if at != len(part.rest) or not (isinstance(fleet, str) and isinstance(sender, str) and isinstance(piece, bytes)):
        raise MalformedError
    if len(fleet) > 64 or not 0 < len(sender) <= 64:
        raise MalformedError
    return fleet, sender, piece


def text_and_body(content: bytes) -> tuple[str, dict[str, object]]:
    """What a whole message says."""
    match whole(content):
        case [str() as text, dict() as body]:
            return text, body
    raise MalformedError


def is_good(public: bytes, part: Part) -> bool:
    """Whether the part bears the signature of this key."""
    try:
        VerifyKey(public).verify(part.signed, part.signature)
    except BadSignatureError:
        return False
    return True


def key_id(public: bytes) -> bytes:
    return hashlib.sha256(public).digest()[:8]


@dataclass
class Known:
    """A key in somebody's trust."""

    owner: str
    role: str
    public: bytes
    revoked: bool

    def may_be(self, name: str) -> bool:
        return name.startswith(self.owner[:-1]) if self.owner.endswith("*") else name == self.owner


@dataclass
class Receiver:
    """A party that takes in datagrams. now: Unix time, microseconds. heard: numbers of each sender in each epoch.
    nonce: of its own question for the time, b"" for none."""

    fleet: str
    robot: bool
    now: int
    keys: dict[bytes, Known]
    vouched: set[bytes]
    nonce: bytes = b""
    heard: dict[tuple[bytes, str, int], set[int]] = field(default_factory=dict)
    open: dict[tuple[bytes, str, int, int], dict[int, bytes]] = field(default_factory=dict)
    passed: list[tuple[str, Part, str, dict[str, object]]] = field(default_factory=list)

    def take(self, datagram: bytes) -> str:
        """`passed`, `kept` for a part that waits for others, or why it is dropped."""
        try:
            part = part_of(datagram)
            objection = self._first(part, datagram)
            if objection:
                return objection
            fleet, sender, piece = names_and_piece(part)
            if fleet != self.fleet:
                return "other fleet"
            if not self.keys[part.key].may_be(sender):
                return "not allowed"
            if self._knows(part, sender):
                return "repeated"
            return self._put_together(part, sender, piece)
        except MalformedError:
            return "malformed"

    def _first(self, part: Part, datagram: bytes) -> str:
        key = self.keys.get(part.key)
        if key is None:
            return "unknown key"
        if key.revoked and not (part.stands and hashlib.sha256(datagram).digest()[:12] in self.vouched):
            return "revoked key"
        if part.kind not in MAY[key.role] or (part.stands and key.role != "commander"):
            return "not allowed"
        mute = {"answer", "report"} if self.robot else {"command", "ask"} if key.role == "robot" else set()
        if part.kind in mute:
            return "not for us"
        ends = part.deadline if part.stands else min(part.deadline, part.issued + NEWS)
        timeless = {"stop"} if self.robot else {"stop", "answer", "report"}
        if self.nonce and part.kind == "heartbeat" and part.parts == 1 and self.nonce in part.rest:
            timeless = {"heartbeat"}
        if self.now > ends + SKEW and part.kind not in timeless:
            return "late"
        if part.issued > self.now + SKEW and part.kind not in timeless:
            return "from the future"
        if not key.owner.endswith("*") and self._knows(part, key.owner):
            return "repeated"
        return "" if is_good(key.public, part) else "forged"

    def _knows(self, part: Part, sender: str) -> bool:
        numbers = self.heard.get((part.key, sender, part.epoch), set())
        old = bool(numbers) and part.sequence <= max(numbers) - WINDOW
        if not part.stands and (old or part.sequence in numbers):
            return True
        return part.number in self.open.get((part.key, sender, part.epoch, part.sequence), {})

    def _put_together(self, part: Part, sender: str, piece: bytes) -> str:
        which = part.key, sender, part.epoch, part.sequence
        pieces = self.open.setdefault(which, {})
        pieces[part.number] = piece
        if len(pieces) < part.parts:
            return "kept"
        del self.open[which]
        text, body = text_and_body(b"".join(pieces[number] for number in range(part.parts)))
        self.heard.setdefault((part.key, sender, part.epoch), set()).add(part.sequence)
        self.passed.append((sender, part, text, body))
        return "passed"
