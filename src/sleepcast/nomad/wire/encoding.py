"""The wire without sockets: bytes to requests, and replies to bytes.

A message is a type (signed, 16 bits), a size (unsigned, 16 bits: how many words follow) and its words, all big-endian.
A word is a signed number of 32 bits, but how many bytes it takes depends on how the client's program was compiled
(`Layout`); a client shows it in its first request that connects, and keeps to it. A message with more words than
anybody needs is read past, not kept, and comes out marked as too long.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from functools import lru_cache
from struct import Struct
from typing import Literal, NamedTuple

from sleepcast.core.errors import printable

HEADER = Struct(">hH")
MAX_WORDS = 4096
"""Of a request that is kept: a text of 16 KiB, many times the longest message that a program of the time sent."""

CONNECTING = frozenset({101, 102, 103})
"""Types of the requests that show a client's layout: two words, the robot's number and the process's, both above 0."""
_SHORT_WORDS = 8
"""Bytes of their words in the 32-bit layout."""


class Layout(Enum):
    """How a client lays out words. FOUR: 4 bytes, the true protocol. EIGHT_TAIL and EIGHT_HEAD: 8 bytes of a 64-bit
    client, in which the value is in the last, or in the first, four of each word that it sends; of a reply it reads
    the first four in either case."""

    FOUR = "4 bytes"
    EIGHT_TAIL = "8 bytes, value last"
    EIGHT_HEAD = "8 bytes, value first"


class Request(NamedTuple):
    """What a client asks: words, of which there are `size`, or none of them if that is more than `MAX_WORDS`."""

    type: int
    words: tuple[int, ...]
    size: int


class Parser:
    """The requests in one client's bytes, in order, however the bytes come in pieces.

    layout: the client's, None as long as it has not shown it; until then words are taken for 4 bytes.
    """

    def __init__(self) -> None:
        self.layout: Layout | None = None
        self._buffer = bytearray()
        self._skip = 0
        """Bytes still to come of a message that is too long."""
        self._long: Request | None = None
        """That message, given once all of it has been skipped."""

    @property
    def buffered(self) -> int:
        """Bytes that wait here."""
        return len(self._buffer)

    @property
    def undecided(self) -> bool:
        """Whether a whole 32-bit request to connect is here that may also be half of a 64-bit one, to robot 0 in the
        first case. Only time can tell: see `decide`."""
        return self.layout is None and self._connects() and len(self._buffer) == HEADER.size + _SHORT_WORDS

    def decide(self) -> None:
        """No more is coming for now: it is a 32-bit request."""
        if self.undecided:
            self.layout = Layout.FOUR

    def feed(self, data: bytes | memoryview) -> None:
        """Take what has come."""
        if self._skip:
            skipped = min(self._skip, len(data))
            self._skip -= skipped
            data = data[skipped:]
        self._buffer += data

    def next(self) -> Request | None:
        """The next whole request, None while there is none."""
        if self._long is not None:
            if self._skip:
                return None
            long, self._long = self._long, None
            return long
        buffer = self._buffer
        if len(buffer) < HEADER.size:
            return None
        kind, size = HEADER.unpack_from(buffer)
        if size == 0:
            del buffer[: HEADER.size]
            return Request(kind, (), 0)
        if self.layout is None and not self._shown():
            return None
        length = HEADER.size + (4 if self.layout in (None, Layout.FOUR) else 8) * size
        if size > MAX_WORDS:
            self._long = Request(kind, (), size)
            self._skip = max(0, length - len(buffer))
            del buffer[:length]
            return self.next()
        if len(buffer) < length:
            return None
        if self.layout in (None, Layout.FOUR):
            words = _numbers(size).unpack_from(buffer, HEADER.size)
        else:
            both = _numbers(2 * size).unpack_from(buffer, HEADER.size)
            words = both[1::2] if self.layout is Layout.EIGHT_TAIL else both[::2]
        del buffer[:length]
        return Request(kind, words, size)

    def _connects(self) -> bool:
        if len(self._buffer) < HEADER.size:
            return False
        kind, size = HEADER.unpack_from(self._buffer)
        return kind in CONNECTING and size == 2

    def _shown(self) -> bool:
        """Find the layout if this is the request that shows it; False if more of it must come first."""
        if not self._connects():
            return True
        buffer = self._buffer
        if len(buffer) < HEADER.size + _SHORT_WORDS:
            return False
        first, second = buffer[4:8], buffer[8:12]
        if any(first):
            self.layout = Layout.FOUR if any(second) else Layout.EIGHT_HEAD
        elif len(buffer) > HEADER.size + _SHORT_WORDS:
            self.layout = Layout.EIGHT_TAIL
        return self.layout is not None


def encode(layout: Layout | None, kind: int, words: Sequence[int] = ()) -> bytes:
    """A reply, in the way in which a client of this layout reads it."""
    body = words if layout in (None, Layout.FOUR) else [half for value in words for half in (value, 0)]
    return HEADER.pack(kind, len(words)) + _numbers(len(body)).pack(*body)


def encode_request(layout: Layout, kind: int, words: Sequence[int] = ()) -> bytes:
    """A request, as a client of this layout sends it."""
    if layout is Layout.EIGHT_TAIL:
        body = [half for value in words for half in (0, value)]
        return HEADER.pack(kind, len(words)) + _numbers(len(body)).pack(*body)
    return encode(layout, kind, words)


def decode(body: bytes) -> tuple[int, ...]:
    """The words of a reply in the layout of 4 bytes."""
    return _numbers(len(body) // 4).unpack(body)


@lru_cache(maxsize=256)
def _numbers(count: int) -> Struct:
    return Struct(f">{count}i")


# The text of `tk`: characters in words, four each, turned round by clients whose machine is little-endian.

ByteOrder = Literal["little", "big"]
MAX_TEXT = 1000
"""Characters of a text that are kept; the page and the terminal show no more."""


def text_of(words: Sequence[int], order: ByteOrder) -> str:
    """What a client of that byte order says, without what a terminal might obey.

    A 64-bit client sends only every other group of four characters: the others are lost before they get here.
    """
    sent = b"".join((word & 0xFFFF_FFFF).to_bytes(4, order) for word in words[: MAX_TEXT // 4])
    return printable(sent.partition(b"\0")[0].decode("latin-1"))
