"""Bids for commands with BEST or QUORUM, and memberships (docs/wire.md, bids and grants). Loaded when there is work,
and let go again.

A bid is a row of `Node.bids`, see below, which `polls.py` makes; times are milliseconds. It is sent less often than by
other robots, since a small computer takes long to sign: so the latest eight beats are those that a caller may still
name.
"""

from micropython import const

from sleepnode.cbor import encode
from sleepnode.checker import buffer_number
from sleepnode.reader import head_of, read

_REQUEST = const(8)

_POLL = const(0)
_PLACES = const(1)
_LEASE = const(2)
_PHASE = const(3)
_WHY = const(4)
"""Why it is out: the state of what waited (`timing.py`) if that was discarded, else 0."""
_MADE = const(5)
"""What the command has made: rows of whether it is a group, its key, and a rule's program."""
_COST = const(6)
_UNTIL = const(7)
_BEAT = const(8)
_SENT = const(9)
"""When the latest beats were sent, the last of them last."""
_NEXT = const(10)
_LATEST = const(11)
"""The number of the caller's latest message."""
_HEARD = const(12)
_BEATEN = const(13)
"""Whether all places are taken, or wanted by better bids."""
_ENDS = const(14)
"""When the lease ends."""
_OUTBID = const(15)
_FAREWELLS = const(16)
_GRANTED = const(17)
_ANSWERED = const(18)
_WHICH = const(19)
"""Its poll: key, epoch and name of the caller, and the number."""

_BIDDING = const(0)
_MEMBER = const(1)
_OUT = const(2)
_SAYS = ("bid", "in", "out")

_MAX_OUT = const(18)
_SOON = const(300)
_SELDOM = const(1000)
_QUIET = const(10000)
_USEFUL = const(300)
_LATE = const(500)
_STILL = "it is held still, so it does not bid"
_ENDED = ("STOP has ended its bid", "CANCEL has ended its bid")
_STOPPED = const(3)


# ---- what the caller says


def hear(node, message):
    """A caller says who is chosen. Raises what nonsense raises: then nothing is heard."""
    grants = message[8]["grants"]
    for bid in node.bids:
        if bid[_WHICH] == (message[0], message[2], message[6], grants["of"]):
            _hear(node, bid, message[3], grants, node.clock.now())
            node.bid_at = 0


def _hear(node, bid, number, grants, now):
    granted = grants["granted"]
    if bid[_PHASE] == _OUT:
        return
    if number > bid[_LATEST]:
        bid[_LATEST], bid[_HEARD] = number, now
        bid[_BEATEN] = _is_beaten(node, bid, grants)
    if node.name in granted:
        back = bid[_BEAT] - grants["beats"][granted.index(node.name)]
        if 0 <= back < len(bid[_SENT]):
            bid[_ENDS] = max(bid[_ENDS], bid[_SENT][-1 - back] + bid[_LEASE])
            bid[_GRANTED] = True
    elif bid[_PHASE] == _BIDDING and not grants["open"]:
        bid[_OUTBID] = granted
        bid[_PHASE] = _OUT


def _is_beaten(node, bid, grants):
    mine, better = _rank(bid[_COST], node.name), list(grants["granted"])
    for at, name in enumerate(grants["best"]):
        if name not in better and _rank(grants["costs"][at], name) < mine:
            better.append(name)
    return len(better) - (node.name in better) >= bid[_PLACES]


def _rank(cost, name):
    """The order of bids: the least cost, of equal ones the smaller name, r2 before r10."""
    parts, word = [], ""
    for c in name:
        if c.isdigit() != bool(len(parts) % 2):
            parts.append(word)
            word = ""
        word += c
    parts.append(word)
    return cost, [(int(part[:18]) if at % 2 else 0, part) for at, part in enumerate(parts)], name


# ---- ticks


def tick(node, now):
    """Leave what is over, and say how the robot stands; the bids by which it is to obey now."""
    late, due = max(0, now - node.bid_at) if node.bid_at else 0, []
    for bid in node.bids[:]:
        granted, bid[_GRANTED] = bid[_GRANTED] and now <= bid[_UNTIL] and now + _USEFUL < bid[_ENDS], False
        if granted and bid[_PHASE] == _BIDDING:
            if not node.is_still():
                bid[_MADE] = _before(node.mind, read(bid[_POLL][7])[4], [])
                due.append(bid)
                continue
            node.answer(bid[_POLL], "fault", None, _STILL)
            bid[_ANSWERED] = True
            bid[_PHASE] = _OUT
        _go_on(node, bid, now, late)
    node.bid_at = _next(node)
    return due


