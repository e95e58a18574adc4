"""Native code that outlives a process: one private folder for each kind of it, in the user's cache folder.

What lies there is run, so a folder or a file counts only if nobody but this user (or root) can write to it. It is
opened once, judged, and then used through its descriptor, so that it cannot be replaced meanwhile.
Each file opens with a digest of its name and of what follows: one that was cut short or damaged is no file.

Keeping code never fails: what cannot be kept, for want of room or of permission, is made again by the next process.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from stat import S_ISDIR, S_ISREG, S_IWGRP, S_IWOTH
from typing import TYPE_CHECKING

from sleepcast.core.files import cache_folder

if TYPE_CHECKING:
    from llvmlite.binding import TargetMachine

MAX_BYTES = 32 * 1024 * 1024
"""Bytes of one kind of code at most; what was not used for longest goes first. All kernels of one version take some 3
MB, the rules of one scenario some 30 kB: room for ten versions, or for a thousand scenarios."""
MAX_PIECE = 8 * 1024 * 1024
"""Bytes of one piece at most: some ten times the largest there is."""
UNSEEN = 32
"""A process looks again at how much is kept after it has kept one part in so many of `MAX_BYTES`: so much more may lie
there for a while, for each process that keeps code at the same time. To look takes longer the more there is."""
DIGEST = sha256().digest_size


class CodeCache:
    """The pieces of one kind, by name. A name tells everything that the code depends on."""

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self._held: dict[Path, tuple[int, int]] = {}
        """By folder: the bytes that lay there when this process looked last, and those that it has kept since."""

    @property
    def folders(self) -> tuple[Path, Path]:
        """Where code is kept, and where else if it cannot be kept there."""
        first, other = self._each()
        return first, other

    def _each(self) -> Iterator[Path]:
        yield cache_folder() / self._kind
        import tempfile  # which takes a while to load, and is seldom needed

        yield Path(tempfile.gettempdir()) / f"sleepcast-{os.geteuid()}-{self._kind}"

    def load(self, name: str) -> bytes | None:
        """The piece of this name; None if there is none."""
        for folder in self._each():
            with suppress(OSError), _opened(folder) as directory, open(_file(name, directory), "rb") as file:
                data = file.read(DIGEST + MAX_PIECE)
                if data[:DIGEST] == _digest(name, data[DIGEST:]):
                    with suppress(OSError):
                        os.utime(file.fileno())  # it has been used
                    return data[DIGEST:]
        return None

    def holding(self, prefix: str) -> Path | None:
        """The folder with pieces whose names begin so; None if there are none."""
        for folder in self._each():
            with suppress(OSError), _opened(folder) as directory:
                if any(name.startswith(prefix) for name in os.listdir(directory)):
                    return folder
        return None

    def names(self, prefix: str) -> list[str]:
        """The names of the pieces that begin so, in the first folder that has some."""
        for folder in self._each():
            with suppress(OSError), _opened(folder) as directory:
                if found := [name for name in os.listdir(directory) if name.startswith(prefix)]:
                    return sorted(found)
        return []

    def save(self, name: str, data: bytes) -> bool:
        """Keep a piece under this name; gives whether that could be done."""
        if len(data) > MAX_PIECE:
            return False
        for folder in self._each():
            with suppress(OSError):
                folder.parent.mkdir(parents=True, exist_ok=True)
                with suppress(FileExistsError):
                    folder.mkdir(mode=0o700)
                with _opened(folder) as directory:
                    _replace(directory, name, _digest(name, data) + data)
                    self._keep_small(folder, directory, DIGEST + len(data))
                return True
        return False

    def _keep_small(self, folder: Path, directory: int, size: int) -> None:
        """See to it that a folder in which so many bytes more are kept does not hold too much."""
        seen, since = self._held.get(folder, (MAX_BYTES, 0))
        if seen + since + size > MAX_BYTES or since + size > MAX_BYTES // UNSEEN:
            self._held[folder] = _make_room(directory), 0
        else:
            self._held[folder] = seen, since + size


def target_machine(level: int = 2) -> TargetMachine:
    """What makes code for this processor, optimised to this level."""
    from llvmlite import binding

    triple, name, features = _here()
    target = binding.Target.from_triple(triple)
    return target.create_target_machine(cpu=name, features=features, opt=level, jit=True)


@cache
def processor() -> str:
    """What machine code for this processor depends on. LLVM tells it, which takes long to load, so once until this
    computer is started anew: then it may be another one."""
    kept, name = CodeCache("processors"), f"{_started()}-{sha256(version_of('llvmlite')).hexdigest()[:16]}"
    known = kept.load(name) if _started() else None
    if known is None:
        known = "\n".join(_here()).encode()
        if _started():
            kept.save(name, known)
    return known.decode()


@cache
def _started() -> str:
    """The number that this computer has got when it was started; empty where the system gives none."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    except OSError:
        return ""


@cache
def _here() -> tuple[str, str, str]:
    """This system, its processor, and what that can do, in LLVM's words; LLVM can make code for them from then on."""
    from llvmlite import binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    return binding.get_process_triple(), binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()


def version_of(library: str) -> bytes:
    """What a library says of its version, without importing it, or reading all that is installed."""
    found = find_spec(library)
    folders = found.submodule_search_locations if found else None
    return b"".join(Path(folder, "_version.py").read_bytes() for folder in folders or ())


@contextmanager
def _opened(folder: Path) -> Iterator[int]:
    """The descriptor of a folder. Raises OSError for one that somebody else can write to."""
    directory = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        _judge(os.fstat(directory))
        yield directory
    finally:
        os.close(directory)


def _file(name: str, directory: int) -> int:
    """The descriptor of a file in a folder. Raises OSError for one that somebody else can write to."""
    file = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, dir_fd=directory)
    try:
        _judge(os.fstat(file))
    except OSError:
        os.close(file)
        raise
    return file


def _judge(status: os.stat_result) -> None:
    plain = S_ISDIR(status.st_mode) or S_ISREG(status.st_mode)
    if not plain or status.st_uid not in (os.geteuid(), 0) or status.st_mode & (S_IWGRP | S_IWOTH):
        raise PermissionError("somebody else can write to it")


def _digest(name: str, data: bytes) -> bytes:
    return sha256(name.encode() + b"\0" + data).digest()


def _replace(directory: int, name: str, data: bytes) -> None:
    """Let a file of the folder hold this, all of it or nothing."""
    temporary = f".{os.urandom(8).hex()}.new"
    try:  # from before there is a file: who is interrupted leaves none behind
        file = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600, dir_fd=directory)
        with open(file, "wb") as output:
            output.write(data)
        os.replace(temporary, name, src_dir_fd=directory, dst_dir_fd=directory)
    except BaseException:
        with suppress(OSError):
            os.unlink(temporary, dir_fd=directory)
        raise


def _make_room(directory: int) -> int:
    """Take away what was not used for longest, if there is more than `MAX_BYTES`, until there is room for what is kept
    until the next look. Gives how many bytes are left."""
    files = []
    with os.scandir(directory) as entries:
        for entry in entries:
            with suppress(FileNotFoundError):  # another process takes away as well
                status = entry.stat(follow_symlinks=False)
                files.append((status.st_mtime, status.st_size, entry.name))
    total = sum(size for _, size, _ in files)
    if total <= MAX_BYTES:
        return total
    left, room = 0, MAX_BYTES - MAX_BYTES // UNSEEN
    for _, size, name in sorted(files, reverse=True):
        room -= size
        if room >= 0:
            left += size
        else:
            with suppress(OSError):
                os.unlink(name, dir_fd=directory)
    return left
