"""The keys of chance of a tick, computed in compiled code: `counter_rng.key` of what the text of a tuple is whose last
element is the number of the tick.

That is BLAKE2b (RFC 7693) of one block, with a digest of eight bytes. The keys of four purposes are computed side by
side, as four numbers of one vector.
"""

from __future__ import annotations

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from sleepcast.simulator.quiet.layout import FIRST_TEXT, LENGTHS, PURPOSES, TEXT_WORDS
from sleepcast.simulator.simd.compiled import part, strict
from sleepcast.simulator.simd.memory import put_byte, put_word, word

_FIRST = (
    *(0x6A09E667F3BCC908, 0xBB67AE8584CAA73B, 0x3C6EF372FE94F82B, 0xA54FF53A5F1D36F1),
    *(0x510E527FADE682D1, 0x9B05688C2B3E6C1F, 0x1F83D9ABFB41BD6B, 0x5BE0CD19137E2179),
)
"""The initial value of the state."""
_DIGEST = 0x01010008
"""Parameters of the hash: eight bytes, no key, no tree."""
_ORDERS = (
    (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15),
    (14, 10, 4, 8, 9, 15, 13, 6, 1, 12, 0, 2, 11, 7, 5, 3),
    (11, 8, 12, 0, 5, 2, 15, 13, 10, 14, 3, 6, 7, 1, 9, 4),
    (7, 9, 3, 1, 13, 12, 11, 14, 2, 6, 5, 10, 4, 0, 15, 8),
    (9, 0, 5, 7, 2, 4, 10, 15, 14, 1, 11, 12, 6, 8, 3, 13),
    (2, 12, 6, 10, 0, 11, 8, 3, 4, 13, 7, 5, 15, 14, 1, 9),
    (12, 5, 1, 15, 14, 13, 4, 10, 0, 7, 6, 3, 9, 2, 8, 11),
    (13, 11, 7, 14, 12, 1, 3, 9, 5, 0, 15, 4, 8, 6, 2, 10),
    (6, 15, 14, 9, 11, 3, 0, 8, 12, 2, 13, 7, 1, 4, 10, 5),
    (10, 2, 8, 4, 7, 6, 1, 5, 15, 11, 9, 14, 3, 12, 13, 0),
)
"""The order of the words of the text in each round; the last two rounds are as the first two."""
ROUNDS = 12
_COLUMNS = ((0, 4, 8, 12), (1, 5, 9, 13), (2, 6, 10, 14), (3, 7, 11, 15))
_DIAGONALS = ((0, 5, 10, 15), (1, 6, 11, 12), (2, 7, 8, 13), (3, 4, 9, 14))
_WORD = ir.IntType(64)
_FOUR = ir.VectorType(_WORD, PURPOSES)


def _all(number):
    return ir.Constant(_FOUR, [number & 0xFFFF_FFFF_FFFF_FFFF] * PURPOSES)


def _mixed(build, state, places, x, y):
    """One mixing step of the state at these four places, with two words of the text."""

    def turned(value, by):
        return build.or_(build.lshr(value, _all(by)), build.shl(value, _all(64 - by)))

    a, b, c, d = (state[place] for place in places)
    for word_, first, second in ((x, 32, 24), (y, 16, 63)):
        a = build.add(build.add(a, b), word_)
        d = turned(build.xor(d, a), first)
        c = build.add(c, d)
        b = turned(build.xor(b, c), second)
    for place, value in zip(places, (a, b, c, d), strict=True):
        state[place] = value


@intrinsic
def hashed(typing, texts, lengths, keys):
    """Write the keys of four texts, a block each from the address `texts` on, padded with 0, with these lengths (bytes,
    from their address on), to the address `keys`."""

    def generate(context, build, signature, given):
        texts, lengths, keys = (build.inttoptr(each, _WORD.as_pointer()) for each in given)

        def gathered(first, step):
            four = ir.Constant(_FOUR, ir.Undefined)
            for lane in range(PURPOSES):
                value = build.load(build.gep(first, [_WORD(lane * step)]), align=8)
                four = build.insert_element(four, value, ir.IntType(32)(lane))
            return four

        words = [gathered(build.gep(texts, [_WORD(number)]), TEXT_WORDS) for number in range(TEXT_WORDS)]
        begun = [_all(number) for number in _FIRST]
        begun[0] = _all(_FIRST[0] ^ _DIGEST)
        state = [*begun, *(_all(number) for number in _FIRST)]
        state[12] = build.xor(state[12], gathered(lengths, 1))
        state[14] = _all(~_FIRST[6])  # this block is the last
        for number in range(ROUNDS):
            order = [words[place] for place in _ORDERS[number % len(_ORDERS)]]
            for half, places in enumerate((*_COLUMNS, *_DIAGONALS)):
                _mixed(build, state, places, *order[2 * half : 2 * half + 2])
        result = build.xor(begun[0], build.xor(state[0], state[8]))
        for lane in range(PURPOSES):
            build.store(build.extract_element(result, ir.IntType(32)(lane)), build.gep(keys, [_WORD(lane)]), align=8)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), generate


@part
def draw_keys(texts, tick, keys, lengths):
    """Write the keys of four purposes in this tick to the address `keys`. texts: the address of their texts up to the
    tick, laid out as `layout` says; lengths: room for four words."""
    digits, rest = 1, tick
    while rest >= 10:
        rest //= 10
        digits += 1
    for purpose in range(PURPOSES):
        text, begin = texts + 8 * (FIRST_TEXT + purpose * TEXT_WORDS), word(texts, LENGTHS + purpose)
        rest = tick
        for place in range(digits):
            put_byte(text, begin + digits - 1 - place, 48 + rest % 10)
            rest //= 10
        put_byte(text, begin + digits, 41)
        put_word(lengths, purpose, begin + digits + 1)
    hashed(texts + 8 * FIRST_TEXT, lengths, keys)


@strict
def keys_of(texts, tick, found):
    """The same from Python. found: gets the keys, int64, with room for four more."""
    draw_keys(texts.ctypes.data, tick, found.ctypes.data, found.ctypes.data + 8 * PURPOSES)