def settle(node, done, now):
    """The robot has obeyed by these bids; what came of each, as for an answer."""
    for bid, found in done:
        made = []
        for is_group, key, before in bid[_MADE]:
            has = _has(node.mind, is_group, key)
            if has is not before and has:
                made.append((is_group, key, has))
        bid[_MADE], bid[_ANSWERED] = made, True
        if found[0] == "matched":
            bid[_PHASE] = _MEMBER
        else:
            bid[_PHASE] = _OUT
        node.answer(bid[_POLL], *found)
        bid[_NEXT] = now
        _go_on(node, bid, now, 0)
    node.bid_at = _next(node)


def _before(mind, form, found):
    """What a form may make, and what there is of it now."""
    if isinstance(form, list):
        head = head_of(form)
        if head in ("join", "rule") and len(form) > 1 and isinstance(form[1], str):
            key = form[1].lower()
            number = buffer_number(key)
            key = key if number is None else "e%d" % number
            found.append((head == "join", key, _has(mind, head == "join", key)))
        for item in form:
            _before(mind, item, found)
    return found


def _has(mind, is_group, key):
    """Whether the robot is in a group, or the program of its rule."""
    return key in mind.groups() if is_group else mind.learned.get(key)


def _go_on(node, bid, now, late):
    """late: by how much this look is late, and so may be the next one."""
    values, phase = node.mind.values, bid[_PHASE]
    idle = values[2] or values[3] or not _is_in_force(node.mind, bid)
    if phase == _MEMBER:
        idle = idle or now >= bid[_ENDS] or now + late > bid[_ENDS] + _LATE
    elif phase == _BIDDING:
        idle = idle or now > bid[_UNTIL]
    if idle:
        bid[_PHASE] = _OUT
    if bid[_PHASE] == _OUT:
        _part(node, bid)
    _say(node, bid, now)
    if bid[_PHASE] == _OUT and not bid[_FAREWELLS]:
        node.bids.remove(bid)


def _is_in_force(mind, bid):
    """Whether something is left of what the command has made, if it has made anything."""
    return not bid[_MADE] or any([_has(mind, each[0], each[1]) is each[2] for each in bid[_MADE]])


def _part(node, bid):
    """End what the command has made; answer if that has not been done."""
    node.end(bid)
    if not bid[_ANSWERED]:
        bid[_ANSWERED] = True
        if bid[_WHY]:
            node.answer(bid[_POLL], "fault", None, _ENDED[bid[_WHY] - _STOPPED])
        else:
            node.answer(bid[_POLL], "not matched", None, "", {"outbid": bid[_OUTBID]})


def _say(node, bid, now):
    phase = bid[_PHASE]
    if now < bid[_NEXT] or (phase == _BIDDING and bid[_BEATEN]):
        return
    if any([each[1] == _REQUEST for each in node.out]):
        return  # it waits to be signed: with more beats behind it, it would be too old to be named
    bid[_FAREWELLS] -= phase == _OUT
    if phase == _BIDDING:
        pause = _SOON if now < bid[_HEARD] + _QUIET else _SELDOM
    else:
        pause = min(max(bid[_LEASE] // 10, _SOON), 5000)
    bid[_NEXT] = now + pause
    bid[_BEAT] += 1
    bid[_SENT] = bid[_SENT][-7:] + [now]
    _, epoch, caller, number = bid[_WHICH]
    epoch = 0 if "hops" in bid[_POLL][8] else epoch
    body = encode({"bid": [caller, epoch, number, bid[_BEAT], _SAYS[phase], float(bid[_COST])]})
    if len(node.out) < _MAX_OUT:
        node.out.insert(0, [now, _REQUEST, now + 5000, "", body])


def _next(node):
    """When there is something to do again."""
    times = [0]
    for bid in node.bids:
        if bid[_PHASE] != _BIDDING or not bid[_BEATEN]:
            times.append(bid[_NEXT])
        if bid[_PHASE] != _OUT:
            times.append(bid[_ENDS] if bid[_PHASE] == _MEMBER else bid[_UNTIL] + 1)
    return min(times[1:]) if len(times) > 1 else 0
