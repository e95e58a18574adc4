"""Acts: what an expression may do to its robot's mind beyond assigning and storing, and how it speaks.

One function for each, found by name in `ACTS`; a refusal is a fault and changes nothing. What an act means stands in
`mind.rules`.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import nan

from sleepcast.language.form import show
from sleepcast.language.parts import Defining, Part, Template, label_of, written
from sleepcast.language.reader import MAX_TEXT
from sleepcast.mind import rules
from sleepcast.mind.limits import PROVEN_TICKS
from sleepcast.mind.refusals import UNKNOWN_CASTE, UNKNOWN_LEASE, UNKNOWN_TOLD, too_long
from sleepcast.node.memory import Act, RobotMemory


def _join(memory: RobotMemory, part: Part) -> float:
    if not memory.change(part, rules.join(memory.base, label_of(part))):
        return nan
    memory.groups |= {label_of(part).casefold()}
    return 1.0


def _leave(memory: RobotMemory, part: Part) -> float:
    if not memory.change(part, rules.leave(memory.base, label_of(part))):
        return nan
    memory.groups -= {label_of(part).casefold()}
    return 1.0


def _activate(memory: RobotMemory, part: Part) -> float:
    wanted = part.name == "activate"
    return 1.0 if memory.change(part, rules.activate(memory.base, label_of(part), wanted)) else nan


def _forget(memory: RobotMemory, part: Part) -> float:
    return 1.0 if memory.change(part, rules.forget(memory.base, label_of(part))) else nan


def _lease(memory: RobotMemory, part: Part, seconds: float) -> float:
    if seconds != seconds:
        return memory.refuse(part, UNKNOWN_LEASE)
    if not memory.change(part, rules.lease(memory.base, label_of(part))):
        return nan
    memory.records[label_of(part)].lease = memory.time + seconds
    memory.records.changed()
    return 1.0


def _defun(memory: RobotMemory, part: Part) -> float:
    defining = part.data
    if not isinstance(defining, Defining):
        raise TypeError(f"a part of op {part.op} defines nothing")
    text = " ".join(map(show, defining.body))
    done = memory.change(part, rules.define_operator(memory.base, written(part), defining.parameters, text))
    return 1.0 if done else nan


def _rollback(memory: RobotMemory, part: Part) -> float:
    memory.base.merging.roll_back()
    if memory.tick - memory.unproven_since < PROVEN_TICKS:
        memory.restore(memory.proven)
    return 1.0


def _report(memory: RobotMemory, part: Part, *arguments: float) -> float:
    memory.voice.report(label_of(part), arguments)
    return arguments[-1] if arguments else 1.0


def _tell(memory: RobotMemory, part: Part, *arguments: float) -> float:
    if any(argument != argument for argument in arguments):
        return memory.refuse(part, UNKNOWN_TOLD)
    if not isinstance(part.data, Template):
        raise TypeError(f"a part of op {part.op} tells nothing")
    hops = min(part.data.hops, memory.hops)
    if memory.voice.may_tell(hops):  # asked first: a text is made only for what goes out
        text = part.data.text(arguments)
        if len(text) > MAX_TEXT:
            return memory.refuse(part, too_long(text))
        memory.voice.tell(text, hops)
    return 1.0


def _ping(memory: RobotMemory, part: Part, caste: float = 0.0) -> float:
    if caste != caste:
        return memory.refuse(part, UNKNOWN_CASTE)
    memory.voice.ping(caste)
    return 1.0


ACTS: Mapping[str, Act] = {
    "join": _join,
    "leave": _leave,
    "activate": _activate,
    "deactivate": _activate,
    "forget": _forget,
    "lease": _lease,
    "defun": _defun,
    "rollback": _rollback,
    "report": _report,
    "tell": _tell,
    "ping": _ping,
}
