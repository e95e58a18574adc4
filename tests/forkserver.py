"""The program under test, forked from a process that has loaded its libraries: to load them takes a quarter of a second
of the processor, and tests start the program a thousand times.

`Popen` and `run` are those of `subprocess`, and the process is a child of ours like any other, with streams, folder,
environment, limits, signals and an end of its own. Another command than `sleepcast`, what is read before a program runs
(`READ_AT_START`), or another system than Linux: such a process is started as usual. A test of the start itself, of how
much is loaded, or of two runs that must not share the seed of Python's hashes takes `subprocess`.
"""

from __future__ import annotations

import atexit
import ctypes
import gc
import os
import pickle
import re
import resource
import runpy
import shlex
import signal
import socket
import subprocess
import sys
import threading
import warnings
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import import_module
from io import TextIOWrapper
from typing import Any

FOREGROUND = ["env", "--default-signal=INT,TERM"]
"""What a shell does for a program in the foreground, and the server does for each."""
READ_AT_START = ("LANG", "LC_", "LD_", "NPY_", "NUMBA_", "OPENBLAS_", "PYTHON", "TZ")
"""How the names of variables begin that the interpreter, the loader and libraries read before the program runs."""
DONE_AFTERWARDS = ("PYTHONPATH", "PYTHONWARNINGS")
"""Those of them that the server has not got, and whose folders and filters the process adds when it begins."""
SIGNS = re.compile(r"[^\w\s./:=,@%+'\"-]")
"""What may mean something to a shell, where it is not between single quotes."""
LIMITS = [getattr(resource, name) for name in dir(resource) if name.startswith("RLIMIT_")]
SUBREAPER = 36
"""prctl(2): who is left behind by its parent becomes this process's child."""
COMMANDS = ["console", "eval", "node", "prepare", "run", "send", "stop", "swarm", "watch", "who"]
WORK = ["account", "describe", "headless", "node_life", "page_runs", "standard_memory"]
LOADED = [*(f"cli.{name}" for name in COMMANDS + WORK), "console", "simulator.quiet.blocks", "station.asking"]
"""Modules of sleepcast: the commands that tests start most, and what they import when they run."""


class Popen(subprocess.Popen):  # type: ignore[type-arg]
    """A process of `sleepcast` from the server, or of anything else, started as usual."""

    def _execute_child(self, args: Any, *how: Any) -> None:
        executable, preexec_fn, close_fds, pass_fds, cwd, env, _, _, shell, *rest = how
        *pipes, _, gid, gids, uid, umask, session, group = rest
        special = (executable, preexec_fn, not close_fds, pass_fds, shell, gids)
        special += (gid is not None, uid is not None, umask != -1, group != -1)
        words, folder, surroundings = words_of(args), cwd or os.getcwd(), dict(os.environ if env is None else env)
        if words is None or any(special) or not os.path.isdir(folder) or not is_alike(surroundings):
            super()._execute_child(args, *how)  # type: ignore[misc]
            return
        try:
            streams = [usual if given == -1 else given for usual, given in enumerate((pipes[0], pipes[3], pipes[5]))]
            limits = [resource.getrlimit(each) for each in LIMITS]
            self.pid = server().start((words, os.fspath(folder), surroundings, limits, session), streams)
            self._child_created = True
        finally:
            self._close_pipe_fds(*pipes)  # type: ignore[attr-defined]


