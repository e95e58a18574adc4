"""Where an export goes: a file or a folder that is there whole, or not at all.

It is written into a hidden folder beside its place and renamed at the end, so that Ctrl-C, a full disk or a bad
recording leaves nothing half written, and what was there before stays until the new one is complete.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp

from sleepcast.core.errors import MisuseError
from sleepcast.core.files import settle


@contextmanager
def written_whole(place: Path, *, force: bool, files: Collection[str]) -> Iterator[Path]:
    """Gives the path at which a file or folder is to be made, which `place` becomes when the block ends without an
    error.

    force: replace what is there, which must be a file, or a folder of nothing but `files`.

    Raises MisuseError if something is there that is not to be replaced; OSError if it cannot be written, and then
    everything is as it was.
    """
    target = Path(os.path.realpath(place))
    _check(place, target, force=force, files=files)
    folder = Path(mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    try:
        new = folder / target.name
        yield new
        _sync(new)
        if target.exists():
            _check(place, target, force=force, files=files)  # it may have come meanwhile
            _exchange(new, target, folder / "before")
        else:
            new.rename(target)
        settle(target.parent)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _check(place: Path, target: Path, *, force: bool, files: Collection[str]) -> None:
    if not target.parent.is_dir():
        raise MisuseError(f"there is no folder {place.parent}: make it, or choose another place with --out")
    if not target.exists():
        return
    if not force:
        raise MisuseError(f"{place} already exists: choose another place with --out, or replace it with --force")
    if bool(files) != target.is_dir() or not (target.is_dir() or target.is_file()):
        raise MisuseError(f"{place} is not what an export makes, so it is not replaced: choose another place")
    others = sorted(each.name for each in target.iterdir() if each.name not in files) if files else []
    if others:
        raise MisuseError(
            f"{place} holds {others[0]!r:.80}, which is of no export, so it is not replaced: choose another place"
        )


def _sync(new: Path) -> None:
    """See that all of it is on the disk."""
    for file in (new, *new.iterdir()) if new.is_dir() else (new,):
        if file.is_file():
            with file.open("rb") as opened:
                os.fsync(opened.fileno())


def _exchange(new: Path, target: Path, before: Path) -> None:
    """Let `target` be the new one. A folder cannot replace another one in one step, so the old one is put away first,
    and comes back if that fails."""
    target.rename(before)
    try:
        new.rename(target)
    except BaseException:
        before.rename(target)
        raise
