"""SHA-512 (FIPS 180-4), which MicroPython has not. Its constants are computed at the start, which is shorter than
writing them down."""

from array import array

from micropython import const

_MASK = const(0xFFFFFFFFFFFFFFFF)


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
    """Take 128 bytes into the state."""
    w = array("Q", [0] * 16)
    a, b, c, d, e, f, g, h = state
    for i in range(80):
        j = i & 15
        if i < 16:
            w[j] = int.from_bytes(data[8 * i : 8 * i + 8], "big")
        else:
            x, y = w[(i - 15) & 15], w[(i - 2) & 15]
            x = ((x >> 1 | x << 63) ^ (x >> 8 | x << 56)) & _MASK ^ x >> 7
            y = ((y >> 19 | y << 45) ^ (y >> 61 | y << 3)) & _MASK ^ y >> 6
            w[j] = (w[j] + x + w[(i - 7) & 15] + y) & _MASK
        t = (e >> 14 | e << 50) ^ (e >> 18 | e << 46) ^ (e >> 41 | e << 23)
        t = h + (t & _MASK) + (e & f ^ (e ^ _MASK) & g) + _ROUNDS[i] + w[j]
        u = (a >> 28 | a << 36) ^ (a >> 34 | a << 30) ^ (a >> 39 | a << 25)
        u = (u & _MASK) + (a & b ^ a & c ^ b & c)
        h, g, f, e, d, c, b, a = g, f, e, (d + t) & _MASK, c, b, a, (t + u) & _MASK
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
