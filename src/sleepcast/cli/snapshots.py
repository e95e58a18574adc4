"""The snapshot that a run is to take: where it goes, and when."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from sleepcast.cli.streams import complain
from sleepcast.core.errors import MisuseError
from sleepcast.loop import Swarm, save, snapshot
from sleepcast.loop.snapshots import SnapshotLostError


@dataclass(frozen=True, slots=True)
class Keeping:
    """A snapshot that is to be taken: into which file, and at which simulated time (s; None: at the end)."""

    file: Path
    at: float | None = None

    def check_place(self) -> None:
        """Raises MisuseError where nothing can be written: better now than after a long run."""
        file = Path(os.path.realpath(self.file))
        if not file.parent.is_dir():
            raise MisuseError(
                f"--snapshot {self.file}: there is no folder {file.parent}; make it, or give another name"
            )
        if file.exists() and not file.is_file():
            raise MisuseError(f"--snapshot {self.file}: that is no file; give another name")
        if not os.access(file.parent, os.W_OK):
            raise MisuseError(f"--snapshot {self.file}: nothing can be written in {file.parent}; give another folder")

    def tick(self, first: int, ticks: int, tick: float) -> int:
        """The tick after which it is taken, in a run of so many from the `first` on. tick: s in each. Raises
        MisuseError for a time at which the run does not come by."""
        last = first + ticks
        if self.at is None:
            return last
        found = round(self.at / tick)
        if not first < found <= last:
            raise MisuseError(
                f"--snapshot-at {self.at:g} s: the run goes from {first * tick:g} s to {last * tick:g} s, so take the "
                "snapshot later than its start and not later than its end"
            )
        return found

    def take(self, swarm: Swarm) -> bool:
        """Take it; gives whether that was done, having said on standard error why not."""
        try:
            save(snapshot(swarm), self.file)
        except SnapshotLostError as error:
            complain(str(error))
            return False
        return True
