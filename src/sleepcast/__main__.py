"""`python -m sleepcast` is the command `sleepcast`, and so is the script that an installation makes.

The command's libraries take a moment to load. Ctrl-C ends the process on the spot meanwhile: raised as an exception in
the middle of an import, it would come out as a traceback, or be swallowed.
"""

import gc
import os
import signal
import sys

INTERRUPTED = 130


def start() -> int:
    """Load the command and run it on this process's arguments; gives the exit status."""
    ours = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if ours:
        signal.signal(signal.SIGINT, lambda number, frame: os._exit(INTERRUPTED))
    from sleepcast.cli import main

    if ours:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    status = main()
    gc.freeze()  # nobody looks for garbage at the end: all of it goes anyway, and after a run the search takes longest
    return status


if __name__ == "__main__":
    sys.exit(start())
