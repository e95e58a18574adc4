"""Extensions: what installed packages add to sleepcast, by entry points."""

from __future__ import annotations

from importlib.metadata import EntryPoint, PackageNotFoundError, distribution, entry_points

from sleepcast.core.errors import MisuseError


def extensions(group: str) -> dict[str, EntryPoint]:
    """The entry points of this group that installed packages have, by name, sorted."""
    return {each.name: each for each in sorted(entry_points(group=group), key=lambda each: each.name)}


def find_extension(group: str, name: str) -> EntryPoint | None:
    """The entry point of this group with this name, None if there is none. Those of sleepcast itself come first: no
    package can take the place of one, and they are found without looking at all packages."""
    try:
        own = distribution("sleepcast").entry_points.select(group=group, name=name)
    except PackageNotFoundError:  # only its source is there
        own = entry_points(group=group, name=name)
    return next(iter(own), None) or extensions(group).get(name)


def load_extension(found: EntryPoint, what: str) -> object:
    """What an entry point stands for. what: "robots", for the error. Raises MisuseError if it cannot be loaded."""
    try:
        return found.load()
    except Exception as error:  # a module that is imported may do anything
        raise MisuseError(f'{what} "{found.name}" cannot be loaded: {type(error).__name__}: {error}') from error
