"""Where a person's files lie, and files that are replaced as a whole or left as they were, whatever happens."""

from __future__ import annotations

import os
import sys
from io import FileIO
from pathlib import Path
from stat import S_ISDIR, S_ISREG

NAME = "sleepcast"


def data_folder() -> Path:
    """Where sleepcast keeps a person's own data, by the custom of the system."""
    return _folder("data", ".local/share")


def config_folder() -> Path:
    """Where sleepcast keeps a person's settings and keys, by the custom of the system; on macOS where 0.2.0 has put
    them, if they are there."""
    before = Path.home() / ".config" / NAME
    if sys.platform == "darwin" and not os.environ.get("XDG_CONFIG_HOME") and before.is_dir():
        return before
    return _folder("config", ".config")


def cache_folder() -> Path:
    """Where sleepcast keeps what it can make again, by the custom of the system."""
    return _folder("cache", ".cache")


def _folder(kind: str, usual: str) -> Path:
    """A person's folder of this kind, usually this one in the home folder of a Linux system."""
    home, said = os.environ.get("HOME", ""), os.environ.get(f"XDG_{kind.upper()}_HOME", "")
    if sys.platform == "linux" and os.path.isabs(home) and "ANDROID_DATA" not in os.environ:
        # As the library says, which takes longer to load than a desk needs for all keys and settings.
        return Path(said if os.path.isabs(said) else f"{home}/{usual}", NAME)
    import platformdirs

    folder: Path = getattr(platformdirs, f"user_{kind}_path")(NAME, appauthor=False)
    return folder


def open_file(file: Path) -> FileIO:
    """Open a file to read. Raises OSError, also for a pipe, where opening would wait for somebody who writes, and for
    what else can be read only once or has no end."""
    mode = file.stat().st_mode
    if not (S_ISREG(mode) or S_ISDIR(mode)):  # a folder has a reason of its own
        raise OSError(None, "that is no file")
    return FileIO(file)


def replace_file(file: Path, data: bytes, *, private: bool = False) -> None:
    """Let `file` hold `data`, and see that it does so after a loss of power as well. A link stays a link.

    private: nobody else on this machine may read it. Raises OSError, and then the file is as it was.
    """
    target = Path(os.path.realpath(file))
    if target.exists() and not target.is_file():
        raise OSError(None, "that is no file")
    temporary = target.with_name(f".{target.name}.{os.getpid()}.new")
    opener = (lambda path, flags: os.open(path, flags, 0o600)) if private else None
    try:
        with open(temporary, "xb", opener=opener) as output:
            output.write(data)
            output.flush()
            os.fsync(output.fileno())
        os.replace(temporary, target)
        settle(target.parent)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def lock_file(file: Path) -> int | None:
    """Keep other processes from locking `file`, which is made if it is missing, until the descriptor is closed or this
    process ends; None where the system or the file system knows no locks. Raises BlockingIOError if another process
    has locked it, OSError if it cannot be made."""
    try:
        import fcntl
    except ImportError:
        return None
    descriptor = os.open(file, os.O_RDWR | os.O_CREAT, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise
    except OSError:
        os.close(descriptor)
        return None
    return descriptor


def settle(folder: Path) -> None:
    """See that the folder's new entry outlives a loss of power, on systems where that can be asked for."""
    if os.name == "posix":
        opened = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(opened)
        finally:
            os.close(opened)
