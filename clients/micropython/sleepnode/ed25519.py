"""Ed25519 (RFC 8032): verifying and signing, in slices.

Both are generators: each `next` does a slice of the work, so that a small computer can look at its radio in between.
Messages are tuples of pieces of bytes. Points are (X, Y, Z, T) with x = X/Z, y = Y/Z, xy = T/Z.

Numbers are large and made by the thousand, and memory is never moved: what a slice leaves behind would lie scattered
among its garbage, with no room for a datagram in between. So garbage is collected before anything is made that stays.
"""

import gc

from micropython import const

from sleepnode.sha512 import sha512

_P = const((1 << 255) - 19)
_L = const((1 << 252) + 27742317777372353535851937790883648493)


def squared(x, times, factor):
    """The square of the square of x, so many times; times a factor."""
    for _ in range(times):
        x = x * x % _P
    return x * factor % _P


def power(x):
    """x to the power 2 ** 250 - 1, modulo p, of which the needed ones are made, whose bits are nearly all 1. `pow` with
    three arguments is not on every board."""
    most, n = x, 1  # to the power 2 ** n - 1
    for odd in b"\1\1\1\1\0\1\0":
        most = squared(most, n, most)
        n *= 2
        if odd:
            most = squared(most, 1, x)
            n += 1
    return most


_D = const(37095705934669439343138083508754565189542113879843219016388785533085940283555)
_X = const(15112221349535400772501151409588531511454012693041857206046113283949847762202)
_Y = const(46316835694926478169428394003475163141307993866256225615783033603165251855960)
"""The base,"""
_XH = const(13255665929656146281080449887007641909509999304849491744738638209813853897619)
_YH = const(55705207129829464869897097349416518624188726193119147708421062336186161442401)
"""and 2 ** 127 times the base."""
_SLICE = const(16)
"""Doublings in one slice."""


def _add(a, b):
    x1, y1, z1, t1 = a
    x2, y2, z2, t2 = b
    e = (y1 - x1) * (y2 - x2) % _P
    f = (y1 + x1) * (y2 + x2) % _P
    t = 2 * t1 * t2 % _P * _D % _P
    z = 2 * z1 * z2 % _P
    h, g = f + e, z + t
    e, f = f - e, z - t
    return e * f % _P, g * h % _P, f * g % _P, e * h % _P


def _double(a):
    x, y, z, _ = a
    xx, yy = x * x % _P, y * y % _P
    h = xx + yy
    e = h - (x + y) * (x + y) % _P
    g = xx - yy
    f = 2 * z * z % _P + g
    return e * f % _P, g * h % _P, f * g % _P, e * h % _P


_ZERO = const((0, 1, 1, 0))


def moved(a):
    """The same point, made again where memory is free once the garbage is gone."""
    gc.collect()
    x, y, z, t = a
    return x + 0, y + 0, z + 0, t + 0


def _number(digest):
    gc.collect()
    return int.from_bytes(digest, "little") % _L


def encoded(a):
    """The 32 bytes that stand for a point. Every number on the way is short: a long one asks for one large piece."""
    x, y, z, _ = a
    z = squared(power(z), 5, squared(z, 3, z * z % _P * z) % _P)
    number = y * z % _P | (x * z % _P & 1) << 255
    gc.collect()
    return number.to_bytes(32, "little")


def _sum(s, k, a, bits):
    """s times the base and k times a, in slices; the last `next` raises StopIteration with the point. bits: that s and
    k have at most."""
    base = _X, _Y, 1, _X * _Y % _P
    both = moved(_add(base, a))
    total = _ZERO
    for bit in range(bits - 1, -1, -1):
        total = _double(total)
        which = (s >> bit & 1) | (k >> bit & 1) << 1
        if which:
            total = _add(total, base if which == 1 else a if which == 2 else both)
        if bit % _SLICE == 0:
            total = moved(total)
            yield
    return total


def times_base(n):
    """A number times the base, in half as many slices: its halves are taken at once."""
    return _sum(n & (1 << 127) - 1, n >> 127, (_XH, _YH, 1, _XH * _YH % _P), 127)


def verify(public, key, message, signature):
    """Whether this is the signature of the message, in slices. public: 32 bytes; key: its `point`, computed once."""
    s = int.from_bytes(signature[32:], "little")
    if key is None or s >= _L:
        return False
    x, y, z, t = key
    k = _number(sha512(signature[:32], public, *message))
    yield
    total = yield from _sum(s, k, (_P - x, y, z, _P - t), 253)
    return encoded(total) == signature[:32]


def sign(secret, public, message):
    """The signature of the message, in slices. secret: see `points.py`."""
    number, prefix = secret
    r = _number(sha512(prefix, *message))
    yield
    first = encoded((yield from times_base(r)))
    k = _number(sha512(first, public, *message))
    return first + ((r + k * number) % _L).to_bytes(32, "little")


def finished(work):
    """What a generator comes to, all its slices at once."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            return end.value
