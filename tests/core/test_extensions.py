"""What packages add: found by their metadata, imported when it is asked for, and named when it is wrong."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from packages import install
from sleepcast.core.errors import MisuseError
from sleepcast.core.extensions import BUILT_IN, COMMANDS, OWN, Extension, extensions, find_extension, load_extension

ROOT = Path(__file__).resolve().parents[2]


def test_the_table_is_that_of_the_installation() -> None:
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["entry-points"]
    assert declared == BUILT_IN


@pytest.mark.parametrize(("group", "name"), [(group, name) for group, names in BUILT_IN.items() for name in names])
def test_what_the_table_names_is_there(group: str, name: str) -> None:
    extension = find_extension(group, name)
    assert extension is not None
    assert extension.package == OWN
    load_extension(extension, group)


def test_sleepcast_s_own_are_there_without_metadata() -> None:
    """From its source alone, and without a look at what is installed."""
    found = "from sleepcast.core.extensions import *; print(*extensions(BODIES), *extensions(COMMANDS))"
    alone = [sys.executable, "-S", "-c", f"import sys; sys.path.append({str(ROOT / 'src')!r}); {found}"]
    said = subprocess.run(alone, capture_output=True, text=True, check=True).stdout.split()
    assert said == ["crazyflie", "mavlink", "nomad", "ros2", "sim", "nserver"]


def test_a_package_adds_by_its_metadata_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(
        tmp_path, monkeypatch, "lawn-bots", "[sleepcast.commands]\nmow = idle:mower.mow\n", idle="class mower: mow = 7"
    )
    assert extensions(COMMANDS)["mow"] == Extension("mow", "idle:mower.mow", "lawn-bots")
    assert "idle" not in sys.modules, "to list is not to import"
    added = find_extension(COMMANDS, "mow")
    assert added is not None
    assert load_extension(added, "command") == 7


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("1 / 0", "ZeroDivisionError: division by zero"),
        ("import no_such_module", "ModuleNotFoundError: No module named 'no_such_module'"),
        ("raise SystemExit(3)", "SystemExit: 3"),
        ("", "AttributeError: module 'lawn' has no attribute 'mow'"),
        ("def", "SyntaxError: "),
        ("from asyncio import CancelledError\nraise CancelledError", "CancelledError: "),
    ],
)
def test_what_cannot_be_loaded_is_named_with_its_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, why: str
) -> None:
    install(tmp_path, monkeypatch, "lawn-bots", "[sleepcast.commands]\nmow = lawn:mow\n", lawn=text)
    monkeypatch.delitem(sys.modules, "lawn", raising=False)
    with pytest.raises(MisuseError) as error:
        load_extension(extensions(COMMANDS)["mow"], "command")
    assert str(error.value).startswith(f'command "mow" of the package lawn-bots cannot be loaded: {why}')


def test_who_waits_no_longer_for_an_import_ends_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(
        tmp_path,
        monkeypatch,
        "lawn-bots",
        "[sleepcast.commands]\nmow = endless:mow\n",
        endless="raise KeyboardInterrupt",
    )
    with pytest.raises(KeyboardInterrupt):
        load_extension(extensions(COMMANDS)["mow"], "command")


@pytest.mark.parametrize(
    ("metadata", "entries"),
    [
        (None, b"[sleepcast.commands]\nghost = ghost:x\n"),
        (b"Metadata-Version: 2.1\n", b"[sleepcast.commands]\nghost = ghost:x\n"),
        (b"Name: ghost\nVersion: 1\n", b"[sleepcast.commands]\nghost\n"),
        (b"Name: ghost\nVersion: 1\n", b"[sleepcast.commands]\ngh\xff = ghost:x\n"),
    ],
    ids=["no metadata", "no name", "no value", "no text"],
)
def test_a_damaged_package_keeps_no_other_from_adding(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, metadata: bytes | None, entries: bytes
) -> None:
    install(tmp_path / "whole", monkeypatch, "lawn-bots", "[sleepcast.commands]\nmow = lawn:mow\n")
    about = tmp_path / "damaged" / "ghost-1.dist-info"
    about.mkdir(parents=True)
    (about / "entry_points.txt").write_bytes(entries)
    if metadata is not None:
        (about / "METADATA").write_bytes(metadata)
    monkeypatch.syspath_prepend(about.parent)
    listed = extensions(COMMANDS)
    assert listed["mow"].about == "Of the package lawn-bots."
    assert "ghost" not in listed


def test_a_name_that_two_packages_add_is_told_with_both(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for package in ("lawn-bots", "grass"):
        install(tmp_path / package, monkeypatch, package, "[sleepcast.commands]\nmow = lawn:mow\n")
    both = extensions(COMMANDS)["mow"]
    assert both.about == "Of the packages grass and lawn-bots."
    with pytest.raises(MisuseError, match='command "mow" is added by grass and lawn-bots: uninstall all but one'):
        load_extension(both, "command")


def test_nobody_takes_the_place_of_sleepcast_s_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, monkeypatch, "grass", "[sleepcast.commands]\nnserver = lawn:mow\n")
    assert extensions(COMMANDS)["nserver"] == find_extension(COMMANDS, "nserver")
    assert extensions(COMMANDS)["nserver"].package == OWN


def test_a_group_is_found_wherever_importlib_finds_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The look at the metadata that saves an import misses nothing: here, packages in an archive."""
    from zipfile import ZipFile

    with ZipFile(tmp_path / "lawn.zip", "w") as archive:
        archive.writestr("lawn-1.0.dist-info/METADATA", "Metadata-Version: 2.1\nName: lawn\nVersion: 1.0\n")
        archive.writestr("lawn-1.0.dist-info/entry_points.txt", "[sleepcast.commands]\nmow = lawn:mow\n")
    monkeypatch.syspath_prepend(tmp_path / "lawn.zip")
    assert [each.name for each in entry_points(group=COMMANDS) if each.name == "mow"] == ["mow"]
    assert extensions(COMMANDS)["mow"].package == "lawn"
