"""The fleet: the minds of many robots of one vocabulary as arrays. Each is, bit for bit, what a node would be.

columns   the robots' numbers by slot, and everything else that is one number a robot
minds     what robots have learned, shared by all that have learned the same
pure      the built-in functions over columns              chance   draws over columns
memory    what a program may touch, for many robots at once
acts      what a program may do beyond assigning
machine   one walk over a program's parts for many robots
rounds    which rules run in a tick                        speech   what robots say
recall    explanations, by evaluating again                view     one robot of the fleet
fleet     the whole: messages and readings in, a tick, what was said out
"""

from sleepcast.fleet.fleet import Fleet, FleetError, Outcome
from sleepcast.fleet.view import RobotView

__all__ = ["Fleet", "FleetError", "Outcome", "RobotView"]
