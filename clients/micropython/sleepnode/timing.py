"""Commands that wait for an instant, and the clocks of those who have sent them (docs/wire.md, an instant for all).
Loaded when there is something to do, and let go again.

What waits is a row of `Node.waiting`: [message, from its issue to the instant, when it was heard, state]. A clock is
[when to ask for the time, the pause after that, how many answers have come, when the best of them had come, by how much
our clock was ahead then, by how much that may be wrong]. Times are milliseconds of our clock. Of two answers the one
that is the better now stays so, since the bounds of both grow alike: so one is kept of all.
"""

import os
import random

from micropython import const

from sleepnode.streams import Streams
from sleepnode.trust import not_stored

_REPORT = const(6)
_STANDING = const(9)
_MAX_WAITING = const(4)

_HEARD = const(0)
_WAITS = const(1)
_RESTARTED = const(2)
_STOPPED = const(3)
_UNSURE = const(5)
"""States of a row; one from _STOPPED on is over, and why it is stands at that place of _OVER."""
_OVER = (
    "STOP has discarded it before its instant",
    "CANCEL has discarded it before its instant",
    "not done: this robot has no bound of its clock, since it could not measure that of the sender",
)
_HELD = "it is held still, so nothing waits in it"

_DUE = const(0)
_PAUSE = const(1)
_COUNT = const(2)
_ENDED = const(3)
_AHEAD = const(4)
_WRONG = const(5)
"""Places in a clock."""
_ENOUGH = const(8)
_SOON = const(300)
_SELDOM = const(16000)
_REFRESH = const(30000)
_STEADY = const(10000)
"""Milliseconds in which two clocks drift apart by one at most."""
_LONGEST = const(1000)
"""Milliseconds from a question to its answer."""


def let_wait(node, message):
    """Let a command wait for its instant, or give what to answer instead."""
    if message[1] == _STANDING or node.trust.keys[message[0]][1] == "robot":
        said = "AFTER-ISSUE is sent once, by a desk: nothing else says when it was issued"
    elif node.stopped or node.catching_up:
        said = _HELD
    elif len(node.waiting) >= _MAX_WAITING:
        said = "%d commands wait in this robot already: no more" % _MAX_WAITING
    else:
        node.waiting.append([message, int(1000 * node.mind.whole), node.clock.now(), _HEARD])
        node.look_at = 0
        return None
    return "fault", None, said, {}


def step(node, now):
    """Answer for what waits from now on, and for what is over; the rows that are to be done now, in their turn."""
    begun, over, due = [], [], []
    _ask(node, now)
    for row in node.waiting[:]:
        said = _said(node, row, now)
        if said:
            over.append((row[0], said))
            node.waiting.remove(row)
        elif said is not None:
            due.append(row)
        elif row[3] == _HEARD:
            row[3] = _WAITS
            begun.append(row[0])
    fault = _keep(node) if begun or over else ""
    for message in begun:
        node.answer(message, "not matched", None, fault, {"waiting": True})
    for message, said in over:
        node.answer(message, said[0], None, said[1])
    node.look_at = _next(node)
    return sorted(due, key=_instant)


def settle(node, done, now):
    """Answer for what was done in the tick at `now`: rows, what came of each (as for an answer), and when it was."""
    fault = _keep(node)
    for row, (word, value, why, more), since in done:
        clock, half = node.clocks[row[0][6]], node.every // 2
        missed = max([half] + [abs(_instant(row) + clock[_AHEAD] - at) for at in (now, since)])
        more["bound"] = (_bound(clock, now) + missed) / 1000
        node.answer(row[0], word, value, "; ".join([each for each in (why, fault) if each]), more)
    node.look_at = _next(node)


def _bound(clock, now):
    return clock[_WRONG] + abs(now - clock[_ENDED]) // _STEADY + 1


def _instant(row):
    """By the sender's clock."""
    return row[0][4] // 1000 + row[1]


