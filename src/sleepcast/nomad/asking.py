"""How a program's values look as the words of a request: masks, orders, texts, corners, packets; pure, and bounded."""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct

from sleepcast.core.errors import MisuseError
from sleepcast.nomad.requests import MAX_CORNERS
from sleepcast.nomad.state import RING
from sleepcast.nomad.units import word
from sleepcast.nomad.wire import MAX_WORDS

MASK_ENTRIES = 44
"""Of a mask: the records wanted, then one for each of State[1] to State[43]."""
END_OF_ORDER = 255
"""Stands behind the last sensor of an order that has fewer than all."""

Corners = Sequence[tuple[int, int]]
"""Of a polygon, counter-clockwise, x and y in tenths of inches."""


def in_words(name: str, numbers: Sequence[int]) -> tuple[int, ...]:
    """Numbers for the function `name`. Raises MisuseError for what no word can hold."""
    for number in numbers:
        if word(number) != number:
            raise MisuseError(f"{name} takes whole numbers of at most 32 bits, not {number!r:.40}; round it first")
    return tuple(map(word, numbers))


def mask_words(mask: Sequence[int]) -> tuple[int, ...]:
    """The words of `ct` for a mask: an entry above 0 is on. Raises MisuseError for one of another length."""
    if len(mask) != MASK_ENTRIES:
        raise MisuseError(f"a mask has {MASK_ENTRIES} entries, not {len(mask)}")
    on = [int(entry > 0) for entry in mask]
    bytes_ = [sum(bit << place for place, bit in enumerate(on[first : first + 8])) for first in range(1, 41, 8)]
    return (*bytes_, on[0] | on[41] << 1 | on[42] << 2 | on[43] << 3, mask[0] & 0xFF)


def order_words(name: str, order: Sequence[int]) -> tuple[int, ...]:
    """The order in which sensors work, ended where there are fewer than all. Raises MisuseError."""
    if len(order) > RING or any(number not in range(RING) for number in order):
        raise MisuseError(f"{name} takes at most {RING} sensors, each 0 to {RING - 1}, not {list(order)!r:.80}")
    return (*order, *(END_OF_ORDER,) * (RING - len(order)))


def text_words(text: str, *, big_endian: bool) -> tuple[int, ...]:
    """A text for `tk`, as a program's memory holds it: four characters a word, and a zero at its end. big_endian: of a
    computer that has the first of them in the word's highest byte. Raises MisuseError for one that is too long."""
    data = text.encode("latin-1", "replace").replace(b"\0", b" ")
    if len(data) >= 4 * MAX_WORDS:
        raise MisuseError(f"tk takes at most {4 * MAX_WORDS - 1} bytes of text, not {len(data)}")
    data += bytes(4 - len(data) % 4)
    return Struct(f"{'>' if big_endian else '<'}{len(data) // 4}i").unpack(data)


def corner_words(name: str, corners: Corners, *more: int) -> tuple[int, ...]:
    """A polygon: how many corners, then each. Raises MisuseError for fewer than 3 or more than an obstacle may have."""
    if not 3 <= len(corners) <= MAX_CORNERS:
        raise MisuseError(f"{name} takes 3 to {MAX_CORNERS} corners, not {len(corners)}")
    return (len(corners), *(number for corner in corners for number in corner), *more)


def packet_words(serial: int, kind: int, data: bytes) -> tuple[int, ...]:
    """A user packet, one byte a word: its length (of all, low byte first), serial number, type and data. Raises
    MisuseError for one that is too long."""
    length = len(data) + 4
    if length > MAX_WORDS:
        raise MisuseError(f"a packet has at most {MAX_WORDS - 4} bytes of data, not {len(data)}")
    return (length & 0xFF, length >> 8, serial & 0xFF, kind & 0xFF, *data)
