"""An attacker: he has recorded what was on the air, has a key of his own, one that was revoked, and an observer's.

What he sends is made from that in ten ways. None of it may move a robot, and only what he says with the observer's key,
within what an observer may say, may make one answer.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from random import Random

import cbor2

from sleepcast.channel import Kind, Message
from sleepcast.channel.envelope import (
    FIXED,
    HEAD,
    MAX_DATAGRAM,
    NUMBER,
    PAYLOAD_AT,
    SIGNATURE_HEAD,
    STANDING,
    TAIL,
    encode,
    signed_bytes,
)
from sleepcast.channel.keys import ID_BYTES, KeyPair
from sleepcast.channel.message import MAX_NUMBER

EDGES = (0, 1, 2**31, 2**32, MAX_NUMBER - 1, MAX_NUMBER, 2**64 - 1)
"""Numbers at which programs go wrong."""
FIELDS = {3: 8, 12: 8, 21: 8, 30: 8, 40: 1, 42: 1, 1: 1, 2: 1, 0: 1}
"""Where the numbers of a message lie in what is signed, and their bytes: epoch, sequence, times, parts, heads."""
DEEPEST = 6
LONGEST_CONTENT = 1_000
EVIL = "(SETQ hits (+ hits 1000000))"
"""What he would have robots do."""


class Attacker:
    """own: a key that nobody knows; revoked, observer: keys that were once known, or are. victim: whose name he takes.

    recorded: what was on the air, by whomever; it must not be empty when he begins.
    """

    def __init__(self, fleet: str, own: KeyPair, revoked: KeyPair, observer: KeyPair, victim: KeyPair, chance: Random):
        self.recorded: list[bytes] = []
        self._fleet, self._own, self._revoked, self._observer = fleet, own, revoked, observer
        self._victim, self._chance = victim.public, chance
        self._sequence = 0
        self.now = 0.0
        """The time as he knows it, s of Unix time."""
        self.ways: dict[str, Callable[[], bytes]] = {
            "bits flipped": self._flipped,
            "cut or lengthened": self._cut,
            "spliced of two": self._spliced,
            "a number changed": self._renumbered,
            "replayed": self._replayed,
            "noise": self._noise,
            "signed by a stranger": self._stranger,
            "signed by a stranger, as the operator's": self._impostor,
            "signed with a revoked key": self._with_revoked,
            "an observer's command": self._with_observer,
        }

    def __call__(self, way: str) -> bytes:
        """One datagram, made this way."""
        return self.ways[way]()

    # ---- what was recorded, damaged

    def _any(self) -> bytes:
        return self._chance.choice(self.recorded)

    def _flipped(self) -> bytes:
        data = bytearray(self._any())
        for _ in range(self._chance.choice((1, 1, 1, 2, 3, 8))):
            bit = self._chance.randrange(8 * len(data))
            data[bit >> 3] ^= 1 << (bit & 7)
        return bytes(data)

    def _cut(self) -> bytes:
        data = self._any()
        if self._chance.random() < 0.8:
            return data[: self._chance.randrange(len(data))]
        return data + self._chance.randbytes(self._chance.randrange(1, MAX_DATAGRAM))

    def _spliced(self) -> bytes:
        one, other = self._any(), self._any()
        at = self._chance.randrange(1, len(one))
        return one[:at] + other[at:]

    def _renumbered(self) -> bytes:
        data = bytearray(self._any())
        at, size = self._chance.choice(tuple(FIELDS.items()))
        number = self._chance.choice(EDGES) if size == 8 else self._chance.randrange(256)
        data[PAYLOAD_AT + at : PAYLOAD_AT + at + size] = number.to_bytes(size, "big")
        return bytes(data)

    def _replayed(self) -> bytes:
        return self._any()

    def _noise(self) -> bytes:
        data = self._chance.randbytes(self._chance.randrange(0, MAX_DATAGRAM + 200))
        return data if self._chance.random() < 0.5 else HEAD + data

    # ---- what he signs himself

    def _command(self, key: KeyPair, sender: str, kind: Kind = Kind.COMMAND) -> bytes:
        self._sequence += 1
        epoch = self._chance.choice((0, 1, 2, int(self.now), int(self.now * 1_000.0)))
        standing = kind is Kind.COMMAND and self._chance.random() < 0.5
        text = EVIL if kind is Kind.COMMAND else ""
        body: dict[str, object] = {"after": 0, "until": None, "rules": 0}
        message = Message(sender, epoch, self._sequence, kind, self.now, self.now + 5.0, text, standing, body)
        return encode(message, self._fleet, key)[0]

    def _stranger(self) -> bytes:
        return self._command(self._own, self._victim.owner)

    def _impostor(self) -> bytes:
        """The operator's id, and a signature that is not his: as dear to a robot as it gets."""
        kind = self._chance.choice((Kind.COMMAND, Kind.COMMAND, Kind.STOP, Kind.RELEASE, Kind.HEARTBEAT))
        data = self._command(self._own, self._victim.owner, kind)
        return data[: len(HEAD)] + self._victim.id + data[len(HEAD) + ID_BYTES :]

    def _with_revoked(self) -> bytes:
        return self._command(self._revoked, self._revoked.public.owner)

    def _with_observer(self) -> bytes:
        kind = self._chance.choice((Kind.COMMAND, Kind.RELEASE, Kind.HEARTBEAT))
        sender = self._chance.choice((self._observer.public.owner, self._victim.owner))
        return self._command(self._observer, sender, kind)

    # ---- what an observer may say, said badly

    def nonsense(self) -> bytes:
        """A datagram of the observer's key with a good signature: of a kind that he may send, or of none; what it says
        is CBOR of any shape, or none."""
        self._sequence += 1
        kind = self._chance.choice((NUMBER[Kind.DIGEST], NUMBER[Kind.REQUEST], NUMBER[Kind.ASK], STANDING + 1))
        content = self._chance.choice((self._garbage, self._shapes, self._repairs))()
        piece = cbor2.dumps(content[:LONGEST_CONTENT])
        names = cbor2.dumps(self._fleet) + cbor2.dumps(self._observer.public.owner)
        if self._chance.random() < 0.1:
            names = self._chance.randbytes(len(names))
        parts = self._chance.choice((1, 1, 1, 2, 96))
        times = (round(self.now * 1e6), round((self.now + 5.0) * 1e6))
        fixed = FIXED.pack(
            *(0x8B, 1, kind, 0x1B, 1, 0x1B, self._sequence, 0x1B, times[0], 0x1B, times[1]),
            *(0x18, self._chance.randrange(parts), 0x18, parts),
        )
        payload = fixed + names + piece
        signature = self._observer.sign(signed_bytes(payload))
        length = b"\x59" + struct.pack(">H", len(payload))
        return b"".join((HEAD, self._observer.id, length, payload, SIGNATURE_HEAD, signature))

    def _garbage(self) -> bytes:
        return self._chance.randbytes(self._chance.randrange(200))

    def _shapes(self) -> bytes:
        return cbor2.dumps(["", {self._word(): self._value(DEEPEST)}])

    def _repairs(self) -> bytes:
        """What digests and requests have, with streams and numbers of any sort."""
        streams = [
            [self._chance.choice((self._victim.id, b"", b"x" * 8, 5)), self._number(), self._value(2)]
            for _ in range(self._chance.randrange(40))
        ]
        return cbor2.dumps(["", {self._chance.choice(("have", "want", "again", "for", "within")): streams}])

    def _value(self, depth: int) -> object:
        sort = self._chance.randrange(6 if depth else 4)
        if sort == 0:
            return self._number()
        if sort == 1:
            return self._word()
        if sort == 2:
            return self._chance.choice((None, True, 1e308, float("nan"), float("inf"), -0.0))
        if sort == 3:
            return self._chance.randbytes(8)
        size = self._chance.randrange(5)
        if sort == 4:
            return [self._value(depth - 1) for _ in range(size)]
        return {self._word(): self._value(depth - 1) for _ in range(size)}

    def _number(self) -> int:
        return self._chance.choice((*EDGES, -1, -(2**63), self._chance.randrange(100)))

    def _word(self) -> str:
        words: Sequence[str] = ("", "have", "want", "after", "until", "rules", "within", "for", "again", "\0", "é" * 40)
        return self._chance.choice(words)


assert PAYLOAD_AT + FIXED.size + TAIL < MAX_DATAGRAM
