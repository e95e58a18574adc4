"""The gallery: the scenarios that come with sleepcast, by name, and scenarios anywhere else, by path."""

from __future__ import annotations

from pathlib import Path

from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.simulator.scenario.scenario import FILE, Scenario, load
from sleepcast.simulator.scenario.world_settings import Changes

GALLERY = Path(__file__).resolve().parents[2] / "scenarios"
"""The folder of the gallery: one folder for each scenario."""


def scenario_names() -> list[str]:
    """The names of the scenarios in the gallery, sorted."""
    return sorted(file.parent.name for file in GALLERY.glob(f"*/{FILE}"))


def find_scenario(name: str, changes: Changes = Changes()) -> Scenario:  # noqa: B008  # frozen: nobody can change it
    """The scenario of the gallery called `name`, or the one in the folder or file at that path, with `changes`.

    Raises MisuseError if there is neither, and what `load` raises for what is wrong in it.
    """
    names = scenario_names()
    if name in names:
        return load(GALLERY / name, changes)
    path = Path(name)
    if path.exists():
        return load(path, changes)
    raise MisuseError(
        f'no scenario "{name}"{did_you_mean(name, names)}: wanted one of {", ".join(names)}, '
        f"or the path of a folder with a {FILE}"
    )
