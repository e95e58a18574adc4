"""Acts: what an expression may do to many robots' minds beyond assigning, and how they speak.

One function for each, found by name in `ACTS`; a refusal is a fault and changes nothing. What an act means stands in
`mind.rules`; it is done once for all robots of one mind, on a draft of that mind.
"""

from __future__ import annotations

from functools import partial
from math import nan

import numpy as np

from sleepcast.channel.message import Kind
from sleepcast.channel.message_batch import Relays
from sleepcast.fleet.columns import Column, Mask, Rows
from sleepcast.fleet.memory import Act, FleetMemory
from sleepcast.language.form import Form, Number, show
from sleepcast.language.parts import Defining, Part, Storing, Template, label_of, written
from sleepcast.language.reader import MAX_TEXT
from sleepcast.language.vocabulary import ACTIVE0, TICK, TIME_SLOT, buffer_number
from sleepcast.mind import rules
from sleepcast.mind.limits import PROVEN_TICKS, TELL_SECONDS, TELLS_TOO_FAR, TELLS_TOO_OFTEN
from sleepcast.mind.refusals import UNKNOWN_CASTE, UNKNOWN_LEASE, UNKNOWN_STORED, UNKNOWN_TOLD, too_long


def _values(done: Mask, value: float = 1.0) -> Column:
    return np.where(done, value, nan)


def _store(memory: FleetMemory, part: Part, rows: Rows, values: Column) -> Column:
    storing = part.data
    if not isinstance(storing, Storing):
        raise TypeError(f"a part of op {part.op} stores nothing")
    if not storing.value:
        done = _keep(memory, part, rows, storing.form, storing)
        return _values(done, 1.0 if storing.activate else 0.0)
    stored = values.copy()
    known = memory.refuse_where(part, rows, np.isnan(values), UNKNOWN_STORED, stored)
    numbers = values[~np.isnan(values)]
    done = np.zeros(known.size, np.bool_)
    for bits in np.unique(numbers.view(np.int64)):  # 0 and -0 are two expressions
        same = numbers.view(np.int64) == bits
        number = float(bits.view(np.float64))
        done[same] = _keep(memory, part, known.take(same), Number(number), storing)
    kept = ~np.isnan(stored)
    stored[kept] = np.where(done, numbers, nan)
    return stored


def _keep(memory: FleetMemory, part: Part, rows: Rows, form: Form, storing: Storing) -> Mask:
    """Keep an expression in a buffer or rule; gives where it was done."""
    key, text, number = storing.key, show(form), buffer_number(storing.key)
    name = written(part) if number is None else key.upper()
    done = np.zeros(rows.size, np.bool_)
    flags = np.zeros(rows.size, np.bool_)
    if number is not None:
        flags = memory.state.column(ACTIVE0 + number, rows) > 0.0
    for flag in (False, True):
        chosen = flags == flag
        if chosen.any():
            store = partial(rules.store, key=key, name=name, text=text, activate=storing.activate, flag=flag)
            done[chosen] = memory.change(part, rows.take(chosen), store)
    return done


def _join(memory: FleetMemory, part: Part, rows: Rows) -> Column:
    name = label_of(part)
    done = memory.change(part, rows, partial(rules.join, name=name))
    if done.any():
        memory.state.group(name.casefold())[rows.take(done).index] = True
    return _values(done)


def _leave(memory: FleetMemory, part: Part, rows: Rows) -> Column:
    key = label_of(part).casefold()
    if key in memory.state.groups:
        memory.state.groups[key][rows.index] = False
    return np.ones(rows.size)


def _activate(memory: FleetMemory, part: Part, rows: Rows) -> Column:
    activate = partial(rules.activate, key=label_of(part), wanted=part.name == "activate")
    return _values(memory.change(part, rows, activate))


def _forget(memory: FleetMemory, part: Part, rows: Rows) -> Column:
    return _values(memory.change(part, rows, partial(rules.forget, key=label_of(part))))


