"""A how-to is followed as a reader follows it: word by word, from its first line on, with programs in their terminals.

    terminal    programs that go on running, each in a terminal of its own, and what they print first; one of the same
                line as an earlier one takes its place, after a Ctrl-C
    air         commands, each after `$ `, and what they print; `...` stands for anything

What these say without a channel is said on a channel of our own.
"""

from __future__ import annotations

import doctest
import os
import re
import shlex
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO, TextIOWrapper
from pathlib import Path

import click
import pytest

import forkserver
from channel.test_udp import free_port
from clients import board
from installing import install
from sleepcast.cli import main, program
from test_docs import ROOT, SHELL, blocks_of, write_files

PAGES = {
    "first-study": 5,
    "on-the-air": 30,
    "ros2": 4,
    "run-experiments": 8,
    "small-computers": 6,
    "tak": 3,
    "use-from-python": 1,
    "write-a-bridge": 3,
    "write-a-plug-in": 2,
}
"""Commands at least that each page shows."""
FIGURE = "docs/pictures/first-study.svg"
USUAL, GROUP = "239.255.83.76 47123", "239.255.83.79"
CONFIGURED = '"address": "{}", "port": {}'
"""The same in the settings of a small computer."""
SAID = "udp://239.255.83.76:47123?interface=lo"
URI = f"udp://{GROUP}:{{}}?interface=lo"
LISTENS = re.compile(r"--port ([1-9]\d*)")
"""A port of this computer at which a page lets a program listen; ours takes one that is free."""
TOO_LATE = re.compile(
    "silent [1-9]|cannot say [1-9]|no robot (was heard|has told of)|none of (the [0-9]+ robots|them knows)"
    "|does not answer"
)
"""What the account of a command says if robots have not told enough in time, as on a busy machine."""
LOOKS = re.compile(" watch --once| --dry-run")
"""Commands that only look at what is there now: what is still to come is seen at another look."""
LONGEST = 240.0
"""Seconds to wait for what a program prints at its start, for its end, or for robots that tell enough."""


def shown_alike(shown: str, printed: str) -> bool:
    return doctest.OutputChecker().check_output(shown, printed, doctest.ELLIPSIS)


