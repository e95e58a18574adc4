"""How the checker writes what stands in no rule: AFTER-ISSUE, CANCEL, BEST and QUORUM. Loaded for one text and let go
again. As in `forms.py`, it gives the cost.
"""

from micropython import const

from sleepnode.checker import Function
from sleepnode.reader import Refused

_JUMP = const(11)
_ELSE_TEST = const(18)
_HOST = const(52)

# Refusals, by their places in `sentences.py`.
_CHOOSES_BY_ACTS_REFUSED = const(67)
_WHOLE_REFUSED = const(68)
_CANCEL_REFUSED = const(69)


def write(c, form, key):
    """Write a special form. Its cost, its test and its command are for later: here they are only checked."""
    price, test, command, fault = 0, 0, 0, ""
    if key == "cancel":
        if c.plan is False:
            raise Refused(_CANCEL_REFUSED)
    else:
        if c.count[0] != 1:
            raise Refused(_WHOLE_REFUSED, form[0].upper())
        _, price, test, command, fault = c.plan
    at, mind, c.acts = len(c.code), c.mind, False
    cost = 1 + (c.part(form[price]) if price else 0)
    c.code = c.code[:at]
    if test:
        c.tested = True
        cost += c.part(form[test])
        other = c.jump(_ELSE_TEST)
        if c.acts:
            raise Refused(_CHOOSES_BY_ACTS_REFUSED, form[0].upper())
    at = len(c.code)
    cost += c.part(form[command]) if command else 0
    c.code = c.code[:at]
    c.emit(_HOST)
    c.thing(Function("", (lambda: mind.fault(fault)) if fault else mind.cancel, 0, 0, False, False), None)
    if test:
        end = c.jump(_JUMP)
        c.arrive(other)
        c.number(0.0)
        c.arrive(end)
    return cost
