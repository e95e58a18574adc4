"""The commands of each sender in their order: which can be obeyed, which wait, and which are missing.

Times are milliseconds of Unix time. Messages are as in `node.py`.
"""

import random

from micropython import const

from sleepnode.trust import make_room

_MAX_STREAMS = const(8)
_TOLD_FOR = const(600000)
"""How long what others tell is remembered: it is not verified."""
_MAX_WAITING = const(4)
_MAX_WANTED = const(16)
_SLACK = const(250)
_SOONEST, _BEHIND, _LATEST = 400, 2000, 60000
_ENOUGH = const(2)
_OLD, _QUIET, _PATIENCE = 60000, 2000, 30000
"""See `Streams.is_catching_up`: how long ago an old command was issued, and how long after it more may come."""
_DONE = const(0)
_RULES = const(1)
_WAITING = const(2)
_WANTED = const(3)
"""Places in a stream: numbers of the latest command and of the latest standing one that were obeyed or skipped, waiting
commands by number, and missing ones: number to [when to ask, the pause after that, until when]."""


def _late(x, y):
    """A random time, seldom early: of many robots a few ask, and the others hear them."""
    return x + (y - x) * max(random.random(), random.random())


def link(body, number):
    """After which number a command comes, sent when, until when, and after which standing one."""
    after, rules = body.get("after"), body.get("rules")
    if isinstance(after, int) and isinstance(rules, int) and 0 <= rules <= after < number:
        return after, _time(body.get("sent")), _time(body.get("until")), rules
    return 0, None, None, 0


def _time(seconds):
    return int(seconds * 1000) if isinstance(seconds, (int, float)) else None


