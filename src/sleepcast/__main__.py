"""`python -m sleepcast` is the command `sleepcast`, and so is the script that an installation makes.

The command's libraries take a moment to load. Ctrl-C ends the process on the spot meanwhile: raised as an exception in
the middle of an import, it would come out as a traceback, or be swallowed. SIGTERM ends it as Ctrl-C does, here and
later, so that bodies are stopped and files are closed.

The folder in which it is started may be anybody's: no module is imported from there, neither here nor by the processes
that it starts.
"""

import atexit
import gc
import os
import signal
import sys
from contextlib import suppress
from typing import NoReturn

USUAL = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
"""What signals do, unless the process was started with another setting, which is kept."""


def run() -> NoReturn:
    """Load and run the command, and end the process. As Python would, it waits for threads that still work, lets those
    of pools end, and tells whoever wants to be told. What Python would take apart then, object by object, goes with the
    process anyway."""
    status = start()
    if "threading" in sys.modules:
        with suppress(BaseException):  # Ctrl-C and SIGTERM: whoever presses it waits no longer
            sys.modules["threading"]._shutdown()
    atexit._run_exitfuncs()
    for stream in filter(None, (sys.stdout, sys.stderr)):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(status)


def start() -> int:
    """Load the command and run it on this process's arguments; gives the exit status."""
    _import_nothing_from_here()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # nothing here multiplies matrices, and threads take time
    ours = [each for each, usual in USUAL.items() if signal.getsignal(each) is usual]
    for each in ours:
        signal.signal(each, lambda number, frame: os._exit(128 + number))
    from sleepcast.core.garbage import SELDOM

    gc.set_threshold(*SELDOM)
    from sleepcast.cli import main
    from sleepcast.cli.interrupts import INTERRUPTED, terminate

    try:
        for each in ours:
            signal.signal(each, terminate if each is signal.SIGTERM else signal.default_int_handler)
        status = main()
    except KeyboardInterrupt:  # pressed just before the command minds it, or as it ends
        status = INTERRUPTED
    gc.freeze()  # nobody looks for garbage at the end: all of it goes anyway, and after a run the search takes longest
    return status


def _import_nothing_from_here() -> None:
    """`python -m` looks for modules in the folder in which it is started, and so do the processes that
    `multiprocessing` starts."""
    os.environ.setdefault("PYTHONSAFEPATH", "1")
    try:
        here, home = os.getcwd(), os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    except OSError:  # the folder is gone
        return
    if not sys.flags.safe_path and sys.path and sys.path[0] in ("", here) and here != home:
        del sys.path[0]


if __name__ == "__main__":
    run()
