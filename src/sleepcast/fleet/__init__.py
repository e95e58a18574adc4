"""The fleet: the minds of many robots of one vocabulary as arrays. Each is, bit for bit, what a node would be.

columns     one number a robot, side by side                 minds   what robots have learned, kept once
pure        the built-in functions over columns              chance  draws over columns
evaluation  whose it is, its budget and its faults           memory  what a program may touch, for many at once
acts        what a program may do beyond assigning           plain   parts that are computed for all robots
machine     one walk over a program's parts for many robots  recall  explanations, by evaluating again
rounds      which rules run in a tick                        tallies how each rule has fared
inbox       messages that wait                               speech  what robots say
core        messages and readings in, a tick of all          limits  the bounds of one robot's mind
kernels     which programs get native code, and when         native  native code, through LLVM
lowering    parts as native code, with `formulas` of numbers and `assembly` below it
meanings    what names stand for in one mind                 libm    the C library's functions
attention   which variables robots look at
fleet       the robots by name                               view    one robot, as a mind of its own
"""

from sleepcast.fleet.core import FleetError, Outcome
from sleepcast.fleet.fleet import Fleet
from sleepcast.fleet.view import RobotView

__all__ = ["Fleet", "FleetError", "Outcome", "RobotView"]
