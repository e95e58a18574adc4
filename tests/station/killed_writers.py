"""Writers of a journal, killed at moments of chance; what they had shown until then.

Run by a test in a process of its own, since it forks: `python -m station.killed_writers FILE ROUNDS SEED`. Prints one
JSON object: the texts that writers have shown, each after `append` had returned.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from pathlib import Path
from random import Random
from typing import BinaryIO

from sleepcast.core.clock import UnixClock
from sleepcast.station import JournalEvent
from sleepcast.station.journal.file import SqliteJournal
from sleepcast.station.journal.journal import PendingEntry

WRITERS = 2
MOST = 12
"""Entries that a writer shows before it is killed, at most."""
MOMENT = 0.002
"""Seconds after them, at most: the time of one entry, or of a new file."""


def write(file: Path, name: str, shown: int) -> None:
    """Write for ever, now and then many entries together or into a new file, and show what is written."""
    journal = SqliteJournal(file, UnixClock())
    for number in range(1_000_000):
        texts = [f"{name}.{number}"]
        if number % 7 == 3:
            texts += [f"{name}.{number}.{more}" for more in range(3)]
            journal.append(*(PendingEntry(0.0, name, JournalEvent.SENT, text=text) for text in texts))
        else:
            journal.append(PendingEntry(0.0, name, JournalEvent.SENT, text=texts[0], details={"robots": ["r1"] * 50}))
        os.write(shown, "".join(f"{text}\n" for text in texts).encode())
        if number % 5 == 4:
            journal.rotate()


def start(file: Path, name: str) -> tuple[int, BinaryIO]:
    """A writer: its process, and where it shows what it has written."""
    here, there = os.pipe()
    child = os.fork()
    if not child:
        os.close(here)
        write(file, name, there)
    os.close(there)
    return child, open(here, "rb", buffering=0)


def main(file: Path, rounds: int, seed: int) -> None:
    chance = Random(seed)
    shown: list[str] = []
    for turn in range(rounds):
        writers = [start(file, f"w{turn}-{writer}") for writer in range(WRITERS)]
        for child, said in writers:
            data, wanted = b"", chance.randrange(MOST)
            while data.count(b"\n") < wanted:
                more = said.read(4096)
                if not more:
                    raise SystemExit(f"writer {child} ended by itself")
                data += more
            time.sleep(chance.uniform(0.0, MOMENT))
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            with said:
                data += said.read()
            shown += [line.decode() for line in data.split(b"\n")[:-1]]
    print(json.dumps(shown))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
