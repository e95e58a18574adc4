"""The state of the git repository around a folder, told without doing what the repository says.

A repository's own configuration can name programs (fsmonitor, filters, hooks, drivers for differences), and a folder
may come from anybody. So git never reads it: HEAD is read here, and git is asked about changed files in a folder of
settings of our own, with the repository's index and objects, no other configuration, and no look into submodules.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

MAX_BYTES = 4_096
"""Of HEAD, of a reference, and of what leads to the repository."""
MAX_PACKED = 16 * 1024 * 1024
"""Bytes of all packed references: a hundred thousand of them."""
PATIENCE = 10.0
"""Seconds that git may take."""
_HASH = re.compile(r"[0-9a-f]{40}(?:[0-9a-f]{24})?")
_REFERENCE = re.compile(r"ref: (refs/(?:[\w.+@=,#%-]+/)*[\w.+@=,#%-]+)")


def git_state(folder: Path) -> str | None:
    """The commit of the repository around a folder, with "+" if a file of it is changed, with "?" if that could not be
    found out; None where there is no repository, or no commit in it."""
    for root in (folder, *folder.parents):
        place = _repository(root / ".git")
        if place is not None:
            commit = _head(place)
            return None if commit is None else commit + _changed(root, place, commit)
    return None


def _repository(git: Path) -> Path | None:
    """The folder of a repository: `.git`, or where a file of this name leads."""
    if git.is_dir():
        return git
    text = _read(git)
    if text is None or not text.startswith("gitdir: "):
        return None
    place = git.parent / text.removeprefix("gitdir: ").strip()
    return place if place.is_dir() else None


def _head(git: Path) -> str | None:
    text = (_read(git / "HEAD") or "").strip()
    if _HASH.fullmatch(text):
        return text
    reference = _REFERENCE.fullmatch(text)
    if reference is None or ".." in reference[1]:
        return None
    for place in (git, _common(git)):  # that of a work tree has its own HEAD, and shares the rest
        commit = (_read(place / reference[1]) or "").strip()
        if _HASH.fullmatch(commit):
            return commit
    for line in (_read(_common(git) / "packed-refs", MAX_PACKED) or "").splitlines():
        commit, _, name = line.partition(" ")
        if name == reference[1] and _HASH.fullmatch(commit):
            return commit
    return None


def _common(git: Path) -> Path:
    """What a work tree shares with the others of its repository."""
    text = _read(git / "commondir")
    return git if text is None else git / text.strip()


def _changed(root: Path, git: Path, commit: str) -> str:
    """Whether files differ from a commit: "" for none, "+", or "?"."""
    program = shutil.which("git")
    if program is None or Path(program).resolve().is_relative_to(root.resolve()):
        return "?"
    difference = ["diff", "--quiet", "--no-ext-diff", "--no-textconv", "--ignore-submodules=all", commit, "--"]
    with TemporaryDirectory(prefix="sleepcast-") as own:
        _settings(Path(own), commit)
        try:
            done = subprocess.run(
                [program, "--no-optional-locks", *difference],
                cwd=root,
                env=dict(_environment(Path(own), root, git)),
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=PATIENCE,
                check=False,
            )
        except (OSError, subprocess.SubprocessError):
            return "?"
    return {0: "", 1: "+"}.get(done.returncode, "?")


def _settings(own: Path, commit: str) -> None:
    """A repository without anything of its own, but for how long its hashes are."""
    (own / "HEAD").write_text(f"{commit}\n", encoding="ascii")
    (own / "refs").mkdir()
    version, kind = (0, "") if len(commit) == 40 else (1, "[extensions]\n\tobjectFormat = sha256\n")
    (own / "config").write_text(f"[core]\n\trepositoryformatversion = {version}\n{kind}", encoding="ascii")


def _environment(own: Path, root: Path, git: Path) -> Iterator[tuple[str, str]]:
    yield from ((name, value) for name, value in os.environ.items() if not name.startswith("GIT_"))
    yield "GIT_DIR", str(own)
    yield "GIT_WORK_TREE", str(root.resolve())
    yield "GIT_INDEX_FILE", str((git / "index").resolve())
    yield "GIT_OBJECT_DIRECTORY", str((_common(git) / "objects").resolve())
    yield "GIT_CONFIG_GLOBAL", os.devnull
    yield "GIT_CONFIG_NOSYSTEM", "1"
    yield "GIT_NO_REPLACE_OBJECTS", "1"


def _read(file: Path, most: int = MAX_BYTES) -> str | None:
    """A small text; None where there is none, or a longer one."""
    try:
        if not file.is_file():
            return None
        with file.open("rb") as opened:
            data = opened.read(most + 1)
    except OSError:
        return None
    return data.decode("utf-8", "replace") if len(data) <= most else None
