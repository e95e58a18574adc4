"""How a mind begins: its `__init__`, loaded once and let go again, because it would stay in memory for ever."""

import math

from micropython import const

from sleepnode import chance
from sleepnode.forms import write as write_form

_MARKING = const(1)
_ID = const(67)
_TIME = const(68)
_TICK = const(69)
_SUPPORT = const(70)
_ROOM = const(72)
"""Names that are learned before their table grows."""
_MAX_HOPS = const(8)
_CONSTANTS = {"true": 1.0, "false": 0.0, "nil": 0.0, "pi": math.pi, "unknown": None}


def begin(mind, sensors=(), actuators=(), constants=None, functions=(), number=0, seed=0):
    """See `Mind`."""
    mind.values = [0.0] * (_ID) + [float(number), 0.0, 0.0] + [None] * (len(sensors) + len(actuators))
    mind.values[_MARKING] = 1.0
    mind.first_actuator = _SUPPORT + len(sensors)
    mind.first_user = mind.first_actuator + len(actuators)
    mind.names = {"marked": 0, "marking": 1, "frozen": 2, "sleeping": 3, "id": _ID, "time": _TIME, "tick": _TICK}
    for at, name in enumerate(tuple(sensors) + tuple(actuators)):
        mind.names[name.lower()] = _SUPPORT + at
    for table in (_CONSTANTS, constants or {}):
        for name, value in table.items():
            mind.names[name.lower()] = (value,)
    for function in functions:
        mind.names[function.name.lower()] = function
    mind.write_form = write_form
    mind.learned = dict.fromkeys(range(_ROOM))
    for number in range(_ROOM):  # its table stays as large: later no piece of memory may be large enough for it
        del mind.learned[number]
    mind._slots = {}
    """Of user variables that texts name and nobody has made yet."""
    mind._members = {}
    mind.leases = {}
    """When rules are deactivated, by key."""
    mind.order = []
    """The keys of rules and buffers in the order in which they run."""
    mind.reports, mind.told, mind.pings, mind.dirty = [], [], [], []
    mind.faults = []
    mind.matched, mind.undecided, mind.moved, mind.held = False, False, False, False
    mind.ruling, mind.moving, mind.whole, mind.asked = False, (), None, False
    mind.steps = mind.dropped = mind.lost = 0
    mind.hops = _MAX_HOPS
    mind.tick, mind.now, mind._draws = 0, 0.0, 0
    mind.key = chance.stream(seed, number)
    mind._paid, mind._refused = 0.0, False
    mind.proven, mind.proven_leases, mind.since = (), {}, 0
    """The set of rules to roll back to, each a key and a program; when it last changed."""
    mind._before = {}
    """The values of variables before a question, by slot."""
    mind._due = []
    """The keys of the rules of a round, None for those that do not run; one list for all rounds."""
    mind._left = None