def run(command: Sequence[object], **options: Any) -> subprocess.CompletedProcess[Any]:
    """`subprocess.run` with a process from the server, with `input`, `timeout`, `capture_output` and `check`."""
    given, timeout, check = (options.pop(name, None) for name in ("input", "timeout", "check"))
    if options.pop("capture_output", False):
        options |= {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    if given is not None:
        options["stdin"] = subprocess.PIPE
    with Popen(list(map(os.fspath, command)), **options) as process:
        try:
            out, err = process.communicate(given, timeout=timeout)
        except BaseException:
            process.kill()
            raise
    done = subprocess.CompletedProcess(process.args, process.returncode, out, err)
    if check:
        done.check_returncode()
    return done


def in_shell(line: str) -> list[str]:
    """The command that starts what a line of a shell says: `sleepcast` without a shell between, where its line needs
    none."""
    needs_shell = SIGNS.search(re.sub(r"'[^']*'", "", line))
    words = [] if needs_shell else shlex.split(line)
    if words[:1] == ["sleepcast"]:
        return [*FOREGROUND, sys.executable, "-m", *words]
    return [*FOREGROUND, "bash", "-c", line]


def words_of(command: Any) -> list[str] | None:
    """What `sleepcast` is told by this command, or None for another program."""
    if sys.platform != "linux" or isinstance(command, str | bytes | os.PathLike):
        return None
    words = [os.fsdecode(word) for word in command]
    if words[: len(FOREGROUND)] == FOREGROUND:
        del words[: len(FOREGROUND)]
    return words[3:] if words[:3] == [sys.executable, "-m", "sleepcast"] else None


def read_at_start(surroundings: Mapping[str, str]) -> dict[str, str]:
    return {name: value for name, value in surroundings.items() if name.startswith(READ_AT_START)}


def is_alike(surroundings: Mapping[str, str]) -> bool:
    """Whether a process with this environment begins as the server did, or can make up for what the server lacks."""
    ours = server().read_at_start
    lacks = set(DONE_AFTERWARDS) - ours.keys()
    return {name: value for name, value in read_at_start(surroundings).items() if name not in lacks} == ours


@cache
def server() -> Server:
    """The one of this process, for as long as it lives."""
    return Server()


class Server:
    """Our end of the process that has loaded the libraries."""

    def __init__(self) -> None:
        self.read_at_start = read_at_start(os.environ)
        self._line, theirs = socket.socketpair()
        self._one = threading.Lock()
        self._prctl = ctypes.CDLL(None, use_errno=True).prctl
        with theirs:
            command = [sys.executable, __file__, str(theirs.fileno())]
            self._process = subprocess.Popen(command, pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL)
        atexit.register(self.close)

    def close(self) -> None:
        """End the process, which waits for what we ask."""
        self._line.shutdown(socket.SHUT_RDWR)  # whoever was forked from us has this end as well
        self._line.close()
        self._process.wait()

    def start(self, what: object, streams: Sequence[int]) -> int:
        """Start a process with these three streams; gives its number."""
        data = pickle.dumps(what)
        with self._one:
            self._prctl(SUBREAPER, 1, 0, 0, 0)
            try:
                socket.send_fds(self._line, [len(data).to_bytes(8, "little")], streams)
                self._line.sendall(data)
                number = int.from_bytes(self._line.recv(8, socket.MSG_WAITALL), "little")
            finally:
                self._prctl(SUBREAPER, 0, 0, 0, 0)
        assert number, "the server could not start a process: it says why above"
        return number


def serve(line: socket.socket) -> None:
    """Start what is asked for, until nobody is there to ask. Each is forked by a process between us and it, which ends
    at once: so it becomes a child of whoever asks."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the tests, which then end us
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as sleepcast.__main__ has it
    del sys.path[0]  # where this file is, nothing is for the program
    for name in LOADED:
        import_module(f"sleepcast.{name}")
    gc.collect()
    gc.freeze()
    while True:
        size, streams, _, _ = socket.recv_fds(line, 8, 3)
        if not size:
            return
        what = pickle.loads(line.recv(int.from_bytes(size, "little"), socket.MSG_WAITALL))
        told, tell = os.pipe()
        if not (between := os.fork()):
            if os.fork():
                os._exit(0)
            line.detach()  # all files of the server's are about to be closed
            become(*what, streams, tell)
            return
        os.close(tell)
        os.waitpid(between, 0)
        line.sendall(os.read(told, 8).ljust(8, b"\0"))
        for each in (*streams, told):
            os.close(each)


def become(
    words: list[str],
    folder: str,
    surroundings: dict[str, str],
    limits: list[tuple[int, int]],
    session: bool,
    streams: list[int],
    tell: int,
) -> None:
    """Be the process `python -m sleepcast WORDS`. tell: where our number is wanted, once we are ready for signals."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if session:
        os.setsid()
    for limit, wanted in zip(LIMITS, limits, strict=True):
        if resource.getrlimit(limit) != wanted:
            resource.setrlimit(limit, wanted)
    os.chdir(folder)
    os.write(tell, os.getpid().to_bytes(8, "little"))
    for number, each in enumerate(streams):
        os.dup2(each, number)
    os.closerange(3, os.sysconf("SC_OPEN_MAX"))
    added = {name: surroundings[name] for name in DONE_AFTERWARDS if name in surroundings and name not in os.environ}
    os.environ.clear()
    os.environ.update(surroundings)
    begin_anew(words, folder)
    make_up_for(added)
    runpy.run_module("sleepcast", run_name="__main__", alter_sys=True)


def begin_anew(words: list[str], folder: str) -> None:
    """What Python has noted of its start."""
    sys.argv, sys.orig_argv = ["-m", *words], [sys.executable, "-m", "sleepcast", *words]
    sys.path.insert(0, folder)
    if "multiprocessing.process" in sys.modules:
        sys.modules["multiprocessing.process"].ORIGINAL_DIR = folder
    for number, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        before, buffer = getattr(sys, name), open(number, f"{mode}b", closefd=False)  # noqa: SIM115 - never closed
        buffer.raw.name = f"<{name}>"
        at_once = number == 2 or buffer.isatty()
        now = TextIOWrapper(buffer, before.encoding, before.errors, newline="\n", line_buffering=at_once)
        now.mode = mode
        setattr(sys, name, now)
        setattr(sys, f"__{name}__", now)


def make_up_for(added: Mapping[str, str]) -> None:
    """Do what the interpreter does at its start with these variables."""
    if folders := added.get("PYTHONPATH"):
        sys.path[1:1] = folders.split(os.pathsep)
    if filters := added.get("PYTHONWARNINGS"):
        sys.warnoptions[:] = filters.split(",")
        warnings._processoptions(sys.warnoptions)  # type: ignore[attr-defined]


if __name__ == "__main__":
    serve(socket.socket(fileno=int(sys.argv[1])))
