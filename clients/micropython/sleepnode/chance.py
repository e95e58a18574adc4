"""Chance: a function of (seed, robot, tick, draw number), the same as on every other node."""

from micropython import const

_MASK = const(0xFFFFFFFFFFFFFFFF)
_GOLDEN = const(0x9E3779B97F4A7C15)


def _mix(z):
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 & _MASK
    z = (z ^ (z >> 27)) * 0x94D049BB133111EB & _MASK
    return z ^ (z >> 31)


def stream(seed, robot):
    """The key of one robot's chance."""
    return _mix((_mix(seed + _GOLDEN & _MASK) + robot * _GOLDEN) & _MASK)


def draw(key, tick, number):
    """A number evenly from [0, 1): draw `number` of a tick."""
    return (_mix(_mix((key + tick * _GOLDEN) & _MASK) + number * _GOLDEN & _MASK) >> 11) * 2.0**-53
