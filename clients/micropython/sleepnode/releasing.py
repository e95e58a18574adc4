"""Which STOPs a RELEASE ends. Loaded for one, and let go again."""

from sleepnode.keeping import marks_in
from sleepnode.latch import covers, first, put


def release(latch, mark, body):
    """Take a RELEASE with this mark: see `Latch`."""
    own = [first(mark, body)] if mark[0] != "?" else []
    ends = own + [each[:3] for each in marks_in(body.get("ends"))]
    over = [each for each in latch.holding if any([covers(end, each) for end in ends])]
    latch.holding = [each for each in latch.holding if each not in over]
    for each in over + own:
        put(latch.ended, each, None)


def holding(node):
    """The STOPs that hold, for a person."""
    return ", ".join(["%s-%d.%d" % tuple(each[:3]) for each in node.latch.holding])
