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

from sleepcast.clock import UnixClock
from sleepcast.station import Event
from sleepcast.station.sqlite_journal import SqliteJournal

WRITERS = 2
LONGEST = 0.03
"""Seconds that a writer lives at most: it opens the file, and writes up to some dozens of entries."""


def write(file: Path, name: str, shown: int) -> None:
    """Write for ever, now and then many entries together or into a new file, and show what is written."""
    journal = SqliteJournal(file, UnixClock())
    for number in range(1_000_000):
        texts = [f"{name}.{number}"]
        if number % 7 == 3:
            texts += [f"{name}.{number}.{more}" for more in range(3)]
            with journal.together():
                for text in texts:
                    journal.append(0.0, name, Event.SENT, text=text, details={})
        else:
            journal.append(0.0, name, Event.SENT, text=texts[0], details={"robots": ["r1"] * 50})
        os.write(shown, "".join(f"{text}\n" for text in texts).encode())
        if number % 9 == 5:
            journal.rotate()


def main(file: Path, rounds: int, seed: int) -> None:
    chance = Random(seed)
    shown: list[str] = []
    for turn in range(rounds):
        here, there = os.pipe()
        writers = []
        for writer in range(WRITERS):
            child = os.fork()
            if not child:
                os.close(here)
                write(file, f"w{turn}-{writer}", there)
            writers.append(child)
        os.close(there)
        for child in writers:
            time.sleep(chance.uniform(0.0, LONGEST))
            os.kill(child, signal.SIGKILL)
        for child in writers:
            os.waitpid(child, 0)
        with open(here, encoding="utf-8") as said:
            shown += [line.removesuffix("\n") for line in said if line.endswith("\n")]
    print(json.dumps(shown))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
