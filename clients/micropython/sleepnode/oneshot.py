"""What BEST, QUORUM and AFTER-ISSUE ask for around the expressions in them. Loaded for one text, and let go again
before these are checked.
"""

from micropython import const

from sleepnode.reader import Refused

_MAX_WAIT = const(3600)
_TIMES = const(" ms s min h ")
_MAX_CHOSEN = const(64)
_BEHIND = {":window": (0.2, 10.0), ":lease": (1.0, 3600.0)}
"""The least and the most seconds that may stand behind a command that chooses."""


def plan(form, key):
    """What a whole command asks for; the places of its cost, test and command, 0 for what it has not got; and the fault
    of a robot that is alone with the text. None if the form is incomplete. Raises Refused."""
    if key == "after-issue" and len(form) == 3:
        if not (_is_time(form[1]) and 0 < form[1][0] <= _MAX_WAIT):
            raise Refused("AFTER-ISSUE waits for a time: wanted more than 0s and at most %ds" % _MAX_WAIT)
        return form[1][0], 0, 0, 2, "AFTER-ISSUE counts from the issue of a command that is sent"
    return _auction(form, form[0].upper(), key == "best") if 5 <= len(form) <= 9 else None


def _auction(form, name, is_best):
    """A BEST or QUORUM asks for how many may obey, and the milliseconds of window and lease."""
    counts = [_chosen(name, each) for each in form[1 : 2 if is_best else 3]]
    if counts[0] > counts[-1]:
        raise Refused("at least %d and at most %d robots: none can be both" % (counts[0], counts[-1]))
    times = {":window": 1.0, ":lease": 4.0}
    for at in range(5, len(form), 2):
        _time(name, form[at], form[at + 1] if at + 1 < len(form) else None, times)
    whole = counts[-1], int(1000 * times[":window"]), int(1000 * times[":lease"])
    return whole, 2 if is_best else 0, 3, 4, "%s chooses among robots that are sent this" % name


def _chosen(name, form):
    fine = isinstance(form, tuple) and form[1][-1:] in "0123456789." and form[2] and form[0] == int(form[0])
    if not (fine and 1 <= form[0] <= _MAX_CHOSEN):
        raise Refused("%s chooses a number of robots: wanted a whole number from 1 to %d" % (name, _MAX_CHOSEN))
    return int(form[0])


def _time(name, key, time, times):
    """Take a time that stands behind the command."""
    which = key.lower() if isinstance(key, str) else ""
    least, most = _BEHIND.get(which, (1, 0))
    if not (_is_time(time) and least <= time[0] <= most):
        wanted = " or ".join(["%s and %gs to %gs" % ((each,) + _BEHIND[each]) for each in (":window", ":lease")])
        raise Refused("what follows the command of %s can only be %s" % (name, wanted))
    times[which] = time[0]


def _is_time(form):
    """Whether a form is a number of seconds, or one with a unit of time."""
    word = form[1] if isinstance(form, tuple) else "/"
    at = len(word)
    while word[at - 1].isalpha():
        at -= 1
    unit = word[at:]
    return "/" not in word and (" %s " % unit in _TIMES if unit else word[-1] in ".0123456789" and form[2])
