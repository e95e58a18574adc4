"""Bridges to real bodies: `open_robot` finds the right one by its URI, and gives a `Robot` with an end."""

from __future__ import annotations

from math import inf
from types import TracebackType
from typing import Protocol, Self
from urllib.parse import parse_qs, urlsplit

from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.robot import Limits, Robot

SCHEMES = {"nomad": "nomad://127.0.0.1:7019#1"}
"""Families of robots with an example of a URI for each."""

SETTINGS = {"type": "scout", "speed": "inf", "turn_rate": "inf"}
"""What can be set of a Nomad in its URI, and what holds otherwise."""
UNLIMITED = Limits(inf, inf, inf)


class BodyError(MisuseError):
    """A URI that leads to no body."""


class RealRobot(Robot, Protocol):
    """A body outside of this process: a `Robot` that is let go at the end, and comes to rest before that.

    `sense` raises SleepcastError when the body can no longer be reached, and will not be.
    """

    @property
    def lost(self) -> str:
        """Why the body cannot be reached now, "" while it can."""

    def now(self) -> float:
        """The time of the last reading: in step, a body is its mind's clock."""

    def complaints(self) -> list[str]:
        """What has gone wrong since the last call, in sentences, without anything being lost by it."""

    def close(self) -> None:
        """Bring the body to rest and let go of it."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


def open_robot(uri: str, *, in_step: bool = False, limits: Limits = UNLIMITED) -> RealRobot:
    """Connect to a body, which then keeps these limits as well as its own.

    uri: `nomad://HOST:PORT#ROBOT` for a Scout behind a Nserver; if wanted, of another type, or with lower limits of
    speed (m/s) and turn rate (rad/s): `nomad://HOST:PORT?type=nomad200&speed=0.3&turn_rate=1#ROBOT`. in_step: every
    `sense` waits for the body's next tick, and nothing happens between two of them (for a simulation whose time waits
    for its programs). Raises BodyError for a URI that leads nowhere, SleepcastError if nobody is there.
    """
    scheme = uri.partition(":")[0]
    if scheme not in SCHEMES:
        known = ", ".join(SCHEMES.values())
        raise BodyError(f"{uri!r:.100} names no body{did_you_mean(scheme, SCHEMES)}; wanted something like {known}")
    wanted = f"wanted something like {SCHEMES[scheme]}"
    try:
        parts = urlsplit(uri)
        port = parts.port
    except ValueError as error:
        raise BodyError(f"{uri!r:.100} leads nowhere ({error}); {wanted}") from None
    if parts.path not in ("", "/") or not parts.hostname:
        raise BodyError(f"{uri!r:.100} has no host, or more than one; {wanted}")
    from sleepcast.bridges.nomad import BASES, PORT, open_nomad  # each family may need libraries of its own

    settings = _settings(uri, parts.query)
    base = BASES.get(settings["type"])
    if base is None:
        raise BodyError(f"{uri!r:.100}: there is no type {settings['type']!r:.40}; there are {', '.join(BASES)}")
    said = Limits(_limit(uri, settings, "speed"), _limit(uri, settings, "turn_rate"), inf)
    limited = base.limited(said.within(limits))
    robot = _number(uri, parts.fragment or "1")
    return open_nomad(parts.hostname, PORT if port is None else port, robot, limited, in_step=in_step)


def _number(uri: str, text: str) -> int:
    if not text.isascii() or not text.isdigit() or not 1 <= int(text[:6]) < 100_000 or len(text) > 5:
        raise BodyError(f"{uri!r:.100}: robots are numbered from 1, so #{text:.20} is none; for example #1")
    return int(text)


def _settings(uri: str, query: str) -> dict[str, str]:
    """What a URI sets behind its question mark."""
    found = dict(SETTINGS)
    for key, (text, *_) in parse_qs(query, keep_blank_values=True).items():
        if key not in SETTINGS:
            known = f"{did_you_mean(key, SETTINGS)}; there are {', '.join(SETTINGS)}"
            raise BodyError(f"{uri!r:.100}: there is no setting {key!r:.40}{known}")
        found[key] = text
    return found


def _limit(uri: str, settings: dict[str, str], key: str) -> float:
    try:
        number = float(settings[key])
    except ValueError:
        number = 0.0
    if not number > 0.0:
        raise BodyError(f"{uri!r:.100}: {key} is a number above 0, in m/s or rad/s, not {settings[key]!r:.40}")
    return number
