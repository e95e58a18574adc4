"""Acts: what an expression may do to many robots' minds beyond assigning, and how they speak.

One function for each, found by name in `ACTS`; a refusal is a fault and changes nothing. What is the same for all
robots of one mind is done once, on a draft of that mind.
"""

from __future__ import annotations

from math import nan

import numpy as np

from sleepcast.channel.message import Kind
from sleepcast.channel.message_batch import Relays
from sleepcast.fleet.columns import Column, Mask, Rows
from sleepcast.fleet.memory import Act, FleetMemory
from sleepcast.language.form import Form, Number, show
from sleepcast.language.parts import Defining, Part, Storing, Template, label_of, written
from sleepcast.language.reader import MAX_TEXT
from sleepcast.language.symbols import Group, Operator, Stored
from sleepcast.language.vocabulary import (
    ACTIVE0,
    MAX_GROUPS,
    MAX_OPERATORS,
    MAX_RULES,
    TICK,
    TIME_SLOT,
    buffer_number,
)
from sleepcast.mind.limits import PROVEN_TICKS, TELL_SECONDS, TELLS_TOO_FAR, TELLS_TOO_OFTEN
from sleepcast.mind.rules import Rule, Transaction


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
    known = memory.refuse_where(part, rows, np.isnan(values), "unknown cannot be stored as an expression", stored)
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
    number = buffer_number(storing.key)
    done = np.zeros(rows.size, np.bool_)
    flags = np.zeros(rows.size, np.bool_)
    if number is not None:
        flags = memory.state.column(ACTIVE0 + number, rows) > 0.0
    for flag in (False, True):
        chosen = flags == flag
        if chosen.any():
            keeping = _Keeping(part, form, storing, flag)
            done[chosen] = memory.change(part, rows.take(chosen), keeping, proving=True)
    return done


class _Keeping:
    """Keeping an expression in one draft. flag: of the buffer."""

    def __init__(self, part: Part, form: Form, storing: Storing, flag: bool) -> None:
        self._key, self._text, self._flag = storing.key, show(form), flag
        self._named = buffer_number(self._key) is None
        self._activate = storing.activate
        self._name = written(part) if self._named else self._key.upper()

    def __call__(self, draft: Transaction) -> str | None:
        before = draft.rules.get(self._key)
        if before is not None and before.protected:
            return f"{before.name} is built in: it cannot be changed over the air"
        if self._named:
            taken = draft.taken(self._key, Stored)
            if taken is not None:
                return taken
            if before is None and draft.named_rules() >= MAX_RULES:
                return f"no room for another rule: there are {MAX_RULES}"
        program = draft.program_for(self._key, self._text, ())
        if isinstance(program, str):
            return program
        draft.put(self._key, self._name, self._text, program, flag=self._flag)
        if self._named:
            draft.learn(self._key, Stored(self._name, program.uses))
        if self._activate:
            draft.activate(self._key, True)
        return None


def _join(memory: FleetMemory, part: Part, rows: Rows) -> Column:
    name = label_of(part)
    key = name.casefold()

    def learn(draft: Transaction) -> str | None:
        taken = draft.taken(key, Group)
        if taken is not None:
            return taken
        known = sum(isinstance(found, Group) for found in draft.learned.values())
        if key not in draft.learned and known >= MAX_GROUPS:
            return f"no room for another group: there are {MAX_GROUPS}"
        draft.learn(key, Group(name))
        return None

    done = memory.change(part, rows, learn)
    if done.any():
        memory.state.group(key)[rows.take(done).index] = True
    return _values(done)


def _leave(memory: FleetMemory, part: Part, rows: Rows) -> Column:
    key = label_of(part).casefold()
    if key in memory.state.groups:
        memory.state.groups[key][rows.index] = False
    return np.ones(rows.size)


def _found(draft: Transaction, key: str) -> Rule | str:
    """The buffer or rule that an act names, or why it cannot be changed."""
    kept = draft.rules.get(key)
    if kept is None:
        return f"no rule {key}"
    return f"{kept.name} is built in: it cannot be changed over the air" if kept.protected else kept


def _activate(memory: FleetMemory, part: Part, rows: Rows) -> Column:
    key, active = label_of(part), part.name == "activate"
    number = buffer_number(key)
    done = np.ones(rows.size, np.bool_)
    kept = memory.where(rows, lambda mind: key in mind.rules) if number is not None else done
    if number is not None and not kept.all():
        empty = rows.take(~kept)
        memory.changing(empty)
        memory.state.assign(ACTIVE0 + number, empty, 1.0 if active else 0.0)

    def activate(draft: Transaction) -> str | None:
        found = _found(draft, key)
        if isinstance(found, str):
            return found
        draft.activate(key, active)
        return None

    if kept.any():
        done[kept] = memory.change(part, rows.take(kept), activate, proving=True)
    return _values(done)


