"""Where a person's files lie, as each system has it."""

from __future__ import annotations

import sys
from pathlib import Path

import platformdirs
import pytest
from platformdirs.macos import MacOS
from platformdirs.unix import Unix

from sleepcast.core.files import cache_folder, config_folder, data_folder


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HOME", str(tmp_path))
    for name in ("XDG_DATA_HOME", "XDG_CONFIG_HOME", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path


def on(platform: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setattr(platformdirs, "PlatformDirs", MacOS if platform == "darwin" else Unix)


def test_on_linux(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    on("linux", monkeypatch)
    share, config, cache = (home / each / "sleepcast" for each in (".local/share", ".config", ".cache"))
    assert (data_folder(), config_folder(), cache_folder()) == (share, config, cache)
    for elsewhere in ("", str(home / "elsewhere"), "nowhere/whole"):
        monkeypatch.setenv("XDG_CACHE_HOME", elsewhere)
        assert cache_folder() == platformdirs.user_cache_path("sleepcast", appauthor=False)
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert cache_folder() == platformdirs.user_cache_path("sleepcast", appauthor=False)


def test_on_macos(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    on("darwin", monkeypatch)
    library = home / "Library"
    support = library / "Application Support" / "sleepcast"
    assert (data_folder(), config_folder(), cache_folder()) == (support, support, library / "Caches" / "sleepcast")


def test_keys_of_0_2_0_are_found_on_macos(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    on("darwin", monkeypatch)
    before = home / ".config" / "sleepcast"
    before.mkdir(parents=True)
    assert config_folder() == before
    monkeypatch.setenv("XDG_CONFIG_HOME", str(home / "other"))
    assert config_folder() == home / "other" / "sleepcast"


def test_folders_that_the_environment_names(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    on("linux", monkeypatch)
    for name in ("DATA", "CONFIG", "CACHE"):
        monkeypatch.setenv(f"XDG_{name}_HOME", str(home / name))
    assert [data_folder(), config_folder(), cache_folder()] == [
        home / name / "sleepcast" for name in ("DATA", "CONFIG", "CACHE")
    ]


@pytest.mark.parametrize("said", ["", "  ", "nearby", "~/mine", "/elsewhere/", "/else//where/.."])
def test_linux_folders_are_those_of_the_library(home: Path, monkeypatch: pytest.MonkeyPatch, said: str) -> None:
    on("linux", monkeypatch)
    for name in ("DATA", "CONFIG", "CACHE"):
        monkeypatch.setenv(f"XDG_{name}_HOME", said)
    theirs = Unix("sleepcast", appauthor=False)
    wanted = (theirs.user_data_path, theirs.user_config_path, theirs.user_cache_path)
    assert (data_folder(), config_folder(), cache_folder()) == wanted


def test_without_a_home_folder_the_library_is_asked(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    on("linux", monkeypatch)
    monkeypatch.setenv("HOME", "nearby")
    assert data_folder() == Unix("sleepcast", appauthor=False).user_data_path
