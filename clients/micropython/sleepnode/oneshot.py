"""How the checker writes what only one-shot commands have: AFTER-ISSUE, CANCEL. Loaded for one text and let go again.

As in `forms.py`: a function of the checker and the form, whose number of arguments is right, that gives the cost.
"""

from micropython import const

from sleepnode.checker import Function
from sleepnode.reader import Refused, head_of

_HOST = const(52)
_MAX_WAIT = const(3600)
_TIMES = const(" ms s min h ")
_HEADS = const(" after-issue cancel ")


def _whole(c, form):
    """Refuse a form around which there is another one."""
    if c.count[0] != 1:
        raise Refused("%s is a whole command, sent once: it stands in no other expression" % form[0].upper())


def _aside(c, form):
    """Check a form that is evaluated later, by itself."""
    at = len(c.code)
    cost = c.part(form)
    c.code = c.code[:at]
    return cost


def _call(c, name, call):
    """Write a call of a function that is there for this text alone."""
    c.emit(_HOST)
    c.thing(Function(name, call, 0, 0, False, False), None)


def _is_time(form):
    """Whether a form is a number of seconds, or one with a unit of time."""
    word = form[1] if isinstance(form, tuple) else "/"
    at = len(word)
    while word[at - 1].isalpha():
        at -= 1
    unit = word[at:]
    return "/" not in word and (" %s " % unit in _TIMES if unit else word[-1] in ".0123456789" and form[2])


def _after_issue(c, form):
    _whole(c, form)
    time = form[1]
    if not (_is_time(time) and 0 < time[0] <= _MAX_WAIT):
        raise Refused("AFTER-ISSUE waits for a time: wanted more than 0s and at most %ds" % _MAX_WAIT)
    cost = _aside(c, form[2])
    mind = c.mind
    _call(c, "", lambda: mind.fault("AFTER-ISSUE counts from the issue of a command that is sent"))
    c.whole = time[0]
    return 1 + cost


def _cancel(c, form):
    if c.is_stored:
        raise Refused("CANCEL stands in what is sent once: nobody has sent what is stored")
    _call(c, "", c.mind.cancel)
    return 1


def write(c, form, key):
    """Write a special form."""
    return _cancel(c, form) if key == "cancel" else _after_issue(c, form)


def refuse_told(c, form):
    """Refuse a told form that has one of these in it which is no name of people's own."""
    if isinstance(form, list):
        head = head_of(form)
        if " %s " % head in _HEADS and c.meaning(head) is None:
            raise Refused("a TELL carries no AFTER-ISSUE or CANCEL: only a desk sends them")
        for item in form:
            refuse_told(c, item)