class Streams:
    """since: when the robot began to listen. missed: how many commands never came in time. theirs: by the key of who
    has told, the latest standing commands that others have. eager: whether to ask for more of them as soon as none
    waits.

    A digest here says what this robot lacks, and it can resend nothing: so it follows digests of others that tell of
    more, not each standing command."""

    def __init__(self, since):
        self.since, self.missed = since, 0
        self.eager, self.theirs, self._old, self._told = False, {}, None, 0
        self._streams = {}
        self._alike, self._interval, self._speaks, self._ends = 0, _SOONEST, 0, 0
        self.news(since)

    def of(self, name):
        stream = self._streams.get(name)
        if stream is None:
            if len(self._streams) >= _MAX_STREAMS:
                make_room("streams", self._streams, name[0])
            stream = self._streams[name] = [0, 0, {}, {}]
        return stream

    def take(self, name, number, standing, body, message, now):
        """The commands that can be obeyed now that this one has come, in order; and the one for which there is no room
        any more, None for none: it has to come again."""
        stream = self.of(name)
        if number <= stream[_DONE]:
            return [], None
        waiting = stream[_WAITING]
        waiting[number] = standing, body, message
        stream[_WANTED].pop(number, None)
        due = self._advance(stream, now)
        return due, waiting.pop(max(waiting))[2] if len(waiting) > _MAX_WAITING else None

    def has(self, key, epoch, number):
        """Whether a command waits, or was obeyed or skipped."""
        stream = self._streams.get((key, epoch))
        return stream is not None and (number <= stream[_DONE] or number in stream[_WAITING])

    def is_too_early(self, key, epoch, number):
        """Whether there is no room for a command to wait for those before it."""
        waiting = self._streams[key, epoch][_WAITING] if (key, epoch) in self._streams else ()
        return len(waiting) >= _MAX_WAITING and number > max(waiting)

    def expire(self, now):
        """The commands that need not wait any longer."""
        due = []
        for stream in self._streams.values():
            if stream[_WAITING]:
                due += self._advance(stream, now)
        return due

    def _advance(self, stream, now):
        due = []
        while stream[_WAITING]:
            number = min(stream[_WAITING])
            standing, body, message = stream[_WAITING][number]
            after, sent, until, rules = link(body, number)
            if rules > stream[_RULES]:
                self._want(stream, rules, now, None)
                break
            if after > stream[_DONE] and (sent is None or sent >= self.since):
                if until is None or now <= until + _SLACK:
                    self._want(stream, after, now, until)
                    break
                self.missed += 1
            del stream[_WAITING][number]
            stream[_DONE] = number
            for old in [each for each in stream[_WANTED] if each <= number]:
                del stream[_WANTED][old]
            if standing:
                stream[_RULES] = number
                self.eager = self.is_behind()
                if message[4] < 1000 * (now - _OLD):
                    self._old = now
            due.append(message)
        return due

    def _want(self, stream, number, now, until):
        if number not in stream[_WANTED] and len(stream[_WANTED]) < _MAX_WANTED:
            stream[_WANTED][number] = [now + _late(20, 80), 150, until]

    def wanted(self, now):
        """What to request now, as in a request's body; [] for nothing."""
        requests, behind = [], self.is_behind()
        for name, stream in self._streams.items():
            numbers = []
            for number, want in list(stream[_WANTED].items()):
                if want[2] is not None and want[2] + _SLACK < now:
                    del stream[_WANTED][number]
                elif want[0] <= now and not (behind and want[2] is None):  # our digests ask for standing ones then
                    numbers.append(number)
                    want[0] = now + _late(want[1] // 2, want[1])
                    want[1] = min(2 * want[1], 2000)
            if numbers:
                requests.append([name[0], name[1], numbers])
        return requests

    # ---- digests

    def have(self):
        """What a digest says: each stream's latest standing command."""
        return sorted([[name[0], name[1], each[_RULES]] for name, each in self._streams.items() if each[_RULES]])

    def matters(self, have, may):
        """Whether it is worth verifying somebody's digest: it tells of more than we know of, or spares us our own."""
        theirs = self._by_stream(have, may)
        spares = self._speaks is not None and self._alike < _ENOUGH
        return self._tells_more(theirs, True) or (spares and theirs == self._by_stream(self.have(), may))

    def compare(self, have, may, now, teller):
        """A digest of this key: ask soon if it tells of more than we have. may: tells whether a key may send standing
        commands."""
        theirs = self._by_stream(have, may)
        if self._tells_more(theirs, False):
            make_room("told", self.theirs, teller, theirs)
            self._told = now
            self.news(now)
        elif theirs == self._by_stream(self.have(), may):
            self._alike += 1

    def _by_stream(self, have, may):
        numbers = {}
        for each in have if isinstance(have, list) else ():
            if isinstance(each, list) and len(each) == 3 and isinstance(each[2], int) and may(each[0]):
                numbers[each[0], each[1]] = each[2]
        return numbers

    def is_behind(self):
        """Whether others are known to have more standing commands."""
        return any([self._tells_more(theirs, False) for theirs in self.theirs.values()])

    def is_catching_up(self, now):
        """Whether its rules must wait: it takes standing commands that are old, and one to come may replace them."""
        since = _PATIENCE if self._old is None else now - self._old
        return since < _PATIENCE and (since < _QUIET or self.is_behind())

    def _tells_more(self, theirs, known):
        """Whether there is more than we have, and if `known`, than is known to be there."""
        ours = self._streams
        for each in theirs:
            most = ours[each][_RULES] if each in ours else 0
            if known:
                most = max([most] + [told.get(each, 0) for told in self.theirs.values()])
            if theirs[each] > most:
                return True
        return False

    def news(self, now):
        """There is news: send a digest soon."""
        if self._ends <= now or self._interval > _SOONEST:
            self._begin(now, _SOONEST)

    def is_due(self, now):
        """Whether to send a digest now."""
        if now - self._told > _TOLD_FOR:
            self.theirs = {}
        speak = self._speaks is not None and self._speaks <= now
        if speak:
            self._speaks = None
            speak = self._alike < _ENOUGH
        if self._ends <= now:
            most = _BEHIND if self.is_behind() else _LATEST
            self._begin(now, min(2 * self._interval, most))
        return speak

    def _begin(self, now, wait):
        self._interval, self._ends, self._alike = wait, now + wait, 0
        self._speaks = now + _late(wait // 2, wait)
