"""STOP and RELEASE: which STOPs hold the robot. Numbers decide, not clocks (docs/wire.md, stop and release)."""

from micropython import const

from sleepnode.reader import unload
from sleepnode.trust import make_room

_MAX_MARKS = const(16)
"""Senders, per epoch, whose STOPs are remembered; beyond, one of the key that has the most is dropped, and if it holds,
counted."""
_FORGOTTEN = "?"
"""Stands in the place of the sender of those."""


class Latch:
    """holding, ended: rows of [sender, epoch, number, key]: the latest STOP of each that holds, and up to which all
    have ended. key: of its sender, as text; it does not say which STOP it is."""

    def __init__(self):
        self.holding, self.ended = [], []

    def stop(self, mark, body):
        """Whether to obey a STOP with this mark, [sender, epoch, number, key]: always, unless a RELEASE has ended
        it."""
        mark = first(mark, body)
        if mark[0] == _FORGOTTEN:  # nobody has this name
            make_room("forget", self.holding, self.ended)
            return True
        if any([covers(each, mark) for each in self.ended]):
            return False
        put(self.holding, mark, self.ended)
        return True

    def release(self, mark, body):
        """Take a RELEASE; whether no STOP holds any more."""
        try:
            from sleepnode.releasing import release

            release(self, mark, body)
        finally:
            unload("keeping", "releasing")
        return not self.holding

    def rows(self):
        """What holds, for others."""
        return [each[:3] for each in self.holding]


def first(mark, body):
    """The mark that counts: of the first copy, if this one is sent again."""
    first, begin = body.get("first"), "%s-%d." % (mark[0], mark[1])
    if isinstance(first, str) and first.startswith(begin) and first[len(begin) :].isdigit():
        return [mark[0], mark[1], min(mark[2], int(first[len(begin) :])), mark[3]]
    return mark


def covers(mark, other):
    return mark[:2] == other[:2] and mark[2] >= other[2]


def put(marks, mark, ended):
    """Keep the highest mark of each sender and epoch, the latest ones last. ended: as in `crowding.marks`."""
    for each in marks:
        if each[:2] == mark[:2]:
            mark = mark if mark[2] >= each[2] else each
            marks.remove(each)
            break
    marks.append(mark)
    if len(marks) >= _MAX_MARKS:  # one place is for those that are counted
        make_room("marks", marks, _MAX_MARKS, ended)
