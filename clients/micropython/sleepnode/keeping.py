"""What outlasts a restart: whom the robot trusts, and which STOPs hold it. Loaded for one file and let go again."""

import json
import os


def keep(file, data):
    """Write a file as a whole: if the power fails, the one of before is there, or the new one beside it. Raises
    OSError."""
    with open(file + ".new", "w") as opened:
        json.dump(data, opened)
    try:
        os.rename(file + ".new", file)
    except OSError:  # a FAT file system replaces no file
        os.remove(file)
        os.rename(file + ".new", file)


def kept(file):
    """What such a file holds. Raises OSError if there is none, and ValueError for a damaged one."""
    for each in (file, file + ".new"):
        try:
            with open(each) as opened:
                return json.load(opened)
        except OSError as error:
            lost = error
    raise lost


def stops(file):
    """Which STOPs held before a restart, as rows of a latch; those of an earlier version have no key."""
    try:
        rows = kept(file)
        if rows == marks_in(rows):
            return [each if len(each) > 3 else each + [""] for each in rows]
    except OSError:
        return []  # none was ever written
    except (ValueError, MemoryError):
        pass
    return [["?", 0, 0, ""]]  # a RELEASE that names it ends it: desks ask what holds


def marks_in(said):
    """The rows of STOPs in what a file or a message says."""
    rows = said[:64] if isinstance(said, list) else []
    return [
        each
        for each in rows
        if isinstance(each, list) and len(each) >= 3 and isinstance(each[0], str) and isinstance(each[2], int)
    ]