@dataclass
class Reader:
    """Somebody who follows a page, with settings, data and a channel of his own."""

    folder: Path
    port: int
    added: Path
    """Where packages are that the page tells its reader to install."""
    running: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)
    within: float = 0.0
    """Seconds in which robots are to answer, 0 for as many as a command takes by itself."""
    called: set[str] = field(default_factory=set)
    """The commands that have been called in a process of their own."""

    def on_our_channel(self, line: str) -> tuple[str, str]:
        """A line as we start it, and the command that it calls, if that is one of ours on a channel."""
        words, ours = shlex.split(line, comments=True), ""
        if words[0] == "sleepcast":
            _, command, _ = program.resolve_command(click.Context(program), words[1:])
            assert command is not None
            last = words[1]
            if isinstance(command, click.Group):
                last, command = words[2], command.commands[words[2]]
            if any(each.name == "channel" for each in command.params):
                within = f" --within {self.within}s" if self.within else ""
                line, ours = line.replace(f" {last}", f" {last} --channel '{URI.format(self.port)}'{within}", 1), last
        line = line.replace(USUAL, f"{GROUP} {self.port}")
        return line.replace(CONFIGURED.format(*USUAL.split()), CONFIGURED.format(GROUP, self.port)), ours

    def surroundings(self) -> dict[str, str]:
        path = f"{self.added}/bin{os.pathsep}{SHELL['PATH']}"
        changes = {"HOME": str(self.folder), "PYTHONWARNINGS": "ignore", "PYTHONPATH": str(self.added), "PATH": path}
        return SHELL | changes

    def start(self, line: str, output: int) -> subprocess.Popen[bytes]:
        line, _ = self.on_our_channel(line)
        return forkserver.Popen(
            forkserver.in_shell(line),
            cwd=self.folder,
            env=self.surroundings(),
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
        )

    def printed(self, line: str) -> str:
        """What a command prints until its end. The first one of its name has a process of its own; in the next ones,
        most of the time would go into loading the same libraries once more."""
        ours, command = self.on_our_channel(line)
        if not command or command not in self.called:
            self.called.add(command)
            return self.start(line, subprocess.PIPE).communicate(timeout=LONGEST)[0].decode()
        screen = TextIOWrapper(BytesIO(), encoding="utf-8", write_through=True)
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(self.folder)
            for name in os.environ.keys() - self.surroundings().keys():
                patch.delenv(name)
            for name, value in self.surroundings().items():
                patch.setenv(name, value)
            for name, stream in ("stdin", TextIOWrapper(BytesIO())), ("stdout", screen), ("stderr", screen):
                patch.setattr(sys, name, stream)
            main(shlex.split(ours, comments=True)[1:])
        return screen.buffer.getvalue().decode()  # type: ignore[attr-defined]

    def leave_running(self, line: str, shown: str) -> None:
        """Start a program in a terminal of its own, and read there what it says."""
        if line in self.running:
            self.end(self.running.pop(line))
        screen = self.folder / f"terminal-{len(list(self.folder.glob('terminal-*')))}"
        with screen.open("wb") as output:
            process = self.running[line] = self.start(line, output.fileno())
        until = time.monotonic() + LONGEST
        while not shown_alike(f"{shown}...", screen.read_text()):
            assert time.monotonic() < until, f"{line}\nprinted\n{screen.read_text()}\nwanted\n{shown}"
            assert process.poll() is None, f"{line}\nended: {screen.read_text()}"
            time.sleep(0.05)

    def run(self, line: str, shown: str) -> None:
        """Run a command to its end, and read what it says; again if robots were too late for it, or it only looks.
        After longer and longer pauses, since a slow robot also has to answer all that came before, and with more time
        for answers."""
        until, printed, self.within = time.monotonic() + LONGEST, None, 0.0
        while printed is None or not shown_alike(shown, printed):
            failed = f"{line}\nprinted\n{printed}\nwanted\n{shown}"
            assert printed is None or TOO_LATE.search(printed) or LOOKS.search(line), failed
            assert time.monotonic() < until, failed
            if printed is not None:
                self.within = min(2.0 * self.within or 0.5, 8.0)
                time.sleep(self.within)
            printed = self.printed(line)

    def end(self, process: subprocess.Popen[bytes]) -> None:
        process.send_signal(signal.SIGINT)
        process.wait(LONGEST)


@pytest.fixture
def reader(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Reader]:
    someone = Reader(tmp_path, free_port(), tmp_path_factory.mktemp("added"))
    monkeypatch.syspath_prepend(someone.added)  # commands that the page's packages add are looked up here, too
    yield someone
    for process in someone.running.values():
        process.kill()
        process.wait()


@pytest.mark.parametrize("page", PAGES)
def test_a_how_to_on_the_air_can_be_followed(reader: Reader, page: str) -> None:
    if page == "small-computers":
        board.needed()
        (reader.folder / "clients").symlink_to(ROOT / "clients")
    if page == "ros2":
        pytest.importorskip("cyclonedds", reason="cyclonedds is not installed here")
    followed, path = 0, ROOT / "docs" / "howto" / f"{page}.md"
    free = {port: str(free_port(socket.SOCK_STREAM)) for port in LISTENS.findall(path.read_text())}
    write_files(path, reader.folder)
    for package in re.findall(r"`pip install \./(examples/\w+)`", path.read_text()):
        install(ROOT / package, reader.added)
    for file in reader.folder.glob("*.py"):
        file.write_text(file.read_text().replace(SAID, URI.format(reader.port)))
    for block in blocks_of(path):
        for session in re.split(r"^\$ ", block.text, flags=re.MULTILINE)[1:]:
            here = re.sub(r"\d+", lambda number: free.get(number[0], number[0]), session)
            line, _, shown = here.partition("\n")
            if block.sort == "terminal":
                reader.leave_running(line, shown)
            elif block.sort == "air":
                reader.run(line, shown)
                followed += 1
    assert followed >= PAGES[page]
    if page == "first-study":
        assert followed < 10
        drawn, shown = ((folder / name).read_text() for folder, name in ((reader.folder, "apart.svg"), (ROOT, FIGURE)))
        for figure in (drawn, shown):
            assert "PolyCollection" in figure, "the band"
            assert "constants.NEAR (m)" in figure
