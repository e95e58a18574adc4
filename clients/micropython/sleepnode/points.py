"""What a key is made of: the point that its public half stands for, and both halves of our own. Loaded when it is
needed and let go again."""

from micropython import const

from sleepnode.ed25519 import encoded, finished, moved, power, squared, times_base
from sleepnode.sha512 import sha512

_P = const((1 << 255) - 19)
_L = const((1 << 252) + 27742317777372353535851937790883648493)
_D = const(37095705934669439343138083508754565189542113879843219016388785533085940283555)
_I = const(19681161376707505956807079304988542015446066515923890162744021073123829784752)
"""The square root of -1."""


def _recover(y, sign):
    """The x of a point with this y, None if there is none."""
    if y >= _P:
        return None
    u, v = (y * y - 1) % _P, (_D * y * y + 1) % _P
    vvv = v * v * v % _P
    uv7 = vvv * vvv % _P * v % _P * u % _P
    x = u * vvv % _P * squared(power(uv7), 2, uv7) % _P
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
    return None if x is None else moved((x, y, 1, x * y % _P))


def expand(seed):
    """The secret number and the prefix of a key with this seed (32 bytes)."""
    h = sha512(seed)
    number = int.from_bytes(h[:32], "little")
    return number & (1 << 254) - 8 | 1 << 254, h[32:]


def public_key(secret):
    """The public half of a key."""
    return encoded(finished(times_base(secret[0] % _L)))
