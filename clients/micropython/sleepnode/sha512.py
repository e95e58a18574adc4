"""SHA-512 (FIPS 180-4), which MicroPython has not. Its constants are computed at the start, which is shorter than
writing them down."""

from array import array

from micropython import const

_MASK = const(0xFFFFFFFFFFFFFFFF)
_TWICE = const(0x10000000000000001)


def _constants():
    def root(n, k):
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

    primes, n = [], 2
    while len(primes) < 80:
        if all([n % p for p in primes]):
            primes.append(n)
        n += 1
    return array("Q", [root(p, 3) for p in primes]), array("Q", [root(p, 2) for p in primes[:8]])


_ROUNDS, _START = _constants()
del _constants
"""The constants of the rounds, and the state to begin with. In arrays, because large numbers take eight times the
memory."""


def _block(state, data):
    """Take 128 bytes into the state. A number that stands there twice (times _TWICE) is turned by shifting it, and what
    is above 64 bits is cut off last: each step on such large numbers takes time and memory."""
    w = array("Q", [int.from_bytes(data[i : i + 8], "big") for i in range(0, 128, 8)])
    a, b, c, d, e, f, g, h = state
    bc = b ^ c
    for i in range(80):
        j = i & 15
        here = w[j]
        if i > 15:
            x, y = w[(i - 15) & 15], w[(i - 2) & 15]
            xx, yy = x * _TWICE, y * _TWICE
            x, y = (xx >> 1 ^ xx >> 8) & _MASK ^ x >> 7, (yy >> 19 ^ yy >> 61) & _MASK ^ y >> 6
            w[j] = here = (here + x + w[(i - 7) & 15] + y) & _MASK
        ee, aa, ab = e * _TWICE, a * _TWICE, a ^ b
        t = h + (ee >> 14 ^ ee >> 18 ^ ee >> 41) + (g ^ e & (f ^ g)) + _ROUNDS[i] + here
        u = t + (aa >> 28 ^ aa >> 34 ^ aa >> 39) + (b ^ ab & bc)
        h, g, f, e, d, c, b, a = g, f, e, (d + t) & _MASK, c, b, a, u & _MASK
        bc = ab
    for i, x in enumerate((a, b, c, d, e, f, g, h)):
        state[i] = (state[i] + x) & _MASK


def sha512(*pieces):
    """The digest of pieces of bytes, one behind the other: 64 bytes."""
    size = sum([len(piece) for piece in pieces])
    tail = b"\x80" + bytes(-(size + 17) % 128) + (8 * size).to_bytes(16, "big")
    state, block, full = array("Q", _START), bytearray(128), 0
    for piece in pieces + (tail,):
        piece = memoryview(piece)
        while piece:
            part = piece[: 128 - full]
            block[full : full + len(part)] = part
            full, piece = full + len(part), piece[len(part) :]
            if full == 128:
                _block(state, block)
                full = 0
    return b"".join([x.to_bytes(8, "big") for x in state])
