"""STOP and RELEASE: which STOPs hold the robot. Numbers decide, not clocks (docs/wire.md, stop and release)."""

from micropython import const

_MAX_MARKS = const(16)
"""Senders, per epoch, whose STOPs are remembered; beyond, the one that has been silent longest is dropped."""


class Latch:
    """holding, ended: rows of [sender, epoch, number]: the latest STOP of each that holds, and up to which all have
    ended."""

    def __init__(self):
        self.holding, self.ended = [], []

    def restore(self, rows):
        """The STOPs that held before a restart. Raises ValueError if these are none."""
        self.holding = [each[:3] for each in _rows(rows)]
        if rows != self.holding:
            raise ValueError

    def stop(self, mark, body):
        """Whether to obey a STOP with this mark, [sender, epoch, number]: always, unless a RELEASE has ended it."""
        mark = _first(mark, body)
        if any([_covers(each, mark) for each in self.ended]):
            return False
        _put(self.holding, mark)
        return True

    def release(self, mark, body):
        """Take a RELEASE; whether no STOP holds any more."""
        own = _first(mark, body)
        ends = [own] + [each[:3] for each in _rows(body.get("ends"))]
        over = [each for each in self.holding if any([_covers(end, each) for end in ends])]
        self.holding = [each for each in self.holding if each not in over]
        for each in over + [own]:
            _put(self.ended, each)
        return not self.holding

    def names(self):
        return ", ".join(["%s-%d.%d" % tuple(each) for each in self.holding])


def _first(mark, body):
    """The mark that counts: of the first copy, if this one is sent again."""
    first, begin = body.get("first"), "%s-%d." % (mark[0], mark[1])
    if isinstance(first, str) and first.startswith(begin) and first[len(begin) :].isdigit():
        return [mark[0], mark[1], min(mark[2], int(first[len(begin) :]))]
    return mark


def _rows(said):
    found = said[:64] if isinstance(said, list) else []
    return [
        each
        for each in found
        if isinstance(each, list) and len(each) >= 3 and isinstance(each[0], str) and isinstance(each[2], int)
    ]


def _covers(mark, other):
    return mark[:2] == other[:2] and mark[2] >= other[2]


def _put(marks, mark):
    """The highest mark of each sender and epoch, the latest ones last."""
    for each in marks:
        if each[:2] == mark[:2]:
            mark = mark if mark[2] >= each[2] else each
            marks.remove(each)
            break
    marks.append(mark)
    del marks[:-_MAX_MARKS]