def _said(node, row, now):
    """What to answer now for a command that is not done, None while it waits, () if it is to be done."""
    if row[3] >= _STOPPED:
        return "fault", _OVER[row[3] - _STOPPED]
    clock, tick = node.clocks[row[0][6]], node.every
    if not clock[_COUNT]:
        return ("fault", _OVER[_UNSURE - _STOPPED]) if now > row[1] + row[2] else None
    left = _instant(row) + clock[_AHEAD] - now
    if 2 * left > tick:
        return None
    if left < (-2 * tick if row[3] == _WAITS else -(tick // 2)):
        if row[3] == _RESTARTED:
            return "fault", "its instant came while the robot was restarted: not done, or only in part"
        return "late", "heard after its instant, so not done"
    if node.stopped or node.catching_up:
        return "fault", _HELD
    early = _instant(row) - row[1] + clock[_AHEAD] - _bound(clock, now) < node.stopped_at
    return ("fault", _OVER[0]) if early else ()


def _next(node):
    """When there is something to do again, None for never."""
    times = []
    for row in node.waiting:
        clock = node.clocks[row[0][6]]
        times.append(_instant(row) + clock[_AHEAD] - node.every // 2 if clock[_COUNT] else row[1] + row[2])
        times.append(clock[_DUE])
    return min(times) if times else None


# ---- clocks


def ask_time(node, body):
    """Ask for the time. body: whose, if that matters."""
    node.nonce, node.asked, node.whom = os.urandom(16), node.clock.now(), body.get("whose", "")
    body["time"] = node.nonce
    node.say(_REPORT, body)


def take_time(node, message, now):
    """Take the answer to our question: set the clock by it, or note by how much it is ahead of that of the sender."""
    trip, issued = node.came - node.asked, message[4] // 1000
    if not 0 <= trip <= _LONGEST or (node.whom and message[6] != node.whom):
        return
    node.nonce = None
    waited = message[8].get("waited")  # s for which the question has waited for its answer
    if isinstance(waited, float) and 0 <= 1000 * waited <= trip:
        trip -= int(1000 * waited)
    if node.whom:
        _took(node, message[6], node.came - trip // 2 - issued, trip // 2)
        return
    behind = issued - node.came + trip // 2
    node.clock.set(now + behind)
    node.zero += behind
    node.next = now + behind
    node.streams = Streams(now + behind)
    node.say(_REPORT, {"label": "clock", "values": [behind / 1000], "took": message[6]})


def _took(node, sender, ahead, half):
    """By how much our clock is ahead of this sender's, within half of the trip."""
    clock, came = node.clocks.get(sender), node.came
    if clock is None:
        return
    if not clock[_COUNT] or half < _bound(clock, came):
        clock[_ENDED], clock[_AHEAD], clock[_WRONG] = came, ahead, half + 2  # for what whole milliseconds leave out
    clock[_COUNT] = min(clock[_COUNT] + 1, _ENOUGH)
    clock[_PAUSE] = _SOON
    clock[_DUE] = min(clock[_DUE], came + _SOON) if clock[_COUNT] < _ENOUGH else came + _REFRESH
    node.look_at = 0


def _ask(node, now):
    """Ask one of those who have sent what waits for the time, if that is due. Nobody else's clock is remembered."""
    clocks = {}
    for row in node.waiting:
        sender = row[0][6]
        first = now + int(_SOON * random.random())  # many robots hear the same command
        clocks[sender] = node.clocks.get(sender) or [first, _SOON, 0, 0, 0, 0]
    node.clocks = clocks
    whom = min(clocks, key=lambda each: clocks[each][_DUE]) if clocks else ""
    if not whom or clocks[whom][_DUE] > now:
        return
    clock = clocks[whom]
    usual = _REFRESH if clock[_COUNT] == _ENOUGH else 4 * clock[_WRONG]
    clock[_DUE] = now + int(max(usual, clock[_PAUSE]) * (1 + random.random() / 2))
    clock[_PAUSE] = min(2 * clock[_PAUSE], _SELDOM)
    ask_time(node, {"whose": whom})


# ---- over a restart


def _keep(node):
    """Write what waits; gives what failed."""
    rows = []
    for message, wait, heard, _ in node.waiting:
        rows.append([message[0].hex()] + message[2:8] + [message[8].get("within"), wait, heard])
    try:
        from sleepnode.keeping import keep

        keep(node.waits_file, rows)
    except (OSError, MemoryError) as error:
        return not_stored(node.waits_file, error)
    return ""


def restored(node, now):
    """What waited before a restart, as rows; a clock that has gone back decides nothing."""
    from sleepnode.keeping import kept

    rows = []
    try:
        for each in kept(node.waits_file):
            message = [bytes.fromhex(each[0]), 0] + each[1:7] + [{"within": each[7]}]
            rows.append([message, each[8], each[9], _UNSURE if each[9] > now else _RESTARTED])
    except OSError:
        pass  # nothing ever waited
    except (ValueError, TypeError, IndexError, MemoryError):
        node.mind.report("%s is damaged: nothing waits any more" % node.waits_file, ())
    return rows
