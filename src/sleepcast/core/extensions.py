"""Extensions: what packages add to sleepcast by entry points, its own bodies, transports and plug-ins among them.

What sleepcast itself adds is a table here, the twin of that in `pyproject.toml`, so that it is there without being
installed, too. What others add is told by the metadata of installed packages, and by nothing else: neither a scenario
nor a message can have code loaded. To list a group imports nothing; an extension is imported when it is asked for.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from contextlib import suppress
from importlib import import_module
from typing import TYPE_CHECKING

from sleepcast.core.errors import MisuseError
from sleepcast.core.records import dataclass

if TYPE_CHECKING:
    from importlib.metadata import Distribution, EntryPoint

BODIES, TRANSPORTS = "sleepcast.bodies", "sleepcast.transports"
COMMANDS, PAGES = "sleepcast.commands", "sleepcast.pages"
OWN = "sleepcast"
"""The package whose extensions are the table below."""
BUILT_IN: dict[str, dict[str, str]] = {
    BODIES: {
        "crazyflie": "sleepcast.bridges.crazyflie.quadcopter:open_body",
        "mavlink": "sleepcast.bridges.mavlink.opening:open_body",
        "nomad": "sleepcast.nomad.bridge.model:open_body",
        "ros2": "sleepcast.bridges.ros2.robot:open_body",
        "sim": "sleepcast.cli.simulated_body:open_body",
    },
    COMMANDS: {"nserver": "sleepcast.nomad.command.nserver:nserver"},
    PAGES: {"nomads": "sleepcast.nomad.panes.serving:PAGE"},
    TRANSPORTS: {
        "memory": "sleepcast.channel.transports.memory:MemoryTransport",
        "udp": "sleepcast.channel.transports.udp:open_udp",
        "zenoh": "sleepcast.channel.transports.zenoh:open_zenoh",
    },
}
ABOUT = {"nserver": "Nomad server for Nclient programs."}
"""What commands of the table do, in the list of all commands."""
METADATA = (".dist-info", ".egg-info")
"""How the folders end in which installed packages tell what they add."""


@dataclass(frozen=True, slots=True)
class Extension:
    """Something that a package adds.

    name: by which people ask for it.
    value: what it is, as `module:name`; of a scenario, the package in whose folder it lies.
    package: that adds it.
    rivals: other packages that add something by this name.
    """

    name: str
    value: str
    package: str = OWN
    rivals: tuple[str, ...] = ()

    @property
    def about(self) -> str:
        """What it is, for a list, as far as that can be told without importing it."""
        if self.package == OWN:
            return ABOUT.get(self.name, "")
        return f"Of the package{'s' if self.rivals else ''} {' and '.join([self.package, *self.rivals])}."

    def refuse_rivals(self, what: str) -> None:
        """Raises MisuseError if other packages add something by this name. what: it is, such as "robots"."""
        if self.rivals:
            packages = " and ".join([self.package, *self.rivals])
            raise MisuseError(f'{what} "{self.name}" is added by {packages}: uninstall all but one of them')


def extensions(group: str) -> dict[str, Extension]:
    """All extensions of a group by name, sorted. Nobody takes the place of one of sleepcast's own."""
    own = {name: Extension(name, value) for name, value in BUILT_IN.get(group, {}).items()}
    return dict(sorted((_installed(group) | own).items()))


def find_extension(group: str, name: str) -> Extension | None:
    """The extension of a group with this name, None if there is none. Those of sleepcast itself are found without
    looking at any package."""
    value = BUILT_IN.get(group, {}).get(name)
    return _installed(group).get(name) if value is None else Extension(name, value)


def load_extension(extension: Extension, what: str) -> object:
    """What an extension stands for.

    extension: to be imported.
    what: it is, for errors, such as "robots".

    Raises MisuseError, with the package's name, if it cannot be loaded or two packages add it.
    """
    extension.refuse_rivals(what)
    module, _, names = extension.value.partition(":")
    try:
        loaded: object = import_module(module)
        for name in filter(None, names.split(".")):
            loaded = getattr(loaded, name)
    except KeyboardInterrupt:  # of a person who waits no longer for the import
        raise
    except BaseException as error:  # a module that is imported may do anything; one in Rust panics by no Exception
        raise MisuseError(
            f'{what} "{extension.name}" of the package {extension.package} cannot be loaded: '
            f"{type(error).__name__}: {error}"
        ) from error
    return loaded


def _installed(group: str) -> dict[str, Extension]:
    """What other packages add to a group, by name."""
    if not _anybody_adds(group):
        return {}
    added: dict[str, Extension] = {}
    for entry, package in _entries(group):
        before = added.get(entry.name)
        if before is None:
            added[entry.name] = Extension(entry.name, entry.value, package)
        elif package != before.package:
            added[entry.name] = Extension(entry.name, before.value, before.package, (*before.rivals, package))
    return {name: each for name, each in added.items() if each.package != OWN}


def _entries(group: str) -> Iterable[tuple[EntryPoint, str]]:
    """What packages add to a group, each with the package's name. One whose metadata is damaged, such as by an
    uninstall that was broken off, adds nothing, and keeps no other from adding: a page with its STOP opens all the
    same."""
    from importlib.metadata import distributions, entry_points  # importing it takes longer than everything else here

    entries: Iterable[EntryPoint]
    try:
        entries = entry_points(group=group)
    except Exception:  # what reads the metadata of all packages raises anything where that of one is damaged
        entries = [entry for package in distributions() for entry in _readable_entries(package, group)]
    for entry in entries:
        name: str | None = None
        with suppress(Exception):  # a package that has lost its name raises, or has none
            name = entry.dist.name if entry.dist is not None else "?"
        if name is not None:
            yield entry, name


def _readable_entries(package: Distribution, group: str) -> Iterable[EntryPoint]:
    try:
        return package.entry_points.select(group=group)
    except Exception:
        return ()


def _anybody_adds(group: str) -> bool:
    """Whether the metadata of any package but sleepcast names a group. Where a place in `sys.path` is no folder, such
    as an archive, that is for `importlib.metadata` to find out."""
    section = f"[{group}]".encode()
    for place in sys.path:
        try:
            names = os.listdir(place or ".")
        except NotADirectoryError:
            return True
        except OSError:
            continue
        for name in names:
            if name.endswith(METADATA) and not name.startswith(f"{OWN}-") and _names(place, name, section):
                return True
            if name.endswith(".egg"):
                return True
    return False


def _names(place: str, folder: str, section: bytes) -> bool:
    try:
        with open(os.path.join(place, folder, "entry_points.txt"), "rb") as file:
            return section in file.read()
    except OSError:
        return False
