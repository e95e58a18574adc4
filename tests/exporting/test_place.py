"""An export is there whole, or not at all, and replaces nothing that is not one."""

from __future__ import annotations

from pathlib import Path

import pytest

from sleepcast.core.errors import MisuseError
from sleepcast.exporting.place import written_whole

FILES = ("a.csv", "b.csv")


def make_folder(place: Path, text: str, *, force: bool = False) -> None:
    with written_whole(place, force=force, files=FILES) as new:
        new.mkdir()
        (new / "a.csv").write_text(text)
        assert new.name == place.name, "a bag is called like its folder"
        assert not place.exists() or force


def break_off(place: Path, error: BaseException, *, force: bool = False) -> None:
    with written_whole(place, force=force, files=FILES) as new:
        new.mkdir()
        (new / "a.csv").write_text("half")
        raise error


def come_late(place: Path) -> None:
    with written_whole(place, force=False, files=FILES) as new:
        new.mkdir()
        place.mkdir()
        (place / "a.csv").write_text("theirs")


def names(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


def test_a_folder_appears_at_the_end_and_leaves_nothing_beside_it(tmp_path: Path) -> None:
    make_folder(tmp_path / "out", "new")
    assert names(tmp_path) == ["out"]
    assert (tmp_path / "out" / "a.csv").read_text() == "new"


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt(), ValueError("bad")])
def test_whatever_goes_wrong_leaves_nothing(tmp_path: Path, error: BaseException) -> None:
    with pytest.raises(type(error)):
        break_off(tmp_path / "out", error)
    assert names(tmp_path) == []


def test_what_is_there_is_replaced_only_by_force_and_only_at_the_end(tmp_path: Path) -> None:
    place = tmp_path / "out"
    make_folder(place, "old")
    with pytest.raises(MisuseError, match="out already exists: choose another place with --out, or replace it"):
        make_folder(place, "new")
    with pytest.raises(KeyboardInterrupt):
        break_off(place, KeyboardInterrupt(), force=True)
    assert (place / "a.csv").read_text() == "old"
    make_folder(place, "new", force=True)
    assert (place / "a.csv").read_text() == "new"
    assert names(tmp_path) == ["out"]


def test_a_file_is_replaced_by_force(tmp_path: Path) -> None:
    place = tmp_path / "run.rrd"
    place.write_text("old")
    with written_whole(place, force=True, files=()) as new:
        new.write_text("new")
    assert (place.read_text(), names(tmp_path)) == ("new", ["run.rrd"])


def test_force_never_takes_a_folder_that_is_no_export(tmp_path: Path) -> None:
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "a.csv").write_text("an export")
    (tmp_path / "home" / "thesis.tex").write_text("years")
    with pytest.raises(MisuseError, match=r"home holds 'thesis\.tex', which is of no export, so it is not replaced"):
        make_folder(tmp_path / "home", "new", force=True)
    (tmp_path / "file").write_text("years")
    with pytest.raises(MisuseError, match="is not what an export makes"):
        make_folder(tmp_path / "file", "new", force=True)
    with (
        pytest.raises(MisuseError, match="is not what an export makes"),
        written_whole(tmp_path / "home", force=True, files=()),
    ):
        pass
    assert names(tmp_path / "home") == ["a.csv", "thesis.tex"]


def test_what_came_meanwhile_is_not_replaced(tmp_path: Path) -> None:
    place = tmp_path / "out"
    with pytest.raises(MisuseError, match="already exists"):
        come_late(place)
    assert (place / "a.csv").read_text() == "theirs"


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(MisuseError, match=r"there is no folder .*gone: make it"):
        make_folder(tmp_path / "gone" / "out", "new")


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    make_folder(tmp_path / "real", "old")
    (tmp_path / "link").symlink_to("real")
    with written_whole(tmp_path / "link", force=True, files=FILES) as new:
        new.mkdir()
        (new / "b.csv").write_text("new")
    assert (tmp_path / "link").is_symlink()
    assert names(tmp_path / "real") == ["b.csv"]
