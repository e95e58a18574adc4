"""Obstacles of a Nomads' world, changed from the page, undone and done again."""

from __future__ import annotations

from pathlib import Path

import pytest

from sleepcast.core.clock import ManualClock
from sleepcast.core.errors import MisuseError
from sleepcast.nomad import Nserver, ServerPace, Windows
from sleepcast.nomad.panes.adapter import NomadsAdapter
from sleepcast.nomad.panes.editor import LOOK_AGAIN, NomadEditor
from sleepcast.nomad.world.building import nomad_world

SQUARE = ((1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0))
OTHER = tuple((x - 4.0, y) for x, y in SQUARE)


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def nomads(clock: ManualClock) -> NomadsAdapter:
    """A robot in an empty room."""
    world = nomad_world()
    server = Nserver(world, windows=Windows(1))
    return NomadsAdapter(server, ServerPace(clock, 1.0), "a room", world.area)


@pytest.fixture
def editor(nomads: NomadsAdapter, clock: ManualClock) -> NomadEditor:
    return NomadEditor(nomads, clock)


def places(editor: NomadEditor) -> list[tuple[float, float]]:
    """The least corner of each obstacle."""
    return sorted((round(min(x for x, _ in each), 3), round(min(y for _, y in each), 3)) for each in editor.outlines())


def test_a_thing_is_built_moved_and_cleared_and_each_is_undone(editor: NomadEditor) -> None:
    begun = editor.version
    built = editor.build(SQUARE)
    assert places(editor) == [(1.0, 1.0)]
    assert editor.version == begun + 1
    moved = editor.shift(editor.version, 0, 2.0, -0.5)
    assert places(editor) == [(3.0, 0.5)]
    assert moved.obstacle == built.obstacle
    cleared = editor.clear(editor.version, 0)
    assert places(editor) == []
    for change, then in ((cleared, [(3.0, 0.5)]), (moved, [(1.0, 1.0)]), (built, [])):
        editor.undo(change.change, again=False)
        assert places(editor) == then
    for change, then in ((built, [(1.0, 1.0)]), (moved, [(3.0, 0.5)]), (cleared, [])):
        editor.undo(change.change, again=True)
        assert places(editor) == then


def test_nothing_is_changed_by_mistake(editor: NomadEditor, nomads: NomadsAdapter, clock: ManualClock) -> None:
    built = editor.build(SQUARE)
    editor.outlines()
    seen = editor.version
    assert nomads.add(OTHER)  # a program's
    clock.advance(LOOK_AGAIN)
    editor.outlines()
    for version, place in ((seen, 0), (editor.version, 2), (editor.version, -1)):
        with pytest.raises(MisuseError, match="have changed meanwhile"):
            editor.clear(version, place)
    with pytest.raises(MisuseError, match="encloses nothing"):
        editor.build([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)])
    with pytest.raises(MisuseError, match="too far away"):
        editor.build([(0.0, 0.0), (1e6, 0.0), (2.0, 4.0)])
    with pytest.raises(MisuseError, match="Only the last"):
        editor.undo(built.change + 1, again=False)
    nomads.remove(SQUARE)  # a program's, too
    with pytest.raises(MisuseError, match=f"Obstacle {built.obstacle} has been changed"):
        editor.undo(built.change, again=False)
    clock.advance(LOOK_AGAIN)
    assert places(editor) == [(-3.0, 1.0)]


def test_a_file_replaces_all(editor: NomadEditor, nomads: NomadsAdapter, tmp_path: Path) -> None:
    editor.build(SQUARE)
    written = nomads.written()
    editor.build(OTHER)
    editor.load("world.txt", written)
    assert places(editor) == [(1.0, 1.0)]
