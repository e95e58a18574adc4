"""Acts: what an expression may do to its robot's mind beyond assigning and storing, and how it speaks.

One function for each, found by name in `ACTS`; a refusal is a fault and changes nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import nan

from sleepcast.language.form import show
from sleepcast.language.parts import Defining, Part, Template, label_of, written
from sleepcast.language.reader import MAX_TEXT
from sleepcast.language.symbols import Group, Operator, Stored
from sleepcast.language.vocabulary import ACTIVE0, MAX_GROUPS, MAX_OPERATORS, buffer_number
from sleepcast.mind.limits import PROVEN_TICKS
from sleepcast.node.buffers import ExpressionBuffer
from sleepcast.node.memory import Act, RobotMemory


def _join(memory: RobotMemory, part: Part) -> float:
    name = label_of(part)
    key = name.casefold()
    if memory.taken(part, key, Group):
        return nan
    if key not in memory.learned and sum(isinstance(d, Group) for d in memory.learned.values()) >= MAX_GROUPS:
        return memory.refuse(part, f"no room for another group: there are {MAX_GROUPS}")
    if not memory.may_write(part, f"group {key}", name):
        return nan
    memory.learn(key, Group(name))
    memory.groups |= {key}
    return 1.0


def _leave(memory: RobotMemory, part: Part) -> float:
    key = label_of(part).casefold()
    if not memory.may_write(part, f"group {key}", label_of(part)):
        return nan
    memory.groups -= {key}
    return 1.0


def _buffer(memory: RobotMemory, part: Part) -> ExpressionBuffer | None:
    """The buffer or rule that an act names, unless there is none or it is built in, which are faults."""
    buffer = memory.rules.kept.get(label_of(part))
    if buffer is None:
        memory.refuse(part, f"no rule {label_of(part)}")
    elif buffer.protected:
        memory.refuse(part, f"{buffer.name} is built in: it cannot be changed over the air")
        return None
    return buffer


def _activate(memory: RobotMemory, part: Part) -> float:
    key, wanted = label_of(part), part.name == "activate"
    number = buffer_number(key)
    flag = memory.merging.flag(key, wanted)  # noted for a rule that is not there yet, too
    if number is not None and key not in memory.rules.kept:
        memory.changing()
        memory.values[ACTIVE0 + number] = 1.0 if flag else 0.0
        return 1.0
    buffer = _buffer(memory, part)
    if buffer is None:
        return nan
    if flag is not wanted:
        return memory.refuse(part, f"{buffer.name} was changed by a command that was sent later")
    memory.changing()
    memory.rules.activate(buffer, wanted)
    return 1.0


def _forget(memory: RobotMemory, part: Part) -> float:
    key = label_of(part)
    buffer = None if key in memory.operators else _buffer(memory, part)
    if buffer is None and key not in memory.operators and key in memory.rules.kept:
        return nan
    memory.merging.forget(key)
    flag = memory.merging.flag(key, False)
    if not memory.may_write(part, key, label_of(part)):
        if buffer is not None and flag is False:
            memory.rules.activate(buffer, False)
        return nan
    if key in memory.operators:
        del memory.operators[key]
    elif buffer is None:
        return nan
    else:
        memory.changing()
        memory.rules.remove(key)
    if memory.learned.pop(key, None) is not None:
        memory.resolve_again(key)
    return 1.0


def _lease(memory: RobotMemory, part: Part, seconds: float) -> float:
    if seconds != seconds:
        return memory.refuse(part, "a lease of unknown length")
    buffer = _buffer(memory, part)
    if buffer is None:
        return nan
    memory.changing()
    buffer.lease = memory.time + seconds
    memory.rules.changed()
    return 1.0


def _defun(memory: RobotMemory, part: Part) -> float:
    defining = part.data
    if not isinstance(defining, Defining):
        raise TypeError(f"a part of op {part.op} defines nothing")
    name = written(part)
    key = name.casefold()
    if memory.taken(part, key, Operator):
        return nan
    if key not in memory.operators and len(memory.operators) >= MAX_OPERATORS:
        return memory.refuse(part, f"no room for another operator: there are {MAX_OPERATORS}")
    program = memory.program_for(part, key, " ".join(map(show, defining.body)), defining.parameters)
    if program is None or not memory.may_write(part, key, name):
        return nan
    memory.operators[key] = program
    memory.learn(key, Operator(name, defining.parameters, program.uses))
    return 1.0


def _rollback(memory: RobotMemory, part: Part) -> float:
    memory.merging.roll_back()
    if memory.tick - memory.unproven_since < PROVEN_TICKS:
        memory.rules.restore(memory.proven)
        gone = [k for k, d in memory.learned.items() if isinstance(d, Stored) and k not in memory.rules.kept]
        for key in gone:
            del memory.learned[key]
            memory.resolve_again(key)
        for buffer in memory.rules.kept.values():
            if buffer_number(buffer.key) is None:
                memory.learn(buffer.key, Stored(buffer.name, buffer.program.uses))
    return 1.0


def _report(memory: RobotMemory, part: Part, *arguments: float) -> float:
    memory.voice.report(label_of(part), arguments)
    return arguments[-1] if arguments else 1.0


def _tell(memory: RobotMemory, part: Part, *arguments: float) -> float:
    if any(argument != argument for argument in arguments):
        return memory.refuse(part, "an unknown cannot be told")
    if not isinstance(part.data, Template):
        raise TypeError(f"a part of op {part.op} tells nothing")
    hops = min(part.data.hops, memory.hops)
    if memory.voice.may_tell(hops):  # asked first: a text is made only for what goes out
        text = part.data.text(arguments)
        if len(text) > MAX_TEXT:
            return memory.refuse(part, f"a text of {len(text)} characters cannot be told: at most {MAX_TEXT} fit")
        memory.voice.tell(text, hops)
    return 1.0


def _ping(memory: RobotMemory, part: Part, caste: float = 0.0) -> float:
    if caste != caste:
        return memory.refuse(part, "a ping of unknown caste")
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
