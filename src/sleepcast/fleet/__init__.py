"""The fleet: the minds of many robots with one vocabulary, as arrays. Each robot behaves exactly as a node would, bit
for bit.

state         what robots know alike                            memory       what programs may read and change
authority     who commands each robot, and who drives it        obeying      what becomes of a message
evaluation    budget and faults, rule statistics                scheduler    which rules run in a tick
messages      queues and outboxes                               bodies       STOP, RELEASE and holding still
inspection    telemetry, previews, explanations                 queries      expressions that are asked for often
failing       rules that fail, and where                        native/      native code for rules, through LLVM
schema        the serialized state                              snapshot     saving and restoring it
marks         groups and flags of each robot, for pictures
population    what becomes of minds when robots come and go
fleet         takes messages and readings, runs ticks; maps robots' names to views of their minds

Tables of many robots, and programs on them, are in the room `columns`.
"""

from sleepcast.fleet.fleet import Fleet, FleetError, RobotView
from sleepcast.fleet.obeying import Evaluated

__all__ = ["Evaluated", "Fleet", "FleetError", "RobotView"]
