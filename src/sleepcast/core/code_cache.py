"""Native code that outlives a process: one private folder for each sort of it, in the user's cache folder.

What lies there is run, so a folder or a file counts only if nobody but this user (or root) can write to it. It is
opened once, judged, and then used through its descriptor, so that it cannot be replaced meanwhile.
Each file opens with a digest of its name and of what follows: one that was cut short or damaged is no file.

Nothing here ever fails: code that cannot be kept, for want of room or of permission, is made again by the next process.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from secrets import token_hex
from stat import S_ISDIR, S_ISREG, S_IWGRP, S_IWOTH

from sleepcast.core.files import cache_folder

MOST = 32 * 1024 * 1024
"""Bytes of one sort of code at most; what was not used for longest goes first. All kernels of one version take some 3
MB, the rules of one scenario some 30 kB: room for ten versions, or for a thousand scenarios."""
LONGEST = 8 * 1024 * 1024
"""Bytes of one piece at most: some ten times the largest there is."""
DIGEST = sha256().digest_size


class CodeCache:
    """The pieces of one sort, by name. A name tells everything that the code depends on."""

    def __init__(self, sort: str) -> None:
        self._sort = sort

    @property
    def folders(self) -> tuple[Path, Path]:
        """Where code is kept, and where else if it cannot be kept there."""
        other = Path(tempfile.gettempdir()) / f"sleepcast-{os.geteuid()}-{self._sort}"
        return cache_folder() / self._sort, other

    def load(self, name: str) -> bytes | None:
        """The piece of this name; None if there is none."""
        for folder in self.folders:
            with suppress(OSError), _opened(folder) as place, open(_file(name, place), "rb") as file:
                data = file.read(DIGEST + LONGEST)
                if data[:DIGEST] == _digest(name, data[DIGEST:]):
                    with suppress(OSError):
                        os.utime(file.fileno())  # it has been used
                    return data[DIGEST:]
        return None

    def holding(self, prefix: str) -> Path | None:
        """The folder with pieces whose names begin so; None if there are none."""
        for folder in self.folders:
            with suppress(OSError), _opened(folder) as place:
                if any(name.startswith(prefix) for name in os.listdir(place)):
                    return folder
        return None

    def count(self, prefix: str) -> int:
        """How many pieces there are whose names begin so."""
        found = 0
        for folder in self.folders:
            with suppress(OSError), _opened(folder) as place:
                found += sum(name.startswith(prefix) for name in os.listdir(place))
        return found

    def save(self, name: str, data: bytes) -> bool:
        """Keep a piece under this name; gives whether that could be done."""
        if len(data) > LONGEST:
            return False
        for folder in self.folders:
            with suppress(OSError):
                folder.parent.mkdir(parents=True, exist_ok=True)
                with suppress(FileExistsError):
                    folder.mkdir(mode=0o700)
                with _opened(folder) as place:
                    _replace(place, name, _digest(name, data) + data)
                    _make_room(place)
                return True
        return False


@contextmanager
def _opened(folder: Path) -> Iterator[int]:
    """The descriptor of a folder. Raises OSError for one that somebody else can write to."""
    place = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        _judge(os.fstat(place))
        yield place
    finally:
        os.close(place)


def _file(name: str, place: int) -> int:
    """The descriptor of a file in a folder. Raises OSError for one that somebody else can write to."""
    file = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, dir_fd=place)
    try:
        _judge(os.fstat(file))
    except OSError:
        os.close(file)
        raise
    return file


def _judge(found: os.stat_result) -> None:
    plain = S_ISDIR(found.st_mode) or S_ISREG(found.st_mode)
    if not plain or found.st_uid not in (os.geteuid(), 0) or found.st_mode & (S_IWGRP | S_IWOTH):
        raise PermissionError("somebody else can write to it")


def _digest(name: str, data: bytes) -> bytes:
    return sha256(name.encode() + b"\0" + data).digest()


def _replace(place: int, name: str, data: bytes) -> None:
    """Let a file of the folder hold this, all of it or nothing."""
    beside = f".{token_hex(8)}.new"
    try:  # from before there is a file: who is interrupted leaves none behind
        file = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600, dir_fd=place)
        with open(file, "wb") as output:
            output.write(data)
        os.replace(beside, name, src_dir_fd=place, dst_dir_fd=place)
    except BaseException:
        with suppress(OSError):
            os.unlink(beside, dir_fd=place)
        raise


def _make_room(place: int) -> None:
    """Take away what was not used for longest, until the rest is no more than `MOST`."""
    found = []
    with os.scandir(place) as entries:
        for entry in entries:
            with suppress(FileNotFoundError):  # another process takes away as well
                status = entry.stat(follow_symlinks=False)
                found.append((status.st_mtime, status.st_size, entry.name))
    room = MOST
    for _, size, name in sorted(found, reverse=True):
        room -= size
        if room < 0:
            with suppress(OSError):
                os.unlink(name, dir_fd=place)
