"""Which rules a robot had when they had proven themselves, and going back to them. Loaded when wanted, and let go
again.
"""

from micropython import const

_FAULTS = const(0)
_BUILT_IN = const(255)
_FLAGS = const(1)
_RAN = const(8)


def remember(mind):
    """The rules of now are those to go back to."""
    rules = []
    for key in _changeable(mind):
        state = mind.learned[key][0]
        state[_FLAGS] = state[_FLAGS] | _RAN if mind.runs(key) else state[_FLAGS] & ~_RAN
        rules += key, mind.learned[key]
    mind.proven, mind.proven_leases = rules, dict(mind.leases)


def roll_back(mind):
    """Go back to them."""
    for key in _changeable(mind):
        mind.remove(key)
    for at in range(0, len(mind.proven), 2):
        key, program = mind.proven[at : at + 2]
        program[0][_FAULTS] = 0
        mind.learned[key] = program
        mind.place(key)
        mind.activate(key, program[0][_FLAGS] & _RAN)
        if key in mind.proven_leases:
            mind.leases[key] = mind.proven_leases[key]


def _changeable(mind):
    return [key for key in mind.order if mind.learned[key][0][_FAULTS] != _BUILT_IN]
