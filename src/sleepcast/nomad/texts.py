"""The text of `tk`: characters in words, four each, turned round by clients whose machine is little-endian."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from sleepcast.core.errors import printable

ByteOrder = Literal["little", "big"]
MAX_TEXT = 1000
"""Characters of a text that are kept; the page and the terminal show no more."""


def text_of(words: Sequence[int], order: ByteOrder) -> str:
    """What a client of that byte order says, without what a terminal might obey.

    A 64-bit client sends only every other group of four characters: the others are lost before they get here.
    """
    sent = b"".join((word & 0xFFFF_FFFF).to_bytes(4, order) for word in words[: MAX_TEXT // 4])
    return printable(sent.partition(b"\0")[0].decode("latin-1"))
