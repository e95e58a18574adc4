"""Parcels: what a room wants to keep, as bytes, and back; nothing but plain data and arrays ever comes out of one.

A parcel is a msgspec `Struct` as msgpack, compressed. Its fields say what may be in it, and msgspec refuses everything
else; an `Array` is checked against the array that it is to become. All bytes are bounded before memory is asked for, so
that a small file cannot grow without end.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from contextlib import suppress
from math import prod
from threading import Lock
from typing import TYPE_CHECKING, TypeVar, cast

import msgspec

from sleepcast.core.errors import SleepcastError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

LEVEL = 1
"""Of the compression: higher ones take several times as long to save a few per cent."""

MIN_ROOM = 512 * 1024**2
"""Bytes for what does not grow with the robots: a full journal, and copies on the air as many as a radio takes."""
ROOM_FOR_ONE = 4_096
"""Bytes for one robot: four times what its body and mind may take."""

UNCOUNTED = 8 * 1024**2
"""Bytes of a parcel whose values are not counted before it is decoded: they take some 200 MB at most."""
BYTES_PER_VALUE = 128
"""There is room for one value in so many bytes. Almost all of a real parcel are arrays, each one value, but a parcel of
empty lists takes fifty times its own size in memory, and is compressed to a thousandth of it."""

UNREADABLE = (msgspec.DecodeError, ValueError, RecursionError, SleepcastError)
"""What decoding untrusted bytes may raise."""

_SIZED = {0xCA: 4, 0xCB: 8, 0xCC: 1, 0xCD: 2, 0xCE: 4, 0xCF: 8, 0xD0: 1, 0xD1: 2, 0xD2: 4, 0xD3: 8}
_SIZED |= {0xD4: 2, 0xD5: 3, 0xD6: 5, 0xD7: 9, 0xD8: 17}
"""Bytes after the first one, by that one, of msgpack's numbers and short extensions."""
_LONG = {0xC4: (1, 0, 0), 0xC5: (2, 0, 0), 0xC6: (4, 0, 0), 0xC7: (1, 1, 0), 0xC8: (2, 1, 0), 0xC9: (4, 1, 0)}
_LONG |= {0xD9: (1, 0, 0), 0xDA: (2, 0, 0), 0xDB: (4, 0, 0)}
_LONG |= {0xDC: (2, 0, 1), 0xDD: (4, 0, 1), 0xDE: (2, 0, 2), 0xDF: (4, 0, 2)}
"""By the first byte: bytes of the length, bytes of a type after it, and values inside for each of that length."""

Body = TypeVar("Body", bound=msgspec.Struct)
Scalar = TypeVar("Scalar", bound="np.generic")


class SerialError(ValueError):
    """Serialized data that is malformed; its reader knows where it came from."""


class Array(msgspec.Struct, frozen=True, array_like=True):
    """An array: its dtype (numpy's code, little endian), its shape, and its bytes: the first of each element, then the
    second of each, and so on, since neighbours are alike in some bytes and not in others, which compresses better."""

    dtype: str
    shape: tuple[int, ...]
    data: bytes

    @classmethod
    def of(cls, values: NDArray[np.generic]) -> Array:
        """A copy of an array of numbers or truths."""
        import numpy as np

        little = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
        apart = little.reshape(-1).view(np.uint8).reshape(-1, little.dtype.itemsize)
        return cls(little.dtype.str, values.shape, apart.T.tobytes())

    def made(self, dtype: type[Scalar], shape: tuple[int, ...], name: str) -> NDArray[Scalar]:
        """The array, which must hold scalars of this type and have this shape. name: for the error. Raises
        SerialError."""
        import numpy as np

        wanted = np.dtype(dtype).newbyteorder("<")
        if self.dtype != wanted.str or self.shape != shape:
            raise SerialError(f"{name} is {self._kind()}, wanted {wanted.str}{list(shape)}")
        if len(self.data) != prod(shape) * wanted.itemsize:
            raise SerialError(f"{name} has {len(self.data)} bytes, wanted {prod(shape) * wanted.itemsize}")
        apart = np.frombuffer(self.data, np.uint8).reshape(wanted.itemsize, -1)
        if wanted.kind == "b" and (apart > 1).any():
            raise SerialError(f"{name} holds something that is neither true nor false")
        values = apart.T.copy(order="C").view(wanted).reshape(shape)
        return values.astype(dtype, copy=False)

    def column(self, dtype: type[Scalar], most: int, name: str) -> NDArray[Scalar]:
        """The same for one dimension of any length up to `most`."""
        if len(self.shape) != 1 or not 0 <= self.shape[0] <= most:
            raise SerialError(f"{name} is {self._kind()}, wanted a list of at most {most}")
        return self.made(dtype, self.shape, name)

    def _kind(self) -> str:
        return f"{self.dtype[:8]}{list(self.shape)[:4]}"


