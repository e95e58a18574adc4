"""Programs: what the checker writes and the machine runs.

A program is one tuple, which takes little memory: first the steps charged on entering it, its shape, and the keys
of the buffers, rules and operators that it may enter; then instructions. An
instruction is a whole number, six bits of what is to be done and above them a number (a slot, a place to jump to, how
many arguments), perhaps with things behind it: a name, a function, a program.
"""

from micropython import const

_SHAPE = const(1)


def shape(height, places, parameters, tested):
    """Lists inside one another, places of its frame, how many of them are parameters, and whether a message with it has
    a top-level test: in one number."""
    return height | places << 6 | parameters << 16 | tested << 23


def height_of(program):
    return program[_SHAPE] & 63


def places_of(program):
    return program[_SHAPE] >> 6 & 1023


def parameters_of(program):
    return program[_SHAPE] >> 16 & 127


def is_tested(program):
    return bool(program[_SHAPE] >> 23)


_NAMES = const(
    "/variable/constant/else/</>/+/-/*/and/pure/write/jump/pop/zero/assign/local/return/enter/call/operator/match/match?/"
    "else?/and?/any/or/or?/known/take/keep/repeat/next/host/defined/store/operate/report/tell/prob/dice/unknown side/"
    "side/none/random/gauss/flag/in/join/leave/define/store number/activate/deactivate/forget/lease/rollback/ping/"
)


def number_of(name):
    """The number of an instruction; the machine has the same ones."""
    return _NAMES[: _NAMES.find("/%s/" % name)].count("/")
