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


def _power(x, n):
    """x to the power n, modulo p; `pow` with three arguments is not on every board."""
    product = 1
    while n:
        if n & 1:
            product = product * x % _P
        x = x * x % _P
        n >>= 1
    return product


_D = const(37095705934669439343138083508754565189542113879843219016388785533085940283555)
_I = const(19681161376707505956807079304988542015446066515923890162744021073123829784752)
"""The square root of -1."""
_X = const(15112221349535400772501151409588531511454012693041857206046113283949847762202)
_Y = const(46316835694926478169428394003475163141307993866256225615783033603165251855960)
"""The base."""
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


def _recover(y, sign):
    """The x of a point with this y, None if there is none."""
    if y >= _P:
        return None
    u, v = (y * y - 1) % _P, (_D * y * y + 1) % _P
    x = u * v**3 % _P * _power(u * v**7 % _P, (_P - 5) // 8) % _P
    if v * x * x % _P != u:
        x = x * _I % _P
        if v * x * x % _P != u:
            return None
    if x == 0 and sign:
        return None
    return _P - x if x & 1 != sign else x


def point(data):
    """The point that 32 bytes stand for, None if they stand for none."""
    y = int.from_bytes(data, "little")
    sign, y = y >> 255, y & (1 << 255) - 1
    x = _recover(y, sign)
    return None if x is None else _moved((x, y, 1, x * y % _P))


_ZERO = const((0, 1, 1, 0))


def _moved(a):
    """The same point, made again where memory is free once the garbage is gone."""
    gc.collect()
    x, y, z, t = a
    return x + 0, y + 0, z + 0, t + 0


def _number(digest):
    gc.collect()
    return int.from_bytes(digest, "little") % _L


def _bytes(a):
    x, y, z, _ = a
    z = _power(z, _P - 2)
    number = y * z % _P | (x * z % _P & 1) << 255
    gc.collect()
    return number.to_bytes(32, "little")


def _sum(s, k, a):
    """s times the base and k times a, in slices; the last `next` raises StopIteration with the point."""
    base = _X, _Y, 1, _X * _Y % _P
    both = _moved(_add(base, a))
    total = _ZERO
    for bit in range(252, -1, -1):
        total = _double(total)
        which = (s >> bit & 1) | (k >> bit & 1) << 1
        if which:
            total = _add(total, base if which == 1 else a if which == 2 else both)
        if bit % _SLICE == 0:
            total = _moved(total)
            yield
    return total


def verify(public, key, message, signature):
    """Whether this is the signature of the message, in slices. public: 32 bytes; key: its `point`, computed once."""
    s = int.from_bytes(signature[32:], "little")
    if key is None or s >= _L:
        return False
    x, y, z, t = key
    k = _number(sha512(signature[:32], public, *message))
    yield
    total = yield from _sum(s, k, (_P - x, y, z, _P - t))
    return _bytes(total) == signature[:32]


def expand(seed):
    """The secret number and the prefix of a key with this seed (32 bytes)."""
    h = sha512(seed)
    number = int.from_bytes(h[:32], "little")
    return number & (1 << 254) - 8 | 1 << 254, h[32:]


def sign(secret, public, message):
    """The signature of the message, in slices. secret: of the seed."""
    number, prefix = secret
    r = _number(sha512(prefix, *message))
    yield
    first = _bytes((yield from _sum(r, 0, _ZERO)))
    k = _number(sha512(first, public, *message))
    return first + ((r + k * number) % _L).to_bytes(32, "little")


def public_key(secret):
    """The public half of a key."""
    return _bytes(finished(_sum(secret[0] % _L, 0, _ZERO)))


def finished(work):
    """What a generator comes to, all its slices at once."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            return end.value