Arrays = dict[str, Array]


def dump_arrays(arrays: Mapping[str, NDArray[np.generic]]) -> Arrays:
    """Copies of arrays by name."""
    return {name: Array.of(values) for name, values in arrays.items()}


def load_arrays(state: Arrays, arrays: Mapping[str, NDArray[np.generic]]) -> None:
    """Write what is kept into these arrays, in place: the same names, dtypes and shapes, and no other. Raises
    SerialError."""
    if state.keys() != arrays.keys():
        odd = ", ".join(sorted(state.keys() ^ arrays.keys()))
        raise SerialError(f"wanted other columns than there are: {odd[:80]}")
    for name, values in arrays.items():
        values[...] = state[name].made(values.dtype.type, values.shape, name)


def within(values: NDArray[np.generic], low: float, high: float, name: str) -> None:
    """Raises SerialError unless all of the values lie from `low` to `high`; unknown does not."""
    if values.size and not (float(values.min()) >= low and float(values.max()) <= high):
        raise SerialError(f"{name} is not everywhere from {low:g} to {high:g}")


def room_for(robots: int) -> int:
    """Bytes that a parcel about so many robots may have, before it is compressed."""
    return MIN_ROOM + ROOM_FOR_ONE * robots


def pack(body: msgspec.Struct, most: int) -> bytes:
    """A parcel as bytes. most: so many of them can be unpacked again. Raises SerialError for more."""
    return compressed(plain(body, most))


def plain(body: msgspec.Struct, most: int) -> bytes:
    """A parcel before it is compressed: a copy of everything in it. Raises SerialError for more than `most` bytes."""
    data = msgspec.msgpack.encode(body)
    if len(data) > most:
        raise SerialError(f"{len(data)} bytes, at most {most} have room")
    return data


def compressed(plain: bytes) -> bytes:
    """A parcel as bytes. On any thread: others go on meanwhile."""
    return zlib.compress(plain, LEVEL)


def unpack(kind: type[Body], data: bytes, most: int, name: str) -> Body:
    """The parcel of this kind in `data`, of at most so many bytes. name: for the error. Raises SerialError."""
    opened = zlib.decompressobj()
    try:
        plain = opened.decompress(data, most)
    except zlib.error:
        raise SerialError(f"{name} is damaged") from None
    if not opened.eof:
        raise SerialError(f"{name} is not complete, or has more than {most} bytes")
    if len(plain) > UNCOUNTED and not _has_at_most(plain, most // BYTES_PER_VALUE):
        raise SerialError(f"{name} has more than {most // BYTES_PER_VALUE} values")
    try:
        return _decoder(kind).decode(plain)
    except UNREADABLE as error:
        raise SerialError(f"{name}: {error}") from None


_decoders: dict[type[msgspec.Struct], msgspec.msgpack.Decoder[msgspec.Struct]] = {}
_making = Lock()


def _decoder(kind: type[Body]) -> msgspec.msgpack.Decoder[Body]:
    """What reads this kind of body. One thread alone makes it: msgspec crashes where two make it find out at the same
    time what is in a struct."""
    with _making:
        if kind not in _decoders:
            _decoders[kind] = msgspec.msgpack.Decoder(kind)
        return cast("msgspec.msgpack.Decoder[Body]", _decoders[kind])


def _has_at_most(plain: bytes, most: int) -> bool:
    """Whether so many values, one after or in the other, are the whole of a msgpack document. What is no document is
    left to those who decode it."""
    at, left, count = 0, 1, 0
    with suppress(IndexError):
        while left > 0:
            left, count = left - 1, count + 1
            if count > most:
                return False
            head = plain[at]
            at += 1
            if 0x80 <= head < 0xA0:
                left += (head & 0x0F) * (1 if head >= 0x90 else 2)
            elif 0xA0 <= head < 0xC0:
                at += head & 0x1F
            elif head in _SIZED:
                at += _SIZED[head]
            elif head in _LONG:
                size, extra, inside = _LONG[head]
                length = int.from_bytes(plain[at : at + size], "big")
                at += size + extra + (0 if inside else length)
                left += inside * length
    return True
