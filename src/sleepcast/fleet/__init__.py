"""The fleet: the minds of many robots of one vocabulary as arrays. Each is, bit for bit, what a node would be.

columns       one number a robot, side by side                  pure      the built-in functions over columns
evaluation    whose it is, its budget and its faults            memory    what a program may touch, for many at once
minds         what robots have learned, kept once               machine   one walk over a program for many robots
scheduler     which rules run in a tick                         rule_statistics  how each rule has fared
messages      what waits, and what robots say                   bodies    stopping, releasing, holding still
evaluation_log  explanations, by evaluating again               read_set  which variables robots look at
telemetry     the latest telemetry of each robot                native/   native code for rules, through LLVM
schema        the serialized state                              snapshot  to it, and back
marks         groups and flags of each robot, for pictures
fleet         messages and readings in, a tick of all; the robots by name, and each seen as a mind of its own
"""

from sleepcast.fleet.fleet import Fleet, FleetError, Outcome, RobotView

__all__ = ["Fleet", "FleetError", "Outcome", "RobotView"]
