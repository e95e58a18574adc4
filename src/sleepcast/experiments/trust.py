"""Programs in experiments: which files a plan would run, and whose they are.

A measure may be a function in Python, so a plan, or a folder of results, that names one is a program. Nothing that lies
in a folder tells whose it is: what was unpacked from an archive belongs to whoever unpacked it, and one changes into a
folder before looking at it. So a folder is somebody's own only once that person has said so. That is kept in the
person's own data, never in the folder, and only counts while nobody else may write there.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterable, Sequence
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from stat import S_IWOTH
from typing import NamedTuple

from sleepcast.core.errors import SleepcastError, printable
from sleepcast.core.extensions import extensions
from sleepcast.core.files import data_folder, open_file, replace_file
from sleepcast.experiments.measures import GROUP, MeasureError, measure_of_stop, own_function
from sleepcast.experiments.plan import Experiment

MAX_FOLDERS = 1_000
"""Folders of one person's own; the oldest ones are forgotten."""
MAX_BYTES = 4_100 * MAX_FOLDERS
"""Of the file that lists them: paths have up to 4,096 bytes."""


class TrustError(SleepcastError):
    """That a folder is somebody's own cannot be kept."""


class NamedFunction(NamedTuple):
    """A function in Python that an experiment names.

    function: as module.function.
    file: where Python would find it; None for a part of Python itself.
    roots: of the folders in which modules are looked for besides, those that lead there.
    around: the files of the packages around it, which are run before it.
    """

    function: str
    file: Path | None
    roots: tuple[Path, ...] = ()
    around: tuple[Path, ...] = ()

    @property
    def files(self) -> tuple[Path, ...]:
        """What is run of these folders."""
        return () if self.file is None or not self.roots else (*self.around, self.file)

    def sentence(self) -> str:
        """For a person."""
        return f"{self.function} of {'this Python' if self.file is None else self.file}"


def programs(experiment: Experiment, folders: Sequence[Path]) -> list[NamedFunction]:
    """What an experiment would run, each once; nothing is imported for that. Raises MeasureError for a condition that
    is none, and for a module that is nowhere.

    folders: where modules are looked for after the places of this Python.
    """
    until = [measure_of_stop(experiment.until)] if experiment.until else []
    return programs_of([*experiment.measures.values(), *until], folders)


def programs_of(texts: Iterable[str], folders: Sequence[Path]) -> list[NamedFunction]:
    """The same for measures. Raises MeasureError for a module that is nowhere."""
    added, named_functions = extensions(GROUP), dict[str, NamedFunction]()
    for text in texts:
        named = own_function(text)
        if named is not None and text.strip() not in added:
            name = ".".join(named)
            named_functions[name] = _program(name, named[0], folders)
    return list(named_functions.values())


def folder_of(scenario: str) -> Path | None:
    """The folder in which somebody's own scenario stands, where modules of its measures are looked for; None for one of
    the gallery."""
    place = Path(scenario)
    return place if place.is_dir() else place.parent if place.is_file() else None


def look_in(folders: Iterable[Path]) -> None:
    """Let Python find modules there, too, after all other places."""
    sys.path += [each for each in map(str, folders) if each not in sys.path]


def _program(function: str, module: str, folders: Sequence[Path]) -> NamedFunction:
    """Where a module is, found without importing anything, not even the packages around it."""
    first, *inside = module.split(".")
    spec = outer = _spec(first, [*sys.path, *map(str, folders)])
    around = list[Path]()
    for part in inside:
        around += [Path(spec.origin).resolve()] if spec and spec.has_location and spec.origin else []
        # by its last name alone: a package without a file of its own asks for the imported one around it
        spec = PathFinder.find_spec(part, list((spec and spec.submodule_search_locations) or ()))
    if outer is None or spec is None:
        where = "".join(f"in {folder}, " for folder in folders)
        raise MeasureError(printable(f"no module {module}: looked {where}and where this Python looks (sys.path)"))
    if not spec.has_location or spec.origin is None:
        return NamedFunction(function, None)
    # Where a link lies, not where it leads: that is where Python looks.
    leading = {Path(each).parent.resolve() for each in outer.submodule_search_locations or [outer.origin or ""]}
    roots = tuple(each for each in folders if each.resolve() in leading)
    return NamedFunction(function, Path(spec.origin).resolve(), roots, tuple(around))


def _spec(name: str, places: list[str]) -> ModuleSpec | None:
    """Of a module that is in no package."""
    for finder in sys.meta_path:
        if (spec := finder.find_spec(name, places if finder is PathFinder else None)) is not None:
            return spec
    return None


# ---- whose a folder is


def is_own(folder: Path, files: Iterable[Path] = ()) -> bool:
    """Whether a person has said that this folder is his own, and nobody else may write to it or to these files."""
    folder = folder.resolve()
    return str(folder) in _own_folders() and all(map(_only_ours, (folder, *files)))


def make_own(folder: Path) -> None:
    """Keep that this folder is the person's own. Raises TrustError."""
    place, path = _file(), str(folder.resolve())
    folders = [*(each for each in _own_folders() if each != path), path][-MAX_FOLDERS:]
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        replace_file(place, json.dumps(folders, indent=0).encode(), private=True)
    except OSError as error:
        raise TrustError(f"cannot keep that {folder} is your own: {place}: {error.strerror or error}") from error


def _file() -> Path:
    return data_folder() / "own-folders.json"


def _own_folders() -> list[str]:
    """Folders that are somebody's own; none if that cannot be read."""
    try:
        with open_file(_file()) as opened:
            stored = json.loads(opened.read(MAX_BYTES) or b"[]")
    except (OSError, ValueError, RecursionError):
        return []
    return [each for each in stored if isinstance(each, str)] if isinstance(stored, list) else []


def _only_ours(place: Path) -> bool:
    """Whether it is this user's or the system's, and not everybody may write to it."""
    try:
        status = os.stat(place)
    except OSError:
        return False
    ours = not hasattr(os, "geteuid") or status.st_uid in (os.geteuid(), 0)
    return ours and not status.st_mode & S_IWOTH
