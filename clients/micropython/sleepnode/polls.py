"""Commands with BEST or QUORUM as they come: whether to bid. Loaded for one text and let go again.

What becomes of a bid is in `bidding.py`, which says what stands where in it.
"""

import random

from micropython import const

_STANDING = const(9)
_POLL = const(0)
_PHASE = const(3)
_COST = const(6)
_UNTIL = const(7)
_ANSWERED = const(18)
_WHICH = const(19)
_BIDDING = const(0)
_OUT = const(2)
_MAX_BIDS = const(2)
_TIMES = const(4)
"""How often a robot says that it is out."""


def _which(message):
    """By what a poll is known; one that a robot tells again is known again."""
    number = message[8].get("auction") if "hops" in message[8] else message[3]
    return message[0], message[2], message[6], number


def _known(node, message):
    which = _which(message)
    for bid in node.bids:
        if bid[_WHICH] == which:
            return bid
    return None


def objection(node, message):
    """What to answer to a poll instead of looking at it: () for nothing, None if it is to be looked at."""
    told, known = "hops" in message[8] or node.trust.keys[message[0]][1] == "robot", _known(node, message)
    if message[1] == _STANDING or (told and not isinstance(message[8].get("auction"), int)):
        said = "BEST and QUORUM are sent once, by a desk, or told by a robot that collects bids: nobody does so here"
    elif node.is_still():
        said = "it is held still, so it does not bid"
    elif known is not None:
        return None if known[_PHASE] == _BIDDING else ()
    elif len(node.bids) < _MAX_BIDS:
        return None
    else:
        said = "it bids for %d commands at once: no more" % _MAX_BIDS
    return "fault", None, said, {}


def begin(node, message, auction, found):
    """Bid by what test and cost have come to, or give what to answer instead. auction: the places, and the milliseconds
    of window and lease."""
    known, cost, now = _known(node, message), found[1], node.clock.now()
    if found[0] != "matched" or cost is None:
        if known:
            known[_ANSWERED], known[_PHASE] = True, _OUT
        return ("not matched", None, "", {"unknown": True}) if found[0] == "matched" else found
    if known:
        known[_POLL], known[_COST], known[_UNTIL] = message, cost, message[5] // 1000
        return None
    body, which = message[8], _which(message)
    message[8] = {key: body[key] for key in ("within", "hops") if key in body}
    first = now + int(min(1000 * (body.get("within") or 0), auction[1] // 2) * random.random())
    beat = (now // 100 % (1 << 30) << 32) + random.getrandbits(30)
    bid = [message, auction[0], auction[2], _BIDDING, 0, [], cost, message[5] // 1000, beat, []]
    node.bids.append(bid + [first, -1, now, False, 0, [], _TIMES, False, False, which])
    node.bid_at = 0
    return None