def _lease(memory: FleetMemory, part: Part, rows: Rows, seconds: Column) -> Column:
    key = label_of(part)
    values = seconds.copy()
    known = memory.refuse_where(part, rows, np.isnan(seconds), UNKNOWN_LEASE, values)
    if known.size == 0:
        return values
    lasting = ~np.isnan(values)
    done = memory.change(part, known, partial(rules.lease, key=key))
    if done.any():
        some = known.take(done)
        memory.statistics.lease(key, some, memory.state.column(TIME_SLOT, some) + values[lasting][done])
    values[lasting] = np.where(done, 1.0, nan)
    return values


def _defun(memory: FleetMemory, part: Part, rows: Rows) -> Column:
    defining = part.data
    if not isinstance(defining, Defining):
        raise TypeError(f"a part of op {part.op} defines nothing")
    text = " ".join(map(show, defining.body))
    define = partial(rules.define_operator, name=written(part), parameters=defining.parameters, text=text)
    return _values(memory.change(part, rows, define))


def _rollback(memory: FleetMemory, part: Part, rows: Rows) -> Column:
    state = memory.state
    unproven = state.column(TICK, rows) - state.unproven_since[rows.index] < PROVEN_TICKS
    for proven in np.unique(state.proven[rows.index][unproven]).tolist():
        wanted = [rule for rule in memory.minds[proven].rules.values() if not rule.protected]
        some = rows.take(unproven & (state.proven[rows.index] == proven))
        memory.change(part, some, partial(rules.roll_back, wanted=wanted))
        for rule in wanted:
            memory.statistics.restore_lease(rule.key, some)
    return np.ones(rows.size)


def _report(memory: FleetMemory, part: Part, rows: Rows, *arguments: Column) -> Column:
    memory.outbox.report(rows, label_of(part), arguments)
    if memory.printed is not None:
        memory.printed.append((rows.robots, label_of(part), arguments))
    return arguments[-1] if arguments else np.ones(rows.size)


def _tell(memory: FleetMemory, part: Part, rows: Rows, *arguments: Column) -> Column:
    if not isinstance(part.data, Template):
        raise TypeError(f"a part of op {part.op} tells nothing")
    values = np.ones(rows.size)
    unknown = np.zeros(rows.size, np.bool_)
    for argument in arguments:
        unknown |= np.isnan(argument)
    memory.refuse_where(part, rows, unknown, UNKNOWN_TOLD, values)
    hops = min(part.data.hops, memory.hops)
    telling = ~unknown
    telling[telling] = _may_tell(memory, rows.take(telling), hops)  # first: a text is made only for what goes out
    told: dict[str, list[int]] = {}
    columns = [argument.tolist() for argument in arguments]
    for place in np.flatnonzero(telling).tolist():
        told.setdefault(part.data.text([column[place] for column in columns]), []).append(place)
    for text, places in told.items():
        mask = np.zeros(rows.size, np.bool_)
        mask[places] = True
        if len(text) > MAX_TEXT:
            memory.refuse_where(part, rows, mask, too_long(text), values)
        else:
            memory.outbox.say(Kind.COMMAND, rows.take(mask), Relays(text, hops), lasts=TELL_SECONDS)
    return values


def _may_tell(memory: FleetMemory, rows: Rows, hops: int) -> Mask:
    """Which of these robots may tell something now, so many hops far."""
    told, less = memory.outbox.may_tell(rows, hops)
    label = TELLS_TOO_OFTEN if hops >= 1 else TELLS_TOO_FAR
    if less.size:
        memory.outbox.report(less, label)
        if memory.printed is not None:
            memory.printed.append((less.robots, label, ()))
    return told


def _ping(memory: FleetMemory, part: Part, rows: Rows, caste: Column | None = None) -> Column:
    castes = np.zeros(rows.size) if caste is None else caste
    values = np.ones(rows.size)
    known = memory.refuse_where(part, rows, np.isnan(castes), UNKNOWN_CASTE, values)
    memory.outbox.ping(known, castes[~np.isnan(castes)])
    return values


ACTS: dict[str, Act] = {
    "store": _store,
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