def _forget(memory: FleetMemory, part: Part, rows: Rows) -> Column:
    key = label_of(part)

    def unlearn(draft: Transaction) -> None:
        if draft.learned.pop(key, None) is not None:
            draft.resolve_again(key)

    def forget_operator(draft: Transaction) -> None:
        del draft.operators[key]
        unlearn(draft)

    def forget_rule(draft: Transaction) -> str | None:
        found = _found(draft, key)
        if isinstance(found, str):
            return found
        draft.remove(key)
        unlearn(draft)
        return None

    done = np.ones(rows.size, np.bool_)
    operator = memory.where(rows, lambda mind: key in mind.operators)
    if operator.any():
        memory.change(part, rows.take(operator), forget_operator)
    if not operator.all():
        done[~operator] = memory.change(part, rows.take(~operator), forget_rule, proving=True)
    return _values(done)


def _lease(memory: FleetMemory, part: Part, rows: Rows, seconds: Column) -> Column:
    key = label_of(part)
    values = seconds.copy()
    known = memory.refuse_where(part, rows, np.isnan(seconds), "a lease of unknown length", values)

    def look(draft: Transaction) -> str | None:
        found = _found(draft, key)
        return found if isinstance(found, str) else None

    if known.size == 0:
        return values
    lasting = ~np.isnan(values)
    done = memory.change(part, known, look, proving=True)
    if done.any():
        some = known.take(done)
        memory.statistics.lease(key, some, memory.state.column(TIME_SLOT, some) + values[lasting][done])
    values[lasting] = np.where(done, 1.0, nan)
    return values


def _defun(memory: FleetMemory, part: Part, rows: Rows) -> Column:
    defining = part.data
    if not isinstance(defining, Defining):
        raise TypeError(f"a part of op {part.op} defines nothing")
    name, text = written(part), " ".join(map(show, defining.body))
    key = name.casefold()

    def define(draft: Transaction) -> str | None:
        taken = draft.taken(key, Operator)
        if taken is not None:
            return taken
        if key not in draft.operators and len(draft.operators) >= MAX_OPERATORS:
            return f"no room for another operator: there are {MAX_OPERATORS}"
        program = draft.program_for(key, text, defining.parameters)
        if isinstance(program, str):
            return program
        draft.operators[key] = program
        draft.learn(key, Operator(name, defining.parameters, program.uses))
        return None

    return _values(memory.change(part, rows, define))


def _rollback(memory: FleetMemory, part: Part, rows: Rows) -> Column:
    state = memory.state
    unproven = state.column(TICK, rows) - state.unproven_since[rows.index] < PROVEN_TICKS
    for proven in np.unique(state.proven[rows.index][unproven]).tolist():
        wanted = [kept for kept in memory.minds[proven].rules.values() if not kept.protected]
        some = rows.take(unproven & (state.proven[rows.index] == proven))
        memory.change(part, some, _Restoring(wanted))
        for kept in wanted:
            memory.statistics.restore_lease(kept.key, some)
    return np.ones(rows.size)


class _Restoring:
    """Bringing rules back in one draft; what is protected stays."""

    def __init__(self, wanted: list[Rule]) -> None:
        self._wanted = wanted

    def __call__(self, draft: Transaction) -> None:
        for key in [kept.key for kept in draft.rules.values() if not kept.protected]:
            draft.remove(key)
        for kept in self._wanted:
            draft.put(kept.key, kept.name, kept.text, kept.program, flag=False)
            draft.activate(kept.key, kept.active)
        gone = [k for k, found in draft.learned.items() if isinstance(found, Stored) and k not in draft.rules]
        for key in gone:
            del draft.learned[key]
            draft.resolve_again(key)
        for kept in list(draft.rules.values()):
            if buffer_number(kept.key) is None:
                draft.learn(kept.key, Stored(kept.name, draft.rules[kept.key].program.uses))


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
    memory.refuse_where(part, rows, unknown, "an unknown cannot be told", values)
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
            reason = f"a text of {len(text)} characters cannot be told: at most {MAX_TEXT} fit"
            memory.refuse_where(part, rows, mask, reason, values)
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
    known = memory.refuse_where(part, rows, np.isnan(castes), "a ping of unknown caste", values)
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
