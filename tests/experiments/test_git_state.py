"""The state of a repository is told, and nothing is done that it says."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path

import pytest

from sleepcast.experiments.git_state import git_state

PROGRAMS = ("core.fsmonitor", "filter.loud.clean", "filter.loud.process", "diff.loud.command", "diff.loud.textconv")
"""Settings of a repository by which git runs programs while it looks for changes."""


def git(folder: Path, *arguments: str) -> str:
    who = ("-c", "user.name=somebody", "-c", "user.email=somebody@example.org", "-c", "commit.gpgsign=false")
    done = subprocess.run(["git", *who, *arguments], cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout.strip()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A repository with one commit."""
    place = tmp_path / "repository"
    place.mkdir()
    git(place, "init", "-q", "-b", "main")
    (place / "file").write_text("one\n")
    git(place, "add", ".")
    git(place, "commit", "-q", "-m", "one")
    return place


def test_a_commit_and_whether_files_differ(folder: Path) -> None:
    commit = git(folder, "rev-parse", "HEAD")
    (folder / "deep" / "down").mkdir(parents=True)
    assert git_state(folder) == git_state(folder / "deep" / "down") == commit
    (folder / "untracked").touch()
    assert git_state(folder) == commit
    (folder / "file").write_text("two\n")
    assert git_state(folder) == f"{commit}+"
    git(folder, "add", ".")
    assert git_state(folder) == f"{commit}+"


@pytest.mark.parametrize("how", ["packed", "detached", "work tree"])
def test_wherever_git_keeps_it(folder: Path, how: str) -> None:
    commit = git(folder, "rev-parse", "HEAD")
    if how == "packed":
        git(folder, "pack-refs", "--all")
        assert not (folder / ".git" / "refs" / "heads" / "main").exists()
    elif how == "detached":
        git(folder, "checkout", "-q", "--detach")
    else:
        git(folder, "worktree", "add", "-q", "-b", "other", "../beside")
        folder = folder.parent / "beside"
    assert git_state(folder) == commit
    (folder / "file").write_text("two\n")
    assert git_state(folder) == f"{commit}+"


@pytest.mark.parametrize("setting", PROGRAMS)
def test_programs_that_a_repository_names_are_not_run(folder: Path, tmp_path: Path, setting: str) -> None:
    mark = tmp_path / "ran"
    (folder / ".gitattributes").write_text("file filter=loud diff=loud\n")
    git(folder, "add", ".")
    git(folder, "commit", "-q", "-m", "two")
    commit = git(folder, "rev-parse", "HEAD")
    git(folder, "config", setting, f"touch {mark}; cat")
    (tmp_path / "more").write_text(f'[core]\n\tfsmonitor = "touch {mark}; false"\n')
    git(folder, "config", "include.path", str(tmp_path / "more"))
    time.sleep(0.01)
    (folder / "file").touch()  # so that git has to look into it
    assert git_state(folder) == commit
    (folder / "file").write_text("two\n")
    assert git_state(folder) == f"{commit}+"
    assert not mark.exists()


def test_nor_those_of_a_repository_inside(folder: Path, tmp_path: Path) -> None:
    inside = folder / "inside"
    inside.mkdir()
    git(inside, "init", "-q")
    git(inside, "commit", "-q", "--allow-empty", "-m", "inside")
    git(folder, "add", ".")
    git(folder, "commit", "-q", "-m", "two")
    git(inside, "config", "core.fsmonitor", f"touch {tmp_path / 'ran'}; false")
    assert git_state(folder) == git(folder, "rev-parse", "HEAD")
    assert not (tmp_path / "ran").exists()


def test_what_is_no_repository_has_no_state(tmp_path: Path) -> None:
    assert git_state(tmp_path) is None
    git(tmp_path, "init", "-q")
    assert git_state(tmp_path) is None  # without a commit


@pytest.mark.parametrize(
    "head", ["", "ref: ../../secret", "ref: refs/../../secret", "ref: refs/heads/main\nmore", "x" * 10_000, "\xff\xfe"]
)
def test_a_head_that_leads_elsewhere_is_none(folder: Path, head: str) -> None:
    (folder.parent / "secret").write_text("0" * 40)
    (folder / ".git" / "HEAD").write_text(head, encoding="latin-1")
    assert git_state(folder) is None


def test_what_cannot_be_found_out_is_said(folder: Path) -> None:
    commit = git(folder, "rev-parse", "HEAD")
    (folder / ".git" / "index").write_bytes(b"no index")
    assert git_state(folder) == f"{commit}?"
