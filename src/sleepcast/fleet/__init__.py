"""The fleet: the minds of many robots of one vocabulary as arrays. Each is, bit for bit, what a node would be.

state         variables as columns, minds kept once             pure      the built-in functions over columns
evaluation    budget and faults, and how each rule has fared    memory    what a program may touch, for many at once
scheduler     which rules run in a tick                         machine   one walk over a program for many robots
messages      what waits, and what robots send                  bodies    stopping, releasing, holding still
inspection    telemetry, previews, explanations                 native/   native code for rules, through LLVM
schema        the serialized state                              snapshot  to it, and back
marks         groups and flags of each robot, for pictures
fleet         messages and readings in, a tick of all; the robots by name, and each seen as a mind of its own
"""

from sleepcast.fleet.fleet import Evaluated, Fleet, FleetError, RobotView

__all__ = ["Evaluated", "Fleet", "FleetError", "RobotView"]
