"""SHA-512 (FIPS 180-4), which MicroPython has not. Its constants are computed at the start, which is shorter."""

from micropython import const

_MASK = const(0xFFFFFFFFFFFFFFFF)


def _root(n, k):
    """The first 64 bits of the fraction of the square or cube root of a small number."""
    n <<= 64 * k
    low, high = 0, 1 << 72
    while high - low > 1:
        middle = (low + high) >> 1
        if middle**k <= n:
            low = middle
        else:
            high = middle
    return low & _MASK


def _constants():
    primes, n = [], 2
    while len(primes) < 80:
        if all([n % p for p in primes]):
            primes.append(n)
        n += 1
    rounds = b"".join([_root(p, 3).to_bytes(8, "big") for p in primes])
    return rounds, [_root(p, 2) for p in primes[:8]]


_ROUNDS, _START = _constants()
"""The constants of the rounds as bytes: eighty large numbers would take nine times the memory."""


def _block(found, data):
    w = [int.from_bytes(data[at : at + 8], "big") for at in range(0, 128, 8)]
    a, b, c, d, e, f, g, h = found
    for i in range(80):
        if i >= 16:
            x, y = w[(i - 15) & 15], w[(i - 2) & 15]
            x = ((x >> 1 | x << 63) ^ (x >> 8 | x << 56)) & _MASK ^ x >> 7
            y = ((y >> 19 | y << 45) ^ (y >> 61 | y << 3)) & _MASK ^ y >> 6
            w[i & 15] = (w[i & 15] + x + w[(i - 7) & 15] + y) & _MASK
        k = int.from_bytes(_ROUNDS[8 * i : 8 * i + 8], "big")
        t = (e >> 14 | e << 50) ^ (e >> 18 | e << 46) ^ (e >> 41 | e << 23)
        t = h + (t & _MASK) + (e & f ^ (e ^ _MASK) & g) + k + w[i & 15]
        u = (a >> 28 | a << 36) ^ (a >> 34 | a << 30) ^ (a >> 39 | a << 25)
        u = (u & _MASK) + (a & b ^ a & c ^ b & c)
        h, g, f, e, d, c, b, a = g, f, e, (d + t) & _MASK, c, b, a, (t + u) & _MASK
    after = a, b, c, d, e, f, g, h
    return [(found[i] + after[i]) & _MASK for i in range(8)]


def sha512(data):
    """The digest of bytes: 64 bytes."""
    tail = b"\x80" + bytes(-(len(data) + 17) % 128) + (8 * len(data)).to_bytes(16, "big")
    data += tail
    state = _START
    for at in range(0, len(data), 128):
        state = _block(state, data[at : at + 128])
    return b"".join([x.to_bytes(8, "big") for x in state])
